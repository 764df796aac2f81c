"""Targets whose names were exchanged from some row on, or at some poses."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.model import RobotModel
from testbed.files.alternatives import Alternative, Interpretation
from testbed.files.frames_fit import fit_frames, flange_poses
from testbed.files.reflectors.one_tool import read_together, target_name
from testbed.files.rows.shifts import FEWEST, as_read
from testbed.files.rows.strays import trimmed_frames
from testbed.files.session import Session
from testbed.units import counted, listed

PARTS = 3
"""Base and tool are fitted to the first and to the last of so many parts: one of the two is whole
where names were exchanged once."""
MOST = 6
"""Other targets that one is held against."""
MOST_NAMED = 4
"""Lines that are named."""


@dataclass(frozen=True, slots=True, eq=False)
class Exchanged:
    """Rows of one target, from some row on or at some poses those of another."""

    alternative: Alternative
    read: Interpretation


def exchanged_names(
    model: RobotModel, session: Session, groups: Sequence[Index], rows: Index
) -> Iterator[Exchanged]:
    """Readings of a target that bear the name of another from or up to some row, or at some poses.

    Parameters
    ----------
    model : RobotModel
        Nominal.
    session : Session
        As it was read.
    groups : sequence of (m,) int arrays
        Rows of each target and station.
    rows : (m,) int array
        Those of the target that is asked about.
    """
    table = session.measurements
    if table.is_pose[rows[0]]:
        return
    others = [
        group
        for group in groups
        if group is not rows
        and all(own[group[0]] == own[rows[0]] for own in (table.station, table.tool))
    ]
    for group in others[:MOST]:
        both = read_together(table, rows, group)
        if len(both) < PARTS * FEWEST:
            continue
        own, beside = both.T
        read = as_read(session, own)
        one, other = (target_name(session, int(k)) for k in (own[0], beside[0]))
        begin = _first_exchanged(model, read, table.position[beside])
        later = np.arange(len(own)) >= (len(own) if begin is None else begin)
        ways = []
        if begin is not None:
            line = _line(session, min(both[begin]))
            ways.append((later, f"from line {line} on", "call them there as before"))
        some = _exchanged_at(model, read, table.position[beside])
        if np.count_nonzero(some[1:] != some[:-1]) > 1:  # else from or up to some row
            places = np.flatnonzero(some)
            lines = [_line(session, min(both[k])) for k in places]
            where = f"at {counted(len(places), 'pose')} (lines {listed(lines, MOST_NAMED)})"
            ways.append((some, where, "exchange them back there"))
        for exchanged, where, fix in ways:
            position = np.where(exchanged[:, None], table.position[beside], read.position)
            condition = f'if targets "{one}" and "{other}" are exchanged {where}'
            yield Exchanged(
                Alternative("names", condition, fix, "M32", "target"),
                replace(read, position=position),
            )


def _line(session: Session, row: int) -> str:
    """The line of a row in its file."""
    return session.place[row].rpartition(":")[2]


def _exchanged_at(model: RobotModel, read: Interpretation, other: Array) -> Bool:
    """Rows (m,) at which `other` (m, 3) is nearer to what base and tool of most rows foretell.

    None where these are half of the rows or more, or a single one.
    """
    F = flange_poses(model, read.q)
    frames, _ = trimmed_frames(F, read.position, None)
    nearer = frames.position_errors(F, other) < frames.position_errors(F, read.position)
    return np.asarray(nearer & (1 < nearer.sum() < len(nearer) / 2))


def _first_exchanged(model: RobotModel, read: Interpretation, other: Array) -> int | None:
    """The first row from which on `other` (m, 3) belongs where `read` stood before; None if none.

    By which of both is nearer to what base and tool of the first or of the last rows foretell.
    """
    F, m = flange_poses(model, read.q), len(other)
    best: tuple[float, int] | None = None
    for some, names in ((slice(0, m // PARTS), (0, 1)), (slice(m - m // PARTS, m), (1, 0))):
        frames = fit_frames(F[some], read.position[some], None, one_valley=True)
        errors = [frames.position_errors(F, p) ** 2 for p in (read.position, other)]
        before, after = (np.concatenate([[0.0], np.cumsum(errors[k])]) for k in names)
        cost = before + after[-1] - after  # of a change before row k, k = 0 ... m
        k = int(np.argmin(cost))
        if 0 < k < m and (best is None or cost[k] < best[0]):
            best = float(cost[k]), k
    return None if best is None else best[1]
