"""How numbers are written: rounding by the uncertainty, units, signs."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed import units as quantities
from testbed.units import (
    counted,
    decimals,
    fixed,
    percent,
    probability,
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


def test_small_p_values_are_not_written_out_and_shares_keep_their_sign_on_the_line():
    assert probability(0.0) == "< 0.001"
    assert probability(0.0421) == "0.042"
    assert percent(0.5).startswith("50")
    assert " " not in percent(0.5)
    assert counted(1, "pose") == "1 pose"


def test_millimetres_and_degrees_are_those_of_numpy_and_of_the_metre():
    import numpy as np

    both = quantities.in_units(np.array([0.001, np.pi]), np.array([True, False]))
    np.testing.assert_allclose(both, [1.0, 180.0], rtol=1e-15)
    assert [quantities.unit_of(True), quantities.unit_of(False)] == ["mm", "deg"]
