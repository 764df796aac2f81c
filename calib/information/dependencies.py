"""What readings cannot tell apart, in words: causes, and what each dropped number looks like."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, check
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.rank import KEEP_TOLERANCE

STILL = 1e-9
"""A joint [rad, m] or an orientation [1] whose range is smaller than this never moves."""


@dataclass(frozen=True, slots=True)
class Dependency:
    """What a dropped number is equivalent to."""

    name: str
    """Of the dropped number."""
    others: str
    """The kept numbers that stand for it, in words; empty where nothing measured shows it."""


def causes_of(
    model: RobotModel, parameters: Parameters, q: ArrayLike | None, lost: bool
) -> list[str]:
    """Sentences on joints that never move and an orientation that never changes."""
    if q is None or not lost:
        return []
    (q,) = check(f"m {model.chain.n_joints}", q=q)
    if len(q) < 2:
        return []
    said = [
        f"joint {i + 1} never moves: its link cannot be told from the links beside it; "
        "choose poses that move it"
        for i in np.flatnonzero(np.ptp(q, axis=0) < STILL)
    ]
    arms = ("tool.x", "tool.y", "tool.z", *model.fixtures.names[: 3 * model.fixtures.counts[0]])
    free = [name for name in arms if name in parameters.free_names]
    R = model.poses(q)[:, :3, :3]
    if free and np.abs(R - R[0]).max() < STILL:
        said.append(
            f"the tool keeps one orientation in all poses: {', '.join(free)} cannot be told from a "
            "shift of the robot; hold them fixed or turn the tool"
        )
    return said


def count_sentences(n_rows: int, n_kept: int, rank: int, n_free: int) -> list[str]:
    """Sentences on too few equations, and on directions between the two tolerances."""
    said = []
    if n_rows < n_free and n_kept == n_rows:
        said.append(
            f"{n_rows} equations tell at most {n_rows} of {n_free} numbers apart: "
            "more poses may tell more"
        )
    if rank != n_kept:
        said.append(
            f"{n_kept} numbers are kept but the singular values count {rank} directions: "
            "some are seen so weakly that rounding decides"
        )
    return said


def dependency(
    names: Sequence[str], lengths: Bool, keep: Sequence[int], mixing: Array, k: int
) -> tuple[Dependency, str]:
    """What dropped number k is equivalent to, and a sentence on it."""
    name, column = names[k], mixing[:, k]
    # 1e-6 of a meter per radian or the like is below what the projection test resolves
    terms = np.flatnonzero(np.abs(column) > KEEP_TOLERANCE)
    if not terms.size:
        said = f"{name} has no effect on anything measured: no measurement can find it"
        return Dependency(name, ""), said
    # equal parts stay in the order of the numbers, whatever rounding made of them
    size = np.round(np.log(np.abs(column[terms])), 9)
    terms = terms[np.argsort(-size, kind="stable")].tolist()
    others = [names[keep[i]] for i in terms]
    if len(terms) == 1 and abs(abs(column[terms[0]]) - 1) < KEEP_TOLERANCE:
        same = "the same" if column[terms[0]] > 0 else "the opposite"
        return Dependency(name, others[0]), (
            f"{name} cannot be told from {others[0]}: any change of {name} looks like {same} "
            f"change of {others[0]}"
        )
    shown = [
        f"{column[i]:+.3g} {'m' if lengths[keep[i]] else 'rad'} of {other}"
        for i, other in zip(terms[:4], others[:4], strict=True)
    ]
    more = f" and {len(terms) - 4} smaller terms" if len(terms) > 4 else ""
    unit, stand = "m" if lengths[k] else "rad", f"{', '.join(others[:4])}{more}"
    return Dependency(name, stand), (
        f"{name} cannot be told from {stand}: 1 {unit} of {name} looks like "
        f"{', '.join(shown)}{more}"
    )
