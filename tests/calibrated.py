"""Measuring sessions of a virtual TX60 whose truth is known, and how to put them together."""

from dataclasses import replace
from functools import cache

import numpy as np

from calib.geometry.frames import step_transform
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.measurement import tables
from calib.measurement.tables import covariances_of_sd
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.conditions import SetUp
from testbed.files.session import Session, Stated
from testbed.files.session_toml import IdentificationTable
from testbed.identify.calibrate import Options, calibrate
from testbed.robots.catalog import load_robot
from tests.reference import DEG, SIGMA_POSITION, SIGMA_ROTATION, pool_r

BASE = np.array([2.5, -1.2, 0.4, 0.3, -0.2, 2.1])
TOOL = np.array([0.03, -0.02, 0.11, 0.4, 0.1, -1.3])
"""Where the robot and the target are, seen from the tracker and the flange: far from nominal."""


@cache
def robot():
    return load_robot("staubli_tx60")


def true_model(seed=3, *, harmonics=0.0, own_frames=False):
    """A TX60 with 0.03 deg and 0.2 mm on every link number."""
    rng, chain = np.random.default_rng(seed), robot().model.chain
    sd = np.array([0.03 * DEG, 2e-4, 2e-4, 0.03 * DEG, 0.03 * DEG])
    chain = replace(chain, links=chain.links + sd * rng.standard_normal(chain.links.shape))
    if not own_frames:
        chain = replace(
            chain, T_world_base=step_transform(BASE), T_flange_tool=step_transform(TOOL)
        )
    terms = harmonic_terms(6) if harmonics else ()
    size = harmonics * DEG * rng.standard_normal(len(terms))
    return RobotModel(chain, JointErrors(terms, size))


def table_of(model, q, *, seed=4, noise=1.0, pose_id=None, repeat=0):
    """Full poses of a model with `noise` times the stated scatter."""
    rng, m = np.random.default_rng(seed), len(q)
    scatter = noise * rng.standard_normal((m, 6)) * [*[SIGMA_POSITION] * 3, *[SIGMA_ROTATION] * 3]
    T = model.poses(q)
    seen = T.copy()
    for k in range(m):
        seen[k, :3, 3] += scatter[k, :3]
        turn = step_transform(np.concatenate([np.zeros(3), scatter[k, 3:]]))
        seen[k, :3, :3] = turn[:3, :3] @ T[k, :3, :3]
    covariance = covariances_of_sd((SIGMA_POSITION, SIGMA_ROTATION), 6, m)
    return tables.poses(q, seen, sd=covariance, pose_id=pose_id, repeat=repeat)


def session_of(table, **changes):
    """A session of a table that states nothing else."""
    m = len(table)
    count = int(table.pose_id.max()) + 1
    plain = Session(
        name="bench",
        measurements=table,
        pose_names=tuple(f"P{k + 1}" for k in range(count)),
        is_test=np.zeros(m, dtype=bool),
        split_stated=False,
        read_back=None,
        time=None,
        conditions=Conditions(),
        set_up=SetUp(),
        approach=None,
        joint_source="commanded",
        uncertainty="stated by the test",
        joint_scatter=np.zeros(table.q.shape[1]),
        fixtures=RobotModel(robot().model.chain).fixtures,
        fixed=(),
        reflector_names=(),
        anchor_names=(),
        station_names=("S1",),
        warnings=(),
        notes=("made by the test",),
        stated=Stated(),
        simulated=False,
        wanted=IdentificationTable(model="geometric"),
        place=tuple(f"bench.csv:{k + 2}" for k in range(m)),
    )
    keys = {"model", "free", "base", "tool"} & set(changes)
    wanted = {key: changes.pop(key) for key in keys}
    return replace(plain, **changes, wanted=plain.wanted.model_copy(update=wanted))


@cache
def sound_session():
    """Eighty poses of a rigid robot, the noise as stated."""
    return session_of(table_of(true_model(), pool_r(80)), simulated=True)


@cache
def sound():
    """It, calibrated."""
    return calibrate(robot(), sound_session(), Options(seed=1))


@cache
def real_session():
    """Eighty poses of a robot that wobbles more than was stated: like real data."""
    model = true_model(harmonics=0.02)
    table = table_of(model, pool_r(90), noise=5.0)
    return session_of(
        table, model="choose", conditions=Conditions(temperature=np.linspace(20, 21, 90))
    )


@cache
def real():
    """It, calibrated, with both models."""
    return calibrate(robot(), real_session(), Options(seed=1))
