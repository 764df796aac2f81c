"""Rows of a session as they were read, or beside the joints of other rows, and their misfit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Index, evenly
from calib.geometry.model import RobotModel
from testbed.files.alternatives import Alternative, Interpretation, shifted
from testbed.files.frames_fit import FAR, Misfit, fit_frames, flange_poses
from testbed.files.session import Session

ROWS = 60
"""Rows on which readings are compared."""
FEWEST = 6
"""Poses below which nothing is tried."""


@dataclass(frozen=True, slots=True, eq=False)
class Shifted:
    """Readings beside the joints of other rows."""

    alternative: Alternative
    read: Interpretation
    own: tuple[Interpretation, ...]
    """As many readings beside their own joints: of fewer rows any fit leaves less."""


def as_read(session: Session, rows: Index) -> Interpretation:
    """Some rows of a session as they were read."""
    table = session.measurements
    rotation = table.rotation[rows] if table.is_pose[rows[0]] else None
    return Interpretation(table.q[rows], table.position[rows], rotation)


def misfit_of(
    model: RobotModel, read: Interpretation, *, one_valley: bool = False, F: Array | None = None
) -> Misfit:
    """What base and tool leave of a reading; `one_valley` as in `fit_frames`.

    F (m, 4, 4) are the poses of its flange, where they are known [m].
    """
    F = flange_poses(model, read.q) if F is None else F
    frames = fit_frames(F, read.position, read.rotation, one_valley=one_valley)
    return frames.misfit(F, read.position, read.rotation)


def spread_out(rows: Index) -> Index:
    """At most `ROWS` of some rows, evenly spread."""
    return evenly(rows, ROWS)


def other_rows(session: Session, rows: Index) -> Iterator[Shifted]:
    """Readings of one row with the joints of another."""
    for shift in (1, 2, 3, 4, 5, -1, -2, -3, -4, -5):
        if len(rows) < FEWEST + abs(shift):
            continue
        low, high = max(0, -shift), len(rows) - max(0, shift)
        some = spread_out(np.arange(low, high))
        moved = as_read(session, rows[some + shift])
        which = "" if len(rows) == len(session.measurements) else " of one target"
        read = replace(moved, q=session.measurements.q[rows[some]])
        yield Shifted(shifted(shift, which), read, (moved, as_read(session, rows[some])))


def other_lines(
    model: RobotModel, session: Session, groups: Sequence[Index], rows: Index
) -> Iterator[Shifted]:
    """Readings of one line with the joints of another, where that fits each of several targets.

    The target belongs to the joints: all cells that were measured have moved.
    """
    table = session.measurements
    optical = np.flatnonzero(~table.is_distance)
    if len(groups) == 1 or len(np.unique(table.is_pose[optical])) > 1:
        return
    for shift in (1, 2, 3, -1, -2, -3):
        each = []
        for group in (rows, *groups):
            at = np.searchsorted(optical, group)
            at = at[(at + shift >= 0) & (at + shift < len(optical))]
            some = spread_out(at)
            if len(some) >= FEWEST:
                own, moved = optical[some], as_read(session, optical[some + shift])
                each.append((own, replace(moved, q=table.q[own])))
        if each and all(misfit_of(model, read).score <= FAR for _, read in each):
            own, read = each[0]
            yield Shifted(shifted(shift), read, (as_read(session, own),))
