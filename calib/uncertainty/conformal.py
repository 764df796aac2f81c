"""A radius around the predicted tool point that needs no model of the error: split conformal."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaincinv

from calib.arrays import check
from calib.errors import InputError


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

    def content_range(self, probability: float = 0.95) -> tuple[float, float]:
        """Range that holds the content of this one radius: it hangs on the n poses drawn.

        References
        ----------
        The content is Beta(k, n + 1 - k) for independent continuous errors.
        """
        tail = (1 - probability) / 2
        a, b = self.rank, self.n_poses + 1 - self.rank
        return float(betaincinv(a, b, tail)), float(betaincinv(a, b, 1 - tail))

    @property
    def sentence(self) -> str:
        """What it says, in words."""
        low, high = self.content_range()
        return (
            f"a new pose from where the {self.n_poses} validation poses were drawn lies within "
            f"{1e6 * self.radius:.0f} um with {100 * self.probability:g} % probability, whatever "
            f"the errors are made of; for this one set {100 * low:.0f} to {100 * high:.0f} %. The "
            "errors contain the measuring noise, so it is a little too wide"
        )


def fewest_poses(probability: float = 0.95) -> int:
    """Smallest n for which the k-th smallest of n errors exists: 19 for 95 %."""
    _checked(probability)
    return int(np.ceil(probability / (1 - probability) - 1e-9))


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
        raise InputError(
            f"{n} validation poses for {100 * probability:g} %",
            code="A3",
            field="distance",
            value=n,
            allowed=f"at least {need}",
            fix="measure more poses where the robot will be used, or ask for less coverage",
        )
    if (distance < 0).any():
        raise InputError(
            f"distance has the value {distance.min():.3g}",
            code="A3",
            field="distance",
            value=float(distance.min()),
            allowed="lengths of errors, none negative",
        )
    k = int(np.ceil((n + 1) * probability - 1e-9))
    return Conformal(float(np.partition(distance, k - 1)[k - 1]), k, n, probability)


def _checked(probability: float) -> None:
    """Refuse what is not a probability strictly between 0 and 1."""
    if not 0 < probability < 1:
        raise InputError(
            f"probability is {probability}",
            code="C41",
            field="probability",
            value=probability,
            allowed="between 0 and 1, e.g. 0.95",
        )
