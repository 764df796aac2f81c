"""What a person should do now: what the strongest finding asks for."""

import numpy as np

from calib.held_out_counts import fewest_poses
from calib.identification.fit_statistics import RED
from testbed.files.session_toml import FRAMES_ALONE
from testbed.identify.applies.beyond import far_step
from testbed.identify.applies.targets import tool_words as target_words
from testbed.identify.calibration import Calibration
from testbed.identify.handback.delivered import GEOMETRIC
from testbed.identify.headline import kind, mm
from testbed.identify.to_do.causes import (
    description_step,
    do_not_use,
    drift_step,
    first_of_all,
    hidden_drift_step,
)
from testbed.identify.to_do.change import NOTHING_LEFT, nothing_left
from testbed.identify.to_do.unconfirmed import unconfirmed
from testbed.identify.visits.wide import wide_step
from testbed.lengths import with_unit

LEARNT = 1.1
"""Errors at held-out poses up to so many times those at training poses are all that is left."""


def next_step(calibration: Calibration) -> str:
    """What a person should do now."""
    fit, proof = calibration.fit, calibration.proof
    if first := first_of_all(calibration):
        return first
    if fit.test is None:
        return (
            f"Measure at least {fewest_poses()} more poses where the robot will be used, and pass "
            "them with --test: until then, only the fit itself supports this result."
        )
    unchanged, far = nothing_left(calibration), far_step(calibration)
    gain = calibration.before_test.position.mean / fit.test.position.mean  # type: ignore[union-attr]  # both or none
    if gain < 1 and not unchanged and not far and calibration.choice.asked != FRAMES_ALONE:
        return do_not_use(calibration)
    if first := description_step(calibration):
        # a drift that is hidden may look like a load from another side
        return f"{first} {hidden_drift_step(calibration)}".rstrip()
    use = _what_to_use(calibration)
    if unchanged:
        use = (
            f'{NOTHING_LEFT} Keep the robot as it is described ([identification] free = "frames" '
            f"then states its R95). This is of the one in robot/, whose numbers were fitted anew."
        )
    if proof.belief is None or proof.point is None:
        return _without_region(calibration, use)
    mean, move = proof.point.radius_mean, proof.point.radius_move
    quote = f"R{100 * proof.point.probability:g} = {with_unit(mean, move)}"
    # the tool of the file is another point, known less well: what is stated at targets is of it
    whose = " of the measured target" if target_words(calibration) else ""
    text = f"{use} Quote {quote} for the mean of many moves{whose}"
    if np.isfinite(move):
        text += f" and {with_unit(move, mean)} for a single move"
    text += ", at poses like the held-out ones."
    if first := far or wide_step(calibration):
        return f"{first}{text[0].lower()}{text[1:]} {hidden_drift_step(calibration)}".rstrip()
    if not proof.belief.n_guards:
        done = "guards" if proof.held_out is not None else "has tested"
        said = f"no held-out pose {done} it"
        if proof.belief.n_ranged:
            said = "distances alone have tested it"
        said += ", and that it is of tool points to each other" * proof.point.relative
        return f"{text} State with it that {said}. {_more_poses(calibration)}"
    if drifts := drift_step(calibration):
        return f"{text} {drifts}"
    if proof.tails is not None and not proof.tails.source:
        return f"{text} Measure every pose twice, to tell noise with long tails from a misfit."
    if not calibration.refuted:
        return f"{text} {hidden_drift_step(calibration)}".rstrip()
    if calibration.choice.asked == "geometric":
        return (
            "Try --model choose: joint errors (sag, waves) may explain what is left. "
            f"Otherwise: {text}"
        )
    if asked_for := unconfirmed(calibration):
        return f"{text} {asked_for}"
    return text if unchanged else f"{text} {_what_is_left(calibration)}"


def _without_region(calibration: Calibration, use: str) -> str:
    """What to use and to quote where no region can be believed."""
    conformal = calibration.proof.conformal
    if not calibration.converged:
        use = (
            "The fit did not converge. Before you use the identified robot with another tool, "
            "measure poses that tell its numbers apart, or free fewer ([identification] free)."
        )
    if conformal is None:
        return f"{use} Do not quote an uncertainty. {_more_poses(calibration)}"
    radius = f"{mm(conformal.radius)} mm (95 % of measured points)"
    return f"{use} Quote the held-out radius of {radius}, at poses like the held-out ones."


def _what_is_left(calibration: Calibration) -> str:
    """What more poses may do about errors that the model does not explain."""
    fit, order = calibration.fit, calibration.proof.drifting
    lack = fit.identification.lack_of_fit
    assert fit.test is not None  # asked for before
    if hidden := hidden_drift_step(calibration):
        return hidden
    if order is not None and order.void and order.covariance is None:
        return (
            "Measure the poses a second time in the same order: only that shows whether what is "
            "left is a drift, and R95 does not include one."
        )
    if fit.test.position.mean > LEARNT * fit.train.position.mean:
        text = "Errors are larger than at the training poses: more of these may help."
        if lack is None and fit.identification.p_value < RED:
            text += (
                " If the readings are noisier than stated, state that, or measure every pose twice "
                "to find out: R95 takes all of it for a misfit."
            )
        return text
    if lack is not None and lack.p_value < RED:
        return "More poses will not reduce what is left: it is not noise."
    if lack is not None:
        return (
            "More poses will not reduce what is left: visits of one pose differ by about as much, "
            "as by noise beyond what is stated, or by joints that come back so."
        )
    return "Only repeated poses can show whether what is left is noise."


def _what_to_use(calibration: Calibration) -> str:
    """Which file to load: joint terms are in robot.toml and corrected targets alone."""
    if calibration.choice.chosen != "extended":
        return "Load the identified robot from robot/, or send targets corrected by --program CSV."
    plain = calibration.fits[0]
    left = mm((plain.test or plain.train).position.mean)
    return (
        "Send targets corrected by --program CSV, or load robot/robot.toml: only these contain "
        "the joint errors, and the figures quoted hold for them alone. For link numbers, URDF or "
        f"MJCF take {GEOMETRIC}/, whose {kind(calibration)} is {left} mm."
    )


def _more_poses(calibration: Calibration) -> str:
    """How a guard is had."""
    where = f"{fewest_poses()} held-out poses, drawn from where the robot is used"
    if calibration.relative:
        return (
            f"Measure positions as well, of poses to identify from and of at least {where}: "
            "distances alone do not show where the robot stands."
        )
    if calibration.measurements.is_distance.all():
        return f"Measure positions, not distances, of at least {where}."
    return f"Measure at least {where}."
