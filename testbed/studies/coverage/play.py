"""Does the stated uncertainty hold? Many robots of each kind, calibrated, validated and judged.

Poses of one robot share its parameter error, so the robot is the unit. Robot k of every kind is
drawn from the same random numbers and meets the same noise and the same validation and judging
poses; all of it comes from streams of its own. Only the judge here sees the truth; what a statement
says comes from what the tracker saw.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification, identify
from calib.identification.least_squares import Status
from calib.identification.model_choice import choose
from calib.measurement.accuracy import distances
from calib.measurement.observations import Measurements
from calib.uncertainty.covariance import standard_uncertainty
from calib.uncertainty.judgement import judge
from calib.uncertainty.regions import mahalanobis_squared
from calib.uncertainty.tool_point import tool_statement
from testbed.laboratory.truth.laboratory import (
    Laboratory,
    Setting,
    open_laboratory,
    validation_start,
)
from testbed.laboratory.truth.robot import draw_truth
from testbed.scenario.read import Scenario
from testbed.streams import stream
from testbed.studies.coverage.records import MODELS, STATEMENTS, CoverageStudy
from testbed.studies.many_robots import TruthName, truth_of_kind
from testbed.studies.trial.compare import true_step
from testbed.studies.trial.records import Trial
from testbed.studies.trial.statement.sources import full_covariance, systematic_covariance
from testbed.studies.trial.statement.state import hidden_reach, left_out

EXACT = 1e-9
"""A model that repeats the noise-free truth this well holds it [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Visit:
    """One robot in the laboratory: what the tracker saw, and the secret that judges."""

    seen: Measurements
    """Of the identification poses."""
    validation: Measurements
    """Of poses drawn as the pool is, its own and no other's."""
    judge_q: Array
    """(t, n) further such poses, never measured [rad, m]."""
    true: Array
    """(t, 3) the secret: noise-free tool points there [m]."""
    bench: Laboratory
    """Its laboratory."""


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """One model of one robot: what it states, against the truth."""

    inside: tuple[float, ...]
    """(3,) share of held-out points inside, per statement."""
    radius: tuple[float, ...]
    """(3,) mean volume-equivalent radius [m]."""
    p_value: float
    held_out_p: float
    flagged: bool
    believed: int
    converged: bool
    mean_error: float


def coverage_study(
    scenario: Scenario, setting: Setting, truth: TruthName, get: Callable[[str], Any]
) -> CoverageStudy:
    """Play the first trial's pose set on `coverage.robots` robots of one kind."""
    first: Trial = get(scenario.trial[0].name)
    bench, count = open_laboratory(scenario, setting), scenario.coverage.robots
    free = bench.free("whitened")
    judged: list[tuple[Judged, ...]] = []
    numbers: list[tuple[Array, float] | None] = []
    extended, evidence, before = np.zeros(count, dtype=bool), np.zeros(count), np.zeros(count)
    names: tuple[str, ...] = ()
    for k in range(count):
        visit = visit_robot(bench, truth, first.selection.indices, k)
        fits, evidence[k], extended[k] = models(visit, free)
        judged.append(tuple(judge_model(fit, visit, scenario.coverage.level) for fit in fits))
        nominal = setting.nominal.poses(visit.judge_q)[:, :3, 3]
        before[k] = distances(visit.true, nominal).mean()
        numbers.append(parameter_errors(fits[0], visit))
        names = fits[0].names
    held = [found for found in numbers if found is not None]
    inside = len(held) == count
    return CoverageStudy(
        truth=truth,
        level=scenario.coverage.level,
        judged=scenario.test.poses,
        inside=np.array([[one.inside for one in row] for row in judged]).transpose(1, 2, 0),
        radius=np.array([[one.radius for one in row] for row in judged]).transpose(1, 2, 0),
        p_value=per_model(judged, "p_value"),
        held_out_p=per_model(judged, "held_out_p"),
        flagged=per_model(judged, "flagged"),
        believed=per_model(judged, "believed"),
        converged=per_model(judged, "converged"),
        extended=extended,
        log_evidence=evidence,
        before=before,
        mean_error=per_model(judged, "mean_error"),
        names=names if inside else (),
        normal_error=np.array([z for z, _ in held]).T if inside else np.zeros((0, count)),
        nees=np.array([nees for _, nees in held]) if inside else np.zeros(0),
    )


def visit_robot(bench: Laboratory, truth: TruthName, chosen: Index, robot: int) -> Visit:
    """Draw robot number `robot` of one kind and measure it; every stream has its number.

    Parameters
    ----------
    bench : Laboratory
        The campaign's own laboratory; its robot is replaced.
    truth : str
        Kind of robot.
    chosen : (m,) array
        Places in the pool of the identification poses.
    robot : int
        From 0.
    """
    scenario, setting = bench.scenario, bench.setting
    seed = int(stream(scenario.seed, "coverage", "robot", robot).integers(2**62))
    drawn = draw_truth(bench.robot, truth_of_kind(scenario, truth), seed)
    own = bench.with_robot(drawn, seed)
    count = scenario.coverage.validation_poses
    q = (
        own.candidates()
        .draw(
            stream(scenario.seed, "coverage", "poses", robot),
            size=count + scenario.test.poses,
            exclude=setting.pool_q,
        )
        .q
    )
    return Visit(
        seen=own.measure_pool(chosen, "coverage", "identification", robot),
        validation=own.measure(
            q[:count],
            np.arange(count),
            "coverage",
            "validation",
            robot,
            start=validation_start(scenario),
        ),
        judge_q=q[count:],
        true=own.held_out(q[count:])[:, :3, 3],
        bench=own,
    )


def models(visit: Visit, free: Parameters) -> tuple[tuple[Identification, ...], float, bool]:
    """Geometric and extended model of a robot, the log evidence, and whether it climbs.

    The geometric one is what is identifiable, without a prior; the extended one is under the weak
    prior. Validation poses have no say in the choice: they would no longer be a test.
    """
    nominal = visit.bench.setting.nominal
    choice = choose(nominal, visit.seen, free)
    fits = (identify(nominal, visit.seen, free), choice.identifications[1])
    return fits, choice.log_evidence, choice.chosen == "extended"


def judge_model(found: Identification, visit: Visit, level: float) -> Judged:
    """What one model states at the judging poses, three ways, and which points it holds."""
    shared = systematic_covariance(visit.bench, found, visit.seen)
    covariance = full_covariance(found, found.covariance + shared)
    bare = tool_statement(found.model, visit.judge_q, covariance, probability=level)
    judgement = judge(
        found,
        visit.validation,
        train=visit.seen,
        probability=level,
        unmodelled=left_out(visit.bench, float(np.sqrt(np.mean(bare.point**2)))),
    )
    seen, ball = judgement.held_out, judgement.conformal
    assert seen is not None  # the scenario asks for enough poses, also for the radius
    assert ball is not None
    wide = tool_statement(
        found.model,
        visit.judge_q,
        covariance,
        discrepancy=judgement.discrepancy,
        probability=level,
    )
    radius = ball.radius + hidden_reach(found, shared, visit.judge_q, level=level)
    error = distances(visit.true, bare.position)
    verdict = judgement.trust
    return Judged(
        inside=(
            float(bare.holds(visit.true).mean()),
            float(wide.holds(visit.true).mean()),
            float((error <= radius).mean()),
        ),
        radius=(bare.mean_radius, wide.mean_radius, radius),
        p_value=found.p_value,
        held_out_p=seen.p_value,
        flagged=not verdict.model_valid,
        believed=STATEMENTS.index(verdict.believe) if verdict.believe in STATEMENTS else -1,
        converged=found.status is Status.CONVERGED,
        mean_error=float(error.mean()),
    )


def parameter_errors(found: Identification, visit: Visit) -> tuple[Array, float] | None:
    """Normalized errors (f,) and NEES of the geometric numbers; None if they cannot hold the truth.

    They cannot where joints or links do what no geometry does, or where numbers that differ are
    held fixed.
    """
    setting, truth = visit.bench.setting, visit.bench.truth
    other = (truth.beyond.backlash, truth.beyond.thermal, truth.beyond.springs)
    if truth.model.joint_errors.coefficients.any() or any(one is not None for one in other):
        return None
    step = true_step(setting, found, visit.seen)
    exact = setting.nominal.moved(found.parameters.expand(step))
    if distances(exact.poses(visit.judge_q)[:, :3, 3], visit.true).max() > EXACT:
        return None
    wrong = found.step - step
    covariance = found.covariance + systematic_covariance(visit.bench, found, visit.seen)
    nees = float(mahalanobis_squared(wrong, covariance))
    return wrong / standard_uncertainty(covariance), nees


def per_model(judged: list[tuple[Judged, ...]], name: str) -> Any:
    """One figure of every robot, per model (2, R)."""
    return np.array([[getattr(row[j], name) for row in judged] for j in range(len(MODELS))])
