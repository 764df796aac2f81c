"""Values of another kind than wanted: a sentence, not a missing attribute."""

import numpy as np
import pytest

import calib
from calib.errors import InputError

LINKS = [[0, 0.4, 0.1, -1.57, 0], [0, 0, 0.5, 0, 0], [0, 0, 0.4, 0, 0]]
ARM = calib.RobotModel(calib.Chain(LINKS))
Q = np.random.default_rng(0).uniform(-2, 2, (60, 3))
SEEN = calib.points(Q, ARM.poses(Q)[:, :3, 3], sd=2e-5)
TRAIN, TEST = SEEN.split(held_out=20)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda: calib.calibrate(LINKS, SEEN), "model is of the type list; a calib.RobotModel"),
        (lambda: calib.calibrate(ARM, Q), "measured is of the type ndarray; calib.Measurements, "),
        (lambda: calib.identify(ARM, Q, None), "measurements is of the type ndarray"),
        (lambda: calib.identify(ARM, SEEN, ["d1"]), "what calib.parameters_of gave"),
        (lambda: calib.RobotModel(LINKS), "chain is of the type list; a calib.Chain"),
        (lambda: calib.calibrate(ARM, TRAIN).judge(Q), "test is of the type ndarray"),
        (
            lambda: calib.judge(calib.calibrate(ARM, TRAIN), TEST, train=TRAIN),
            "calib.calibrate has it as .identification",
        ),
        (
            lambda: calib.Chain(np.zeros((3, 4))),
            r"links has shape \(3, 4\); theta, d, a, alpha, beta of each joint; add a column of ",
        ),
        (
            lambda: ARM.poses(np.zeros(3)),
            r"q has shape \(3,\); expected \(m, 3\); one pose is a table of one row: \[q\]",
        ),
        (lambda: ARM.poses(np.zeros(5)), r"q has shape \(5,\); expected \(m, n\)"),
        (lambda: calib.Chain(np.zeros((3, 6))), r"\(3, 6\); axis 1 should be 5\."),
    ],
)
def test_a_value_of_another_kind_is_refused_in_words(wrong, sentence):
    with pytest.raises(InputError, match=sentence):
        wrong()


def test_a_name_that_is_not_there_can_be_guessed_by_python():
    """Python's own traceback says "Did you mean" where an error has the name and the module."""
    with pytest.raises(AttributeError) as caught:
        calib.calibrated  # noqa: B018
    assert (caught.value.name, caught.value.obj) == ("calibrated", calib)
