"""Every message about engines, word for word."""

import pickle
import sys

import pytest

from calib.errors import CalibError, MachineError, TooFewPosesError
from testbed.engines import choice, kit
from testbed.engines.choice import crowded, engine_of, slice_of, workers_of
from testbed.engines.kit import require_alike
from testbed.faults import Fault, one_error
from tests.golden.words import assert_as_written

OURS = {"truebed": "0.1.0", "numpy": "2.4.0", "source code": "0123456789ab"}
CASES = {
    "no workers": lambda _: workers_of("0"),
    "fewer than none": lambda _: workers_of("-2"),
    "a word": lambda _: workers_of("all"),
    "too many workers": lambda _: workers_of("100000"),
    "slice 0": lambda _: slice_of("0/4"),
    "slice 5 of 4": lambda _: slice_of("5/4"),
    "half a slice": lambda _: slice_of("1.5/4"),
    "no slice": lambda _: slice_of("2"),
    "no address": lambda _: engine_of(1, "127.0.0.1:8786"),
    "workers and scheduler": lambda _: engine_of(4, "tcp://127.0.0.1:8786"),
    "no package": lambda _: engine_of(1, "tcp://127.0.0.1:8786"),
    "more workers than cores": lambda _: crowded(64),
    "another version": lambda _: require_alike(OURS | {"truebed": "0.0.9"}),
    "other sources and packages": lambda _: require_alike(
        OURS | {"numpy": "2.5.1", "source code": "ffffffffffff"}
    ),
}


@pytest.fixture(autouse=True)
def _here(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)  # as if it were not installed
    monkeypatch.setattr(choice, "cores", lambda: 2)
    monkeypatch.setattr(kit, "alike", lambda: OURS)


def told(case, path):
    """What is raised, or said."""
    try:
        return f"said\n{case(path)}"
    except CalibError as error:
        return f"{type(error).__name__}\n{str(error).replace(str(path), 'HERE')}"


def test_messages_are_word_for_word_as_written_down(tmp_path):
    text = "\n".join(
        f"{name}: {told(case, tmp_path / str(k))}\n" for k, (name, case) in enumerate(CASES.items())
    )
    assert_as_written(text, "engine_messages.txt")


def test_enough_cores_need_no_word_and_auto_takes_them_all():
    assert [crowded(1), crowded(2), workers_of("auto"), workers_of("12")] == ["", "", 2, 12]


@pytest.mark.parametrize(
    "error",
    [
        MachineError("x is 1", code="F3", field="x", value=1, fix="mend it"),
        TooFewPosesError("3 poses are few", least=6, count=3),
        one_error([Fault(("x",), "x is 1"), Fault(("y",), "y is 2")], ""),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_of_ours_goes_whole_from_process_to_process_and_to_its_place(error):
    placed = error.located("here")
    assert (type(placed), vars(placed)) == (type(error), vars(error) | {"where": "here"})
    assert error.where == ""
    assert placed.located("there") is placed
    for each in (error, placed):
        other = pickle.loads(pickle.dumps(each))
        assert (type(other), vars(other)) == (type(each), vars(each))
        assert other.args == (str(each),)
