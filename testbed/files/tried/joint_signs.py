"""Joints that turn the other way than the robot's file says, several of them at once.

Link numbers are right-handed, and controllers are not always: of KUKA, J1, J4 and J6 turn against
them. The arm that results is the mirror image of its own file if the links have a plane of
symmetry, so that points look as in a left-handed frame. All sets of signs are tried, each with the
zero of at most one joint further by quarter turns.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calib.arrays import evenly
from calib.geometry.model import RobotModel
from testbed.files.alternatives import Alternative, Interpretation
from testbed.files.frames_fit import FAR, TIMES, fit_frames, flange_poses
from testbed.files.rows.counts import HERE, added
from testbed.files.tried.quarter_turns import FEWEST, QUARTER, ROWS
from testbed.robots.controller import Controller
from testbed.units import listed

MOST = 2500
"""Combinations up to which they are tried: 832 of six joints take half a second."""
SAME = 1e-6
"""Relative difference of misfits below which two combinations are one arm, named in two ways."""
SIGNS = "signs"
"""Name of the alternative."""


@dataclass(frozen=True, slots=True)
class Counted:
    """Joints (from 0) that turn the other way, and one whose zero is further by quarter turns."""

    signs: frozenset[int]
    zero: tuple[int, int] | None = None
    """Joint and quarter turns, 1 to 3."""

    @property
    def size(self) -> tuple[bool, int]:
        """What is changed: of equal arms the one with less is meant."""
        return self.zero is not None, len(self.signs)

    def read(self, rows: Interpretation) -> Interpretation:
        """The same rows with joints that are counted so."""
        q = rows.q.copy()
        q[:, list(self.signs)] *= -1
        if self.zero is not None:
            q[:, self.zero[0]] += QUARTER * self.zero[1]
        return replace(rows, q=q)


def other_signs(
    model: RobotModel, controller: Controller, read: Interpretation, mirror: Alternative | None
) -> tuple[Alternative, Interpretation] | None:
    """The signs of joints, and the zero of one, that bring readings near the robot; else None.

    None as well where combinations that differ in more than the sign of one joint come nearly as
    near: it would be a guess.

    Parameters
    ----------
    model : RobotModel
        Nominal.
    controller : Controller
        How the file was taken to count them.
    read : Interpretation
        As the file was read.
    mirror : Alternative or None
        A left-handed frame, if that explains the readings: then signs alone are tried.
    """
    if mirror is None and len(np.unique(read.q, axis=0)) < FEWEST:
        return None
    some = evenly(np.arange(len(read.q)), ROWS)
    rotation = None if read.rotation is None else read.rotation[some]
    rows = Interpretation(read.q[some], read.position[some], rotation)
    scored = [(_score(model, one.read(rows)), one)
              for one in _combinations(model, controller, zeros=mirror is None)]  # fmt: skip
    least = min((score for score, _ in scored), default=np.inf)
    if least > FAR:
        return None
    near = sorted((one for one in scored if one[0] <= TIMES * least), key=lambda one: one[0])
    arms = list[tuple[float, Counted]]()
    for score, one in near:
        if arms and score <= (1 + SAME) * arms[-1][0] and one.zero != arms[-1][1].zero:
            if one.size < arms[-1][1].size:
                arms[-1] = score, one
        else:
            arms.append((score, one))
    alike = (one for score, one in arms if score <= (1 + SAME) * arms[0][0])
    best = max(alike, key=lambda one: len(one.signs))  # a whole mirror image, where none tells
    untold = frozenset[int]().union(*(one.signs ^ best.signs for _, one in arms))
    if any(one.zero != best.zero for _, one in arms) or len(untold) > 1 or not best.signs:
        return None
    return _proposed(best, untold, controller, model.chain.n_joints, mirror), best.read(read)


def _combinations(model: RobotModel, controller: Controller, *, zeros: bool) -> Iterator[Counted]:
    """Each set of signs of the joints that a statement can turn, with each zero of an inner joint.

    A base in the world takes up the zero of a first joint that turns, and a tool that of the last.
    """
    n = model.chain.n_joints
    own = [j for j in controller.counted(n).tolist()
           if j not in controller.stated or _statement(j) in controller.statements]  # fmt: skip
    turning = [int(j) for j in np.flatnonzero(model.chain.prismatic == 0) if 0 < j < n - 1]
    further = [None, *product(turning if zeros else (), (1, 2, 3))]
    if 2 ** len(own) * len(further) > MOST:
        return
    for marks, zero in product(product((False, True), repeat=len(own)), further):
        yield Counted(frozenset(j for j, mark in zip(own, marks, strict=True) if mark), zero)


def _score(model: RobotModel, rows: Interpretation) -> float:
    """What base and tool leave of some rows [m]."""
    F = flange_poses(model, rows.q)
    frames = fit_frames(F, rows.position, rows.rotation, one_valley=True)
    return frames.misfit(F, rows.position, rows.rotation).score


def _statement(j: int) -> str:
    """The line of [controller] for a joint (from 0) that turns the other way."""
    return f"q{j + 1} = -J{j + 1}"


def _proposed(
    best: Counted,
    untold: frozenset[int],
    controller: Controller,
    n: int,
    mirror: Alternative | None,
) -> Alternative:
    """What they mean and what to do; `untold` is a joint (from 0) whose sign may be either.

    A left-handed frame comes first where the signs are stated already, or where all of n joints
    would have to turn the other way.
    """
    signs = sorted(best.signs)
    numbers = listed([str(j + 1) for j in signs])
    said = f"joint {numbers} turns" if len(signs) == 1 else f"joints {numbers} turn"
    condition = f"if {said} the other way"
    new = [_statement(j) for j in signs if j not in controller.stated]
    old = [f'"{_statement(j)}"' for j in signs if j in controller.stated]
    fixes = [added(controller, *new)] if new else []
    if old:
        fixes.append(f"take {listed(old)} out of [controller] {HERE}")
    if best.zero is not None:
        j, quarters = best.zero
        turn = f"{90 * (quarters if quarters < 3 else -1):+d} deg"
        condition += f" and the zero of joint {j + 1} is turned by {turn}"
        fixes.append(
            f"add {turn} to theta_deg of joint {j + 1} there, and take it off its lower_deg and "
            "upper_deg"
        )
    if untold:
        condition += f" (of joint {min(untold) + 1} these readings do not tell it)"
    if mirror is None:
        return Alternative(SIGNS, condition, "; ".join(fixes), "M20", f"q{signs[0] + 1}")
    if not new or len(signs) == len(controller.counted(n)):
        condition = f"{mirror.condition}, or {condition}: points do not tell which"
        fix = f"{mirror.fix}; or, if it is right-handed, {'; '.join(fixes)}"
        return replace(mirror, condition=condition, fix=fix)
    condition += ", which points show in the same way as a left-handed frame does"
    fixes.append("check the axes of the export instead only if you know its frame as such")
    return Alternative(SIGNS, condition, "; ".join(fixes), "M20", f"q{signs[0] + 1}")
