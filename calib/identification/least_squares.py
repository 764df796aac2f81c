"""Nonlinear least squares with exact derivatives: trust-region steps and a certified solution.

It is independent of robots. The unknown may be on a manifold: the caller moves it.
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
"""Largest number of refused steps in a row, each a quarter of the one before."""
LEVEL = 1e-10
"""Relative increase of a sum of squares that rounding may cause: meters in double precision divided
by a noise of micrometers leave 1e-10 in each whitened residual."""


SLOW = 0.3
"""Ratio of successive offsets above which a step counts as slow convergence."""
SLOWEST = 0.9
"""Largest such ratio of a step that is taken where the sum of squares is flat to rounding."""
SLOW_OFFSET = 1e-4
"""Certificate that is enough after slow convergence, in a valley where the sum of squares is flat
to rounding. A tenth of what Bates & Watts 1988 ask of any fit. A search for 123 numbers of an arm
on springs ended at 3e-5."""
DEPTH = 5
"""Number of steps of slow convergence that are remembered."""


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
    """Result of a least-squares fit, with its certificate."""

    x: X
    """The estimate."""
    residual: Array
    """(n,) measured minus predicted at x."""
    jacobian: Array
    """(n, p) derivative of the prediction at x."""
    end: Tangent
    """Tangent plane at x, its columns scaled by their own norms."""
    certificate: float
    """Relative offset, or |Q1'r| for an exact fit; see `Tangent.certificate`."""
    status: Status
    """How the fit ended."""
    iterations: int
    """Number of steps taken."""
    trace: Array
    """(iterations + 1,) sum of squares at the start and after each step."""

    @property
    def factor(self) -> Array:
        """K (p, p) with K K' = inv(A'A) at x."""
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

    Each step is the best one inside a trust region in scaled columns of A: a Levenberg-Marquardt
    step far away, a plain Gauss-Newton step near the solution, until the remaining step is 1e-10
    standard deviations. Steps come from normal equations where these are well conditioned; the
    solution is judged by an orthogonal factorization of A.

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
        Typical size of each unknown, which sets the first trust radius. Without it the first step
        is a plain Gauss-Newton step, for good starts.
    most : int
        Largest number of steps.
    until : float
        Relative offset at which to stop; larger if another fit starts from the solution.
    report : callable, optional
        Called with the step count and the sum of squares after each step.

    Returns
    -------
    Solution
        Its `status` is CONVERGED only with a certificate, of 1e-4 after slow convergence.

    Raises
    ------
    InputError
        A2: the start cannot be evaluated; M27: fewer rows than unknowns.

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
        plain, before = step, radius
        # beyond the radius only what a prior holds may go
        steady = here.damping(radius) == 0.0 or here.system.believed is not None
        if steady:
            step = memory.mixed(plain, here.scale)
        candidate = move(x, step)
        # a step that raises the sum of squares is refused, whatever the tangent plane there
        level = np.inf if here.exact else here.cost * (1 + LEVEL)
        there = _system(evaluate, candidate, here.scale, level)
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
            memory.add(step, plain, steady and slow and radius == before)
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
    """Anderson acceleration: extrapolation from the last steps of slow convergence.

    Where curvature of the model is large against its residual, undamped steps converge linearly;
    so do those damped by one trust radius, where a prior holds the numbers. The last steps within
    one radius together predict the limit.

    References
    ----------
    Anderson 1965; Walker & Ni 2011, SIAM Journal on Numerical Analysis 49(4), (2.1).
    """

    def __init__(self) -> None:
        self.steps: list[tuple[Array, Array]] = []

    def forget(self) -> None:
        """Discard all steps."""
        self.steps.clear()

    def add(self, taken: Array, plain: Array, slow: bool) -> None:
        """Store a step taken and the plain one there if convergence is slow; else discard all."""
        if not slow:
            self.forget()
        else:
            self.steps = [*self.steps[1 - DEPTH :], (taken, plain)]

    def mixed(self, plain: Array, scale: Array) -> Array:
        """Accelerated step (p,), where the plain one within the radius is `plain`."""
        if not self.steps:
            return plain
        taken = np.array([one for one, _ in self.steps]).T
        before = np.array([one for _, one in self.steps] + [plain])
        changes = np.diff(before, axis=0).T
        weighed = scale[:, None] * changes
        share = np.linalg.lstsq(weighed, scale * plain, rcond=None)[0]
        return np.asarray(plain - (taken + changes) @ share)


def _system(
    evaluate: Callable[[X], tuple[Array, Array] | System],
    x: X,
    least: Array | float = 0.0,
    most: float = np.inf,
) -> Tangent | None:
    """Tangent plane at x; None if the model is not finite there, or |r|^2 is larger than `most`.

    The scale of a column never falls below `least`, its scale before, so that an unknown whose
    column vanishes on the way does not diverge.
    """
    # a trial step may be far too long: overflow only refuses it
    with np.errstate(all="ignore"):
        return normal_plane(System(*evaluate(x)), least, most)


def _nearer(here: Tangent, there: Tangent) -> bool:
    """Whether a step halved the offset without raising the sum of squares beyond rounding.

    Near the solution the sum of squares is flat to rounding and the offset is the finer measure.
    Where only the offset is left, slow convergence is enough.
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
