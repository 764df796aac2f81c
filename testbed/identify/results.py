"""result.json, arrays.npz and the small tables of a calibration; units in the names."""

from collections.abc import Mapping
from dataclasses import astuple
from typing import Any

import numpy as np

from calib.measurement.accuracy import Accuracy
from testbed.identify.applies.rows import HEAD, held_out_places, place_numbers
from testbed.identify.calibration import Calibration
from testbed.identify.conditions import conditions_numbers
from testbed.identify.handback.delivered import Delivered
from testbed.identify.handback.results import hand_back_numbers
from testbed.identify.handback.states import handed_numbers
from testbed.identify.records import Figures, FittedModel, RowErrors
from testbed.identify.results_statement import decisions, statements, targets
from testbed.identify.shared import shared_numbers
from testbed.identify.visits.report import part_of, visit_numbers
from testbed.identify.words import notice, reasons, verdict
from testbed.jobsheet.report import job_numbers
from testbed.report.text import csv_text
from testbed.robots.write.joint_map import JointMap, joint_map, joint_map_rows
from testbed.store.quantities import (
    AS_NAMED,
    METRE,
    RADIAN,
    Quantity,
    Unit,
    as_arrays,
    as_json,
    below,
    fields_of,
    unitless,
)
from testbed.units import DEG, MM, sentences

FORMAT = 1
KIND = "calibration"
DELIVERED = {
    name: name
    for name in ("robot", "urdf", "mjcf", "program", "program_failed", "program_conditions")
}


def headline(calibration: Calibration, delivered: Delivered) -> dict[str, Any]:
    """Every headline number and word of a calibration as plain JSON values."""
    source, split, outliers = calibration.source, calibration.split, calibration.gross
    table, choice, trust = calibration.measurements, calibration.choice, calibration.proof.trust
    words: dict[str, object] = {
        "format": FORMAT,
        "kind": KIND,
        "notice": notice(calibration),
        "session": source.name,
        "robot": source.robot,
        "seed": split.seed,
        "files_sha256": dict(source.files),
        "verdict/believable": calibration.settled,
        "verdict/believe": trust.believe,
        "verdict/sentence": verdict(calibration),
        "verdict/reasons": reasons(calibration),
        "data/rows": len(table),
        "data/poses": table.n_poses,
        "data/kinds": sorted(set(table.kind.tolist())),
        "data/joints": source.joints,
        "data/uncertainty": source.uncertainty,
        "data/masked": source.masked,
        "data/drift": source.drift,
        "data/warnings": (*source.warnings, *calibration.warnings),
        "split/sentence": split.sentence,
        "split/stated": split.stated,
        "split/train_poses": table.rows(calibration.is_used).n_poses,
        "split/held_out_poses": table.rows(split.is_test).n_poses,
        "outliers/left_out_rows": outliers.left_out.sum(),
        "outliers/training": outliers.sentences,
        "outliers/held_out": outliers.held_out_sentences,
        "outliers/held_out_rows": outliers.held_out_names,
        "frames": calibration.frames,
        "before/what": "nominal links, base, tool and fixtures fitted to the training rows",
    }
    chosen: dict[str, object] = {
        "model": choice.chosen,
        "model_choice/asked": choice.asked,
        "model_choice/sentence": choice.sentence,
        "model_choice/log_evidence": choice.log_evidence,
    }
    keys = ("name", "unit", "old", "new", "delta", "U_k2")
    numbers = [
        {
            **dict(zip(keys, astuple(one.row), strict=True)),
            "tolerance": one.tolerance,
            "held_by": one.held_by,
        }
        for one in handed_numbers(calibration)
    ]
    parts = [
        *unitless(words),
        Quantity("outliers/R95_mean_without_um", outliers.radius_without, METRE),
        *below("data/conditions", conditions_numbers(calibration)),
        *below("sessions", visit_numbers(calibration)),
        *below("job", job_numbers(calibration.set_up.job)),
        *_figures("before/train", calibration.before_train),
        *_figures("before/held_out", calibration.before_test),
        *(each for fit in calibration.fits for each in below(f"models/{fit.model}", _model(fit))),
        *unitless(chosen),
        *below("statements", statements(calibration)),
        *below("applies", place_numbers(calibration)),
        *below("shared", shared_numbers(calibration.shared)),
        Quantity("parameters", numbers),
        *below("handed_back", hand_back_numbers(calibration)),
        *below("delivered", fields_of(delivered, DELIVERED)),
        *below("targets", targets(delivered.targets)),
        *below("decisions", decisions(calibration, delivered)),
    ]
    return as_json(parts)


def map_of(calibration: Calibration) -> JointMap | None:
    """What each joint turns beside its command, if the chosen model has waves of joints."""
    result = calibration.fit.identification
    found = joint_map(result.model, result.parameters, calibration.covariance)
    return found if len(found.joints) else None


def joint_map_csv(calibration: Calibration) -> str | None:
    """joint_map.csv, for controllers that take tables; None without waves of joints."""
    found = map_of(calibration)
    return None if found is None else csv_text(*joint_map_rows(found))


def arrays(calibration: Calibration) -> dict[str, np.ndarray[Any, Any]]:
    """The main arrays of a calibration, names with units."""
    table, before = calibration.measurements, calibration.before.chain
    own: dict[str, object] = {
        "q_rad_m": table.q,
        "pose_id": table.pose_id,
        "is_test": calibration.split.is_test,
        "is_used": calibration.is_used,
        "before/T_world_base": before.T_world_base,
        "before/T_flange_tool": before.T_flange_tool,
    }
    out = [*_as_named(own), *_error_arrays("before", calibration.before_misses)]
    for fit in calibration.fits:
        result, chain = fit.identification, fit.identification.model.chain
        values: dict[str, object] = {
            "links": chain.links,
            "T_world_base": chain.T_world_base,
            "T_flange_tool": chain.T_flange_tool,
            "joint_terms": result.model.joint_errors.coefficients,
            "step": result.step,
            "covariance": result.covariance,
            "scatter_covariance": fit.scatter,
        }
        out += [*_error_arrays(fit.model, fit.misses), *below(fit.model, _as_named(values))]
    return as_arrays(out)


def _as_named(values: Mapping[str, object]) -> list[Quantity]:
    """Arrays whose entries differ in unit, or have none."""
    return [Quantity(name, value, AS_NAMED) for name, value in values.items()]


def split_csv(calibration: Calibration) -> str:
    """Every row: what it was used for, and its errors before and after."""
    table, split, outliers = calibration.measurements, calibration.split, calibration.gross
    before, after = calibration.before_misses, calibration.fit.misses
    found, rows = held_out_places(calibration), []
    places = {} if found is None else found.cells()
    for k in range(len(table)):
        part = "test" if split.is_test[k] else "left out" if outliers.left_out[k] else "identify"
        if part == "identify" and not split.is_train[k]:
            part = part_of(calibration, k) or "later visit"
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
                *places.get(k, ("",) * len(HEAD)),
            )
        )
    head = ("pose_id", "repeat", "kind", "split", "error_before_mm", "error_after_mm",
            "rotation_before_deg", "rotation_after_deg", *HEAD)  # fmt: skip
    return csv_text(head, rows)


def _error_arrays(name: str, errors: RowErrors) -> list[Quantity]:
    """The errors of one model, row by row."""
    return [
        Quantity(f"{name}/miss_xyz_m", errors.vector, METRE),
        Quantity(f"{name}/miss_m", errors.position, METRE),
        Quantity(f"{name}/miss_rad", errors.rotation, RADIAN),
    ]


def _model(fit: FittedModel) -> list[Quantity]:
    """Headline of one model."""
    result = fit.identification
    words: dict[str, object] = {
        "rank": result.reduction.rank,
        "free_numbers": len(result.reduction.kept) + len(result.reduction.dropped),
        "estimated": result.rank,
        "condition": result.reduction.condition,
        "dependencies": sentences(result.reduction.sentences),
        "chi_square_per_dof": result.chi_square / result.dof if result.dof > 0 else None,
        "p_value": result.p_value,
        "noise_factor": fit.noise_factor,
        "certificate": result.certificate,
        "status": result.status.value,
    }
    return [*unitless(words), *_figures("train", fit.train), *_figures("held_out", fit.test)]


def _figures(path: str, figures: Figures | None) -> list[Quantity]:
    """Statistics of the errors over some rows; null without rows."""
    if figures is None:
        return [Quantity(path, None)]
    out = [*_accuracy(figures.position, "mm", METRE), Quantity("median_mm", figures.median, METRE)]
    if figures.rotation is not None:
        out += _accuracy(figures.rotation, "deg", RADIAN)
    return below(path, out)


def _accuracy(errors: Accuracy, ending: str, unit: Unit) -> list[Quantity]:
    """Statistics of one kind of error."""
    names = {"mean": errors.mean, "rms": errors.rms, "p95": errors.p95, "max": errors.maximum}
    return [Quantity(f"{name}_{ending}", value, unit) for name, value in names.items()]
