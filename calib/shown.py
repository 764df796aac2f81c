"""What a result shows of itself in a notebook, and its tables for pandas and Arrow."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from html import escape
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from calib.errors import refuse

ROWS = 40
"""Rows of a table that a notebook shows; the frames hold all."""
LINE = 100
"""Characters of the line of a result that writes none of its own."""
FRAMES = "pip install 'truebed[frames]'"


@dataclass(frozen=True, slots=True, eq=False)
class ResultTable(Mapping[str, np.ndarray[Any, Any]]):
    """Columns of equal length, by names that end in their unit; ``dict(table)`` is plain arrays."""

    columns: Mapping[str, Any]
    """Sequences or arrays of equal length; a single value stands in every row."""
    precision: str = ""
    """Column of uncertainties: of a row, the numbers beside it are shown to two of its digits."""

    def __post_init__(self) -> None:
        names = tuple(self.columns)
        columns = np.broadcast_arrays(*map(np.asarray, self.columns.values()), subok=False)
        assert all(column.ndim == 1 for column in columns), "columns of unequal length"
        object.__setattr__(self, "columns", dict(zip(names, columns, strict=True)))

    def __getitem__(self, name: str) -> np.ndarray[Any, Any]:
        return np.asarray(self.columns[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def __repr__(self) -> str:
        return f"ResultTable({self.rows} rows of {', '.join(self)})"

    @property
    def rows(self) -> int:
        """Number of rows."""
        return max((len(values) for values in self.values()), default=0)

    def to_pandas(self) -> Any:
        """The table as a ``pandas.DataFrame`` (extra ``frames``)."""
        with _needed("pandas"):
            from pandas import DataFrame

        return DataFrame({name: values.copy() for name, values in self.items()})

    def to_arrow(self) -> Any:
        """The table as a ``pyarrow.Table`` (extra ``frames``)."""
        with _needed("pyarrow"):
            from pyarrow import table

        return table({name: values.tolist() for name, values in self.items()})

    def _repr_html_(self) -> str:
        shown = [[self._cell(name, row) for name in self] for row in range(min(self.rows, ROWS))]
        head = "".join(f"<th>{escape(name)}</th>" for name in self)
        body = "".join(f"<tr>{''.join(cells)}</tr>" for cells in shown)
        rest = f"<p>{self.rows - ROWS} more rows</p>" if self.rows > ROWS else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{rest}"

    def _cell(self, name: str, row: int) -> str:
        """One cell: words to the left, numbers to the right."""
        value = self[name][row]
        if not isinstance(value, np.floating):
            side = "right" if isinstance(value, np.integer) else "left"
            return f'<td style="text-align:{side}">{escape(str(value))}</td>'
        return f'<td style="text-align:right">{self._number(float(value), row)}</td>'

    def _number(self, value: float, row: int) -> str:
        """A number with the digits that it deserves."""
        if not np.isfinite(value):
            return "–"
        size = float(self[self.precision][row]) if self.precision else 0.0
        return f"{value:z.{decimals(size)}f}" if 0 < size < np.inf else f"{value:.4g}"


def concatenated(tables: Iterable[ResultTable]) -> ResultTable:
    """Tables of the same columns below each other."""
    parts = list(tables)
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return ResultTable(columns, parts[0].precision)


def in_a_line(record: object) -> str:
    """Fields of a dataclass as far as a line holds them: small ones by value, arrays by shape."""
    names = (field.name for field in fields(cast("Any", record)))
    parts = [text for name in names if (text := _field(name, getattr(record, name)))]
    line = f"{type(record).__name__}({', '.join(parts)}"
    return f"{line})" if len(line) < LINE else f"{line[: LINE - 4].rpartition(',')[0]}, ...)"


class Shown:
    """A result: one line, the same with words and a table in a notebook, tables for frames."""

    __slots__ = ()

    def __repr__(self) -> str:
        return in_a_line(self)

    def tables(self) -> Mapping[str, ResultTable]:
        """Tables by name, the one that a notebook shows first; none by default."""
        return {}

    def to_pandas(self, table: str = "") -> Any:
        """One of `tables`, by default the first, as a ``pandas.DataFrame`` (extra ``frames``)."""
        return self._table(table).to_pandas()

    def to_arrow(self, table: str = "") -> Any:
        """One of `tables`, by default the first, as a ``pyarrow.Table`` (extra ``frames``)."""
        return self._table(table).to_arrow()

    def _table(self, name: str) -> ResultTable:
        """The table of a name."""
        tables = self.tables()
        if not tables:
            message = f"{type(self).__name__} has no table"
            raise refuse("table", code="A3", message=message, fix="its fields are plain arrays")
        if name and name not in tables:
            raise refuse("table", name, f"one of {', '.join(tables)}", code="A3")
        return tables[name or next(iter(tables))]

    def _repr_html_(self) -> str:
        """For notebooks: the line, the summary folded away where there is one, and a table."""
        parts = [f"<p><b>{escape(repr(self))}</b></p>"]
        if summary := getattr(self, "summary", None):
            text = f"<pre>{escape(summary())}</pre>"
            parts.append(f"<details><summary>summary</summary>{text}</details>")
        for name, table in list(self.tables().items())[:1]:
            parts.append(f"<p>{escape(name)}</p>{table._repr_html_()}")
        return "\n".join(parts)


def _field(name: str, value: object) -> str:
    """A field of a result in a few characters; empty where that is not enough."""
    if isinstance(value, np.ndarray):
        return f"{name} {value.shape}"
    if isinstance(value, float):
        return f"{name}={value:.4g}"
    if isinstance(value, str | int) and len(f"{value}") < LINE // 3:
        return f"{name}={value!r}"
    return f"{len(value)} {name}" if isinstance(value, tuple) and value else ""


def mean_of(values: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Mean for a line about a result; zero of none."""
    return float(values.mean()) if values.size else 0.0


def length_unit(lengths: ArrayLike) -> tuple[float, str]:
    """Unit in which people read lengths [m] side by side, per meter: um, and mm from 1 mm on.

    The largest that is finite decides. A length that three digits round to 1 mm counts as one.

    Examples
    --------
    >>> length_unit(412e-6), length_unit([412e-6, 4.31e-3]), length_unit(999.6e-6)
    ((1000000.0, 'um'), (1000.0, 'mm'), (1000.0, 'mm'))
    """
    sizes = np.abs(np.asarray(lengths, dtype=np.float64))
    largest = sizes.max(initial=0.0, where=np.isfinite(sizes))
    return (1e3, "mm") if largest >= 0.9995e-3 else (1e6, "um")


def length_words(length: float, *beside: float, um: str = "") -> str:
    """A length [m] for a sentence with its unit, the same for all that it is read beside.

    In mm it has three digits, and below a micrometer it is in um whatever is beside it; in um it is
    written in the format `um`, by default as a whole number, and with two digits where that would
    hide it.

    Examples
    --------
    >>> length_words(26.4e-6), length_words(3.14e-6), length_words(45e-9), length_words(0.0)
    ('26 um', '3.1 um', '0.045 um', '0 um')
    >>> length_words(4.3074e-3), length_words(26.4e-6, 4.3e-3), length_words(3e-9, 4.3e-3)
    ('4.31 mm', '0.0264 mm', '0.003 um')
    >>> length_words(26.44e-6, um=".1f"), length_words(412e-6, um="#.3g")
    ('26.4 um', '412 um')
    """
    unit = length_unit([length, *beside])[1]
    size = 1e6 * length
    if unit == "mm" and not 0 < size < 1:
        return f"{three_digits(size / 1e3)} mm"
    form = um or (".0f" if size == 0 or size >= 9.95 else ".2g")
    return f"{f'{size:{form}}'.rstrip('.')} um"


def angle_words(angle: float) -> str:
    """An angle [rad] for a sentence with its unit: mdeg with two digits, and deg from one on.

    Examples
    --------
    >>> [angle_words(np.radians(degrees)) for degrees in (0.0096, 0.957, 0.9996, 3.02)]
    ['9.6 mdeg', '957 mdeg', '1.00 deg', '3.02 deg']
    """
    size = 1e3 * float(np.degrees(angle))
    if size >= 999.5:
        return f"{three_digits(size / 1e3)} deg"
    return f"{size:.2g} mdeg" if size < 99.5 else f"{size:.0f} mdeg"


def three_digits(number: float) -> str:
    """Three digits, zeros at the end among them, and all of those before the point.

    Examples
    --------
    >>> three_digits(3.0), three_digits(412.3), three_digits(1234.5), three_digits(0.0)
    ('3.00', '412', '1234', '0')
    """
    if number == 0 or abs(number) >= 999.5:
        return f"{number:.0f}"
    return f"{number:#.3g}".rstrip(".")


def decimals(uncertainty: float) -> int:
    """Places behind the point that leave an uncertainty two digits; six where there is none.

    Examples
    --------
    >>> decimals(0.0123), decimals(4.5), decimals(120.0)
    (3, 1, 0)
    """
    known = 0 < uncertainty < np.inf
    return max(0, 1 - int(np.floor(np.log10(uncertainty)))) if known else 6


@contextmanager
def _needed(package: str) -> Iterator[None]:
    """Say what to type where an optional package is missing."""
    try:
        yield
    except ImportError as error:
        message = f"a frame needs the package {package}, which is not installed"
        raise refuse("", code="A8", message=message, fix=FRAMES) from error
