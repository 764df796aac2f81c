"""Values of another kind than wanted: a sentence, not a missing attribute."""

import inspect

import numpy as np
import pytest

import calib
from calib.arrays import frozen
from calib.errors import InputError
from calib.geometry.gravity import Weight
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.operating import OperatingConditions, approaches
from calib.geometry.springs import SprungJoints

LINKS = [[0, 0.4, 0.1, -1.57, 0], [0, 0, 0.5, 0, 0], [0, 0, 0.4, 0, 0]]
ARM = calib.RobotModel(calib.Chain(LINKS))
Q = np.random.default_rng(0).uniform(-2, 2, (60, 3))
SEEN = calib.points(Q, ARM.poses(Q)[:, :3, 3], sd=2e-5)
TRAIN, TEST = SEEN.split(held_out=20)
SLIDES = calib.Chain(LINKS, ("prismatic",) * 3)
SLIDING = SprungJoints(Weight(SLIDES, np.ones((3, 4))), [1], [2], [1.0], np.zeros((3, 4)))


def with_term(name, joint, wave="sin", weights=(0, 1, 0)):
    return calib.RobotModel(ARM.chain, JointErrors((JointTerm(name, joint, wave, weights),)))


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
        (
            lambda: calib.points(Q, np.ma.masked_less(Q, 0.0), sd=2e-5),
            "has masked entries; every entry must be a number; leave these rows out",
        ),
        (lambda: ARM.poses(Q + 0j), "q is complex; every entry must be a real number"),
        (
            lambda: JointTerm("a", 1, "tan", (0, 1, 0)),
            "wave of the term a is 'tan'; expected one of sin, cos, approach, torque, lengths",
        ),
        (lambda: JointTerm("a", 1, "sin", (0, np.nan, 0)), r"weights\[1\] is nan"),
        (lambda: with_term("a", 3), r"term a \(sin\) is on joint 3; -1 of lengths, else 0 to 2"),
        # Python counts from the end, and nothing would move by it
        (lambda: with_term("a", -2), r"term a \(sin\) is on joint -2"),
        (lambda: with_term("a", -1), r"term a \(sin\) is on joint -1"),
        (lambda: with_term("a", 0, "lengths"), r"term a \(lengths\) is on joint 0"),
        (lambda: with_term("a", 0, weights=(1,)), "has 1 weights; one for each of 3 joints"),
        (
            lambda: calib.parameters_of(with_term("theta2", 0)),
            "two numbers of the model are called theta2; rename the term",
        ),
        (lambda: calib.RobotModel(ARM.chain, ()), "joint_errors is of the type tuple"),
        (lambda: calib.RobotModel(ARM.chain, fixtures=None), "fixtures is of the type NoneType"),
        (
            lambda: calib.RobotModel(ARM.chain, JointErrors(springs=SLIDING)),
            "springs weigh an arm of joints .*prismatic.*; those of the chain",
        ),
        (
            lambda: ARM.poses(Q, OperatingConditions(torque=np.zeros((60, 2)))),
            "torque has 2 columns; one for each of 3 joints",
        ),
        (lambda: approaches(Q, [1, 0]), r"order has shape \(2,\); one for each of 60 poses"),
        (lambda: calib.parameters_of(ARM, length=0.0), "length is 0.0; expected above 0 m"),
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


def test_a_mask_that_hides_nothing_is_no_hindrance():
    bare = np.ma.masked_array(Q, mask=np.zeros(Q.shape, dtype=bool))
    np.testing.assert_array_equal(ARM.poses(bare), ARM.poses(Q))


def test_what_somebody_else_can_write_is_copied_and_what_nobody_can_is_kept():
    links = np.array(LINKS)
    shown = links[:]
    shown.setflags(write=False)
    chain = calib.Chain(shown)
    links[:] = 9.0
    np.testing.assert_array_equal(chain.links, LINKS)
    # memory that is no array's: bytes never change, a bytearray does
    fixed, loose = (np.frombuffer(kind(np.ones(3).tobytes())) for kind in (bytes, bytearray))
    loose.setflags(write=False)
    assert frozen(fixed) is fixed
    assert frozen(loose) is not loose
    # what is frozen, and its rows, are never copied again
    kept = frozen(LINKS)
    assert frozen(kept) is kept
    assert frozen(kept[1:]).base is kept


def test_help_shows_the_kinds_of_arguments_as_they_are_written():
    shown = str(inspect.signature(calib.points))
    assert shown.startswith("(q: ArrayLike, xyz: ArrayLike, *, sd: ArrayLike, offset: ArrayLike = ")
    assert shown.endswith("pose_id: ArrayLike | None = None, repeat: ArrayLike | None = None) "
                          "-> Measurements")  # fmt: skip
    shown = str(inspect.signature(calib.calibrate))
    assert shown.startswith("(model: RobotModel, measured: Measurements, *, free: Iterable[str] |")


def test_nothing_that_is_public_shows_what_numpy_calls_an_array_like():
    rooms = (calib, calib.design, calib.uncertainty)
    public = [getattr(room, name) for room in rooms for name in dir(room) if name[0] != "_"]
    kinds = {thing for thing in public if inspect.isclass(thing)}
    methods = [vars(kind)[name] for kind in kinds for name in vars(kind) if name[0] != "_"]
    methods = [getattr(method, "__func__", method) for method in methods]
    told = [
        (call.__qualname__, str(inspect.signature(call)))
        for call in (*public, *methods)
        if inspect.isfunction(call)
    ]
    assert len(told) > 80
    assert not [name for name, shown in told if "_SupportsArray" in shown]
