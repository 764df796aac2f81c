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
from calib.identification.least_squares import Status
from calib.identification.model_choice import choose
from calib.measurement.accuracy import point_distances
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
from testbed.laboratory.truth.terms import UnmodelledTerms
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.coverage.settings import CoverageSettings
from testbed.studies.coverage.study import STATEMENTS, CoverageStudy
from testbed.studies.many_robots import TruthName, alone, together, truth_of_kind
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


OF_A_MODEL = (
    *("inside", "radius", "p_value", "held_out_p", "flagged", "believed", "converged"),
    "mean_error",
)
OF_A_ROBOT = ("extended", "log_evidence", "before", "normal_error", "nees")
AXES = dict.fromkeys((*OF_A_MODEL, *OF_A_ROBOT), -1)


def play_robots(
    scenario: Scenario, setting: Setting, truth: TruthName, trial: Trial, robots: range
) -> CoverageStudy:
    """Play a trial's pose set on some robots of one kind."""
    laboratory = open_laboratory(scenario, setting)
    chosen = trial.selection.indices
    return gather([play_robot(laboratory, truth, chosen, k) for k in robots])


def gather(parts: Sequence[CoverageStudy]) -> CoverageStudy:
    """The robots of all parts; numbers that one of them cannot hold are judged on none."""
    if not all(part.names for part in parts):
        parts = [
            replace(part, names=(), normal_error=np.zeros((0, len(part.before))), nees=np.zeros(0))
            for part in parts
        ]
    return replace(together(parts, AXES), names=parts[-1].names)


def play_robot(
    laboratory: Laboratory, truth: TruthName, chosen: Index, robot: int
) -> CoverageStudy:
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


def measure_robot(
    laboratory: Laboratory, truth: TruthName, chosen: Index, robot: int
) -> MeasuredRobot:
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
    scenario = laboratory.scenario
    own = laboratory.with_robot(truth_of_kind(scenario, truth), "coverage", "robot", robot)
    count = scenario.table(CoverageSettings).validation_poses
    pool = own.candidates().draw(
        stream(scenario.seed, "coverage", "poses", robot),
        size=count + scenario.test.poses,
        exclude=own.pool_q,
    )
    validation_q, judge_q = np.split(pool.q, [count])
    return MeasuredRobot(
        seen=own.measure_pool(chosen, "coverage", "identification", robot),
        validation=own.measure(
            validation_q,
            np.arange(count),
            "coverage",
            "validation",
            robot,
            start=validation_start(scenario),
        ),
        judge_q=judge_q,
        true=own.held_out(judge_q)[:, :3, 3],
        laboratory=own,
    )


def models(measured: MeasuredRobot) -> tuple[tuple[Identification, ...], float, bool]:
    """Geometric and extended model of a robot, the log evidence, and whether it climbs.

    The geometric one is what is identifiable, without a prior; the extended one is under the weak
    prior. Validation poses have no say in the choice: they would no longer be a test.
    """
    nominal, free = measured.laboratory.setting.nominal, measured.laboratory.free("whitened")
    choice = choose(nominal, measured.seen, free)
    fits = (identify(nominal, measured.seen, free), choice.identifications[1])
    return fits, choice.log_evidence, choice.chosen == "extended"


def judge_model(found: Identification, measured: MeasuredRobot, level: float) -> dict[str, Any]:
    """What one model states at the judging poses, three ways, and which points it holds.

    Names as in `CoverageStudy`.
    """
    shared = systematic_covariance(measured.laboratory, found, measured.seen)
    covariance = replace(found, covariance=found.covariance + shared).full_covariance
    bare = tool_statement(found.model, measured.judge_q, covariance, probability=level)
    judgement = judge(
        found,
        measured.validation,
        train=measured.seen,
        probability=level,
        unmodelled=unmodelled_effects(measured.laboratory, float(np.sqrt(np.mean(bare.point**2)))),
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
    verdict = judgement.trust
    return {
        "inside": (
            float(bare.holds(measured.true).mean()),
            float(wide.holds(measured.true).mean()),
            float((error <= radius).mean()),
        ),
        "radius": (bare.mean_radius, wide.mean_radius, radius),
        "p_value": found.p_value,
        "held_out_p": seen.p_value,
        "flagged": not verdict.model_valid,
        "believed": STATEMENTS.index(verdict.believe) if verdict.believe in STATEMENTS else -1,
        "converged": found.status is Status.CONVERGED,
        "mean_error": float(error.mean()),
    }


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
