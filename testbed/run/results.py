"""Headline numbers and main arrays of a campaign: result.json, arrays.npz; units in the names."""

from pathlib import PurePath
from typing import Any

import numpy as np

from calib.information.propagation import point_uncertainty
from calib.measurement.accuracy import Accuracy
from testbed.laboratory.truth.laboratory import Setting
from testbed.report.page import SIMULATED
from testbed.run.report import headline_verdict
from testbed.studies.compensation.summary import compensation_arrays, compensation_headline
from testbed.studies.coverage.summary import coverage_arrays, coverage_headline
from testbed.studies.pose_sets.compare import contest_of
from testbed.studies.trial.records import Campaign, Estimate, PopulationStudy, Trial
from testbed.studies.trial.statement.report import statement_headline, truth_headline
from testbed.studies.trial.verdict import judge
from testbed.studies.wen2022.claims import examine
from testbed.studies.wen2022.results import reexamined_arrays, reexamined_headline

FORMAT = 1
MM, DEG = 1e3, 180 / np.pi


def headline(campaign: Campaign) -> dict[str, Any]:
    """Every headline number of a campaign as plain JSON values."""
    verdict = headline_verdict(campaign)
    out: dict[str, Any] = {
        "format": FORMAT,
        "notice": SIMULATED,
        "scenario": campaign.scenario.name,
        "seed": campaign.scenario.seed,
        "robot": _robot_name(campaign.scenario.robot),
        "verdict": {
            "believable": verdict.believable,
            "contradicted": verdict.contradicted,
            "sentence": verdict.sentence,
            "reasons": list(verdict.reasons),
        },
        "pool": _pool(campaign.setting),
        "truth_budget": truth_headline(campaign.validation),
        "trials": {trial.name: _trial(trial) for trial in campaign.trials},
    }
    if campaign.pose_count is not None:
        first, second = campaign.pose_count.chosen
        out["pose_count"] = {"O1_poses": first, "O2_poses": second}
    if campaign.random_sets:
        out["random_sets"] = {
            sets.trial: {
                "criterion": sets.criterion,
                "chosen": sets.chosen_value,
                "random_mean": float(sets.values.mean()),
                "random_best": sets.best,
                "beaten": sets.beaten,
                "of": len(sets.values),
            }
            for sets in campaign.random_sets
        }
    if campaign.paper_budget is not None:
        budget = campaign.paper_budget
        out["paper_budget"] = {
            "mean_u_ratio_best_to_random": float((budget.best / budget.random).mean()),
            "mean_u_r_ratio_best_to_random": float(
                (budget.best_repeatability / budget.repeatability).mean()
            ),
        }
    if campaign.tool_point is not None:
        study = campaign.tool_point
        u3 = np.sqrt((study.spread**2).sum(axis=-1))
        out["tool_point"] = {
            source: {
                "zero_pose_u_distance_mm": float(study.distance_sd[k, 0] * MM),
                "held_out_mean_u_distance_mm": float(study.distance_sd[k, 1:].mean() * MM),
                "zero_pose_u_3d_mm": float(u3[k, 0] * MM),
                "held_out_mean_u_3d_mm": float(u3[k, 1:].mean() * MM),
            }
            for k, source in enumerate(study.source)
        }
        full = np.sqrt(np.trace(study.covariance, axis1=1, axis2=2))
        out["tool_point"]["full covariance"] = {
            "trial": study.trial,
            "zero_pose_u_3d_mm": float(full[0] * MM),
            "held_out_mean_u_3d_mm": float(full[1:].mean() * MM),
        }
    if campaign.population is not None:
        out["population"] = _population(campaign.population, campaign)
    if campaign.coverage:
        out["coverage"] = coverage_headline(campaign.coverage)
    if campaign.compensation:
        out["compensation"] = compensation_headline(campaign.compensation)
    if campaign.reexamined:
        out["reexamined"] = reexamined_headline(campaign, examine(campaign))
    return out


def arrays(campaign: Campaign) -> dict[str, np.ndarray[Any, Any]]:
    """The main arrays of a campaign, names with units."""
    setting = campaign.setting
    out: dict[str, np.ndarray[Any, Any]] = {
        "true_step": setting.nominal.chain.step_to(setting.true.chain),
        "pool_q": setting.pool_q,
        "pool_position_m": setting.pool_nominal[:, :3, 3],
        "test_q": setting.test_q,
        "test_true_position_m": setting.test_true[:, :3, 3],
        "judge_q": campaign.validation.judge_q,
        "judge_true_position_m": campaign.validation.judge_true,
        "validation_position_m": campaign.validation.seen.position,
        "validation_pose": campaign.validation.seen.pose_id,
    }
    for trial in campaign.trials:
        out[f"{trial.name}/indices"] = trial.selection.indices
        out[f"{trial.name}/measured_position_m"] = trial.measurements.position
        for estimate in trial.estimates:
            key = f"{trial.name}/{estimate.mode}"
            found, seen = estimate.identification, estimate.comparison
            out[f"{key}/step"] = found.step
            out[f"{key}/true_step"] = seen.true_step
            out[f"{key}/standard_uncertainty"] = found.standard_uncertainty
            out[f"{key}/type_a"] = estimate.type_a
            out[f"{key}/covariance"] = found.covariance
            out[f"{key}/test_error_before_m"] = seen.before
            out[f"{key}/test_error_after_m"] = seen.after
            out[f"{key}/test_error_xyz_m"] = seen.error
            out[f"{key}/test_covariance"] = seen.covariance
            if estimate.statement is not None:
                out[f"{key}/validation_error_xyz_m"] = estimate.statement.held_out.error
            if estimate.replications is not None:
                out[f"{key}/replicated_nees"] = estimate.replications.nees
                out[f"{key}/replicated_coverage"] = estimate.replications.parameter_coverage
    if campaign.pose_count is not None:
        out["pose_count/counts"] = campaign.pose_count.counts
        out["pose_count/mean"] = campaign.pose_count.mean
    out |= coverage_arrays(campaign.coverage)
    out |= compensation_arrays(campaign.compensation)
    out |= reexamined_arrays(campaign)
    return {name: np.asarray(value) for name, value in out.items()}


def _population(study: PopulationStudy, campaign: Campaign) -> dict[str, Any]:
    """Errors over many robots."""
    modes, against = campaign.scenario.identification.estimators, _against_random(campaign)
    return {
        "robots": study.before.size,
        "before_mean_mm": float(study.before.mean() * MM),
        "trials": {
            name: {
                mode: {
                    "mean_mm": float(study.mean_error[i, j].mean() * MM),
                    "rms_mm": float(np.sqrt(np.mean(study.rms_error[i, j] ** 2)) * MM),
                    "stated_u_3d_rms_mm": float(np.sqrt(np.mean(study.stated_u[i, j] ** 2)) * MM),
                    "inside_95": float(study.inside[i, j].mean()),
                }
                for j, mode in enumerate(modes)
            }
            | {"promised_u_3d_rms_mm": float(np.sqrt(np.mean(study.goal_u[i] ** 2)) * MM)}
            | ({"against_random": against[name]} if name in against else {})
            for i, name in enumerate(study.trials)
        },
    }


def _against_random(campaign: Campaign) -> dict[str, Any]:
    """Error ratio of each set to the random set of its size, by itself and with all others."""
    if campaign.population is None or campaign.population.before.size < 2:
        return {}
    return {
        entry.trial.name: {
            "error_ratio": float(np.exp(entry.ratio.value)),
            "ci_95": [float(np.exp(entry.ratio.low)), float(np.exp(entry.ratio.high))],
            "joint_ci_95": [float(np.exp(entry.joint.low)), float(np.exp(entry.joint.high))],
            "outcome": entry.outcome,
            "smaller_error_share": entry.wins,
        }
        for entry in contest_of(campaign).entries
        if entry.ratio is not None and entry.joint is not None
    }


def _robot_name(robot: str) -> str:
    """Name of a shipped robot, or of one's own without the path of this machine."""
    path = PurePath(robot)
    return path.parent.name if path.suffix == ".toml" else path.name


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
