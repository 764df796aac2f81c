"""Nests that stay on the floor: how the station moved between rounds, and how that is corrected."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.errors import InputError
from calib.geometry.frames import exp_so3, log_so3
from calib.measurement.corrections import rigid_fit_covariance
from testbed.files.nests.between_rounds import correct_drift
from testbed.files.nests.motions import best_fit, show_a_turn
from testbed.files.nests.unseated import unseated
from testbed.files.readings import SHOWN, Readings
from testbed.files.refusal import refusal
from testbed.files.session import DRIFTED, Drift
from testbed.files.session_toml import DriftTable
from testbed.units import named

MOST_LOST = 0.1
"""Part of the rounds that may be lost; one always may."""


def split_nests(readings: Readings, nests: Sequence[str]) -> tuple[Readings, Readings]:
    """Readings of the robot, and those of the nests."""
    at_nest = np.array([target in nests for target in readings.target], dtype=bool)
    return readings.rows(~at_nest), readings.rows(at_nest)


def judge_drift(
    readings: Readings, nests: Sequence[str], middle: Array, *, limit: float
) -> tuple[Drift, Array, list[str]]:
    """How the station moved, from its readings of the nests, and where each round stands.

    The k-th reading of a nest belongs to the k-th round. One farther than `limit` from the median
    of its nest is wrong and does not count, nor one that is not where the others of its round have
    it (`unseated`), nor a round with fewer than three others, or all in one line. Each is fitted to
    the first by a rotation and a translation (Procrustes).

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
        Mean place of each round in the file, as `Readings.order` counts.
    warnings : list of str
        Name the shots and rounds that do not count.

    Raises
    ------
    InputError
        M27: fewer than three nests, nests in line, or too many rounds without three good shots;
        M35: a nest was not measured, or too many rounds are unfinished.
    """
    rows, rounds, wrong, elsewhere = _rounds(readings, nests, limit)
    _require_nests(rounds, nests, readings.where)
    kept, lost = _whole_rounds(readings, rows, rounds)
    warnings = [*elsewhere, *lost]
    rounds, there = rounds[kept], rows[kept] >= 0
    begins = (readings.order[rows[kept]] * there).sum(axis=1) / there.sum(axis=1)
    steps, squares, freedom = [], 0.0, 0
    first = rounds[0]
    stated = readings.covariance[rows[kept], :3, :3]
    for k, now in enumerate(rounds):
        both = np.isfinite(now[:, 0]) & np.isfinite(first[:, 0])
        R, t = best_fit(first[both], now[both])
        steps.append(np.concatenate([t, log_so3(R)]))
        if k:
            squares += float(np.square(now[both] - first[both] @ R.T - t).sum())
            freedom += 3 * int(both.sum()) - 6
    # the residual holds the scatter of two rounds: the first and this one
    variance = float(np.trace(stated[there], axis1=1, axis2=2).mean()) / 3
    scatter = np.sqrt(squares / freedom) if freedom > 0 else np.sqrt(2 * variance)
    u = scatter * _lever(first[np.isfinite(first[:, 0])], middle)
    # few nests scatter little by chance: as much as stated, and what a variance of t has
    shown = squares / 2 / max(freedom - 2, 1) if freedom > 0 else 0.0
    noise = max(1.0, shown / variance) * stated
    moved = (exp_so3(step[3:]) @ middle + step[:3] for step in steps)
    shift = np.array([np.linalg.norm(point - middle) for point in moved])
    drift = Drift(
        nests=tuple(nests),
        steps=frozen(steps),
        shift=frozen(shift),
        uncertainty=float(u),
        corrected=bool(shift.max(initial=0.0) > DRIFTED * u),
        wrong=tuple(wrong),
        covariance=frozen(
            [
                rigid_fit_covariance(place[good], middle, own[good])
                for place, own in zip(rounds, noise, strict=True)
                for good in [np.isfinite(place[:, 0])]
            ]
        ),
    )
    return drift, begins, warnings


def _rounds(
    readings: Readings, nests: Sequence[str], limit: float
) -> tuple[Index, Array, list[str], list[str]]:
    """Rows (r, k) of the shots by round, their places (r, k, 3), nan where wrong, and these.

    Last, which nests stood elsewhere in which rounds.
    """
    rows = _shots(readings, nests)
    place = np.where((rows >= 0)[..., None], readings.position[rows], np.nan)
    missed = np.asarray((place == 0).all(axis=2))
    place[missed] = np.nan
    gone = np.asarray(np.isnan(place).all(axis=(0, 2)))
    middle = np.nanmedian(np.where(gone[:, None], 0.0, place), axis=0)
    off = np.linalg.norm(place - middle, axis=2)
    wrong = [
        f"{readings.where}: nest {nests[k]} was not shot in round {r + 1}"
        if rows[r, k] < 0
        else f"{readings.place[rows[r, k]]}: nest {nests[k]} "
        + ("was missed" if missed[r, k] else f"is {off[r, k] * 1e3:.3f} mm from its median")
        for r, k in np.argwhere(missed | (rows < 0) | (off > limit))
    ]
    place[off > limit] = np.nan
    sd = np.sqrt(np.trace(readings.covariance[:, :3, :3], axis1=1, axis2=2).mean() / 3)
    elsewhere = unseated(place, float(sd))
    wrong += [
        f"{readings.place[rows[r, k]]}: nest {nests[k]} is not where the others have it"
        for r, k in np.argwhere(elsewhere)
    ]
    place[elsewhere] = np.nan
    return rows, place, wrong, _unseated_words(readings, nests, elsewhere)


def _unseated_words(readings: Readings, nests: Sequence[str], elsewhere: Bool) -> list[str]:
    """What is said of nests that stood elsewhere in some rounds (r, k)."""
    said = []
    for k in np.flatnonzero(elsewhere.any(axis=0)).tolist():
        rounds = np.flatnonzero(elsewhere[:, k]) + 1
        which = named("round", [str(r) for r in rounds[:SHOWN]], len(rounds))
        said.append(
            f"{readings.where}: nest {nests[k]} is not where the others have it in {which}, as if "
            "it was unseated and set right again; its shots there do not count"
        )
    return said


def _shots(readings: Readings, nests: Sequence[str]) -> Index:
    """Row of each round's shot at each nest (r, k); -1 where it is not there.

    The k-th shots at all nests are a round. Where some were left out, a round ends before a nest
    that it has, or before poses of the robot, whichever leaves fewer rounds unfinished.
    """
    names = np.array(readings.target)
    counts = Counter(readings.target)
    if not counts:
        message = f"has no row of a nest, and [drift] names {', '.join(nests)}"
        fix = "name what each row is of in a column target, or take [drift] out"
        raise refusal(readings.where, "drift.nests", message, fix=fix)
    if all(counts[nest] for nest in nests) and len(set(counts.values())) == 1:
        return np.stack([np.flatnonzero(names == nest) for nest in nests], axis=1)
    found = [_in_turn(readings, nests, apart=apart) for apart in (True, False)]
    rows = min(found, key=lambda each: int((each < 0).any(axis=1).sum()))
    unfinished = int((rows < 0).any(axis=1).sum())
    if unfinished > max(1, MOST_LOST * len(rows)) or not all(counts[nest] for nest in nests):
        shown = ", ".join(f"{nest} {counts[nest]}" for nest in nests)
        message = f"the nests were not all shot equally often ({shown})"
        fix = "check their names under [drift], or remove the unfinished round"
        raise refusal(readings.where, "drift.nests", message, fix=fix)
    return rows


def _in_turn(readings: Readings, nests: Sequence[str], *, apart: bool) -> Index:
    """Rows of the shots (r, k) of rounds that end before a nest comes again; -1 where none is.

    With `apart` they also end where other rows stand between.
    """
    rounds: list[list[int]] = []
    last = -1
    for row, (name, at) in enumerate(zip(readings.target, readings.order, strict=True)):
        k = list(nests).index(name)
        if not rounds or rounds[-1][k] >= 0 or (apart and at > last + 1):
            rounds.append([-1] * len(nests))
        rounds[-1][k], last = row, int(at)
    return np.array(rounds, dtype=np.int64)


def _whole_rounds(readings: Readings, rows: Index, rounds: Array) -> tuple[Index, list[str]]:
    """Rounds with three good shots, not in one line, and a warning of others; see `judge_drift`."""
    good, at = np.isfinite(rounds[:, :, 0]), np.nanmedian(rounds, axis=0)
    first = int(np.argmax([show_a_turn(at[some]) for some in good]))
    both = good & good[first]
    lost = np.flatnonzero([not show_a_turn(at[some]) for some in both])
    if not len(lost):
        return np.arange(len(rounds)), []
    begins = [readings.place[rows[r][rows[r] >= 0][0]].rpartition(":")[2] for r in lost[:SHOWN]]
    which = (
        f"{named('round', [str(r + 1) for r in lost[:SHOWN]], len(lost))} over the nests (from "
        f"{named('line', begins, len(lost))})"
    )
    line = " out of one line" if both[lost].sum(axis=1).max() >= 3 else ""
    few = f"fewer than three good shots{line}"
    if len(lost) > max(1, MOST_LOST * len(rounds)) or len(rounds) < 3:
        has = "has" if len(lost) == 1 else "have"
        message = f"{which} of {len(rounds)} {has} {few}"
        fix = "raise limit_mm under [drift], or leave the drift out"
        raise _too_few(readings.where, message, allowed="at least 3", fix=fix)
    warning = f"{readings.where}: {which} left out: {few}"
    return np.setdiff1d(np.arange(len(rounds)), lost), [warning]


def _require_nests(rounds: Array, nests: Sequence[str], where: str) -> None:
    """Refuse nests that were never in their place, or that cannot show a rotation."""
    for k, nest in enumerate(nests):
        if np.isnan(rounds[:, k]).all():
            message = (
                f"nest {nest} has no shot near its median: it moved, or was confused with another"
            )
            fix = f"leave {nest} out of [drift], or raise limit_mm"
            raise _too_few(where, message, value=nest, fix=fix)
    if show_a_turn(np.nanmedian(rounds, axis=0)):
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
    """Uncertainty of the fitted shift at `middle` per unit scatter of a nest, one axis."""
    covariance = rigid_fit_covariance(nests, middle, np.tile(np.eye(3), (len(nests), 1, 1)))
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
    drift, begins, lost = judge_drift(nests, settings.nests, middle, limit=settings.limit_mm / 1e3)
    if apart is None or not drift.corrected:
        return correct_drift(robot, drift, begins, middle), drift, lost
    warning = (
        f"{nests.where}: does not say between which poses the nests were shot; the drift is "
        "reported, not taken off"
    )
    return robot, replace(drift, corrected=False), [*lost, warning]
