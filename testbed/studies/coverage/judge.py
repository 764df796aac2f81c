"""Four kinds of statements of many robots at their judging poses, and which points these contain.

Robots whose models are alike are judged together over the robot axis, the others one by one. Tests
compare both ways.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.jacobian import joint_columns
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification
from calib.identification.least_squares import Status
from calib.measurement.accuracy import point_distances
from calib.measurement.observations import Measurements
from calib.uncertainty.discrepancy import Discrepancy
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.many.judgements import ManyJudgements, judge_many
from calib.uncertainty.many.sights import alike
from calib.uncertainty.regions import FLAT, coverage_factor, inside
from calib.uncertainty.statement.applicability import Applicability
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.conditions import Conditions
from calib.uncertainty.statement.departure import departure
from calib.uncertainty.tool_point import tool_statement
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.studies.coverage.kinds import Use
from testbed.studies.trial.statement.sources import (
    drift_left,
    systematic_covariance,
    systematic_inputs,
    systematic_reach,
    unmodelled_effects,
)

TOGETHER, ENTRIES = 25, 2**19
"""Most robots in one pass, and most entries of a stack of their covariances: rows, gains and
covariances of a robot with hundreds of free numbers take some 5 MB."""
OF_A_MODEL = (
    *("inside", "radius", "p_value", "held_out_p", "flagged", "believed", "converged"),
    *("mean_error", "growth", "p_drift"),
)


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredRobot:
    """One robot in the laboratory: its measurements, and the truth that judges."""

    seen: Measurements
    """Measurements of the identification poses."""
    validation: Measurements
    """Measurements of poses drawn like the pool, anew for this robot."""
    judge_q: Array
    """(t, n) judging poses, drawn likewise and never measured [rad, m]."""
    true: Array
    """(t, 3) true, noise-free tool points there [m]."""
    laboratory: Laboratory
    """The laboratory with this robot."""
    use: Use
    """Conditions under which the robot is used."""


def judge_models(
    fits: Sequence[Identification], measured: Sequence[MeasuredRobot], level: float
) -> list[dict[str, Any]]:
    """Results of `judge_model` for one model of each robot, with those alike judged at once."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for k, (fit, one) in enumerate(zip(fits, measured, strict=True)):
        if not (systematic_inputs(one.laboratory, one.seen) or drift_left(one.laboratory)):
            key = alike(fit, one.seen, one.validation, level)
            if key is not None:
                groups.setdefault((*key, one.use.one_move), []).append(k)
    found: list[dict[str, Any] | None] = [None] * len(fits)
    for group in groups.values():
        size = min(TOGETHER, max(1, ENTRIES // fits[group[0]].parameters.n_free ** 2))
        for start in range(0, len(group), size):
            places = group[start : start + size]
            own, some = [fits[k] for k in places], [measured[k] for k in places]
            judged = judge_many(
                own,
                [one.seen for one in some],
                [one.validation for one in some],
                [one.judge_q for one in some],
                probability=level,
            )
            for k, figures in zip(places, _figures(judged, own, some, level), strict=True):
                found[k] = figures
    return [
        judge_model(fit, one, level) if figures is None else figures
        for fit, one, figures in zip(fits, measured, found, strict=True)
    ]


def _figures(
    judged: ManyJudgements,
    fits: Sequence[Identification],
    measured: Sequence[MeasuredRobot],
    level: float,
) -> list[dict[str, Any] | None]:
    """Results of `judge_model` for each robot from arrays; None if that function is needed."""
    true, n = np.stack([one.true for one in measured]), measured[0].validation.n_poses
    error = true - judged.position
    sigma = judged.believed
    if measured[0].use.one_move:
        sd = np.stack([one.laboratory.sigma_q for one in measured])
        moved = judged.rows[..., list(joint_columns(fits[0].model.chain))] * sd[:, None, None]
        sigma = sigma + moved @ np.swapaxes(moved, 2, 3)
    normal = coverage_factor(3, level)
    beyond = np.array([Discrepancy(raw, raw, n).factor(level) for raw in judged.discrepancy])
    beyond = np.where(judged.discrepancy.any(axis=(1, 2)), beyond, normal)
    held, size = np.stack(
        [
            regions_hold(error, covariance, factor, level)
            for covariance, factor in (
                (sigma, judged.factor),
                (judged.bare, np.full(len(fits), normal)),
                (judged.bare + judged.discrepancy[:, None], beyond),
            )
        ],
        axis=1,
    )
    distance, found = np.linalg.norm(error, axis=2), list[dict[str, Any] | None]()
    for k, (fit, one) in enumerate(zip(fits, measured, strict=True)):
        if judged.alone[k]:
            found.append(None)
            continue
        has = believed_where(judged.applies[k], one)
        at, p = has if has.any() else ~has, judged.held_out_p[k]
        radius = judged.conformal[k]
        found.append(
            {
                "inside": (
                    float(held[0, k, at].mean()),
                    *(float(each[k].mean()) for each in held[1:]),
                    float((distance[k] <= radius).mean()),
                ),
                "radius": (
                    float(size[0, k, at].mean()),
                    *(float(each[k].mean()) for each in size[1:]),
                    float(radius),
                ),
                "p_value": fit.p_value,
                "held_out_p": float(p),
                "flagged": bool(fit.p_value < RED or p < RED),
                "believed": float(has.mean()),
                "converged": True,
                "mean_error": float(distance[k].mean()),
                "growth": float(judged.applies[k].growth[at].mean()),
                "p_drift": 1.0 if np.isnan(judged.drift_p[k]) else float(judged.drift_p[k]),
            }
        )
    return found


def regions_hold(
    error: Array, covariance: Array, factor: Array, level: float
) -> tuple[Array, Array]:
    """Whether regions contain the errors (R, t, 3), 0 or 1 (R, t), and radii of equal balls [m]."""
    square, variance, flat = _in_units_of(error, covariance)
    holds = square <= factor[:, None] ** 2
    for k in np.flatnonzero(flat.any(axis=1)).tolist():
        stretch = (factor[k] / coverage_factor(3, level)) ** 2
        holds[k] = inside(error[k], stretch * covariance[k], probability=level)
    return holds.astype(np.float64), factor[:, None] * np.maximum(variance, 0.0) ** (1 / 6)


def _in_units_of(error: Array, covariance: Array) -> tuple[Array, Array, Bool]:
    """Squared Mahalanobis norms (R, t) of errors, determinants, and which covariances are singular.

    The Cholesky factors of three columns are written out; the smallest variance is at least the
    determinant divided by the square of the trace.
    """
    (a, *_), (b, d, _), (c, e, f) = np.moveaxis(covariance, (2, 3), (0, 1))
    x, y, z = np.moveaxis(error, 2, 0)
    trace = a + d + f
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = b / a, c / a
        second = d - u * b
        w = (e - u * c) / second
        third = f - v * c - w * w * second
        y = y - u * x
        z = z - v * x - w * y
        square = x**2 / a + y**2 / second + z**2 / third
        variance = a * second * third
        flat = ~((variance > FLAT * trace**3) & (second > 0) & (third > 0))
    if flat.any():
        variance = np.where(flat, np.linalg.det(covariance), variance)
    return square, variance, flat


def believed_where(applies: Applicability, measured: MeasuredRobot) -> Bool:
    """Judging poses (t,) where a region is stated: near held-out poses, with the same payload."""
    count = len(measured.true)
    data, there = (Conditions(payload=np.full(count, load)) for load in measured.use.payload)
    other = departure(data, there, count).outside
    return np.asarray((applies.place != "outside") & ~other)


def judge_model(found: Identification, measured: MeasuredRobot, level: float) -> dict[str, Any]:
    """The four statements of one model at the judging poses, and which points these contain.

    Keys are the fields of `CoverageStudy`.
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
    """Share of points in the believed region, its mean radius [m], share of poses, mean growth.

    The share of poses is that where a region is stated. Regions are those of the mean of many
    moves, or of one move if single moves are judged; joints then return with standard deviations
    `sd` (n,) [rad, m].
    """
    if belief is None:
        return 0.0, 0.0, 0.0, 1.0
    applies = belief.proven.applies(measured.judge_q)
    has = believed_where(applies, measured)
    at = has if has.any() else ~has
    growth = applies.growth[at]
    stated = belief.regions(
        measured.judge_q[at], growth=growth, repeatability=sd if measured.use.one_move else None
    )
    inside = stated.holds(measured.true[at]).mean()
    return float(inside), stated.mean_radius, float(has.mean()), float(growth.mean())
