"""Identifiability: which numbers the measurements tell apart, and what stands for the others."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import qr

from calib.arrays import LATER, Array, Bool, check, frozen, wrong_shape
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.rank import (
    KEEP_TOLERANCE,
    RANK_TOLERANCE,
    choose_columns,
    count,
    practical_rank,
    singular_values,
    triangle,
)
from calib.kinds import in_short
from calib.shown import Shown

PARALLEL = np.cos(np.deg2rad(1.0))
"""Axes within 1 degree count as parallel: then beta is identifiable and d is not (Hayati)."""
STILL = 1e-9
"""A joint [rad, m] or an orientation [1] whose range is smaller than this never moves."""


@dataclass(frozen=True, slots=True)
class Dependency:
    """What a dropped number is equivalent to."""

    name: str
    """Of the dropped number."""
    others: str
    """The kept numbers that stand for it, in words; empty where nothing measured shows it."""


@dataclass(frozen=True, slots=True, eq=False)
class Reduction(Shown):
    """Which free numbers are kept, the rank, and what each dropped number is equivalent to."""

    singular_values: Array
    """(min(N, f),) singular values of the scaled columns, largest first."""
    rank: int
    """Number of singular values above the tolerance: combinations that can be told apart."""
    tolerance: float
    """Part of the largest singular value below which a singular value counts as zero."""
    condition: float
    """Largest over smallest singular value of the kept scaled columns."""
    kept: Annotated[tuple[str, ...], "p"]
    """(p,) names of the kept numbers, in the order of the full vector."""
    dropped: Annotated[tuple[str, ...], "f - p"]
    """(f - p,) names of the others."""
    mixing: Annotated[Array, "p", "f"]
    """(p, f) matrix that turns a step of all free numbers into the step of the kept ones with the
    same effect, to first order [m, rad]."""
    sentences: tuple[str, ...]
    """Causes of the loss of rank, then one sentence per dropped number."""
    unobservable: tuple[str, ...]
    """Free numbers without any effect on the measurements: no kept number stands for them."""
    practical_rank: int | None = None
    """Directions learned beyond the prior; None if no prior was given."""
    dependencies: Annotated[tuple[Dependency, ...], LATER] = ()
    """(d,) what the last d sentences are about."""

    @property
    def causes(self) -> tuple[str, ...]:
        """The sentences on no dropped number of its own."""
        return self.sentences[: len(self.sentences) - len(self.dependencies)]

    def sentences_without(self, names: Collection[str]) -> tuple[str, ...]:
        """All sentences but those on some dropped numbers."""
        each = zip(self.dependencies, self.sentences[len(self.causes) :], strict=True)
        return (*self.causes, *(text for one, text in each if one.name not in names))

    @property
    def told_apart(self) -> bool:
        """Whether the data alone determine the kept numbers; if not, a prior has to help."""
        return self.condition * self.tolerance < 1

    def __repr__(self) -> str:
        kept, dropped = len(self.kept), len(self.dropped)
        return f"Reduction({kept} kept, {dropped} dropped, condition {self.condition:.3g})"


@in_short
def reduce(
    A: ArrayLike,
    parameters: Parameters,
    *,
    model: RobotModel,
    q: ArrayLike | None = None,
    prior_sd: ArrayLike | None = None,
) -> Reduction:
    """Find free numbers that can be told apart, and say in words what the others are equivalent to.

    Columns are offered in a fixed order (anchors and stations, base, reflectors, tool, links, joint
    terms) and kept if independent of those kept before. Of each link d comes last if the next axis
    is parallel, else beta: the number that is then least identifiable. On a TX60 this keeps the
    thirty customary numbers. Where readings leave the base free to turn (distances from points on a
    line), its numbers that such a turn moves most come last among the six and are held.

    If nothing ties anchors to a known place, the base is held and defines the world; if only
    reflectors of unknown place were measured, the tool is held and the reflectors are found in its
    frame; if the tool never turns, reflectors and tool are held and the base is found.

    Parameters
    ----------
    A : (N, f) array
        Jacobian of the free numbers, columns times `parameters.free_scale`, rows whitened (or
        rotation rows times the characteristic length).
    parameters : Parameters
        The free numbers and their scale.
    model : RobotModel
        Where the Jacobian was taken; its axes decide the order.
    q : (m, n) array, optional
        Joint values [rad, m] of the poses: lets the sentences name a joint that never moves and an
        orientation that never changes.
    prior_sd : (f,) array, optional
        Prior sd of the free numbers [m, rad]: the practical rank is then given too.

    Raises
    ------
    InputError
        A1: the sizes of A, parameters and model differ; M27: there is nothing to reduce.

    References
    ----------
    Hayati 1983 for d and beta of parallel axes.
    """
    (A,) = check("N f", A=A)
    if parameters.names != model.names:
        message = "parameters and model list different numbers"
        raise refuse("names", code="A1", message=message)
    if A.shape[1] != parameters.n_free:
        raise wrong_shape("A", A.shape, f"one column per free number, {parameters.n_free}")
    if not A.size:
        allowed = "at least one row and one free number"
        raise refuse("A", A.shape, allowed, code="M27", message="nothing to reduce")
    small = triangle(A)
    singular = singular_values(small)
    found = choose_columns(small, _order(parameters, model, small))
    keep = sorted(found.places)
    rows = np.argsort(found.places)
    scale, names = parameters.free_scale, parameters.free_names
    # a scaled column is J_k s_k, so a step x_k of number k is x_k / s_k of its column
    mixing = found.coordinates[rows] * scale[keep][:, None] / scale
    mixing[:, keep] = np.eye(len(keep))
    n_directions, left = count(singular, RANK_TOLERANCE), sorted(set(range(len(names))) - set(keep))
    lengths = parameters.is_length[parameters.free]
    # moments load springs, and where none bends they do nothing yet
    unloaded = {k for k in found.silent.tolist() if names[k].startswith("moment")}
    causes = [
        *_causes(model, parameters, q, n_directions < len(names)),
        *_count_sentences(len(A), len(keep), n_directions, len(names)),
    ]
    told = [_dependency(names, lengths, keep, mixing, k) for k in left if k not in unloaded]
    every = len(keep) == len(names)
    spread = singular if every else singular_values(small[:, keep]) if keep else np.ones(1)
    return Reduction(
        singular_values=frozen(singular),
        rank=n_directions,
        tolerance=RANK_TOLERANCE,
        condition=float(spread[0] / spread[-1]),
        kept=tuple(names[k] for k in keep),
        dropped=tuple(names[k] for k in left),
        mixing=frozen(mixing),
        sentences=(*causes, *(sentence for _, sentence in told)),
        unobservable=tuple(names[k] for k in sorted(found.silent)),
        practical_rank=None if prior_sd is None else practical_rank(small / scale, prior_sd),
        dependencies=tuple(one for one, _ in told),
    )


def _order(parameters: Parameters, model: RobotModel, A: Array) -> list[int]:
    """Indices among the free numbers, in the order in which columns of A are offered."""
    n = model.chain.n_joints
    tool = range(6 + 5 * n, 12 + 5 * n)
    first, further = model.first_fixture, model.first_fixture + model.fixtures.first_tool
    reflectors = range(first, first + 3 * len(model.fixtures.reflectors))
    placed, tools = range(reflectors.stop, further), range(further, model.n_numbers)
    # direction of the next joint axis in the frame of this one: Rx(alpha) Ry(beta) z
    cosine = np.cos(model.chain.links[:, 3]) * np.cos(model.chain.links[:, 4])
    late = [6 + 5 * i + (1 if abs(cosine[i]) > PARALLEL else 4) for i in range(n - 1)]
    links = [k for k in range(6, 6 + 5 * n) if k not in late]
    terms = range(12 + 5 * n, first)
    order = [*placed, *range(6), *reflectors, *tool, *tools, *links, *late, *terms]
    place = {int(k): i for i, k in enumerate(parameters.free_index)}
    base = [place[k] for k in range(6) if k in place]
    order = [place[k] for k in order if k in place]
    at = order.index(base[0]) if base else 0
    order[at : at + len(base)] = _turning_last(base, A[:, base])
    return order


def _turning_last(base: list[int], A: Array) -> list[int]:
    """The numbers of the base, last those that steps without effect on A (N, b) move most.

    Held instead, a number that such a step hardly moves would leave it to the others, which noise
    then moves far along it.
    """
    if not base:
        return base
    rest, V = np.linalg.svd(triangle(A))[1:]
    idle = V[count(rest, KEEP_TOLERANCE) :]
    if not len(idle):
        return base
    last = [base[k] for k in qr(idle, mode="r", pivoting=True)[1][: len(idle)]]
    return [k for k in base if k not in last] + [k for k in base if k in last]


def _causes(
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


def _count_sentences(n_rows: int, n_kept: int, rank: int, n_free: int) -> list[str]:
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


def _dependency(
    names: Sequence[str], lengths: Bool, keep: Sequence[int], mixing: Array, k: int
) -> tuple[Dependency, str]:
    """What dropped number k is equivalent to, and a sentence on it."""
    name, column = names[k], mixing[:, k]
    # 1e-6 of a meter per radian or the like is below what the projection test resolves
    terms = np.flatnonzero(np.abs(column) > KEEP_TOLERANCE)
    if not terms.size:
        said = f"{name} has no effect on anything measured"
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
