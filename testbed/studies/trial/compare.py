"""Identified against true: held-out errors, parameters, and whether stated regions contain them.

This module, `replication` and `population` judge; with the simulator they alone look at the truth.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.bodies import Z
from calib.geometry.frames import target_points, transform
from calib.geometry.jacobian import reflector_rows
from calib.geometry.joint_errors import JointTerm
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from calib.identification.identify import Identification, identify
from calib.measurement import accuracy
from calib.measurement.accuracy import point_distances
from calib.measurement.observations import Measurements
from calib.measurement.prediction import perfect, predict, predicted_positions
from calib.uncertainty.regions import coverage_factor, inside, mahalanobis_squared, student_factor
from calib.uncertainty.tool_point import ToolStatement
from testbed.laboratory.truth.setting import Setting, in_turn
from testbed.laboratory.truth.terms import UnmodelledTerms
from testbed.studies.trial.records import Comparison, Estimate, judged_numbers
from testbed.studies.trial.statement.records import Validation

INTERVAL = coverage_factor(1)
"""Half width of a 95 % interval in standard uncertainties."""
REFIT_POSES = 200
"""Number of pool poses at which the truth is expressed by the estimated numbers."""


def target_prediction(
    model: RobotModel,
    q: Array,
    target: Array,
    covariance: Array,
    at: OperatingConditions | None = None,
) -> tuple[Array, Array, Array]:
    """Point (m, 3), rotation (m, 3, 3) and stated covariance (m, 6, 6) at joints q [m, rad].

    `covariance` (P, P) is that of all numbers of the model, zero for those not estimated. The poses
    are visited in turn; `at` has further conditions.
    """
    T, J = model.poses_and_jacobian(q, in_turn(q) if at is None else at)
    point, rows = reflector_rows(T, J, np.broadcast_to(target, (len(q), 3)))
    J = np.concatenate([rows, J[:, 3:]], axis=1)
    return point, T[:, :3, :3], J @ covariance @ np.swapaxes(J, 1, 2)


def measured_distance(seen: Measurements, model: RobotModel) -> Array:
    """Distance (m,) between the measured points and those that `model` predicts [m].

    For a distance row it is the error of the distance.
    """
    if seen.is_distance.any():
        return predict(model, seen).misses
    return point_distances(seen.position, predicted_positions(model, seen))


def noise_free(model: RobotModel, like: Measurements, q: Array) -> Measurements:
    """Measurements of `model` without noise at q (m, n), of the kind of the first row of `like`.

    If `like` has several targets or stations, every pose has a row of each.
    """
    T, m = model.poses(q), len(q)
    kinds = np.unique(like.target_key, axis=0, return_index=True)[1]
    if len(kinds) > 1:
        each = np.tile(np.arange(m), len(kinds))
        table = like.rows(np.repeat(kinds, m))
        return perfect(model, replace(table, q=q[each], pose_id=each, repeat=0 * each))
    table = like.rows(np.zeros(m, dtype=np.int64))
    return replace(
        table,
        q=q,
        position=target_points(T, table.offset[0]),
        rotation=T[:, :3, :3] if table.is_pose[0] else table.rotation,
        pose_id=np.arange(m),
        repeat=np.zeros(m, dtype=np.int64),
    )


def true_step(
    setting: Setting,
    identification: Identification,
    like: Measurements,
    unmodelled: UnmodelledTerms | None = None,
) -> Array:
    """True values minus nominal (f,) of the estimated parameters, in their gauge.

    With a prior on all free numbers no number stands for another, and this is the step as drawn.

    Otherwise the kept set is refitted to noise-free poses of the true geometry (without joint
    errors), so that redundant numbers of the truth are expressed by it exactly and not only to
    first order. If it cannot represent the truth, this is its best fit over poses of the pool.
    """
    prior = identification.prior
    if prior is not None and set(prior.names) == set(identification.names):
        return drawn_step(setting, identification, unmodelled)
    # joint errors of the nominal model are part of the comparison
    geometry = replace(setting.true, joint_errors=setting.nominal.joint_errors)
    table = noise_free(geometry, like, setting.pool_q[:REFIT_POSES])
    exact = identify(setting.nominal, table, identification.parameters, prior=prior)
    if exact.parameters.free_names != identification.parameters.free_names:
        return np.asarray(setting.nominal.step_to(geometry)[identification.parameters.free])
    return exact.step


def drawn_step(
    setting: Setting, identification: Identification, unmodelled: UnmodelledTerms | None = None
) -> Array:
    """True minus nominal (f,) of the estimated numbers, term by term as they were drawn.

    Joint terms of the true robot that the model lacks are left out; the same wave of a joint may
    have another name there. Numbers that nothing in the true robot defines are nan.
    """
    nominal, true = setting.nominal, setting.true
    values = dict(zip(nominal.names, nominal.chain.step_to(true.chain), strict=False))
    placed = nominal.fixtures.step_to(true.fixtures)
    values |= dict(zip(nominal.fixtures.names, placed, strict=True))
    for model, sign in ((true, 1.0), (nominal, -1.0)):
        for name, value in zip(
            model.joint_errors.names, model.joint_errors.coefficients, strict=True
        ):
            values[name] = values.get(name, 0.0) + sign * value
    waves = {_wave(term): term.name for term in true.joint_errors.terms}
    for term in identification.model.joint_errors.terms:
        values.setdefault(term.name, values.get(waves.get(_wave(term), ""), 0.0))
    values |= _drawn_beyond(setting, identification.model, unmodelled or UnmodelledTerms())
    return np.array([values.get(name, 0.0) for name in identification.names])


def _drawn_beyond(
    setting: Setting, model: RobotModel, unmodelled: UnmodelledTerms
) -> dict[str, float]:
    """True springs and play in the numbers of a fitted model; nan for undefined ones.

    A bend at its reference load is that load over the stiffness. Moments and tilts are undefined,
    since each stands for others that act alike. Play is the number of an approach term only if the
    approach alone decides on its side.
    """
    known, errors, play = setting.nominal.joint_errors, model.joint_errors, unmodelled.backlash
    values = dict[str, float]()
    if (springs := errors.springs) is not None and known.springs is None:
        values = dict.fromkeys(springs.names, np.nan)
        closed = any(term.name.startswith("gravity") for term in setting.true.joint_errors.terms)
        if (of := unmodelled.springs) is not None:
            bearing = of.bearing if len(of.bearing) else np.full(len(of.drive), np.inf)
            stiff = np.where(springs.axis == Z, of.drive[springs.joint], bearing[springs.joint])
            values |= dict(zip(springs.names, (springs.load / stiff).tolist(), strict=False))
        elif not closed:
            values |= dict.fromkeys(springs.names[: len(springs.load)], 0.0)
    for term in errors.terms:
        if term.is_wave or term.name in known.names:
            continue
        values[term.name] = np.nan
        if term.wave == "approach" and unmodelled.motion is None:
            if play is None:
                values[term.name] = 0.0
            elif play.side == "approach":
                values[term.name] = float(play.half_width[term.joint])
    return values


def _wave(term: JointTerm) -> tuple[object, ...]:
    """Key of a term, independent of its name."""
    return term.joint, term.wave, term.weights


def compare(
    setting: Setting,
    identification: Identification,
    measurements: Measurements,
    truth: Array,
    *,
    systematic: Array | None = None,
    at: OperatingConditions | None = None,
) -> Comparison:
    """Judge one identification.

    Parameters
    ----------
    setting : Setting
        The truth and the held-out poses.
    identification : Identification
        Result to judge.
    measurements : Measurements
        Measurements that it was identified from.
    truth : (f,) array
        Result of `true_step` [m, rad].
    systematic : (f, f) array, optional
        Covariance of the estimate by errors common to all rows, to be added.
    at : OperatingConditions, optional
        Conditions of the held-out poses; by default they are visited in turn.
    """
    q, target = setting.test_q, setting.target
    at = in_turn(q) if at is None else at
    stated = identification
    if systematic is not None and systematic.any():
        stated = replace(identification, covariance=identification.covariance + systematic)
    p_true, T0 = target_points(setting.test_true, target), setting.nominal.poses(q, at)
    point, R, covariance = target_prediction(
        identification.model, q, target, stated.full_covariance, at
    )
    before = point_distances(p_true, target_points(T0, target))
    error = p_true - point
    after = point_distances(p_true, point)
    wrong, judged = identification.step - truth, judged_numbers(identification, truth)
    alone = stated.covariance[np.ix_(judged, judged)]
    at_measured = [
        accuracy.error_statistics(measured_distance(measurements, model))
        for model in (setting.nominal, identification.model)
    ]
    return Comparison(
        before=before,
        after=after,
        rotation_before=accuracy.rotation_errors(setting.test_true, T0),
        rotation_after=accuracy.rotation_errors(setting.test_true, transform(R, point)),
        error=error,
        covariance=covariance,
        inside=inside(error, covariance[:, :3, :3]),
        identification_before=at_measured[0],
        identification_after=at_measured[1],
        accuracy_before=accuracy.error_statistics(before),
        accuracy_after=accuracy.error_statistics(after),
        true_step=truth,
        parameter_inside=judged & (np.abs(wrong) <= INTERVAL * stated.standard_uncertainty),
        nees=float(mahalanobis_squared(wrong[judged], alone)),
    )


def held_by_repeats(estimate: Estimate) -> tuple[Bool, float]:
    """Whether the 95 % interval of type A, t s, contains each true number (f,), and Student's t.

    s is the scatter of v repeated calibrations, with v - 1 degrees of freedom. If the model lacks
    nothing, the interval of a further calibration contains the truth in 95 % of cases, that of one
    of the repeats more often.
    """
    seen, found = estimate.comparison, estimate.identification
    factor = float(student_factor(len(estimate.repeated) - 1))
    return np.abs(found.step - seen.true_step) <= factor * estimate.type_a, factor


def attained(
    validation: Validation, regions: Mapping[str, ToolStatement], radius: float | None
) -> Array:
    """Share (w,) of the true points at the judging poses inside each statement.

    The region of one move is compared with the ends of single moves. `radius` [m] is that of a ball
    about the predicted points; None without a ball.
    """
    true, moved = validation.judge_true, validation.judge_moved
    shares = [
        float(region.holds(moved if name == "move" else true).mean())
        for name, region in regions.items()
    ]
    if radius is not None:
        position = regions["parameters"].position
        shares.append(float((point_distances(true, position) <= radius).mean()))
    return np.array(shares)


def held_by(region: ToolStatement | None, setting: Setting) -> Bool:
    """Whether (t,) each true held-out tool point is in its region; false without a region."""
    true = target_points(setting.test_true, setting.target)
    return np.zeros(len(true), dtype=bool) if region is None else region.holds(true)
