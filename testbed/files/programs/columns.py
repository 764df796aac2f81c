"""The joint columns of a program under the names of other controllers: A1, J1, axis 1, joint_1."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from calib.errors import InputError
from testbed.files.dialects.numbers import number_of
from testbed.files.refusal import refusal
from testbed.files.table import DataTable
from testbed.files.text import Sheet
from testbed.robots.robot import Robot

NUMBERED = re.compile(
    r"(?P<word>a|j|q|ax|axis|axes|achse|joint|theta)[ _.-]*(?P<number>[1-9][0-9]?)"
    r"(?:[ _]*[\[(]?(?P<unit>deg|degrees?|°|rad|radians?|mm|m)[\])]?)?",
    re.IGNORECASE,
)
UNITS = {"d": "deg", "°": "deg", "r": "rad"}
"""Units by the first letters of their names."""
ANGLES = ("deg", "rad")
ROTATION = "the columns of the rotation as well"
_PLACE = re.compile(r"(?P<axis>[xyz])(?:[ _]*[\[(]?(?:mm|m)[\])]?)?", re.IGNORECASE).fullmatch
"""A place as controllers call it."""
TURNS = (
    (("a", "b", "c"), ("rz_deg", "ry_deg", "rx_deg"), "kuka"),
    (("w", "p", "r"), ("rx_deg", "ry_deg", "rz_deg"), "fanuc"),
)
"""Angles as controllers call them, as they are called here, and in which order these turn."""


def joints_by_number(sheet: Sheet, robot: Robot) -> dict[str, str]:
    """Our names of joint columns mapped to those of the file; empty if they are ours, or unclear.

    Clear is one column per joint, named by the same word and the number of the joint. The unit is
    that in the names, or degrees if the numbers are too large for radians.
    """
    found = [(name, hit) for name in sheet.head if (hit := NUMBERED.fullmatch(name.strip()))]
    families: dict[str, dict[int, tuple[str, str]]] = {}
    for name, hit in found:
        unit = (hit["unit"] or "").lower()
        family = families.setdefault(hit["word"].lower(), {})
        family[int(hit["number"])] = (name, UNITS.get(unit[:1], unit))
    own = robot.controller.counted(robot.model.chain.n_joints).tolist()
    n, kinds = len(own), [robot.model.chain.kinds[k] for k in own]
    whole = [one for one in families.values() if set(one) == {k + 1 for k in own}]
    if len(whole) != 1 or len(found) != n:
        return {}
    columns = [whole[0][k + 1] for k in own]
    units = [unit for _, unit in columns]
    if not any(units) and "prismatic" not in kinds:
        units = [_unit_by_size(sheet, [name for name, _ in columns], robot)] * n
    if not all(
        unit in (("mm", "m") if kind == "prismatic" else ANGLES)
        for unit, kind in zip(units, kinds, strict=True)
    ):
        return {}
    return {f"q{own[k] + 1}_{unit}": columns[k][0] for k, unit in enumerate(units)}


def _unit_by_size(sheet: Sheet, names: list[str], robot: Robot) -> str:
    """Degrees if some number is beyond every limit in radians; else empty, since it is unclear."""
    places = [sheet.head.index(name) for name in names]
    cells = [row[place].replace(",", ".") for row in sheet.rows for place in places]
    largest = max((abs(value) for value in map(number_of, cells) if np.isfinite(value)), default=0)
    return "deg" if largest > 1.2 * robot.controller.farthest(robot.limits) else ""


def renamed_words(names: Mapping[str, str], robot: Robot) -> tuple[str, ...]:
    """A sentence on joint columns that have other names in the file; none if they are ours."""
    own = [name for name in names if name != names[name]]
    if not own:
        return ()
    first, last = names[own[0]], names[own[-1]]
    units = " and ".join(dict.fromkeys(name.rpartition("_")[2] for name in own))
    numbers = [name.rpartition("_")[0].removeprefix("q") for name in own]
    held = len(numbers) != int(numbers[-1])
    joints = ", ".join(numbers) if held else f"1 to {len(own)}"
    return (
        f"the program's columns {first} to {last} are taken as the joints {joints} of "
        f"{robot.name}, in {units}",
    )


def require_no_places(table: DataTable) -> None:
    """Refuse joints with places beside them that are called as a controller calls them: X, Y, Z.

    Joints beside poses say only how the arm stands there, and are often rounded: taken as targets
    they would be others than the program's.

    Raises
    ------
    InputError
        M35: three columns are called X, Y and Z.
    """
    theirs = {hit["axis"].lower(): name for name in table.sheet.head if (hit := _PLACE(name))}
    if set(theirs) != set("xyz"):
        return
    names = ", ".join(theirs[axis] for axis in "xyz")
    raise refusal(
        table.where, "program", f"has {names} beside joints, so that its targets may be either",
        allowed="poses are x_mm y_mm z_mm with a rotation, and joints beside them state the "
        "configuration alone",
        fix=f"rename these as x_mm, y_mm, z_mm and {turns_named(table.sheet.head) or ROTATION}; or "
        "leave them out if the joints are the targets",
    )  # fmt: skip


def turns_named(head: Sequence[str]) -> str:
    """What the angles of a controller in a header are called here; empty if none are there."""
    stems = {name.strip().lower().split(" ")[0].partition("_")[0]: name for name in head}
    for theirs, ours, controller in TURNS:
        if set(theirs) <= set(stems):
            old, new = (", ".join(some) for some in ([stems[one] for one in theirs], ours))
            return f"{old} as {new}, with a column euler that says {controller}"
    return ""


def no_targets(table: DataTable, robot: Robot) -> InputError:
    """The error of a program without columns of joints or of poses."""
    kinds = robot.model.chain.kinds
    first, last = (
        f"q{k + 1}_{'mm' if kinds[k] == 'prismatic' else 'deg'}" for k in (0, len(kinds) - 1)
    )
    numbered = [name for name in table.sheet.head if NUMBERED.fullmatch(name.strip())]
    fix = "rename its columns like this, with the unit, in the first line"
    if len(numbered) == len(kinds):
        fix = (
            f"{numbered[0]} to {numbered[-1]} may be degrees or radians: rename them as {first} "
            f"... {last}, or {first.replace('deg', 'rad')} ... {last.replace('deg', 'rad')}"
        )
    return refusal(
        table.where, "program", "has no columns known as targets",
        value=", ".join(table.names)[:200],
        allowed=f"joints are {first} ... {last} (or _rad); poses are x_mm y_mm z_mm and qw qx qy "
        f"qz, or rx_deg ry_deg rz_deg with euler; {table.found(120)}",
        fix=fix,
    )  # fmt: skip
