"""Numbers for people: units, digits, intervals in words; quantities that carry their unit."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import floor, isfinite, log10

import numpy as np

from calib.arrays import Array, Bool

MM = 1e3
"""Millimetres per metre."""
UM = 1e6
"""Micrometres per metre."""
DEG = 180.0 / np.pi
"""Degrees per radian."""
MDEG = 1e3 * DEG
"""Thousandths of a degree per radian."""
MICRO = re.compile(r"(?<=[\d)]) [uµ]m\b")
NARROW = "\u202f"
"""Narrow space that does not break a line, between a number and its sign."""


def decimals(value: float, digits: int) -> int:
    """Decimal places that show `digits` significant digits of a value, rounding included.

    Examples
    --------
    >>> decimals(0.0123, 2), decimals(0.00996, 2), decimals(123.0, 2)
    (3, 3, 0)
    """
    if not isfinite(value) or value == 0.0:
        return 0
    first = digits - 1 - floor(log10(abs(value)))
    # 0.00996 becomes 0.010: one place less than its first digit suggests
    return max(digits - 1 - floor(log10(round(abs(value), first))), 0)


def fixed(value: float, places: int) -> str:
    """A number with `places` decimals, a real minus sign, and no negative zero.

    Examples
    --------
    >>> fixed(-0.0004, 2), fixed(-1.5, 1)
    ('0.00', '−1.5')
    """
    if not isfinite(value):
        return "not available" if np.isnan(value) else ("∞" if value > 0 else "−∞")
    text = f"{value:.{places}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    return text.replace("-", "−")


def significant(value: float, digits: int = 3) -> str:
    """A number with `digits` significant digits, written without an exponent where readable.

    Examples
    --------
    >>> significant(0.012345), significant(1234.5), significant(2.1e-5)
    ('0.0123', '1234', '2.10 × 10⁻⁵')
    """
    if not isfinite(value) or value == 0.0:
        return fixed(value, 0)
    if abs(value) >= 1e-4 and abs(value) < 1e6:
        return fixed(value, decimals(value, digits))
    exponent = floor(log10(abs(value)))
    if round(abs(value) / 10.0**exponent, digits - 1) >= 10.0:
        exponent += 1
    power = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{fixed(value / 10.0**exponent, digits - 1)} × 10{power}"


def with_uncertainty(value: float, standard: float, *extra: float) -> tuple[str, ...]:
    """A value, its uncertainty and further values, all to the decimal of u's second digit.

    Parameters
    ----------
    value : float
        In the unit of `standard`.
    standard : float
        Standard uncertainty u; it decides the decimals.
    *extra : float
        Written to the same decimal.

    References
    ----------
    JCGM 100:2008, 7.2.6.

    Examples
    --------
    >>> with_uncertainty(290.12345, 0.0123, 290.1)
    ('290.123', '0.012', '290.100')
    """
    places = decimals(standard, 2) if standard > 0 else 6
    return tuple(fixed(number, places) for number in (value, standard, *extra))


def millimetres(length: float, digits: int = 3) -> str:
    """A length [m] in mm with `digits` significant digits, the unit left to the column."""
    return significant(length * MM, digits)


def micrometres(length: float, digits: int = 3) -> str:
    """A length [m] in um with `digits` significant digits, the unit left to the column."""
    return significant(length * UM, digits)


def percent(share: float) -> str:
    """A share of one in percent, with its sign; one decimal only below 10 % and above 99 %.

    Examples
    --------
    >>> [percent(share).replace(NARROW, " ") for share in (0.954, 0.034, 1.0)]
    ['95 %', '3.4 %', '100 %']
    >>> [percent(share).replace(NARROW, " ") for share in (0.9997, 0.0004)]
    ['> 99.9 %', '< 0.1 %']
    """
    if 0.0 < share < 0.0005 or 0.9995 <= share < 1.0:
        return f"{'< 0.1' if share < 0.5 else '> 99.9'}{NARROW}%"
    places = 1 if 0.0 < share < 0.1 or 0.99 < share < 1.0 else 0
    return f"{fixed(100.0 * share, places)}{NARROW}%"


def probability(p: float) -> str:
    """A p-value; below one in a thousand only that is said.

    Examples
    --------
    >>> probability(0.412), probability(3e-9)
    ('0.41', '< 0.001')
    """
    return "< 0.001" if p < 1e-3 else significant(p, 2)


def p_equals(p: float) -> str:
    """A p-value with its sign, to stand behind the letter p.

    Examples
    --------
    >>> p_equals(0.412), p_equals(3e-9)
    ('= 0.41', '< 0.001')
    """
    return probability(p) if p < 1e-3 else f"= {probability(p)}"


def in_units(values: Array, is_length: Bool) -> Array:
    """Values (f,) in mm where they are lengths [m], in degrees where angles [rad]."""
    return np.asarray(values * np.where(is_length, MM, DEG))


def unit_of(is_length: bool) -> str:
    """Unit in which a parameter is written."""
    return "mm" if is_length else "deg"


def typeset(text: str) -> str:
    """A plain sentence with the report's units: micro as one letter, signs kept to their numbers.

    Examples
    --------
    >>> typeset("180 um at 95 %, a word um stays").replace(NARROW, "_")
    '180_µm at 95_%, a word um stays'
    """
    return MICRO.sub(f"{NARROW}µm", text).replace(" %", f"{NARROW}%")


def plain(text: str) -> str:
    """A sentence of the report as plain text, for the terminal as well."""
    return text.replace(NARROW, " ").replace("µ", "u").replace("−", "-")


def sentence(text: str, *, keep_name: bool = False) -> str:
    """The text with a capital and a full stop.

    With `keep_name` a first word that is more than letters, or has a capital inside, stays, as the
    name of a number.

    Examples
    --------
    >>> sentence("no pose fits"), sentence("d2 cannot be told from d3.", keep_name=True)
    ('No pose fits.', 'd2 cannot be told from d3.')
    >>> sentence("vAP is up to 3 um", keep_name=True)
    'vAP is up to 3 um.'
    """
    first = text.partition(" ")[0].rstrip(",:;")
    if not keep_name or (first.isalpha() and first[1:] == first[1:].lower()):
        text = text[:1].upper() + text[1:]
    return text if text.endswith((".", "!", "?")) else f"{text}."


def sentences(texts: Iterable[str]) -> tuple[str, ...]:
    """Texts as sentences; the names of numbers that some begin with stay as they are."""
    return tuple(sentence(text, keep_name=True) for text in texts)


def listed(words: Sequence[str], most: int | None = None) -> str:
    """Words with commas and a last "and"; of more than `most` the first, and how many more.

    Examples
    --------
    >>> listed(["a", "b", "c"]), listed(["a"]), listed(["a", "b", "c"], 1)
    ('a, b and c', 'a', 'a and 2 more')
    """
    if most is not None and len(words) > most:
        words = [*words[:most], f"{len(words) - most} more"]
    return _in_a_row(words, " and ")


def either(words: Sequence[str]) -> str:
    """Words with commas and a last "or".

    Examples
    --------
    >>> either(["a", "b", "c"]), either(["a"])
    ('a, b or c', 'a')
    """
    return _in_a_row(words, " or ")


def _in_a_row(words: Sequence[str], last: str) -> str:
    """Words with commas, and another word before the last one."""
    return last.join([", ".join(words[:-1]), words[-1]] if words[1:] else words)


def named(noun: str, names: Sequence[str], count: int = 0) -> str:
    """A noun and its names, of which there are `count` if these are only the first.

    Examples
    --------
    >>> named("line", ["7"]), named("line", ["7", "9"], 3)
    ('line 7', 'lines 7, 9 and 1 more')
    """
    more = max(count - len(names), 0)
    plural = "s" * (len(names) + more > 1)
    return f"{noun}{plural} {', '.join(names)}" + f" and {more} more" * (more > 0)


def counted(number: int, noun: str) -> str:
    """A count and its noun.

    Examples
    --------
    >>> counted(1, "pose"), counted(29, "pose"), counted(2, "body")
    ('1 pose', '29 poses', '2 bodies')
    """
    plural = f"{noun[:-1]}ies" if noun.endswith(("ry", "dy")) else f"{noun}s"
    return f"{number} {noun if number == 1 else plural}"


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean over robots with its 95 % confidence interval."""

    value: float
    half_width: float
    """Student's t over robots."""

    @property
    def low(self) -> float:
        """Lower end."""
        return self.value - self.half_width

    @property
    def high(self) -> float:
        """Upper end."""
        return self.value + self.half_width
