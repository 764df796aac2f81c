"""A radius around the predicted tool point that needs no model of the error: split conformal."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaincinv

from calib.arrays import check, require_probability
from calib.errors import refuse
from calib.held_out_counts import fewest_poses
from calib.kinds import checked_kinds
from calib.shown import length_words


@dataclass(frozen=True, slots=True)
class Conformal:
    """Radius that holds the error of a new pose, drawn like the validation poses."""

    radius: float
    """[m]"""
    rank: int
    """k: the radius is the k-th smallest of the n errors."""
    n_poses: int
    """n."""
    probability: float
    """Content asked for, on average over validation sets: k / (n + 1) or more."""

    @checked_kinds
    def content_range(self, probability: float = 0.95) -> tuple[float, float]:
        """Range that holds the content of this one radius: it depends on the n poses drawn.

        References
        ----------
        The content is Beta(k, n + 1 - k) for independent continuous errors.
        """
        tail = (1 - require_probability(probability)) / 2
        a, b = self.rank, self.n_poses + 1 - self.rank
        return float(betaincinv(a, b, tail)), float(betaincinv(a, b, 1 - tail))

    @property
    def sentence(self) -> str:
        """The result in words."""
        low, high = self.content_range()
        return (
            f"a further reading of the same target, at a pose drawn like the {self.n_poses} held "
            f"out, lies within {length_words(self.radius)} with {100 * self.probability:g} % "
            f"probability, whatever the errors are made of; this one radius holds "
            f"{100 * low:.0f} to {100 * high:.0f} % of such readings, with 95 % confidence. The "
            "noise of that reading is in it, and what all readings share is not"
        )


@checked_kinds
def conformal(distance: ArrayLike, *, probability: float = 0.95) -> Conformal:
    """Radius from the errors (n,) [m] at held-out poses, `HeldOut.distance`.

    Raises
    ------
    InputError
        Fewer poses than `fewest_poses`: no finite radius can be promised.

    References
    ----------
    k-th smallest error, k = ceil((n + 1) p); exchangeable errors. Vovk et al. 2005.
    """
    (distance,) = check("n", distance=distance)
    need = fewest_poses(probability)
    n = len(distance)
    if n < need:
        message = f"{n} validation poses for {100 * probability:g} %"
        fix = "measure more poses where the robot will be used, or ask for less coverage"
        raise refuse("distance", n, f"at least {need}", code="A3", message=message, fix=fix)
    least = float(distance.min())
    if least < 0:
        message, allowed = f"distance has the value {least:.3g}", "lengths of errors, none negative"
        raise refuse("distance", least, allowed, code="A3", message=message)
    k = int(np.ceil((n + 1) * probability - 1e-9))
    return Conformal(float(np.partition(distance, k - 1)[k - 1]), k, n, probability)
