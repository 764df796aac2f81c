"""What is believed of a calibration, what speaks against the noise alone, and why, in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from calib.arrays import LATER
from calib.held_out_counts import fewest_poses
from calib.identification.fit_statistics import RED, chance
from calib.identification.identify import Identification, Status
from calib.identification.outliers.tails import LongTails
from calib.shown import Shown, angle_words, length_words
from calib.uncertainty.bootstrap import Bootstrap
from calib.uncertainty.conformal import Conformal
from calib.uncertainty.drift.drifting import Drifting
from calib.uncertainty.frames.other_frame import OtherFrame
from calib.uncertainty.held_out import HeldOut
from calib.uncertainty.outlying.poses import Strays
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.places import steps_words
from calib.uncertainty.statement.questions import LEVEL, Questions
from calib.uncertainty.statement.stated_point import StatedPoint
from calib.uncertainty.validation import LinearCheck

FRAME, MISFIT = "another frame", "misfit"
"""Name of that question."""
DATUM = (
    "The readings do not show where the robot stands: radii are of tool "
    "points to each other, in the frame that fits those at the poses identified from best; where "
    "that lies in the base is known no better than the links were, and is in no radius"
)
"""What a statement in an inner datum leaves out."""
IMAGE = (
    "The tool points lie in a plane, and distances are the same to the image of the arm beyond it: "
    "radii contain both, and positions of poses to identify from would tell them apart"
)
"""Why a statement of a plane arm contains two."""
QUIETEST = 1e-6
"""Chi-square per degree of freedom below which nothing is measured, and no factor has a meaning."""
StatementName = Literal["region", "none"]


@dataclass(frozen=True, slots=True)
class Trust(Shown):
    """Whether the region is believed, whether the parameters alone are refuted, and the reasons."""

    believe: StatementName
    refuted: bool
    """Whether a test contradicts the interval from the parameters alone; where none does, that
    interval is still not proven."""
    sentences: tuple[str, ...]
    found: Annotated[tuple[str, ...], LATER] = ()
    """Those of them that say what speaks against the stated noise alone: a drift, also one that
    nothing can show, and readings that it does not explain."""

    def __repr__(self) -> str:
        return f"Trust(believe={self.believe!r}, refuted={self.refuted})"

    @property
    def sentence(self) -> str:
        """All of it, as one text."""
        return " ".join(f"{part}." for part in self.sentences)


def trust(
    identification: Identification,
    *,
    belief: Belief | None,
    point: StatedPoint | None,
    questions: Questions,
    held_out: HeldOut | None = None,
    frame: OtherFrame | None = None,
    drifting: Drifting | None = None,
    conformal: Conformal | None = None,
    bootstrap: Bootstrap | None = None,
    linear: LinearCheck | None = None,
    unmodelled: Sequence[str] = (),
    tails: LongTails | None = None,
    strays: Strays | None = None,
    pose_names: Sequence[str] = (),
    ranged: bool = False,
) -> Trust:
    """Put what was found into words: what is believed first, then what is in it, then the tests.

    There is no order of statements to fall back through: the region holds whatever the evidence
    allows. Without a region nothing is believed, and the conformal radius is named as a number that
    needs no model.

    Parameters
    ----------
    identification : Identification
        The fit with its chi-square test; with repeats, its lack-of-fit test.
    belief, point : optional
        The believed region and its radius; both or none.
    questions : Questions
        Tests, together.
    held_out, frame, drifting, conformal, bootstrap, linear : optional
        What else was computed.
    unmodelled : sequence of str
        What is known to be missing in every covariance.
    tails : LongTails, optional
        Of the residuals, where they are longer than those of normal noise.
    strays : Strays, optional
        Held-out poses that stand out where all others agree.
    pose_names : sequence of str
        What poses are called, by `pose_id`; by default their numbers.
    ranged : bool
        Whether all that is held out are distances, which guard nothing.
    """
    reasons = _against(identification, held_out, strays)
    nonlinear = [part.sentence for part in (bootstrap,) if part is not None and not part.agrees]
    if linear is not None and linear.outcome == "not validated":
        nonlinear.append(linear.sentence)
    refuted = bool(reasons or nonlinear)
    words: list[str] = []
    found: list[str] = []
    if drifting is not None and (drifting.seen or drifting.void):
        found.append(_capital(drifting.sentence))
    if frame is not None and (frame.found or frame.in_part):
        words.append(_capital(frame.sentence))
    if strays is not None:
        words.append(_capital(strays.said_of(_named(strays.poses.tolist(), pose_names))))
    if belief is None or point is None:
        settled = bootstrap is not None and bootstrap.settled  # then its covariance was used
        words = _nothing(identification, [] if settled else nonlinear, conformal) + words
    else:
        few = strays is not None and not strays.moved
        words += _believed(belief, point, questions, drifting, few=few, ranged=ranged)
    if reasons:
        found.append("The parameters alone do not explain the readings: " + "; ".join(reasons))
        words.append(found[-1])
    else:
        text = _unrefuted(identification, questions, held_out, frame)
        if strays is not None and not strays.moved:
            text = f"Apart from what stands out: {text[0].lower()}{text[1:]}"
        words.append(text)
    if tails is not None:
        words.append(_capital(tails.said_of(_named(tails.poses, pose_names))))
        if identification.loss == "squared" and tails.source != "misfit":
            words.append(_capital(tails.remedy))
    if nonlinear and belief is not None:
        words.append(
            "Linear propagation does not hold here, so the part of the parameters is taken from "
            "virtual calibrations: " + "; ".join(nonlinear)
        )
    elif not nonlinear:
        words += [_capital(part.sentence) for part in (bootstrap, linear) if part is not None]
    words += [f"Not covered by the stated noise: {text}" for text in unmodelled]
    told = tuple(text for text in found if text in words)
    return Trust("none" if belief is None else "region", refuted, tuple(words), told)


def _believed(
    belief: Belief,
    point: StatedPoint,
    questions: Questions,
    drifting: Drifting | None,
    *,
    few: bool,
    ranged: bool,
) -> list[str]:
    """What is believed, and what is in it."""
    what, size = "no misfit is in it", belief.misfit.upper
    if size > 0:
        up_to = length_words(size, point.radius_mean, um=".1f")
        what = f"this includes a misfit of up to {up_to} per axis"
    words = [f"{_capital(point.sentence)}; {what}"]
    if point.move_sentence:
        words.append(_capital(point.move_sentence))
    words.append(_capital(belief.misfit.told(MISFIT in questions.said, few=few)))
    if belief.turned:
        words.append(
            f"The measured angles are off by up to {angle_words(belief.turned)} per axis "
            "more than their stated noise and the misfit explain; the region includes what "
            "this does to the tool point"
        )
    if belief.n_guards:
        words.append(
            f"{belief.n_guards} held-out poses guard the coverage factor, k = {belief.factor:.2f}"
        )
    elif belief.n_ranged:
        guard = f"; {fewest_poses(belief.probability)} poses measured as positions would guard all"
        words.append(
            f"Distances at {belief.n_ranged} held-out poses widen the coverage factor where they "
            f"ask for it, k = {belief.factor:.2f}; they guard no direction but their own, so a "
            "stricter limit of the misfit is used as well" + guard * (belief.datum is None)
            # of no use where nothing shows in which frame such positions would stand
        )
    else:
        seen = " and measured as positions (a distance shows one direction only)" * ranged
        guard = (
            f"; {fewest_poses(belief.probability)} poses drawn from where the robot is used{seen} "
            "would guard it"
        )
        words.append(
            "No held-out pose guards the coverage factor, so a stricter limit of the misfit is "
            "used instead" + guard * (belief.datum is None)
        )
    if belief.datum is not None:
        words.append(DATUM)
    if belief.mirrored:
        words.append(IMAGE)
    if steps := steps_words(belief.proven):
        words.append(_capital(steps))
    if drifting is not None and (drifting.void or drifting.covariance is not None):
        words.append(_capital(drifting.sentence))
    return words


def _nothing(fit: Identification, nonlinear: list[str], conformal: Conformal | None) -> list[str]:
    """Why nothing is believed, and which number is left."""
    if fit.status is not Status.CONVERGED:
        why = f"the fit {fit.status.value}"
    elif fit.mode == "paper":
        why = "an unweighted fit claims a covariance that its estimate does not have"
    elif nonlinear:
        why = "linear propagation does not hold: " + "; ".join(nonlinear)
    else:
        why = "there are too few measurements to bound what the model may miss"
    words = [f"No statement about the tool point is believed: {why}"]
    if conformal is not None:
        words.append(f"A number that needs no model: {conformal.sentence}")
    return words


def _freedom(fit: Identification) -> float:
    """Degrees of freedom of its chi-square, which a prior may leave below one."""
    return fit.dof_effective if np.isfinite(fit.dof_effective) else float(fit.dof)


def _against(
    fit: Identification, held_out: HeldOut | None, strays: Strays | None = None
) -> list[str]:
    """What contradicts the interval from the parameters alone."""
    reasons = []
    if fit.mode == "paper":
        return ["an unweighted fit has no test"]
    if fit.p_value < RED:
        reasons.append(
            f"the residuals are larger than the stated noise (chi-square "
            f"{fit.chi_square / _freedom(fit):.2f} per degree of freedom, p {chance(fit.p_value)})"
        )
    lack = fit.lack_of_fit
    if lack is not None and lack.p_value < RED:
        reasons.append(
            f"the misfit is larger than the scatter of repeats explains (p {chance(lack.p_value)})"
        )
    if held_out is not None and held_out.p_value < RED:
        few = "" if strays is None else f" ({strays.counted_words} among them)"
        reasons.append(
            f"errors at {len(held_out)} held-out poses{few} are larger than predicted (chi-square "
            f"{held_out.chi_square / (3 * len(held_out)):.2f} per degree of freedom, "
            f"p {chance(held_out.p_value)})"
        )
    return reasons


def _unrefuted(
    fit: Identification, questions: Questions, held_out: HeldOut | None, frame: OtherFrame | None
) -> str:
    """What the tests saw where none refutes: nothing, or a doubt; never a proof."""
    p = f"combined p {chance(questions.combined)}"
    of = "residuals" if held_out is None else "residuals and held-out errors"
    if questions.said:
        motion = FRAME
        if frame is not None and frame.in_part:
            motion = "a motion that explains the held-out errors in part"
        elif frame is not None and not frame.found:
            motion = f"{FRAME}, by less than the region allows for"
        said = " and ".join(motion if name == FRAME else f"a {name}" for name in questions.said)
        least = max(p for p in questions.adjusted if p < LEVEL)
        return f"A test of the {of} shows {said} (p {chance(least)})"
    if not questions.agree:
        return f"The {of} together are larger than the stated noise makes likely ({p})"
    if fit.p_value > 1 - RED and fit.dof > 0 and fit.loss == "squared":
        each = fit.chi_square / _freedom(fit)
        factor = f"{each**-0.5:.2g}" if each > QUIETEST else f"more than {QUIETEST**-0.5:.0f}"
        return (
            f"The residuals are smaller than the stated noise, by a factor of {factor} (chi-square "
            f"{each:.2g} per degree of freedom): no test shows more than it, and the region is too "
            "wide unless it stands for errors that all readings share"
        )
    return f"No test of the {of} contradicts the stated noise ({p}), though that is no proof"


def _named(poses: Sequence[int], names: Sequence[str]) -> list[str]:
    """What these poses are called."""
    return [names[pose] if names else str(pose) for pose in poses]


def _capital(text: str) -> str:
    """With a capital letter."""
    return text[:1].upper() + text[1:]
