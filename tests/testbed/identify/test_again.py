"""A robot calibrated before, with all its joint errors, and calibrated again from new poses."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.operating import OperatingConditions, approaches
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status
from calib.identification.ladders import ladders_of
from calib.identification.levels import joined, prior_of, with_errors
from calib.identification.prior import own_prior
from calib.identification.row_ladders import RowTerms, row_ladders
from calib.measurement.tables import poses
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.fit import plain_fit
from testbed.robots.catalog import load_robot
from testbed.robots.write.identified import identified_robot
from testbed.robots.write.toml import robot_toml
from tests.calibrated import robot, session_of, table_of, true_model
from tests.reference import DEG, pool_r

BARE = replace(robot(), visuals=())


def written(model, folder):
    """The robot with a model, as its robot.toml says it."""
    mine = replace(identified_robot(BARE, model, name="mine"), visuals=())
    (folder / "robot.toml").write_text(robot_toml(mine), encoding="utf-8")
    return load_robot(folder)


def test_a_file_says_how_large_each_number_is_believed_to_be(tmp_path):
    """Levels of every ladder at once, the small ones among them: prior widths as the ladder has."""
    q = pool_r(30)
    load = np.random.default_rng(0).normal(size=q.shape) * 30
    at = OperatingConditions(
        approach=approaches(q), torque=load, temperature=np.linspace(20, 35, 30)
    )
    table = replace(poses(q, BARE.model.poses(q), sd=(1e-5, 1e-4)), conditions=at)
    known = RowTerms(gear=((30.5,), *[()] * 5))
    beside = [ladder.levels[-1] for ladder in row_ladders(BARE.model, table, known)]
    for bent, wavy, payload in (
        ("sag and small bearings", "joint map with small waves", None),
        ("springs and bearings on a tilted base", "waves 1 to 4", np.zeros(4)),
    ):
        both = ladders_of(BARE.model, limits=BARE.limits, payload=payload)
        named = {level.name: level for ladder in both for level in ladder.levels}
        levels = [named[bent], named[wavy], *beside]
        wide = with_errors(BARE.model, joined(levels))
        step = np.zeros(wide.n_numbers)
        step[wide.chain.n_numbers : wide.first_fixture] = 1e-5
        model = written(wide.moved(step), tmp_path).model
        believed = prior_of(levels)
        prior = own_prior(parameters_of(model), model)
        sd = dict(zip(prior.names, prior.sd, strict=True))
        expected = dict(zip(believed.names, believed.sd, strict=True))
        # links are written in millimeters and degrees: a rounding or two
        assert sd == pytest.approx(expected, rel=1e-14)


def shaken(orders, seed=7):
    """A robot whose drives leave waves of 6 mdeg."""
    terms = harmonic_terms(6, orders)
    size = 6e-3 * DEG * np.random.default_rng(seed).standard_normal(len(terms))
    return replace(true_model(own_frames=True), joint_errors=JointErrors(terms, size))


def error(model, true):
    """Mean distance where nobody measured [m]."""
    q = pool_r(600)[400:]
    off = model.poses(q)[:, :3, 3] - true.poses(q)[:, :3, 3]
    return float(np.linalg.norm(off, axis=1).mean())


def test_few_new_poses_keep_a_joint_map_and_do_not_spoil_it(tmp_path):
    """Thirty poses are 180 equations for 234 numbers: what they do not tell stays what it was."""
    true, q = shaken((1, 2, 5, 11)), pool_r(600)
    terms = [term for term in ladders_of(BARE.model)[1].levels[-1].errors.terms if term.joint < 3]
    wide = with_errors(BARE.model, JointErrors(tuple(terms)))
    first = plain_fit(wide, table_of(true, q[:90]), parameters_of(wide))
    back, table = written(first.model, tmp_path).model, table_of(true, q[150:180], seed=5)
    again = plain_fit(back, table, parameters_of(back))
    fresh = plain_fit(BARE.model, table, parameters_of(BARE.model))
    assert again.prior.names == tuple(term.name for term in terms)
    assert again.status is Status.CONVERGED
    # measured 58, 79 and 130 um
    assert error(first.model, true) < error(again.model, true)
    assert error(again.model, true) < 0.75 * error(fresh.model, true)


@pytest.mark.study
def test_a_calibrated_robot_calibrated_again_is_as_accurate(tmp_path):
    """Chosen from 100 poses, written, chosen again from 40 others, by the whole verb."""
    true, q = shaken((1, 2, 5, 11, 17, 24)), pool_r(600)
    found = []
    for start, rows, seed in ((robot(), q[:150], 4), (None, q[150:210], 5)):
        arm = written(found[0].fit.identification.model, tmp_path) if start is None else start
        session = session_of(table_of(true, rows, seed=seed), model="choose")
        found.append(calibrate(arm, session, Options(seed=1)))
    fresh = calibrate(robot(), session, Options(seed=1))
    first, again = (error(one.fit.identification.model, true) for one in found)
    # measured 59 and 60 um, and 89 from the new poses alone
    assert again < 1.15 * first
    assert again < 0.8 * error(fresh.fit.identification.model, true)
