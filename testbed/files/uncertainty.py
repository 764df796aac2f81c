"""Covariances of readings: from columns of the file, from stated numbers, or from an MPE."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool
from calib.errors import InputError
from calib.measurement.noise import spherical_covariance
from testbed.files.columns import AXES, covariance_names, find_all
from testbed.files.session_toml import UncertaintyTable
from testbed.files.table import Table

MPE_RULES = {"rectangular": 3**-0.5, "two_sigma": 0.5, "typical": 0.25}
"""Standard uncertainty as a part of the maximum permissible error."""
SIZE = {"pose": 6, "point": 3, "distance": 1}
"""Numbers that a reading of each kind states."""


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Covariances and where they come from."""

    covariance: Array
    """(m, 6, 6) of [position (m); rotation (rad)], one where a reading states nothing."""
    source: str
    joints_included: bool
    """Whether the scatter of the joints is in it already."""
    columns: tuple[str, ...]
    warnings: tuple[str, ...]


def spread_of(
    kind: str, table: Table | None, position: Array, good: Bool, settings: UncertaintyTable
) -> Spread:
    """Covariances of readings.

    What session.toml states counts before what the columns say.

    Parameters
    ----------
    kind : str
        pose, point or distance.
    table : Table or None
        For its columns; None: there are none.
    position : (m, 3) array
        Readings in the frame of the station, whose origin an MPE counts from [m].
    good : (m,) array of bool
        Rows that are used.
    settings : UncertaintyTable
        [uncertainty] of session.toml.

    Raises
    ------
    InputError
        M33: nothing is stated, or something below zero; M34: a covariance is none.
    """
    m, size = len(position), SIZE[kind]
    own = settings.joint_repeatability == "included"
    full = _full_columns(table) if table is not None and not _states(settings) else []
    if full and table is not None:
        return Spread(
            _from_entries(table, full, good, size),
            f"the covariances of {table.where}",
            own,
            tuple(full),
            (),
        )
    covariance = np.tile(np.eye(6), (m, 1, 1))
    told: list[str] = []
    sources: list[str] = []
    used: list[str] = []
    for part in ("distance",) if kind == "distance" else ("position", "rotation")[: size // 3]:
        block, source, names, warnings = _part(part, table, position, good, settings)
        start = 3 if part == "rotation" else 0
        width = 1 if part == "distance" else 3
        covariance[:, start : start + width, start : start + width] = block
        sources.append(source)
        used += names
        told += warnings
    return Spread(covariance, " and ".join(dict.fromkeys(sources)), own, tuple(used), tuple(told))


def _states(settings: UncertaintyTable) -> bool:
    """Whether session.toml states how well a device measures."""
    given = (settings.position_um, settings.rotation_mdeg, settings.distance_um, settings.mpe_um)
    return any(value is not None for value in given)


def _part(
    part: str, table: Table | None, position: Array, good: Bool, settings: UncertaintyTable
) -> tuple[Array, str, list[str], list[str]]:
    """Covariance (m, 3, 3) or (m, 1, 1) of one part, its source, its columns and warnings."""
    m, width = len(position), 1 if part == "distance" else 3
    least, stated = {
        "position": (settings.at_least_position_um * 1e-6, _times(settings.position_um, 1e-6)),
        "rotation": (
            np.radians(settings.at_least_rotation_mdeg * 1e-3),
            _times(settings.rotation_mdeg, np.pi / 180e3),
        ),
        "distance": (settings.at_least_distance_um * 1e-6, _times(settings.distance_um, 1e-6)),
    }[part]
    if part == "position" and settings.mpe_um is not None:
        return _from_mpe(position, good, settings)
    if stated is not None:
        unit = (
            f"{stated * 1e6:g} um" if part != "rotation" else f"{np.degrees(stated) * 1e3:g} mdeg"
        )
        u = np.full((m, width), max(stated, least))
        return _diagonal(u), f"{part} {unit} per axis, stated", [], []
    found = _columns(part, table) if table is not None else None
    if found is None or table is None:
        where = table.where if table is not None else "session.toml"
        key = f"{part}_{'mdeg' if part == 'rotation' else 'um'}"
        column = {"position": "ux_mm uy_mm uz_mm", "rotation": "urx_deg ury_deg urz_deg"}
        raise InputError(
            f"nothing says how well the {part} was measured",
            code="M33",
            where=where,
            field=f"uncertainty.{key}",
            allowed=f"columns {column.get(part, 'u_distance_mm')}, or {key} under [uncertainty] in "
            "session.toml (k = 1)",
            fix=f"state it, for example {key} = {10 if part == 'rotation' else 20}",
        )
    names, factors, halved = found
    u, told = _mended(table, names, factors, good)
    u = np.maximum(u * (0.5 if halved else 1.0), least)
    source = f"columns {', '.join(table.names[name] for name in names)}"
    at_least = f", at least {least * 1e6:g} {'urad' if part == 'rotation' else 'um'}"
    return _diagonal(u), source + at_least * bool(least), names, told


def _mended(
    table: Table, names: list[str], factors: list[float], good: Bool
) -> tuple[Array, list[str]]:
    """Stated uncertainties (m, k) with zeros replaced by what their printing hides."""
    values = table.numbers(names)
    u = np.where(good[:, None], values, 1.0) * factors
    if (u < 0).any():
        row, k = (int(i) for i in np.argwhere(u < 0)[0])
        raise InputError(
            f'{table.names[names[k]]} is "{table.texts(names[k])[row][:20]}"',
            code="M33",
            where=table.place(row),
            field=names[k],
            allowed="an uncertainty is above zero",
            fix="mend it",
        )
    told = []
    for k, name in enumerate(names):
        zero = u[:, k] == 0
        if not zero.any():
            continue
        fewest, most = table.decimals(name)
        others = u[good & ~zero, k]
        rounded = fewest == most and most > 0
        if not rounded and not len(others):
            raise InputError(
                f"{table.names[name]} is zero in all rows",
                code="M33",
                where=table.where,
                field=name,
                allowed="an uncertainty is above zero",
                fix="state it under [uncertainty] in session.toml",
            )
        # a fixed number of decimals hides what is below its last digit; otherwise there was none
        floor = 10.0**-most / 12**0.5 * factors[k] if rounded else float(np.median(others))
        u[zero, k] = floor
        what = "its print resolution / sqrt(12)" if rounded else "the median of the others"
        shown = floor / factors[k]
        told.append(
            f"{table.where}: {table.names[name]} is zero in {int(zero.sum())} of {len(table)} rows;"
            f" taken as {shown:.3g} {name.rpartition('_')[2]}, {what}"
        )
    return u, told


def _columns(part: str, table: Table) -> tuple[list[str], list[float], bool] | None:
    """Columns of a part: k = 1 or else k = 2."""
    axes = {"position": AXES[:3], "rotation": AXES[3:], "distance": ("_distance",)}[part]
    kind = "angle" if part == "rotation" else "length"
    for prefix in ("u", "U95"):
        found = find_all(table.names, tuple(prefix + axis for axis in axes), kind, table.where)
        if found:
            return *found, prefix == "U95"
    return None


def _from_mpe(
    position: Array, good: Bool, settings: UncertaintyTable
) -> tuple[Array, str, list[str], list[str]]:
    """Covariances (m, 3, 3) from a maximum permissible error across the beam, taken all around."""
    constant, slope = settings.mpe_um or (0.0, 0.0)
    part = MPE_RULES[settings.mpe_rule]
    sd = (constant * 1e-6 * part, slope * 1e-6 * part)
    at = np.where(good[:, None], position, 1.0)
    covariance = spherical_covariance(
        at, np.eye(4), range_sd=sd, transverse_sd=sd, rotation_sd=(1.0, 1.0, 1.0)
    )[:, :3, :3]
    least = settings.at_least_position_um * 1e-6
    u = np.maximum(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), least)
    source = f"MPE {constant:g} um + {slope:g} um/m, read as {settings.mpe_rule}"
    return _diagonal(u), source, [], []


def _full_columns(table: Table) -> list[str]:
    """The 21 entries of the covariance, if they are there."""
    names = covariance_names()
    there = [name for name in names if name in table]
    if there and len(there) < len(names):
        missing = next(name for name in names if name not in there)
        raise InputError(
            f"there are {len(there)} of 21 columns of the covariance; {missing} is missing",
            code="M35",
            where=table.where,
            field=missing,
            fix="give all of them or none",
        )
    return there


def _from_entries(table: Table, names: list[str], good: Bool, size: int) -> Array:
    """Covariances (m, 6, 6) of the 21 entries of their upper triangle."""
    values = table.numbers(names)
    covariance = np.zeros((len(table), 6, 6))
    i, j = np.triu_indices(6)
    covariance[:, i, j] = values
    covariance[:, j, i] = values
    covariance[~good] = np.eye(6)
    part = covariance[:, :size, :size]
    variance = np.diagonal(part, axis1=1, axis2=2)
    positive = (variance > 0).all(axis=1)
    scale = np.sqrt(np.where(variance > 0, variance, 1.0))
    least = np.linalg.eigvalsh(part / (scale[:, :, None] * scale[:, None, :]))[:, 0]
    wrong = ~positive | (least < 1e-13)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            "the covariance is not positive definite: smallest eigenvalue "
            f"{np.linalg.eigvalsh(part[row])[0]:.3g}",
            code="M34",
            where=table.place(row),
            field="covariance",
            value=float(least[row]),
            allowed="every direction must scatter a little",
            fix="check the 21 entries",
        )
    return covariance


def _diagonal(u: Array) -> Array:
    """Covariances (m, k, k) of standard uncertainties (m, k)."""
    return np.square(u)[:, :, None] * np.eye(u.shape[1])


def _times(value: float | None, factor: float) -> float | None:
    """A stated number in SI."""
    return None if value is None else value * factor
