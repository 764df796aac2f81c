"""How numbers are written: rounding by the uncertainty, units, signs."""

import json
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.arrays import Array
from testbed import lengths
from testbed import units as quantities
from testbed.store.quantities import (
    AS_NAMED,
    METRE,
    ONE,
    RADIAN,
    SECOND,
    Quantity,
    as_arrays,
    as_json,
    below,
    declared,
    fields_of,
)
from testbed.units import (
    Mean,
    counted,
    decimals,
    fixed,
    percent,
    probability,
    sentence,
    significant,
    with_uncertainty,
)

sizes = st.floats(min_value=1e-7, max_value=50.0)
values = st.floats(min_value=-1e3, max_value=1e3)


def number(text):
    """A written number read back."""
    return float(text.replace("−", "-"))


@given(value=values, u=sizes)
def test_a_value_and_its_uncertainty_end_at_the_same_decimal_and_u_shows_two_digits(value, u):
    written, spread = with_uncertainty(value, u)
    places = [len(text.partition(".")[2]) for text in (written, spread)]
    assert places[0] == places[1]
    digits = spread.replace(".", "").lstrip("0")
    # above 10 the second digit is the unit: a report of mm and deg never rounds to tens
    assert len(digits) == 2 or u >= 9.5
    half = 0.5 * 10.0 ** -places[0]
    # half a unit of the last place, and rounding of float64 in between
    assert abs(number(written) - value) <= half * (1 + 1e-9) + 1e-12
    assert abs(number(spread) - u) <= half * (1 + 1e-9) + 1e-12


@given(value=st.floats(min_value=-1e9, max_value=1e9).filter(lambda v: abs(v) > 1e-12))
def test_significant_digits_keep_the_value_to_half_a_unit_of_the_last_one(value):
    text = significant(value, 3)
    if "×" in text:
        mantissa, power = text.split(" × 10")
        plain = power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
        back = number(mantissa) * 10.0 ** int(plain)
        assert 1.0 <= abs(number(mantissa)) < 10.0
    else:
        back = number(text)
    # three digits: 5 parts in 1000 at worst; integers below a million are written in full
    assert back == pytest.approx(value, rel=5.01e-3)


def test_a_rounded_zero_has_no_sign_and_missing_numbers_say_so():
    assert fixed(-1e-9, 3) == "0.000"
    assert fixed(math.nan, 2) == "not available"
    assert fixed(-math.inf, 2) == "−∞"


def test_rounding_up_to_the_next_power_of_ten_does_not_add_a_digit():
    assert fixed(0.00996, decimals(0.00996, 2)) == "0.010"
    assert with_uncertainty(1.0, 0.0996) == ("1.00", "0.10")


def test_a_sentence_begins_with_a_capital_and_ends_once():
    assert sentence("all done") == sentence("all done.") == "All done."
    assert sentence("is it?") == "Is it?"
    assert sentence("q2 moves", keep_name=True) == "q2 moves."
    assert sentence("note: q2 moves", keep_name=True) == "Note: q2 moves."


def test_small_p_values_are_not_written_out_and_shares_keep_their_sign_on_the_line():
    assert probability(0.0) == "< 0.001"
    assert probability(0.0421) == "0.042"
    assert percent(0.5).startswith("50")
    assert " " not in percent(0.5)
    assert counted(1, "pose") == "1 pose"


def test_millimetres_and_degrees_are_those_of_numpy_and_of_the_metre():
    both = quantities.in_units(np.array([0.001, np.pi]), np.array([True, False]))
    np.testing.assert_allclose(both, [1.0, 180.0], rtol=1e-15)
    assert [quantities.unit_of(True), quantities.unit_of(False)] == ["mm", "deg"]


@dataclass(frozen=True)
class Played:
    """A record whose fields declare their units."""

    radius: Annotated[Array, METRE]
    share: Array
    turn: Annotated[float, RADIAN] = 0.0


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1))
def test_a_quantity_shows_the_very_bits_of_value_times_factor(numbers):
    array = np.array(numbers)
    with np.errstate(over="ignore"):
        for ending, unit, factor in (
            ("mm", METRE, 1e3), ("um", METRE, 1e6), ("m", METRE, 1.0),
            ("deg", RADIAN, 180 / np.pi), ("mdeg", RADIAN, 180e3 / np.pi),
        ):  # fmt: skip
            name = f"some/error_{ending}"
            assert Quantity(name, array, unit).shown == (factor * array).tolist()
            assert Quantity(name, array[0], unit).shown == float(array[0] * factor)
            assert Quantity(name, numbers[0], unit).shown == numbers[0] * factor
            np.testing.assert_array_equal(Quantity(name, array, unit).array, array * factor)


def test_a_document_nests_by_name_in_order_and_holds_only_what_json_has():
    document = as_json(
        [
            Quantity("robots", np.int64(8)),
            Quantity("truths/rigid/before_mm", np.float64(0.25), METRE),
            Quantity("truths/rigid/passed", np.bool_(True)),
            Quantity("budget_u_3d_um", {"tracker": np.float64(1e-6), "combined": None}, METRE),
            *below("truths/full.2", [Quantity("u_s", (1.5, 2), SECOND), Quantity("verdict", "ok")]),
            Quantity("trials", {}),
            Quantity("clearance_mm/wanted", 10, AS_NAMED),
        ]
    )
    assert json.dumps(document) == json.dumps(
        {
            "robots": 8,
            "truths": {
                "rigid": {"before_mm": 250.0, "passed": True},
                "full.2": {"u_s": [1.5, 2], "verdict": "ok"},
            },
            "budget_u_3d_um": {"tracker": 1.0, "combined": None},
            "trials": {},
            "clearance_mm": {"wanted": 10},
        }
    )


def test_a_mean_is_shown_with_its_interval_and_a_printed_one_without():
    mean = Mean(0.5e-3, 0.1e-3)
    shown = Quantity("before_mm", mean, METRE).shown
    assert shown == {"value": mean.value * 1e3, "ci_95": [mean.low * 1e3, mean.high * 1e3]}
    for width in (0.0, math.inf, math.nan):
        assert Quantity("ratio", Mean(2.0, width)).shown == {"value": 2.0, "ci_95": None}


@pytest.mark.parametrize(
    ("name", "unit"),
    [("mean", METRE), ("mean_mm/rms", RADIAN), ("mean_deg", METRE), ("meanmm", METRE),
     ("mean_mm", ONE), ("turn_deg", ONE), ("radius_m", ONE), ("time", SECOND)],
)  # fmt: skip
def test_a_name_that_does_not_end_in_its_unit_is_refused(name, unit):
    with pytest.raises(ValueError, match=name):
        Quantity(name, 1.0, unit)


def test_a_unit_may_end_an_outer_name_and_the_innermost_counts():
    assert Quantity("budget_um/tracker", 1.0, METRE).shown == 1e6
    assert Quantity("budget_um/tracker_mm", 1.0, METRE).shown == 1e3
    assert Quantity("clearance_mm/poses", 3).shown == 3  # one count in a table of lengths


def test_nothing_is_published_twice():
    with pytest.raises(ValueError, match="twice"):
        as_json([Quantity("a/b", 1), Quantity("a/b", 2)])


def test_fields_of_a_record_bring_the_units_that_they_declare():
    record = Played(np.array([1e-3, 2e-3]), np.array([0.5]))
    assert [declared(Played, name) for name in ("radius", "share", "turn")] == [METRE, ONE, RADIAN]
    stored = as_arrays(below("coverage", fields_of(record, {"radius_m": "radius", "in": "share"})))
    assert list(stored) == ["coverage/radius_m", "coverage/in"]
    assert stored["coverage/radius_m"] is record.radius
    with pytest.raises(ValueError, match="radius"):
        fields_of(record, {"radius": "radius"})


@given(length=st.floats(min_value=0.0, max_value=10.0), digits=st.sampled_from([2, 3, 4]))
def test_no_length_reads_as_a_thousand_micrometers(length, digits):
    value, unit = lengths.with_unit(length, digits=digits).rsplit(" ", 1)
    if unit == "um":
        assert length < 0.9995e-3
    else:
        # three digits: half a unit of the last is 5 parts in 1000 at worst
        assert number(value) == pytest.approx(1e3 * length, rel=5.01e-3)
        assert length >= 0.9995e-3


def test_a_length_is_written_in_the_unit_of_those_that_it_is_read_beside():
    words = lengths.with_unit
    assert [words(x) for x in (999.4e-6, 999.6e-6, 1e-3)] == ["999 um", "1.00 mm", "1.00 mm"]
    assert (words(980e-6, 1.2e-3), words(1.2e-3, 980e-6)) == ("0.980 mm", "1.20 mm")
    assert words(26.4e-6, math.nan, math.inf) == "26.4 um"
    assert lengths.as_stated(1234.5e-6) == "1.2345 mm"
    assert lengths.column_unit([412e-6, 4.31e-3]) == (1e3, "mm")
    assert lengths.column_unit([412e-6]) == (1e6, "µm")
