"""Joint vectors that people hand in: lists of the scenario and CSV files of joint targets."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.uncertainty.statement.conditions import Conditions
from testbed.bounds import PAYLOAD, TEMPERATURE, Bound
from testbed.gates.kinds import require_no_program
from testbed.gates.text import read_text, separator_of, split
from testbed.report.text import unguarded
from testbed.robots.catalog import Robot
from testbed.robots.controller import BEYOND
from testbed.units import DEG, MM, counted, unit_of

MAX_MB = 10.0
UNITS = {"deg": np.pi / 180, "rad": 1.0, "mm": 1e-3, "m": 1.0}
SAME = 1e-9
"""Joint vectors nearer than this in every joint are one pose [rad, m]."""


def from_deg(
    robot: Robot, rows: Sequence[Sequence[float]], where: str, *, single: bool = False
) -> Array:
    """Joint vectors (k, n) of the arm [rad, m] from those of its controller in deg, mm for slides.

    Checks their length, the joint limits and that none comes twice; `where` names the key, which
    holds one pose only if `single`.
    """
    own = robot.controller.counted(robot.model.chain.n_joints)
    n = len(own)
    names = [where if single else f"{where} entry {k + 1}" for k in range(len(rows))]
    for k, row in enumerate(rows):
        if len(row) != n:
            message = f"{names[k]} has {counted(len(row), 'number')}"
            motors = " with a motor" * bool(robot.controller.held)
            has = f"{robot.name} has {n} joints{motors}"
            raise refuse(where, list(row), has, code="S37", message=message, fix="correct the list")
    scale = np.where(robot.model.chain.prismatic, 1e-3, np.pi / 180)[own]
    q = robot.controller.read(
        np.array(rows, dtype=np.float64).reshape(-1, n) * scale, robot.model.chain.n_joints
    )
    check_joints(robot, q, names, where)
    return frozen(q)


def check_joints(robot: Robot, q: ArrayLike, names: Sequence[str], field: str) -> None:
    """Refuse joint vectors (k, n) of the arm that are not finite, beyond a limit, or there twice.

    Limits are those of the arm's joints and of its controller's.
    """
    q = np.asarray(q)
    lower, upper = robot.limits.T
    for row, name in zip(q, names, strict=True):
        if not np.isfinite(row).all():
            message = f"{name}: joint {int(np.argmin(np.isfinite(row))) + 1} is not a number"
            raise refuse(field, code="M25", message=message, fix="correct or remove that pose")
        # degrees written with few decimals may round a joint at its limit outward
        by_arm = (row < lower - BEYOND) | (row > upper + BEYOND)
        beyond = np.flatnonzero(by_arm | robot.controller.beyond(row))
        if beyond.size:
            j, counts = int(beyond[0]), robot.controller
            whose = "" if counts.plain else " of the arm" if by_arm[j] else " of the controller"
            of_arm = bool(by_arm[j])
            value = float((row if of_arm else counts.of_arm(row))[j])
            slides = bool(robot.model.chain.prismatic[j])
            unit, size = unit_of(slides), MM if slides else DEG
            low, high = (robot.limits if of_arm else counts.limits)[j] * size
            allowed = f"its limits are {low:g} to {high:g} {unit}"
            message = f"{name}: joint {j + 1}{whose} is {value * size:.6g} {unit}"
            fix = "give joint values in deg inside the limits"
            raise refuse(field, value, allowed, code="M20", message=message, fix=fix)
    order = np.lexsort(np.round(q / SAME).T[::-1]) if len(q) else np.zeros(0, dtype=np.int64)
    for a, b in pairwise(order):
        if np.abs(q[a] - q[b]).max() < SAME:
            first, second = sorted((int(a), int(b)))
            message = f"{names[second]} is the same pose as {names[first]}"
            raise refuse(field, code="M26", message=message, fix="remove one of them")


def read_joints(robot: Robot, path: str | Path) -> Array:
    """Joints (k, n) of the arm [rad, m] of a CSV file of targets, q1_deg ... (also _rad, _mm, _m).

    Other columns are ignored; where there is a column ``role``, rows that a plan.csv does not
    identify from do not count: "test", "via" and "start".
    """
    head, rows = _rows(path)
    places, scale = _columns(robot, head, str(path))
    q = [[_number(row, k, where, head[k]) for k in places] for where, row in rows]
    if not q:
        message, fix = "has no joint targets", "add some rows"
        raise refuse("", code="M35", message=message, fix=fix, where=str(path))
    joints = robot.controller.read(np.array(q) * scale, robot.model.chain.n_joints)
    check_joints(robot, joints, [where for where, _ in rows], "plan.measured")
    return frozen(joints)


def read_conditions(path: str | Path) -> Conditions:
    """What the rows of such a file say of their conditions: payload_kg, tool, temperature_degC.

    Raises
    ------
    InputError
        M25: a cell is empty, or no number; V9: a number beyond sense.
    """
    head, rows = _rows(path)
    payload, temperature = (
        frozen([_within(row, head.index(name), where, name, bound) for where, row in rows])
        if name in head
        else None
        for name, bound in (("payload_kg", PAYLOAD), ("temperature_degC", TEMPERATURE))
    )
    if "tool" not in head:
        return Conditions(payload, None, temperature)
    k = head.index("tool")
    tools = tuple(row[k] if k < len(row) else "" for _, row in rows)
    if any(tools) and "" in tools:
        where, fix = rows[tools.index("")][0], "fill the cell"
        raise refuse("tool", code="M25", message="tool is empty", fix=fix, where=where)
    return Conditions(payload, tools if any(tools) else None, temperature)


def _rows(path: str | Path) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """Head and rows of a file of joint targets, each row with its place."""
    text = read_text(Path(path), str(path), max_mb=MAX_MB, larger="split it")
    require_no_program(text.lines, str(path))
    content = text.content("#")
    separator = separator_of(content[0][1]) if content else ""
    rows = [list(map(unguarded, row)) for row in split(content, separator, str(path))]
    head = rows[0] if rows else []
    role = head.index("role") if "role" in head else None
    kept = []
    for (line, _), row in zip(content[1:], rows[1:], strict=True):
        passed = role is not None and len(row) > role and row[role] in ("test", "via", "start")
        if any(row) and not passed:
            kept.append((f"{path}:{line}", row))
    return head, kept


def _columns(robot: Robot, head: list[str], where: str) -> tuple[list[int], Array]:
    """Place of each joint's column in the head, and the factor to SI."""
    places, scale = [], []
    for j in robot.controller.counted(robot.model.chain.n_joints):
        units = ("mm", "m") if robot.model.chain.prismatic[j] else ("deg", "rad")
        wanted = [f"q{j + 1}_{unit}" for unit in units]
        found = [name for name in wanted if name in head]
        if len(found) != 1 or head.count(found[0]) != 1:
            raise refuse(
                "plan.measured",
                ", ".join(head)[:200],
                f"one of {', '.join(wanted)} belongs in the first line",
                code="M35",
                message=f"has {'more than one' if found else 'no'} column for joint {j + 1}",
                fix="name the columns q1_deg, q2_deg ...",
                where=where,
            )
        places.append(head.index(found[0]))
        scale.append(UNITS[found[0].rsplit("_", 1)[1]])
    return places, np.array(scale)


def _number(row: list[str], k: int, where: str, column: str) -> float:
    """One finite cell."""
    text = row[k].strip() if k < len(row) else ""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        message, allowed = f'{column} is "{text[:40]}"', "it must be a number"
        fix = "correct or remove that row"
        raise refuse(column, text[:40], allowed, code="M25", message=message, fix=fix, where=where)
    return value


def _within(row: list[str], k: int, where: str, column: str, bound: Bound) -> float:
    """One finite cell of a sensible size; a payload is none below zero."""
    value, unit = _number(row, k, where, column), column.rpartition("_")[2]
    message = f"{column} is {value:g}"
    if bound is PAYLOAD and value < 0:
        code, allowed = "M25", "a payload is 0 kg or more"
    elif abs(value) > bound.most:
        code, allowed = "V9", bound.allowed(unit)
    else:
        return value
    raise refuse(column, value, allowed, code=code, message=message, fix="correct it", where=where)
