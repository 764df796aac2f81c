"""What bends an arm, as the report shows it: maps of joints and sag, each by a second way."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from calib.geometry.jacobian import joint_columns
from calib.geometry.parameters import parameters_of
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.terms import gravity_loads
from testbed.report.page import Figure
from testbed.robots.catalog import load_robot
from testbed.studies.trial.bending.plots import shade_steps
from testbed.studies.trial.bending.report import bending_section, known_map
from testbed.studies.trial.bending.sag import sag_of, without_gravity
from tests.testbed.laboratory.outcomes import settings

ROBOT = load_robot("staubli_tx60")
Q = np.random.default_rng(2).uniform(*(0.8 * ROBOT.limits.T), (40, 6))


def campaign(preset, **changes):
    """As much of a campaign as figures of bends look at; the model is the nominal one."""
    truth, nominal = settings(preset, **changes), ROBOT.model
    setting = SimpleNamespace(
        nominal=nominal,
        true=draw_truth(ROBOT, truth, 4).model,
        pool_q=Q,
        pool_nominal=nominal.poses(Q),
        target=np.zeros(3),
    )
    known = parameters_of(nominal).freeing([])
    found = SimpleNamespace(model=nominal, parameters=known, covariance=np.zeros((0, 0)))
    trial = SimpleNamespace(name="set", estimates=(SimpleNamespace(identification=found),))
    scenario = SimpleNamespace(truth=truth, robot="staubli_tx60")
    return SimpleNamespace(scenario=scenario, setting=setting, trials=(trial,), motion=None)


def sag(played):
    return sag_of(played, played.trials[0].estimates[0])


def to_first_order(played, turns):
    """How far small turns (m, 6) of the joints move the true tool (m,) [m]."""
    true = played.setting.true
    J = true.poses_and_jacobian(Q)[1][:, :3, joint_columns(true.chain)]
    return np.linalg.norm((J @ turns[:, :, None])[:, :, 0], axis=1)


def test_sag_on_springs_is_gravity_over_stiffness_times_the_lever():
    drives = np.array([90.0, 90.0, 40.0, 12.0, 10.0, 6.0])
    played = campaign("elastic", bearing_nm_per_mrad=(), payload_kg=0.0)
    found = sag(played)
    true = played.setting.true
    turns = gravity_loads(true.chain, ROBOT.masses, ROBOT.centers, Q) / (1e3 * drives)
    expected = to_first_order(played, turns)
    assert expected.max() > 1e-4
    # what bends is bent a thousandth elsewhere
    np.testing.assert_allclose(found.size, expected, rtol=0, atol=3e-3 * expected.max())
    away = true.poses(Q)[:, :3, 3] - ROBOT.model.poses(Q)[:, :3, 3]
    assert (np.abs(found.left - np.linalg.norm(away, axis=1)) <= found.size + 1e-12).all()
    np.testing.assert_allclose(
        np.hypot(*found.place.T), np.linalg.norm(played.setting.pool_nominal[:, :3, 3], axis=1)
    )


def test_sag_in_closed_form_is_the_lever_of_its_terms_and_no_wave_counts():
    played = campaign("wen2022")
    errors = played.setting.true.joint_errors
    turns = errors.offsets(Q) - without_gravity(errors).offsets(Q)
    assert (turns[:, 1:3] != 0).all()
    assert not turns[:, [0, 3, 4, 5]].any()
    expected = to_first_order(played, turns)
    np.testing.assert_allclose(sag(played).size, expected, rtol=0, atol=1e-3 * expected.max())


@pytest.mark.parametrize(
    ("preset", "figures"), [("rigid", 0), ("drives", 1), ("wen2022", 2), ("elastic", 2)]
)
def test_there_is_a_figure_of_what_bends_and_none_of_what_does_not(preset, figures):
    played = campaign(preset)
    section = bending_section(played)
    assert (section is None) == (not figures)
    blocks = () if section is None else section.blocks
    assert [type(block) for block in blocks] == [Figure] * figures
    assert (sag(played) is None) == (figures < 2)


def test_the_true_map_is_what_each_joint_turns_without_the_lines_of_its_encoder():
    true = draw_truth(ROBOT, settings("drives", encoder_mdeg=3.0, encoder_periods=1024), 4).model
    found = known_map(true)
    kept = [k for k, term in enumerate(true.joint_errors.terms) if "encoder" not in term.name]
    assert len(kept) < len(true.joint_errors.terms)
    errors = replace(
        true.joint_errors,
        terms=tuple(true.joint_errors.terms[k] for k in kept),
        coefficients=true.joint_errors.coefficients[kept],
    )
    expected = errors.offsets(np.repeat(found.angle[:, None], 6, axis=1))
    np.testing.assert_allclose(found.turn, expected, rtol=0, atol=1e-18)
    assert not found.u.any()


def test_shades_part_the_largest_value_by_ones_twos_and_fives():
    assert shade_steps(1052.0).tolist() == [50, 100, 200, 500, 1000]
    assert shade_steps(1000.0).tolist() == [20, 50, 100, 200, 500]
    assert shade_steps(7.0).tolist() == [0.2, 0.5, 1, 2, 5]
