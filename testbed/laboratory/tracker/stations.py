"""Tracker stations compared: what each one sees, and how well the best design from there does."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import refuse
from calib.geometry.parameters import Parameters
from calib.information.goals import Goals
from testbed.laboratory.bench import Bench
from testbed.laboratory.tracker.station import Designer, View, view_from
from testbed.scenario.tables import StationSettings

NAMED = 5
"""Stations whose fault is named when none can be used."""


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
        Chooses poses from blocks; must be the same procedure for every station.

    Raises
    ------
    InputError
        If no station sees poses that the parameters could be identified from.

    References
    ----------
    Predicted covariance of the parameters: the inverse of M = sum of B'B over the designed poses,
    whitened by the tracker's covariance from that station; u^2 at a goal is tr(G M^-1 G').
    """
    rows = [
        view_from(bench.standing_at(station), q, parameters, goals, designer)
        for station in stations
    ]
    u_mean = np.array([row.u_mean for row in rows])
    statements = tuple(
        _statement(k, station, row, len(q))
        for k, (station, row) in enumerate(zip(stations, rows, strict=True))
    )
    if not np.isfinite(u_mean).any():
        nobody = f"none of {len(rows)} stations can" if len(rows) > 1 else "the station cannot"
        raise refuse(
            "plan.stations",
            stations.tolist(),
            "the tracker must see poses that tell the parameters apart",
            code="M28",
            message=f"[plan.stations] {nobody} be used: " + "; ".join(statements[:NAMED]),
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
