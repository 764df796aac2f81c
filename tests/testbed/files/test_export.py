"""Virtual measurements leave as files and come back bit for bit."""

from functools import cache

import numpy as np
import pytest

from calib.errors import InputError
from calib.identification.identify import identify
from calib.measurement.observations import COLUMNS
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.robots.catalog import load_robot
from testbed.run.export import export_campaign, exported_rows
from testbed.scenario.checks import free_parameters
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from tests import campaign

SMALL = {
    "identification.estimators": ["whitened"],
    "uncertainty.replications": 0,
    "uncertainty.repeats": 2,
    "pool.size": 20,
    "test.poses": 6,
    "studies.random_sets": 0,
    "trial": [
        {"name": "first", "poses": 8, "method": "random"},
        {"name": "second", "poses": 7, "method": "random"},
    ],
}
POINTS = {
    "tracker.measures": "point",
    "tracker.reflector_mm": [50.0, 30.0, 80.0],
    "trial": [{"name": "first", "poses": 14, "method": "random"}],
}


@cache
def played(points=False):
    scenario = changed(load_scenario("quick"), SMALL | (POINTS if points else {}))
    return campaign.played(scenario)


@pytest.mark.parametrize("points", [False, True])
def test_every_array_comes_back_bit_for_bit(tmp_path, points):
    run, robot = played(points), load_robot("staubli_tx60")
    export_campaign(run, robot, tmp_path / "out")
    session = read_session(tmp_path / "out", robot)
    bench = open_laboratory(run.scenario, run.setting)
    table, is_test, time = exported_rows(bench, run.trials[0])
    for name in COLUMNS:
        written, read = getattr(table, name), getattr(session.measurements, name)
        if name == "covariance":
            # rounding makes the laboratory's own matrices asymmetric in the last bit; the triangle
            # that whitening reads is the one that is written
            written, read = np.tril(written), np.tril(read)
        np.testing.assert_array_equal(written, read, err_msg=name)
        assert written.dtype == read.dtype
    np.testing.assert_array_equal(session.is_test, is_test)
    np.testing.assert_array_equal(session.time, time - time[0])
    assert session.split_stated
    assert session.simulated
    assert session.wanted.visits == "first"
    assert not session.joint_scatter.any()
    assert not session.masked
    assert not session.warnings


def test_what_is_identified_from_the_files_is_what_the_run_identified(tmp_path):
    run, robot = played(), load_robot("staubli_tx60")
    export_campaign(run, robot, tmp_path / "out")
    session = read_session(tmp_path / "out" / "session.toml", robot)
    first = session.measurements.rows(~session.is_test & (session.measurements.repeat == 0))
    for name in COLUMNS:
        mine, theirs = getattr(first, name), getattr(run.trials[0].measurements, name)
        if name != "covariance":
            np.testing.assert_array_equal(mine, theirs)
    found = identify(run.setting.nominal, first, free_parameters(run.scenario, robot, "whitened"))
    own = run.trials[0].estimates[0].identification
    # the same numbers through the same arithmetic
    np.testing.assert_array_equal(found.step, own.step)
    np.testing.assert_array_equal(found.covariance, own.covariance)


def test_what_hung_on_the_arm_and_how_warm_it_was_is_in_the_files(tmp_path):
    """Springs that feel 2 kg, and links that warm up by 5 K; stiff cold ones have no columns."""
    truth = {"preset": "elastic", "thermal_k": 5.0, "thermal_h": 0.05}
    scenario = changed(load_scenario("quick"), SMALL | {"truth": truth})
    robot = load_robot("staubli_tx60")
    export_campaign(campaign.played(scenario), robot, tmp_path / "out")
    session = read_session(tmp_path / "out", robot)
    assert set(session.conditions.payload.tolist()) == {2.0}
    center = session.measurements.conditions.center
    assert np.unique(center, axis=0).tolist() == [[0.0, 0.0, 0.05]]  # of every shipped preset
    since = np.genfromtxt(tmp_path / "out" / "first.csv", delimiter=",", names=True)["time_s"]
    # 63 % of the rise after 180 s
    warm = 20.0 + 5.0 * (1.0 - np.exp(-since / 180.0))
    np.testing.assert_allclose(session.conditions.temperature, warm, rtol=1e-14)
    assert warm[0] == 20.0
    assert np.ptp(warm) > 2.0
    export_campaign(played(), robot, tmp_path / "stiff")
    assert read_session(tmp_path / "stiff", robot).conditions.stated == ()


def test_every_trial_has_its_files(tmp_path):
    robot = load_robot("staubli_tx60")
    export_campaign(played(), robot, tmp_path / "out")
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {"first.csv", "second.csv", "session.toml", "second.toml"}
    second = read_session(tmp_path / "out" / "second.toml", robot)
    assert second.measurements.rows(~second.is_test).n_poses == 7
    written = (tmp_path / "out" / "session.toml").read_text()
    assert written.startswith("# SIMULATED")
    assert "systematic" not in written  # this tracker has no such errors
    digits = (tmp_path / "out" / "first.csv").read_text().splitlines()[1].split(",")[6]
    assert len(digits.lstrip("-0.").replace(".", "")) >= 15


def test_exported_files_pass_the_probe(tmp_path):
    robot = load_robot("staubli_tx60")
    export_campaign(played(), robot, tmp_path / "out")
    found = probe(robot, read_session(tmp_path / "out", robot))
    found.raise_if_wrong()
    assert found.stated.position < 2e-3


def test_nothing_of_the_user_is_written_over(tmp_path):
    robot = load_robot("staubli_tx60")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("mine")
    for overwrite in (False, True):
        with pytest.raises(InputError, match="C40"):
            export_campaign(played(), robot, tmp_path / "out", overwrite=overwrite)
    assert (tmp_path / "out" / "thesis.tex").read_text() == "mine"
    export_campaign(played(), robot, tmp_path / "new")
    with pytest.raises(InputError, match="C40"):
        export_campaign(played(), robot, tmp_path / "new")
    export_campaign(played(), robot, tmp_path / "new", overwrite=True)
    assert (tmp_path / "new.old-1" / "session.toml").is_file()
