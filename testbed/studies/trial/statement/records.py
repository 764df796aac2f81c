"""Records of the statements of a calibration, and of the visit of held-out poses behind them."""

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
from calib.uncertainty.drift.drifting import Drifting
from calib.uncertainty.frames.other_frame import OtherFrame
from calib.uncertainty.held_out import HeldOut
from calib.uncertainty.outlying.poses import Strays
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.questions import Questions
from calib.uncertainty.statement.stated_point import StatedPoint
from calib.uncertainty.trust import Trust
from calib.uncertainty.validation import LinearCheck

LEVEL = 0.95
"""Probability that every statement promises."""
BELIEVED = ("region", "move")
"""Believed statements; the others are for comparison."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Validation(Shown):
    """The held-out poses, measured once after the trials, and the truth that judges statements."""

    seen: Measurements
    """One visit of the held-out poses, in their order; missed shots have no row."""
    judge_q: Annotated[Array, "j", "n"]
    """(j, n) judging poses, drawn like the pool and never measured [rad, m]."""
    judge_true: Annotated[Array, "j", 3]
    """(j, 3) truth: noise-free positions of the judged tool point there [m]."""
    judge_moved: Annotated[Array, "j", 3]
    """(j, 3) truth: its position after one move to each of them [m]."""
    terms: Annotated[tuple[str, ...], "k"]
    """(k,) terms of the truth that are switched on."""
    term_rms: Annotated[Array, "k"]
    """(k,) truth: root mean square displacement of the tool at the held-out poses by each term
    alone [m]."""
    together_rms: float
    """The same by all terms at once [m]."""
    interaction_rms: float
    """Root mean square difference between that and the sum of each alone [m]."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """Result of the end-to-end bootstrap."""

    replicates: int
    """Number of virtual calibrations of the identified robot."""
    agrees: bool
    """Whether they scatter according to the stated covariance."""
    worst: float
    """Ratio of replicated to stated standard deviation that is farthest from 1."""
    bias: float
    """Largest mean error in stated standard deviations."""
    sentence: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Statement(Shown):
    """Statements of the default estimator's result, and the evidence for them."""

    model: str
    """The fitted model, geometric or extended."""
    why: str
    """Which model and why, in words."""
    log_evidence: FloatOrNan
    """Log odds of the extended model; nan if the evidence was not computed."""
    offered: tuple[Offer, ...]
    """Joint errors on offer for the model, and the outcome of each."""
    steps: tuple[ClimbStep, ...]
    """Steps of the choice, level by level."""
    outliers: tuple[str, ...]
    """A sentence for each reading of the calibration that does not fit the others, or one that says
    that there are too many."""
    outlier_poses: Annotated[Index, "k"]
    """(k,) poses of these readings in the pool; none if there are too many."""
    set_aside: Annotated[Index, "h"]
    """(h,) held-out poses with a gross error that were set aside; only with a robust loss."""
    lack_of_fit: LackOfFit | None
    """All visits fitted together: misfit against the scatter of repeats; None without repeats or
    with a robust loss."""
    held_out: HeldOut
    """Errors at the measured held-out poses, and those predicted."""
    belief: Belief | None
    """The believed region at any posture; None if nothing can be believed."""
    point: StatedPoint | None
    """The believed region as one radius, at poses like the held-out ones."""
    questions: Questions
    """All tests together."""
    frame: OtherFrame | None
    """Test for held-out readings in another frame; None if too few were measured."""
    drifting: Drifting | None
    """Test for noise with memory; None for distances or very few rows."""
    discrepancy: Discrepancy | None
    conformal: Conformal | None
    bootstrap: Replayed | None
    """Result of the bootstrap; None with a robust loss or a prior, which it does not support."""
    linear: LinearCheck
    """Whether first-order propagation holds, at the held-out pose with the largest stated u."""
    linear_pose: int
    """That pose, from 0."""
    sources: Annotated[tuple[str, ...], "s"]
    """(s,) sources of uncertainty."""
    source_u: Annotated[Array, "s"]
    """(s,) 3-D standard uncertainty at the tool by each source, RMS over held-out poses [m]."""
    combined_u: float
    """Standard uncertainty by all of them: that of the parameters alone [m]."""
    larger_noise_u: float
    """Standard uncertainty by noise beyond the stated one, from repeats or angles; or zero [m]."""
    drift_u: float
    """Standard uncertainty by drift; zero if none is in the region [m]."""
    misfit_u: float
    """Standard uncertainty by the misfit at its upper limit; zero if nothing is believed [m]."""
    discrepancy_u: FloatOrNan
    """Standard uncertainty that held-out poses show beyond that; nan if not estimated [m]."""
    systematic: Annotated[Array, "f", "f"]
    """(f, f) covariance of the estimate by the tracker's systematic errors; zero if it states none
    [m, rad]."""
    trust: Trust
    names: Annotated[tuple[str, ...], "w"]
    """(w,) statements made: region, move, parameters, bootstrap, discrepancy, conformal."""
    radius: Annotated[Array, "w"]
    """(w,) 3-D radius that contains the tool point with probability `LEVEL` at poses like the
    held-out ones; the conformal one includes errors of the tracker that these do not show [m]."""
    attained: Annotated[Array, "w"]
    """(w,) truth: share of true tool points inside, at the judging poses; for the region of one
    move, share of single moves that end inside."""
    honest: FloatOrNan
    """Share at the judging poses that 999 of 1000 robots reach if the believed region is correct;
    nan if nothing is believed."""
    inside: Annotated[Bool, "t"]
    """(t,) truth: whether the held-out tool point is inside the believed region; false without
    one."""
    warnings: tuple[str, ...]
    """What could not be stated, and what to do about it."""
    levels: Annotated[str, LATER] = ""
    """By which levels of joint errors the model is extended, as `why` says it."""
    because: Annotated[str, LATER] = ""
    """Why it was fitted, as `why` says it."""
    strays: Annotated[Strays | None, LATER] = None
    """Held-out poses that stand out where all others agree; they stay in every figure."""


SUMS = (
    "parameters alone", "noise beyond the stated", "drift", "misfit up to its limit", "believed",
    "discrepancy",
)  # fmt: skip
"""Lines of the budget below the sources, in their order."""


def sums_of(statement: Statement) -> dict[str, float]:
    """Lines of the budget below the sources, 3-D standard uncertainty at the tool [m].

    The parameters alone are the sum of the sources. The believed uncertainty is the sum of these,
    of noise beyond the stated one, of drift and of the misfit at its limit, times the factor of the
    region over that of chi-square. The discrepancy is listed separately.
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
