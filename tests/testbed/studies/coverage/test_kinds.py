"""Kinds of robots of the coverage study: what is wrong has the size, place and memory it should."""

from dataclasses import replace

import numpy as np
import pytest

from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.scenario.read import changed
from testbed.streams import stream
from testbed.studies import load_scenario, scenario_of
from testbed.studies.coverage.kinds import APART, MEMORY, SIZES, apart, drawn, remembering, where
from testbed.studies.coverage.play import measure_robot


@pytest.fixture(scope="module")
def bench():
    changes = {"pool.size": 300, "test.poses": 40, "coverage.robots": 2}
    scenario = changed(load_scenario("coverage"), changes | {"tracker": {"preset": "at960"}})
    return open_laboratory(scenario, make_setting(scenario))


@pytest.mark.parametrize("robot", [0, 1, 2])
def test_a_slight_robot_is_wrong_by_its_part_of_the_noise_after_the_best_geometry(bench, robot):
    """By Gauss-Newton on the noise-free points of the true robot, its geometry wrong as well."""
    size = stream(bench.scenario.seed, "coverage", "slight", robot).uniform(*SIZES)
    own, q = drawn(bench, "slight", robot).laboratory, bench.pool_q[100:]
    true, model = own.held_out(q)[:, :3, 3], bench.setting.nominal
    for _ in range(3):
        T, J = model.poses_and_jacobian(q)
        rows, error = J[:, :3].reshape(3 * len(q), -1), (true - T[:, :3, 3]).ravel()
        model = model.moved(np.linalg.lstsq(rows, error, rcond=1e-9)[0])
    left = np.sqrt(np.mean((true - model.poses(q)[:, :3, 3]) ** 2))
    noise = np.sqrt(np.mean(np.diagonal(bench.covariance(q)[:, :3, :3], axis1=1, axis2=2)))
    # sized over a hundred other poses: the rms of one robot's misfit scatters by 5 to 8 %
    assert left / noise == pytest.approx(size, rel=0.25)


def test_noise_that_remembers_keeps_its_variance(bench):
    q = np.tile(bench.pool_q, (4, 1))
    seen = bench.measure(q[:800], np.arange(800), "test")
    held = bench.measure(q[800:], np.arange(400), "test", "held")
    parts = remembering(bench, (seen, held))
    e = np.concatenate([rows.position - bench.truth.poses(rows.q)[:, :3, 3] for rows in parts])
    root = np.linalg.cholesky(np.concatenate([rows.covariance[:, :3, :3] for rows in parts]))
    white = np.linalg.solve(root, e[:, :, None])[:, :, 0]
    # 1200 rows that remember 15 are some 40 independent ones in each of three directions
    assert white.std() == pytest.approx(1.0, rel=3 / np.sqrt(2 * 120))
    follows = (white[1:] * white[:-1]).mean() / (white**2).mean()
    assert follows == pytest.approx(np.exp(-1 / MEMORY), abs=0.04)


@pytest.mark.parametrize("robot", range(4))
def test_a_shifted_robot_is_used_where_it_was_not_measured(bench, robot):
    train, held, judged = apart(bench, robot, (20, 10, 15))
    place = ("half", "joint 1", "elbow", "low")[robot]
    low, high = np.quantile(where(bench, place, bench.pool_q), APART)
    assert (len(train), len(held), len(judged)) == (20, 10, 15)
    assert (where(bench, place, np.vstack([train, held])) < low).all()
    assert (where(bench, place, judged) > high).all()
    assert len(np.unique(np.vstack([train, held, judged]), axis=0)) == 45


def test_what_is_judged_is_the_load_and_the_single_move_of_the_kind(bench):
    chosen = np.arange(20)
    loaded, mean, move = (
        measure_robot(bench, k, chosen, 0) for k in ("loaded", "slight", "one_move")
    )
    assert loaded.use.payload == (2.0, 5.0)
    unloaded = loaded.laboratory.held_out(loaded.judge_q)[:, :3, 3]
    assert np.linalg.norm(loaded.true - unloaded, axis=1).mean() > 100e-6
    # the same robot, and one move of it
    off = move.true - mean.true
    J = bench.setting.nominal.poses_and_jacobian(move.judge_q)[1]
    columns = [bench.setting.nominal.names.index(f"theta{i}") for i in range(1, 7)]
    sd = J[:, :3, columns] * bench.robot.repeatability
    assert np.sqrt((off**2).mean()) == pytest.approx(np.sqrt((sd**2).sum(2).mean()), rel=0.25)


LEVEL_ARM = """<robot name="level"><link name="l0"/>{joints}<link name="tool0"/>
<joint name="t" type="fixed"><parent link="l3"/><child link="tool0"/>
<origin xyz="0.1 0 0.06"/></joint></robot>"""
TURNS = """<joint name="j{k}" type="revolute"><parent link="l{before}"/><child link="l{k}"/>
<origin xyz="{x} 0 {z}"/><axis xyz="0 0 1"/>
<limit lower="-2.4" upper="2.4" velocity="2" effort="100"/></joint>
<link name="l{k}"><inertial><origin xyz="0.1 0 0"/><mass value="3"/>
<inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    """A laboratory with an arm of upright axes: it does not sag, and its tool is at one height."""
    path = tmp_path_factory.mktemp("level") / "level.urdf"
    links = ((0.0, 0.3), (0.35, 0.0), (0.3, 0.0))
    joints = (TURNS.format(k=k, before=k - 1, x=x, z=z) for k, (x, z) in enumerate(links, 1))
    path.write_text(LEVEL_ARM.format(joints="".join(joints)), encoding="utf-8")
    small = {"pool": {"size": 60}, "test": {"poses": 5}, "tracker": {"preset": "paper"}}
    trial = {"name": "a", "poses": 8, "method": "random"}
    names = {"format": 1, "name": "level", "robot": str(path), "truth": {"preset": "rigid"}}
    study = {"robots": 4, "truths": ["shift"], "validation_poses": 19}
    scenario = scenario_of({**names, **small, "trial": [trial], "coverage": study})
    return open_laboratory(scenario, make_setting(scenario))


@pytest.mark.parametrize("robot", range(4))
def test_an_arm_that_does_not_sag_is_wrong_by_waves_and_used_elsewhere_than_lower(level, robot):
    """Else a spring would be as soft as it takes, and no posture be higher than another."""
    own = drawn(level, "shift", robot)
    q = level.pool_q
    setting = own.laboratory.setting
    still = replace(setting.true, joint_errors=setting.nominal.joint_errors)
    error = (own.laboratory.held_out(q) - still.poses(q))[:, :3, 3]
    assert 1e-6 < np.abs(error).max() < 1e-4  # a few noises of 17.5 um
    train, held_out, judged = apart(own.laboratory, robot, (8, 19, 5))
    at = [where(level, "half", some) for some in (np.vstack([train, held_out]), judged)]
    if robot in (0, 3):  # height tells nothing, the next one in turn does
        assert at[0].max() < at[1].min()
