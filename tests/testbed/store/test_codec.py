"""Records go to flat arrays and back bit for bit; what has no place on disk is refused."""

import math
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from typing import Annotated, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from calib.arrays import LATER, Array, Bool, FloatOrNan, Index, Labels
from calib.errors import CalibError
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Identification, identify
from calib.identification.outliers.moved import Moved
from calib.identification.prior import weak_prior
from testbed.store.codec import pack, unpack
from testbed.store.quantities import METRE
from tests.reference import pool_r, rigid_truth, tx60
from tests.truth.measuring import measured


class Mood(Enum):
    GOOD = "all is well"
    BAD = "try again"


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    text: str
    number: float
    count: int
    flag: bool
    mood: Mood
    kind: Literal["a", "b"]


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    leaves: tuple[Leaf, ...]
    pair: tuple[int, str]
    words: tuple[str, ...]
    values: Array
    truth: Bool
    index: Index
    names: Labels
    maybe: Leaf | None
    limit: float | None


LEAVES = st.builds(
    Leaf,
    text=st.text(max_size=8),
    number=st.floats(allow_nan=False, allow_infinity=False),
    count=st.integers(-(2**70), 2**70),
    flag=st.booleans(),
    mood=st.sampled_from(Mood),
    kind=st.sampled_from(["a", "b"]),
)
SHAPES = hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
TREES = st.builds(
    Tree,
    leaves=st.lists(LEAVES, max_size=3).map(tuple),
    pair=st.tuples(st.integers(), st.text(max_size=3)),
    words=st.lists(st.text(max_size=3), max_size=3).map(tuple),
    values=hnp.arrays(np.float64, SHAPES, elements=FINITE),
    truth=hnp.arrays(np.bool_, SHAPES),
    index=hnp.arrays(np.int64, SHAPES),
    # numpy text drops trailing NUL characters
    names=hnp.arrays("U4", SHAPES, elements=st.text("abö€", max_size=4)),
    maybe=st.none() | LEAVES,
    limit=st.none() | FINITE,
)


def same(one, other) -> bool:
    """Equality down to the last bit, the sign of zero included."""
    if type(one) is not type(other):
        return False
    if is_dataclass(one):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return (
            one.dtype == other.dtype
            and one.shape == other.shape
            and one.tobytes() == other.tobytes()
        )
    if isinstance(one, float):
        return np.float64(one).tobytes() == np.float64(other).tobytes()
    return one == other


@given(TREES)
def test_a_record_comes_back_bit_for_bit(tree):
    assert same(tree, unpack(Tree, pack(tree)))


@given(TREES)
def test_a_record_comes_back_from_its_file_bit_for_bit(tree):
    from testbed.store.npz import record_bytes, record_from

    data = record_bytes("k", tree, "spec")
    assert data == record_bytes("k", tree, "spec")
    assert same(tree, record_from(data, "k", Tree, "spec"))


def test_arrays_come_back_read_only():
    leafless = Tree((), (1, "x"), (), np.ones(2), *[np.zeros(1, t) for t in "?qU"], None, None)
    back = unpack(Tree, pack(leafless))
    with pytest.raises(ValueError, match="read-only"):
        back.values[0] = 2


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_an_infinite_number_is_refused_by_name(value):
    with pytest.raises(CalibError, match=r"leaves\.0\.number is -?inf; a record holds finite"):
        pack(Tree((Leaf("", value, 0, True, Mood.GOOD, "a"),), *[None] * 8))


def test_a_nan_in_an_array_is_refused_with_its_place():
    @dataclass(frozen=True)
    class One:
        values: Array

    with pytest.raises(CalibError, match=r"values\[0, 1\] is nan"):
        pack(One(np.array([[0, np.nan]])))


def test_a_nan_survives_as_null_where_the_field_says_that_it_may_be_one_and_nowhere_else():
    @dataclass(frozen=True)
    class One:
        ratio: FloatOrNan
        shown: Annotated[FloatOrNan, METRE]
        sure: float = 1.0

    assert pack(One(math.nan, math.nan)) == {"ratio": None, "shown": None, "sure": 1.0}
    back = unpack(One, {"ratio": None, "shown": None, "sure": 1.0})
    assert math.isnan(back.ratio)
    assert math.isnan(back.shown)
    with pytest.raises(CalibError, match="sure is nan; a record holds finite numbers only"):
        pack(One(0.5, 0.5, math.nan))
    for value in (None, math.nan, math.inf):
        with pytest.raises((ValueError, CalibError), match=r"sure is (None|nan|inf)"):
            unpack(One, {"ratio": 0.5, "shown": 0.5, "sure": value})


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.ones(2, complex), "holds complex128, not float64"),
        (np.ones(2, "f4"), "holds float32, not float64"),
        (np.ones(2, ">f8"), "holds >f8, not float64"),
        (np.ones(2, int), "holds int64, not float64"),
        (np.array([None]), "holds object, not float64"),
        (np.array(["1"]), "holds <U1, not float64"),
        (np.array([0.0, np.nan]), r"values\[1\] is nan"),
        (np.array([[-np.inf]]), r"values\[0, 0\] is -inf"),
        (1.0, "values is not an array"),
    ],
)
def test_an_array_of_a_file_is_of_the_kind_that_the_field_declares_and_finite(array, message):
    @dataclass(frozen=True)
    class One:
        values: Array

    with pytest.raises((ValueError, CalibError), match=message):
        unpack(One, {"values": array})


@pytest.mark.parametrize("value", [np.float64(0.1), np.int64(3), np.bool_(1), np.str_("a")])
def test_a_number_of_numpy_is_kept_as_the_plain_one(value):
    @dataclass(frozen=True)
    class One:
        thing: object

    (kept,) = pack(One(value)).values()
    assert type(kept) is type(value.item())
    assert kept == value


@pytest.mark.parametrize("value", [{"a": 1}, [1], b"x", 1j, np.array([None])])
def test_what_has_no_place_on_disk_is_refused(value):
    @dataclass(frozen=True)
    class One:
        thing: object

    with pytest.raises(TypeError, match=r"thing .* no place on disk"):
        pack(One(value))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"text": 3}, "text is 3, not str"),
        ({"count": 1.0}, "count is 1.0, not int"),
        ({"count": True}, "count is True, not int"),
        ({"flag": 1}, "flag is 1, not bool"),
        ({"mood": "UGLY"}, "mood is 'UGLY', not a Mood"),
        ({"extra": 1}, "extra is not a field of Leaf"),
        ({"number": None, "text": None}, "text is None, not str"),
    ],
)
def test_content_that_does_not_fit_the_class_is_refused(change, message):
    good = pack(Leaf("x", 1.0, 2, True, Mood.BAD, "a"))
    with pytest.raises(ValueError, match=message):
        unpack(Leaf, good | change)
    del good["text"]
    with pytest.raises(ValueError, match="text is missing"):
        unpack(Leaf, good)


@pytest.mark.parametrize("loss", ["squared", "cauchy"])
def test_an_identification_with_prior_repeats_and_weights_comes_back(loss):
    rng = np.random.default_rng(1)
    q = np.tile(pool_r()[:12], (2, 1))
    parameters = parameters_of(tx60())
    table = measured(rigid_truth(rng), q, rng)
    found = identify(tx60(), table, parameters, prior=weak_prior(parameters), loss=loss)
    back = unpack(Identification, pack(found))
    assert (back.loss, back.lack_of_fit) == (loss, found.lack_of_fit)
    assert (back.log_evidence, back.dof_effective) == (found.log_evidence, found.dof_effective)
    assert back.prior.names == found.prior.names
    np.testing.assert_array_equal(back.prior.precision, found.prior.precision)
    np.testing.assert_array_equal(back.weights, found.weights)
    plain = identify(tx60(), table, parameters)
    again = unpack(Identification, pack(plain))
    assert again.prior is None
    assert np.isnan(again.log_evidence)


def test_a_field_that_is_newer_than_a_record_has_its_default_there_and_nowhere_else():
    @dataclass(frozen=True)
    class Inner:
        values: Array | None = None

    @dataclass(frozen=True)
    class One:
        old: float
        number: Annotated[float, LATER] = 0.5
        inner: Annotated[Inner, LATER] = Inner()

    new = One(1.0, 2.0, Inner(np.ones(3)))
    assert unpack(One, pack(new)).inner.values.tolist() == [1.0, 1.0, 1.0]
    assert unpack(One, {"old": 1.0}) == One(1.0)
    with pytest.raises(ValueError, match="old is missing"):
        unpack(One, {"number": 2.0})
    with pytest.raises(ValueError, match="number is 'x', not float"):
        unpack(One, {"old": 1.0, "number": "x"})


def test_a_step_of_a_calibration_from_before_its_alternatives_were_told_is_read():
    """`truebed report` refused such folders."""
    now = Moved("tool", 0, 33, 34, 26, np.arange(6.0), 2e-4, 0.97, 1e-9)
    before = {key: value for key, value in pack(now).items() if not key.startswith("or_else")}
    assert unpack(Moved, before).or_else == ()
    told = replace(now, or_else=(("joint", 3), ("station", 0)))
    assert unpack(Moved, pack(told)).or_else == told.or_else
