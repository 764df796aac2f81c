"""What all readings share: from session.toml and from an export to the report's two columns."""

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.errors import InputError
from calib.measurement.corrections import Corrections
from calib.measurement.prediction import predict
from calib.uncertainty.statement.gain import estimator_gain
from calib.uncertainty.statement.shared import UNSEEN
from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.delivered import Delivered
from testbed.identify.results import headline
from testbed.identify.session import with_test
from testbed.identify.shared import OF_NESTS, shared_of, shared_section
from testbed.identify.words import reasons, terminal_text
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.robots.catalog import load_robot
from testbed.run.export import export_campaign
from testbed.scenario.instrument import beam_of, errors_of
from testbed.scenario.read import changed
from testbed.scenario.systematic import SystematicTable
from testbed.studies import load_scenario
from tests import campaign
from tests.calibrated import robot, session_of, table_of, true_model
from tests.reference import DEG, UM, pool_r

NOTHING = Delivered((), (), 0)
PARTS = SystematicTable(
    range_offset_um=1.5, scale_um_per_m=0.2, encoder_amplitude_um=(7.5, 3.0),
    target_offset_um=2.5, target_turn_mdeg=3.0, level_mdeg=0.5,
    station_mm=(100.0, -200.0, 300.0), station_up=(0.0, 0.1, 0.9),
)  # fmt: skip


@cache
def calibrated():
    """Sixty poses by an instrument that states its systematic parts."""
    session = session_of(table_of(true_model(), pool_r(60)), systematic=PARTS)
    return calibrate(robot(), session, Options(seed=1))


def test_every_part_is_in_its_unit():
    found = errors_of(PARTS)
    assert found.range_offset == pytest.approx(1.5 * UM)
    assert found.scale == pytest.approx(0.2e-6)
    assert found.encoder == pytest.approx((7.5 * UM, 3.0e-6))
    assert found.target_offset == pytest.approx(2.5 * UM)
    assert found.target_turn == pytest.approx(0.003 * DEG)
    assert found.level == pytest.approx(0.0005 * DEG)


def test_the_beam_starts_where_it_is_stated_and_its_axis_stands_as_stated():
    T = beam_of(PARTS)
    np.testing.assert_allclose(T[:3, 3], [0.1, -0.2, 0.3])
    np.testing.assert_allclose(T[:3, 2], np.array([0, 0.1, 0.9]) / math.hypot(0.1, 0.9))
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_a_calibration_has_what_readings_shifted_by_a_source_do_to_it():
    """By the gain of the estimate, with the sensitivity of the target's place written down."""
    found = calibrated()
    fit = found.fit.identification
    train = found.measurements.rows(found.is_used)
    R = fit.model.poses(train.q)[:, :3, :3]
    moved = np.einsum("mfe,mek->fk", estimator_gain(fit, train)[:, :, :3], R) * 2.5 * UM
    judged = found.measurements.rows(found.split.is_test)
    J = predict(fit.model, judged).rows[:, :3, fit.parameters.free_index]
    u = np.sqrt(((J @ moved) ** 2).sum((1, 2)).mean())
    place = found.shared.names.index("target's place")
    assert found.shared.at_tool[place] == pytest.approx(u, rel=1e-9)
    assert u == pytest.approx(2.5 * UM * np.sqrt(3), rel=1e-3)  # it is in the tool frame
    assert set(found.shared.hidden) >= {"range scale", "target's place", "level of the station"}


def test_the_believed_region_holds_what_is_shared():
    found = calibrated()
    whole = found.fit.identification.full_covariance + found.shared.covariance
    drifting = found.proof.drifting
    if drifting is not None and drifting.drift is not None:  # by chance
        whole = whole + drifting.drift.covariance
    index = found.fit.identification.parameters.free_index
    own = np.sqrt(np.diag(whole))[index]
    believed = found.proof.belief.covariance[np.ix_(index, index)] / np.outer(own, own)
    # one sum in another order
    np.testing.assert_allclose(
        believed, whole[np.ix_(index, index)] / np.outer(own, own), atol=1e-12
    )
    # the ball that is believed is no smaller than that of what is shared alone: of a Gaussian R95
    # is 1.61 times its u or more, least where it is round: sqrt(7.81 / 3), by chi-square of 3
    assert found.proof.point.radius_mean > 1.6 * found.shared.combined


def test_the_report_and_the_results_have_both_columns_and_the_words():
    found = calibrated()
    section = shared_section(found)
    rows = {row[0]: row[1:] for row in section.blocks[0].rows}
    assert tuple(rows) == (*found.shared.names, "all together")
    numbers = headline(found, NOTHING)["shared"]
    assert numbers["u_3d_mm"] == pytest.approx(found.shared.combined * 1e3)
    for k, name in enumerate(found.shared.names):
        at_tool, seen, words = rows[name]
        # both are written to two decimals
        assert float(at_tool) == pytest.approx(found.shared.at_tool[k] / UM, abs=0.006)
        assert float(seen) == pytest.approx(found.shared.seen[k] / UM, abs=0.006)
        assert (words == "no") == (name in found.shared.hidden)
        one = numbers["sources"][name]
        assert one["at_tool_u_3d_mm"] == pytest.approx(found.shared.at_tool[k] * 1e3)
        assert one["seen_u_3d_mm"] == pytest.approx(found.shared.seen[k] * 1e3)
        assert one["sentence"] == found.shared.sentences[k]
        assert (one["sentence"] == UNSEEN) == (words == "no")
    json.dumps(numbers, allow_nan=False)


def test_a_session_that_states_none_is_told_that_none_is_counted():
    none = replace(calibrated(), shared=None)
    assert shared_section(none) is None
    said = "because the session states none ([uncertainty.systematic]); held-out poses of the same "
    assert any(said in text for text in reasons(none))
    assert said in terminal_text(none, NOTHING)
    assert "shared" not in headline(none, NOTHING)
    plain = session_of(table_of(true_model(), pool_r(30)))
    assert plain.systematic is None
    every = np.ones(len(none.measurements), dtype=bool)
    assert shared_of(plain, none.fit.identification, none.measurements, every, every) is None


def test_what_nests_leave_is_a_source_of_its_own():
    """Beside stated parts as well as alone, where the instrument still states none."""
    found, rng = calibrated(), np.random.default_rng(0)
    result, rows = found.fit.identification, found.measurements
    used, judged = found.is_used, found.split.is_test
    root = 1e-5 * rng.normal(size=(3, 6, 6))
    which = np.tile(np.arange(3), (len(rows), 1))
    share, lever = rng.normal(size=(2, len(rows), 3))
    left = Corrections(which, share, lever, root @ root.mT)
    plain = replace(session_of(rows), corrections=left)
    alone = shared_of(plain, result, rows, used, judged)
    assert alone.names == (OF_NESTS,)
    with_parts = shared_of(replace(plain, systematic=PARTS), result, rows, used, judged)
    parts = shared_of(replace(session_of(rows), systematic=PARTS), result, rows, used, judged)
    assert with_parts.names == (*parts.names, OF_NESTS)
    np.testing.assert_allclose(with_parts.covariance, parts.covariance + alone.covariance)
    assert with_parts.combined == pytest.approx(np.hypot(parts.combined, alone.combined))
    assert any("the session states none" in one for one in reasons(replace(found, shared=alone)))
    (table,) = shared_section(replace(found, shared=alone)).blocks
    assert table.rows[0][:2] == (OF_NESTS, f"{1e6 * alone.at_tool[0]:.2f}")
    (table,) = shared_section(replace(found, shared=with_parts)).blocks
    assert table.rows[-2][0] == OF_NESTS


EXPORTED = {
    "identification.estimators": ["whitened"],
    "uncertainty.replications": 0,
    "uncertainty.repeats": 2,
    "pool.size": 40,
    "test.poses": 6,
    "studies.random_sets": 0,
    "studies.paper_budget": False,
    "tracker.preset": "at960",
    "tracker.systematic": True,
    "trial": [{"name": "first", "poses": 12, "method": "random"}],
}


@pytest.mark.parametrize("measures", ["pose", "point"])
def test_an_exported_campaign_states_what_its_tracker_was_drawn_from(tmp_path, measures):
    points = {"tracker.measures": "point", "tracker.reflector_mm": [50.0, 30.0, 80.0]}
    more = points if measures == "point" else {"tracker.level_mdeg": 0.4}
    run = campaign.played(changed(load_scenario("quick"), EXPORTED | more))
    export_campaign(run, load_robot("staubli_tx60"), tmp_path / "out")
    session = read_session(tmp_path / "out", load_robot("staubli_tx60"))
    found, bench = errors_of(session.systematic), open_laboratory(run.scenario, run.setting)
    # written with 17 digits, in micrometers and millidegrees
    assert found.range_offset == pytest.approx(2.5 * UM / np.sqrt(3), rel=1e-14)
    assert found.scale == pytest.approx(0.2e-6, rel=1e-14)
    assert found.encoder == pytest.approx((7.5 * UM, 3e-6), rel=1e-14)
    assert found.target_offset == pytest.approx(2.5 * UM, rel=1e-14)
    turn, level = (0.005 * DEG / np.sqrt(3), 0.0004 * DEG) if measures == "pose" else (0, 0)
    assert found.target_turn == pytest.approx(turn, rel=1e-14)
    assert found.level == pytest.approx(level, rel=1e-14)
    T, station = beam_of(session.systematic), bench.tracker.T_world_tracker
    np.testing.assert_allclose(T[:3, 2:], station[:3, 2:], atol=1e-15)
    if measures == "pose":
        shared = calibrate(load_robot("staubli_tx60"), session).shared
        # the tracker's own figures, whose circles have their zero elsewhere
        assert shared.at_tool[shared.names.index("tracker's encoders")] > 5 * UM


def test_a_held_out_file_has_the_same_instrument_or_says_nothing():
    one = session_of(table_of(true_model(), pool_r(30)), systematic=PARTS)
    same = session_of(table_of(true_model(), pool_r(50)[30:], seed=9))
    assert with_test(one, same).systematic == PARTS
    assert with_test(one, replace(same, systematic=PARTS)).systematic == PARTS
    other = PARTS.model_copy(update={"station_mm": (0.0, 0.0, 0.0)})
    with pytest.raises(InputError, match="another place of the instrument"):
        with_test(one, replace(same, systematic=other))


def test_a_held_out_file_brings_what_its_own_nests_are_wrong_by():
    one, other = (session_of(table_of(true_model(), pool_r(m)[m - 8 :])) for m in (8, 16))
    which = np.tile(np.arange(2), (8, 1))
    left = Corrections(which, np.ones((8, 2)), np.ones((8, 3)), np.tile(np.eye(6), (2, 1, 1)))
    both = with_test(replace(one, corrections=left), replace(other, corrections=left))
    np.testing.assert_array_equal(both.corrections.share, np.ones((16, 2)))
    np.testing.assert_array_equal(both.corrections.which, np.repeat([[0, 1], [2, 3]], 8, axis=0))
    for given in ((left, None), (None, left)):
        alone = (replace(each, corrections=c) for each, c in zip((one, other), given, strict=True))
        share = with_test(*alone).corrections.share
        np.testing.assert_array_equal(share.any(axis=1), np.repeat([g is left for g in given], 8))
