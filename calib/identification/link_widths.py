"""Widths of the prior of links: wider than usual where the measurements leave little doubt.

A prior that is too narrow is taken for noise: what the links may not explain is left in the
residuals, the prior is then weighed against that larger noise, and holds the links even closer to
nominal. Every model that is compared under it suffers alike, so that their choice cannot see it.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.climbing import ASKED
from calib.identification.evidence.normal_equations import normal_equations
from calib.identification.evidence.shared_misfit import Asked, SharedMisfit
from calib.identification.levels import Ladder, Level, asked_of
from calib.identification.prior import Prior
from calib.measurement.observations import Measurements

MOST = 4
"""Largest number of doublings: sixteen times the usual widths, 1 cm and 1.6 deg."""

Rung = tuple[int, int]
"""Doublings of the widths of lengths and of angles."""


@dataclass(frozen=True, slots=True)
class LinkWidths:
    """Factors on the prior sd of links, and what speaks for them."""

    length: float = 1.0
    """Of lengths; one or more, a power of two."""
    angle: float = 1.0
    """Of angles."""
    gain: float = 0.0
    """Log evidence against the widths as given, each with the noise that it leaves."""

    @property
    def widened(self) -> bool:
        """Whether any of them exceeds one."""
        return max(self.length, self.angle) > 1.0


USUAL = LinkWidths()
"""Widths as given."""


def link_widths(
    nominal: RobotModel,
    near: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    ladders: Sequence[Ladder],
    part: Index | None,
    *,
    prior: Prior,
    links: Collection[str],
) -> LinkWidths:
    """Widen the prior of links as far as evidence asks for it and poses left out confirm it.

    Widths of lengths, of angles or of both are doubled, whichever has the most evidence, as long as
    that gains odds of 20 to 1 and lowers the mean error at poses left out. At the end the richest
    model has to ask for the widths as well: bent joints are not taken for wrong links.

    It is meant for one real arm of which nobody has stated a width. Arms drawn from a population of
    stated widths, as in studies of many robots, have these as their prior, which is then exact.

    Parameters
    ----------
    nominal, near, measurements, parameters, ladders, part, prior
        As in `climb`; the prior has independent numbers. Without poses to leave out nothing
        is widened.
    links : collection of str
        Names of the numbers whose prior may be widened.

    References
    ----------
    MacKay 1992, Bayesian interpolation, section 4: widths of priors and noise by their evidence.
    """
    if part is None:
        return USUAL
    width = dict(zip(prior.names, prior.sd.tolist(), strict=True))
    sd = np.array([width[name] for name in parameters.free_names])
    is_link = np.array([name in links for name in parameters.free_names])
    is_length = parameters.is_length[parameters.free_index]
    pose = np.unique(measurements.together, return_inverse=True)[1].ravel()

    def under(levels: tuple[Level, ...]) -> _Under:
        errors = [level.errors for level in levels]
        bare = normal_equations(nominal, near, measurements, parameters, errors, prior)
        shared = SharedMisfit.of(bare, measurements)
        return _Under(shared, asked_of(levels), sd, is_link & is_length, is_link & ~is_length)

    alone = under(())
    here: Rung = (0, 0)
    while True:
        evidence = alone.evidence(here)
        further = [(here[0] + i, here[1] + j) for i, j in ((1, 0), (0, 1), (1, 1))]
        gains = {each: alone.evidence(each) - evidence for each in further if max(each) <= MOST}
        asking = sorted((each for each in gains if gains[each] > ASKED), key=gains.__getitem__)
        least = alone.left_out(here, part, pose) if asking else 0.0
        better = [each for each in asking if alone.left_out(each, part, pose) < least]
        if not better:
            break
        here = better[-1]
    if here == (0, 0):
        return USUAL
    richest = under(tuple(ladder.levels[-1] for ladder in ladders))
    gain = richest.evidence(here) - richest.evidence((0, 0))
    return LinkWidths(2.0 ** here[0], 2.0 ** here[1], gain) if gain > ASKED else USUAL


@dataclass(frozen=True, slots=True, eq=False)
class _Under:
    """A model under priors of several widths, each with the noise that it leaves."""

    shared: SharedMisfit
    """Equations under the prior as given."""
    asked: Asked
    """Joint errors of the model."""
    sd: Array
    """(f,) prior sd as given [m, rad]."""
    lengths: Bool
    """(f,) which numbers are lengths of links."""
    angles: Bool
    """(f,) which numbers are angles of links."""
    found: dict[Rung, tuple[float, SharedMisfit, float]] = field(default_factory=dict)
    """Log evidence, equations at the noise left, and variance of the shared misfit."""

    def at(self, rung: Rung) -> tuple[float, SharedMisfit, float]:
        """The same of some widths."""
        if rung not in self.found:
            doubled = self.lengths * rung[0] + self.angles * rung[1]
            bare = replace(self.shared.bare, precision=np.diag((self.sd * 2.0**doubled) ** -2.0))
            shared, v = replace(self.shared, bare=bare).at_noise_of(self.asked)
            solved = shared.of_model(self.asked).solved_at(v, shared.bare.scale)
            noise = float(bare.equations.sum()) * float(np.log(shared.bare.scale))
            self.found[rung] = solved.evidence - noise, shared, v
        return self.found[rung]

    def evidence(self, rung: Rung) -> float:
        """Log evidence of some widths, up to a constant that all of them share."""
        return self.at(rung)[0]

    def left_out(self, rung: Rung, part: Index, pose: Index) -> float:
        """Mean error at poses left out in turn [m]."""
        _, shared, v = self.at(rung)
        whole, missed = shared.rows_at(v), np.full(len(pose), np.nan)
        for k in np.unique(part):
            rest = whole.without(part == k)
            missed[part == k] = whole.misses(rest.solved(*self.asked), part == k)
        return float(np.mean(np.bincount(pose, missed) / np.bincount(pose)))
