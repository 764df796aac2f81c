"""Initial guesses of frames and fixtures from closed forms, the most reliable first."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.frames import inverse, points_of_frames, transform, transform_points
from calib.identification.start.alignment import Alignment, StartProblem
from calib.identification.start.closed_forms import (
    PointColumns,
    fitted_frame,
    hand_eye_rotations,
    lifted_arm,
    lifted_rotation,
    multilaterated,
    tool_rotation,
)
from calib.identification.start.ranging import from_distances, on_known_sides

ROTATION_ARM = 0.3
"""A measured rotation counts like three points at this distance from the target [m]."""
FEWEST_LIFT = 5
"""Positions below which the linear lift of the rotation has more unknowns than equations."""
MANY = 20
"""Number of positions from which the linear lift is reliable."""
ARM_GUESSES = np.concatenate([np.zeros((1, 3)), *(r * np.eye(3)[[0, 0, 1, 1, 2, 2]]
    * np.array([1, -1, 1, -1, 1, -1])[:, None] for r in (0.08, 0.25))])  # fmt: skip
"""(13, 3) offsets of a reflector from its nominal place to try if no closed form applies [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class PartialAlignment:
    """The alignment as far as it is known; nan elsewhere."""

    tool: Array
    """(4, 4) T_flange_tool [m]."""
    arms: Array
    """(k, 3) targets in the flange frame [m]."""
    stations: Array
    """(1 + t, 4, 4) T_station_base [m]."""


def initial_guesses(problem: StartProblem) -> Iterator[Alignment]:
    """Alignments to start from, the most reliable first; each is computed on demand."""
    table = problem.measurements
    optical = ~table.is_distance
    held = optical & problem.placed[table.station]
    if held.any():
        partial = _from_held(problem, np.flatnonzero(held))
        yield _complete(problem, _with_stations(problem, partial))
        return
    if problem.placed[0] and not optical.any():
        for guess in (np.full(3, np.nan), *ARM_GUESSES):
            yield _complete(problem, _without_stations(problem, problem.nominal_arms + guess))
        return
    if optical.any():
        # begin with the station of most equations; the others follow from its arms
        main = int(np.argmax(np.bincount(table.station[optical], table.equations[optical])))
        rows = np.flatnonzero(optical & (table.station == main))
        for X in _station_rotations(problem, rows):
            partial = _from_rotation(problem, rows, main, X)
            yield _complete(problem, _with_stations(problem, partial))
        return
    for arms in _arm_guesses(problem):
        yield _complete(problem, _without_stations(problem, arms))
    yield from _turned_base_guesses(problem)


def _without_stations(problem: StartProblem, arms: Array) -> PartialAlignment:
    """Partial alignment of arms (k, 3) [m], the tool fitted to them, and stations that are held."""
    model, placed = problem.model, problem.placed
    stations = np.full((len(placed), 4, 4), np.nan)
    stations[placed] = inverse(model.fixtures.station_frames[placed]) @ model.chain.T_world_base
    return PartialAlignment(_tool_of(problem, arms), arms, stations)


def _station_rotations(problem: StartProblem, rows: Index) -> Iterator[Array]:
    """Rotations R_station_base (3, 3) to try for the station that measured `rows`."""
    table, F = problem.measurements, problem.F[rows]
    position, target = table.position[rows], problem.target[rows]
    about, fixed = problem.nominal_arms, problem.fixed
    pose, sure = table.is_pose[rows], len(rows) >= MANY
    # hand-eye calibration, from full poses
    if pose.sum() >= 3 and problem.free_tool:
        rotations = hand_eye_rotations(F[pose], table.rotation[rows[pose]])
        if rotations is not None:
            sure = True
            yield rotations[0]
    # Procrustes, if targets are known on the flange
    known = np.append(fixed[:-1], not problem.free_tool)
    if known[target].any():
        arms = np.where(known[:, None], about, np.nan)
        yield _fitted_station(problem, rows, problem.model.chain.T_flange_tool, arms)[:3, :3]
    # linear lift, from points alone
    if len(rows) >= FEWEST_LIFT:
        yield lifted_rotation(F, position, target, about, fixed)
    # alternate between frame and arms from guessed arms; one guess if the forms above suffice
    columns = PointColumns.of(F, target, fixed)
    for guess in ARM_GUESSES[: 1 if sure else None]:
        arms, X = np.where(fixed[:, None], about, about + guess), np.eye(3)
        for _ in range(5):
            X = fitted_frame(position, points_of_frames(F, arms[target]), np.eye(3))[:3, :3]
            arms = columns.shift_and_arms(X, position, arms)[1]
        yield X


def _from_rotation(problem: StartProblem, rows: Index, main: int, X: Array) -> PartialAlignment:
    """Shift of the main station, arms and tool, given its rotation X (3, 3)."""
    table, F, target = problem.measurements, problem.F[rows], problem.target[rows]
    about = problem.nominal_arms
    columns = PointColumns.of(F, target, problem.fixed)
    shift, all_arms = columns.shift_and_arms(X, table.position[rows], about)
    # only arms that this station measured
    arms = np.full_like(all_arms, np.nan)
    arms[np.unique(target)] = all_arms[np.unique(target)]
    pose = table.is_pose[rows]
    if problem.free_tool and pose.any():
        tool = transform(tool_rotation(X, F[pose], table.rotation[rows[pose]]), arms[-1])
    else:
        tool = _tool_of(problem, arms)
    partial = _without_stations(problem, arms)
    stations = partial.stations.copy()
    stations[main] = transform(X, shift)
    # given targets follow from the tool, whether measured or not
    arms = np.where(problem.given[:, None], problem.offsets_through(tool), arms)
    return replace(partial, tool=tool, stations=stations, arms=arms)


def _from_held(problem: StartProblem, rows: Index) -> PartialAlignment:
    """Arms and tool from rows of stations that are held: their readings in the flange frame."""
    table, F, target = problem.measurements, problem.F[rows], problem.target[rows]
    partial = _without_stations(problem, np.full(problem.offsets.shape, np.nan))
    X = partial.stations[table.station[rows]]
    in_flange, arms = points_of_frames(inverse(X @ F), table.position[rows]), partial.arms.copy()
    for k in np.unique(target):
        arms[k] = in_flange[target == k].mean(0)
    pose = table.is_pose[rows]
    if problem.free_tool and pose.any():
        in_base = np.swapaxes(X[pose, :3, :3], 1, 2) @ table.rotation[rows[pose]]
        tool = transform(tool_rotation(np.eye(3), F[pose], in_base), arms[-1])
    else:
        tool = _tool_of(problem, arms)
    arms = np.where(problem.given[:, None], problem.offsets_through(tool), arms)
    return replace(partial, tool=tool, arms=arms)


def _tool_of(problem: StartProblem, arms: Array) -> Array:
    """Tool frame (4, 4) fitted to given targets with known arms; nominal if these leave it open."""
    nominal = problem.model.chain.T_flange_tool
    known = problem.given & np.isfinite(arms[:, 0])
    if not (problem.free_tool and known.any()):
        return nominal
    return fitted_frame(arms[known], problem.offsets[known], nominal[:3, :3])


def _fitted_station(problem: StartProblem, rows: Index, tool: Array, arms: Array) -> Array:
    """T_station_base (4, 4) fitted to the rows that measured known targets."""
    table = problem.measurements
    rows = rows[np.isfinite(arms[problem.target[rows], 0])]
    F, position = problem.F[rows], table.position[rows]
    points = points_of_frames(F, arms[problem.target[rows]])
    # a rotation as three points on its axes
    pose = table.is_pose[rows]
    turned, R = (F[pose] @ tool)[:, :3, :3], table.rotation[rows[pose]]
    there, here = [position], [points]
    for axis in range(3):
        there.append(position[pose] + ROTATION_ARM * R[:, :, axis])
        here.append(points[pose] + ROTATION_ARM * turned[:, :, axis])
    about = problem.model.chain.T_world_base[:3, :3]
    return fitted_frame(np.concatenate(there), np.concatenate(here), about)


def _with_stations(problem: StartProblem, partial: PartialAlignment) -> PartialAlignment:
    """Add all stations with poses or points, and the arms of reflectors that only they measured."""
    table = problem.measurements
    known, seen = partial.stations[:, 0, 0], np.unique(table.station[~table.is_distance])
    for s in sorted(seen.tolist(), key=lambda s: bool(np.isnan(known[s]))):
        rows = np.flatnonzero((table.station == s) & ~table.is_distance)
        arms, stations = partial.arms.copy(), partial.stations.copy()
        target = problem.target[rows]
        if not np.isfinite(stations[s]).all():
            if not np.isfinite(arms[target, 0]).any():
                arms = _lifted_arms(problem, rows, arms)
            stations[s] = _fitted_station(problem, rows, partial.tool, arms)
        # this station places reflectors that no earlier one has placed
        in_flange = points_of_frames(inverse(stations[s] @ problem.F[rows]), table.position[rows])
        for k in np.unique(target):
            if not np.isfinite(arms[k]).all():
                arms[k] = in_flange[target == k].mean(0)
        partial = replace(partial, arms=arms, stations=stations)
    return partial


def _lifted_arms(problem: StartProblem, rows: Index, arms: Array) -> Array:
    """Arms (k, 3), adding targets that only a new station measured: by the lift, else nominal."""
    new = np.unique(problem.target[rows])
    arms = arms.copy()
    arms[new] = problem.nominal_arms[new]
    if len(rows) >= FEWEST_LIFT:
        fixed = np.ones(len(arms), dtype=bool)
        fixed[new] = False
        about = np.where(np.isfinite(arms), arms, 0.0)
        F, target = problem.F[rows], problem.target[rows]
        position = problem.measurements.position[rows]
        X = lifted_rotation(F, position, target, about, fixed)
        columns = PointColumns.of(F, target, fixed)
        arms[new] = columns.shift_and_arms(X, position, about)[1][new]
    return arms


def _arm_guesses(problem: StartProblem) -> Iterator[Array]:
    """Arms (k, 3) to try if only distances were measured; nan if not known yet [m]."""
    table, nominal, fixed = problem.measurements, problem.nominal_arms, problem.fixed
    arms = np.where(fixed[:, None], nominal, np.nan)
    if fixed[np.unique(problem.target)].any():
        yield arms
        return
    # the target with the most distances: by the linear lift, then around its nominal place
    main = int(np.argmax(np.bincount(problem.target)))
    rows = np.flatnonzero(problem.target == main)
    _, anchor = np.unique(table.anchor[rows], return_inverse=True)
    count = int(anchor.max()) + 1
    if len(rows) >= 3 + 13 * count:
        arms[main] = lifted_arm(problem.F[rows], table.distance[rows], anchor.ravel(), count)
        yield arms.copy()
    for guess in ARM_GUESSES:
        arms[main] = nominal[main] + guess
        yield arms.copy()


def _turned_base_guesses(problem: StartProblem) -> Iterator[Alignment]:
    """Alignments with the base turned by right angles, for anchors with too few distances."""
    table = problem.measurements
    points = points_of_frames(problem.F, problem.nominal_arms[problem.target])
    centers = problem.model.fixtures.anchors[table.anchor]
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        R = np.eye(3)[list(order)] * signs
        if np.linalg.det(R) > 0:
            # |R p + t - s| = d: the base lies at distance d from s - R p
            t = multilaterated(centers - points @ R.T, table.distance)
            tool = problem.model.chain.T_flange_tool
            yield Alignment(problem.F, transform(R, t), tool, problem.model.fixtures)


def _complete(problem: StartProblem, partial: PartialAlignment) -> Alignment:
    """Complete alignment: base and stations in the world, then what only distances determine."""
    model, fixtures = problem.model, problem.model.fixtures
    # the first station is the world: if it measured nothing, the base stays nominal
    sighted = np.isfinite(partial.stations[:, 0, 0])
    base = partial.stations[0] if sighted[0] else model.chain.T_world_base
    arms, anchors = from_distances(problem, partial.arms, base if sighted.any() else None)
    seen = not problem.measurements.is_distance.all()
    tool = partial.tool if sighted.any() and seen else _tool_of(problem, arms)
    if not sighted.any():
        # by distances alone the base follows from known anchors
        fixed = problem.known_anchor & np.isfinite(anchors[:, 0])
        if fixed.any():
            anchors = on_known_sides(problem, arms, anchors, np.flatnonzero(fixed))
            base = fitted_frame(fixtures.anchors[fixed], anchors[fixed], base[:3, :3])
    # stations, reflectors and anchors in the frames that the fixtures use
    stations = fixtures.stations.copy()
    for s in np.flatnonzero(sighted[1:]):
        stations[s] = base @ inverse(partial.stations[s + 1])
    reflectors = fixtures.reflectors.copy()
    for k in np.flatnonzero(~problem.given & np.isfinite(arms[:, 0])):
        reflectors[problem.reflector[k]] = (arms[k] - tool[:3, 3]) @ tool[:3, :3]
    world = transform_points(base, anchors)
    placed = ~problem.known_anchor & np.isfinite(anchors[:, 0])
    anchors = np.where(placed[:, None], world, fixtures.anchors)
    found = replace(fixtures, reflectors=reflectors, anchors=anchors, stations=stations)
    return Alignment(problem.F, base, tool, found)
