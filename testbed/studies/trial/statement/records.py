"""What is stated of a calibration, and the visit of the held-out poses on which that rests."""

from dataclasses import dataclass
from math import isnan
from typing import Annotated

from calib.arrays import LATER, Array, Bool, FloatOrNan, Index
from calib.identification.climbing import ClimbStep, Offer
from calib.identification.lack_of_fit import LackOfFit
from calib.measurement.observations import Measurements
from calib.shown import Shown
from calib.uncertainty.conformal import Conformal
from calib.uncertainty.discrepancy import Discrepancy
from calib.uncertainty.held_out import HeldOut
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.drifting import Drifting
from calib.uncertainty.statement.other_frame import OtherFrame
from calib.uncertainty.statement.questions import Questions
from calib.uncertainty.statement.stated_point import StatedPoint
from calib.uncertainty.trust import Trust
from calib.uncertainty.validation import LinearCheck

LEVEL = 0.95
"""Content that every statement promises."""
BELIEVED = ("region", "move")
"""Statements that are believed; the others stand beside them."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Validation(Shown):
    """The held-out poses, measured once after the trials; and the secret that judges statements."""

    seen: Measurements
    """One visit of the held-out poses, in their order; missed shots have no row."""
    judge_q: Annotated[Array, "j", "n"]
    """(j, n) further poses drawn as the pool is, never measured [rad, m]."""
    judge_true: Annotated[Array, "j", 3]
    """(j, 3) secret: noise-free true points there of the tool point that is judged [m]."""
    judge_moved: Annotated[Array, "j", 3]
    """(j, 3) secret: where one move to each of them ends [m]."""
    terms: Annotated[tuple[str, ...], "k"]
    """(k,) terms of the truth that are switched on."""
    term_rms: Annotated[Array, "k"]
    """(k,) secret: root mean square displacement of the tool at the held-out poses by each term
    alone [m]."""
    together_rms: float
    """The same by all of them at once [m]."""
    interaction_rms: float
    """Of what they do together beyond the sum of each alone [m]."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """What the end-to-end bootstrap said."""

    replicates: int
    """Virtual calibrations of the identified robot."""
    agrees: bool
    """Whether they scatter as the stated covariance says."""
    worst: float
    """Ratio of replicated to stated standard deviation that is farthest from 1."""
    bias: float
    """Largest mean error in stated standard deviations."""
    sentence: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Statement(Shown):
    """What the default estimator's result may be trusted with, and why."""

    model: str
    """geometric or extended: what was fitted."""
    why: str
    """Which model and why, in words."""
    log_evidence: FloatOrNan
    """Log odds of the extended model; nan where the evidence was not asked."""
    offered: tuple[Offer, ...]
    """Joint errors that were offered to the model, and what became of them."""
    steps: tuple[ClimbStep, ...]
    """How the choice went, level by level."""
    outliers: tuple[str, ...]
    """Shots of the calibration that do not fit the others, by name of the pose."""
    outlier_poses: Index
    """Their poses in the pool."""
    set_aside: Index
    """Held-out poses whose shot is grossly wrong and was set aside; only under a robust loss."""
    lack_of_fit: LackOfFit | None
    """All visits fitted together: misfit against the scatter of repeats; None without repeats or
    with a robust loss."""
    held_out: HeldOut
    """Errors of the measured held-out poses, and what was predicted for them."""
    belief: Belief | None
    """What is believed, wherever it is asked for; None where nothing can be believed."""
    point: StatedPoint | None
    """The same as one radius, at poses like the held-out ones."""
    questions: Questions
    """Tests, together."""
    frame: OtherFrame | None
    """Whether the held-out readings stand in another frame; None where too few were measured."""
    drifting: Drifting | None
    """Whether the noise remembers; None for distances or a handful of rows."""
    discrepancy: Discrepancy | None
    conformal: Conformal | None
    bootstrap: Replayed | None
    """None with a robust loss or a prior, which it does not play."""
    linear: LinearCheck
    """Whether first-order propagation holds, at the held-out pose with the largest stated u."""
    linear_pose: int
    """That pose, from 0."""
    sources: Annotated[tuple[str, ...], "s"]
    """(s,) sources of uncertainty."""
    source_u: Annotated[Array, "s"]
    """(s,) 3-D standard uncertainty that each leaves at the tool, RMS over held-out poses [m]."""
    combined_u: float
    """All of them together: the parameters alone [m]."""
    larger_noise_u: float
    """What repeats or angles ask for beyond the stated noise, at the tool; zero for nothing [m]."""
    drift_u: float
    """What a drift may leave there; zero where none is in the region [m]."""
    misfit_u: float
    """The same of the largest misfit up to its limit; zero where nothing is believed [m]."""
    discrepancy_u: FloatOrNan
    """What held-out poses show beyond that [m]; nan where it was not estimated."""
    systematic: Annotated[Array, "f", "f"]
    """(f, f) covariance that the tracker's systematic errors leave in the estimate; zero where it
    states none [m, rad]."""
    trust: Trust
    names: Annotated[tuple[str, ...], "w"]
    """(w,) statements made: region, move, parameters, bootstrap, discrepancy, conformal."""
    radius: Annotated[Array, "w"]
    """(w,) 3-D radius that holds the tool point with `LEVEL` at poses like the held-out ones; the
    conformal one with what the tracker hides from these [m]."""
    attained: Annotated[Array, "w"]
    """(w,) secret: share of true tool points inside, at the judging poses; of the region of one
    move, share of single moves that end inside."""
    honest: FloatOrNan
    """Least share at the judging poses that 999 of 1000 robots would have if the believed region
    is honest; nan where nothing is believed."""
    inside: Annotated[Bool, "t"]
    """(t,) secret: true held-out tool point inside the believed region; none inside without
    one."""
    warnings: tuple[str, ...]
    """What could not be stated, and what to do about it."""
    levels: Annotated[str, LATER] = ""
    """By which levels of joint errors the model is extended, as `why` says it."""
    because: Annotated[str, LATER] = ""
    """Why it was fitted, as `why` says it."""


SUMS = (
    "parameters alone", "noise beyond the stated", "drift", "misfit up to its limit", "believed",
    "discrepancy",
)  # fmt: skip
"""Lines of the budget below the sources, in their order."""


def sums_of(statement: Statement) -> dict[str, float]:
    """Lines of the budget below the sources, 3-D standard uncertainty at the tool [m].

    The parameters alone are the sum of the sources; what is believed is the sum of these, of noise
    that repeats show beyond the stated one, of drift and of the misfit up to its limit, times the
    factor of the region over that of chi-square. The discrepancy stands beside it.
    """
    lines = {"parameters alone": statement.combined_u}
    if statement.larger_noise_u:
        lines["noise beyond the stated"] = statement.larger_noise_u
    if statement.drift_u:
        lines["drift"] = statement.drift_u
    if statement.point is not None:
        lines["misfit up to its limit"] = statement.misfit_u
        lines["believed"] = statement.point.u_mean
    if not isnan(statement.discrepancy_u):
        lines["discrepancy"] = statement.discrepancy_u
    return lines
