"""The joints that belong to the readings of one file: read, matched, without copies."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from testbed.files.cleaned import Cleaned, sheet_of, table_in
from testbed.files.columns import TEXTS
from testbed.files.joints import has_joints, read_joints
from testbed.files.matching import Match, by_cycle, by_order, by_pose, by_row
from testbed.files.observed import has_readings, unused_columns
from testbed.files.refusal import refusal, require_names
from testbed.files.rows.by_time import by_time
from testbed.files.rows.copies import without_averages, without_copies
from testbed.files.rows.stale import stale_rows
from testbed.files.session_toml import SessionFile
from testbed.files.sources import Sources
from testbed.files.table import DataTable
from testbed.files.targets import TargetPart
from testbed.gates.text import FileText
from testbed.robots.robot import Robot
from testbed.units import listed

IDLE = {
    "pose": ("target", "anchor", "path"),
    "point": ("anchor", "path"),
    "distance": ("station", "path"),
}
"""Columns of texts that say nothing of readings of a kind."""
SHOWN = 4
"""Targets named in one sentence."""
OF_JOINTS = ("station", "anchor", "path")
"""The same beside joints in a file of their own."""


def with_joints(
    cleaned: Cleaned,
    sources: Sources,
    settings: SessionFile,
    robot: Robot,
    others: Sequence[Cleaned],
    *,
    drop: bool,
) -> tuple[TargetPart, Match]:
    """The joints of one file's readings; `others` show other poses, or other columns of it."""
    how, readings, section = settings.joints, cleaned.readings, cleaned.section
    apart = how.file is not None or sources.data is not None
    text = (
        sources.text(how.file, "joints", sheet_of(how, section, how.file))
        if apart
        else cleaned.text
    )
    same = text is cleaned.text
    table = table_in(text, settings, how, section if same else None)
    nests = settings.drift.nests if same and settings.drift else ()
    if sources.data is not None and not same:
        _require_one_place(table, cleaned, sources, settings, robot)
    joints = read_joints(table, robot, how.source, drop=drop, nests=nests)
    if same:
        match = by_row(joints, readings)
    elif readings.cycling:
        match = by_cycle(joints, readings, robot.model)
    elif settings.match == "order":
        match = by_order(joints, readings, robot.model, cleaned.lines)
    elif settings.match == "time":
        slides = robot.model.chain.prismatic[: joints.q.shape[1]] > 0
        match, told = by_time(
            joints, readings, slides, settings.match_within_s, ahead=how.clock_offset_s, drop=drop
        )
        readings = replace(readings, notes=(*readings.notes, told))
    else:
        poses = {name for other in others for name in other.poses}
        match = by_pose(joints, readings, drop=drop, elsewhere=poses)
    part = TargetPart(joints.rows(match.joints), readings.rows(match.readings), section)
    own, idle = ([readings.columns], IDLE[readings.kind]) if same else ([], OF_JOINTS)
    if not same:
        with_names = _with_targets_of_joints(part, len(joints))
        idle = OF_JOINTS if with_names is not part else (*OF_JOINTS, "target")
        part = with_names
    nests_named = ("target",) if settings.drift is not None else ()
    unused = unused_columns(
        table, joints.used, *own, elsewhere=_read_of(text, others),
        idle={*idle} - {*nests_named},
    )  # fmt: skip
    if not same and cleaned.table is not None:
        unused += unused_columns(
            cleaned.table, readings.columns, elsewhere=_read_of(cleaned.text, others),
            idle={*IDLE[readings.kind]} - {*nests_named},
        )  # fmt: skip
    notes = (*part.readings.notes, *(one.sentence for one in unused))
    part = replace(part, readings=replace(part.readings, notes=notes, unread=tuple(unused)))
    if settings.match == "time" and part.joints.extras.pose is None:  # a log numbers no poses
        named = replace(part.joints.extras, pose=part.readings.extras.pose)
        part = replace(part, joints=replace(part.joints, extras=named))
    # only now: match = "order" counts the rows of the file
    fresh, stale = stale_rows(part, robot.model, fine=cleaned.fine)
    part, copies, alike = without_copies(part.rows(fresh), fine=cleaned.fine)
    part, means = without_averages(part)
    # only now: nests have no pose, and may be the only targets with a name
    require_names("pose_id", part.joints.extras.pose or (), part.joints.place)
    for side in (part.joints, part.readings):
        require_names("tool", side.extras.conditions.tool or (), side.place)
    if readings.kind != "pose" and any(part.readings.target):
        require_names("target", part.readings.target, part.readings.place)
    said = (*match.warnings, *alike, *_several_targets(part))
    return part, replace(match, masked=(*stale, *copies, *means), warnings=said)


def _several_targets(part: TargetPart) -> tuple[str, ...]:
    """A warning of full poses of several targets by name, which are taken as those of one."""
    if part.readings.kind != "pose":
        return ()
    for where, column in (
        (part.readings.where, part.readings.target),
        (part.joints.where, part.joints.extras.target or ()),
    ):
        names = sorted({*column} - {""})
        # a name that never comes again is where the robot was sent
        if 1 < len(names) < len(column):
            return (
                f"{where}: the column target names {len(names)} targets ("
                f"{listed(names, SHOWN)}), and [frames] takes all poses as those of "
                "one target; if several were mounted, give each a [[session]] of its own",
            )
    return ()


def _with_targets_of_joints(part: TargetPart, count: int) -> TargetPart:
    """Points named as in the file of the `count` joints, where their own names no targets.

    Each of these joints belongs to one reading. Names that never come again are those of where the
    robot was sent: a reflector is measured more than once.
    """
    names, readings = part.joints.extras.target or (), part.readings
    paired = len(part) == count == len(np.unique(part.joints.row))
    if readings.kind != "point" or any(readings.target) or not paired:
        return part
    if not 0 < len(set(names)) < len(names):
        return part
    return replace(part, readings=replace(readings, target=names))


def _require_one_place(
    joints: DataTable, cleaned: Cleaned, sources: Sources, settings: SessionFile, robot: Robot
) -> None:
    """Refuse a table of both kinds of which session.toml, beside it, takes one from another file.

    Raises
    ------
    InputError
        C41: joints of one session would be matched with readings of another.
    """
    data, table, other = str(sources.data), cleaned.table, settings.joints.file
    if other is None and has_readings(joints):
        kind, key, other = "readings", cleaned.section.name, cleaned.readings.where
    elif other is not None and table is not None and has_joints(table, robot):
        kind, key = "joints", "joints"
    else:
        return
    raise refusal(
        data, "--config", f"has {kind} of its own, and [{key}] takes those of {other}", code="C41",
        fix=f"take file = out of [{key}], or name both files in a session.toml and give that alone",
    )  # fmt: skip


def _read_of(text: FileText, others: Sequence[Cleaned]) -> set[str]:
    """Columns of a file that other sections read, as the file calls them."""
    same = [other for other in others if other.table is not None and other.text is text]
    return {
        other.table.names[name]
        for other in same
        if other.table is not None
        for name in (*other.readings.columns.names, *TEXTS)
        if name in other.table.names and name not in IDLE[other.readings.kind]
    }
