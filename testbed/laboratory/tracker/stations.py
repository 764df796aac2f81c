"""Tracker stations compared: what each one sees, and how well the best design from there does."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen
from calib.errors import InputError
from calib.geometry.parameters import Parameters
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.station import Designer, View, judge
from testbed.laboratory.tracker.tracker import tracker_from
from testbed.robots.catalog import Robot
from testbed.scenario.read import At960Tracker, PaperTracker, StationSettings

TOLD = 5
"""Stations whose fault is told when none can be used."""


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
    """(s,) predicted RMS standard uncertainty of the tool point over the goal; inf: no design
    [m]."""
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


def compare_stations(
    robot: Robot,
    simulator: Simulator,
    settings: PaperTracker | At960Tracker,
    stations: ArrayLike,
    q: ArrayLike,
    parameters: Parameters,
    goal: ArrayLike,
    designer: Designer,
    *,
    sigma_q: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    line_of_sight: bool = True,
) -> StationComparison:
    """Design from every station with the same pool and say which station is best.

    Parameters
    ----------
    robot : Robot
        Nominal robot.
    simulator : Simulator
        Of its nominal chain, with the obstacles of the cell.
    settings : PaperTracker or At960Tracker
        The tracker; its own station is not used.
    stations : (s, 3) array_like
        Beam origins in the base frame [m].
    q : (N, n) array_like
        Common pool: free poses, drawn without asking what any station sees [rad, m].
    parameters : Parameters
        Numbers to identify, already reduced to what poses of the pool can tell.
    goal : (g, 3, p) array_like
        Jacobians of the tool point at the goal poses, in scaled columns [m].
    designer : callable
        Chooses poses from blocks; must be the same procedure for every station.
    sigma_q : (n,) array_like, optional
        Stated repeatability of each joint; none by default [rad or m].
    weights : (g,) array_like, optional
        How much each goal pose counts; the same by default.
    line_of_sight : bool
        Whether a blocked beam hides a pose.

    Raises
    ------
    InputError
        If no station sees poses that the parameters could be identified from.

    References
    ----------
    Predicted covariance of the parameters: the inverse of M = sum of B'B over the designed poses,
    whitened by the tracker's covariance from that station; u^2 at a goal is tr(G M^-1 G').
    """
    stations, goal = check(f"s 3, g 3 {parameters.n_free}", stations=stations, goal=goal)
    (q,) = check(f"N {len(robot.limits)}", q=q)
    share = np.ones(len(goal)) if weights is None else check(f"{len(goal)}", weights=weights)[0]
    noise = np.zeros(q.shape[1]) if sigma_q is None else np.asarray(sigma_q, dtype=np.float64)
    if not len(stations):
        raise InputError(
            "no stations to compare",
            code="S37",
            field="plan.stations",
            fix="write [plan.stations] list_mm or a grid",
        )
    rows = []
    for station in stations:
        tracker = tracker_from(
            settings.model_copy(update={"station_mm": tuple(station * 1e3)}), robot.model.chain
        )
        rows.append(judge(robot, simulator, tracker, q, parameters, goal, share, noise, designer,
                           line_of_sight))  # fmt: skip
    u_mean = np.array([row.u_mean for row in rows])
    statements = tuple(
        _statement(k, station, row, len(q))
        for k, (station, row) in enumerate(zip(stations, rows, strict=True))
    )
    if not np.isfinite(u_mean).any():
        nobody = f"none of {len(rows)} stations can" if len(rows) > 1 else "the station cannot"
        raise InputError(
            f"[plan.stations] {nobody} be used: " + "; ".join(statements[:TOLD]),
            code="M28",
            field="plan.stations",
            value=stations.tolist(),
            allowed="the tracker must see poses that tell the parameters apart",
            fix="move the stations to where the probe faces them and nothing stands between",
        )
    return StationComparison(
        stations=frozen(stations),
        n_candidates=len(q),
        turned_away=frozen([row.turned_away for row in rows], np.int64),
        hidden=frozen([row.hidden for row in rows], np.int64),
        visible=frozen([row.visible for row in rows], np.int64),
        range_mean=frozen([row.range_mean for row in rows]),
        designs=tuple(row.design for row in rows),
        u_mean=frozen(u_mean),
        u_worst=frozen([row.u_worst for row in rows]),
        statements=statements,
        best=int(np.argmin(u_mean)),
    )


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
    return f"{seen} at {row.range_mean:.2f} m on average and predicts u = {row.u_mean * 1e6:.1f} um"
