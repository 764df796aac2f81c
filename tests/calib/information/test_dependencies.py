"""What a reduction says of dropped numbers is a record, from which its words can be left out."""

import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.information.reduction import Dependency, reduce

MODEL = RobotModel(Chain(np.zeros((2, 5))))


def made(*columns, names=("theta1", "a1", "alpha1"), q=None):
    """The reduction of a Jacobian with these columns."""
    return reduce(np.stack(columns, axis=1), parameters_of(MODEL).freeing(names), model=MODEL, q=q)


def test_each_dropped_number_has_what_stands_for_it_and_the_sentence_that_says_so():
    one, other = np.array([1.0, 0.0, 2.0]), np.array([0.0, 1.0, 1.0])
    found = made(one, other, one + other)
    assert found.dependencies == (Dependency("alpha1", "theta1, a1"),)
    (told,) = found.sentences
    assert told.startswith("alpha1 cannot be told from theta1, a1: 1 rad of alpha1 looks like ")
    assert found.causes == found.sentences_without(["alpha1"]) == ()
    silent = made(one, other, 0 * one)
    assert silent.dependencies == (Dependency("alpha1", ""),)
    assert silent.sentences_without(["theta1"]) == silent.sentences


def test_causes_stay_whatever_dropped_numbers_are_left_out():
    q = np.array([[0.1, 0.5], [0.2, 0.5], [0.3, 0.5]])
    found = made(np.ones(3), 2 * np.ones(3), -np.ones(3), q=q)
    assert [one.name for one in found.dependencies] == list(found.dropped)
    assert len(found.sentences) == len(found.causes) + 2
    assert found.causes[0].startswith("joint 2 never moves")
    assert found.sentences_without(found.dropped) == found.causes
    assert found.sentences_without([found.dropped[0]]) == (*found.causes, found.sentences[-1])


@pytest.mark.parametrize("count", [4, 6])
def test_of_many_numbers_that_stand_for_one_the_first_four_are_named(count):
    rng = np.random.default_rng(3)
    names = ("theta1", "d1", "a1", "alpha1", "theta2", "a2", "alpha2")[: count + 1]
    basis = rng.normal(size=(count, 9))
    found = made(*basis, basis.sum(axis=0), names=names)
    (one,) = found.dependencies
    more = f" and {count - 4} smaller terms" * (count > 4)
    assert len(one.others.removesuffix(more).split(", ")) == 4
    assert one.others.endswith(more)
    assert f"{one.name} cannot be told from {one.others}: 1 " in found.sentences[-1]
