"""What is known of a campaign beside its readings, and what that says of their noise."""

from dataclasses import dataclass, replace
from typing import NamedTuple

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements, joined
from calib.uncertainty.statement.evidence import NoiseRepeats
from calib.uncertainty.statement.repeats import noise_repeats


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
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Point in the tool frame that is stated [m]."""
    doubted: tuple[Array, Array] | None = None
    """Part of the covariances (m, 6, 6) of what identified and (n, 6, 6) of what is held out that
    nothing measured tells: as noise it is in the weights, as misfit in the region."""
    stations_are_visits: bool = False
    """Whether each station is a visit of its own, which may stand in another frame by itself."""
    unmodelled: tuple[str, ...] = ()
    """What is known to be in no covariance: then a drift is looked for whatever a test says."""


class MeasuredNoise(NamedTuple):
    """The noise that something measured tells."""

    repeats: NoiseRepeats | None
    """What repeats say of it; None without enough of them."""
    train: Measurements
    """What identified, with no other noise."""
    test: Measurements
    """What is held out, likewise."""


def measured_noise(
    model: RobotModel, train: Measurements, test: Measurements, known: Circumstances
) -> MeasuredNoise:
    """What repeats say, and without them both tables less the part of the noise that is doubted."""
    visits = known.visits
    if visits is None:
        visits = joined([train, replace(test, pose_id=-1 - test.pose_id)]) if len(test) else train
    repeats = noise_repeats(model, visits, in_evidence=known.visits is None)
    if known.doubted is None or repeats is not None:
        return MeasuredNoise(repeats, train, test)
    less = [
        replace(table, covariance=table.covariance - part)
        for table, part in zip((train, test), known.doubted, strict=True)
    ]
    return MeasuredNoise(None, *less)
