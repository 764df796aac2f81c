"""The statement of a calibration, with the check of linear propagation (JCGM 102).

All of it comes from what the tracker saw; only `attained`, which `comparison` adds, is the truth's.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.identification.identify import Identification
from calib.identification.joint_models import shared_waves
from calib.identification.lack_of_fit import LackOfFit
from calib.identification.outlier_search import search_outliers
from calib.measurement.observations import Measurements, joined
from calib.uncertainty.adaptive import adaptive
from calib.uncertainty.bootstrap import Bootstrap
from calib.uncertainty.conformal import Conformal, fewest_poses
from calib.uncertainty.covariance import correlated_draws
from calib.uncertainty.discrepancy import FEWEST
from calib.uncertainty.judgement import judge
from calib.uncertainty.tool_point import propagate, tool_statement
from calib.uncertainty.validation import LinearCheck, validate
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.streams import stream
from testbed.studies.trial.compare import attained
from testbed.studies.trial.estimator import Estimator
from testbed.studies.trial.statement.outliers import outlier_sentences, without_gross_errors
from testbed.studies.trial.statement.records import LEVEL, Replayed, Statement, Validation
from testbed.studies.trial.statement.sources import drift_left, full_covariance, sources_of

DRIFT_COUNTS = 1 / 3
"""Part of the stated u from which drift counts: below it u grows by 5 % at most."""


def state(
    bench: Laboratory,
    estimator: Estimator,
    found: Identification,
    visits: list[Measurements],
    validation: Validation,
    name: str,
) -> Statement:
    """Weigh what may be said of the tool point after one calibration.

    Parameters
    ----------
    bench : Laboratory
        The laboratory.
    estimator : Estimator
        What was fitted.
    found : Identification
        From the first visit.
    visits : list of Measurements
        All visits of the trial's poses.
    validation : Validation
        The held-out poses, measured.
    name : str
        Of the trial: the bootstrap and the Monte Carlo draw from streams named after it.
    """
    q, seed = bench.setting.test_q, bench.scenario.seed
    search = search_outliers(estimator.nominal, found, visits[0])
    outliers = np.sort(search.rows)
    gross = outliers if found.loss != "squared" else outliers[:0]
    sources = sources_of(bench, found, visits[0], gross, q)
    shots, aside = without_gross_errors(found, validation.seen, visits[0])
    total = full_covariance(found, found.covariance + sources.systematic)
    linear, worst = linear_check(
        found, total, q, bench.setting.target, stream(seed, "statement", "linear", name)
    )
    lack = misfit(estimator, found, visits)
    judgement = judge(
        replace(found, lack_of_fit=lack),
        shots,
        train=visits[0],
        probability=LEVEL,
        rng=stream(seed, "statement", "bootstrap", name),
        rejected_too=True,
        linear=linear,
        unmodelled=left_out(bench, sources.combined),
    )
    seen, beyond, ball = judgement.held_out, judgement.discrepancy, judgement.conformal
    assert seen is not None  # the tracker sees poses or points, never distances
    replayed = judgement.bootstrap
    at_judges = partial(
        tool_statement, found.model, validation.judge_q, target=target_or_origin(bench)
    )
    hidden = hidden_reach(found, sources.systematic, validation.judge_q, target_or_origin(bench))
    stated = {"model": at_judges(total)}
    if replayed is not None:
        stated["bootstrap"] = at_judges(
            full_covariance(found, replayed.empirical + sources.systematic)
        )
    if beyond is not None:
        stated["discrepancy"] = at_judges(total, discrepancy=beyond)
    radius = {name: one.mean_radius for name, one in stated.items()}
    if ball is not None:
        radius["conformal"] = ball.radius + hidden
    return Statement(
        model="extended" if estimator.extended else "geometric",
        why=estimator.why,
        log_evidence=estimator.log_evidence,
        outliers=outlier_sentences(search, visits[0]),
        outlier_poses=visits[0].pose_id[outliers],
        set_aside=aside,
        lack_of_fit=lack,
        held_out=seen,
        discrepancy=beyond,
        conformal=ball,
        bootstrap=None if replayed is None else summary(replayed),
        linear=linear,
        linear_pose=worst,
        sources=sources.names,
        source_u=sources.at_tool,
        combined_u=sources.combined,
        discrepancy_u=float("nan") if beyond is None else root_trace(beyond.covariance),
        systematic=sources.systematic,
        trust=judgement.trust,
        names=tuple(radius),
        radius=np.array(list(radius.values())),
        attained=attained(validation, tuple(stated.values()), radius.get("conformal")),
        warnings=(*too_few(len(seen)), *notes(found, len(outliers), aside, hidden, ball)),
    )


def hidden_reach(
    found: Identification,
    systematic: Array,
    q: Array,
    target: Array | None = None,
    *,
    level: float = LEVEL,
) -> float:
    """How far the tracker's systematic part reaches at postures q (N, n), on average [m]."""
    if not systematic.any():
        return 0.0
    common = full_covariance(found, systematic)
    stated = tool_statement(found.model, q, common, target=target, probability=level)
    return float(stated.region[0][:, 0].mean())


def left_out(bench: Laboratory, u: float) -> tuple[str, ...]:
    """What is known to be wrong and in no covariance, where it counts beside a stated u [m]."""
    left = drift_left(bench)
    if left <= DRIFT_COUNTS * u:
        return ()
    return (
        f"the station wanders, which no stated covariance contains: about {1e6 * left:.0f} um stay "
        "in the readings between two rounds over the nests",
    )


def target_or_origin(bench: Laboratory) -> Array | None:
    """The tool point that is stated; None where it is the origin of the tool frame."""
    target = bench.setting.target
    return target if target.any() else None


def root_trace(covariance: Array) -> float:
    """3-D standard uncertainty [m] of a covariance (3, 3)."""
    return float(np.sqrt(np.trace(covariance)))


def too_few(n: int) -> tuple[str, ...]:
    """What n held-out poses are too few to state.

    A warning, not an error: the calibration itself is as good as before.
    """
    need = fewest_poses(LEVEL)
    told = []
    if n < need:
        told.append(
            f"too few held-out poses were measured ({n}) for a {100 * LEVEL:g} % radius that needs "
            f"no model of the error: {need} are the fewest; write [test] poses = {need} or more"
        )
    if n < FEWEST:
        told.append(
            f"too few held-out poses were measured ({n}) to show a discrepancy: {FEWEST} are the "
            "fewest for a covariance"
        )
    return tuple(told)


def summary(found: Bootstrap) -> Replayed:
    """The figures of a bootstrap that are kept."""
    worst = found.ratio[np.argmax(np.abs(found.ratio - 1))]
    bias = found.bias[np.argmax(np.abs(found.bias))]
    return Replayed(found.replicates, found.agrees, float(worst), float(bias), found.sentence)


def misfit(
    estimator: Estimator, found: Identification, visits: list[Measurements]
) -> LackOfFit | None:
    """All visits fitted together, to see whether the model misses more than repeats scatter."""
    if found.loss != "squared" or len(visits) < 2:
        return None
    return estimator.fit(joined(visits), found.parameters).lack_of_fit


def notes(
    found: Identification,
    outliers: int,
    aside: Index,
    hidden: float,
    ball: Conformal | None,
) -> tuple[str, ...]:
    """What else a reader must know; `hidden` is the reach of the tracker's systematic part [m]."""
    told = []
    if outliers and found.loss == "squared":
        some = "a shot" if outliers == 1 else f"{outliers} shots"
        told.append(
            f"{some} of the calibration may pull at the result; measure again what does not fit, "
            'or write loss = "cauchy" in [identification]'
        )
    if len(aside):
        told.append(
            f"the shots of held-out poses {', '.join(str(k) for k in aside)} were grossly wrong "
            "and are set aside; measure them again"
        )
    if hidden > 0 and ball is not None:
        told.append(
            "what the tracker gets wrong the same way in both visits shows at no held-out pose: "
            f"{1e6 * hidden:.0f} um for it are added to the conformal radius in the table"
        )
    if found.prior is not None:
        told.append(
            "the estimate rests on a prior as well: its intervals hold over robots like those that "
            "the prior describes, not over repeats of one"
        )
    return (*told, *shared_waves(found))


FLAT = 1e-9
"""Part of the largest variance below which a direction does not scatter: few numbers are free."""
DIGITS = 1
"""Digits of a stated uncertainty that linear propagation must get right; each more takes a hundred
times the draws."""


def linear_check(
    found: Identification, covariance: Array, q: Array, target: Array, rng: np.random.Generator
) -> tuple[LinearCheck, int]:
    """First-order propagation against Monte Carlo, at the posture with the largest stated u.

    References
    ----------
    JCGM 102:2011, clause 8.
    """
    linear = tool_statement(found.model, q, covariance, target=target)
    worst = int(np.argmax(linear.point))
    there = q[worst : worst + 1]

    def sample(count: int, rng: np.random.Generator) -> Array:
        """Points of the target under moved models."""
        steps = correlated_draws(covariance, count, rng)
        return moved_targets(found.model, there, steps, target)[:, 0] @ axes

    axes = moving_axes(linear.covariance[worst])
    played = adaptive(sample, rng, digits=DIGITS, probability=LEVEL, finer=5.0)
    check = validate(
        linear.position[worst] @ axes,
        axes.T @ linear.covariance[worst] @ axes,
        played,
        digits=DIGITS,
    )
    share = float((check.differences / check.tolerance).max())
    said = (
        f"first-order propagation is {check.outcome}: against {played.draws} Monte Carlo draws at "
        f"the held-out pose with the largest uncertainty, means, uncertainties and region differ "
        f"by at most {share:.2g} of what {DIGITS} digit of u allows"
    )
    return replace(check, sentence=said), worst


def moved_targets(model: RobotModel, q: Array, steps: Array, target: Array) -> Array:
    """Points (M, N, 3) of a target (3,) on the tool under M moved models [m].

    A tool frame that moves by t and turns by R carries the target to t + R target in the old frame:
    the tool point of a frame that moves by that much.
    """
    if target.any():
        end, steps = model.chain.n_numbers, steps.copy()
        steps[:, end - 6 : end - 3] += exp_so3(steps[:, end - 3 : end]) @ target
    return propagate(model, q, steps)


def moving_axes(covariance: Array) -> Array:
    """Directions (3, k) in which a point scatters at all: world axes unless it lies in a plane."""
    values, vectors = np.linalg.eigh(covariance)
    flat = values <= FLAT * values[-1]
    return np.eye(3) if not flat.any() else np.asarray(vectors[:, ~flat])
