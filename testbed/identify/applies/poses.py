"""What a calibration warns of its poses: joints hardly moved, poses too much alike."""

import numpy as np

from calib.geometry.parameters import shown_in
from calib.identification.fit_statistics import RED
from calib.identification.identify import Status
from calib.identification.result import ILL_CONDITIONED
from calib.measurement.observations import Measurements
from testbed.files.rows.exact import digit_steps, moved_by_digits
from testbed.files.session import Session
from testbed.identify.applies.quiet import quiet_words
from testbed.identify.records import FittedModel
from testbed.lengths import with_unit
from testbed.robots.catalog import Robot
from testbed.units import named, significant

LEAST_TURN, LEAST_SLIDE = np.radians(10.0), 0.010
"""Range of a joint at the training poses below which it counts as not moved [rad, m]."""


def warnings_of(
    geometric: FittedModel, chosen: FittedModel, train: Measurements, robot: Robot, session: Session
) -> tuple[str, ...]:
    """Sentences on the poses, by the geometric fit, and on the fit that was chosen.

    What the keys of inverse transforms would have to be is not said: each part of such a reading
    has noise of both keys.
    """
    result = chosen.identification
    texts = [*_still(geometric, train), *_condition(geometric)]
    if result.status is not Status.CONVERGED:
        texts.append(f"the fit {result.status.value}")
    if not session.stated.inverted:
        texts += quiet_words(result, train, scatter_told(robot, session))
    return tuple(texts)


def scatter_told(robot: Robot, session: Session) -> str:
    """Who told the scatter of the joints that the noise contains: nobody, "stated", "assumed"."""
    if not session.joint_scatter.any():
        return ""
    return "assumed" if robot.scatter_is_assumed else "stated"


def coarse_joints(session: Session, chosen: FittedModel, train: Measurements) -> tuple[str, ...]:
    """That joints are written with so few digits that rounding is more than the stated noise.

    Commanded joints are what they are, however few their digits: these are asked about only where
    the residuals are larger than their noise explains.
    """
    fit, read = chosen.identification, session.joint_source == "read-back"
    if not read and fit.p_value >= RED:
        return ()
    steps = digit_steps(fit.model, train.q)
    stated = session.measurements.covariance[:, :3, :3]
    noise = float(np.sqrt(np.trace(stated, axis1=1, axis2=2).mean() / 3))
    moved = moved_by_digits(fit.model, train.q, steps) / np.sqrt(3)
    if moved <= noise or session.measurements.is_distance.any():
        return ()
    turns = steps[~(fit.model.chain.prismatic > 0)]
    coarse = f"in steps of {significant(np.degrees(turns.max()), 1)} deg" if turns.any() else "so"
    rounded = "rounding" if read else "if they were rounded when they were written, that"
    return (
        f"the joints stand {coarse} in the file: {rounded} alone moves the tool by "
        f"{with_unit(moved, noise, digits=2)} per axis in each reading (standard deviation), where "
        f"{with_unit(noise, moved, digits=2)} of noise is stated; write more decimals",
    )


def _still(fit: FittedModel, train: Measurements) -> tuple[str, ...]:
    """Which joints were hardly moved: nothing was learnt of them, and nothing tests it."""
    kinds = np.array(fit.identification.model.chain.kinds)
    least = np.where(kinds == "revolute", LEAST_TURN, LEAST_SLIDE)
    still = np.flatnonzero(np.ptp(train.q, axis=0) < least) + 1
    if not len(still):
        return ()
    many = len(still) > 1
    return (
        f"{named('joint', [*map(str, still)])} moved by less than "
        f"{np.degrees(LEAST_TURN):.0f} deg or {1e3 * LEAST_SLIDE:.0f} mm: nothing here shows how "
        f"well the result holds where {'they have' if many else 'it has'} other values",
    )


def _condition(fit: FittedModel) -> tuple[str, ...]:
    """Whether the poses are too much alike, and which number suffers most.

    Of a fit with terms of joints, which a prior holds beside the readings, no condition tells that.
    """
    result = fit.identification
    own = result.model.joint_errors
    held = result.prior is not None and bool(own.terms or own.springs is not None)
    if result.reduction.condition <= ILL_CONDITIONED or held:
        return ()
    alike = (
        f"the poses are too much alike (condition {significant(result.reduction.condition, 2)}): "
    )
    more = "; vary the wrist and the orientation of the tool more"
    if result.prior is not None:
        return (f"{alike}the prior of the links determines what they do not{more}",)
    lengths = result.parameters.is_length[result.parameters.free_index]
    worst = result.least_known
    unit, scale = shown_in(result.names[worst], bool(lengths[worst]))
    value = scale * float(result.standard_uncertainty[worst])
    return (
        f"{alike}{result.names[worst]} is known least well, U = {significant(2 * value, 2)} {unit} "
        f"from the stated noise{more}",
    )
