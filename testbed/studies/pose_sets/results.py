"""What the comparison of pose sets publishes in result.json."""

from typing import Any

import numpy as np

from testbed.studies.pose_sets.compare import contest_of
from testbed.studies.pose_sets.records import PopulationStudy, population_of
from testbed.studies.trial.records import Campaign
from testbed.units import MM, Quantity


def published(campaign: Campaign) -> list[Quantity]:
    """Errors over many robots; nothing where the study is off."""
    study = population_of(campaign)
    return [] if study is None else [Quantity("population", _population(study, campaign))]


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
    study = population_of(campaign)
    if study is None or study.before.size < 2:
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
