"""What each calibration states, and what is wrong with the true robot: keys of result.json."""

from typing import Any

import numpy as np

from testbed.records_statement import LEVEL, Statement, Validation

MM, UM = 1e3, 1e6


def statement_headline(found: Statement) -> dict[str, Any]:
    """What may be believed of one calibration, with its figures."""
    seen = found.held_out
    out: dict[str, Any] = {
        "model": {"chosen": found.model, "sentence": found.why},
        "outlier_poses": [int(pose) for pose in found.outlier_poses],
        "set_aside_poses": [int(pose) for pose in found.set_aside],
        "validation": {
            "poses": len(seen),
            "chi_square_per_dof": seen.chi_square / (3 * len(seen)),
            "p_value": seen.p_value,
            "mean_error_um": float(seen.distance.mean() * UM),
        },
        "level": LEVEL,
        "statements": {
            name: {
                "radius_um": float(radius * UM),
                "attained": float(share),
                "believed": name == found.trust.believe,
            }
            for name, radius, share in zip(found.names, found.radius, found.attained, strict=True)
        },
        "trust": {
            "believe": found.trust.believe,
            "model_valid": found.trust.model_valid,
            "reasons": list(found.trust.sentences),
        },
        "budget_u_3d_um": {
            name: float(u * UM) for name, u in zip(found.sources, found.source_u, strict=True)
        }
        | {"combined": found.combined_u * UM},
        "discrepancy_u_3d_um": None if np.isnan(found.discrepancy_u) else found.discrepancy_u * UM,
        "linear": {"outcome": found.linear.outcome, "sentence": found.linear.sentence},
        "warnings": {"count": len(found.warnings), "reasons": list(found.warnings)},
    }
    if not np.isnan(found.log_evidence):
        out["model"]["log_evidence"] = found.log_evidence
    if found.lack_of_fit is not None:
        lack = found.lack_of_fit
        out["lack_of_fit"] = {"ratio": lack.ratio, "p_value": lack.p_value}
    if found.bootstrap is not None:
        played = found.bootstrap
        out["bootstrap"] = {
            "replicates": played.replicates,
            "agrees": played.agrees,
            "worst_sd_ratio": played.worst,
        }
    return out


def truth_headline(validation: Validation) -> dict[str, Any]:
    """The secret: how far each term of the truth alone moves the tool, over held-out poses."""
    return {
        "terms_rms_mm": {
            name: float(rms * MM)
            for name, rms in zip(validation.terms, validation.term_rms, strict=True)
        },
        "together_rms_mm": validation.together_rms * MM,
        "interaction_rms_mm": validation.interaction_rms * MM,
    }
