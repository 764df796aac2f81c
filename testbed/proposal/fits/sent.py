"""Positions computed by a controller, distinguished from those that an instrument measured."""

from dataclasses import replace

import numpy as np

from testbed.files.frames_fit import target_groups
from testbed.files.rows.exact import exactness
from testbed.files.rows.shifts import FEWEST, as_read, misfit_of, spread_out
from testbed.files.session import Session
from testbed.proposal.drafts import EACH_A_STATION, Draft
from testbed.robots.robot import Robot

PLACE = ("x_", "y_", "z_")
"""Names of coordinates before their unit."""


def is_of_a_controller(robot: Robot, session: Session | None) -> bool:
    """Whether the nominal robot fits positions better than it would fit a real robot's."""
    groups = [] if session is None else target_groups(session.measurements)
    if session is None or not groups:
        return False
    rows = spread_out(groups[0])
    left = misfit_of(robot.model, as_read(session, rows))
    return bool(exactness(robot.model, session, rows, left))


def places_of(draft: Draft) -> tuple[str, ...]:
    """The files and columns that a draft takes its positions from, by their names."""
    section = next(draft.document[name] for name in ("frames", "points", "ranges")
                   if name in draft.document)  # fmt: skip
    several = [name for own in section.get("targets", {}).values() for name in own]
    columns = section.get("columns", {})
    files = section.get("files", [section[key] for key in ("file", "sheet") if key in section])
    return (*files, *(several or [name for own, name in columns.items() if own[:2] in PLACE]))


def without_sent(robot: Robot, draft: Draft, session: Session | None) -> tuple[Draft, str]:
    """A draft of several files without those computed by a controller, and a sentence on these."""
    name = next((key for key in ("frames", "points") if "files" in draft.document.get(key, {})), "")
    if session is None or not name:
        return draft, ""
    table, section = session.measurements, dict(draft.document[name])
    files = section.pop("files")
    made = []
    for k, file in enumerate(files):
        rows = np.flatnonzero(table.station == k)
        if len(rows) < FEWEST or table.is_distance[rows[0]]:
            continue
        some = spread_out(rows)
        if exactness(robot.model, session, some, misfit_of(robot.model, as_read(session, some))):
            made.append(file)
    left = [file for file in files if file not in made]
    if not made or not left:
        return draft, ""
    own = {"files": left} if len(left) > 1 else {"file": left[0]}
    notes = tuple(one for one in draft.notes if len(left) > 1 or one != EACH_A_STATION)
    said = f". {', '.join(made)} is left aside: it has a controller's own poses"
    return replace(draft, document=draft.document | {name: own | section}, notes=notes), said
