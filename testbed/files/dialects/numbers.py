"""Cells of a table as numbers: what Python reads otherwise, and decimal commas."""

import re
from collections.abc import Sequence

import numpy as np

from calib.arrays import Array

NUMBER = re.compile(r"[+\u2212-]?\d[\d.,]*([eE][+-]?\d+)?")


def floats(cells: Sequence[str]) -> Array:
    """Numbers (m,); nan where a cell is none."""
    if not any("_" in cell for cell in cells):  # Python reads 1_000, a table should not
        try:
            return np.array([float(cell) for cell in cells], dtype=np.float64)
        except ValueError:
            pass
    return np.array([number_of(cell) for cell in cells], dtype=np.float64)


def number_of(cell: str) -> float:
    """One number, its minus as in print or not, or nan."""
    try:
        return np.nan if "_" in cell else float(cell.replace("\u2212", "-"))
    except ValueError:
        return np.nan


def pointed(cell: str) -> str:
    """A number with a decimal comma as one with a point; a point there makes it no number."""
    return cell.replace(",", ".") if "." not in cell else "?"


def digits_after(cell: str, mark: str) -> int:
    """Digits after the decimal mark."""
    mantissa = re.split("[eE]", cell)[0]
    return len(mantissa.split(mark)[1]) if mark in mantissa else 0
