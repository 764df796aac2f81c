"""Do targets that stand in one file stand on one tool? Places a robot was sent to are no target."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from calib.arrays import Array, Index
from calib.errors import InputError
from calib.measurement.observations import Measurements
from testbed.files.frames_fit import FAR
from testbed.files.refusal import refusal
from testbed.files.rows.shifts import FEWEST
from testbed.files.session import Session

NEAR = 5e-3
"""Middles of two reflectors do not lie so near each other: the smallest balls of trackers measure
12.7 mm. Where a robot was sent and where it was seen mostly do [m]."""
MOST = 20
"""Targets of which each is held against each other one."""


class NotOneTool(NamedTuple):
    """Why readings of two targets are not of two reflectors on one tool."""

    kind: Literal["one reflector", "apart", "one point"]
    """They lie where no two reflectors can, do not stay together, or are of two frames."""
    words: str
    """What the two do."""


def apart_or_alike(one: Array, other: Array, far: float = FAR) -> NotOneTool | None:
    """Why readings (m, 3) of two targets at the same poses are not of one tool [m]; else None.

    Medians, so that single shots that were missed say nothing. On one tool how far they lie apart
    varies by less than `far` [m].
    """
    away = np.linalg.norm(one - other, axis=1)
    away = away[np.isfinite(away)]
    if len(away) < FEWEST:
        return None
    middle = float(np.median(away))
    if middle < NEAR:
        words = f"lie {middle * 1e3:.2g} mm from each other, where no two reflectors can"
        return NotOneTool("one reflector", words)
    varies = float(np.median(np.abs(away - middle)))
    if varies > far:
        words = f"do not stay together: how far they lie apart varies by {varies * 1e3:.2g} mm"
        return NotOneTool("apart", words)
    return None


def not_on_one_tool(session: Session, groups: Sequence[Index]) -> InputError | None:
    """The error of two targets that cannot both have been on the tool; None if there are none.

    Parameters
    ----------
    session : Session
        As it was read.
    groups : sequence of (m,) int arrays
        Rows of each target and station.
    """
    table = session.measurements
    for both in pairs_of_targets(table, groups):
        rows, beside = both.T
        why = apart_or_alike(table.position[rows], table.position[beside])
        if why is not None:
            first, second = (target_name(session, int(k)) for k in (rows[0], beside[0]))
            said = f'targets "{first}" and "{second}" {why.words}'
            fix = "keep what was measured: one of them may be where the robot was sent"
            if why.kind == "one reflector":
                fix += "; one reflector that was read again has a row for each reading"
            return refusal(
                session.where, "target", said, code="M32",
                allowed="targets are reflectors on one tool, each at a place of its own", fix=fix,
            )  # fmt: skip
    return None


def pairs_of_targets(table: Measurements, groups: Sequence[Index]) -> Iterator[Index]:
    """Rows (k, 2) of each two targets that one station saw on one tool, at `FEWEST` poses or more.

    `groups` are the rows (m,) of each target; no more than `MOST` of them are paired.
    """
    for one, other in combinations(groups[:MOST], 2):
        if any(own[one[0]] != own[other[0]] for own in (table.station, table.tool)):
            continue
        both = read_together(table, one, other)
        if len(both) >= FEWEST:
            yield both


def read_together(table: Measurements, one: Index, other: Index) -> Index:
    """Rows (k, 2) of two targets, each pair of one visit of a pose."""
    at = {(table.pose_id[k], table.repeat[k]): k for k in other}
    visits = ((k, (table.pose_id[k], table.repeat[k])) for k in one)
    return np.array([(k, at[visit]) for k, visit in visits if visit in at]).reshape(-1, 2)


def named_target(session: Session, row: int) -> str:
    """What a sentence on the target and the station of a row begins with; empty where all are one.

    Examples: ``target A: ``, ``station b.csv: ``.
    """
    table = session.measurements
    target, stations = target_name(session, row), session.station_names
    said = [f"target {target}"] if target else []
    at = int(table.station[row])
    if len(stations) > 1 and at < len(stations):
        said.append(f"station {stations[at]}")
    return f"{', '.join(said)}: " if said else ""


def target_name(session: Session, row: int) -> str:
    """The name of the target of a row; of one that needs none it is empty."""
    k, names = int(session.measurements.reflector[row]), session.reflector_names
    return names[k] if 0 <= k < len(names) else ""
