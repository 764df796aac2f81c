"""Conditions of rows for a model: loads, directions of approach, torques and temperature."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.operating import AS_USUAL, OperatingConditions, approaches
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.refusal import refusal
from testbed.files.rows.beside import BesideJoints
from testbed.files.rows.say import NO_TORQUES, UNKNOWN, RowsSay
from testbed.robots.file_frames import hung_in_chain
from testbed.robots.robot import NO_MASS, Robot
from testbed.units import counted

SAME_JOINTS = 1e-6
"""Rows at joints that differ by no more were measured at one stop [rad, m]."""


@dataclass(frozen=True, slots=True, eq=False)
class RowsOfFile:
    """The rows of one file that were matched, in the order of the file."""

    q: Array
    """(m, n) [rad, m]."""
    place: tuple[str, ...]
    """(m,) file and line."""
    number: Index
    """(m,) place among all rows of the file, lost readings too."""
    time: Array | None
    """(m,) [s]."""
    beside: BesideJoints


def operating_conditions(
    files: Sequence[RowsOfFile], conditions: Conditions, robot: Robot, order: str, said: str = ""
) -> tuple[OperatingConditions, RowsSay, tuple[str, ...]]:
    """Conditions of all rows, what they say for a model, and notes for the report.

    Parameters
    ----------
    files : sequence of RowsOfFile
        Rows of the files, one after the other.
    conditions : Conditions
        Payload, tool and temperature of all rows.
    robot : Robot
        Which was measured.
    order : str
        [identification] order.
    said : str
        The session.toml, where its [conditions] state the payload.

    Raises
    ------
    InputError
        M25: a payload heavier than the arm. M35: torques of another number of joints.
    """
    notes, unsaid = [], []
    _require_light(conditions, [said] if said else [p for one in files for p in one.place], robot)
    if conditions.payload is not None and conditions.payload.any() and conditions.center is None:
        notes.append(
            "payload_kg has no payload_x_mm, payload_y_mm, payload_z_mm beside it: the center of "
            "the payload is taken at the flange"
        )
    torque, drive, why = _torques(files)
    if why:
        unsaid.append(("torque", why))
    if torque is not None and torque.shape[1] != robot.model.chain.n_joints:
        raise refusal(
            files[0].place[0].rpartition(":")[0], f"{drive}1",
            f"has the {drive} of {counted(torque.shape[1], 'joint')}", code="M35",
            allowed=f"{robot.name} has {robot.model.chain.n_joints}",
            fix="give that of every joint",
        )  # fmt: skip
    directions, why = [], ""
    for one in files:
        sides, why_not = _directions(one, order)
        directions.append(sides)
        why = why or why_not
    if why:
        unsaid.append(("approach", why))
        if why != UNKNOWN:
            notes.append(why)
    approach = np.concatenate(directions)
    found = OperatingConditions(
        conditions.payload,
        hung_in_chain(robot, conditions.payload, conditions.center),
        approach if approach.any() else None,
        torque,
        conditions.temperature,
    )
    return found if found.stated else AS_USUAL, RowsSay(drive, tuple(unsaid)), tuple(notes)


def stated_order(files: Sequence[RowsOfFile]) -> Index | None:
    """Place (m,) in time of the rows of one file by its column order; None without one that sorts.

    Several files may count anew in each of them.
    """
    if len(files) != 1 or files[0].beside.order is None or _no_order(files[0]):
        return None
    order = np.empty(len(files[0].q), dtype=np.int64)
    order[np.argsort(files[0].beside.order, kind="stable")] = np.arange(len(order))
    return frozen(order, np.int64)


def _require_light(conditions: Conditions, place: Sequence[str], robot: Robot) -> None:
    """Refuse a payload that weighs more than the arm, where it is known what that weighs."""
    if conditions.payload is None or any(note.startswith(NO_MASS) for note in robot.notes):
        return
    most, own = float(conditions.payload.max(initial=0.0)), float(robot.masses.sum())
    if most > own > 0:
        table = "[conditions] " * (len(place) < len(conditions.payload))
        raise refusal(
            place[0] if table else place[int(conditions.payload.argmax())], "payload_kg",
            f"{table}payload_kg is {most:g}, and the moving parts of {robot.name} weigh "
            f"{own:.3g} kg", code="M25", value=most, allowed="an arm carries less than it weighs",
            fix="give the payload in kg",
        )  # fmt: skip


def _torques(files: Sequence[RowsOfFile]) -> tuple[Array | None, str, str]:
    """Torques (m, n) of all rows, whether they are currents, and why there are none."""
    there = [one.beside for one in files if one.beside.torque is not None]
    kinds = {beside.drive for beside in there}
    if not there:
        return None, "", NO_TORQUES
    if len(there) < len(files) or len(kinds) > 1:
        return None, "", "not all files have them, or some have torques and some currents"
    torques = [beside.torque for beside in there if beside.torque is not None]
    return np.concatenate(torques), kinds.pop(), ""


def _directions(rows: RowsOfFile, order: str) -> tuple[Array, str]:
    """Directions (m, n) of the last moves of one file, and why they are not known.

    The row after one that was left out was approached from joints that nobody knows.
    """
    nowhere = np.zeros_like(rows.q)
    key = rows.time
    if rows.beside.order is not None:
        key, odd = rows.beside.order, _no_order(rows)
        if odd:
            return nowhere, odd
    if order == "unknown" or (key is None and order != "as measured"):
        return nowhere, UNKNOWN
    found = approaches(rows.q, key)
    found[_after_lost(rows.number, key)] = 0.0
    return found, ""


def _after_lost(number: Index, key: Array | None) -> Index:
    """Rows between which and the one before them, as the file stands, others were lost."""
    at = np.arange(len(number)) if key is None else np.argsort(key, kind="stable")
    there = np.zeros(int(number.max(initial=0)) + 2, dtype=np.int64)
    there[number] = 1
    before = np.cumsum(there) - there
    low = np.minimum(number[at[1:]], number[at[:-1]])
    high = np.maximum(number[at[1:]], number[at[:-1]])
    return at[1:][before[high] - before[low] < high - low]


def _no_order(rows: RowsOfFile) -> str:
    """Why a column order does not sort the rows: one number for two stops; empty if it does."""
    key = rows.beside.order
    assert key is not None  # asked for only where it is there
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    at = first[group.ravel()]
    off = np.abs(rows.q - rows.q[at]).max(axis=1) > SAME_JOINTS
    if not off.any():
        return ""
    row = int(np.argmax(off))
    where, _, line = Path(rows.place[at[row]]).name.rpartition(":")
    again = rows.place[row].rpartition(":")[2]
    return (
        f"the column order of {where} is not an order: lines {line} and {again} both have "
        f"{key[row]:g}, at other joints"
    )
