"""The straight line of `iso9283`: readings into one frame, then every figure with its limits."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from calib.arrays import Array, Index, frozen
from calib.measurement.cycles import repeatability_level, sd_bias
from calib.measurement.iso9283 import (
    IsoFigure,
    accuracy,
    distance_accuracy,
    distance_repeatability,
    gaps,
    repeatability,
)
from calib.measurement.iso_bends import corners
from calib.measurement.iso_drift import BLOCK, DriftFigures, drift
from calib.measurement.iso_limits import (
    Limits,
    largest_limits,
    mean_limits,
    repeatability_limits,
    spread_limits,
)
from calib.measurement.iso_memory import CycleMemory, cycle_memory
from calib.measurement.iso_paths import in_planes, path_figures, resampled
from calib.measurement.iso_rotations import rotation_accuracy, rotation_repeatability
from testbed.files.refusal import refusal
from testbed.iso9283.frames import in_command_frame
from testbed.iso9283.records import (
    PROBABILITY,
    CycleResult,
    CycleTest,
    PathRuns,
    PathShown,
    PoseDrift,
    StatedFigure,
    Visits,
)
from testbed.iso9283.shared import ROTATION, Shared

MOST_PAIRED = 10
"""Poses of which every pair has a distance; of more only those that follow each other."""


def play_test(test: CycleTest) -> CycleResult:
    """All figures of a test.

    Raises
    ------
    InputError
        The frames do not go together, or a path does not follow its command.
    """
    moved, T, frame = in_command_frame(test)
    shared = Shared(test, T)
    figures, shown = list[StatedFigure](), list[PathShown]()
    drifts: tuple[PoseDrift, ...] = ()
    p_value, memory = float("nan"), None
    if moved.visits is not None:
        memory = cycle_memory(moved.visits.position[:, in_time(moved.visits)])
        figures += _poses(moved.visits, shared, memory)
        figures += _directions(moved.visits, memory)
        figures += _distances(moved.visits, shared, memory)
        changes, drifts, p_value = _drifts(moved.visits)
        figures += changes
    for path in moved.paths:
        one, picture = _path(path, shared)
        figures += one
        shown.append(picture)
    return CycleResult(moved, _alike(figures), drifts, p_value, tuple(shown), frame, memory)


def _alike(figures: Sequence[StatedFigure]) -> tuple[StatedFigure, ...]:
    """The figures, each with the median u of all that have its name."""
    u = dict[str, list[float]]()
    for figure in figures:
        u.setdefault(figure.name, []).append(figure.u)
    typical = {name: float(np.median(values)) for name, values in u.items()}
    return tuple(replace(figure, typical_u=typical[figure.name]) for figure in figures)


def in_time(visits: Visits) -> Index:
    """Cycles (n,) in the order of their times, else as they are numbered.

    One order for all poses: what they share in a cycle stays together.
    """
    if visits.time is None:
        return np.arange(visits.cycles)
    return np.argsort(visits.time.mean(axis=0), kind="stable")


def _poses(visits: Visits, shared: Shared, memory: CycleMemory) -> Iterator[StatedFigure]:
    """AP and RP of every entry, and of its orientation."""
    x, c, n, names = visits.position, visits.command, visits.cycles, visits.names
    common = shared.covariance(x.mean(axis=1))
    AP, RP = accuracy(x, c, common=common), repeatability(x, noise=visits.noise)
    apart, dof = _shared_part(AP, accuracy(x, c)), memory.freedom_of_mean
    AP, RP = memory.of_mean(AP, apart), memory.of_scatter(RP)
    yield from _figures("AP", names, AP, mean_limits(AP, dof), n, shared=apart)
    variance = x.var(axis=1, ddof=1) / (memory.worth * memory.shrunk)
    yield from _parts(names, x.mean(axis=1) - c, variance, common, n, dof)
    level = None if visits.noise is None else repeatability_level(visits.noise)
    yield from _figures("RP", names, RP, repeatability_limits(x, memory=memory), n, noise=level)
    if visits.rotation is None:
        return
    if (sent := visits.command_rotation) is not None:
        common = shared.covariance(x.mean(axis=1), ROTATION)
        turn = rotation_accuracy(visits.rotation, sent, common=common)
        apart = _shared_part(turn, rotation_accuracy(visits.rotation, sent))
        turn = memory.of_mean(turn, apart)
        limits = mean_limits(turn, dof)
        yield from _figures("AP_angle", names, turn, limits, n, angle=True, shared=apart)
    spread = rotation_repeatability(visits.rotation, noise=visits.turn_noise)
    spread = memory.of_scatter(spread)
    limits = spread_limits(spread.value, n, memory=memory)
    for k, axis in enumerate("xyz"):
        own = IsoFigure(spread.value[:, k], spread.uncertainty[:, k], spread.floor[:, k])
        part = Limits(limits.lower[:, k], limits.upper[:, k], limits.dof[:, k])
        yield from _figures(f"RP_angle_{axis}", names, own, part, n, angle=True)


def _parts(
    names: tuple[str, ...], off: Array, variance: Array, common: Array | None, n: int, dof: float
) -> Iterator[StatedFigure]:
    """AP along each axis, with its sign."""
    shared = 0.0 if common is None else np.diagonal(common, axis1=1, axis2=2)
    u = np.sqrt(variance + shared)
    half = stdtrit(dof, (1 + PROBABILITY) / 2) * u
    for k, axis in enumerate("xyz"):
        for e, name in enumerate(names):
            value, width = float(off[e, k]), float(half[e, k])
            yield StatedFigure(
                f"AP_{axis}", name, value, value - width, value + width, float(u[e, k]),
                float("nan"), n, shared=float(np.sqrt(np.broadcast_to(shared, off.shape)[e, k])),
            )  # fmt: skip


def _directions(visits: Visits, memory: CycleMemory) -> Iterator[StatedFigure]:
    """Multi-directional variation of every pose that was reached from several directions."""
    n = visits.cycles
    for pose in dict.fromkeys(visits.pose):
        own = [e for e, name in enumerate(visits.pose) if name == pose]
        if len(own) > 1:
            found = memory.of_mean(gaps(visits.position[own]))
            limits = largest_limits(found, 2 * memory.freedom_of_mean)
            yield from _figures("vAP", (pose,), found.largest, limits, n)


def _distances(visits: Visits, shared: Shared, memory: CycleMemory) -> Iterator[StatedFigure]:
    """AD with its sign and RD of pairs of poses reached from the same direction."""
    x, c, n = visits.position, visits.command, visits.cycles
    for one, two in _pairs(visits):
        wanted = float(np.linalg.norm(c[two] - c[one]))
        if not wanted:
            continue
        D = np.linalg.norm(x[two] - x[one], axis=1)
        common = shared.of_distance(x[one].mean(axis=0), x[two].mean(axis=0))
        AD = memory.of_mean(distance_accuracy(x[one], x[two], wanted, common=common), common)
        value, u = float(D.mean() - wanted), float(AD.uncertainty)
        half = float(stdtrit(memory.freedom_of_mean, (1 + PROBABILITY) / 2)) * u
        where = f"{visits.names[one]} to {visits.names[two]}"
        floor = float(AD.floor)
        yield StatedFigure(
            "AD", where, value, value - half, value + half, u, floor, n, shared=common
        )
        noise = None if visits.noise is None else visits.noise[one] + visits.noise[two]
        RD = memory.of_scatter(distance_repeatability(x[one], x[two], noise=noise))
        limits = spread_limits(RD.value, n, memory=memory)
        yield from _figures("RD", (where,), RD, limits, n, noise=RD.floor / sd_bias(n))


def _pairs(visits: Visits) -> Iterator[tuple[int, int]]:
    """Entries whose distance is stated."""
    for way in dict.fromkeys(visits.approach):
        own = [e for e, approach in enumerate(visits.approach) if approach == way]
        every = len(own) <= MOST_PAIRED
        yield from combinations(own, 2) if every else pairwise(own)


def _drifts(visits: Visits) -> tuple[list[StatedFigure], tuple[PoseDrift, ...], float]:
    """DAP and dRP of every entry, where there are times and two blocks of cycles."""
    n = visits.cycles
    if visits.time is None or n // BLOCK < 2:
        return [], (), float("nan")
    order = in_time(visits)
    x, time = visits.position[:, order], visits.time[:, order] / 3600
    found = drift(x, visits.command)
    # within blocks, so that what differs between them, a drift, is not taken for it
    memory = cycle_memory(x[:, : n // BLOCK * BLOCK].reshape(-1, BLOCK, 3))
    parts = np.split(np.arange(n), [BLOCK * k for k in range(1, n // BLOCK)])
    figures, drifts = list[StatedFigure](), list[PoseDrift]()
    for e, name in enumerate(visits.names):
        hours = frozen(np.array([time[e, part].mean() for part in parts]))
        figures += _drift_figures(found, e, x[e], visits.command[e], parts, name, memory)
        drifts.append(
            PoseDrift(
                name, hours, found.accuracy[e], found.repeatability[e], found.chance[e],
                found.p_values[e],
            )
        )  # fmt: skip
    return figures, tuple(drifts), found.p_value


def _drift_figures(
    found: DriftFigures, e: int, x: Array, command: Array, parts: list[Index], name: str,
    memory: CycleMemory,
) -> Iterator[StatedFigure]:  # fmt: skip
    """The largest change of AP and RP against the first block; memory is that within a block."""
    made = {"dAP": lambda y: accuracy(y, command), "dRP": repeatability}
    # all blocks but the last are of one length
    stacks = np.stack([x[part] for part in parts[:-1]]), x[parts[-1]][None]
    for k, (key, values) in enumerate(
        (("dAP", found.accuracy[e]), ("dRP", found.repeatability[e]))
    ):
        u = np.concatenate([made[key](one).uncertainty for one in stacks])
        u, floor = np.hypot(u[0], u[1:]), np.full(len(u) - 1, found.by_chance[e, k])
        change = IsoFigure(np.abs(values[1:] - values[0]), u, floor, u, np.ones(len(u)))
        change = (memory.of_scatter if k else memory.of_mean)(change)
        dof = memory.freedom(BLOCK - 1) if k else memory.freedom_of_mean
        limits = largest_limits(change, 2 * dof)
        yield from _figures(key, (name,), change.largest, limits, len(x))


def _path(path: PathRuns, shared: Shared) -> tuple[list[StatedFigure], PathShown]:
    """AT and RT of one path."""
    x, n = resampled(path.runs, path.command), len(path.runs)
    if (missed := ~np.isfinite(x).all(axis=2)).any():
        point, run = (int(k) for k in np.argwhere(missed)[0])
        raise refusal(
            path.place[run], "path_point",
            f"the run of path {path.name} that begins here does not pass the plane across point "
            f"{path.points[point]} in its turn", code="M35",
            allowed="every run follows the whole path, in its order",
            fix="check the order of points and rows, the cycles, and lost readings, or take this "
            "run out",
        )  # fmt: skip
    common = shared.covariance(x.mean(axis=1))
    noise = None if path.noise is None else np.broadcast_to(path.noise, (len(x), 3, 3))
    fewest = min(map(len, path.runs))
    found = path_figures(x, path.command, noise=noise, readings=fewest)
    a, r = found.worst
    AT, RT = accuracy(x, path.command, common=common), found.repeatability
    own = float(_shared_part(AT, found.accuracy)[a])
    where = f"path {path.name}"
    far, near = largest_limits(AT, n - 1), repeatability_limits(x)
    lowest = float(far.lower)
    if corners(path.command).any():
        # how much of a corner is cut between two readings they tell only roughly
        sharp = accuracy(
            resampled(path.runs, path.command, sharp=True), path.command, common=common
        )
        lowest = min(lowest, float(largest_limits(sharp, n - 1).lower))
    least = repeatability_limits(x, probability=1 - (1 - PROBABILITY) / len(x))
    level = float("nan")
    if noise is not None:
        level = float(repeatability_level(in_planes(noise, path.command)).max())
    steps = np.linalg.norm(np.diff(path.command, axis=0), axis=1)
    figures = [
        StatedFigure("AT", where, float(AT.value[a]), lowest,
                     float(far.upper), float(AT.uncertainty[a]), found.floor, n, shared=own),
        StatedFigure("RT", where, float(RT.value[r]), float(least.lower.max()),
                     float(near.upper.max()), float(RT.uncertainty[r]), found.spread_floor, n,
                     noise=level),
    ]  # fmt: skip
    along = frozen(np.concatenate([[0.0], np.cumsum(steps)]))
    mean = frozen(x.mean(axis=1))
    return figures, PathShown(path.name, path.command, along, mean, AT.value, RT.value)


def _figures(
    name: str, where: tuple[str, ...], found: IsoFigure, limits: Limits, n: int,
    *, angle: bool = False, shared: ArrayLike = 0.0, noise: Array | None = None,
) -> Iterator[StatedFigure]:  # fmt: skip
    """One figure for each entry."""
    level = np.nan if noise is None else noise
    own, level = (np.broadcast_to(one, found.value.shape) for one in (shared, level))
    columns = (found.value, limits.lower, limits.upper, found.uncertainty, found.floor, own, level)
    for place, values in zip(where, np.stack([np.atleast_1d(x) for x in columns], 1), strict=True):
        value, lower, upper, u, floor, common, alone = (float(x) for x in values)
        yield StatedFigure(
            name, place, value, lower, upper, u, floor, n, angle, common, noise=alone
        )


def _shared_part(whole: IsoFigure, alone: IsoFigure) -> Array:
    """What of a standard uncertainty all readings share."""
    return np.asarray(np.sqrt(np.maximum(whole.uncertainty**2 - alone.uncertainty**2, 0.0)))
