"""How much misfit may hide behind the noise: the size that the evidence allows, and what it does.

A test sees a misfit only from about the size of the noise on; below it, intervals from parameters
alone hold the truth ever less often. So the size is not tested away but estimated, from training
and held-out rows in one likelihood, and its upper limit belongs into every region.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.special import chdtrc

from calib.arrays import LATER, Array, Bool, FloatOrNan
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import Shown, length_words
from calib.uncertainty.statement.evidence import (
    SEEN,
    NoiseRepeats,
    PositionRows,
    believed_before,
    detectable,
    position_rows,
    sound_rows,
)
from calib.uncertainty.statement.gain import covariance_of_groups, estimator_gain, of_all_numbers
from calib.uncertainty.statement.likelihood import DOUBT, likelihood
from calib.uncertainty.statement.shape import MisfitShape, misfit_shape

DROP = 0.821
"""Fall of the log-likelihood at the one-sided upper 90 % limit: half the 80 % point of chi2_1."""
UNGUARDED_DROP = 1.353
"""The same for 95 %, where too few held-out poses guard the factor of the region."""
SHOWN = 0.01
"""A p-value below which the readings show a misfit, in words."""
ENOUGH = (
    "which is enough for the share of poses that is promised, as counting the held-out errors "
    "shows: few of them are larger"
)
NO_WHITE_NOISE = 1.25
"""What a real misfit, smooth over the poses, needs more than white noise of its size to be seen."""


@dataclass(frozen=True, slots=True, eq=False)
class HiddenMisfit(Shown):
    """Sizes of a misfit, one standard deviation per axis [m], as far as the evidence goes."""

    shape: MisfitShape
    best: FloatOrNan
    """Most likely size; nan where the rows show nothing."""
    upper: float
    """Upper limit of its profile likelihood; infinite where the rows show nothing."""
    detectable: FloatOrNan
    """Size that a test would have seen; nan where the rows are too few to see any."""
    ratio: float
    """Twice the log-likelihood that the best size gains over none."""
    noise_scale: float
    """Factor on the stated noise at the best size."""
    noise_sd: float
    """Stated noise of the position rows, root mean square per axis [m]."""
    repeated: bool
    """Whether repeats told the noise; else it is taken on trust within 10 %."""
    doubted: bool = False
    """Whether a part of the stated noise counts as misfit in the upper limit, too."""
    counted: Annotated[bool, LATER] = False
    """Whether counting the held-out errors lowered the upper limit."""

    def __repr__(self) -> str:
        return f"HiddenMisfit(up to {length_words(self.upper, um='.3g')} per axis)"

    @property
    def larger_noise(self) -> float:
        """Factor, one or more, by which repeats show more noise than was stated."""
        return max(1.0, self.noise_scale) if self.repeated else 1.0

    def at_least(self, other: "HiddenMisfit") -> "HiddenMisfit":
        """The same with the upper limit that less noise leaves to the misfit."""
        return replace(self, upper=max(self.upper, other.upper), doubted=True)

    @property
    def p_value(self) -> float:
        """Chance of a larger likelihood ratio if there is no misfit: half of chi2_1's tail."""
        return float(chdtrc(1, self.ratio) / 2) if self.ratio > 0 else 1.0

    @property
    def sentence(self) -> str:
        """The result in words, where nothing else was asked of the readings."""
        return self.told(self.p_value < SHOWN)

    def told(self, shown: bool, *, few: bool = False) -> str:
        """The result in words, and whether the readings count as showing a misfit.

        `few` poses that stand out look like a misfit of all.
        """
        if not np.isfinite(self.upper):
            return "there are too few measurements to bound what the model may miss"
        if shown:
            return self._shown(few)
        size, told = f"up to {_words(self.upper, self.detectable)}", ""
        if self.doubted:
            told = (
                "; repeats do not show how far the joints scatter, so all of that scatter counts "
                "as misfit"
            )
        elif not self.repeated:
            told = "; the stated noise is untested, as too few poses were repeated"
        if self.counted and not self.upper:
            return f"the region includes no misfit, {ENOUGH}{told}"
        limit = f"these readings allow for {size}, which the region includes{told}"
        if self.counted:
            limit = f"the region includes {size}, {ENOUGH}{told}"
        if np.isnan(self.detectable):
            return f"the measurements are too few to detect a misfit; per axis, {limit}"
        if self.detectable < self.upper:
            return f"no test detects a misfit, yet one may hide behind the noise; per axis, {limit}"
        return (
            f"a misfit of {_words(self.detectable, self.upper)} per axis or more would have been "
            f"detected; {limit}"
        )

    def _shown(self, few: bool) -> str:
        """That the readings show a misfit, and how large a one the region allows for."""
        p = "p < 0.001" if self.p_value < SEEN else f"p = {self.p_value:.3f}"
        size = f"about {_words(self.best, self.upper)} per axis ({p})"
        limit = f"the region allows for up to {_words(self.upper, self.best)}"
        if self.upper < self.best:
            limit += f", {ENOUGH}"
        if few:
            return (
                "a few errors that stand out look like a misfit of all poses: taken together, the "
                f"readings show one of {size}, and {limit}"
            )
        return f"the readings show a misfit of {size}, and {limit}"


def _words(size: float, *beside: float) -> str:
    """A size [m] with its unit, to a tenth of a micrometer."""
    return length_words(size, *beside, um=".1f")


def misfit(
    identification: Identification,
    train: Measurements,
    held_out: Measurements | None = None,
    *,
    repeats: NoiseRepeats | None = None,
    stops: tuple[Array, Array] | None = None,
    drop: float = DROP,
) -> HiddenMisfit:
    """Size of what the model misses, by the restricted likelihood of all position rows.

    Parameters
    ----------
    identification : Identification
        By weighted least squares, from `train`.
    train : Measurements
        What was identified from.
    held_out : Measurements, optional
        Poses, points or distances drawn from where the robot is used.
    repeats : NoiseRepeats, optional
        What repeats say of the noise; without them its scale is known within `DOUBT`.
    stops : tuple of arrays, optional
        Roots (m, 6, j) and (n, 6, j) of the noise that rows of one stop share, of both tables.
    drop : float
        Fall of the log-likelihood at the upper limit.

    References
    ----------
    y = A x + d + e, e ~ N(0, g^2 N), d ~ N(0, sigma^2 D) at each pose, x flat or with its prior;
    g is profiled out. REML: Patterson & Thompson 1971. Angles are no evidence: quiet ones would
    deny a loud position.
    """
    if identification.mode != "whitened":
        raise refuse(
            "identification", identification.mode, "an estimate by stated noise", code="A3",
            message="the unweighted fit states no noise behind which a misfit could hide",
        )  # fmt: skip
    sound = sound_rows(identification, len(train))
    shape, rows = evidence_rows(
        identification.model, identification.parameters, train, held_out, sound, stops
    )
    unit, noise_sd = rows.unit, rows.noise_sd
    found = likelihood(rows, unit, repeats, believed_before(identification))
    if found is None:
        return HiddenMisfit(shape, np.nan, np.inf, np.nan, 0.0, 1.0, noise_sd, repeats is not None)
    best = int(np.argmax(found.value))
    return HiddenMisfit(
        shape,
        best=unit * float(found.size[best]),
        upper=unit * found.limit(drop),
        detectable=detectable_size(rows, repeats),
        ratio=float(2 * (found.value[best] - found.value[0])),
        noise_scale=float(found.noise_scale[best]),
        noise_sd=noise_sd,
        repeated=repeats is not None,
    )


def evidence_rows(
    model: RobotModel,
    parameters: Parameters,
    train: Measurements,
    held_out: Measurements | None,
    sound: Bool,
    stops: tuple[Array, Array] | None = None,
) -> tuple[MisfitShape, PositionRows]:
    """Shape of a misfit where the robot is used, and the position rows that may show it.

    Of the rows of `train` those that are `sound` (m,). `stops` as `misfit` takes them.
    """
    own, theirs = (None, None) if stops is None else stops
    if held_out is None or not len(held_out):
        shape = misfit_shape(model, train)
        return shape, position_rows(model, parameters, train, shape, sound, own)
    shape = misfit_shape(model, held_out)
    rows = position_rows(model, parameters, train, shape, sound, own)
    every = np.ones(len(held_out), np.bool_)
    more = position_rows(model, parameters, held_out, shape, every, theirs)
    return shape, rows.joined(more)


def detectable_size(rows: PositionRows, repeats: NoiseRepeats | None = None) -> float:
    """Size per axis of a misfit that these rows would show, whatever they read [m].

    As far as repeats tell the scale of the noise; else it is known within `DOUBT`.
    """
    doubt = DOUBT if repeats is None else np.inf if repeats.in_evidence else repeats.log_scale_sd
    unit = rows.noise_sd
    return NO_WHITE_NOISE * unit * detectable(unit**2 * rows.lam, rows.A.shape[1], doubt)


def misfit_covariance(
    identification: Identification, train: Measurements, shape: MisfitShape
) -> Array:
    """Covariance (P, P) of all numbers from a misfit of 1 m per axis in the training rows.

    References
    ----------
    F D F', F = inv(A'WA + Lambda0) A'W, D of the poses: the rows of one pose share its draw.
    """
    B = shape.rows(predict(identification.model, train).rows)
    each = estimator_gain(identification, train) @ B  # (m, f, k)
    return of_all_numbers(identification, covariance_of_groups(each, train.pose_id[:, None]))
