"""The coverage study in result.json and arrays.npz; units in the names."""

from typing import Any

import numpy as np

from testbed.coverage_summary import cells, followed, numbers_check
from testbed.population import Mean, mean_over_robots
from testbed.records_coverage import MODELS, CoverageStudy

MM = 1e3


def coverage_headline(studies: tuple[CoverageStudy, ...]) -> dict[str, Any]:
    """Attained coverage of every cell, and what the program's advice was worth."""
    found = cells(studies)
    return {
        "robots": studies[0].before.size,
        "level": studies[0].level,
        "truths": {
            study.truth: {
                "before_mean_mm": float(study.before.mean() * MM),
                "extended_chosen": float(study.extended.mean()),
                **{
                    model: {
                        "mean_mm": float(study.mean_error[i].mean() * MM),
                        "flagged": float(study.flagged[i].mean()),
                        "converged": float(study.converged[i].mean()),
                        **{
                            cell.statement: {
                                "inside": cell.share.value,
                                "ci_95": share_interval(cell.share),
                                "joint_ci_95": share_interval(cell.joint),
                                "radius_mm": cell.radius * MM,
                                "outcome": cell.outcome,
                            }
                            for cell in found
                            if (cell.truth, cell.model) == (study.truth, model)
                        },
                    }
                    for i, model in enumerate(MODELS)
                },
                "advice_followed": _followed(study),
            }
            | _numbers(study)
            for study in studies
        },
    }


def coverage_arrays(studies: tuple[CoverageStudy, ...]) -> dict[str, np.ndarray[Any, Any]]:
    """What each robot gave."""
    return {
        f"coverage/{study.truth}/{name}": getattr(study, field)
        for study in studies
        for name, field in (
            ("inside", "inside"),
            ("radius_m", "radius"),
            ("mean_error_m", "mean_error"),
            ("p_value", "p_value"),
            ("held_out_p", "held_out_p"),
            ("flagged", "flagged"),
            ("log_evidence", "log_evidence"),
            ("nees", "nees"),
            ("normal_error", "normal_error"),
        )
    }


def _followed(study: CoverageStudy) -> dict[str, Any]:
    """Share inside for whoever uses the chosen model and the statement to be believed."""
    shares, without = followed(study)
    if len(shares) < 2:
        return {"inside": None, "ci_95": None, "nothing_to_believe": without}
    mean = mean_over_robots(shares)
    return {
        "inside": mean.value,
        "ci_95": share_interval(mean),
        "nothing_to_believe": without,
    }


def share_interval(mean: Mean) -> list[float]:
    """Interval of a share, which ends at none and at all."""
    return [max(mean.low, 0.0), min(mean.high, 1.0)]


def _numbers(study: CoverageStudy) -> dict[str, Any]:
    """The numbers of the geometric model, where it can hold the truth."""
    check = numbers_check(study)
    if check is None:
        return {}
    return {
        "numbers": {
            "count": len(check.names),
            "inside_mean": float(check.shares.mean()),
            "inside_min": float(check.shares.min()),
            "inside_max": float(check.shares.max()),
            "band_of_all": [float(value) for value in check.band],
            "nees_mean": check.nees,
            "nees_band": [float(value) for value in check.nees_band],
            "nees_p_value": check.nees_p,
            "ranks_p_value": check.rank_p,
            "passed": check.passed,
        }
    }
