"""What could not be stated of a calibration, or rests on trust, and what to do about it."""

from calib.arrays import Index
from calib.held_out_counts import FEWEST, fewest_poses
from calib.identification.identify import Identification
from calib.identification.joint_models import shared_waves
from testbed.studies.trial.statement.records import LEVEL


def warnings_of(
    result: Identification,
    held_out: int,
    outliers: int,
    set_aside: Index,
    shared: float,
    unseen: tuple[str, ...],
) -> tuple[str, ...]:
    """What a reader must know of the statements, and what to do about it.

    Too few held-out poses are a warning, not an error: the calibration itself is as good as before.
    Gross errors count where some are in the fit or were set aside; `shared` [m] was added to the
    conformal radius; `unseen` errors of the tracker show at no held-out pose.
    """
    need, warnings = fewest_poses(LEVEL), []
    if held_out < need:
        warnings.append(
            f"too few held-out poses were measured ({held_out}) for a {100 * LEVEL:g} % radius "
            f"that needs no model of the error: {need} are the fewest; write [test] poses = {need} "
            "or more"
        )
    if held_out < FEWEST:
        warnings.append(
            f"too few held-out poses were measured ({held_out}) to show a discrepancy: {FEWEST} "
            "are the fewest for a covariance"
        )
    if outliers and result.loss == "squared":
        some = "a shot" if outliers == 1 else f"{outliers} shots"
        warnings.append(
            f"{some} of the calibration may pull at the result; measure again what does not fit, "
            'or write loss = "cauchy" in [identification]'
        )
    if len(set_aside):
        poses = ", ".join(map(str, set_aside))
        warnings.append(
            f"the shots of held-out poses {poses} were grossly wrong and are set aside; measure "
            "them again"
        )
    if shared > 0:
        warnings.append(
            "what the tracker gets wrong the same way in both visits shows at no held-out pose: "
            f"{1e6 * shared:.0f} um for it are added to the conformal radius in the table"
        )
    if unseen:
        warnings.append(
            f"no held-out pose of this tracker can show its {' or its '.join(unseen)}: what they "
            "leave is in the believed region by the sizes that the tracker states of itself"
        )
    if result.prior is not None:
        warnings.append(
            "the estimate rests on a prior as well: its intervals hold over robots like those that "
            "the prior describes, not over repeats of one"
        )
    return (*warnings, *shared_waves(result))
