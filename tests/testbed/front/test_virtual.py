"""The laboratory in a script's hands: what it reads and what it judges are of the same robot."""

import numpy as np
import pytest

import calib
import truebed
from calib.errors import InputError
from calib.measurement.observations import joined
from calib.measurement.prediction import predict
from testbed.laboratory import pool
from testbed.studies.trial.estimator import estimator_for
from truebed import VirtualLaboratory

SMALL = {"pool.size": 60, "test.poses": 20}


@pytest.fixture(scope="module")
def lab() -> VirtualLaboratory:
    return truebed.laboratory("quick", SMALL)


@pytest.mark.parametrize("robot", ["its own", "another"])
def test_the_truth_that_judges_is_the_one_that_is_measured(lab, robot):
    """Mean readings of many visits, which know nothing of `errors`, come to where it says."""
    there = lab if robot == "its own" else lab.another("of the same kind", 1)
    places, visits = np.arange(3), 50
    said = there.errors(there.nominal, there.poses[places])
    shots = [there.measure(places, "mean", repeat=k) for k in range(visits)]
    read = np.array([seen.position - there.nominal.poses(seen.q)[:, :3, 3] for seen in shots])
    sd = np.sqrt(np.diagonal(shots[0].covariance[:, :3, :3], axis1=1, axis2=2) / visits)
    # nine normal numbers beyond 4.5 standard deviations: once in 16,000 seeds
    assert (np.abs(read.mean(axis=0) - said) < 4.5 * sd).all()
    assert np.linalg.norm(said, axis=1).min() > 20 * sd.max()


def test_another_robot_has_the_same_candidates_and_another_truth(lab):
    other = lab.another("of the same kind", 1)
    assert np.array_equal(other.poses, lab.poses)
    assert np.array_equal(other.held_out, lab.held_out)
    apart = other.errors(lab.nominal) - lab.errors(lab.nominal)
    assert np.linalg.norm(apart, axis=1).mean() > 50e-6
    again = lab.another("of the same kind", 1)
    assert np.array_equal(other.errors(lab.nominal), again.errors(lab.nominal))


def test_a_calibration_comes_near_the_truth_by_what_it_states(lab):
    seen = lab.measure(range(40), "forty")
    found = calib.identify(lab.nominal, seen, lab.free)
    assert 10 * lab.mean_error(found) < lab.mean_error(lab.nominal)
    assert lab.mean_error(found) == lab.mean_error(found.model)
    assert lab.mean_error(found) == np.linalg.norm(lab.errors(found), axis=1).mean()
    # chi-square of 30 numbers lies within 9 to 68 but once in 10,000 seeds
    wrong = found.step - lab.true_step(found, seen)
    assert 9 < wrong @ np.linalg.solve(found.covariance, wrong) < 68


def test_places_and_their_joints_read_the_same_and_names_draw_the_noise(lab):
    places = lab.measure([4, 2], "a")
    joints = lab.measure(lab.poses[[4, 2]], "a")
    assert np.array_equal(places.position, joints.position)
    assert not np.array_equal(places.position, lab.measure([4, 2], "b").position)
    assert lab.rng("mine").integers(2**60) == lab.rng("mine").integers(2**60)
    scenario = "Scenario('quick', seed 1, staubli_tx60, 2 trials)"
    assert repr(lab) == f"VirtualLaboratory({scenario}, 60 poses)"
    problem = calib.design.Problem.of_blocks(lab.blocks(), 29, "D")
    assert len(calib.design.detmax(problem, lab.rng("mine")).indices) == 29


def noise(lab: VirtualLaboratory, places, name: str, **visit) -> np.ndarray:
    """Readings of places less where the robot of this preset stops, which has no scatter [m]."""
    seen = lab.measure(places, name, **visit)
    return seen.position - lab.inside.truth.poses(seen.q)[:, :3, 3]


def test_no_two_readings_share_their_noise_but_the_same_visit_of_the_same_robot(lab):
    """By robots, poses, names and visits: a name alone once gave all robots one noise."""
    other, every = lab.another("other", 1), np.arange(50)
    same = noise(lab, every, "a")
    np.testing.assert_array_equal(noise(lab, every, "a"), same)
    others = [
        noise(other, every, "a"),
        noise(lab.another("other", 2), every, "a"),
        noise(lab, every[::-1], "a"),
        noise(lab, every, "b"),
        noise(lab, every, "a", repeat=1),
        np.concatenate([noise(lab, [k], "a") for k in every]),
    ]
    draws = np.array([same, *others]).reshape(len(others) + 1, -1)
    correlation = np.corrcoef(draws)[np.triu_indices(len(draws), 1)]
    assert np.abs(correlation).max() < 5 / np.sqrt(draws.shape[1])  # of 21 pairs: 1e-5
    np.testing.assert_allclose(draws.std(axis=1), 17.5e-6, rtol=0.25)  # 5 sd of 150 numbers


def test_poses_measured_one_at_a_time_tell_as_much_as_together(lab):
    """Were the noise of each the same, the frames would take it up, and nothing be left over."""
    seen = joined([lab.measure([k], "one by one") for k in range(40)])
    found = calib.identify(lab.nominal, seen, lab.free)
    # chi-square of 210 numbers over 210 lies within 0.6 to 1.5 but once in 100,000 seeds
    assert 0.6 < found.chi_square / found.dof < 1.5


def test_own_random_numbers_are_none_that_the_laboratory_draws(lab):
    """Whoever draws joints from ``rng("test")`` must not meet the poses that judge."""
    low, high = lab.inside.robot.limits.T
    for name in ("test", "pool"):
        drawn = lab.rng(name).uniform(low, high, (240, len(low)))
        known = np.concatenate([lab.held_out, lab.poses])
        assert np.abs(drawn[:, None] - known).max(axis=2).min() > 1e-6


def test_a_number_of_numpys_is_that_number(lab):
    one, other = lab.another("k", 3), lab.another("k", np.int64(3))
    np.testing.assert_array_equal(one.errors(lab.nominal), other.errors(lab.nominal))
    assert lab.rng(np.int32(3)).integers(2**60) == lab.rng(3).integers(2**60)
    visits = [lab.measure([0], "a", repeat=repeat).position for repeat in (2, np.int64(2))]
    np.testing.assert_array_equal(*visits)
    for wrong in (-1, 0.5, True, "1"):
        with pytest.raises(InputError, match="a whole number, 0 or larger"):
            lab.measure([0], "a", repeat=wrong)
    for wrong in (0.5, True, None):
        with pytest.raises(InputError, match="text or a whole number"):
            lab.rng(wrong)


def test_a_later_visit_sees_the_robot_as_warm_as_a_campaign_does():
    """Visit k begins when k visits have ended, as those of a trial do."""
    warm = SMALL | {"truth.thermal_k": 10.0, "truth.thermal_h": 0.2}
    lab, places = truebed.laboratory("quick", warm), np.arange(10)
    q, span = lab.poses[places], 10 * lab.inside.tracker.pose_time
    for repeat in (0, 7):
        read = np.mean(
            [lab.measure(places, f"{k}", repeat=repeat).position for k in range(25)], axis=0
        )
        time = repeat * span + lab.inside.tracker.pose_time * np.arange(10)
        true = lab.inside.truth.poses(q, time=time)[:, :3, 3]
        # 17.5 um over 25 readings; between the visits lengths grow by some 60 um
        assert np.abs(read - true).max() < 4.5 * 3.5e-6


def test_a_pose_that_comes_twice_says_what_it_met_each_time():
    """The side it was come from, and what hung on the arm."""
    lab = truebed.laboratory("quick", SMALL | {"truth.preset": "payloads"})
    places = [5, 7, 9, 5]
    seen = lab.measure(places, "x")
    assert seen.pose_id.tolist() == places
    assert seen.conditions.payload.tolist() == [0.0, 5.0, 0.0, 5.0]
    moves = np.diff(lab.poses[[5, *places]], axis=0)[1:]
    np.testing.assert_array_equal(seen.conditions.approach[1:], np.sign(moves))
    # 5 kg bend the arm by tenths of a millimetre
    assert np.linalg.norm(seen.position[3] - seen.position[0]) > 1e-4


def test_what_hangs_on_the_arm_at_held_out_poses_is_known_to_a_model_that_asks():
    """A payload unlike the mean of those measured; unsaid, it costs such a model 0.14 mm."""
    changes = {
        "truth.preset": "payloads",
        "truth.payload_kg": 5.0,
        "identification.model": "choose",
        "identification.estimators": ["whitened"],
        "uncertainty.repeats": 2,
        "pool.size": 100,
        "test.poses": 25,
        "trial": [{"name": "all", "poses": 80, "method": "random"}],
    }
    lab = truebed.laboratory("quick", changes)
    seen = lab.measure(range(80), "all")
    found = estimator_for(lab.inside, "whitened", seen).fit(seen)
    assert found.model.joint_errors.springs is not None
    assert lab.mean_error(found) < 20e-6
    trial = truebed.run(truebed.scene("quick", changes)).trials[0]
    assert trial.estimates[0].comparison.after.mean() < 20e-6
    stated = trial.estimates[0].statement
    assert stated.attained[stated.names.index("region")] > 0.9


def test_another_robot_is_met_from_stations_and_reflectors_of_its_own():
    lab = truebed.laboratory("stations", SMALL)
    other = lab.another("other", 1)
    seen, there = (one.measure(range(20), "x") for one in (lab, other))
    assert len(seen) == len(there)
    own, nominal = (one.inside.truth.model.fixtures for one in (other, lab)), lab.nominal.fixtures
    steps = [nominal.step_to(one) for one in own]
    assert not (steps[0] == steps[1])[steps[0] != 0].any()
    assert (steps[0] == 0).tolist() == (steps[1] == 0).tolist()  # known places stay known
    # what is read is of these places: nothing but noise is left, and terms that no model has
    found = predict(other.inside.truth.model, there).misses
    assert found.max() < 1e-3 < predict(lab.inside.truth.model, there).misses.max()


def test_own_joints_may_leave_the_box_but_not_what_the_robot_can_do(lab):
    high = np.zeros((1, 6))  # straight up: above the box that candidates come from
    assert len(lab.measure(high, "up")) == 1
    turned = np.full((1, 6), 9.0)
    for wrong, sentence in (
        (turned, "pose 0 cannot be measured: joint limits"),
        (np.radians([[0.0, 0, 150, 0, 0, 0]]), "pose 0 cannot be measured: "),
        (np.zeros((2, 5)), "poses has shape (2, 5); axis 1 should be 6"),
        ([60], "poses is 60; expected 0 to 59"),
        ([-1], "poses is -1; expected 0 to 59"),
        ([], "poses is empty; one pose or more"),
        ([[np.nan] * 6], "poses[0, 0] is nan"),
    ):
        with pytest.raises(InputError) as caught:
            lab.measure(wrong, "x")
        assert sentence in str(caught.value)
    for call, sentence in (
        (lambda: lab.errors("geometry"), "found is of the type str"),
        (lambda: lab.errors(lab.nominal, np.zeros(6)), "q has shape (6,); expected (m, 6)"),
        (lambda: lab.blocks("white"), "kind is white; whitened or paper"),
    ):
        with pytest.raises(InputError) as caught:
            call()
        assert sentence in str(caught.value)


@pytest.mark.parametrize("scene", ["position_only", "stations"])
def test_where_points_are_measured_there_are_no_rows_of_the_paper(scene):
    lab = truebed.laboratory(scene, SMALL)
    assert lab.blocks().shape[0] == 60
    with pytest.raises(InputError, match="of full poses, which this laboratory"):
        lab.blocks("paper")


def test_a_scenario_that_cannot_be_played_is_refused_by_its_name(monkeypatch):
    monkeypatch.setattr(pool, "PATIENCE", ((4_000, 1e-3), (4_000, 1e-2)))
    with pytest.raises(InputError) as caught:
        truebed.laboratory("quick", SMALL | {"pool.box_center_mm": [9000.0, 0.0, 0.0]})
    assert 'scenario "quick"' in str(caught.value)
    with pytest.raises(InputError) as caught:
        truebed.laboratory("quick", SMALL | {"robot": "universal_ur10"})
    assert 'scenario "quick"' in str(caught.value)
    assert "wen2022" in str(caught.value)


def test_places_are_taken_as_a_mask_too_and_what_are_none_is_said_so(lab):
    mask = np.isin(np.arange(len(lab.poses)), [2, 4])
    assert np.array_equal(lab.measure(mask, "a").q, lab.poses[[2, 4]])
    problem = calib.design.Problem.of_blocks(lab.blocks(), 29, "D")
    chosen = calib.design.random_set(problem, lab.rng("set"))
    with pytest.raises(InputError, match=r"type Selection; .*; give its indices"):
        lab.measure(chosen, "a")
    with pytest.raises(InputError, match="poses is of the type int; places"):
        lab.measure(3, "a")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: truebed.robot(None), "name_or_path is of the type NoneType; a name or a path"),
        (lambda: truebed.scene("quick", ["seed"]), "changes is of the type list; .*give a dict"),
        (lambda: truebed.scene(3), "scenario is of the type int; a name or a path"),
        (lambda: truebed.save("a.npz", {}), "path is of the type dict; a name or a path"),
        (lambda: truebed.load(None), "folder is of the type NoneType"),
    ],
)
def test_what_is_no_name_and_no_path_is_said_so(wrong, message):
    with pytest.raises(InputError, match=message):
        wrong()
