"""Targets under other conditions than the data: the rule by loops, and every sentence."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.statement.conditions import (
    CENTER,
    MOST_NAMED,
    NOT_STATED,
    UNITS,
    Conditions,
    Tolerance,
)
from calib.uncertainty.statement.departure import AS_MEASURED, PLACED, counted, departure, named

PAYLOAD = Conditions(payload=np.array([0.0, 0.0, 2.0]))


def drawn(rng, count):
    """Conditions of some rows, each kind stated or not, on a grid that meets the limits."""
    names = np.array(["probe", "gripper", "welder"])
    return Conditions(
        np.round(rng.uniform(0, 6, count) * 4) / 4 if rng.random() < 0.7 else None,
        tuple(map(str, rng.choice(names, count))) if rng.random() < 0.7 else None,
        np.round(rng.uniform(15, 30, count) * 2) / 2 if rng.random() < 0.7 else None,
    )


def alone(data, target, tolerance):
    """The kinds of one target that no row of the data, nor any two around it, allow."""
    kinds = []
    if data.payload is not None and target["payload"] is not None:
        at, room = target["payload"], tolerance.payload
        near = any(abs(at - x) <= room for x in data.payload)
        between = any(x <= at <= y for x in data.payload for y in data.payload)
        kinds += ["payload"] * (not near and not between)
    if data.tool is not None and target["tool"] is not None:
        kinds += ["tool"] * all(target["tool"] != name for name in data.tool)
    if data.temperature is not None and target["temperature"] is not None:
        at, room = target["temperature"], tolerance.temperature
        near = any(abs(at - x) <= room for x in data.temperature)
        between = any(x <= at <= y for x in data.temperature for y in data.temperature)
        kinds += ["temperature"] * (not near and not between)
    return kinds


def test_the_rule_is_that_of_a_loop_over_rows_and_pairs_of_rows():
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(400):
        data, targets = drawn(rng, rng.integers(1, 5)), drawn(rng, 7)
        tolerance = Tolerance() if rng.random() < 0.5 else Tolerance(0.25, 0.5)
        found = departure(data, targets, 7, tolerance)
        for k in range(7):
            target = {
                kind: None if getattr(targets, kind) is None else getattr(targets, kind)[k]
                for kind in UNITS
            }
            kinds = alone(data, target, tolerance)
            silent = [kind for kind in targets.stated if kind not in data.stated]
            assert bool(found.outside[k]) == bool(kinds or silent)
            both = set(data.stated) & set(targets.stated)
            inside = AS_MEASURED if both else NOT_STATED
            said = [f"other {' and '.join(kinds)}"] if kinds else []
            said += [f"{' and '.join(silent)} of the measurements not stated"] if silent else []
            assert found.words[k] == ("; ".join(said) or inside)
            seen.add(found.words[k])
    # each of three kinds is the same, other or unknown; the same is one of two words
    assert len(seen) == 3**3 + 1


def test_half_a_kilogram_and_two_kelvin_are_no_difference_and_a_hair_more_is():
    data = Conditions(np.array([1.0]), None, np.array([20.0, 21.0]))
    at = Conditions(np.array([0.5, 1.5, 1.0, 1.0]), None, np.array([20.0, 20.0, 18.0, 23.0]))
    assert not departure(data, at, 4).outside.any()
    past = Conditions(
        np.array([0.499, 1.501, 1.0, 1.0]), None, np.array([20.0, 20.0, 17.99, 23.01])
    )
    assert departure(data, past, 4).outside.all()
    # a mass between two that were measured is no extrapolation
    between = Conditions(payload=np.array([1.0]))
    assert not departure(PAYLOAD, between, 1).outside.any()


def test_targets_that_say_nothing_are_refused_nothing():
    """What only the data state is a condition that whoever uses the targets can keep."""
    found = departure(PAYLOAD, Conditions(), 3)
    assert not found.outside.any()
    assert found.words == (NOT_STATED,) * 3
    assert found.sentences == found.unknown == ()
    assert len(found.unsaid) == 1
    nobody = departure(Conditions(), Conditions(), 3)
    assert not nobody.outside.any()
    assert nobody.unsaid == ()


@pytest.mark.parametrize("kind", UNITS)
def test_nothing_is_stated_under_a_condition_of_which_the_data_say_nothing(kind):
    """Neither of a payload nor of a tool or a temperature is it known that it was the same."""
    values = {"payload": np.ones(3), "tool": ("probe",) * 3, "temperature": np.full(3, 20.0)}
    targets = Conditions(**{kind: values[kind]})
    no_rows = Conditions(np.zeros(0), (), np.zeros(0))
    assert no_rows.stated == ()
    others = Conditions(**{name: values[name] for name in UNITS if name != kind})
    for data in (Conditions(), no_rows, others):
        found = departure(data, targets, 3)
        assert found.outside.all()
        assert found.unknown == (kind,)
        assert found.words == (f"{kind} of the measurements not stated",) * 3
        assert found.sentences == ()
        assert f"the targets state their {kind} (" in found.unsaid[-1]
        assert "nothing can be stated at these targets" in found.unsaid[-1]
    assert not departure(targets, targets, 3).outside.any()


def test_every_sentence():
    data = Conditions(np.zeros(3), ("probe",) * 3, np.array([20.1, 21.34, 20.5]))
    one = Conditions(np.array([0, 5.0]), ("probe", "gripper"), np.array([20.0, 31.0]))
    assert departure(data, one, 2).sentences == (
        "target 2 carries 5 kg; the measurements had a payload of 0 kg: nothing can be stated "
        "there until rows whose payload varies as much have identified a term for it",
        "target 2 has the tool gripper; the measurements had the tool probe: nothing can be stated "
        "there until rows have been measured with that tool",
        "target 2 is at 31 degC; the measurements were at 20.1 to 21.34 degC: nothing can be "
        "stated there until rows whose temperature varies as much have identified a term for it",
    )
    many = Conditions(
        np.linspace(0, 30, 31), ("gripper",) * 30 + ("probe",), np.array([40.0, 10.0] + [21.0] * 29)
    )
    said = departure(PAYLOAD, many, 31).sentences
    assert said == (
        "targets 4, 5, 6, 7, 8, 9, 10, 11, 12, 13 and 18 more carry 3 to 30 kg; the measurements "
        "had a payload of 0 to 2 kg: nothing can be stated there until rows whose payload varies "
        "as much have identified a term for it",
    )
    assert int(departure(PAYLOAD, many, 31).other["payload"].sum()) == MOST_NAMED + 18
    payload, tool, warm = (
        departure(data, many, 31).clauses(partial(named, "row"), "the others").values()
    )
    assert payload.startswith("rows 2, 3,")
    assert tool.endswith("and 20 more have the tool gripper; the others had the tool probe")
    assert warm == "rows 1 and 2 are at 10 to 40 degC; the others were at 20.1 to 21.34 degC"
    two = Conditions(tool=("gripper", "welder", "probe"))
    (tools,) = departure(data, two, 3).clauses(partial(counted, "row"), "the others").values()
    assert tools == "2 rows have the tools gripper and welder; the others had the tool probe"


def test_what_only_one_side_states_is_said():
    data = Conditions(np.zeros(3), None, np.array([20.0, 21.0, 22.0]))
    targets = Conditions(np.zeros(2), ("probe", "gripper"))
    assert departure(data, targets, 2).unsaid == (
        "the targets do not state their temperature: the statement holds as long as that is the "
        "same as in the measurements (temperature 20 to 22 degC)",
        "the targets state their tool (tool probe and gripper), and the measurements do not: "
        "whether it is the same is unknown, so that nothing can be stated at these targets until "
        "the measurements state it",
    )
    both = Conditions(np.ones(2), ("probe", "gripper"))
    assert "their payload and tool (payload 1 kg, tool probe and gripper)" in (
        said := departure(Conditions(), both, 2).unsaid[0]
    )
    assert "whether they are the same is unknown" in said


def test_lists_that_are_endless_are_cut_and_results_print_as_one_line():
    names = tuple(f"T{k}" for k in range(14))
    assert Conditions(tool=names).words("tool").endswith("T9 and 4 more")
    assert Conditions(tool=names).words("payload") == ""
    assert Conditions().phrase == ""
    assert Conditions(np.ones(2), ("probe",) * 2, np.array([20, 21.0])).phrase == (
        "with a payload of 1 kg and the tool probe at 20 to 21 degC"
    )
    assert Conditions(temperature=np.ones(1)).phrase == "at 1 degC"
    assert repr(Conditions()) == "Conditions(not stated)"
    assert repr(PAYLOAD) == "Conditions(0 to 2 kg)"
    assert repr(departure(PAYLOAD, PAYLOAD, 3)) == "Departure(0 of 3 outside)"


def test_rows_are_chosen_by_mask_and_by_index():
    rows = Conditions(np.arange(3.0), ("a", "b", "c"), None)
    for which in (np.array([False, True, True]), np.array([1, 2])):
        some = rows.rows(which)
        assert some.payload.tolist() == [1.0, 2.0]
        assert some.tool == ("b", "c")
        assert some.temperature is None


def test_a_column_of_another_length_is_refused():
    with pytest.raises(InputError, match="payload is 3; one for each of 2 targets"):
        departure(PAYLOAD, PAYLOAD, 2)
    with pytest.raises(InputError, match=r"targets\[1\] is nan"):
        departure(PAYLOAD, Conditions(payload=np.array([0.0, np.nan])), 2)


def test_a_payload_of_the_same_mass_that_hangs_elsewhere_is_another_one():
    """Half a kilogram at 100 mm is the room: 5 kg may hang 10 mm elsewhere, and no more."""

    def hung(*x_mm):
        center = np.array([[x, 0.0, 50.0] for x in x_mm]) / 1e3
        return Conditions(payload=np.full(len(x_mm), 5.0), center=center)

    found = departure(hung(0.0, 20.0), hung(-9.0, 29.0, 31.0, 520.0), 4)
    assert found.other["payload"].tolist() == [False, False, True, True]
    assert found.sentences[0].startswith(
        "targets 3 and 4 carry 5 kg at 31 to 520, 0, 50 mm; the measurements had a payload of 5 kg "
        "at 0 to 20, 0, 50 mm: nothing can be stated there"
    )


def test_a_center_that_one_side_states_is_as_a_payload_that_one_side_states():
    """Targets that say where a load hangs of which nobody knows that have no region."""
    unsaid = Conditions(payload=np.full(4, 5.0))
    center = np.array([[0.0, 0.0, 0.9]] * 4)
    mine = departure(replace(unsaid, center=center), unsaid, 4)
    assert not mine.outside.any()
    assert mine.unsaid == (
        "the targets do not state their payload center: the statement holds as long as that is the "
        "same as in the measurements (payload center at 0, 0, 900 mm)",
    )
    # what weighs no more than the tolerance may hang anywhere, and another mass is said as one
    weights = np.array([5.0, 4.8, 0.5, 9.0])
    some = Conditions(payload=np.array([0.0, 5.0]))
    theirs = departure(some, Conditions(payload=weights, center=center), 4)
    assert theirs.unknown == (CENTER,)
    assert theirs.outside.tolist() == [True, True, False, True]
    assert theirs.words == (
        "payload center of the measurements not stated",
        "payload center of the measurements not stated",
        AS_MEASURED,
        "other payload",
    )
    assert theirs.unsaid == (
        "the targets state their payload center (payload center at 0, 0, 900 mm), and the "
        "measurements do not: whether it is the same is unknown, so that nothing can be stated at "
        "these targets until the measurements state it",
    )
    # of an arm that carried nothing it is known where nothing hung
    bare = Conditions(payload=np.zeros(3))
    light = Conditions(payload=np.full(4, 0.4), center=center / 90)
    assert not departure(bare, light, 4).outside.any()
    assert departure(bare, replace(light, center=center), 4).outside.all()
    assert departure(bare, light, 4).unsaid == ()


def test_a_tool_whose_point_is_stated_is_no_other_tool():
    tools = Conditions(tool=("probe", "gripper", "welder"))
    for data, untold in ((Conditions(tool=("probe",) * 2), ()), (Conditions(), ("tool",))):
        found = departure(data, tools, 3, placed=("gripper",))
        assert found.outside.tolist() == [bool(untold), False, True]
        assert found.placed.tolist() == [False, True, False]
        assert found.words[1] == PLACED
        assert found.unknown == untold
    assert "(tool probe and welder)" in found.unsaid[0]
    alone = departure(Conditions(), Conditions(tool=("gripper",) * 3), 3, placed=("gripper",))
    assert not alone.outside.any()
    assert alone.unknown == alone.unsaid == ()
