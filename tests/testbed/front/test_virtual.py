"""The laboratory in a script's hands: what it reads and what it judges are of the same robot."""

import numpy as np
import pytest

import calib
import truebed
from calib.errors import InputError
from truebed import VirtualLaboratory

SMALL = {"pool.size": 60, "test.poses": 20}


@pytest.fixture(scope="module")
def lab() -> VirtualLaboratory:
    return truebed.laboratory("quick", SMALL)


@pytest.mark.parametrize("robot", ["its own", "another"])
def test_the_truth_that_judges_is_the_one_that_is_measured(lab, robot):
    """Mean readings of many visits, which know nothing of `errors`, come to where it says."""
    there = lab if robot == "its own" else lab.another("of the same kind", 1)
    places, visits = np.arange(3), 200
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


def test_own_joints_may_leave_the_box_but_not_what_the_robot_can_do(lab):
    high = np.zeros((1, 6))  # straight up: above the box that candidates come from
    assert len(lab.measure(high, "up")) == 1
    turned = np.full((1, 6), 9.0)
    for wrong, sentence in (
        (turned, "pose 0 cannot be measured: joint limits"),
        (np.radians([[0.0, 0, 150, 0, 0, 0]]), "pose 0 cannot be measured: "),
        (np.zeros((2, 5)), "poses has shape (2, 5); axis 1 should be 6"),
        ([60], "poses is 60; 0 to 59"),
        ([-1], "poses is -1; 0 to 59"),
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


def test_a_scenario_that_cannot_be_played_is_refused_by_its_name():
    with pytest.raises(InputError) as caught:
        truebed.laboratory("quick", SMALL | {"pool.box_center_mm": [9000.0, 0.0, 0.0]})
    assert 'scenario "quick"' in str(caught.value)
    with pytest.raises(InputError) as caught:
        truebed.laboratory("quick", SMALL | {"robot": "universal_ur10"})
    assert 'scenario "quick"' in str(caught.value)
    assert "wen2022" in str(caught.value)
