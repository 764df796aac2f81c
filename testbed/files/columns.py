"""The column names of the project's own layout: a unit in each, and its factor to SI."""

import re
from collections.abc import Collection, Container
from difflib import get_close_matches

import numpy as np

from calib.errors import InputError

LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
ANGLES = {
    "rad": 1.0,
    "deg": float(np.pi / 180),
    "mdeg": float(np.pi / 180e3),
    "urad": 1e-6,
}
UNITS = {"length": LENGTHS, "angle": ANGLES}
PLAIN = (
    "pose_id",
    "repeat",
    "station",
    "split",
    "approach",
    "time",
    "time_s",
    "temperature_degC",
    "target",
    "anchor",
    "euler",
    "qw",
    "qx",
    "qy",
    "qz",
    *(f"r{i}{j}" for i in "123" for j in "123"),
)
"""Names that carry no unit, or always the same."""
AXES = ("x", "y", "z", "rx", "ry", "rz")
STEMS: dict[str, str] = {
    **dict.fromkeys(("x", "y", "z", "range", "distance"), "length"),
    **dict.fromkeys(("reflector_x", "reflector_y", "reflector_z"), "length"),
    **dict.fromkeys(("rx", "ry", "rz", "e1", "e2", "e3", "rvx", "rvy", "rvz"), "angle"),
    **dict.fromkeys(("azimuth", "elevation", "zenith"), "angle"),
    **{f"{u}{axis}": "length" for u in ("u", "U95") for axis in ("x", "y", "z", "_distance")},
    **{f"{u}{axis}": "angle" for u in ("u", "U95") for axis in ("rx", "ry", "rz")},
}
"""Stem of a column name to what it measures."""
JOINT = re.compile(r"q([1-9]\d?)(_read)?")


def covariance_names() -> tuple[str, ...]:
    """The 21 entries of the upper triangle, by rows: ``cov_x_x_m2`` ... ``cov_rz_rz_rad2``."""
    return tuple(f"cov_{a}_{b}_{_squared(a, b)}" for i, a in enumerate(AXES) for b in AXES[i:])


def is_known(name: str) -> bool:
    """Whether this program has a column of that name."""
    if name in PLAIN or name in covariance_names():
        return True
    stem, _, unit = name.rpartition("_")
    if JOINT.fullmatch(stem):
        return unit in LENGTHS or unit in ANGLES
    return stem in STEMS and unit in UNITS[STEMS[stem]]


def close_to(name: str) -> str:
    """``did you mean "x_mm"?``, or nothing."""
    known = [
        *PLAIN,
        *(f"{stem}_{unit}" for stem, kind in STEMS.items() for unit in UNITS[kind]),
        *(f"q{k}{read}_{unit}" for k in range(1, 10) for read in ("", "_read") for unit in
          ("deg", "rad", "mm", "m")),
    ]  # fmt: skip
    close = get_close_matches(name, known, n=1, cutoff=0.75)
    return f'did you mean "{close[0]}"?' if close else ""


def find(names: Container[str], stem: str, kind: str, where: str) -> tuple[str, float] | None:
    """Name of the column of a stem, whatever its unit, and its factor to SI; None if none is there.

    Raises
    ------
    InputError
        M35: it is there in two units.
    """
    found = [f"{stem}_{unit}" for unit in UNITS[kind] if f"{stem}_{unit}" in names]
    if len(found) > 1:
        raise InputError(
            f"{' and '.join(found)} are both there",
            code="M35",
            where=where,
            field=stem,
            fix="keep one of them",
        )
    return (found[0], UNITS[kind][found[0].rpartition("_")[2]]) if found else None


def find_all(
    names: Collection[str], stems: tuple[str, ...], kind: str, where: str
) -> tuple[list[str], list[float]] | None:
    """Names and factors of columns that belong together; None if none of them is there.

    Raises
    ------
    InputError
        M35: some are there and some are not.
    """
    found = [find(names, stem, kind, where) for stem in stems]
    if not any(found):
        return None
    missing = [stem for stem, at in zip(stems, found, strict=True) if at is None]
    if missing:
        have = next(at[0] for at in found if at)
        raise InputError(
            f"there is a column {have} but none for {', '.join(missing)}",
            code="M35",
            where=where,
            field=missing[0],
            fix=next(
                (hint for name in names if not is_known(name) and (hint := close_to(name))),
                "give all of them or none",
            ),
        )
    there = [at for at in found if at]
    return [name for name, _ in there], [factor for _, factor in there]


def _squared(a: str, b: str) -> str:
    """Unit of a covariance entry in a column name."""
    return {0: "m2", 1: "m_rad", 2: "rad2"}[(len(a) == 2) + (len(b) == 2)]
