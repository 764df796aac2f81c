"""A robot whose joint errors are known already, as the nominal robot of a virtual campaign."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.model import RobotModel
from calib.identification.joint_models import extended_model
from calib.identification.prior import own_prior
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.many import ManyTrueRobots
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.setting import in_turn, journey
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.identified import identified_robot
from testbed.scenario.checks import check_robot
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.trial.compare import true_step
from testbed.studies.trial.estimator import estimator_for
from tests import campaign
from tests.testbed.laboratory.outcomes import settings
from tests.testbed.robots.robot_cases import TX60, joint_vectors

MODEL = extended_model(TX60.model)
KNOWN = identified_robot(
    replace(TX60, visuals=()),
    MODEL.moved(np.random.default_rng(3).normal(size=MODEL.n_numbers) * 2e-4),
    name="mine",
)
"""A calibrated TX60: 27 joint terms that move its tool by tenths of a millimetre."""


def test_the_true_robot_has_the_errors_its_nominal_model_knows():
    """Perturbed by nothing, the true robot is the nominal one, joint errors included."""
    still = settings("rigid", angle_sd_deg=0.0, length_sd_mm=0.0)
    true = draw_truth(KNOWN, still, seed=1)
    q = joint_vectors(50)
    np.testing.assert_allclose(true.poses(q), KNOWN.model.poses(q), rtol=0, atol=1e-12)


def test_the_true_robot_has_the_play_its_nominal_model_knows():
    """Rows say from which side joints came, and the model asks; so does the robot."""
    terms = tuple(
        JointTerm(f"approach{i + 1}", i, "approach", tuple(float(k == i) for k in range(6)))
        for i in range(6)
    )
    play = RobotModel(TX60.model.chain, JointErrors(terms, np.full(6, 7e-5)))  # 4 mdeg
    mine = identified_robot(replace(TX60, visuals=()), play, name="mine")
    true = draw_truth(mine, settings("rigid", angle_sd_deg=0.0, length_sd_mm=0.0), seed=1)
    q = joint_vectors(50)
    way, said = journey(q, 0.0, 10.0), in_turn(q)
    there = true.poses(q, **way._asdict())
    np.testing.assert_allclose(there, play.poses(q, said), rtol=0, atol=1e-12)
    assert np.abs(there - play.poses(q))[:, :3, 3].max() > 50e-6
    assert ManyTrueRobots.of([true]) is None  # its rows are beyond what arrays know


def test_numbers_of_known_joint_errors_are_not_perturbed():
    """And who asks for it is told so by the check, not by the run."""
    term = KNOWN.model.joint_errors.names[0]
    scenario = changed(load_scenario("quick"), {"truth.perturb": ["alpha2", term]})
    with pytest.raises(InputError, match=rf'perturb has "{term}", which mine does not know'):
        check_robot(scenario, KNOWN, where="x.toml")
    sound = changed(scenario, {"truth.perturb": ["alpha2", "base.x"]})
    check_robot(changed(sound, {"identification.estimators": ["whitened"]}), KNOWN, where="x.toml")


def test_what_the_scenario_adds_comes_on_top():
    preset = settings("wen2022")
    plain, known = (draw_truth(one, preset, seed=1) for one in (TX60, KNOWN))
    q = joint_vectors(20)
    added = known.model.joint_errors.offsets(q) - KNOWN.model.joint_errors.offsets(q)
    np.testing.assert_allclose(added, plain.model.joint_errors.offsets(q), rtol=0, atol=1e-18)


def test_a_campaign_on_its_folder_identifies_what_is_left(tmp_path):
    """Terms are free beside the links under their prior; the true step predicts the true robot."""
    write_robot_folder(KNOWN, tmp_path / "mine")
    scenario = changed(
        load_scenario("quick"), {"robot": str(tmp_path / "mine"), "pool.size": 60, "test.poses": 15}
    )
    bench = open_laboratory(scenario, campaign.compute(scenario, "setting", None))
    table = bench.free("whitened")
    assert set(KNOWN.model.joint_errors.names) <= set(table.free_names)
    seen = bench.measure_pool(np.arange(40), "test")
    estimator = estimator_for(bench, "whitened", seen)
    assert estimator.reason.because.endswith(
        "; of the joint errors that the robot has already 27 free under a prior"
    )
    found = estimator.fit(seen)
    known = own_prior(table, bench.setting.nominal)
    assert found.prior.names == known.names == KNOWN.model.joint_errors.names
    np.testing.assert_array_equal(found.prior.sd, known.sd)
    step = true_step(bench.setting, found, seen)
    model = bench.setting.nominal.moved(found.parameters.expand(step))
    q = bench.setting.test_q
    away = np.linalg.norm((model.poses(q) - bench.truth.poses(q))[:, :3, 3], axis=1)
    assert away.max() < 1e-9
    error = np.linalg.norm((found.model.poses(q) - bench.truth.poses(q))[:, :3, 3], axis=1)
    before = np.linalg.norm((KNOWN.model.poses(q) - bench.truth.poses(q))[:, :3, 3], axis=1)
    assert error.mean() < 0.2 * before.mean()
    assert extended_model(KNOWN.model).names == KNOWN.model.names  # no term stands in it twice
