"""A plan.csv beside what was measured: its rows that nobody measures, and what it foretells."""

from collections.abc import Iterable
from dataclasses import replace

from testbed.files.text import Sheet

PLAN = {"pose_id", "role", "move", "approach_s"}
"""Columns of every plan."""
STOPS, PASSED = ("identify", "test"), ("start", "via")
"""Roles of poses that are measured, which are words of a column split, and of the others."""
READING = ("x_mm", "y_mm", "z_mm", "azimuth_deg", "elevation_deg", "range_mm")
"""What a plan foretells of a target, behind its name."""


def of_stops(sheet: Sheet) -> Sheet:
    """A plan without the rows that are passed, its role as the split; other sheets as they are."""
    if not set(sheet.head) >= PLAN or "split" in sheet.head:
        return sheet
    role = sheet.head.index("role")
    roles = [row[role] for row in sheet.rows]
    if not set(roles) <= {*STOPS, *PASSED}:
        return sheet
    kept = [k for k, word in enumerate(roles) if word in STOPS]
    return replace(
        sheet,
        head=tuple("split" if name == "role" else name for name in sheet.head),
        rows=tuple(sheet.rows[k] for k in kept),
        lines=tuple(sheet.lines[k] for k in kept),
    )


def foretold(head: Iterable[str]) -> frozenset[str]:
    """Columns of a plan that say what the tracker will show, all six of a target, and its moves."""
    names = set(head)
    targets = {name.removesuffix(f"_{READING[0]}") for name in names if name.endswith(READING[0])}
    groups = [{f"{target}_{axis}" for axis in READING} for target in targets]
    if any(group <= names for group in groups):
        groups.append({"move", "approach_s"} & names)
    return frozenset(name for group in groups if group <= names for name in group)
