"""First guesses of frames and fixtures, best first: what the closed forms make of a table."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import inverse, transform
from calib.geometry.model import RobotModel
from calib.identification.start.alignment import Rig
from calib.identification.start.closed_forms import (
    fitted_frame,
    hand_eye_rotations,
    lifted_arm,
    lifted_rotation,
    multilaterated,
    shift_and_arms,
    tool_rotation,
)
from calib.measurement.observations import GIVEN, Measurements

LEVER = 0.3
"""A seen rotation counts like three points this far out [m]."""
FEWEST_LIFT = 5
"""Positions below which the linear lift of the rotation has more unknowns than equations."""
MANY = 20
"""Positions that leave the lift no doubt."""
FEWEST_RANGES = 4
"""Distances below which a point in space is not found linearly."""
GUESSES = np.concatenate([np.zeros((1, 3)), *(r * np.eye(3)[[0, 0, 1, 1, 2, 2]]
    * np.array([1, -1, 1, -1, 1, -1])[:, None] for r in (0.08, 0.25))])  # fmt: skip
"""(13, 3) where a reflector may be, from the nominal place [m], if no closed form applies."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A table against the flange poses that nominal links give, its targets numbered."""

    model: RobotModel
    F: Array
    """(m, 4, 4) T_base_flange [m]."""
    measurements: Measurements
    target: Index
    """(m,) which target a row sees; pose rows see the last one, the tool origin."""
    offsets: Array
    """(k, 3) targets in the tool frame: given, or nominal for reflectors of the fixtures [m]."""
    reflector: Index
    """(k,) which reflector of the fixtures a target is, or -1."""
    free_tool: bool
    known_anchor: Bool
    """(s,) anchors whose place in the world is known."""

    @property
    def nominal_arms(self) -> Array:
        """(k, 3) targets in the flange frame with the nominal tool [m]."""
        tool = self.model.chain.T_flange_tool
        return self.offsets @ tool[:3, :3].T + tool[:3, 3]

    @property
    def given(self) -> Bool:
        """(k,) targets whose place in the tool frame is given."""
        return np.asarray(self.reflector == GIVEN)


@dataclass(frozen=True, slots=True, eq=False)
class Opening:
    """What is known so far of a scene: nan where nothing is."""

    tool: Array
    """(4, 4) T_flange_tool [m]."""
    arms: Array
    """(k, 3) targets in the flange frame [m]."""
    stations: Array
    """(1 + t, 4, 4) T_station_base [m]."""


def scene_of(
    model: RobotModel,
    F: Array,
    measurements: Measurements,
    free_tool: bool,
    free_anchors: Collection[int],
) -> Scene:
    """Number the targets of a table."""
    key = np.column_stack([measurements.offset, measurements.reflector])
    seen, target = np.unique(key[~measurements.is_pose], axis=0, return_inverse=True)
    of_row = np.full(len(measurements), len(seen))
    of_row[~measurements.is_pose] = target.ravel()
    reflector = np.append(seen[:, 3].astype(np.int64), GIVEN)
    offsets = np.concatenate([seen[:, :3], np.zeros((1, 3))])
    own = reflector != GIVEN
    offsets[own] = model.fixtures.reflectors[reflector[own]]
    known = ~np.isin(np.arange(len(model.fixtures.anchors)), list(free_anchors))
    return Scene(model, F, measurements, of_row, offsets, reflector, free_tool, known)


def openings(scene: Scene) -> Iterator[Rig]:
    """Rigs to start from, the likeliest first; made one by one, as long as they are asked for."""
    seen = ~scene.measurements.is_distance
    if seen.any():
        equations = np.bincount(
            scene.measurements.station[seen], scene.measurements.equations[seen]
        )
        main = int(np.argmax(equations))
        rows = np.flatnonzero(seen & (scene.measurements.station == main))
        for X in _turns(scene, rows):
            yield _completed(scene, _stations(scene, _opened(scene, rows, main, X), main))
        return
    for arms in _arm_guesses(scene):
        yield _completed(scene, _nothing(scene, arms))
    yield from _turned_bases(scene)


def _nothing(scene: Scene, arms: Array) -> Opening:
    """An opening that knows arms at most: no station, the tool as they say."""
    empty = np.full((1 + len(scene.model.fixtures.stations), 4, 4), np.nan)
    return Opening(_tool_of(scene, arms), arms, empty)


def _turns(scene: Scene, rows: Index) -> Iterator[Array]:
    """Rotations R_station_base (3, 3) to try for the station that saw `rows`."""
    table, F = scene.measurements, scene.F[rows]
    seen, target = table.position[rows], scene.target[rows]
    about, fixed = scene.nominal_arms, scene.given & (not scene.free_tool)
    pose, sure = table.is_pose[rows], len(rows) >= MANY
    if pose.sum() >= 3 and scene.free_tool:
        found = hand_eye_rotations(F[pose], table.rotation[rows[pose]])
        sure = sure or found is not None
        if found is not None:
            yield found[0]
    known = np.append(fixed[:-1], not scene.free_tool)
    if known[target].any():
        yield _fitted(scene, rows, scene.model.chain.T_flange_tool, np.where(
            known[:, None], about, np.nan))[:3, :3]  # fmt: skip
    if len(rows) >= FEWEST_LIFT:
        yield lifted_rotation(F, seen, target, about, fixed)
    # where the linear forms have all they need, guesses would only cost time
    for guess in GUESSES[: 1 if sure else None]:
        c, X = np.where(fixed[:, None], about, about + guess), np.eye(3)
        for _ in range(5):
            points = (F[:, :3, :3] @ c[target][:, :, None])[:, :, 0] + F[:, :3, 3]
            X = fitted_frame(seen, points, np.eye(3))[:3, :3]
            c = shift_and_arms(X, F, seen, target, c, fixed)[1]
        yield X


def _opened(scene: Scene, rows: Index, main: int, X: Array) -> Opening:
    """What follows from the rotation of the main station: its shift, arms and the tool."""
    table, F, target = scene.measurements, scene.F[rows], scene.target[rows]
    fixed = scene.given & (not scene.free_tool)
    t, c = shift_and_arms(X, F, table.position[rows], target, scene.nominal_arms, fixed)
    arms = np.full_like(c, np.nan)
    arms[np.unique(target)] = c[np.unique(target)]
    pose = table.is_pose[rows]
    if scene.free_tool and pose.any():
        tool = transform(tool_rotation(X, F[pose], table.rotation[rows[pose]]), arms[-1])
    else:
        tool = _tool_of(scene, arms)
    opening = _nothing(scene, arms)
    stations = opening.stations.copy()
    stations[main] = transform(X, t)
    return replace(opening, tool=tool, stations=stations, arms=_with_given(scene, tool, arms))


def _tool_of(scene: Scene, arms: Array) -> Array:
    """Tool frame (4, 4) by the given targets whose arms are known; nominal as far as they leave."""
    nominal = scene.model.chain.T_flange_tool
    known = scene.given & np.isfinite(arms[:, 0])
    if not (scene.free_tool and known.any()):
        return nominal
    return fitted_frame(arms[known], scene.offsets[known], nominal[:3, :3])


def _with_given(scene: Scene, tool: Array, arms: Array) -> Array:
    """Arms (k, 3), those of given targets where the tool has them."""
    own = scene.offsets @ tool[:3, :3].T + tool[:3, 3]
    return np.where(scene.given[:, None], own, arms)


def _fitted(scene: Scene, rows: Index, tool: Array, arms: Array) -> Array:
    """T_station_base (4, 4) by the rows that see known targets."""
    table = scene.measurements
    rows = rows[np.isfinite(arms[scene.target[rows], 0])]
    c = arms[scene.target[rows]]
    F, seen = scene.F[rows], table.position[rows]
    points = (F[:, :3, :3] @ c[:, :, None])[:, :, 0] + F[:, :3, 3]
    pose = table.is_pose[rows]
    turned, R = (F[pose] @ tool)[:, :3, :3], table.rotation[rows[pose]]
    there, here = [seen], [points]
    for axis in range(3):
        there.append(seen[pose] + LEVER * R[:, :, axis])
        here.append(points[pose] + LEVER * turned[:, :, axis])
    about = scene.model.chain.T_world_base[:3, :3]
    return fitted_frame(np.concatenate(there), np.concatenate(here), about)


def _stations(scene: Scene, opening: Opening, main: int) -> Opening:
    """All stations that saw anything, and the arms of reflectors that only they saw."""
    table = scene.measurements
    for s in [main, *np.unique(table.station[~table.is_distance]).tolist()]:
        rows = np.flatnonzero((table.station == s) & ~table.is_distance)
        arms, stations = opening.arms.copy(), opening.stations.copy()
        if not np.isfinite(stations[s]).all():
            if not np.isfinite(arms[scene.target[rows], 0]).any():
                new = np.unique(scene.target[rows])
                arms[new] = scene.nominal_arms[new]
                if len(rows) >= FEWEST_LIFT:
                    fixed = np.ones(len(arms), dtype=bool)
                    fixed[new] = False
                    about = np.where(np.isfinite(arms), arms, 0.0)
                    part = scene.F[rows], table.position[rows], scene.target[rows]
                    X = lifted_rotation(*part, about, fixed)
                    arms[new] = shift_and_arms(X, *part, about, fixed)[1][new]
            stations[s] = _fitted(scene, rows, opening.tool, arms)
        back = inverse(stations[s] @ scene.F[rows])
        own = (back[:, :3, :3] @ table.position[rows][:, :, None])[:, :, 0] + back[:, :3, 3]
        for k in np.unique(scene.target[rows]):
            if not np.isfinite(arms[k]).all():
                arms[k] = own[scene.target[rows] == k].mean(0)
        opening = replace(opening, arms=arms, stations=stations)
    return opening


def _arm_guesses(scene: Scene) -> Iterator[Array]:
    """Arms (k, 3) to try where only distances were measured; nan where nothing is known yet."""
    table, nominal = scene.measurements, scene.nominal_arms
    given = scene.given & (not scene.free_tool)
    arms = np.where(given[:, None], nominal, np.nan)
    if given[np.unique(scene.target)].any():
        yield arms
        return
    main = int(np.argmax(np.bincount(scene.target)))
    rows = np.flatnonzero(scene.target == main)
    _, anchor = np.unique(table.anchor[rows], return_inverse=True)
    count = int(anchor.max()) + 1
    if len(rows) >= 3 + 13 * count:
        arms[main] = lifted_arm(scene.F[rows], table.distance[rows], anchor.ravel(), count)
        yield arms.copy()
    for guess in GUESSES:
        arms[main] = nominal[main] + guess
        yield arms.copy()


def _turned_bases(scene: Scene) -> Iterator[Rig]:
    """Rigs with the base turned in steps of 90 degrees, where an anchor has too few distances."""
    table = scene.measurements
    c = scene.nominal_arms[scene.target]
    points = (scene.F[:, :3, :3] @ c[:, :, None])[:, :, 0] + scene.F[:, :3, 3]
    centers = scene.model.fixtures.anchors[table.anchor]
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        R = np.eye(3)[list(order)] * signs
        if np.linalg.det(R) > 0:
            # |R p + t - s| = d: the base lies at distance d from s - R p
            t = multilaterated(centers - points @ R.T, table.distance)
            tool = scene.model.chain.T_flange_tool
            yield Rig(scene.F, transform(R, t), tool, scene.model.fixtures)


def _completed(scene: Scene, opening: Opening) -> Rig:
    """The rig of an opening: base and stations in the world, then what only distances tell."""
    model, fixtures = scene.model, scene.model.fixtures
    sighted = np.isfinite(opening.stations[:, 0, 0])
    base = opening.stations[0] if sighted[0] else model.chain.T_world_base
    arms, anchors = _ranged(scene, opening.arms, base if sighted.any() else None)
    tool = opening.tool if sighted.any() else _tool_of(scene, arms)
    if not sighted.any():
        fixed = scene.known_anchor & np.isfinite(anchors[:, 0])
        if fixed.any():
            base = fitted_frame(fixtures.anchors[fixed], anchors[fixed], base[:3, :3])
    stations = fixtures.stations.copy()
    for s in np.flatnonzero(sighted[1:]):
        stations[s] = base @ inverse(opening.stations[s + 1])
    reflectors = fixtures.reflectors.copy()
    for k in np.flatnonzero(~scene.given & np.isfinite(arms[:, 0])):
        reflectors[scene.reflector[k]] = (arms[k] - tool[:3, 3]) @ tool[:3, :3]
    world = anchors @ base[:3, :3].T + base[:3, 3]
    found = ~scene.known_anchor & np.isfinite(anchors[:, 0])
    placed = np.where(found[:, None], world, fixtures.anchors)
    return Rig(scene.F, base, tool, Fixtures(reflectors, placed, stations))


def _ranged(scene: Scene, arms: Array, base: Array | None) -> tuple[Array, Array]:
    """Arms (k, 3) and anchors (s, 3) in the base frame, one after the other from distances."""
    table, fixtures = scene.measurements, scene.model.fixtures
    arms, anchors = arms.copy(), np.full((len(fixtures.anchors), 3), np.nan)
    if base is not None:
        known = (fixtures.anchors - base[:3, 3]) @ base[:3, :3]
        anchors[scene.known_anchor] = known[scene.known_anchor]
    far = np.flatnonzero(table.is_distance)
    R, p = scene.F[far, :3, :3], scene.F[far, :3, 3]
    target, anchor, distance = scene.target[far], table.anchor[far], table.distance[far]
    for _ in range(len(arms) + len(anchors)):
        before = np.isfinite(arms).sum() + np.isfinite(anchors).sum()
        for k in np.unique(anchor):
            rows = (anchor == k) & np.isfinite(arms[target, 0])
            if np.isnan(anchors[k, 0]) and rows.sum() >= FEWEST_RANGES:
                points = (R[rows] @ arms[target[rows]][:, :, None])[:, :, 0] + p[rows]
                anchors[k] = multilaterated(points, distance[rows])
        for k in np.unique(target):
            rows = (target == k) & np.isfinite(anchors[anchor, 0])
            if np.isnan(arms[k, 0]) and rows.sum() >= FEWEST_RANGES:
                # the anchor as the flange sees it lies at distance d from the reflector
                apart = (anchors[anchor[rows]] - p[rows])[:, None, :] @ R[rows]
                arms[k] = multilaterated(apart[:, 0], distance[rows])
        if np.isfinite(arms).sum() + np.isfinite(anchors).sum() == before:
            break
    return arms, anchors
