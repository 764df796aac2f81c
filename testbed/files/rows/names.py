"""Targets whose names were exchanged from some row on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from testbed.files.alternatives import Alternative, Interpretation
from testbed.files.frames_fit import fit_frames, flange_poses
from testbed.files.reflectors.one_tool import read_together, target_name
from testbed.files.rows.shifts import FEWEST, as_read
from testbed.files.session import Session

PARTS = 3
"""Base and tool are fitted to the first and to the last of so many parts: one of the two is whole
where names were exchanged once."""
MOST = 6
"""Other targets that one is held against."""


@dataclass(frozen=True, slots=True, eq=False)
class Exchanged:
    """Rows of one target, from some row on those of another."""

    alternative: Alternative
    read: Interpretation


def exchanged_names(
    model: RobotModel, session: Session, groups: Sequence[Index], rows: Index
) -> Iterator[Exchanged]:
    """Readings of a target that bear the name of another from some row on, or up to there.

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
        begin = _first_exchanged(model, read, table.position[beside])
        if begin is None:
            continue
        later = np.arange(len(own)) >= begin
        position = np.where(later[:, None], table.position[beside], read.position)
        one, other = (target_name(session, int(k)) for k in (own[0], beside[0]))
        line = session.place[min(both[begin])].rpartition(":")[2]
        condition = f'if targets "{one}" and "{other}" are exchanged from line {line} on'
        fix = "call them there as before"
        yield Exchanged(
            Alternative("names", condition, fix, "M32", "target"), replace(read, position=position)
        )


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
