"""result.json, arrays.npz and the small tables of a calibration; units in the names."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calib.measurement.accuracy import Accuracy
from testbed.identify.records import Calibration, Delivered, Figures, Fit, Misses
from testbed.identify.words import notice, reasons, verdict
from testbed.robots.write.dh_table import DhRow, dh_rows
from testbed.units import DEG, MM, sentences

FORMAT = 1
KIND = "calibration"


def headline(calibration: Calibration, delivered: Delivered) -> dict[str, Any]:
    """Every headline number of a calibration as plain JSON values."""
    source, split, gross, proof = (
        calibration.source, calibration.split, calibration.gross, calibration.proof,
    )  # fmt: skip
    table = calibration.measurements
    return {
        "format": FORMAT,
        "kind": KIND,
        "notice": notice(calibration),
        "session": source.name,
        "robot": source.robot,
        "seed": split.seed,
        "files_sha256": dict(source.files),
        "verdict": {
            "believable": not calibration.contradicted,
            "believe": proof.trust.believe,
            "sentence": verdict(calibration),
            "reasons": list(reasons(calibration)),
        },
        "data": {
            "rows": len(table),
            "poses": table.n_poses,
            "kinds": sorted(set(table.kind.tolist())),
            "joints": source.joints,
            "uncertainty": source.uncertainty,
            "masked": list(source.masked),
            "drift": list(source.drift),
            "warnings": [*source.warnings, *calibration.warnings],
        },
        "split": {
            "sentence": split.sentence,
            "stated": split.stated,
            "train_poses": table.rows(calibration.is_used).n_poses,
            "held_out_poses": table.rows(split.is_test).n_poses,
        },
        "outliers": {
            "left_out_rows": int(gross.left_out.sum()),
            "training": list(gross.sentences),
            "held_out": list(gross.held_out_sentences),
        },
        "frames": list(calibration.frames),
        "before": {
            "what": "nominal links, base, tool and fixtures fitted to the training rows",
            "train": _figures(calibration.before_train),
            "held_out": _figures(calibration.before_test),
        },
        "models": {fit.model: _fit(fit) for fit in calibration.fits},
        "model": calibration.choice.chosen,
        "model_choice": {
            "asked": calibration.choice.asked,
            "sentence": calibration.choice.sentence,
            "log_evidence": calibration.choice.log_evidence,
        },
        "statements": statements(calibration),
        "parameters": [
            {
                "name": row.name,
                "unit": row.unit,
                "old": row.old,
                "new": row.new,
                "delta": row.delta,
                "U_k2": row.expanded,
            }
            for row in dh_table(calibration)
        ],
        "delivered": {
            "robot": list(delivered.robot),
            "program": list(delivered.program),
            "program_failed": delivered.program_failed,
        },
    }


def statements(calibration: Calibration) -> dict[str, Any]:
    """What may be said of the tool's position at a new pose [mm]."""
    proof = calibration.proof
    out: dict[str, Any] = {"model_valid": proof.trust.model_valid}
    if proof.held_out is not None:
        u = np.sqrt(np.trace(proof.held_out.predicted, axis1=1, axis2=2))
        out["model_u_3d_rms_mm"] = float(np.sqrt(np.mean(u**2)) * MM)
        out["held_out_p_value"] = proof.held_out.p_value
    if proof.discrepancy is not None:
        out["discrepancy_u_3d_mm"] = float(np.sqrt(np.trace(proof.discrepancy.covariance)) * MM)
    if proof.conformal is not None:
        low, high = proof.conformal.content_range()
        out["conformal_radius_mm"] = proof.conformal.radius * MM
        out["conformal_probability"] = proof.conformal.probability
        out["conformal_content_range"] = [low, high]
    return out


def dh_table(calibration: Calibration) -> tuple[DhRow, ...]:
    """Base, links, tool and joint terms: nominal links with fitted frames against the result."""
    found = calibration.fit.identification
    return dh_rows(calibration.before, found.model, found.parameters, calibration.covariance)


def arrays(calibration: Calibration) -> dict[str, np.ndarray[Any, Any]]:
    """The main arrays of a calibration, names with units."""
    table = calibration.measurements
    out: dict[str, np.ndarray[Any, Any]] = {
        "q_rad_m": table.q,
        "pose_id": table.pose_id,
        "is_test": calibration.split.is_test,
        "is_used": calibration.is_used,
        "before/T_world_base": calibration.before.chain.T_world_base,
        "before/T_flange_tool": calibration.before.chain.T_flange_tool,
    }
    out |= _miss_arrays("before", calibration.before_misses)
    for fit in calibration.fits:
        found = fit.identification
        chain = found.model.chain
        out |= _miss_arrays(fit.model, fit.misses)
        out |= {
            f"{fit.model}/links": chain.links,
            f"{fit.model}/T_world_base": chain.T_world_base,
            f"{fit.model}/T_flange_tool": chain.T_flange_tool,
            f"{fit.model}/joint_terms": found.model.joint_errors.coefficients,
            f"{fit.model}/step": found.step,
            f"{fit.model}/covariance": found.covariance,
            f"{fit.model}/scatter_covariance": fit.scatter,
        }
    return {name: np.asarray(value) for name, value in out.items()}


def split_csv(calibration: Calibration) -> str:
    """Every row: what it was used for, and what it is missed by before and after."""
    table, split, gross = calibration.measurements, calibration.split, calibration.gross
    before, after = calibration.before_misses, calibration.fit.misses
    rows = []
    for k in range(len(table)):
        part = "test" if split.is_test[k] else "left out" if gross.left_out[k] else "identify"
        if part == "identify" and not split.is_train[k]:
            part = "later visit"
        pose = bool(table.is_pose[k])
        rows.append(
            (
                calibration.pose_names[int(table.pose_id[k])],
                str(int(table.repeat[k])),
                str(table.kind[k]),
                part,
                f"{before.position[k] * MM:.6f}",
                f"{after.position[k] * MM:.6f}",
                f"{before.rotation[k] * DEG:.6f}" if pose else "",
                f"{after.rotation[k] * DEG:.6f}" if pose else "",
            )
        )
    head = ("pose_id", "repeat", "kind", "split", "error_before_mm", "error_after_mm",
            "rotation_before_deg", "rotation_after_deg")  # fmt: skip
    return csv_text(head, rows)


def csv_text(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A CSV with plain line ends."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()


def _miss_arrays(name: str, misses: Misses) -> dict[str, np.ndarray[Any, Any]]:
    """The misses of one model."""
    return {
        f"{name}/miss_xyz_m": misses.vector,
        f"{name}/miss_m": misses.position,
        f"{name}/miss_rad": misses.rotation,
    }


def _fit(fit: Fit) -> dict[str, Any]:
    """Headline of one model."""
    found = fit.identification
    return {
        "rank": found.reduction.rank,
        "free_numbers": len(found.reduction.kept) + len(found.reduction.dropped),
        "estimated": found.rank,
        "condition": found.reduction.condition,
        "dependencies": list(sentences(found.reduction.sentences)),
        "chi_square_per_dof": found.chi_square / found.dof if found.dof > 0 else None,
        "p_value": found.p_value,
        "noise_factor": fit.noise_factor,
        "certificate": found.certificate,
        "status": found.status.value,
        "train": _figures(fit.train),
        "held_out": _figures(fit.test),
    }


def _figures(figures: Figures | None) -> Mapping[str, Any] | None:
    """Statistics with units in the keys."""
    if figures is None:
        return None
    out = _accuracy(figures.position, "mm", MM) | {"median_mm": figures.median * MM}
    return out if figures.rotation is None else out | _accuracy(figures.rotation, "deg", DEG)


def _accuracy(a: Accuracy, unit: str, scale: float) -> dict[str, Any]:
    """Statistics of one kind of error."""
    return {
        f"mean_{unit}": a.mean * scale,
        f"rms_{unit}": a.rms * scale,
        f"p95_{unit}": a.p95 * scale,
        f"max_{unit}": a.maximum * scale,
    }
