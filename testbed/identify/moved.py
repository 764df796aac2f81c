"""What changed once, a station, the base, a target, the tool, a joint or the load, in words."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Bool
from calib.geometry.gravity import DOWN
from calib.geometry.model import RobotModel
from calib.identification.outliers.changes import targets_of, told
from calib.identification.outliers.moved import Moved, moved_once, moved_or_back
from calib.measurement.observations import GIVEN, Measurements
from calib.shown import length_unit
from testbed.files.session import Session
from testbed.identify.calibration import Calibration
from testbed.identify.records import FittedModel
from testbed.lengths import with_unit
from testbed.units import DEG, MM, fixed

PART = {"tool": "tool", "target": "tool", "station": "base", "base": "base"}
"""The part of a [[session]] that is another's no more, by what moved."""
ONE_SIDE = "from one side only"
INSTEAD = {
    "tool": "the tool slipped, or was remounted",
    "load": "the load changed",
    "robot": "it is another arm",
    "base": "the base of the robot was moved",
    "station": "the instrument or the base of the robot was moved",
}
APART = "describe the rows from there on as a [[session]] of their own"
PUT_BACK = {
    "station": "the instrument or the base of the robot was pushed, and put back",
    "base": "the base of the robot was moved, and put back",
    "target": "another tool or reflector, or one that was not in its place",
    "tool": "another tool, or one that was not in its place",
    "joint": "its zero was lost, and set again",
    "load": "another payload or tool",
}
"""What happened where it came back, by what moved."""


def moved_in(
    session: Session,
    nominal: RobotModel,
    models: Sequence[FittedModel],
    measurements: Measurements,
    used: Bool,
) -> Moved | None:
    """What moved between two rows that identify, where something tells their order.

    A step that a rich model took for waves of the joints is not in its residuals, but it explains
    those of a simpler model, most of what is beyond noise: what the model misses follows the poses
    and does not begin at a row. Where rows state what bends or lengthens the arm, it may: there
    only the chosen model is asked.

    Parameters
    ----------
    session : Session
        Whose rows. Of several visits it is asked what differs between one and the next: a tool or
        a base that is the same as another's only by the file, or the zero of a joint.
    nominal : RobotModel
        The robot as its file places it: how its base stands tells where gravity pulls.
    models : sequence of FittedModel
        The chosen one, then the simplest: the first whose residuals a step explains counts.
    measurements : Measurements
        All rows (m).
    used : (m,) array of bool
        Rows identified from.
    """
    visit = session.visit if session.visits else None
    if visit is None and session.wanted.order == "unknown":
        return None
    rows = np.flatnonzero(used)
    order = session.in_time[rows] if visit is None else visit[rows]
    table = measurements.rows(rows)
    asked = models[:1] if told(table.conditions) else models
    fits = dict.fromkeys(model.identification for model in asked)
    gravity = nominal.chain.T_world_base[:3, :3].T @ DOWN
    look = moved_or_back if visit is None else moved_once
    steps = (look(fit, table, order, gravity=gravity) for fit in fits)
    found = next((step for step in steps if step is not None), None)
    if found is None:
        return None
    last, row = int(rows[found.last]), int(rows[found.row])
    if found.until is not None and found.back is not None:
        return replace(
            found, last=last, row=row, until=int(rows[found.until]), back=int(rows[found.back])
        )
    if visit is not None and visit[last] == visit[row]:
        return None  # whose rows nobody puts in order
    return replace(found, last=last, row=row)


def moved_words(calibration: Calibration) -> tuple[str, ...]:
    """What moved, between which poses, how far, and what is to be done."""
    found = calibration.moved
    if found is None:
        return ()
    if found.until is not None:
        return (back_words(calibration, found),)
    last, first = (pose_name(calibration, row) for row in (found.last, found.row))
    what, mend = said_of(calibration, found)
    what += or_else(calibration, found)
    if found.or_else and found.what != "joint":
        mend = f'{APART}, tool or base "same as" the first if you know that it stayed'
    explains = explained_by(found)
    if calibration.visits and calibration.visit is not None:
        one, other = (calibration.visits[calibration.visit[k]] for k in (found.row, found.last))
        kinds = (found.what, *(kind for kind, _ in found.or_else))
        if found.what == "load":
            mend = "state the payload of both under [session.conditions]"
        parts = list(dict.fromkeys(PART[kind] for kind in kinds if kind in PART))
        if parts:
            free = " and ".join(f'{part} = "free"' for part in parts)
            mend = f"write {free} in the [[session]] that has it the same as another"
        return (
            f'From session "{one.name}" on something differs from "{other.name}": {what}. '
            f"{explains}; {mend}",
        )
    return (
        f"Between pose {last} and pose {first} something {happened(found)}: from there on {what}. "
        f"{explains}; {mend}",
    )


def back_words(calibration: Calibration, found: Moved) -> str:
    """What moved and came back, between which poses, how far, and what is to be done."""
    ends = (found.last, found.row, found.until, found.back)
    before, first, last, after = (pose_name(calibration, row) for row in ends if row is not None)
    what = said_of(calibration, found)[0].partition(" (")[0] + f" ({PUT_BACK[found.what]})"
    what += or_else(calibration, found)
    return (
        f"Between pose {before} and pose {first} something {happened(found)}, and between pose "
        f"{last} and pose {after} it was as before: in the rows between {what}. "
        f"{explained_by(found)}; leave the rows from pose {first} to pose {last} out, held-out "
        "ones among them as well, or describe them as a [[session]] of their own"
    )


def explained_by(found: Moved) -> str:
    """How much of the errors it explains."""
    return f"That explains {100 * found.explained:.0f} % of the errors beyond noise (p < 0.001)"


def pose_name(calibration: Calibration, row: int) -> str:
    """What the pose of a row is called."""
    return str(calibration.pose_names[calibration.measurements.pose_id[row]])


def happened(found: Moved) -> str:
    """That it moved or changed, in a word."""
    return "changed" if found.what in ("load", "robot") else "moved"


def said_of(calibration: Calibration, found: Moved) -> tuple[str, str]:
    """What stands off, and what mends it."""
    size = with_unit(found.size, digits=2)
    if found.what == "joint":
        slides = calibration.nominal.chain.kinds[found.number] == "prismatic"
        off = float(found.change[0])
        scale, unit = length_unit(off) if slides else (DEG, "deg")
        text = f"{off * scale:+.3g} {unit}"
        what = f"joint {found.number + 1} is {text} off (its zero slipped or was set again)"
        return what, f"correct that joint in the rows of one side, or identify {ONE_SIDE}"
    if found.what == "load":
        what = f"the arm bends by {size} more or less than before (another payload or tool)"
        return what, f"state payload_kg for each row, or identify {ONE_SIDE}"
    if found.what == "robot":
        what = f"the readings are {size} off, as those of another arm (one with links of its own, "
        return f"{what}or one that was hit or mended)", f"identify {ONE_SIDE}"
    if found.what == "target":
        whole = calibration.measurements.rows(calibration.is_used)
        name = _target(calibration, whole, found.number)
        where = f"{size} off on the tool"
        if len(found.change) > 3:  # a 6-D target may turn about the very point that is seen
            where += f", {_turned(found)}"
        what = f"{name} is {where} (it came loose, or was remounted)"
        if len(targets_of(whole)[0]) > 1:
            return what, "leave its rows of one side out"
        return what, APART
    turned = _turned(found)
    if found.what == "tool":
        what = f"all targets are {size} off on the tool as a whole, {turned} (it slipped, or "
        return f"{what}was remounted)", f'{APART}, base = "same as" the first'
    what = f"the readings are {size} off as a whole, {turned} "
    if found.what == "base":
        what = f"the readings of all stations are {size} off as a whole, {turned} (the base of "
        return f"{what}the robot was moved)", f'{APART}, tool = "same as" the first'
    what += "(the instrument or the base of the robot was moved)"
    if len(calibration.set_up.stations) > 1:
        what = f"the readings of station {calibration.set_up.stations[found.number]} are {size} "
        what += f"off as a whole, {turned} (it was moved)"
    return what, f'{APART}, tool = "same as" the first'


def or_else(calibration: Calibration, found: Moved) -> str:
    """What else may have moved instead, behind what did; empty where nothing may."""
    table = calibration.measurements.rows(calibration.is_used)
    others = ", or ".join(_instead(calibration, table, *each) for each in found.or_else)
    return f"; or {others}: the readings do not tell which" * bool(others)


def _instead(calibration: Calibration, table: Measurements, kind: str, number: int) -> str:
    """That another thing moved."""
    if kind == "joint":
        return f"the zero of joint {number + 1} slipped or was set again"
    if kind == "target":
        return f"{_target(calibration, table, number)} came loose, or was remounted"
    if kind == "station" and len(calibration.set_up.stations) > 1:
        return f"station {calibration.set_up.stations[number]} was moved"
    return INSTEAD[kind]


def _turned(found: Moved) -> str:
    """By how much it turned."""
    return f"turned by {fixed(float(np.linalg.norm(found.change[3:])) * DEG, 4)} deg"


def _target(calibration: Calibration, table: Measurements, number: int) -> str:
    """What a target is called."""
    targets, which = targets_of(table)
    row = int(np.argmax(which == number))
    reflector = int(table.reflector[row])
    if len(targets) == 1:
        return "the target"
    if reflector != GIVEN and reflector < len(calibration.reflector_names):
        return f"target {calibration.reflector_names[reflector]}"
    place = " ".join(f"{MM * x:g}" for x in table.offset[row])
    return f"the target at {place} mm"
