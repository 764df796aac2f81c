"""The proof of a calibration: what its errors at held-out poses show, and what is believed of it.

One rule for every robot: parameters, the largest misfit that the evidence allows, what the
instrument shares and what a drift leaves. Other statements stand beside it for comparison.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import LATER, Array
from calib.held_out_counts import FEWEST, fewest_poses
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification, Status
from calib.identification.outliers.tails import LongTails, long_tails
from calib.kinds import checked_kinds
from calib.measurement.observations import Measurements
from calib.measurement.remembered import remembering
from calib.shown import ResultTable, Shown, length_words
from calib.uncertainty.bootstrap import REPLICATES, Bootstrap, bootstrap
from calib.uncertainty.circumstances import Circumstances as Circumstances
from calib.uncertainty.circumstances import measured_noise
from calib.uncertainty.conformal import Conformal, conformal
from calib.uncertainty.discrepancy import Discrepancy, discrepancy
from calib.uncertainty.drift.drifting import Drifting
from calib.uncertainty.frames.other_frame import OtherFrame
from calib.uncertainty.held_out import (
    HeldOut,
    errors_of_poses,
    first_of_pose,
    held_out,
    require_disjoint,
)
from calib.uncertainty.outlying.poses import Strays
from calib.uncertainty.proven_belief import proven_belief, stated_radius
from calib.uncertainty.refit import unknown_to_loops
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.gain import of_all_numbers
from calib.uncertainty.statement.questions import Questions, fisher
from calib.uncertainty.statement.stated_point import StatedPoint
from calib.uncertainty.statement.stops import judged_by_stops, stop_covariance
from calib.uncertainty.trust import FRAME, MISFIT, Trust, trust
from calib.uncertainty.validation import LinearCheck


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Judgement(Shown):
    """What held-out poses show of one identification, and what is believed of it."""

    belief: Belief | None
    """The believed regions; None where nothing can be believed."""
    point: StatedPoint | None
    """The same as one radius, at poses like the held-out ones; None where nothing is believed."""
    questions: Questions
    """Tests, together."""
    held_out: HeldOut | None
    """Errors at the held-out poses, one row each; None where no pose or point was held out, or no
    reading identified from shows the frame of those that were."""
    frame: OtherFrame | None
    """Whether they stand in another frame, without those that stand out; None below
    `other_frame.FEWEST` poses."""
    drifting: Drifting | None
    """Whether the noise remembers, and what that leaves; None without an order in time."""
    discrepancy: Discrepancy | None
    """What the model leaves out, as a covariance; None below `held_out_counts.FEWEST` poses."""
    conformal: Conformal | None
    """Radius without a model of the error; None below `conformal.fewest_poses` poses."""
    bootstrap: Bootstrap | None
    """Virtual calibrations; None where none were asked for, or where they decide nothing."""
    trust: Trust
    """What is believed, and why."""
    tails: LongTails | None = None
    """Tails of the residuals that are longer than those of normal noise, without poses that stand
    out; None where they are not."""
    strays: Annotated[Strays | None, LATER] = None
    """Held-out poses that stand out where all others agree; they stay in every figure."""

    def __repr__(self) -> str:
        count = 0 if self.held_out is None else len(self.held_out)
        radius = "none" if self.point is None else length_words(self.point.radius_mean)
        return (
            f"Judgement(believe={self.trust.believe!r}, held-out poses: {count}, radius: {radius})"
        )

    def tables(self) -> Mapping[str, ResultTable]:
        """``errors`` at the held-out poses [m]; ``questions`` and the p-value of each."""
        asked = {"question": self.questions.names, "p_value": self.questions.p_values}
        errors = {} if self.held_out is None else self.held_out.tables()
        return {**errors, "questions": ResultTable(asked)}

    def summary(self) -> str:
        """All that was stated, as text of one line for each statement."""
        lines = []
        if self.held_out is not None:
            size = self.held_out.distance
            mean, most = float(size.mean()), float(size.max())
            lines.append(
                f"held-out poses: {len(size)}, mean error {length_words(mean, most)}, largest "
                f"{length_words(most)}, p = {self.held_out.p_value:.2g}"
            )
        parts = (self.discrepancy, self.conformal, self.bootstrap)
        names = ("discrepancy", "conformal radius", "bootstrap")
        lines += [
            f"{name}: {part.sentence}"
            for name, part in zip(names, parts, strict=True)
            if part is not None
        ]
        return "\n".join([*lines, f"believe: {self.trust.believe}", self.trust.sentence])


@checked_kinds
@remembering()
def judge(
    identification: Identification,
    test: Measurements,
    *,
    train: Measurements,
    circumstances: Circumstances | None = None,
    probability: float = 0.95,
    rng: np.random.Generator | None = None,
    replicates: int = REPLICATES,
    rejected_too: bool = False,
    linear: LinearCheck | None = None,
) -> Judgement:
    """Judge an identification by poses that it never used.

    Parameters
    ----------
    identification : Identification
        What was identified; with repeats, its lack-of-fit test counts as well.
    test : Measurements
        Held-out poses, points or distances, drawn from where the robot will be used.
    train : Measurements
        What was identified from: no held-out pose may be in it.
    circumstances : Circumstances, optional
        What else is known of the campaign.
    probability : float
        Content of every statement.
    rng : numpy.random.Generator, optional
        Of virtual calibrations, which check whether linear propagation holds; by default none are
        played. None are played for a robust loss or a prior either, nor for what would have to be
        fitted one by one: fixtures, distances, further stations or tools, springs, lengths that
        follow the temperature.
    replicates : int
        Virtual calibrations.
    rejected_too : bool
        Whether to play them for a fit that did not converge, or that its residuals or the held-out
        poses reject, too: there they decide nothing.
    linear : LinearCheck, optional
        Linear propagation against Monte Carlo.

    Raises
    ------
    InputError
        If a held-out pose was used for the identification, too, or what is known of the campaign
        is not of these rows.
    """
    known = Circumstances() if circumstances is None else circumstances
    known.require_fitting(identification, train, test)
    require_disjoint(test.q, train.q)
    if known.stops is not None:
        identification = judged_by_stops(identification, train, known.stops[0])
    seen, points = None, test.rows(~test.is_distance)
    if len(points):
        covariance = _of_noise(identification, train, known)
        seen = held_out(identification.model, covariance, first_of_pose(points), train.q)
    spread = discrepancy(seen) if seen is not None and len(seen) >= FEWEST else None
    errors = errors_of_poses(identification.model, test)
    radius = None
    if len(errors) >= fewest_poses(probability):
        radius = conformal(errors, probability=probability)
    replayed = None
    rejected = not rejected_too and _rejected(identification, seen)
    if rng is not None and not rejected and _can_play(identification, train):
        replayed = bootstrap(
            identification.model, train, identification.parameters, rng, replicates=replicates
        )
    bent = (replayed is not None and not replayed.agrees) or (
        linear is not None and linear.outcome == "not validated"
    )
    settled = replayed is not None and replayed.settled
    belief = frame = slow = point = tails = strays = None
    sound = identification.status is Status.CONVERGED and identification.mode == "whitened"
    if sound and (settled or not bent):
        numbers = None
        if bent and replayed is not None:
            numbers = of_all_numbers(identification, replayed.empirical)
        quiet = measured_noise(identification.model, train, test, known)
        belief, frame, slow, strays = proven_belief(
            identification, train, test, known, numbers, probability, quiet
        )
        if belief is not None:
            point = stated_radius(belief, identification, train, test, frame, known, quiet)
        if frame is not None and frame.unshown:
            seen = spread = radius = None
        apart = frame is not None and frame.found
        others = test if strays is None else test.rows(~np.isin(test.pose_id, strays.poses))
        tails = long_tails(identification, train, test.rows([]) if apart else others)
    questions = _asked(identification, seen, belief, frame, slow)
    verdict = trust(
        identification, belief=belief, point=point, questions=questions, held_out=seen,
        frame=frame, drifting=slow, conformal=radius, bootstrap=replayed, linear=linear,
        unmodelled=known.unmodelled, tails=tails, strays=strays, pose_names=known.pose_names,
        ranged=len(test) > 0 and bool(test.is_distance.all()),
    )  # fmt: skip
    return Judgement(
        belief, point, questions, seen, frame, slow, spread, radius, replayed, verdict, tails,
        strays,
    )  # fmt: skip


def _of_noise(fit: Identification, train: Measurements, known: Circumstances) -> Array:
    """Covariance (P, P) of all numbers from the noise, that which rows of one stop share in it."""
    if known.stops is None or fit.mode != "whitened":
        return fit.full_covariance
    return fit.full_covariance + stop_covariance(fit, train, known.stops[0])


def _asked(
    fit: Identification, seen: HeldOut | None, belief: Belief | None, frame: OtherFrame | None,
    slow: Drifting | None,
) -> Questions:  # fmt: skip
    """Distinct questions with their p-values; residuals and held-out errors make one number."""
    names, p = [], []
    if belief is not None:
        names.append(MISFIT)
        p.append(belief.misfit.p_value)
    if frame is not None and not frame.unshown:
        names.append(FRAME)
        p.append(min(1.0, 2 * min(frame.p_base, frame.p_tool)))
    if slow is not None and not slow.void:
        names.append("drift")
        p.append(slow.p_value)
    parts = [fit.p_value] if fit.dof > 0 and fit.mode == "whitened" else []
    parts += [seen.p_value] if seen is not None else []
    untold = ("drift",) if slow is not None and slow.few else ()
    return Questions(tuple(names), tuple(p), fisher(parts), untold)


def _rejected(identification: Identification, seen: HeldOut | None) -> bool:
    """Whether residuals or held-out errors contradict the noise, whatever replicates show."""
    return (
        identification.status is not Status.CONVERGED
        or identification.p_value < RED
        or (seen is not None and seen.p_value < RED)
    )


def _can_play(identification: Identification, train: Measurements) -> bool:
    """Whether virtual calibrations play what was done: least squares to poses and points.

    What has to be fitted one by one takes too long, a thousand times.
    A prior drawn anew for each would be tested over its own width, not over that of the estimate.
    """
    model = identification.model
    if identification.loss != "squared" or identification.prior is not None:
        return False
    own = unknown_to_loops(model, train, identification.parameters)
    return own is None and not model.fixtures.n_numbers
