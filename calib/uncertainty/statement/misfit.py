"""How much misfit may hide behind the noise: the size that the evidence allows, and what it does.

A test sees a misfit only from about the size of the noise on; below it, intervals from parameters
alone hold the truth ever less often. So the size is not tested away but estimated, from training
and held-out rows in one likelihood, and its upper limit belongs into every region.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, Bool, FloatOrNan, frozen
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import Shown
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
from calib.uncertainty.statement.shape import (
    MisfitShape,
    angles_apart,
    are_loud,
    misfit_shape,
    wrong_shots,
)

DROP = 0.821
"""Fall of the log-likelihood at the one-sided upper 90 % limit: half the 80 % point of chi2_1."""
UNGUARDED_DROP = 1.353
"""The same for 95 %, where too few held-out poses guard the factor of the region."""
SHOWN = 0.01
"""A p-value below which the readings show a misfit, in words."""
TURNS = np.concatenate([[0.0], np.geomspace(0.01, 1000.0, 200)])
"""Errors of angles that are tried, in their stated standard deviations."""
ROUNDS = 10
"""Searches for wrong shots among angles that are all further off than stated; two or three do."""
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

    def __repr__(self) -> str:
        return f"HiddenMisfit(up to {1e6 * self.upper:.3g} um per axis)"

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

    def told(self, shown: bool) -> str:
        """The result in words, and whether the readings count as showing a misfit."""
        if not np.isfinite(self.upper):
            return "there are too few measurements to bound what the model may miss"
        if shown:
            few = ""
            if self.upper < self.best:
                few = (
                    ", which is enough for the share of poses that is promised, as counting the "
                    "held-out errors shows: few of them are larger"
                )
            return (
                f"the readings show a misfit of about {1e6 * self.best:.1f} um per axis (p "
                f"{'< 0.001' if self.p_value < SEEN else f'= {self.p_value:.3f}'}), and the "
                f"region allows for up to {1e6 * self.upper:.1f} um{few}"
            )
        told = "" if self.repeated else "; the stated noise is untested, as no pose was repeated"
        if self.doubted:
            told = (
                "; repeats do not show how far the joints scatter, so all of that scatter counts "
                "as misfit"
            )
        if np.isnan(self.detectable):
            least = "the measurements are too few to say how large a misfit may hide"
        else:
            size = f"{1e6 * self.detectable:.1f} um per axis"
            least = f"a misfit of {size} or more would have been detected; a smaller one may hide"
        return (
            f"{least} behind the noise: these readings allow for up to {1e6 * self.upper:.1f} um, "
            f"which the region includes{told}"
        )


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
            message="the unweighted fit knows no noise behind which a misfit could hide",
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


@dataclass(frozen=True, slots=True, eq=False)
class LoudTurns:
    """Errors of angles beyond what is stated of them, and what they pull the numbers by.

    The estimate follows angles that no evidence of positions looks at.
    """

    size: float
    """Upper limit per axis, anew at each pose [rad]."""
    covariance: Array
    """(P, P) that they leave in all numbers [m, rad]."""


def loud_turns(
    identification: Identification, train: Measurements, held_out: Measurements
) -> LoudTurns | None:
    """How far angles are off beyond their noise and the misfit of positions; None where not at all.

    References
    ----------
    t by its profile likelihood, its limit as that of the misfit; C = t^2 sum over poses of F F', F
    the gain of the angles of a pose.
    """
    tables = [table for table in (train, held_out) if table.is_pose.any()]
    if not tables:
        return None
    model = identification.model
    shape = misfit_shape(model, held_out if len(held_out) else train)
    seen = [(predict(model, table), table.is_pose) for table in tables]
    variance, square = angles_apart(
        np.concatenate([one.residual[some] for one, some in seen]),
        np.concatenate([shape.rows(one.rows[some, 3:]) for one, some in seen]),
        np.concatenate([table.covariance[table.is_pose] for table in tables]),
    )
    if not are_loud(variance, square):
        return None
    tried = float(np.sqrt(variance.mean())) * TURNS
    wrong = wrong_shots(variance, square)
    for _ in range(ROUNDS):  # what is far off for the noise may be none for these errors
        whole = (variance + tried[:, None, None] ** 2)[:, ~wrong]
        value = -(np.log(whole) + square[~wrong] / whole).sum(axis=(1, 2)) / 2
        before, wrong = wrong, wrong_shots(variance + tried[value.argmax()] ** 2, square)
        if np.array_equal(wrong, before):
            break
    last = int(np.flatnonzero(value >= value.max() - DROP)[-1])
    size = float(tried[min(last + 1, len(tried) - 1)])
    pull = estimator_gain(identification, train)[:, :, 3:]
    _, pose = np.unique(train.pose_id, return_inverse=True)
    moved = np.zeros((int(pose.max()) + 1, *pull.shape[1:]))
    np.add.at(moved, pose.ravel(), pull)
    root = size * np.moveaxis(moved, 0, 1).reshape(pull.shape[1], -1)
    return LoudTurns(size, frozen(of_all_numbers(identification, root @ root.T)))
