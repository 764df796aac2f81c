"""Several folders of one kind in one table: their figures, as their files have them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from calib.errors import refuse
from calib.shown import length_unit
from testbed.cli.folders import ISO9283, PLAN
from testbed.report.text import table
from testbed.store import layout
from testbed.store.documents import read_json
from testbed.store.manifest import CALIBRATION, CAMPAIGN
from testbed.units import UM, plain, significant

NUMBERS = {PLAN: layout.PLAN, ISO9283: layout.RESULT, CALIBRATION: layout.RESULT}
"""Where the figures of a folder stand."""
TITLES = {
    PLAN: "What plans promise", ISO9283: "Tests after ISO 9283", CALIBRATION: "Calibrations",
}  # fmt: skip
CERTIFIED = "efficiency"
"""Proven to be at least so large: rounded up, it would say more than was proven."""
COLUMNS: dict[str, dict[str, str]] = {
    PLAN: {
        "scenario": "scenario", "robot": "robot", "poses": "poses", "s": "duration_s",
        "R95 um": "predicted/R95_over_goal_um", "worst um": "predicted/R95_worst_um",
        "misfit seen um": "predicted/misfit_seen_um", CERTIFIED: "certificate/efficiency",
    },
    ISO9283: {
        "test": "test", "cycles": "data/cycles", "AP um": "figures/AP/*/value_um",
        "RP um": "figures/RP/*/value_um", "AT um": "figures/AT/*/value_um",
        "RT um": "figures/RT/*/value_um", "decision": "verdict/decision",
    },
    CALIBRATION: {
        "session": "session", "robot": "robot", "model": "model",
        "poses": "split/train_poses", "held out": "split/held_out_poses",
        "before mm": "before/held_out/mean_mm", "after mm": "models/{model}/held_out/mean_mm",
        "p95 mm": "models/{model}/held_out/p95_mm", "R95 um": "statements/R95_mean_um",
        "relative": "statements/relative", "believed": "verdict/believable",
        "guarded by": "statements/guards",
    },
}  # fmt: skip
"""Figures by the head of their column; ``*`` stands for the place where one is largest."""
NONE = "-"


def document(kind: str, path: Path) -> dict[str, Any]:
    """The figures of a folder, as its file has them.

    Raises
    ------
    InputError
        D42: it has no such file, or one that is damaged.
    """
    fix = "give the command that wrote it again, with another --out"
    try:
        return read_json(path / NUMBERS[kind], fix=fix)
    except FileNotFoundError as error:
        message = f"has no {NUMBERS[kind]}: what wrote it was not finished, or the file was removed"
        raise refuse("", code="D42", message=message, fix=fix, where=str(path)) from error


def table_of(kind: str, found: Mapping[str, Mapping[str, Any]]) -> str:
    """Folders of one kind as a table, by their names."""
    if kind == CAMPAIGN:
        from testbed.cli.terminal import HEAD, headline_rows

        cells = [
            [name, result["scenario"], str(result["seed"]), *row]
            for name, result in found.items()
            for row in headline_rows(result)
        ]
        notice = next(iter(found.values()))["notice"]
        title = "Tool error on held-out poses"
        return f"{notice}\n{table(title, ('run', 'scenario', 'seed', *HEAD), cells)}"
    heads, each = columns(kind, [*found.values()])
    cells = [[name, *row] for name, row in zip(found, each, strict=True)]
    head = ("folder", *heads)
    shown = [k for k in range(len(head)) if any(row[k] != NONE for row in cells)]
    return table(TITLES[kind], [head[k] for k in shown], [[row[k] for k in shown] for row in cells])


def columns(
    kind: str, found: Sequence[Mapping[str, Any]]
) -> tuple[list[str], list[tuple[str, ...]]]:
    """Heads, and one row per folder with a dash where it has no such figure.

    A column of micrometers is one of millimeters where its largest figure asks for these.
    """
    heads, cells = [], []
    for head, path in COLUMNS[kind].items():
        told = [figure(one, path.format(model=one.get("model", ""))) for one in found]
        if head.endswith(" um"):
            lengths = [x / UM for x in told if isinstance(x, float)]
            scale, unit = length_unit(lengths)
            told = [x / UM * scale if isinstance(x, float) else x for x in told]
            heads.append(f"{head.removesuffix('um')}{unit}")
        else:
            heads.append(head)
        cells.append([cell(value, head) for value in told])
    return heads, [*zip(*cells, strict=True)]


def figure(document: object, path: str) -> object:
    """What stands at a path of a document; None where nothing does.

    Examples
    --------
    >>> figure({"a": {"x": {"v": 1}, "y": {"v": 3}}}, "a/*/v")
    3
    """
    first, _, rest = path.partition("/")
    if not isinstance(document, Mapping):
        return None
    if first == "*":
        found = [figure(one, rest) for one in document.values()]
        return max((one for one in found if isinstance(one, int | float)), default=None)
    value = document.get(first)
    return figure(value, rest) if rest else value


def cell(value: object, head: str) -> str:
    """A figure in the unit that its head in `COLUMNS` names, or in that which suits its column."""
    if value is None or isinstance(value, Mapping | list):
        return NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and head == CERTIFIED:
        from testbed.plan.promises import efficiency_word

        return efficiency_word(value)
    if isinstance(value, float):
        return f"{value:.4f}" if head.endswith(" mm") else plain(significant(value))
    return str(value)
