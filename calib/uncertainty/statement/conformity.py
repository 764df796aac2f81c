"""Whether a tool point conforms to a tolerance: pass, fail or undecided, by a stated rule."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import LATER, Array, Bool, Labels, check, frozen, require_probability
from calib.errors import refuse
from calib.shown import ResultTable, Shown, length_unit, length_words
from calib.uncertainty.statement.distance import distance_radius, probability_within

Rule = Literal["guarded", "simple"]
RULES: tuple[Rule, ...] = ("guarded", "simple")
SIMPLE = "simple acceptance without a guard band"


@dataclass(frozen=True, slots=True, eq=False)
class Conformity(Shown):
    """Decisions on N tool points against one tolerance."""

    rule: Rule
    """"guarded": a guard band of R95 on both sides of the limit; "simple": none, on request, where
    R95 fits within the limit."""
    tolerance: float
    """Largest distance from the nominal point that conforms [m]."""
    probability: float
    """Content of the guard band."""
    distance: Annotated[Array, "N"]
    """(N,) length of the predicted deviation [m]."""
    guard: Annotated[Array, "N"]
    """(N,) width of the guard band, R95 of the region; zero under the simple rule [m]."""
    risk: Annotated[Array, "N"]
    """(N,) specific consumer's risk: probability that the point is out of tolerance."""
    outcome: Annotated[Labels, "N"]
    """(N,) "pass", "fail" or "undecided"."""
    radius: Annotated[Array | None, LATER] = None
    """(N,) R95 of the region, whatever the rule [m]; None counts as the guard band."""

    def __repr__(self) -> str:
        return f"Conformity({', '.join(f'{n} {word}' for word, n in self.counts.items())})"

    def tables(self) -> dict[str, ResultTable]:
        """``points``: distance, guard band [m], risk of each, and the outcome."""
        lengths = {"distance_m": self.distance, "guard_m": self.guard}
        return {"points": ResultTable({**lengths, "risk": self.risk, "outcome": self.outcome})}

    @property
    def counts(self) -> dict[str, int]:
        """How many of each outcome, in the order pass, undecided, fail; those that came up."""
        found = {word: int((self.outcome == word).sum()) for word in ("pass", "undecided", "fail")}
        return {word: count for word, count in found.items() if count}

    @property
    def hopeless(self) -> Bool:
        """(N,) where the tolerance is smaller than R95: no pass is possible by any rule."""
        radius = self.guard if self.radius is None else self.radius
        return np.asarray(radius > self.tolerance)

    @property
    def largest_risk(self) -> float | None:
        """Largest risk of a point that passed; None if none did."""
        passed = self.risk[self.outcome == "pass"]
        return float(passed.max()) if len(passed) else None

    @property
    def sentence(self) -> str:
        """The decisions in words; which rule, and how large the risk of a pass is."""
        counted = ", ".join(f"{count} {word}" for word, count in self.counts.items())
        radius = self.guard if self.radius is None else self.radius
        small = int(self.hopeless.sum())
        both = (self.tolerance, float(radius.max())) if small else (self.tolerance,)
        scale, unit = length_unit(both)
        limit = length_words(self.tolerance) if unit == "um" else f"{scale * self.tolerance:.6g} mm"
        risk, band = self.largest_risk, f"R{100 * self.probability:g}"
        largest = "" if risk is None else f", largest risk of a pass {100 * risk:.2g} %"
        rule = f"guard band {band}" if self.rule == "guarded" else SIMPLE
        said = ""
        if small:
            said = (
                f"; at {small} of {len(self.guard)} points no pass is possible: the tolerance is "
                f"smaller than the uncertainty, {band} up to {length_words(*both[::-1])}"
            )
        return f"{counted} (tolerance {limit}, {rule}{largest}{said})"


def conformity(
    deviation: ArrayLike,
    covariance: ArrayLike,
    tolerance: float,
    *,
    rule: Rule = "guarded",
    probability: float = 0.95,
) -> Conformity:
    """Decide whether points conform to a tolerance on their distance from nominal.

    A guarded pass needs |d| <= T - R95: the ball that holds the point lies within the tolerance,
    so that the risk is at most 1 - probability whatever the shape of the region. A guarded fail
    needs |d| >= T + R95. In between nothing is decided.

    The simple rule passes |d| <= T and fails all else, but decides as the guarded one where R95 is
    larger than T: there no reading shows that a point conforms. A point at the limit has a risk of
    one half at least, as the tolerance then lies on one side of it.

    Parameters
    ----------
    deviation : (N, 3) array_like
        Predicted minus nominal point [m].
    covariance : (N, 3, 3) array_like
        Of the predicted point, its factor already in it where that is larger than chi-square's
        [m^2].
    tolerance : float
        T, above zero [m].
    rule : {"guarded", "simple"}
        Whether a guard band stands between a pass and the limit.
    probability : float
        Content of the guard band.

    References
    ----------
    JCGM 106:2012, 7 (conformance probability), 8.2 (simple acceptance), 8.3 (guard bands), 9
    (risks); ILAC-G8:09/2019, 4.2.
    """
    require_probability(probability)
    if rule not in RULES:
        raise refuse("rule", rule, " or ".join(map(repr, RULES)), code="A3")
    if not 0 < tolerance < np.inf:
        raise refuse("tolerance", tolerance, "above zero [m]", code="A3")
    d, S = check("n 3, n 3 3", deviation=deviation, covariance=covariance)
    distance = np.linalg.norm(d, axis=1)
    radius = distance_radius(S, probability)
    guarded = np.full(len(S), rule == "guarded")
    band = np.where(guarded | (radius > tolerance), radius, 0.0)
    risk = 1 - probability_within(np.full(len(S), tolerance), S, d)
    outcome = np.full(len(S), "undecided")
    outcome[distance <= tolerance - band] = "pass"
    outcome[np.where(band > 0, distance >= tolerance + band, distance > tolerance)] = "fail"
    return Conformity(
        rule, float(tolerance), probability, frozen(distance),
        frozen(np.where(guarded, radius, 0.0)), frozen(np.clip(risk, 0.0, 1.0)),
        frozen(outcome, np.str_), frozen(radius),
    )  # fmt: skip
