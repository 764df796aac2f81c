"""The extended model: which terms it adds, and that these are the torque of gravity."""

import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.frames import rot_x, rot_y
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.joint_models import extended_model, extended_parameters, gravity_is_closed
from calib.measurement.observations import Measurements
from tests.calib.slopes import slopes
from tests.reference import DEG, TX60_LINKS, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

POOL = pool_r()
GOALS = pool_r(300, seed=99)
MDEG = 1e-3 * DEG


def bent(seed: int) -> RobotModel:
    """A true robot with sag of 10, 6, 8 mdeg and harmonics of some 6 mdeg."""
    rng = np.random.default_rng(seed)
    size = np.array([10, 6, 8, *np.tile([6, 6, 3, 3], 6)]) * MDEG
    size[3:] *= rng.uniform(-1.2, 1.2, 24)
    terms = JointErrors((*gravity_terms(6), *harmonic_terms(6)), size)
    return RobotModel(rigid_truth(rng).chain, terms)


def seen(truth: RobotModel, m: int, seed: int, first: int = 0) -> Measurements:
    return measured(truth, POOL[first : first + m], np.random.default_rng(seed))


def test_the_extended_model_has_27_terms_and_moves_nothing():
    wide = extended_model(tx60())
    assert wide.n_numbers == 42 + 27
    assert wide.names[42:45] == ("gravity2.upper", "gravity2.fore", "gravity3.fore")
    assert wide.names[45:49] == tuple(f"harmonic1.{w}" for w in ("sin1", "cos1", "sin2", "cos2"))
    np.testing.assert_array_equal(wide.poses(POOL[:20]), tx60().poses(POOL[:20]))


def test_terms_already_known_are_kept_and_not_doubled():
    known = JointErrors(gravity_terms(6), np.array([1, 2, 3]) * MDEG)
    wide = extended_model(RobotModel(tx60().chain, known))
    assert len(wide.joint_errors.terms) == 27
    np.testing.assert_array_equal(wide.joint_errors.coefficients[:3], known.coefficients)
    assert extended_model(wide).names == wide.names


def with_base(T) -> Chain:
    return Chain(TX60_LINKS, T_world_base=T)


@pytest.mark.parametrize(
    ("chain", "closed"),
    [
        (Chain(TX60_LINKS), True),
        (with_base(rot_x(0.5 * DEG)), True),
        (with_base(rot_x(5 * DEG)), False),
        (with_base(rot_x(180 * DEG)), True),
        (with_base(rot_y(90 * DEG)), False),
        (Chain(TX60_LINKS[:2]), False),
        (Chain(TX60_LINKS * ([1, 1, 0, 1, 1])), False),
        (Chain(TX60_LINKS, ("revolute", "prismatic", *["revolute"] * 4)), False),
        (Chain(TX60_LINKS + np.pi * (np.arange(30) == 8).reshape(6, 5)), False),
    ],
    ids=[
        "tx60",
        "tilted a little",
        "tilted",
        "hanging",
        "on a wall",
        "two joints",
        "no upper arm",
        "rail",
        "flip",
    ],
)
def test_gravity_is_added_only_where_its_closed_form_holds(chain, closed):
    assert gravity_is_closed(chain) is closed
    names = extended_model(RobotModel(chain)).joint_errors.names
    assert ("gravity2.upper" in names) is closed


def test_the_closed_form_is_the_torque_of_weights_on_the_arm():
    """Torque on joints 2 and 3 by virtual work: -d(height)/dq of two masses, by differences."""
    chain, q = tx60().chain, POOL[:30]

    def heights(at):
        """World heights of a point halfway up the arm and of the wrist."""
        fore = Chain(chain.links[:4]).links.copy()
        elbow = RobotModel(Chain(chain.links[:2])).poses(at[:, :2])[:, 2, 3]
        wrist = RobotModel(Chain(fore)).poses(at[:, :4])[:, 2, 3]
        return np.stack([elbow, wrist])

    # d3 = 20 mm lies along the parallel axes and does not turn: pure sines remain
    for drop in np.moveaxis(-slopes(heights, q, by=(1, 2)), -1, 0):
        waves = np.stack([np.sin(q[:, 1]), np.sin(q[:, 1] + q[:, 2])], axis=1)
        for torque in drop:
            fit = np.linalg.lstsq(waves, torque)[0]
            assert np.abs(waves @ fit - torque).max() < 1e-9
            assert fit.min() > -1e-9


def test_prismatic_joints_have_no_harmonics():
    links = np.vstack([[0.0, 0, 0.1, -90 * DEG, 0.01], TX60_LINKS])
    wide = extended_model(RobotModel(Chain(links, ("prismatic", *["revolute"] * 6))))
    assert not any(name.startswith("harmonic1") for name in wide.names)
    assert sum(name.startswith("harmonic") for name in wide.names) == 24


def test_the_extended_table_frees_what_was_free_and_all_terms():
    wide = extended_model(tx60())
    table = extended_parameters(tx60(), wide, parameters_of(tx60(), WEN24, length=0.5))
    assert table.free_names == (*WEN24, *wide.names[42:])
    np.testing.assert_array_equal(table.scale, parameters_of(wide, length=0.5).scale)
