"""The compensation study in result.json and arrays.npz; units in the names."""

from typing import Any

import numpy as np

from testbed.compensation_summary import Outcome, Typical, outcomes
from testbed.records_compensation import CompensationStudy

MM = 1e3
MDEG = 180e3 / np.pi


def compensation_headline(studies: tuple[CompensationStudy, ...]) -> dict[str, Any]:
    """ISO 9283 figures of every kind of robot before and after."""
    first = studies[0]
    return {
        "robots": len(first.extended),
        "trial": first.trial,
        "cycles": first.cycles,
        "truths": {
            study.truth: {
                "extended_chosen": float(study.extended.mean()),
                **{found.variant: _outcome(found) for found in outcomes(study)},
            }
            for study in studies
        },
    }


def compensation_arrays(
    studies: tuple[CompensationStudy, ...],
) -> dict[str, np.ndarray[Any, Any]]:
    """What each robot gave."""
    out: dict[str, np.ndarray[Any, Any]] = {}
    for study in studies:
        key = f"compensation/{study.truth}"
        for j, name in enumerate(("AP_m", "RP_m", "AP_angle_rad")):
            out[f"{key}/{name}"] = study.figures[:, j]
        for j, name in enumerate(("AD_m", "RD_m")):
            out[f"{key}/{name}"] = study.distances[:, j]
        out[f"{key}/true_AP_m"] = study.true
        out[f"{key}/held_out_m"] = study.held_out
        out[f"{key}/targets"] = study.targets
        out[f"{key}/corrected"] = study.corrected
    return out


def _outcome(found: Outcome) -> dict[str, Any]:
    """One way to run the program."""
    return {
        "AP": _typical(found.ap, MM, "mm"),
        "RP": _typical(found.rp, MM, "mm"),
        "AP_angle": _typical(found.angle, MDEG, "mdeg"),
        "AD": _typical(found.ad, MM, "mm"),
        "RD": _typical(found.rd, MM, "mm"),
        "true_AP_mm": found.true * MM,
        "held_out_mean_mm": found.held_out * MM,
        "held_out_p95_mm": found.held_out_p95 * MM,
        "robots_better": found.better,
        "targets_not_corrected": found.uncorrected,
    }


def _typical(found: Typical, factor: float, unit: str) -> dict[str, float]:
    """One figure."""
    return {
        f"median_{unit}": found.value * factor,
        f"p05_{unit}": found.low * factor,
        f"p95_{unit}": found.high * factor,
        f"u_{unit}": found.uncertainty * factor,
        f"floor_{unit}": found.floor * factor,
    }
