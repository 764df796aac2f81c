"""Whether held-out readings stand in another frame: their errors as one rigid motion."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.special import chdtrc

from calib.arrays import LATER, Array, frozen
from calib.errors import refuse
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, predicted_positions
from calib.shown import Shown, length_words
from calib.uncertainty.frames.motion_fit import asked, chi_square, explained
from calib.uncertainty.frames.rigid import (
    motions_of,
    plain_offset,
    rest_of,
    rms_length,
    whole_motion,
)
from calib.uncertainty.statement.belief import Belief

PLAIN = 5.0
"""One kind of motion that leaves so many times less than the other is plainly the one."""
LEFT = 0.05
"""Chance of what a motion leaves below which it does not explain the errors.

A true motion is hardly lost by it: the misfit believed is the largest that may hide, not the usual.
"""
PART = 0.01
"""A motion that leaves no more of the errors is one: gross errors bend the plain rules."""
LEAST_TURN = 5e-4
"""Turns below this, in degrees, would be written as zero."""
UNTIL = "positions at three of the held-out poses or more, not on one line, identify as well"
"""What ties held-out positions to readings that show no frame."""
FEWEST_LEFT = 3
"""Points below which a motion leaves nothing to speak of."""
FEWEST = 6
"""Held-out poses below which a motion of six numbers is not told from their noise."""


@dataclass(frozen=True, slots=True, eq=False)
class OtherFrame(Shown):
    """The rigid motion that explains held-out errors best, and whether there is one."""

    shift: Annotated[Array, 3]
    """(3,) of the mean point of the poses, axes of the station [m]."""
    turn: Annotated[Array, 3]
    """(3,) rotation vector about that point [rad]."""
    tool: Annotated[Array, 3]
    """(3,) the same errors as an offset of the target, axes of the tool [m]."""
    size: float
    """Root mean square of what the motion does at the poses [m]."""
    tool_size: float
    """The same of the offset [m]."""
    p_base: float
    """Chance of as large a motion if there is none."""
    p_tool: float
    n_poses: int
    at_tool: bool
    """Whether an offset of the target explains the errors better than a motion of the base."""
    station: int = 0
    """Which station saw the poses; 0 is the world."""
    within: float = 0.0
    """A motion up to this size is in the believed region anyway [m]."""
    errors: float = 0.0
    """Root mean square of the errors that were to be explained [m]."""
    rest: float = 0.0
    """Root mean square of what the motion leaves of them [m]."""
    p_rest: float = 1.0
    """Chance of as much of it by noise, parameters and the misfit believed without these rows."""
    both: bool = False
    """Whether only station and target together explain the errors."""
    unshown: Annotated[bool, LATER] = False
    """Whether no reading identified from shows a frame: held-out positions then stand in another
    one, wherever they were read, and can be no evidence."""

    def __repr__(self) -> str:
        word = "another" if self.found else "the same"
        return f"OtherFrame({word}, {length_words(self.size, um='.3g')}, p = {self.p_base:.2g})"

    @property
    def found(self) -> bool:
        """Whether held-out rows stand in another frame: they prove nothing then.

        What bends the arm moves all held-out points a little, too, more than chance and less than
        is believed of them; and what the motion leaves must be no more than is believed either.
        """
        return self.unshown or (self._moved and self._explained)

    @property
    def in_part(self) -> bool:
        """Whether a motion explains errors, but not enough of them: the rows are evidence."""
        return self._moved and not self.found

    @property
    def _moved(self) -> bool:
        """Whether there is a motion, larger than chance and than the region."""
        size = self.tool_size if self.at_tool else self.size
        return min(self.p_base, self.p_tool) < RED and size > self.within

    @property
    def _explained(self) -> bool:
        """Whether the motion leaves what is believed, or next to nothing."""
        return self.p_rest >= LEFT or self.rest <= PART * self.errors

    @property
    def sentence(self) -> str:
        """The result in words."""
        if self.in_part:
            less = max(self.errors - self.rest, 0.0)
            return (
                f"a rigid motion explains {length_words(less)} of the held-out errors of "
                f"{length_words(self.errors)} (rms), but not the remaining "
                f"{length_words(self.rest)}: joints, payload or the model changed"
            )
        if not self.found:
            return f"{self.n_poses} held-out poses are in the frame of the calibration"
        return self.said_of(
            "the held-out rows" + f" of station {self.station + 1}" * bool(self.station)
        )

    def said_of(self, rows: str) -> str:
        """That they stand elsewhere, in words; `rows` is what they are called."""
        if self.unshown:
            return self._unshown_words(rows)
        if self.at_tool:
            what = (
                f"see another target: {length_words(self.tool_size)} from where the calibration "
                "has it on the tool"
            )
        else:
            angle = np.degrees(float(np.linalg.norm(self.turn)))
            turned = f" and {angle:.{1 if angle >= 1 else 3}f} deg" if angle >= LEAST_TURN else ""
            what = (
                f"are off as a whole by {length_words(self.size)}{turned} (another base, or the "
                "station moved)"
            )
        if self.both:
            what += (
                ", and the target moved, too" if not self.at_tool else ", and the base moved, too"
            )
        return f"{rows} {what}; they prove nothing without a base or target of their own"

    def _unshown_words(self, rows: str) -> str:
        """The same where no frame is another: what would show one, and what is left in the best."""
        said = (
            f"{rows} were read as positions, and no reading identified from shows in which frame: "
            f"they prove nothing until {UNTIL}"
        )
        if self.n_poses < FEWEST_LEFT:
            return said
        usual = "no more than is believed" if self.p_rest >= LEFT else "more than is believed"
        return (
            f"{said}; in the frame that fits them best they are off by {length_words(self.rest)} "
            f"(rms), {usual}"
        )


def other_frame(
    belief: Belief, held_out: Measurements, identification: Identification, train: Measurements
) -> OtherFrame:
    """Ask whether a rigid motion explains errors at held-out poses, beyond those identified from.

    Parameters
    ----------
    belief : Belief
        What is believed of errors there; its misfit is in their covariance.
    held_out : Measurements
        Poses and points, from one station.
    identification : Identification
        From `train`.
    train : Measurements
        What was identified from. A frame that was held fixed, and does not fit, shows in all
        readings: it is no other frame.

    References
    ----------
    Generalized least squares with V = G C G' (the parameter error, common to all) + N + sigma_U^2
    Q; fall of chi-square, six numbers for the base, three for the tool.
    """
    points = held_out.rows(~held_out.is_distance)
    if points.n_poses < FEWEST:
        raise refuse(
            "held_out", points.n_poses, f"{FEWEST} poses or more", code="A3",
            message=f"{points.n_poses} held-out poses cannot show another frame",
        )  # fmt: skip
    seen = predict(belief.model, points)
    e = seen.residual[:, :3]
    about = predicted_positions(belief.model, points).mean(axis=0)
    base, tool = np.split(motions_of(belief.model, points, about)[:, :3], [6], axis=2)
    # rows of another frame look like a misfit, too; it is no larger than the errors themselves
    size = min(belief.misfit.upper, float(np.sqrt((e**2).mean())))
    shared, error, of_base, of_tool = asked(
        belief, points, size, about, (e, base, tool), identification, train
    )
    moved, gain, moves = explained(shared, error, of_base, base)
    offset, tool_gain, tool_size = explained(shared, error, of_tool, tool)
    p_base, p_tool = float(chdtrc(6, gain)), float(chdtrc(3, tool_gain))
    at_tool = p_tool < p_base
    if min(p_base, p_tool) < RED:
        # a misfit as large as gross errors explains them, too, and no derivative a large turn
        whole, whole_size, left = whole_motion(belief.model, points, about)
        plain, plain_size, plain_left = plain_offset(e, tool)
        if max(left, plain_left) > PLAIN * min(left, plain_left):
            at_tool = plain_left < left
            if at_tool:
                offset, tool_size = plain, plain_size
            else:
                moved, moves = whole, whole_size
    return OtherFrame(
        frozen(moved[:3]), frozen(moved[3:]), frozen(offset), moves, tool_size, p_base, p_tool,
        points.n_poses, at_tool, int(points.station[0]),
    )  # fmt: skip


def unshown_frame(
    belief: Belief, held_out: Measurements, identification: Identification, train: Measurements
) -> OtherFrame:
    """Held-out positions where no reading identified from shows a frame, and what is left of them.

    Arguments as `after_the_motion` takes them; of several stations, that which saw most poses.
    """
    points = held_out.rows(~held_out.is_distance)
    station = int(np.argmax(np.bincount(points.station)))
    own = points.rows(points.station == station)
    about = predicted_positions(belief.model, own).mean(axis=0)
    motion, size, _ = whole_motion(belief.model, own, about)
    none = OtherFrame(
        frozen(motion[:3]), frozen(motion[3:]), frozen(np.zeros(3)), size, 0.0, 0.0, 1.0,
        own.n_poses, at_tool=False, station=station,
    )  # fmt: skip
    if not np.isfinite(belief.misfit.upper):
        return replace(none, unshown=True)
    alone = after_the_motion(none, belief, own, identification, train, both=False)
    return replace(alone, unshown=True)


def after_the_motion(
    found: OtherFrame, belief: Belief, held_out: Measurements, identification: Identification,
    train: Measurements, *, both: bool = True,
) -> OtherFrame:  # fmt: skip
    """The same motion, and what it leaves: of station or target, else of both together.

    Parameters
    ----------
    found : OtherFrame
        Of some of the held-out rows.
    belief : Belief
        What is believed without the held-out rows.
    held_out, identification, train
        As `other_frame` takes them.
    both : bool
        Whether both together are tried at all.

    References
    ----------
    Chi-square of the rest at its generalized least squares, with the covariance of `other_frame`
    and the largest misfit; the motion itself is taken off whole, so that a large turn leaves none.
    """
    points = held_out.rows(~held_out.is_distance & (held_out.station == found.station))
    p = predicted_positions(belief.model, points)
    about = p.mean(axis=0)
    base, tool = np.split(motions_of(belief.model, points, about)[:, :3], [6], axis=2)
    applied = belief.proven.applies(points.q, points.conditions)
    size = belief.misfit.upper * float(np.sqrt(np.maximum(applied.growth, 1.0).mean()))

    def left(station: bool, target: bool) -> OtherFrame:
        rest = rest_of(points.position, p, tool, station=station, target=target)
        shared, error, of_base, of_tool = asked(
            belief, points, size, about, (rest, base, tool), identification, train
        )
        motion = np.concatenate([of_base] * station + [of_tool] * target, axis=1)
        square, rank = chi_square(shared, error, motion)
        p_rest = float(chdtrc(max(error.size - rank, 1), square))
        errors = rms_length(points.position - p)
        return replace(
            found, errors=errors, rest=rms_length(rest), p_rest=p_rest, both=station and target
        )

    alone = left(not found.at_tool, found.at_tool)
    whole = alone if alone.found or not both else left(True, True)
    return whole if whole.found else alone
