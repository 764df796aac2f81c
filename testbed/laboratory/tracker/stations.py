"""Tracker stations: where one can stand, what it sees, how well the best design from there does."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.errors import CalibError, InputError, refuse
from calib.geometry.frames import target_points
from calib.geometry.parameters import Parameters
from calib.information.goals import Goals
from calib.measurement.observations import DISTANCE
from calib.shown import length_words
from testbed.laboratory.bench import Bench
from testbed.laboratory.tracker.predicted import goal_uncertainty, shared_rows
from testbed.robots.room import BESIDE, from_arm, leading_slides, reach
from testbed.scenario.planning import StationSettings

METERS = 0.05
"""A station so near the base was stated in meters [m]."""
NEAREST = 0.8
"""Nearest target a tracker is asked to measure [m]."""
NAMED = 5
"""Stations whose fault is named when none can be used."""
Designer = Callable[[Array, Array], Index]
"""From blocks (V, r, p) of the visible poses, and (V, r, k) of errors that all their readings
share, to the positions of the chosen ones."""


class View(NamedTuple):
    """What the tracker sees from one station, and the best design: see `StationComparison`."""

    turned_away: int
    hidden: int
    visible: int
    range_mean: float
    design: Index
    u_mean: float
    u_worst: float
    fault: str = ""
    """Why there is no design."""


@dataclass(frozen=True, slots=True, eq=False)
class StationComparison:
    """One common pool of poses, seen from several stations; uncertainties are predictions."""

    stations: Array
    """(s, 3) beam origins in the base frame [m]."""
    n_candidates: int
    """Poses of the common pool."""
    turned_away: Index
    """(s,) candidates whose target does not face the station."""
    hidden: Index
    """(s,) candidates that face it, but the beam is blocked."""
    visible: Index
    """(s,) candidates that can be measured from there."""
    range_mean: Array
    """(s,) mean distance to the visible targets; nan if there are none [m]."""
    designs: tuple[Index, ...]
    """(s,) the poses designed for each station, as positions in the common pool; maybe none."""
    u_mean: Array
    """(s,) predicted RMS standard uncertainty of the tool point over the goal, errors that all
    readings share included; inf: no design [m]."""
    u_worst: Array
    """(s,) the same at the worst goal pose [m]."""
    statements: tuple[str, ...]
    """(s,) what became of each station, in words."""
    best: int
    """Station with the smallest mean uncertainty; ties to the first."""


def station_grid(settings: StationSettings) -> Array:
    """Stations (s, 3) of a scenario: the list, or the grid with x running slowest [m]."""
    if settings.grid is None:
        return np.array(settings.list_mm, dtype=np.float64).reshape(-1, 3) / 1e3
    axes = [
        np.linspace(low, high, count) if count > 1 else np.array([(low + high) / 2])
        for low, high, count in zip(
            settings.grid.from_mm, settings.grid.to_mm, settings.grid.count, strict=True
        )
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) / 1e3


def require_stations(bench: Bench) -> None:
    """Refuse a station of [tracker] or [fixtures] where no tracker can stand."""
    scenario = bench.scenario
    places = [("[tracker] station_mm", "tracker.station_mm", scenario.tracker.station_mm)]
    if scenario.fixtures is not None:
        places += [
            (f"[fixtures] stations_mm entry {k}", "fixtures.stations_mm", place)
            for k, place in enumerate(scenario.fixtures.stations_mm, 1)
        ]
    for name, field, (x, y, z) in places:
        at = f"{name} at ({x:g}, {y:g}, {z:g}) mm"
        require_station(bench, np.array([x, y, z]) / 1e3, at, field)


def require_station(bench: Bench, station: Array, name: str, field: str) -> None:
    """Refuse one station (3,) in the base frame [m] where no tracker can stand."""
    chain = bench.robot.model.chain

    def refusal(message: str, allowed: str, fix: str) -> InputError:
        mm = (station * 1e3).tolist()
        return refuse(field, mm, allowed, code="S37", message=f"{name} {message}", fix=fix)

    below = -bench.simulator.above_floor((chain.T_world_base @ [*station, 1.0])[:3])
    if below > 0:
        message = f"lies {below * 1e3:.0f} mm below the floor"
        raise refusal(message, "", "put the tracker above the floor")
    needed = reach(chain, bench.robot.limits) + BESIDE
    apart = from_arm(chain, bench.robot.limits, station)
    if apart < needed:
        meters = 0 < np.linalg.norm(station) < METERS
        place = "where the arm can slide" if leading_slides(chain) else "the base"
        raise refusal(
            f"is {apart:.2f} m from {place}: the tracker would stand in the robot's work space",
            f"it needs {needed:.2f} m or more, the arm's length and {BESIDE:g} m",
            "it is in mm: are these meters?" if meters else "move the tracker away from the robot",
        )


def require_ranges(bench: Bench, q: Array, whose: str) -> None:
    """Refuse stations that poses q (m, n) bring the target too near to; `whose` poses they are."""
    chain, T = bench.robot.model.chain, bench.robot.model.poses(q)
    optical = [one for one in bench.rounds if one.kind != DISTANCE]
    for tracker in [one.tracker for one in optical] or [bench.tracker]:
        targets = target_points(T, tracker.aim(chain))
        nearest = float(np.linalg.norm(targets - tracker.station, axis=1).min())
        if nearest < NEAREST:
            raise refuse(
                "tracker.station_mm", nearest,
                f"it needs {NEAREST:g} m or more, or the tracker stands in the robot's work space",
                code="S37", fix="move the tracker away from the robot",
                message=f"a pose of {whose} brings the target to {nearest:.2f} m from the tracker",
            )  # fmt: skip


def compare_stations(
    bench: Bench,
    stations: Array,
    q: Array,
    parameters: Parameters,
    goals: Goals,
    designer: Designer,
) -> StationComparison:
    """Design from every station with the same pool and find the best station.

    Parameters
    ----------
    bench : Bench
        The laboratory; the tracker's own station is not used.
    stations : (s, 3) array
        Beam origins in the base frame [m].
    q : (N, n) array
        Common pool: free poses, drawn without asking what any station sees [rad, m].
    parameters : Parameters
        Numbers to identify, already reduced to what poses of the pool can tell apart.
    goals : Goals
        The goal poses in these numbers.
    designer : callable
        Chooses poses; must be the same procedure for every station.

    Raises
    ------
    InputError
        If no station sees poses that the parameters could be identified from.

    References
    ----------
    Predicted covariance of the parameters: the inverse of M = sum of B'B over the designed poses,
    whitened by the tracker's covariance from that station; u^2 at a goal is tr(G M^-1 G'), and what
    the errors in common add (`predicted.goal_u`).
    """
    rows = [
        view_from(bench.standing_at(station), q, parameters, goals, designer)
        for station in stations
    ]
    statements = tuple(
        _statement(k, station, row, len(q))
        for k, (station, row) in enumerate(zip(stations, rows, strict=True))
    )
    if not any(np.isfinite(row.u_mean) for row in rows):
        nobody = f"none of {len(rows)} stations can" if len(rows) > 1 else "the station cannot"
        message = f"[plan.stations] {nobody} be used: " + "; ".join(statements[:NAMED])
        allowed = "the tracker must see poses that tell the parameters apart"
        fix = "move the stations to where the probe faces them and nothing stands between"
        value = stations.tolist()
        raise refuse("plan.stations", value, allowed, code="M28", message=message, fix=fix)
    away, hidden, visible, range_mean, designs, u_mean, u_worst, _ = zip(*rows, strict=True)
    return StationComparison(
        stations=frozen(stations),
        n_candidates=len(q),
        turned_away=frozen(away, np.int64),
        hidden=frozen(hidden, np.int64),
        visible=frozen(visible, np.int64),
        range_mean=frozen(range_mean),
        designs=designs,
        u_mean=frozen(u_mean),
        u_worst=frozen(u_worst),
        statements=statements,
        best=int(np.argmin(u_mean)),
    )


def view_from(
    bench: Bench, q: Array, parameters: Parameters, goals: Goals, designer: Designer
) -> View:
    """What the station of a bench sees of poses q (m, n), and how well the best design does."""
    facing, seen = visible_from(bench, q)
    away, hidden = int((~facing).sum()), int((facing & ~seen).sum())
    left, none = np.flatnonzero(seen), np.zeros(0, dtype=np.int64)
    if not len(left):
        return View(away, hidden, 0, np.nan, none, np.inf, np.inf, "nothing")
    targets = bench.tracker.targets(bench.robot.model.poses(q[left]))
    distance = float(np.linalg.norm(targets - bench.tracker.station, axis=1).mean())
    counted = (away, hidden, len(left), distance)
    blocks, shared = bench.blocks(q[left], parameters), shared_rows(bench, q[left])
    try:
        chosen = np.asarray(designer(blocks, shared), dtype=np.int64)
    except CalibError as error:
        return View(*counted, none, np.inf, np.inf, _why(error))
    u = goal_uncertainty(np.concatenate([blocks, shared], axis=2)[chosen], goals.rows)
    if not np.isfinite(u).all():
        return View(*counted, none, np.inf, np.inf, "the design cannot tell the parameters apart")
    mean = float(np.sqrt(np.average(u**2, weights=goals.weights)))
    return View(*counted, frozen(left[chosen], np.int64), mean, float(u.max()))


def _why(error: CalibError) -> str:
    """An error as a part of another sentence: without place, code and advice."""
    return f"{error.message}, {error.allowed}" if error.allowed else error.message


def visible_from(bench: Bench, q: Array) -> tuple[Bool, Bool]:
    """Whether (m,) the target faces the tracker, and whether the tracker also sees it."""
    candidates = bench.candidates()
    facing = candidates.faces(q)
    seen = facing.copy()
    if candidates.settings.line_of_sight:
        seen[facing] = candidates.sees(q[facing])
    return facing, seen


def place_word(k: int, station: Array) -> str:
    """A station as people name it."""
    x, y, z = station * 1e3
    return f"station {k + 1} at ({x:.0f}, {y:.0f}, {z:.0f}) mm"


def _statement(k: int, station: Array, row: View, n: int) -> str:
    """What became of a station."""
    lost = [
        f"{count} {word}"
        for count, word in (
            (row.turned_away, "with the probe turned away"),
            (row.hidden, "hidden from the beam"),
        )
        if count
    ]
    because = f" ({', '.join(lost)})" if lost else ""
    if not row.visible:
        return f"{place_word(k, station)} sees nothing: of {n} candidates {' and '.join(lost)}"
    seen = f"{place_word(k, station)} sees {row.visible} of {n} candidates{because}"
    if row.fault:
        return f"{seen}, but no design: {row.fault}"
    u = length_words(row.u_mean, um=".1f")
    return f"{seen} at {row.range_mean:.2f} m on average and predicts u = {u}"
