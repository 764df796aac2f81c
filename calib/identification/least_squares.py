"""Nonlinear least squares with exact derivatives: trust-region steps, and a certificate of the end.

Knows nothing of robots. The unknown may live on a manifold: the caller moves it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.identification.tangent import NEGLIGIBLE, System, Tangent, normal_plane

X = TypeVar("X")

MOST_REFUSALS = 30
"""Refused steps in a row, each a quarter of the one before, after which none will help."""
LEVEL = 1e-10
"""Part by which a sum of squares may rise by rounding alone: metres in double precision, divided by
a noise of micrometres, leave 1e-10 in each whitened residual."""


SLOW = 0.3
"""An undamped step that leaves more than this part of the way is part of a slow approach."""
SLOWEST = 0.9
"""Part of the way that a step may leave where the sum of squares cannot tell any more."""
SLOW_OFFSET = 1e-5
"""Certificate of a slow approach that ends where no step helps: a valley in which the sum of
squares is level to rounding. A hundredth of what Bates & Watts 1988 ask of any fit."""
DEPTH = 5
"""So many steps of a slow approach are remembered."""


class Status(Enum):
    """How a fit ended, in a sentence."""

    CONVERGED = "converged: no parameter can lower the sum of squares any further"
    STALLED = (
        "stopped where no step lowers the sum of squares, but without a certificate; "
        "check the derivatives or start closer to the answer"
    )
    LIMIT = (
        "stopped at the iteration limit; hold the parameters that are least known, "
        "or say in a prior what is known of them"
    )
    DEFICIENT = (
        "stopped where some parameters cannot be told apart; free fewer of them or add observations"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Solution(Generic[X]):
    """Where a fit ended and why it may be believed."""

    x: X
    """The answer."""
    residual: Array
    """(n,) measured minus predicted there."""
    jacobian: Array
    """(n, p) derivative of the prediction there."""
    end: Tangent
    """The tangent plane there, its columns scaled by their own norms."""
    certificate: float
    """Relative offset, or |Q1'r| for an exact fit; see `Tangent.certificate`."""
    status: Status
    iterations: int
    """Steps taken."""
    trace: Array
    """(iterations + 1,) sum of squares at the start and after each step."""

    @property
    def factor(self) -> Array:
        """K (p, p) with K K' = inv(A'A) there."""
        return self.end.factor

    def __repr__(self) -> str:
        status = self.status.name.lower()
        return f"Solution({status} after {self.iterations} steps, |r|^2 = {self.trace[-1]:.4g})"


def solve(
    evaluate: Callable[[X], tuple[Array, Array] | System],
    start: X,
    *,
    move: Callable[[X, Array], X],
    reach: Array | None = None,
    most: int = 500,
    until: float = NEGLIGIBLE,
    report: Callable[[int, float], None] | None = None,
) -> Solution[X]:
    """Minimize the sum of squares |r(x)|^2 from `start`.

    Each step is the best one inside a trust region, the columns of A scaled: a Levenberg-Marquardt
    step far away, a plain Gauss-Newton step near the answer, until what is left is 1e-10 standard
    deviations. Steps come from normal equations where these are well conditioned; the end is
    judged by orthogonal factors of A.

    Parameters
    ----------
    evaluate : callable
        x -> residual r (n,), measured minus predicted, and A (n, p), exact derivative of the
        prediction by a small step at x; or both with the rows of a prior, a `System`. May return
        values that are not finite: the step is then refused.
    start : X
        First point, of any type.
    move : callable
        (x, step (p,)) -> the point after the step.
    reach : (p,) array, optional
        Typical size of each unknown: the first step goes no further. Without it the first step is a
        plain Gauss-Newton step, right where the start is good.
    most : int
        Largest number of steps.
    until : float
        Relative offset at which to stop; a larger one where another fit begins at the answer.
    report : callable, optional
        Told the step count and the sum of squares after each step.

    Returns
    -------
    Solution
        `status` is CONVERGED only with the certificate, whatever else happened; after a slow
        approach with one of 1e-5.

    References
    ----------
    More 1978 (trust region, column scale), Bates & Watts 1988 (relative offset).

    Examples
    --------
    >>> t = np.arange(4.0)
    >>> solution = solve(
    ...     lambda x: (np.exp(-0.5 * t) - np.exp(-x * t), -t[:, None] * np.exp(-x * t)[:, None]),
    ...     np.array([1.0]),
    ...     move=lambda x, step: x + step,
    ... )
    >>> float(solution.x[0].round(9)), solution.status.name
    (0.5, 'CONVERGED')
    """
    x, here = start, _system(evaluate, start)
    if here is None:
        message = "the residual or its derivative is not finite at the start"
        fix = "start where the model can be computed"
        raise refuse("start", code="A2", message=message, fix=fix)
    n, p = here.shape
    if p > n:
        message = f"{n} rows for {p} unknowns"
        allowed = "at least as many rows as unknowns"
        raise refuse("residual", n, allowed, code="M27", message=message)
    radius = np.inf if reach is None else float(np.linalg.norm(here.scale * reach)) or np.inf
    trace, refused, memory, slow = [here.cost], 0, Memory(), False
    while len(trace) <= most and refused < MOST_REFUSALS:
        if here.within(until):
            here = here.on_rows()
            if here.within(until):
                break
        step, length, predicted = here.step(radius)
        plain, free = step, here.damping(radius) == 0.0
        if free:
            step = memory.mixed(plain, here.scale)
        candidate = move(x, step)
        there = _system(evaluate, candidate, here.scale)
        drop = here.cost - there.cost if there is not None else -np.inf
        gain = drop / predicted if predicted > 0 else -np.inf
        nearer = there is not None and _nearer(here, there)
        taken = there is not None and (nearer or (gain > 1e-4 and not here.at_rounding))
        if step is not plain and not taken:
            memory.forget()
            continue
        if gain > 0.75 and length > 0.95 * radius:
            radius *= 2
        elif gain < 0.25 and not nearer:
            radius = 0.25 * length
        if there is not None and taken:
            slow = there.offset > SLOW * here.offset
            memory.add(step, plain, free and slow)
            x, here, refused = candidate, there, 0
            trace.append(here.cost)
            if report is not None:
                report(len(trace) - 1, here.cost)
        elif here.at_rounding:
            break
        else:
            refused += 1
    here = here.on_rows()
    r, A = here.system.whole
    return Solution(
        x=x,
        residual=frozen(r),
        jacobian=frozen(A),
        end=here,
        certificate=here.certificate,
        status=_status(here, len(trace) > most, slow),
        iterations=len(trace) - 1,
        trace=frozen(trace),
    )


class Memory:
    """The last undamped steps of a slow approach, and where they led.

    Where products of numbers bend the model as much as the residual is large, each undamped step
    leaves a fixed part of the way. What the last ones had in common tells the rest of it.

    References
    ----------
    Anderson 1965; Walker & Ni 2011, SIAM Journal on Numerical Analysis 49(4), (2.1).
    """

    def __init__(self) -> None:
        self.steps: list[tuple[Array, Array]] = []

    def forget(self) -> None:
        """Begin anew."""
        self.steps.clear()

    def add(self, taken: Array, plain: Array, slow: bool) -> None:
        """Note a step taken, the undamped one there, and whether it left much of the way."""
        if not slow:
            self.forget()
        else:
            self.steps = [*self.steps[1 - DEPTH :], (taken, plain)]

    def mixed(self, plain: Array, scale: Array) -> Array:
        """The step (p,) to take from here, where the undamped one is `plain`."""
        if not self.steps:
            return plain
        taken = np.array([one for one, _ in self.steps]).T
        before = np.array([one for _, one in self.steps] + [plain])
        changes = np.diff(before, axis=0).T
        weighed = scale[:, None] * changes
        share = np.linalg.lstsq(weighed, scale * plain, rcond=None)[0]
        return np.asarray(plain - (taken + changes) @ share)


def _system(
    evaluate: Callable[[X], tuple[Array, Array] | System], x: X, least: Array | float = 0.0
) -> Tangent | None:
    """Tangent plane at x; None where the model cannot be computed.

    The scale of a column never falls below `least`, the scale before: a column that fades on the
    way must not let its unknown run away.
    """
    # a trial step may be far too long: overflow there is an answer, not a mishap
    with np.errstate(all="ignore"):
        return normal_plane(System(*evaluate(x)), least)


def _nearer(here: Tangent, there: Tangent) -> bool:
    """Whether a step halved the offset and left the sum of squares level.

    Near the answer the sum of squares is flat to rounding; the offset is the finer judge. Where it
    is the only one, a slow approach counts as well.
    """
    level = there.exact or there.cost <= here.cost * (1 + LEVEL)
    flat = here.offset**2 <= LEVEL * here.cost
    return level and there.offset <= (SLOWEST if flat else 0.5) * here.offset


def _status(here: Tangent, out_of_steps: bool, slow: bool) -> Status:
    """How the fit ended."""
    if here.deficient:
        return Status.DEFICIENT
    if here.certified or (slow and not out_of_steps and here.certificate < SLOW_OFFSET):
        return Status.CONVERGED
    return Status.LIMIT if out_of_steps else Status.STALLED
