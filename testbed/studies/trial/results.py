"""What a campaign publishes of its trials, statements and secret: result.json and arrays.npz."""

import numpy as np

from calib.arrays import Array
from calib.measurement.accuracy import Accuracy
from calib.uncertainty.statement.stated_point import widened
from testbed.laboratory.truth.setting import held_out_conditions
from testbed.store.quantities import METRE, RADIAN, Quantity, below, fields_of, in_si
from testbed.studies.trial import decisions
from testbed.studies.trial.bending.records import Ways
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.studies.trial.statement.records import BELIEVED, LEVEL, Statement, Validation, sums_of
from testbed.studies.trial.verdict import judge


def published(campaign: Campaign) -> list[Quantity]:
    """The headline of the pool, of the truth and of every trial."""
    setting = campaign.setting
    rejected = dict(zip(setting.rejection_names, setting.rejection_counts, strict=True))
    found = [
        Quantity("pool/poses", len(setting.pool_q)),
        Quantity("pool/drawn", setting.n_drawn),
        Quantity("pool/rejected", rejected),
        *below("truth_budget", truth_headline(campaign.validation)),
    ]
    if campaign.motion is not None:
        found += below("motion", motion_headline(campaign.motion))
    for trial in campaign.trials:
        found += below(f"trials/{trial.name}", _trial(campaign, trial))
    if campaign.pose_count is not None:
        for name, poses in zip(("O1", "O2"), campaign.pose_count.chosen, strict=True):
            found.append(Quantity(f"pose_count/{name}_poses", poses))
    for sets in campaign.random_sets:
        figures = [
            Quantity("criterion", sets.criterion),
            Quantity("chosen", sets.chosen_value),
            Quantity("random_mean", sets.mean),
            Quantity("random_best", sets.best),
            Quantity("beaten", sets.beaten),
            Quantity("of", sets.drawn),
        ]
        found += below(f"random_sets/{sets.trial}", figures)
    return found


def published_arrays(campaign: Campaign) -> list[Quantity]:
    """Poses and truth, and what every estimate gave."""
    setting, visit = campaign.setting, campaign.validation
    found: dict[str, object] = {
        "true_step": setting.nominal.chain.step_to(setting.true.chain),
        "pool_q": setting.pool_q,
        "pool_position_m": setting.pool_nominal[:, :3, 3],
        "test_q": setting.test_q,
        "test_true_position_m": setting.test_true[:, :3, 3],
        "judge_q": visit.judge_q,
        "judge_true_position_m": visit.judge_true,
        "validation_position_m": visit.seen.position,
        "validation_pose": visit.seen.pose_id,
    }
    for trial in campaign.trials:
        found[f"{trial.name}/indices"] = trial.selection.indices
        found[f"{trial.name}/measured_position_m"] = trial.measurements.position
        for estimate in trial.estimates:
            key = f"{trial.name}/{estimate.mode}"
            fit, judged = estimate.identification, estimate.comparison
            found[f"{key}/step"] = fit.step
            found[f"{key}/true_step"] = judged.true_step
            found[f"{key}/standard_uncertainty"] = fit.standard_uncertainty
            found[f"{key}/type_a"] = estimate.type_a
            found[f"{key}/covariance"] = fit.covariance
            found[f"{key}/test_error_before_m"] = judged.before
            found[f"{key}/test_error_after_m"] = judged.after
            found[f"{key}/test_error_xyz_m"] = judged.error
            found[f"{key}/test_covariance"] = judged.covariance
            if estimate.statement is not None:
                found[f"{key}/validation_error_xyz_m"] = estimate.statement.held_out.error
                found[f"{key}/test_inside_believed"] = estimate.statement.inside
                found |= _regions(campaign, estimate.statement, key)
            if estimate.replications is not None:
                found[f"{key}/replicated_nees"] = estimate.replications.nees
                found[f"{key}/replicated_coverage"] = estimate.replications.parameter_coverage
    if campaign.pose_count is not None:
        found["pose_count/counts"] = campaign.pose_count.counts
        found["pose_count/mean"] = campaign.pose_count.mean
    return in_si(found)


def _regions(campaign: Campaign, statement: Statement, key: str) -> dict[str, object]:
    """Covariances of the believed regions at the held-out poses, their factor in them."""
    belief, setting = statement.belief, campaign.setting
    if belief is None:
        return {}
    at = held_out_conditions(campaign.scenario, setting.test_q)
    mean = belief.regions(setting.test_q, target=setting.target, at=at)
    return {f"{key}/test_believed_covariance": widened(mean)}


def _trial(campaign: Campaign, trial: Trial) -> list[Quantity]:
    """Headline of one trial."""
    found = [
        Quantity("poses", len(trial.selection.indices)),
        Quantity("method", trial.method),
        Quantity("criterion", trial.selection.criterion),
        Quantity("criterion_rows", trial.rows),
        Quantity("criterion_value", trial.selection.value),
    ]
    for estimate in trial.estimates:
        figures = [*_estimate(trial, estimate), *decisions.published(campaign, estimate)]
        found += below(f"estimates/{estimate.mode}", figures)
    return found


def _estimate(trial: Trial, estimate: Estimate) -> list[Quantity]:
    """Headline of one estimate."""
    found, seen, played = estimate.identification, estimate.comparison, estimate.replications
    verdict, whitened = judge(trial, estimate), found.mode == "whitened"
    out = [
        Quantity("believable", verdict.believable),
        Quantity("contradicted", verdict.contradicted),
        Quantity("parameters", found.parameters.n_free),
        Quantity("rank", found.rank),
        # the paper's estimator knows no noise to compare its residuals with
        Quantity("chi_square_per_dof", found.chi_square / found.dof if whitened else None),
        Quantity("p_value", found.p_value if whitened else None),
        Quantity("certificate", found.certificate),
        Quantity("status", found.status.value),
        *_accuracy("held_out_before", seen.accuracy_before),
        *_accuracy("held_out_after", seen.accuracy_after),
        *_accuracy("at_measured_before", seen.identification_before),
        *_accuracy("at_measured_after", seen.identification_after),
        Quantity("held_out_rotation_after_mean_deg", seen.rotation_after.mean(), RADIAN),
        Quantity("stated_u_3d_rms_mm", estimate.stated_u, METRE),
        Quantity("held_out_inside_95", estimate.inside.mean()),
        Quantity("parameters_alone_u_3d_rms_mm", seen.stated_u, METRE),
        Quantity("held_out_inside_parameters_alone", seen.inside.mean()),
        Quantity("parameters_inside_95", seen.parameter_inside[estimate.judged].mean()),
        Quantity("nees", seen.nees),
    ]
    if estimate.statement is not None:
        out += below("statement", statement_headline(estimate.statement))
    if played is not None:
        out += [
            Quantity("replications/count", played.count),
            Quantity("replications/nees_mean", played.nees.mean()),
            Quantity("replications/parameter_coverage_mean", played.parameter_coverage.mean()),
            Quantity("replications/parameter_coverage_min", played.parameter_coverage.min()),
            Quantity("replications/tool_coverage_mean", played.tool_coverage.mean()),
            *_mean("replications/region_coverage_mean", played.region_coverage),
            Quantity("replications/sd_ratio_min", played.sd_ratio.min()),
            Quantity("replications/sd_ratio_max", played.sd_ratio.max()),
        ]
    return out


def _accuracy(name: str, a: Accuracy) -> list[Quantity]:
    """Position error statistics."""
    values = {"mean": a.mean, "rms": a.rms, "p95": a.p95, "max": a.maximum}
    return [Quantity(f"{name}/{key}_mm", value, METRE) for key, value in values.items()]


def statement_headline(statement: Statement) -> list[Quantity]:
    """What may be believed of one calibration, with its figures."""
    held_out, lack, played = statement.held_out, statement.lack_of_fit, statement.bootstrap
    evidence = statement.log_evidence
    sources = dict(zip(statement.sources, statement.source_u, strict=True))
    out = [
        Quantity("model/chosen", statement.model),
        Quantity("model/sentence", statement.why),
        *([] if np.isnan(evidence) else [Quantity("model/log_evidence", evidence)]),
        Quantity("outlier_poses", statement.outlier_poses),
        Quantity("set_aside_poses", statement.set_aside),
        Quantity("stray_poses", () if statement.strays is None else statement.strays.poses),
        Quantity("validation/poses", len(held_out)),
        Quantity("validation/chi_square_per_dof", held_out.chi_square / (3 * len(held_out))),
        Quantity("validation/p_value", held_out.p_value),
        Quantity("validation/mean_error_um", held_out.distance.mean(), METRE),
        Quantity("level", LEVEL),
        *_believed(statement),
        Quantity("tests", _tests(statement)),
    ]
    for name, radius, share in zip(
        statement.names, statement.radius, statement.attained, strict=True
    ):
        out += [
            Quantity(f"statements/{name}/radius_um", radius, METRE),
            Quantity(f"statements/{name}/attained", share),
            Quantity(f"statements/{name}/believed", name in BELIEVED),
        ]
    out += [
        Quantity("trust/believe", statement.trust.believe),
        Quantity("trust/refuted", statement.trust.refuted),
        Quantity("trust/reasons", statement.trust.sentences),
        Quantity("budget_u_3d_um", {**sources, **sums_of(statement)}, METRE),
        Quantity("linear/outcome", statement.linear.outcome),
        Quantity("linear/sentence", statement.linear.sentence),
        Quantity("warnings/count", len(statement.warnings)),
        Quantity("warnings/reasons", statement.warnings),
    ]
    if lack is not None:
        out += below("lack_of_fit", fields_of(lack, {"ratio": "ratio", "p_value": "p_value"}))
    if played is not None:
        names = {"replicates": "replicates", "agrees": "agrees", "worst_sd_ratio": "worst"}
        out += below("bootstrap", fields_of(played, names))
    return out


LENGTHS = (
    "u_mean_um", "R95_mean_um", "u_move_um", "R95_move_um", "misfit_upper_um", "detectable_um"
)  # fmt: skip
"""What is believed, in numbers: 3-D standard uncertainty and radius of the mean of many moves and
of one move, the misfit that is in it, and the misfit that would have been seen."""


def _believed(statement: Statement) -> list[Quantity]:
    """What is believed: the mean of many moves and one move, and what is in it; null if nothing."""
    point, belief = statement.point, statement.belief
    lengths = dict.fromkeys(LENGTHS, np.nan)
    if belief is not None and point is not None:
        values = (
            point.u_mean, point.radius_mean, point.u_move, point.radius_move,
            belief.misfit.upper, belief.misfit.detectable,
        )  # fmt: skip
        lengths = dict(zip(LENGTHS, values, strict=True))
    return [
        *(Quantity(name, None if np.isnan(v) else v, METRE) for name, v in lengths.items()),
        Quantity("factor", None if belief is None else belief.factor),
        Quantity("guards", None if belief is None else belief.n_guards),
    ]


def _tests(statement: Statement) -> dict[str, float]:
    """p-values of the distinct questions, as Holm adjusts them, and of all readings together."""
    asked = statement.questions
    return {**dict(zip(asked.names, asked.adjusted, strict=True)), "combined": asked.combined}


def _mean(name: str, values: Array | None) -> list[Quantity]:
    """A mean, where there are values."""
    return [] if values is None else [Quantity(name, values.mean())]


def motion_headline(ways: Ways) -> list[Quantity]:
    """Widths of the loops, what still swings when the tracker looks, and both sides' ends apart."""
    return [
        Quantity("loop_width_mdeg", ways.loop_width, RADIAN),
        Quantity("tool_loop_width_um", ways.tool_width, METRE),
        Quantity("from_rest_mean_um", ways.seen.mean(), METRE),
        Quantity("from_rest_max_um", ways.seen.max(), METRE),
        Quantity("both_sides_mean_um", ways.apart.mean(), METRE),
        Quantity("both_sides_max_um", ways.apart.max(), METRE),
    ]


def truth_headline(validation: Validation) -> list[Quantity]:
    """The secret: how far each term of the truth alone moves the tool, over held-out poses."""
    terms = dict(zip(validation.terms, validation.term_rms, strict=True))
    return [
        Quantity("terms_rms_mm", terms, METRE),
        Quantity("together_rms_mm", validation.together_rms, METRE),
        Quantity("interaction_rms_mm", validation.interaction_rms, METRE),
    ]
