"""Covariances of readings: from columns of the file, from stated numbers, or from an MPE."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool
from calib.measurement.noise import spherical_covariance
from calib.measurement.observations import Measurements
from testbed.bounds import LENGTH_SD
from testbed.files.columns import AXES, bound_of, covariance_names
from testbed.files.refusal import refusal
from testbed.files.session_toml import UncertaintyTable
from testbed.files.table import Columns, DataTable, together
from testbed.lengths import as_stated

MPE_RULES = {"rectangular": 3**-0.5, "two_sigma": 0.5, "typical": 0.25}
"""Standard uncertainty as a part of the maximum permissible error."""
SIZE = {"pose": 6, "point": 3, "distance": 1}
"""Numbers that a reading of each kind states."""
OF_THE_RANGE = ("range_offset_um", "scale_um_per_m")
OF_THE_DIRECTION = ("encoder_amplitude_um", "level_mdeg")
"""Systematic parts that need to know where the beam starts."""
ABOVE_ZERO = "an uncertainty is above zero"


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Covariances and where they come from."""

    covariance: Array
    """(m, 6, 6) of [position (m); rotation (rad)], one where a reading states nothing."""
    source: str
    warnings: tuple[str, ...] = ()


def spread_columns(kind: str, table: DataTable, settings: UncertaintyTable) -> Columns:
    """The columns of a table that its covariances come from; none if session.toml states them."""
    if not _is_stated(settings) and (full := _full_columns(kind, table)):
        return Columns(full)
    stated = {"position": settings.mpe_um or settings.position_um}
    stated |= {"rotation": settings.rotation_mdeg, "distance": settings.distance_um}
    return together(*(_columns(part, table) for part in _parts(kind) if stated[part] is None))


def _is_stated(settings: UncertaintyTable) -> bool:
    """Whether session.toml states any uncertainty."""
    given = (settings.position_um, settings.rotation_mdeg, settings.distance_um, settings.mpe_um)
    return any(value is not None for value in given)


def _parts(kind: str) -> tuple[str, ...]:
    """What a reading of a kind measures."""
    return ("distance",) if kind == "distance" else ("position", "rotation")[: SIZE[kind] // 3]


def spread_of(
    kind: str, table: DataTable | None, position: Array, good: Bool, settings: UncertaintyTable
) -> Spread:
    """Covariances of readings.

    What session.toml states takes precedence over the columns.

    Parameters
    ----------
    kind : str
        pose, point or distance.
    table : DataTable or None
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
    if table is not None and not _is_stated(settings):
        full = _full_columns(kind, table)
        if full:
            covariance = _from_entries(table, full, good, SIZE[kind])
            return Spread(covariance, f"the covariances of {table.where}")
    covariance = np.tile(np.eye(6), (len(position), 1, 1))
    spreads = [_part(part, table, position, good, settings) for part in _parts(kind)]
    for k, spread in enumerate(spreads):
        own = slice(3 * k, 3 * k + spread.covariance.shape[1])
        covariance[:, own, own] = spread.covariance
    return Spread(
        covariance,
        " and ".join(dict.fromkeys(spread.source for spread in spreads)),
        tuple(warning for spread in spreads for warning in spread.warnings),
    )


def require_shown(settings: UncertaintyTable, table: Measurements, where: str) -> None:
    """Refuse systematic parts that change no reading, and those of a beam from nowhere.

    Raises
    ------
    InputError
        M33: there are no angles, or only distances, or nothing says where the instrument stands.
    """
    if settings.systematic is None:
        return
    stated = [key for key, size in settings.systematic.sizes.items() if size]
    optical = not table.is_distance.all()
    for key in stated:
        seen, what = optical, "there are only distances"
        if key == "target_turn_mdeg":
            seen, what = bool(table.is_pose.any()), "no angle was measured"
        if key in (*OF_THE_DIRECTION, "target_turn_mdeg") and not seen:
            raise refusal(
                where, f"uncertainty.systematic.{key}",
                f"[uncertainty.systematic] {key} changes no reading: {what}",
                code="M33", value=settings.systematic.sizes[key], fix=f"remove {key}",
            )  # fmt: skip
    beam = [key for key in stated if key in (*OF_THE_RANGE, *OF_THE_DIRECTION)]
    if beam and optical and settings.systematic.station_mm is None:
        raise refusal(
            where, "uncertainty.systematic.station_mm",
            f"[uncertainty.systematic] has {' and '.join(beam)}, but nothing states where the "
            "instrument stands",
            code="M33", allowed="station_mm, where its beam starts in the frame of the coordinates",
            fix="write station_mm = [0, 0, 0] where the coordinates are in its own frame",
        )  # fmt: skip


def _part(
    part: str, table: DataTable | None, position: Array, good: Bool, settings: UncertaintyTable
) -> Spread:
    """Covariances (m, 3, 3) or (m, 1, 1) of one part."""
    turns = part == "rotation"
    unit, factor = ("mdeg", np.pi / 180e3) if turns else ("um", 1e-6)
    least = getattr(settings, f"at_least_{part}_{unit}")
    least = np.radians(least * 1e-3) if turns else least * 1e-6
    if part == "position" and settings.mpe_um is not None:
        return _from_mpe(position, good, settings)
    stated = getattr(settings, f"{part}_{unit}")
    if stated is not None:
        u = stated * factor
        shown = f"{np.degrees(u) * 1e3:g} mdeg" if turns else as_stated(u)
        width = 1 if part == "distance" else 3
        source = f"{part} {shown} per axis, stated"
        return Spread(_diagonal(np.full((len(position), width), max(u, least))), source)
    found = _columns(part, table) if table is not None else None
    if found is None or table is None:
        where = table.where if table is not None else "session.toml"
        columns = {"position": "ux_mm uy_mm uz_mm", "rotation": "urx_deg ury_deg urz_deg"}
        key = f"{part}_{unit}"
        raise refusal(
            where, f"uncertainty.{key}", f"nothing states how well the {part} was measured",
            code="M33",
            allowed=f"columns {columns.get(part, 'u_distance_mm')}, or {key} under [uncertainty] "
            "in session.toml (k = 1)",
            fix=f"state it, for example {key} = {10 if turns else 20}",
        )  # fmt: skip
    u, warnings = _without_zeros(table, found, good)
    expanded = found.names[0].startswith("U95")
    u = np.maximum(u * (0.5 if expanded else 1.0), least)
    source = f"columns {', '.join(table.names[name] for name in found.names)}"
    at_least = f", at least {least * 1e6:g} {'urad' if turns else 'um'}"
    return Spread(_diagonal(u), source + at_least * bool(least), tuple(warnings))


def _without_zeros(table: DataTable, columns: Columns, good: Bool) -> tuple[Array, list[str]]:
    """Stated uncertainties (m, k), zeros replaced by what their printing hides, and warnings."""
    u = np.where(good[:, None], table.numbers(columns.names), 1.0) * columns.factors
    if (u < 0).any():
        row, k = (int(i) for i in np.argwhere(u < 0)[0])
        name = columns.names[k]
        message = f'{table.names[name]} is "{table.texts(name)[row][:20]}"'
        raise refusal(
            table.place(row), name, message, code="M33", allowed=ABOVE_ZERO, fix="correct it"
        )
    warnings = []
    for k, (name, factor) in enumerate(zip(columns.names, columns.factors, strict=True)):
        zero = u[:, k] == 0
        if not zero.any():
            continue
        fewest, most = table.decimals(name)
        others = u[good & ~zero, k]
        floor = 10.0**-most / 12**0.5 * factor
        # no instrument is as good as many decimals are fine: there a zero is nothing said
        rounded = fewest == most and most > 0 and bound_of(name).is_usual(floor)
        if not rounded and not len(others):
            message = f"{table.names[name]} is zero in all rows"
            fix = "state it under [uncertainty] in session.toml"
            raise refusal(table.where, name, message, code="M33", allowed=ABOVE_ZERO, fix=fix)
        # a fixed number of decimals hides what is below its last digit; otherwise there was none
        floor = floor if rounded else float(np.median(others))
        u[zero, k] = floor
        what = "its print resolution / sqrt(12)" if rounded else "the median of the others"
        warnings.append(
            f"{table.where}: {table.names[name]} is zero in {int(zero.sum())} of {len(table)} rows;"
            f" taken as {floor / factor:.3g} {name.rpartition('_')[2]}, {what}"
        )
    return u, warnings


def _columns(part: str, table: DataTable) -> Columns | None:
    """Columns of a part: k = 1 or else k = 2."""
    axes = {"position": AXES[:3], "rotation": AXES[3:], "distance": ("_distance",)}[part]
    kind = "angle" if part == "rotation" else "length"
    for prefix in ("u", "U95"):
        found = table.find(kind, *(f"{prefix}{axis}" for axis in axes))
        if found:
            return found
    return None


def _from_mpe(position: Array, good: Bool, settings: UncertaintyTable) -> Spread:
    """Covariances (m, 3, 3) from a maximum permissible error across the beam, taken all around."""
    constant, slope = settings.mpe_um or (0.0, 0.0)
    part = MPE_RULES[settings.mpe_rule]
    sd = (constant * 1e-6 * part, slope * 1e-6 * part)
    # a missed shot, 0 0 0, has no direction: it is left out later
    at = np.where((good & position.any(axis=1))[:, None], position, 1.0)
    covariance = spherical_covariance(
        at, np.eye(4), range_sd=sd, transverse_sd=sd, rotation_sd=(1.0, 1.0, 1.0)
    )[:, :3, :3]
    least = max(settings.at_least_position_um * 1e-6, LENGTH_SD.least)
    u = np.maximum(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), least)
    source = f"MPE {constant:g} um + {slope:g} um/m, read as {settings.mpe_rule}"
    return Spread(_diagonal(u), source)


def _full_columns(kind: str, table: DataTable) -> tuple[str, ...]:
    """The 21 entries of the covariance, if they are there; a point needs those of its position."""
    names = covariance_names()
    if kind == "point" and any(name not in table for name in names):
        names = covariance_names(SIZE[kind])
    missing = [name for name in names if name not in table]
    if len(missing) == len(names):
        return ()
    if missing:
        count = len(names) - len(missing)
        message = (
            f"there are {count} of {len(names)} columns of the covariance; {missing[0]} is missing"
        )
        raise refusal(table.where, missing[0], message, fix="give all of them or none")
    return names


def _from_entries(table: DataTable, names: tuple[str, ...], good: Bool, size: int) -> Array:
    """Covariances (m, 6, 6) of the entries of their upper triangle, or of that of the position."""
    values = table.numbers(names)
    covariance = np.tile(np.eye(6), (len(table), 1, 1))
    i, j = np.triu_indices(6 if len(names) == len(covariance_names()) else SIZE["point"])
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
        raise refusal(
            table.place(row), "covariance",
            "the covariance is not positive definite: smallest eigenvalue "
            f"{np.linalg.eigvalsh(part[row])[0]:.3g}", code="M34",
            value=float(least[row]),
            allowed="every direction must scatter a little", fix=f"check the {len(names)} entries",
        )  # fmt: skip
    return covariance


def _diagonal(u: Array) -> Array:
    """Covariances (m, k, k) of standard uncertainties (m, k)."""
    return np.square(u)[:, :, None] * np.eye(u.shape[1])
