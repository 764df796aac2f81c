"""Warnings of a calibration: what could not be stated, or is assumed, and what to do about it."""

from calib.arrays import Index
from calib.held_out_counts import FEWEST, fewest_poses
from calib.identification.identify import Identification
from calib.identification.joint_models import shared_waves
from calib.shown import length_words
from testbed.studies.trial.statement.records import LEVEL


def warnings_of(
    result: Identification,
    held_out: int,
    outliers: int,
    set_aside: Index,
    shared: float,
    unseen: tuple[str, ...],
) -> tuple[str, ...]:
    """Warnings on the statements, and what to do about them.

    Too few held-out poses are a warning, not an error: the calibration itself is as good as before.
    Gross errors are mentioned if some are in the fit or were set aside; `shared` [m] was added to
    the conformal radius; `unseen` errors of the tracker are visible at no held-out pose.
    """
    need, warnings = fewest_poses(LEVEL), []
    if held_out < need:
        warnings.append(
            f"too few held-out poses were measured ({held_out}) for a {100 * LEVEL:g} % radius "
            f"that needs no model of the error: at least {need} are needed; write [test] poses = "
            f"{need} or more"
        )
    if held_out < FEWEST:
        warnings.append(
            f"too few held-out poses were measured ({held_out}) to show a discrepancy: a "
            f"covariance needs at least {FEWEST}"
        )
    if outliers and result.loss == "squared":
        some = "one reading" if outliers == 1 else f"{outliers} readings"
        warnings.append(
            f"{some} of the calibration may distort the result; repeat what does not fit, "
            'or write loss = "cauchy" in [identification]'
        )
    if len(set_aside):
        poses = ", ".join(map(str, set_aside))
        warnings.append(
            f"the readings of held-out poses {poses} were grossly wrong and are left out; repeat "
            "them"
        )
    if shared > 0:
        warnings.append(
            "held-out poses cannot show errors of the tracker that are the same at both visits: "
            f"{length_words(shared, um='.0f')} for these are added to the conformal radius in the "
            "table"
        )
    if unseen:
        warnings.append(
            f"no held-out pose of this tracker can show its {' or its '.join(unseen)}: the "
            "believed region includes these errors in the size that the tracker states"
        )
    if result.prior is not None:
        warnings.append(
            "the estimate also rests on a prior: its intervals hold over robots like those that "
            "the prior describes, not over repeats of one"
        )
    return (*warnings, *shared_waves(result))
