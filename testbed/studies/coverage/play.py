"""Does the stated uncertainty hold? Many robots of each kind, calibrated, validated and judged.

Poses of one robot share its parameter error, so the robot is the unit. Robot k of every kind is
drawn from the same random numbers and meets the same noise and the same validation and judging
poses; all of it comes from streams of its own. Only the judge here sees the truth; what a statement
says comes from what the tracker saw.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib.arrays import Array, Index
from calib.identification.identify import Identification, identify
from calib.identification.ladders import ladders_of
from calib.identification.least_squares import Status
from calib.identification.model_choice import choose
from calib.measurement.accuracy import point_distances
from calib.measurement.observations import Measurements
from calib.uncertainty.covariance import standard_uncertainty
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.regions import mahalanobis_squared
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.conditions import Conditions, departure
from calib.uncertainty.tool_point import tool_statement
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import Setting, validation_start
from testbed.laboratory.truth.terms import UnmodelledTerms
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.coverage.kinds import Use, apart, drawn, in_random_order, remembering
from testbed.studies.coverage.settings import CoverageSettings
from testbed.studies.coverage.study import CoverageStudy
from testbed.studies.many_robots import alone, together
from testbed.studies.trial.compare import true_step
from testbed.studies.trial.records import Trial
from testbed.studies.trial.statement.sources import (
    systematic_covariance,
    systematic_reach,
    unmodelled_effects,
)

EXACT = 1e-9
"""A model that repeats the noise-free truth this well holds it [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredRobot:
    """One robot in the laboratory: what the tracker saw, and the secret that judges."""

    seen: Measurements
    """Of the identification poses."""
    validation: Measurements
    """Of poses drawn as the pool is, its own and no other's."""
    judge_q: Array
    """(t, n) further such poses, never measured [rad, m]."""
    true: Array
    """(t, 3) the secret: noise-free tool points there [m]."""
    laboratory: Laboratory
    """With this robot."""
    use: Use
    """Where and how it is used."""


OF_A_MODEL = (
    *("inside", "radius", "p_value", "held_out_p", "flagged", "believed", "converged"),
    *("mean_error", "growth", "p_drift"),
)
OF_A_ROBOT = ("extended", "log_evidence", "before", "normal_error", "nees")
AXES = dict.fromkeys((*OF_A_MODEL, *OF_A_ROBOT), -1)


def play_robots(
    scenario: Scenario, setting: Setting, kinds: Sequence[str], trial: Trial, robots: range
) -> dict[str, CoverageStudy]:
    """Play a trial's pose set on some robots of each kind."""
    laboratory = open_laboratory(scenario, setting)
    chosen = trial.selection.indices
    return {
        kind: gather([play_robot(laboratory, kind, chosen, k) for k in robots]) for kind in kinds
    }


def gather(parts: Sequence[CoverageStudy]) -> CoverageStudy:
    """The robots of all parts; numbers that one of them cannot hold are judged on none."""
    if not all(part.names for part in parts):
        parts = [
            replace(part, names=(), normal_error=np.zeros((0, len(part.before))), nees=np.zeros(0))
            for part in parts
        ]
    return replace(together(parts, AXES), names=parts[-1].names)


def play_robot(laboratory: Laboratory, truth: str, chosen: Index, robot: int) -> CoverageStudy:
    """Calibrate, validate and judge one robot."""
    scenario, nominal = laboratory.scenario, laboratory.setting.nominal
    measured = measure_robot(laboratory, truth, chosen, robot)
    fits, evidence, extended = models(measured)
    judged = [judge_model(fit, measured, scenario.table(CoverageSettings).level) for fit in fits]
    normal_error, nees = parameter_errors(fits[0], measured) or (np.zeros(0), np.nan)
    return CoverageStudy(
        truth=truth,
        level=scenario.table(CoverageSettings).level,
        judged=scenario.test.poses,
        names=fits[0].names if len(normal_error) else (),
        **alone(
            AXES,
            extended=extended,
            log_evidence=evidence,
            before=point_distances(measured.true, nominal.poses(measured.judge_q)[:, :3, 3]).mean(),
            normal_error=normal_error,
            nees=nees,
            **{name: [one[name] for one in judged] for name in OF_A_MODEL},
        ),
    )


def measure_robot(laboratory: Laboratory, truth: str, chosen: Index, robot: int) -> MeasuredRobot:
    """Draw robot number `robot` of one kind and measure it; every stream has its number.

    Parameters
    ----------
    laboratory : Laboratory
        Of the campaign; its robot is replaced.
    truth : str
        Kind of robot.
    chosen : (m,) array
        Places in the pool of the identification poses.
    robot : int
        From 0.
    """
    use = drawn(laboratory, truth, robot)
    own, scenario = use.laboratory, use.laboratory.scenario
    count, judged = scenario.table(CoverageSettings).validation_poses, scenario.test.poses
    if truth == "shift":
        train_q, validation_q, judge_q = apart(own, robot, (len(chosen), count, judged))
        own = own.with_poses(train_q, judge_q)
        chosen = np.arange(len(train_q))
    else:
        pool = own.candidates().draw(
            stream(scenario.seed, "coverage", "poses", robot),
            size=count + judged,
            exclude=own.pool_q,
        )
        validation_q, judge_q = np.split(pool.q, [count])
    if truth == "drifting":
        chosen = in_random_order(own, chosen, robot)
    seen = own.measure_pool(chosen, "coverage", "identification", robot)
    start, names = validation_start(scenario), ("coverage", "validation", robot)
    validation = own.measure(validation_q, np.arange(count), *names, start=start)
    if truth == "drifting":
        seen, validation = remembering(own, (seen, validation))
    true = use.used.held_out(judge_q)
    if use.one_move:
        rng = stream(scenario.seed, "coverage", "moves", robot)
        true = use.used.truth.poses(judge_q, rng=rng)
    return MeasuredRobot(seen, validation, judge_q, true[:, :3, 3], own, use)


def models(measured: MeasuredRobot) -> tuple[tuple[Identification, ...], float, bool]:
    """Geometric and extended model of a robot, the log evidence, and whether it climbs.

    The geometric one is what is identifiable, without a prior; the extended one is under the weak
    prior. Validation poses have no say in the choice: they would no longer be a test.
    """
    nominal, free = measured.laboratory.setting.nominal, measured.laboratory.free("whitened")
    robot = measured.laboratory.robot
    ladders = ladders_of(nominal, moments=robot.moments, limits=robot.limits)
    choice = choose(nominal, measured.seen, free, ladders=ladders)
    fits = (identify(nominal, measured.seen, free), choice.identifications[1])
    return fits, choice.log_evidence, choice.chosen == "extended"


def judge_model(found: Identification, measured: MeasuredRobot, level: float) -> dict[str, Any]:
    """What one model states at the judging poses, four ways, and which points it holds.

    Names as in `CoverageStudy`.
    """
    own, m = measured.laboratory, len(measured.seen)
    shared = systematic_covariance(own, found, measured.seen)
    covariance = replace(found, covariance=found.covariance + shared).full_covariance
    sd = own.sigma_q if own.sigma_q.any() else None
    bare = tool_statement(found.model, measured.judge_q, covariance, probability=level)
    judgement = judge(
        found,
        measured.validation,
        train=measured.seen,
        probability=level,
        circumstances=Circumstances(
            order=(np.arange(m), m + np.arange(len(measured.validation))),
            shared=replace(found, covariance=shared).full_covariance if shared.any() else None,
            repeatability=sd,
            unmodelled=unmodelled_effects(own, float(np.sqrt(np.mean(bare.point**2)))),
        ),
    )
    seen, ball = judgement.held_out, judgement.conformal
    assert seen is not None  # the scenario asks for enough poses, also for the radius
    assert ball is not None
    wide = tool_statement(
        found.model,
        measured.judge_q,
        covariance,
        discrepancy=judgement.discrepancy,
        probability=level,
    )
    radius = ball.radius + systematic_reach(found, shared, measured.judge_q, level=level)
    error = point_distances(measured.true, bare.position)
    inside, size, believed, growth = judge_region(judgement.belief, measured, sd)
    slow = judgement.drifting
    return {
        "inside": (
            inside,
            float(bare.holds(measured.true).mean()),
            float(wide.holds(measured.true).mean()),
            float((error <= radius).mean()),
        ),
        "radius": (size, bare.mean_radius, wide.mean_radius, radius),
        "p_value": found.p_value,
        "held_out_p": seen.p_value,
        "flagged": judgement.trust.refuted,
        "believed": believed,
        "converged": found.status is Status.CONVERGED,
        "mean_error": float(error.mean()),
        "growth": growth,
        "p_drift": 1.0 if slow is None or slow.void else slow.p_value,
    }


def judge_region(
    belief: Belief | None, measured: MeasuredRobot, sd: Array | None
) -> tuple[float, float, float, float]:
    """Share of points in the believed region, its radius [m], where it is believed, its growth.

    The region is of the mean of many moves, or where single moves are judged, of one: joints come
    back with standard deviations `sd` (n,).
    """
    if belief is None:
        return 0.0, 0.0, 0.0, 1.0
    applies, use, count = belief.proven.applies(measured.judge_q), measured.use, len(measured.true)
    data, there = (Conditions(payload=np.full(count, load)) for load in use.payload)
    other = departure(data, there, count).outside
    has = (applies.place != "outside") & applies.reaches & ~other
    at = has if has.any() else ~has
    growth = applies.growth[at]
    stated = belief.regions(
        measured.judge_q[at], growth=growth, repeatability=sd if use.one_move else None
    )
    inside = stated.holds(measured.true[at]).mean()
    return float(inside), stated.mean_radius, float(has.mean()), float(growth.mean())


def parameter_errors(found: Identification, measured: MeasuredRobot) -> tuple[Array, float] | None:
    """Normalized errors (f,) and NEES of the geometric numbers; None if they cannot hold the truth.

    They cannot where joints or links do what no geometry does, or where numbers that differ are
    held fixed.
    """
    setting, truth = measured.laboratory.setting, measured.laboratory.truth
    if truth.model.joint_errors.coefficients.any() or truth.unmodelled != UnmodelledTerms():
        return None
    step = true_step(setting, found, measured.seen)
    exact = setting.nominal.moved(found.parameters.expand(step))
    if point_distances(exact.poses(measured.judge_q)[:, :3, 3], measured.true).max() > EXACT:
        return None
    wrong = found.step - step
    covariance = found.covariance + systematic_covariance(measured.laboratory, found, measured.seen)
    nees = float(mahalanobis_squared(wrong, covariance))
    return wrong / standard_uncertainty(covariance), nees
