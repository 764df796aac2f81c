"""The proof of a calibration: its errors at held-out poses, and which statement to believe."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification, Status
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.bootstrap import REPLICATES, Bootstrap, bootstrap
from calib.uncertainty.conformal import Conformal, conformal, fewest_poses
from calib.uncertainty.discrepancy import FEWEST, Discrepancy, discrepancy
from calib.uncertainty.held_out import HeldOut, held_out
from calib.uncertainty.trust import Trust, trust
from calib.uncertainty.validation import LinearCheck


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Judgement:
    """What held-out poses show of one identification, and which statement to believe."""

    held_out: HeldOut | None
    """Errors at the held-out poses, one row each; None without such poses, or for distances."""
    discrepancy: Discrepancy | None
    """What the model leaves out, as a covariance; None below `discrepancy.FEWEST` poses."""
    conformal: Conformal | None
    """Radius without a model of the error; None below `conformal.fewest_poses` poses."""
    bootstrap: Bootstrap | None
    """Virtual calibrations; None where none were asked for, or where they decide nothing."""
    trust: Trust
    """The statement to believe, and why."""

    def __repr__(self) -> str:
        count = 0 if self.held_out is None else len(self.held_out)
        radius = "none" if self.conformal is None else f"{1e6 * self.conformal.radius:.0f} um"
        return (
            f"Judgement(believe={self.trust.believe!r}, held-out poses: {count}, "
            f"conformal radius: {radius})"
        )

    def summary(self) -> str:
        """All that was stated, as text of one line for each statement."""
        lines = []
        if self.held_out is not None:
            size = 1e6 * self.held_out.distance
            lines.append(
                f"held-out poses: {len(size)}, mean error {size.mean():.0f} um, largest "
                f"{size.max():.0f} um, p = {self.held_out.p_value:.2g}"
            )
        parts = (self.discrepancy, self.conformal, self.bootstrap)
        names = ("discrepancy", "conformal radius", "bootstrap")
        lines += [
            f"{name}: {part.sentence}"
            for name, part in zip(names, parts, strict=True)
            if part is not None
        ]
        return "\n".join([*lines, f"believe: {self.trust.believe}", self.trust.sentence])


def judge(
    identification: Identification,
    test: Measurements,
    *,
    train: Measurements | None = None,
    probability: float = 0.95,
    rng: np.random.Generator | None = None,
    replicates: int = REPLICATES,
    rejected_too: bool = False,
    linear: LinearCheck | None = None,
    unmodelled: Sequence[str] = (),
) -> Judgement:
    """Judge an identification by poses that it never used.

    Parameters
    ----------
    identification : Identification
        What was identified; with repeats, its lack-of-fit test counts as well.
    test : Measurements
        Held-out poses, points or distances, drawn from where the robot will be used.
    train : Measurements, optional
        What was identified from: no held-out pose may be in it, and virtual calibrations play it.
    probability : float
        Content of the conformal radius.
    rng : numpy.random.Generator, optional
        Of virtual calibrations, which check whether linear propagation holds; by default none are
        played. None are played for a robust loss or a prior either, nor with fixtures or distances.
    replicates : int
        Virtual calibrations.
    rejected_too : bool
        Whether to play them for a fit that did not converge, or that its residuals or the held-out
        poses reject, too: there they decide nothing.
    linear : Validation, optional
        Linear propagation against Monte Carlo.
    unmodelled : sequence of str
        What is known to be in no covariance, each reason enough not to believe the model.

    Raises
    ------
    InputError
        If a held-out pose was used for the identification, too.
    """
    if rng is not None and train is None:
        raise refuse(
            "train", code="A3", message="virtual calibrations need the table identified from",
            allowed="measurements, where rng is given",
        )  # fmt: skip
    seen = None
    if len(test) and not test.is_distance.any():
        used_q = np.zeros((0, test.q.shape[1])) if train is None else train.q
        seen = held_out(
            identification.model, identification.full_covariance, first_of_pose(test), used_q
        )
    spread = discrepancy(seen) if seen is not None and len(seen) >= FEWEST else None
    errors = errors_of_poses(identification.model, test)
    radius = None
    if len(errors) >= fewest_poses(probability):
        radius = conformal(errors, probability=probability)
    replayed = None
    rejected = not rejected_too and _rejected(identification, seen)
    if rng is not None and train is not None and not rejected and _can_play(identification, train):
        replayed = bootstrap(
            identification.model, train, identification.parameters, rng, replicates=replicates
        )
    verdict = trust(
        identification,
        held_out=seen,
        discrepancy=spread,
        conformal=radius,
        bootstrap=replayed,
        linear=linear,
        unmodelled=unmodelled,
    )
    return Judgement(seen, spread, radius, replayed, verdict)


def first_of_pose(test: Measurements) -> Measurements:
    """The first row of every pose: its others repeat the same error of the model."""
    return test.rows(np.unique(test.pose_id, return_index=True)[1])


def errors_of_poses(model: RobotModel, test: Measurements) -> Array:
    """Largest position error (p,) of each pose [m]: poses are alike, rows of one not independent.

    A distance shows an error along one line only: no radius around a point comes of it.
    """
    points = test.rows(~test.is_distance)
    if not len(points):
        return np.zeros(0)
    return points.largest_of_poses(predict(model, points).misses)


def _rejected(identification: Identification, seen: HeldOut | None) -> bool:
    """Whether the model-based interval falls whatever virtual calibrations show."""
    return (
        identification.status is not Status.CONVERGED
        or identification.p_value < RED
        or (seen is not None and seen.p_value < RED)
    )


def _can_play(identification: Identification, train: Measurements) -> bool:
    """Whether virtual calibrations play what was done: least squares to poses and points.

    A prior drawn anew for each would be tested over its own width, not over that of the estimate.
    """
    lonely = identification.model.fixtures.n_numbers or train.is_distance.any()
    return identification.loss == "squared" and identification.prior is None and not lonely
