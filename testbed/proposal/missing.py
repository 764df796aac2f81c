"""Files without a reading, or without some of the joints: what is missing, and what to do."""

from collections.abc import Sequence

from calib.errors import InputError
from testbed.files.joints import held_words
from testbed.files.observed import BESIDE_PLAN
from testbed.files.refusal import no_rows, refusal
from testbed.files.rows.planned import foretold
from testbed.names import some
from testbed.proposal.data import Found
from testbed.proposal.fits.tried import unnamed
from testbed.proposal.names import is_wished
from testbed.proposal.naming.own_joints import called_in, counted_joints
from testbed.proposal.rows.sideways import on_its_side
from testbed.proposal.wished import is_angle, is_computed
from testbed.robots.robot import Robot
from testbed.units import counted, either

MOST_JOINTS = 20
"""More than the number of joints in any file."""
FEWEST_NAMED = 2
"""Number of columns called as joints of the robot from which no other words are meant."""
SHOWN = 8
"""Largest number of unknown columns that are named."""


def with_rows(looks: Sequence[Found]) -> tuple[Found, ...]:
    """The tables that have rows, without sheets that have none beside others of a workbook.

    Raises
    ------
    InputError
        M27: a file has none, or no sheet of a workbook has.
    """
    found = tuple(one for one in looks if one.rows)
    for one in looks:
        if not one.rows and (one.sheet is None or not found):
            raise no_rows(str(one.path))
    return found


def no_reading(looks: tuple[Found, ...], n: int) -> InputError:
    """The error for files of which no column is known as a reading, of an arm with n joints."""
    ahead = [foretold(one.head) for one in looks]
    if any(ahead):
        return refusal(looks[0].name, "DATA", "has no column known as a reading", fix=BESIDE_PLAN)
    if (turned := on_its_side(looks, n)) is not None:
        return turned
    wished = [name for one in looks for name in one.head if is_wished(name)]
    fix = "name the columns, or name them under columns in session.toml by hand"
    nameless = [one for one in looks if one.kind == "bare"]
    if nameless:
        return unnamed(nameless[0])
    if angles := [name for one in looks for name in one.head if is_angle(name)]:
        fix = (
            f"beside {', '.join(angles[:6])}, name one azimuth, one elevation (or zenith "
            "angle) and one range, or export the X Y Z of the same points"
        )
    if made := [name for one in looks for name in one.head if is_computed(name)]:
        fix = f"{made[0]} ... are poses that the controller computed: give what was measured"
    if wished:
        fix = f"{', '.join(wished[:6])} are targets or differences: give what was measured"
    where = ", ".join(one.called for one in looks) or "DATA"
    no = "none has a" if len(looks) > 1 else "has no"
    return refusal(
        where, "DATA", f"{no} column known as a reading",
        allowed="columns X Y Z, also with rotations; or points or frames of Spatial Analyzer",
        fix=fix,
    )  # fmt: skip


def require_joints(looks: tuple[Found, ...], robot: Robot) -> None:
    """Refuse a file with only some of the joints, if no other file has the rest."""
    own = columns_of(robot)
    _require_named(looks, robot, own)
    for look in looks:
        there = joints_in(look)
        if missing := sorted(set(own) - there) if there else []:
            names = [f"q{k}" for k in missing]
            held = held_words(robot, names, [f"q{k}" for k in there])
            raise refusal(
                str(look.path), "joints",
                f"has columns for {counted(len(there), 'joint')}, and none for {', '.join(names)}",
                allowed=f"{robot.name} has {counted(len(own), 'joint')}",
                fix=f"give all of them, or another ROBOT{held}",
            )  # fmt: skip


def _require_named(looks: tuple[Found, ...], robot: Robot, own: Sequence[int]) -> None:
    """The same of columns that are called as the joints in the file of the robot."""
    names = [robot.joint_names[k - 1] for k in own] if robot.joint_names else []
    each = [called_in(look, names) for look in looks]
    missing = [name for name in names if not any(name in called for called in each)]
    k = max(range(len(looks)), key=lambda k: len(each[k]))
    if len(each[k]) < FEWEST_NAMED or not missing:
        return
    still = ""
    if names[-len(missing) :] == missing:
        still = f"; if {either(missing)} stood still, name a link before it as --tip"
    raise refusal(
        str(looks[k].path), "joints",
        f"has columns for {counted(len(each[k]), 'joint')}, and none for {', '.join(missing)}",
        allowed=f"{robot.name} has {counted(len(own), 'joint')}",
        fix=f"give all of them, or another ROBOT{still}",
    )  # fmt: skip


def not_tried(looks: tuple[Found, ...], robot: Robot) -> str:
    """Why nothing could be tried where no columns are known as the joints of a robot, in words."""
    look, there = max(((one, counted_joints(one)) for one in looks), key=lambda one: len(one[1]))
    if len(there) >= FEWEST_NAMED:
        first = columns_of(robot)[0]
        return (
            f"{look.called} has {counted(len(there), 'joint')}, {there[0]} to {there[-1]}, and "
            f"{robot.name} {len(columns_of(robot))}: nothing could be tried. Name the file under "
            f"[joints], and its own joints under columns, as in q{first}_rad = "
            f'"{there[0]}"'
        )
    return (
        f"there are no joints: nothing could be tried{_not_known(looks)}. Log those of every "
        "pose: where a controller says that the tool is does not replace them"
    )


def _not_known(looks: tuple[Found, ...]) -> str:
    """The unknown columns of tables, in words."""
    names = [
        name
        for one in looks
        if one.kind == "table"
        for name in one.head
        if name not in {each.theirs for each in one.meanings}
    ]
    return f"; not known are {some(names, SHOWN)}" if names else ""


def joints_in(look: Found) -> set[int]:
    """Numbers of the joints with columns in a file."""
    return {k for k in range(1, MOST_JOINTS) if f"q{k}" in look.stems or f"q{k}_read" in look.stems}


def columns_of(robot: Robot) -> tuple[int, ...]:
    """Numbers of the joints with columns in a table of this robot."""
    return tuple(robot.controller.counted(robot.model.chain.n_joints) + 1)
