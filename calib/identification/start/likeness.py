"""Whether measurements are of such an arm, in SI units, before and after it was fitted to them."""

import numpy as np

from calib.arrays import Array
from calib.errors import InputError, refuse
from calib.geometry.model import RobotModel
from calib.identification.start.start import Start
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import length_words

FARTHEST = 100.0
"""Largest reach of an arm [m], of booms as well: beyond it the links are in mm."""
UNLIKE, TURNED = 0.1, 0.5
"""Largest rms error of nominal links, as a part of the reach; real arms miss by a hundredth at
most. The same of rotations [rad]."""
LEFT, LEFT_TURNED = 0.02, 0.1
"""The same of fitted links, as a median: these of real arms miss by a thousandth. Two joints in
each other's place leave a twentieth, a wrist joint in degrees a fortieth."""
LEAST = 0.025
"""Smallest median error of fitted links that counts [m]: servos of small arms leave a centimeter.
"""
TIMES = 5.0
"""An error of so many standard deviations of an axis may be noise."""
GIVE = (
    "give joint values in rad (slides in m) in the order and sense of the links, positions and sd "
    "in m, rotations that are not transposed, and links in the standard order of Denavit and "
    "Hartenberg (Craig's has a and alpha of the joint before), all of this robot; if they are, "
    "state an sd that the readings have"
)


def reach_of(model: RobotModel) -> float:
    """Sum of all lengths of the links [m]; of an arm of slides it may be zero."""
    return float(np.abs(model.chain.links[:, 1:3]).sum())


def require_meters(model: RobotModel, measured: Measurements) -> None:
    """Raise an `InputError` (M21) where links or sd can be in no meters."""
    reach = reach_of(model)
    if reach > FARTHEST:
        message, allowed = f"the links add up to {reach:.4g} m", f"at most {FARTHEST:.0f} m"
        fix = "give d and a in m, positions and sd as well; these look like mm"
        raise refuse("links", reach, allowed, code="M21", message=message, fix=fix)
    sd = float(_axis_sd(measured).min(initial=np.inf))
    if np.inf > sd > reach > 0:
        message = f"sd is {sd:.4g} m or more in every row; the arm reaches {reach:.3g} m"
        raise refuse("sd", sd, code="M21", message=message, fix="give sd in m")


def require_nominal_likeness(start: Start) -> None:
    """Raise an `InputError` (M32) if nominal links miss by too much with the best frames."""
    reach = reach_of(start.model)
    if start.position_rms > UNLIKE * reach > 0:
        raise _unlike("nominal links miss the measurements", start.position_rms, reach)
    if start.rotation_rms > TURNED:
        raise _turned("nominal links miss the measured rotations", start.rotation_rms)


def require_fitted_likeness(fitted: RobotModel, start: Start, measured: Measurements) -> None:
    """The same of fitted links, beyond what the noise explains; few wrong readings do not count.

    What slides has a way that no link number tells: it counts as reach, as far as it was used.
    """
    slides = start.model.chain.prismatic > 0
    ways = float(np.ptp(measured.q[:, slides], axis=0).sum()) if len(measured) else 0.0
    reach, left = reach_of(start.model) + ways, predict(fitted, measured)
    miss = _beyond(left.misses, _axis_sd(measured))
    if miss > max(LEFT * reach, LEAST) and reach > 0:
        raise _unlike("even fitted links miss most measurements", miss, reach)
    poses = measured.is_pose
    turn = _beyond(left.turns[poses], _mean_sd(measured.covariance[poses, 3:, 3:]))
    if turn > LEFT_TURNED:
        raise _turned("even fitted links miss most measured rotations", turn)


def _axis_sd(measured: Measurements) -> Array:
    """Standard deviation (m,) of an axis of a row, as a mean over its axes [m]."""
    along = np.sqrt(np.maximum(measured.covariance[:, 0, 0], 0.0))
    mean = _mean_sd(measured.covariance[:, :3, :3])
    return np.asarray(np.where(measured.is_distance, along, mean))


def _mean_sd(covariance: Array) -> Array:
    """Root mean square over the axes of covariances (m, 3, 3)."""
    return np.asarray(np.sqrt(np.maximum(np.trace(covariance, axis1=1, axis2=2) / 3, 0.0)))


def _beyond(error: Array, sd: Array) -> float:
    """Median of errors (m,), of those that noise explains zero; zero without any."""
    return float(np.median(np.where(error > TIMES * sd, error, 0.0))) if len(error) else 0.0


def _unlike(what: str, miss: float, reach: float) -> InputError:
    """The error for positions of another arm."""
    message = f"{what} by {length_words(miss)} with the best base and tool; the arm reaches "
    return refuse("measured", miss, code="M32", message=f"{message}{reach:.3g} m", fix=GIVE)


def _turned(what: str, turn: float) -> InputError:
    """The error for rotations of another arm."""
    message = f"{what} by {np.degrees(turn):.3g} deg with the best base and tool"
    return refuse("measured", turn, code="M32", message=message, fix=GIVE)
