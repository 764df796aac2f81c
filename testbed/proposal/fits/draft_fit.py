"""What base and tool of the nominal robot leave of a draft, beside what was fitted to what."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from testbed.files.frames_fit import FAR, Misfit, far_for, fit_frames, flange_poses, target_groups
from testbed.files.probe import probe
from testbed.files.rows.shifts import FEWEST, ROWS, spread_out
from testbed.files.session import Session
from testbed.robots.robot import Robot

AXES = 3
"""Equations of a position; a distance has one."""
EXPLAINED = 3
"""Least spread of positions, as a multiple of the misfit, that a robot has caused."""
APART = FAR
"""Spread of positions from which on that of the flange counts as well: a tip that touches places
from many sides stays near them while the arm moves [m]."""


@dataclass(frozen=True, slots=True)
class DraftFit:
    """Misfit of a draft after fitting base and tool, with counts of equations and unknowns."""

    left: Misfit
    """Infinite if nothing could be fitted."""
    equations: int
    numbers: int
    far: float = FAR
    """Misfit that the right draft never leaves [m]."""

    @property
    def score(self) -> float:
        """Misfit in one number [m]."""
        return self.left.score

    @property
    def is_near(self) -> bool:
        """Whether it is as small as a right draft of an arm near nominal leaves."""
        return self.score <= self.far

    @property
    def is_one(self) -> bool:
        """Whether anything was fitted."""
        return bool(np.isfinite(self.score))

    @property
    def noise(self) -> float:
        """The misfit by degrees of freedom [m]; infinite without any."""
        left = self.equations - self.numbers
        return self.score * float(np.sqrt(self.equations / left)) if left > 0 else np.inf


NONE = DraftFit(Misfit(np.inf, 0.0), 0, 0)


def fit_of(robot: Robot, session: Session | None, parts: int) -> DraftFit:
    """Misfit after fitting base and tool to the best of several parts of the rows of one target."""
    if session is None:
        return NONE
    table, groups = session.measurements, target_groups(session.measurements)
    if not groups and parts == 1:
        stated = probe(robot, session).stated
        # the tool and the positions; if all of these are free, the base is the world
        free = len(session.free_anchors)
        numbers = 3 + 3 * free + (6 if free < len(session.anchor_names) else 0)
        return DraftFit(stated, min(len(table), ROWS), numbers) if stated is not None else NONE
    if not groups or len(groups[0]) < FEWEST * parts:
        return NONE
    left = []
    for stretch in np.array_split(groups[0], parts):
        rows = spread_out(stretch)
        F = flange_poses(robot.model, table.q[rows])
        turned = table.rotation[rows] if table.is_pose[rows[0]] else None
        seen = table.position[rows]
        frames = fit_frames(F, seen, turned)
        misfit = frames.misfit(F, seen, turned)
        if EXPLAINED * misfit.score > _moved(F, seen):
            misfit = NONE.left  # no robot has moved them
        size, numbers = (AXES, 9) if turned is None else (2 * AXES, 12)
        left.append(DraftFit(misfit, size * len(rows), numbers, far_for(seen)))
    return min(left, key=lambda one: one.score)


def _moved(F: Array, seen: Array) -> float:
    """How far a robot has moved the flange F (m, 4, 4), or what was seen of it (m, 3) [m]."""
    spread, travel = (float(np.sqrt(np.var(p, axis=0).sum())) for p in (seen, F[:, :3, 3]))
    return max(spread, travel) if spread > APART else spread
