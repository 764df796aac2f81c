"""Nests that stay on the floor: how the station moved between rounds, and taking that off."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.errors import InputError
from calib.geometry.frames import exp_so3, log_so3, skew
from testbed.files.readings import Readings
from testbed.files.session import Drift
from testbed.files.session_toml import DriftTable

TIMES = 2.0
"""A drift counts if it is larger than so many of its standard uncertainties."""
FLAT = 0.02
"""Nests are in line if their second principal extent is below this part of the first."""


def split_nests(readings: Readings, nests: Sequence[str]) -> tuple[Readings, Readings]:
    """Readings of the robot, and those of the nests."""
    own = np.array([target in nests for target in readings.target], dtype=bool)
    return readings.rows(~own), readings.rows(own)


def judge_drift(
    shots: Readings, nests: Sequence[str], middle: Array, *, limit: float
) -> tuple[Drift, Index]:
    """How the station moved, from its shots at the nests, and where each round begins.

    The k-th shot at a nest belongs to the k-th round. A shot farther than `limit` from the median
    of its nest is wrong and does not count. Each round is fitted to the first by a rotation and a
    translation (Procrustes).

    Parameters
    ----------
    shots : Readings
        At the nests only.
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
        M27: fewer than three nests, or nests in line; M35: a nest was not shot, or not as often as
        the others.
    """
    place, order, wrong = _rounds(shots, nests, limit)
    _require_nests(place, nests, shots.where)
    steps, residuals, freedom = [], 0.0, 0
    for seen in place:
        both = np.isfinite(seen[:, 0]) & np.isfinite(place[0][:, 0])
        if both.sum() < 3:
            raise InputError(
                f"a round over the nests has {int(both.sum())} good shots",
                code="M27",
                where=shots.where,
                field="drift.nests",
                allowed="at least 3",
                fix="raise limit_mm under [drift], or leave the drift out",
            )
        R, t = best_fit(place[0][both], seen[both])
        left = seen[both] - place[0][both] @ R.T - t
        steps.append(np.concatenate([t, log_so3(R)]))
        if seen is not place[0]:
            residuals += float(np.square(left).sum())
            freedom += 3 * int(both.sum()) - 6
    # the residual holds the scatter of two rounds: the first and its own
    scatter = (
        np.sqrt(residuals / freedom) if freedom > 0 else float(np.sqrt(_stated(shots)) * 2**0.5)
    )
    u = scatter * _lever(place[0][np.isfinite(place[0][:, 0])], middle)
    shift = np.array([np.linalg.norm(_moved(step, middle) - middle) for step in steps])
    drift = Drift(
        nests=tuple(nests),
        steps=frozen(steps),
        shift=frozen(shift),
        uncertainty=float(u),
        corrected=bool(shift.max(initial=0.0) > TIMES * u),
        wrong=tuple(wrong),
    )
    return drift, order


def corrected(readings: Readings, drift: Drift, begins: Index) -> Readings:
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
    shots: Readings, nests: Sequence[str], limit: float
) -> tuple[list[Array], Index, list[str]]:
    """Shots (k, 3) of each round, nan where wrong; where rounds begin; the wrong shots in words."""
    counts = Counter(shots.target)
    missing = [nest for nest in nests if not counts[nest]]
    if missing or len(set(counts.values())) > 1:
        shown = ", ".join(f"{nest} {counts[nest]}" for nest in nests)
        raise InputError(
            f"the nests were not all shot equally often ({shown})",
            code="M35",
            where=shots.where,
            field="drift.nests",
            fix="check their names under [drift], or remove the unfinished round",
        )
    names = np.array(shots.target)
    place = np.stack([shots.position[names == nest] for nest in nests], axis=1)
    order = np.stack([shots.order[names == nest] for nest in nests], axis=1)
    rows = np.stack([np.flatnonzero(names == nest) for nest in nests], axis=1)
    off = np.linalg.norm(place - np.median(place, axis=0), axis=2)
    wrong: Bool = off > limit
    told = [
        f"{shots.place[rows[r, k]]}: nest {nests[k]} is {off[r, k] * 1e3:.3f} mm from its median"
        for r, k in np.argwhere(wrong)
    ]
    place[wrong] = np.nan
    return list(place), np.asarray(order.mean(axis=1)), told


def _require_nests(place: list[Array], nests: Sequence[str], where: str) -> None:
    """Refuse nests that were never in their place, or that cannot show a rotation."""
    columns = np.stack(place, axis=1)
    for nest, column in zip(nests, columns, strict=True):
        if np.isnan(column).all():
            raise InputError(
                f"nest {nest} has no shot near its median: it moved, or was confused with another",
                code="M27",
                where=where,
                field="drift.nests",
                value=nest,
                fix=f"leave {nest} out of [drift], or raise limit_mm",
            )
    at = np.array([np.nanmedian(column, axis=0) for column in columns])
    extent = np.linalg.svd(at - at.mean(axis=0), compute_uv=False)
    if len(nests) >= 3 and extent[1] > FLAT * extent[0]:
        return
    told = f"{len(nests)} nests" if len(nests) < 3 else "nests in one line"
    raise InputError(
        f"{told} cannot show how a station turns",
        code="M27",
        where=where,
        field="drift.nests",
        value=len(nests),
        allowed="at least 3, not in one line",
        fix="measure more nests, or remove [drift]",
    )


def _lever(nests: Array, middle: Array) -> float:
    """Uncertainty of the fitted shift at `middle` per unit scatter of a nest, one axis.

    A rigid fit has the covariance inv(sum J'J) with J = [I, -[x - c]x] for nests x.
    """
    J = np.concatenate([np.broadcast_to(np.eye(3), (len(nests), 3, 3)), -skew(nests - middle)], 2)
    normal = np.einsum("kri,krj->ij", J, J)
    covariance = np.linalg.solve(normal, np.eye(6))
    return float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))


def _moved(step: Array, point: Array) -> Array:
    """A point after a step [translation; rotation]."""
    return np.asarray(exp_so3(step[3:]) @ point + step[:3])


def _stated(shots: Readings) -> float:
    """Mean stated variance of a shot, one axis."""
    return float(np.mean(np.diagonal(shots.covariance[:, :3, :3], axis1=1, axis2=2)))


def without_drift(
    readings: Readings, apart: Readings | None, settings: DriftTable
) -> tuple[Readings, Drift | None, list[str]]:
    """Readings of the robot with the drift taken off where it counts, the drift, and warnings.

    Parameters
    ----------
    readings : Readings
        Of one file, nests among them or not.
    apart : Readings or None
        Shots at the nests in a file of their own.
    settings : DriftTable
        [drift] of session.toml.
    """
    own, nests = split_nests(readings, settings.nests)
    shots = nests if apart is None else split_nests(apart, settings.nests)[1]
    if not len(own) or (apart is not None and len(nests)):
        raise InputError(
            "holds shots at nests only" if not len(own) else "has shots at nests of [drift] file",
            code="M35",
            where=readings.where,
            field="drift.file",
            fix="name the file of the nests under [drift] only",
        )
    middle = own.position.mean(axis=0)
    drift, begins = judge_drift(shots, settings.nests, middle, limit=settings.limit_mm / 1e3)
    if apart is not None and drift.corrected:
        return (
            own,
            replace(drift, corrected=False),
            [f"{shots.where}: does not say between which poses the nests were shot; the drift is "
             "reported, not taken off"],
        )  # fmt: skip
    return corrected(own, drift, begins), drift, []
