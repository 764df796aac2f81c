"""What a campaign publishes of its trials: result.json and arrays.npz."""

from typing import Any

import numpy as np

from calib.information.propagation import point_uncertainty
from calib.measurement.accuracy import Accuracy
from testbed.laboratory.truth.laboratory import Setting
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.studies.trial.statement.report import statement_headline, truth_headline
from testbed.studies.trial.verdict import judge
from testbed.units import DEG, MM, Quantity, in_si


def published(campaign: Campaign) -> list[Quantity]:
    """The headline of the pool, of the truth and of every trial."""
    found = [
        Quantity("pool", _pool(campaign.setting)),
        Quantity("truth_budget", truth_headline(campaign.validation)),
        Quantity("trials", {trial.name: _trial(trial) for trial in campaign.trials}),
    ]
    if campaign.pose_count is not None:
        for name, poses in zip(("O1", "O2"), campaign.pose_count.chosen, strict=True):
            found.append(Quantity(f"pose_count/{name}_poses", poses))
    for sets in campaign.random_sets:
        key = f"random_sets/{sets.trial}"
        found += [
            Quantity(f"{key}/criterion", sets.criterion),
            Quantity(f"{key}/chosen", sets.chosen_value),
            Quantity(f"{key}/random_mean", float(sets.values.mean())),
            Quantity(f"{key}/random_best", sets.best),
            Quantity(f"{key}/beaten", sets.beaten),
            Quantity(f"{key}/of", len(sets.values)),
        ]
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
            if estimate.replications is not None:
                found[f"{key}/replicated_nees"] = estimate.replications.nees
                found[f"{key}/replicated_coverage"] = estimate.replications.parameter_coverage
    if campaign.pose_count is not None:
        found["pose_count/counts"] = campaign.pose_count.counts
        found["pose_count/mean"] = campaign.pose_count.mean
    return in_si(found)


def _pool(setting: Setting) -> dict[str, Any]:
    """How the pool came about."""
    return {
        "poses": len(setting.pool_q),
        "drawn": setting.n_drawn,
        "rejected": {
            name: int(count)
            for name, count in zip(setting.rejection_names, setting.rejection_counts, strict=True)
        },
    }


def _trial(trial: Trial) -> dict[str, Any]:
    """Headline of one trial."""
    return {
        "poses": len(trial.selection.indices),
        "method": trial.method,
        "criterion": trial.selection.criterion,
        "criterion_rows": trial.rows,
        "criterion_value": trial.selection.value,
        "estimates": {estimate.mode: _estimate(trial, estimate) for estimate in trial.estimates},
    }


def _estimate(trial: Trial, estimate: Estimate) -> dict[str, Any]:
    """Headline of one estimate."""
    found, seen, played = estimate.identification, estimate.comparison, estimate.replications
    u, whitened = point_uncertainty(seen.covariance), found.mode == "whitened"
    verdict = judge(trial, estimate)
    out = {
        "believable": verdict.believable,
        "contradicted": verdict.contradicted,
        "parameters": found.parameters.n_free,
        "rank": found.rank,
        # the paper's estimator knows no noise to compare its residuals with
        "chi_square_per_dof": found.chi_square / found.dof if whitened else None,
        "p_value": found.p_value if whitened else None,
        "certificate": found.certificate,
        "status": found.status.value,
        "held_out_before": _accuracy(seen.accuracy_before),
        "held_out_after": _accuracy(seen.accuracy_after),
        "at_measured_before": _accuracy(seen.identification_before),
        "at_measured_after": _accuracy(seen.identification_after),
        "held_out_rotation_after_mean_deg": float(seen.rotation_after.mean() * DEG),
        "stated_u_3d_rms_mm": float(np.sqrt(np.mean(u**2)) * MM),
        "held_out_inside_95": float(seen.inside.mean()),
        "parameters_inside_95": float(seen.parameter_inside.mean()),
        "nees": seen.nees,
    }
    if estimate.statement is not None:
        out["statement"] = statement_headline(estimate.statement)
    if played is not None:
        out["replications"] = {
            "count": played.count,
            "nees_mean": float(played.nees.mean()),
            "parameter_coverage_mean": float(played.parameter_coverage.mean()),
            "parameter_coverage_min": float(played.parameter_coverage.min()),
            "tool_coverage_mean": float(played.tool_coverage.mean()),
            "sd_ratio_min": float(played.sd_ratio.min()),
            "sd_ratio_max": float(played.sd_ratio.max()),
        }
    return out


def _accuracy(a: Accuracy) -> dict[str, Any]:
    """Position error statistics in mm."""
    return {
        "mean_mm": a.mean * MM,
        "rms_mm": a.rms * MM,
        "p95_mm": a.p95 * MM,
        "max_mm": a.maximum * MM,
    }
