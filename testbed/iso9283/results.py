"""result.json and iso9283.csv of a test: every figure with its limits, units in the names."""

from typing import Any

import numpy as np

from testbed.iso9283.decided import decisions, overall
from testbed.iso9283.records import STANDARD, CycleResult, StatedFigure
from testbed.iso9283.words import enough, mark, notice, reasons, verdict
from testbed.jobsheet.report import job_numbers
from testbed.report.text import csv_text
from testbed.store.quantities import METRE, RADIAN, Quantity, as_json, below, stated, unitless

FORMAT = 1
KIND, FILES = "iso9283", "files_sha256"


def headline(result: CycleResult) -> dict[str, Any]:
    """Every figure and word as plain JSON values."""
    test, visits = result.test, result.test.visits
    words: dict[str, object] = {
        "format": FORMAT,
        "kind": KIND,
        "notice": notice(result),
        "standard": STANDARD,
        "test": test.name,
        FILES: {one.path.name: one.sha256 for one in test.files},
        "verdict/mark": mark(result),
        "verdict/sentence": verdict(result),
        "verdict/reasons": reasons(result),
        "verdict/decision": overall(result) or None,
        "verdict/cycles_of_the_standard": enough(result),
        "data/poses": list(dict.fromkeys(visits.pose)) if visits else [],
        "data/cycles": visits.cycles if visits else 0,
        "data/paths": {one.name: len(one.runs) for one in test.paths},
        "data/frame": result.frame,
        "data/uncertainty": test.uncertainty or None,
        "data/conditions": test.conditions or None,
        "data/speed_percent": test.speed_percent,
        "data/date": test.date or None,
        "data/notes": test.notes,
        "data/warnings": test.warnings,
    }
    parts = [*unitless(words), *below("job", job_numbers(test.job))]
    for one in decisions(result):
        own = [stated("limit_um", one.limit, METRE)]
        own += unitless({"decision": one.word, "sentence": one.sentence})
        parts += below(f"decisions/{one.name}", own)
    for figure in result.figures:
        where = figure.where.replace("/", "|")
        parts += below(f"figures/{figure.name}/{where}", _numbers(figure))
    if result.drifts:
        parts.append(Quantity("drift/p_of_all_poses", result.drift_p_value))
    for drift in result.drifts:
        keys = ("dAP", "dRP")
        for key, chance, p in zip(keys, drift.chance, drift.p_values, strict=True):
            where = f"drift/{drift.where.replace('/', '|')}/{key}"
            parts += below(where, [Quantity("chance_95_um", chance, METRE), Quantity("p", p)])
    return as_json(parts)


def _numbers(figure: StatedFigure) -> list[Quantity]:
    """One figure."""
    unit, end = (RADIAN, "mdeg") if figure.angle else (METRE, "um")
    floor = None if np.isnan(figure.floor) else figure.floor
    values = {
        "value": figure.value,
        "lower_95": figure.lower,
        "upper_95": figure.upper,
        "u": figure.u,
        "floor": floor,
    }
    return [
        *(Quantity(f"{name}_{end}", value, unit) for name, value in values.items()),
        Quantity("cycles", figure.cycles),
    ]


def iso_csv(result: CycleResult) -> str:
    """iso9283.csv: one row per figure."""
    head = ("figure", "where", "value", "lower_95", "upper_95", "u", "floor", "unit", "cycles")
    rows = []
    for figure in result.figures:
        names = ("value", "lower_95", "upper_95", "u", "floor")
        end = "mdeg" if figure.angle else "um"
        shown = {one.name: one.shown for one in _numbers(figure)}
        cells = (shown[f"{name}_{end}"] for name in names)
        rows.append(
            (
                figure.name,
                figure.where,
                *("" if cell is None else f"{cell:.6g}" for cell in cells),
                end,
                str(figure.cycles),
            )
        )
    return csv_text(head, rows)
