"""Whether first-order propagation may be trusted: its result against Monte Carlo, to the digits."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen, require_numbers, wrong_shape
from calib.errors import refuse
from calib.kinds import checked_kinds
from calib.shown import Shown
from calib.uncertainty.adaptive import Adaptive, require_digits
from calib.uncertainty.covariance import correlation, covariance_factor
from calib.uncertainty.monte_carlo import numerical_tolerance
from calib.uncertainty.regions import coverage_factor

CheckOutcome = Literal["validated", "not validated", "undecided"]
DIFFERENCE_STEP = 1e-2
"""Step of the derivatives, in standard uncertainties of each input."""


@dataclass(frozen=True, slots=True, eq=False)
class FirstOrder(Shown):
    """Result of the law of propagation for k outputs."""

    value: Array
    """(k,) the model at the means of the inputs."""
    covariance: Array
    """(k, k) C U C' with sensitivities C."""
    sensitivity: Array
    """(k, n) derivative of each output by each input."""

    def __repr__(self) -> str:
        return f"FirstOrder({len(self.value)} outputs of {self.sensitivity.shape[1]} inputs)"

    @property
    def standard(self) -> Array:
        """(k,) standard uncertainties."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def correlation(self) -> Array:
        """(k, k) correlation of the outputs."""
        return correlation(self.covariance)


@dataclass(frozen=True, slots=True, eq=False)
class LinearCheck(Shown):
    """The verdict on first-order propagation, and what it rests on."""

    outcome: CheckOutcome
    differences: Annotated[Array, "d"]
    """(d,) absolute differences from Monte Carlo: means, u, largest eigenvalue, factor."""
    tolerance: Annotated[Array, "d"]
    """(d,) what each may be."""
    sentence: str

    def __repr__(self) -> str:
        return f"LinearCheck({self.sentence})"

    @property
    def validated(self) -> bool:
        """Whether the first-order result may stand."""
        return self.outcome == "validated"


@checked_kinds
def first_order(
    model: Callable[[Array], Array], mean: ArrayLike, covariance: ArrayLike
) -> FirstOrder:
    """Propagate means (n,) and covariance (n, n) of the inputs by the law of propagation.

    Parameters
    ----------
    model : callable
        (M, n) inputs -> (M,) or (M, k) outputs, row by row.
    mean, covariance : (n,), (n, n) array_like
        Of the inputs, correlations included.

    References
    ----------
    JCGM 100:2008, 5.1.2, 5.2.2; derivatives by five-point differences.
    """
    mean, covariance = check("n, n n", mean=mean, covariance=covariance)
    if not len(mean):
        raise refuse("mean", 0, "at least one input", code="A1", message="there are no inputs")
    covariance_factor(covariance)
    h = DIFFERENCE_STEP * np.sqrt(np.diagonal(covariance))
    moving = np.flatnonzero(h)
    steps = np.zeros((len(moving), 4, len(mean)))
    for row, i in enumerate(moving):
        steps[row, :, i] = h[i] * np.array([-2, -1, 1, 2])
    points = np.concatenate([mean[None], (mean + steps).reshape(-1, len(mean))])
    out = require_numbers("model", model(points))
    if out.ndim not in (1, 2) or len(out) != len(points):
        raise wrong_shape("model", out.shape, f"a row of outputs for each of {len(points)} rows")
    (out,) = check(f"{len(points)} k", model=out.reshape(len(points), -1))
    around = out[1:].reshape(len(moving), 4, out.shape[1])
    slope = np.einsum("s,nsk->kn", np.array([1, -8, 8, -1]) / 12, around) / h[moving]
    C = np.zeros((out.shape[1], len(mean)))
    C[:, moving] = slope
    sigma = C @ covariance @ C.T
    return FirstOrder(frozen(out[0]), frozen((sigma + sigma.T) / 2), frozen(C))


@checked_kinds
def validate(
    value: ArrayLike, covariance: ArrayLike, monte_carlo: Adaptive, *, digits: int = 2
) -> LinearCheck:
    """Compare means, u, largest eigenvalue of the correlation and k_p with Monte Carlo.

    Parameters
    ----------
    value, covariance : (k,), (k, k) array_like
        By the law of propagation.
    monte_carlo : Adaptive
        Run with ``finer=5``.
    digits : int
        Significant digits that are to be stated.

    References
    ----------
    JCGM 101:2008 and JCGM 102:2011, clause 8: within delta, Monte Carlo run to delta / 5.
    """
    k = len(monte_carlo.mean)
    value, covariance = check(f"{k}, {k} {k}", value=value, covariance=covariance)
    require_digits(digits)
    covariance_factor(covariance)
    u = np.sqrt(np.diagonal(covariance))
    largest = float(np.linalg.eigvalsh(correlation(covariance))[-1])
    factor = coverage_factor(len(u), monte_carlo.probability)
    linear = np.array([*value, *u, largest, factor])
    other = np.array(
        [
            *(*monte_carlo.mean, *monte_carlo.standard),
            *(monte_carlo.largest_eigenvalue, monte_carlo.factor),
        ]
    )
    delta = [numerical_tolerance(float(v), digits) for v in u]
    tolerance = np.array(
        [*delta, *delta, numerical_tolerance(largest, digits), numerical_tolerance(factor, digits)]
    )
    differences = np.abs(linear - other)
    outcome = _verdict(differences, tolerance, monte_carlo.error)
    names = [f"{what} {i + 1}" for what in ("value", "uncertainty") for i in range(len(u))]
    names += ["largest eigenvalue of the correlation", "coverage factor"]
    k = int(np.argmax(differences / tolerance))
    return LinearCheck(
        outcome,
        frozen(differences),
        frozen(tolerance),
        _words(
            outcome,
            f"{names[k]} differs by {differences[k]:.3g} with a tolerance of {tolerance[k]:.3g}",
        ),
    )


def _verdict(differences: Array, tolerance: Array, error: Array) -> CheckOutcome:
    """Beyond the tolerance by more than Monte Carlo's own error: no. Within, and certain: yes."""
    if (differences - error > tolerance).any():
        return "not validated"
    if not (error <= tolerance / 5 * (1 + 1e-9)).all():
        return "undecided"
    return "validated" if (differences <= tolerance).all() else "not validated"


def _words(outcome: CheckOutcome, finding: str) -> str:
    """The verdict as a sentence."""
    if outcome == "validated":
        return f"first-order propagation is validated: {finding}"
    if outcome == "undecided":
        return (
            f"undecided: {finding}, but the Monte Carlo run is not five times finer; run it with "
            "finer=5"
        )
    return (
        f"first-order propagation is not validated: {finding}; state the Monte Carlo result instead"
    )
