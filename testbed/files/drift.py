"""Nests that stay on the floor: how the station moved between rounds, and how that is corrected."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import InputError
from calib.geometry.frames import exp_so3, log_so3, skew
from testbed.files.readings import Readings
from testbed.files.refusal import refusal
from testbed.files.session import Drift
from testbed.files.session_toml import DriftTable

TIMES = 2.0
"""A drift counts if it is larger than so many of its standard uncertainties."""
FLAT = 0.02
"""Nests are in line if their second principal extent is below this part of the first."""


def split_nests(readings: Readings, nests: Sequence[str]) -> tuple[Readings, Readings]:
    """Readings of the robot, and those of the nests."""
    at_nest = np.array([target in nests for target in readings.target], dtype=bool)
    return readings.rows(~at_nest), readings.rows(at_nest)


def judge_drift(
    readings: Readings, nests: Sequence[str], middle: Array, *, limit: float
) -> tuple[Drift, Index]:
    """How the station moved, from its readings of the nests, and where each round begins.

    The k-th reading of a nest belongs to the k-th round. One farther than `limit` from the median
    of its nest is wrong and does not count. Each round is fitted to the first by a rotation and a
    translation (Procrustes).

    Parameters
    ----------
    readings : Readings
        Of the nests only.
    nests : sequence of str
        Their names.
    middle : (3,) array
        Middle of the measured points, where the shift is stated [m].
    limit : float
        Largest distance from the median [m].

    Returns
    -------
    drift : Drift
        Not corrected yet, but judged.
    begins : (r,) array
        Place of each round in the file, as `Readings.order` counts.

    Raises
    ------
    InputError
        M27: fewer than three nests, or nests in line; M35: a nest was not measured, or not as often
        as the others.
    """
    rounds, begins, wrong = _rounds(readings, nests, limit)
    _require_nests(rounds, nests, readings.where)
    steps, squares, freedom = [], 0.0, 0
    first = rounds[0]
    for k, now in enumerate(rounds):
        both = np.isfinite(now[:, 0]) & np.isfinite(first[:, 0])
        count = int(both.sum())
        if count < 3:
            message = f"a round over the nests has {count} good shots"
            fix = "raise limit_mm under [drift], or leave the drift out"
            raise _too_few(readings.where, message, allowed="at least 3", fix=fix)
        R, t = best_fit(first[both], now[both])
        steps.append(np.concatenate([t, log_so3(R)]))
        if k:
            squares += float(np.square(now[both] - first[both] @ R.T - t).sum())
            freedom += 3 * count - 6
    # the residual holds the scatter of two rounds: the first and this one
    stated = np.diagonal(readings.covariance[:, :3, :3], axis1=1, axis2=2)
    scatter = np.sqrt(squares / freedom) if freedom > 0 else np.sqrt(stated.mean()) * 2**0.5
    u = scatter * _lever(first[np.isfinite(first[:, 0])], middle)
    moved = (exp_so3(step[3:]) @ middle + step[:3] for step in steps)
    shift = np.array([np.linalg.norm(point - middle) for point in moved])
    drift = Drift(
        nests=tuple(nests),
        steps=frozen(steps),
        shift=frozen(shift),
        uncertainty=float(u),
        corrected=bool(shift.max(initial=0.0) > TIMES * u),
        wrong=tuple(wrong),
    )
    return drift, begins


def correct_drift(readings: Readings, drift: Drift, begins: Index) -> Readings:
    """Readings with the drift taken off, between two rounds in proportion."""
    if not drift.corrected:
        return readings
    at = np.column_stack([np.interp(readings.order, begins, column) for column in drift.steps.T])
    R = exp_so3(at[:, 3:])
    back = np.swapaxes(R, 1, 2)
    position = (back @ (readings.position - at[:, :3])[..., None])[..., 0]
    rotation = readings.rotation if readings.kind == "point" else back @ readings.rotation
    return replace(readings, position=position, rotation=rotation)


def best_fit(a: Array, b: Array) -> tuple[Array, Array]:
    """Rotation and translation with b about R a + t, for points a, b (k, 3).

    References
    ----------
    Arun, Huang, Blostein 1987; Umeyama 1991 for the determinant.
    """
    center_a, center_b = a.mean(axis=0), b.mean(axis=0)
    U, _, Vt = np.linalg.svd((b - center_b).T @ (a - center_a))
    mirror = np.diag([1.0, 1.0, np.linalg.det(U @ Vt)])
    R = U @ mirror @ Vt
    return R, center_b - R @ center_a


def _rounds(
    readings: Readings, nests: Sequence[str], limit: float
) -> tuple[Array, Index, list[str]]:
    """Places (r, k, 3) by round, nan where wrong; where rounds begin; wrong readings in words."""
    counts = Counter(readings.target)
    if not all(counts[nest] for nest in nests) or len(set(counts.values())) > 1:
        shown = ", ".join(f"{nest} {counts[nest]}" for nest in nests)
        message = f"the nests were not all shot equally often ({shown})"
        fix = "check their names under [drift], or remove the unfinished round"
        raise refusal(readings.where, "drift.nests", message, fix=fix)
    names = np.array(readings.target)
    rows = np.stack([np.flatnonzero(names == nest) for nest in nests], axis=1)
    place = readings.position[rows]
    off = np.linalg.norm(place - np.median(place, axis=0), axis=2)
    wrong = [
        f"{readings.place[rows[r, k]]}: nest {nests[k]} is {off[r, k] * 1e3:.3f} mm from its median"
        for r, k in np.argwhere(off > limit)
    ]
    place[off > limit] = np.nan
    return place, readings.order[rows].mean(axis=1), wrong


def _require_nests(rounds: Array, nests: Sequence[str], where: str) -> None:
    """Refuse nests that were never in their place, or that cannot show a rotation."""
    for k, nest in enumerate(nests):
        if np.isnan(rounds[:, k]).all():
            message = (
                f"nest {nest} has no shot near its median: it moved, or was confused with another"
            )
            fix = f"leave {nest} out of [drift], or raise limit_mm"
            raise _too_few(where, message, value=nest, fix=fix)
    at = np.nanmedian(rounds, axis=0)
    extent = np.linalg.svd(at - at.mean(axis=0), compute_uv=False)
    if len(nests) >= 3 and extent[1] > FLAT * extent[0]:
        return
    what = f"{len(nests)} nests" if len(nests) < 3 else "nests in one line"
    raise _too_few(
        where, f"{what} cannot show how a station turns", value=len(nests),
        allowed="at least 3, not in one line", fix="measure more nests, or remove [drift]",
    )  # fmt: skip


def _too_few(
    where: str, message: str, *, value: object = None, allowed: str = "", fix: str
) -> InputError:
    """The error of nests that cannot show a drift."""
    return refusal(where, "drift.nests", message, code="M27", value=value, allowed=allowed, fix=fix)


def _lever(nests: Array, middle: Array) -> float:
    """Uncertainty of the fitted shift at `middle` per unit scatter of a nest, one axis.

    A rigid fit has the covariance inv(sum J'J) with J = [I, -[x - c]x] for nests x.
    """
    J = np.concatenate([np.broadcast_to(np.eye(3), (len(nests), 3, 3)), -skew(nests - middle)], 2)
    normal = np.einsum("kri,krj->ij", J, J)
    covariance = np.linalg.solve(normal, np.eye(6))
    return float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))


def without_drift(
    readings: Readings, apart: Readings | None, settings: DriftTable
) -> tuple[Readings, Drift | None, list[str]]:
    """Readings of the robot with the drift taken off where it counts, the drift, and warnings.

    Parameters
    ----------
    readings : Readings
        Of one file, nests among them or not.
    apart : Readings or None
        Of the nests, where they have a separate file.
    settings : DriftTable
        [drift] of session.toml.
    """
    robot, nests = split_nests(readings, settings.nests)
    if not len(robot) or (apart is not None and len(nests)):
        what = "has shots at nests of [drift] file" if len(robot) else "holds shots at nests only"
        fix = "name the file of the nests under [drift] only"
        raise refusal(readings.where, "drift.file", what, fix=fix)
    if apart is not None:
        _, nests = split_nests(apart, settings.nests)
    middle = robot.position.mean(axis=0)
    drift, begins = judge_drift(nests, settings.nests, middle, limit=settings.limit_mm / 1e3)
    if apart is None or not drift.corrected:
        return correct_drift(robot, drift, begins), drift, []
    warning = (
        f"{nests.where}: does not say between which poses the nests were shot; the drift is "
        "reported, not taken off"
    )
    return robot, replace(drift, corrected=False), [warning]
