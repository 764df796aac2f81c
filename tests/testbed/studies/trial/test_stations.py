"""The scene `stations`: recovery, stated regions, budget, and files that give the same numbers."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import binom, chi2

from calib.errors import InputError
from calib.geometry.frames import inverse
from calib.identification.identify import identify
from calib.identification.result import Identification
from calib.measurement.observations import COLUMNS
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.identify.calibrate import calibrate
from testbed.identify.session import row_names
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.robots.catalog import load_robot
from testbed.run.export import export_campaign, exported_rows
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.trial.compare import true_step
from testbed.studies.trial.report_rounds import round_tables
from tests import campaign

SMALL = {
    "pool.size": 60,
    "test.poses": 20,
    "uncertainty.repeats": 2,
    "uncertainty.replications": 4,
    "studies.random_sets": 2,
    "trial": [{"name": "designed", "poses": 14, "method": "detmax"}],
}
POSES = {
    "tracker.measures": "pose",
    "fixtures.reflectors_mm": {},
    "fixtures.ranged": [],
    "fixtures.free": ["P2"],
}
QUIET = {
    "tracker.range_um": [1e-3, 0.0],
    "tracker.transverse_um": [1e-3, 0.0],
    "tracker.centering_um": 0.0,
    "tracker.rotation_mdeg": [1e-3] * 3,
    "fixtures.distance_um": [1e-3, 0.0],
    "truth.joint_repeatability_mdeg": 0.0,
}


@cache
def played(poses=False):
    scenario = changed(load_scenario("stations"), SMALL | (POSES if poses else {}))
    return campaign.played(scenario)


def test_with_hardly_any_noise_everything_is_found_where_it_is():
    """What no gauge hides, in nanometres: tool points, reflectors among each other, P2."""
    scenario = changed(load_scenario("stations"), SMALL | QUIET)
    lab = open_laboratory(scenario, make_setting(scenario))
    setting, true = lab.setting, lab.setting.true
    found = identify(setting.nominal, lab.measure_pool(np.arange(60), "x"), lab.free("whitened"))
    c = np.array([60.0, 0.0, 90.0]) / 1e3
    T, model = setting.test_true, found.model
    mine = model.poses(setting.test_q)
    for k in range(3):  # reflectors A, B, C in the world
        one, other = (
            c if k == 0 else fixtures.reflectors[k - 1]
            for fixtures in (model.fixtures, true.fixtures)
        )
        missed = mine[:, :3, :3] @ one + mine[:, :3, 3] - (T[:, :3, :3] @ other + T[:, :3, 3])
        assert np.abs(missed).max() < 5e-9
    np.testing.assert_allclose(model.fixtures.anchors, true.fixtures.anchors, rtol=0, atol=5e-9)
    off = inverse(model.fixtures.stations[0]) @ true.fixtures.stations[0] - np.eye(4)
    assert np.abs(off).max() < 5e-9
    # nominal places are off by half a millimetre
    assert np.abs(setting.nominal.fixtures.anchors - true.fixtures.anchors).max() > 1e-4


def shares(count):
    """Share of replications whose region of all parameters holds the truth, and numbers found."""
    run = played()
    lab = open_laboratory(run.scenario, run.setting)
    first: Identification = run.trials[0].estimates[0].identification
    truth = true_step(run.setting, first, run.trials[0].measurements)
    inside = 0
    for k in range(count):
        seen = lab.measure_pool(run.trials[0].selection.indices, "region", repeat=k)
        found = identify(run.setting.nominal, seen, first.parameters)
        e = found.step - truth
        inside += e @ np.linalg.solve(found.covariance, e) <= chi2.ppf(0.95, len(e))
    return inside / count, len(truth)


def test_the_region_of_all_parameters_holds_the_truth_as_often_as_it_says():
    count = 40
    share, numbers = shares(count)
    low, high = binom.ppf([0.0005, 0.9995], count, 0.95) / count
    assert low <= share <= high
    # 30 of the arm and its frames, three reflectors' 3 distances, 6 of a station, 3 of P2
    assert numbers == 30 + 3 + 6 + 3


@pytest.mark.study
def test_the_region_of_all_parameters_holds_94_to_96_percent():
    share, _ = shares(4000)  # 0.34 % is one standard deviation
    assert 0.94 <= share <= 0.96


def test_the_budget_adds_up_to_what_is_stated():
    for poses in (False, True):
        run = played(poses)
        estimate = run.trials[0].estimates[0]
        sources = dict(zip(estimate.statement.sources, estimate.statement.source_u, strict=True))
        assert set(sources) == {"tracker noise", "joint repeatability"}
        # stated by J C J', the sources by F Sigma F' row by row
        assert np.sqrt(sum(u**2 for u in sources.values())) == pytest.approx(
            estimate.comparison.stated_u, rel=1e-6
        )


def test_a_designed_set_sees_every_fixture():
    run = played()
    table = run.trials[0].measurements
    assert set(table.station) == {0, 1}
    assert set(table.reflector) == {-1, 0, 1}
    assert set(table.anchor) == {-1, 0, 1}
    assert table.n_poses == 14


@pytest.mark.parametrize("poses", [False, True])
def test_files_are_read_bit_for_bit_and_identify_finds_the_same_numbers(tmp_path, poses):
    run, robot = played(poses), load_robot("staubli_tx60")
    export_campaign(run, robot, tmp_path / "out")
    session = read_session(tmp_path / "out", robot)
    bench = open_laboratory(run.scenario, run.setting)
    table, is_test, _ = exported_rows(bench, run.trials[0])
    # the files have what the tracker saw first, then the distances
    order = np.argsort(table.is_distance, kind="stable")
    table, is_test = table.rows(order), is_test[order]
    for name in COLUMNS:
        written, read = getattr(table, name), getattr(session.measurements, name)
        if name == "covariance":
            written, read = np.tril(written), np.tril(read)
        np.testing.assert_array_equal(written, read, err_msg=name)
    np.testing.assert_array_equal(session.is_test, is_test)
    probe(robot, session).raise_if_wrong()
    found = calibrate(robot, session)
    own = run.trials[0].estimates[0].identification
    mine = found.fits[0].identification
    assert not found.gross.left_out.any()
    np.testing.assert_array_equal(mine.step, own.step)
    np.testing.assert_array_equal(mine.covariance, own.covariance)
    np.testing.assert_array_equal(mine.model.fixtures.stations, own.model.fixtures.stations)
    assert mine.names == own.names


def test_where_to_begin_is_a_help_and_no_more(tmp_path, monkeypatch):
    """Metres off, or not taken at all: the same answer; unknown names are refused."""
    run, robot = played(), load_robot("staubli_tx60")
    export_campaign(run, robot, tmp_path / "out")
    file = tmp_path / "out" / "session.toml"
    text = file.read_text()
    own = run.trials[0].estimates[0].identification
    file.write_text(text.replace("[2200.0, 2400.0, 600.0]", "[-2200.0, -2400.0, 600.0]"))
    far = calibrate(robot, read_session(tmp_path / "out", robot))
    assert "fixtures from [start]" in far.frames[0]
    monkeypatch.setattr("testbed.identify.frames.AS_GOOD", 0.0)
    nothing = calibrate(robot, read_session(tmp_path / "out", robot))
    assert "starting from nothing" in nothing.frames[0]
    for found in (far, nothing):
        mine = found.fits[0].identification
        assert mine.chi_square == pytest.approx(own.chi_square, rel=1e-6)
    file.write_text(text.replace("stations_mm = {", 'stations_mm = { "3" = [0.0, 0.0, 0.0], '))
    with pytest.raises(InputError, match=r'\[start\] stations_mm has "3"; free ones are 2'):
        read_session(tmp_path / "out", robot)


def test_a_row_is_called_by_all_that_tells_it_from_others(tmp_path):
    """Pose, target and station, or anchor: a wrong place of an anchor is not a wrong pose."""
    export_campaign(played(), load_robot("staubli_tx60"), tmp_path / "out")
    session = read_session(tmp_path / "out", load_robot("staubli_tx60"))
    names = row_names(session, session.measurements)
    pose = f"{session.pose_name(0)}, visit 1"
    first = {name for name in names if name.startswith(f"pose {pose},")}
    targets, stations = ("", ", target B", ", target C"), ("station 1", "station 2")
    optical = {f"pose {pose}{target}, {station}" for target in targets for station in stations}
    ranges = {f"pose {pose}, distance from {anchor}" for anchor in ("P1", "P2")}
    assert first <= optical | ranges
    assert first & ranges
    assert first & {name for name in optical if name.endswith("station 2")}


@pytest.mark.parametrize("table", ["points", "ranges"])
def test_a_reflector_has_one_place_whichever_table_states_it(tmp_path, table):
    run, robot = played(), load_robot("staubli_tx60")
    export_campaign(run, robot, tmp_path / "out")
    file = tmp_path / "out" / "session.toml"
    text, known = file.read_text(), '"A" = [60.0, 0.0, 90.0]'
    before, of_it, after = text.partition(f"[{table}]\n")
    rest = after.splitlines(keepends=True)
    assert known in rest[1]
    whole = read_session(tmp_path / "out", robot).measurements
    file.write_text(before + of_it + rest[0] + "".join(rest[2:]))  # said in the other one alone
    again = read_session(tmp_path / "out", robot).measurements
    for name in ("reflector", "offset"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    for other, told in (("[61.0, 0.0, 90.0]", r"at \(61, 0, 90\) mm"), ('"free"', "free")):
        file.write_text(before + of_it + after.replace(known, f'"A" = {other}', 1))
        with pytest.raises(InputError, match=rf'reflector "A" is .*{told}.*; state only one'):
            read_session(tmp_path / "out", robot)


def test_the_report_says_what_was_seen_from_where():
    run = played()
    (table,) = round_tables(run)
    seen = run.trials[0].measurements
    assert table.rows[0][:4] == ("station 1", "A", "point", "")
    assert table.rows[4][:4] == ("station 2", "B", "point", "B, station 2")
    assert table.rows[-1][:4] == ("P2", "A", "distance", "P2")
    # the counts by hand: three reflectors from two stations, then the two anchors
    counts = [
        *(
            int(((seen.station == s) & (seen.reflector == r) & ~seen.is_distance).sum())
            for s in (0, 1)
            for r in (-1, 0, 1)
        ),
        *(int((seen.anchor == a).sum()) for a in (0, 1)),
    ]
    assert [int(row[4]) for row in table.rows] == counts
    assert sum(counts) == len(seen)
