"""Frames of an arm's links on its identified joint axes, each origin changed as little as may be.

A URDF turns a joint about an axis through the origin of its link's frame, so that this frame lies
on the identified axis. It is still free to turn about that axis and to slide along it, and does so
until the axis after it, seen from it, is where the file has it: a wrong zero of a joint turns the
link of that joint, with all that is mounted on it, and leaves every later origin alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.chain import Chain, forward
from calib.geometry.frames import exp_so3, inverse, transform, transform_step
from testbed.robots.describe.axes import reach
from testbed.robots.placements import link_poses

STEPS, SETTLED = 30, 1e-12
"""Most steps of Gauss and Newton, and a step that is rounding [m]."""
APART = 1e-6
"""Step of the difference quotients [m]."""
WORTH = 0.2
"""What a slide along an axis, or a turn about it, has to gain per unit to be made: along nearly
parallel axes, long slides gain next to nothing."""
SMALLEST = 1e-6
"""Slides and turns below this are left out, as no pose depends on them [m]."""
SHORTEST = 0.05
"""Least lever by which turns are compared with shifts [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class DescribedArm:
    """Frames of an arm of n moving joints as its file has them, all joints at zero."""

    steps: Sequence[Array]
    """(n) of (4, 4): link of each moving joint, in that of the one before, the root link first
    [m]."""
    axes: Sequence[Array]
    """(n) of (3,), unit vectors, each in the frame of its link."""
    ending: Array
    """(4, 4) tip in the last of these links [m]."""


def nearest_frames(arm: DescribedArm, chain: Chain, T_flange_tool: Array) -> Array:
    """Frames (n, 4, 4) of the moving links on the axes of a chain, in the root link at joint zero.

    The squares of all shifts and, by a lever of the arm's size, of all turns by which origins
    differ from those of the file are least in sum. A turn about a joint's own axis and a slide
    along it cost nothing: they are its zero.

    Parameters
    ----------
    arm : DescribedArm
        As the file has it.
    chain : Chain
        The same arm as it was identified, its world the root link of the file.
    T_flange_tool : (4, 4) array
        Its tool as the file has it: another one that was found on its flange moves no link.
    """
    n = chain.n_joints
    lines = link_poses(chain, np.zeros((1, n)))[0, 1:]
    tip = forward(replace(chain, T_flange_tool=T_flange_tool), np.zeros((1, n)))[0]
    lever = max(reach(chain) / n, SHORTEST)
    slides = chain.prismatic.astype(bool)

    def placed(own: Array) -> tuple[Array, Array]:
        return _placed(arm, lines, tip, slides, lever, own)

    own = _settled(placed, np.zeros((n, 2)), slice(None), range(2 * n))
    own[np.abs(own) < SMALLEST] = 0.0
    # the last link follows the tip alone, which so stays where it is on it if it can
    return placed(_settled(placed, own, slice(-6, None), range(2 * n - 2, 2 * n)))[1]


def _settled(
    placed: Callable[[Array], tuple[Array, Array]], own: Array, rows: slice, free: range
) -> Array:
    """Slides and turns (n, 2) of which some, `free`, make the squares of some `rows` least.

    References
    ----------
    Gauss and Newton, each step the shortest one without the directions that gain less than `WORTH`.
    """
    own = own.copy()
    for _ in range(STEPS):
        base, _ = placed(own)
        columns = []
        for k in free:
            other = own.copy()
            other.flat[k] += APART
            columns.append((placed(other)[0] - base)[rows] / APART)
        U, s, Vt = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
        kept = s > WORTH
        step = -Vt[kept].T @ (U[:, kept].T @ base[rows] / s[kept])
        own.flat[free] += step
        if np.abs(step).max() < SETTLED:
            break
    return own


def _placed(
    arm: DescribedArm, lines: Array, tip: Array, slides: Bool, lever: float, own: Array
) -> tuple[Array, Array]:
    """Shifts and turns (6 (n + 1),) of all origins [m], and the frames (n, 4, 4).

    `own` (n, 2) are slides along each axis and turns about it, these times the lever [m].
    """
    T, changes, frames = np.eye(4), [], []
    for step, axis, line, is_slide, (along, about) in zip(
        arm.steps, arm.axes, lines, slides, own, strict=True
    ):
        T, shift, turn = onto_axis(T @ step, axis, line, at_any_place=bool(is_slide))
        changes += [shift, lever * turn]
        T = T @ transform(exp_so3(axis * (about / lever)), axis * along)
        frames.append(T)
    left = transform_step(inverse(T @ arm.ending) @ tip)
    return np.concatenate([*changes, left[:3], lever * left[3:]]), np.array(frames)


def onto_axis(
    T: Array, axis: Array, line: Array, *, at_any_place: bool
) -> tuple[Array, Array, Array]:
    """A frame (4, 4) moved the shortest way onto an axis, its shift and its turn (3,) [m, rad].

    `axis` (3,) is that of the frame, `line` (4, 4) has the other as its z through its origin. That
    of a prismatic joint has no place, only a direction.
    """
    here, there = T[:3, :3] @ axis, line[:3, 2]
    across = np.cross(here, there)
    sine = float(np.linalg.norm(across))
    turn = across * (np.arctan2(sine, here @ there) / sine) if sine else np.zeros(3)
    away = line[:3, 3] - T[:3, 3]
    shift = np.zeros(3) if at_any_place else away - there * (there @ away)
    return transform(exp_so3(turn) @ T[:3, :3], T[:3, 3] + shift), shift, turn
