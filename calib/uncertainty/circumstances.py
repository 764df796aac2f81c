"""What is known of a campaign beside its readings, and what that says of their noise."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index, check
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.identification.identify import Identification
from calib.kinds import check_fields
from calib.measurement.observations import Measurements, joined
from calib.measurement.tool_target import ToolTarget
from calib.uncertainty.statement.evidence import NoiseRepeats
from calib.uncertainty.statement.repeats import noise_repeats

QUIET = 1e-6
"""Part of the noise that is left in held-out rows whose noise nobody states."""


@dataclass(frozen=True, slots=True, eq=False)
class Circumstances:
    """What is known of a campaign beside its readings; each part may be missing."""

    visits: Measurements | None = None
    """Every visit of the poses, each approached anew, where only some of them identify."""
    order: tuple[Index, Index] | None = None
    """Place in time of each row (m,) identified from and (n,) held out, one numbering for both."""
    shared: Array | None = None
    """(P, P) covariance of all numbers from what all readings share [m, rad]."""
    repeatability: Array | None = None
    """(j,) standard deviation with which each joint comes back [rad, m]."""
    told_by: str = "the robot's description"
    """What tells it."""
    drawn: bool = True
    """Whether held-out poses were drawn where the robot is used: designed ones guard nothing."""
    target: ToolTarget | tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Point in the tool frame that is stated [m], or a reflector of the model."""
    doubted: tuple[Array, Array] | None = None
    """Part of the covariances (m, 6, 6) of what identified and (n, 6, 6) of what is held out that
    nothing measured tells: as noise it is in the weights, as misfit in the region."""
    stops: tuple[Array, Array] | None = None
    """Roots (m, 6, j) and (n, 6, j) of that part of both tables' noise, which is in their
    covariances, that rows of one pose and repeat share: the arm comes back once for all of them."""
    unstated: bool = False
    """Whether the noise of the readings is a guess, or less than stated by the residuals: held-out
    errors then guard a region as if they had none, unless repeats tell it. Where there is less of
    it than is counted on, a misfit passes for noise."""
    stations_are_visits: bool = False
    """Whether each station is a visit of its own, which may stand in another frame by itself."""
    drifts: float = 0.0
    """Standard deviation per axis by which visits of the same poses show that something drifts,
    perhaps the arm, which may stand anywhere in it when it is used [m]."""
    unmodelled: tuple[str, ...] = ()
    """What is known to be in no covariance: then a drift is looked for whatever a test says."""
    pose_names: tuple[str, ...] = ()
    """What poses are called in sentences, by `pose_id`; by default their numbers."""

    def __post_init__(self) -> None:
        check_fields(self)

    def require_fitting(
        self, identification: Identification, train: Measurements, test: Measurements
    ) -> None:
        """Refuse what is not of these rows: of `train`, which identified, and of `test`.

        Raises
        ------
        InputError
            A3: other numbers of rows or joints, a negative repeatability, or more doubted noise
            than there is.
        """
        weighed = len(identification.weights) > 0  # each row; else each equation has a residual
        seen = len(train) if weighed else int(train.equations.sum())
        rows = len(identification.weights if weighed else identification.residual)
        if rows != seen and identification.mode == "whitened":  # the paper has twelve of a pose
            what = "rows" if weighed else "equations"
            message = f"train has {seen} {what}, and the identification is from {rows}"
            fix = "give the rows that it was identified from"
            raise refuse("train", seen, code="A3", message=message, fix=fix)
        counts = len(train), len(test)
        if self.order is not None:
            check(f"{counts[0]}, {counts[1]}", train_order=self.order[0], test_order=self.order[1])
        joints = identification.model.chain.n_joints
        if self.repeatability is not None:
            (sd,) = check(f"{joints}", repeatability=self.repeatability)
            if (sd < 0).any():
                raise refuse("repeatability", float(sd.min()), "zero or more", code="A3")
        named = len(self.pose_names)
        if named and len(test) and not 0 <= test.pose_id.min() <= test.pose_id.max() < named:
            least, most = int(test.pose_id.min()), int(test.pose_id.max())
            message = f"pose_names are {named}, and held-out poses have numbers {least} to {most}"
            raise refuse("pose_names", named, "one for each pose_id", code="A3", message=message)
        if not 0 <= self.drifts < np.inf:
            raise refuse("drifts", self.drifts, "zero or more", code="A3")
        if self.stops is not None:
            check(f"{counts[0]} 6 j, {counts[1]} 6 j", stops_of_train=self.stops[0],
                  stops_of_test=self.stops[1])  # fmt: skip
        if self.doubted is None:
            return
        shapes = ", ".join(f"{m} 6 6" for m in counts)
        parts = check(shapes, doubted_of_train=self.doubted[0], doubted_of_test=self.doubted[1])
        for table, part in zip((train, test), parts, strict=True):
            left = np.linalg.eigvalsh((table.covariance - part)[:, :3, :3])
            if len(table) and left.min() <= 0:
                message = "doubted is all of the noise of a row, or more"
                allowed = "a part of it: what is left must scatter in every direction"
                raise refuse("doubted", float(left.min()), allowed, code="A3", message=message)


class MeasuredNoise(NamedTuple):
    """The noise that something measured tells."""

    repeats: NoiseRepeats | None
    """What repeats say of it; None without enough of them."""
    train: Measurements
    """What identified, with no other noise."""
    test: Measurements
    """What is held out, likewise."""
    guards: Measurements
    """The same, with the noise that is no part of the errors which guard a region."""


def measured_noise(
    model: RobotModel, train: Measurements, test: Measurements, known: Circumstances
) -> MeasuredNoise:
    """What repeats say, and without them both tables less the part of the noise that is doubted."""
    visits = known.visits
    if visits is None:
        visits = joined([train, replace(test, pose_id=-1 - test.pose_id)]) if len(test) else train
    repeats = noise_repeats(model, visits, in_evidence=known.visits is None)
    if repeats is not None:
        return MeasuredNoise(repeats, train, test, test)
    if known.doubted is not None:
        train, test = (
            replace(table, covariance=table.covariance - part)
            for table, part in zip((train, test), known.doubted, strict=True)
        )
    still = replace(test, covariance=QUIET * test.covariance) if known.unstated else test
    return MeasuredNoise(None, train, test, still)
