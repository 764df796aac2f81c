"""A robot program's targets from CSV, corrected for the identified robot, row by row, into CSV.

Rows, columns, comments, separator and decimal mark stay as they are; the numbers of the targets
change, and columns with the result of each row are added. A target that cannot be corrected without
reserve stays as it was: the robot then does what it did before, and the row states why.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.arrays import Array, Bool
from calib.compensation import compensate, corrected_poses, status_sentences
from calib.geometry.frames import inverse as inverse_transform
from calib.geometry.frames import transform
from calib.geometry.inverse import InverseStatus, inverse_kinematics, spread
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.measurement.accuracy import rotation_errors
from calib.uncertainty.statement.conditions import Conditions, departure
from testbed.disk import atomic_write
from testbed.files.columns import TEXTS
from testbed.files.conditions import SetUp, first_stated, target_conditions
from testbed.files.joints import joint_columns, read_joints
from testbed.files.refusal import refusal
from testbed.files.rotations import VECTOR, axes_of, checked_rotations, in_form, stated_in
from testbed.files.rows.targets import NAMES, called, of_targets, target_names
from testbed.files.session import Stated
from testbed.files.table import Columns, DataTable, require_short, table_of, together
from testbed.files.text import read_sheet, rewritten
from testbed.files.valid import valid_rows
from testbed.gates.text import FileText, read_text
from testbed.robots.catalog import Robot
from testbed.units import DEG, significant

ADDED = ("status", "before_mm", "left_mm", "left_deg", "conditions")
"""Columns that are added: outcome, errors before and after by the identified model, and whether the
target lies under the conditions of the measurements."""
WORDS: dict[InverseStatus, str] = {
    "singular": "left as written: the posture is nearly singular, and its correction would move a "
    "joint far; move the target",
    "limits": "left as written: the corrected posture is outside the joint limits",
    "out of reach": "left as written: the robot does not reach it from a posture near this one",
}
STARTS = 64


@dataclass(frozen=True, slots=True, eq=False)
class ProgramResult:
    """The outcome of each target of a program."""

    status: tuple[InverseStatus, ...]
    """(m,) "reached", or why the target stayed as it was."""
    deviation_before: Array
    """(m, 3) identified minus nominal position with the program as it was, world axes [m]."""
    deviation: Array
    """(m, 3) the same with the corrected program [m]."""
    left_rotation: Array
    """(m,) angle between both, with the corrected program [rad]."""
    q_before: Array
    """(m, n) joints that the program as it was takes [rad, m]."""
    q: Array
    """(m, n) joints that the corrected program takes [rad, m]."""
    sentences: tuple[str, ...]
    """What was done, and what is to be looked at."""
    conditions: tuple[str, ...] = ()
    """(m,) whether the target lies under the conditions of the measurements, in words."""
    at: OperatingConditions = AS_USUAL
    """Under which the model takes the targets."""
    departed: Bool | None = None
    """(m,) whether it lies under others."""
    names: tuple[str, ...] = ()
    """(m,) what the program calls each target; empty where it has no name."""
    places: tuple[str, ...] = ()
    """(m,) file and line in which each target stands."""

    @property
    def before(self) -> Array:
        """(m,) position error of the robot with the program as it was [m]."""
        return np.asarray(np.linalg.norm(self.deviation_before, axis=1))

    @property
    def left(self) -> Array:
        """(m,) the same with the corrected program [m]."""
        return np.asarray(np.linalg.norm(self.deviation, axis=1))

    @property
    def corrected(self) -> Bool:
        """(m,) whether the target was changed."""
        return np.array([one == "reached" for one in self.status], dtype=np.bool_)


@dataclass(frozen=True, slots=True, eq=False)
class _Targets:
    """New numbers (m, k) of the columns of targets [SI]."""

    columns: Columns
    numbers: Array


def correct_program(
    path: Path,
    robot: Robot,
    identified: RobotModel,
    out: Path,
    *,
    measured: Conditions | None = None,
    set_up: SetUp | None = None,
) -> ProgramResult:
    """Correct the targets of a program file.

    Joint targets stand in ``q1_deg`` ... (``_rad``, ``_mm``, ``_m``). Cartesian ones in ``x_mm y_mm
    z_mm`` (``_m``) with a rotation as ``qw qx qy qz``, ``r11`` ... ``r33``, ``rvx_deg`` ..., or
    ``rx_deg ry_deg rz_deg`` whose sequence is stated in a column ``euler``: poses of the tool in
    the base frame, for a controller that keeps its nominal model. Joint columns beside Cartesian
    ones state in which configuration the controller reaches them. ``payload_kg``, ``tool`` and
    ``temperature_degC`` state under which conditions it goes there.

    Parameters
    ----------
    path : Path
        The program.
    robot : Robot
        Its robot, for whose nominal model it was written; joint limits are respected.
    identified : RobotModel
        What the robot really is, joint errors included.
    out : Path
        The corrected program, which must not exist.
    measured : Conditions, optional
        Of the rows that the statement rests on.
    set_up : SetUp, optional
        Conditions of targets that do not say theirs, and how far all may differ.

    Raises
    ------
    InputError
        C40: `out` exists, or is the program itself. M20, M22-M25, M35: the program is not
        understood; nothing is written.
    """
    if out.exists():
        what = "is the program itself" if path.exists() and out.samefile(path) else "exists"
        fix = "choose another file"
        raise refusal("", "out", f"{out.name} {what}", code="C40", value=str(out), fix=fix)
    text, table = read_program(path, robot)
    correct = _correct_poses if _is_cartesian(table) else _correct_joints
    m, set_up = len(table), set_up or SetUp()
    own = first_stated(target_conditions(table), set_up.use.rows(np.zeros(m, dtype=np.int64)))
    result, targets = correct(table, robot, identified, own)
    away = departure(measured or Conditions(), own, m, set_up.tolerance)
    columns: tuple[Sequence[str] | Array, ...] = (
        result.status,
        1e3 * result.before,
        1e3 * result.left,
        DEG * result.left_rotation,
        away.words,
    )
    theirs = [table.names[name] for name in targets.columns.names]
    numbers = dict(zip(theirs, (targets.numbers / targets.columns.factors).T, strict=True))
    added = dict(zip(ADDED, columns, strict=True))
    comma = table.decimal == ","
    new = rewritten(text, table.sheet, numbers, result.corrected, added, comma=comma)
    atomic_write(out, new.encode("utf-8"))
    count, changed = len(result.status), int(result.corrected.sum())
    kept = f"; the other {count - changed} stay as they were" if changed < count else ""
    done = (
        f"{changed} of {count} targets corrected{kept}: by the identified model all "
        f"{count} miss {1e3 * result.before.mean():.3f} mm before and "
        f"{significant(1e3 * result.left.mean())} mm after on average"
    )
    names = target_names(table)
    failed = status_sentences(result.status, "target", WORDS, names=called(names))
    return replace(
        result,
        sentences=(done, *failed, *away.sentences, *away.unsaid, *result.sentences),
        conditions=away.words,
        departed=away.outside,
        names=names,
        places=table.places,
    )


def read_program(path: Path, robot: Robot) -> tuple[FileText, DataTable]:
    """The lines and the targets of a program file, each target's columns looked at.

    Raises
    ------
    InputError
        M20, M22-M25, M35: the program is not understood.
    """
    text = read_text(path, path.name)
    sheet = read_sheet(text)
    for name in ADDED:
        if name in sheet.head:
            message = f'has a column "{name}" already, as a corrected program has'
            fix = "correct the program as it was, not a corrected one"
            raise refusal(path.name, name, message, fix=fix)
    numeric = [
        name for name in sheet.head if name not in TEXTS and ("_" in name or name[:1] in "qr")
    ]
    table = table_of(sheet, {}, numeric=numeric)
    if not len(table):
        raise refusal(path.name, "file", "has no targets", fix="write one target a line")
    for name in NAMES:
        require_short(table, name)
    target_conditions(table)
    if _is_cartesian(table):
        _poses(table)
    if joint_columns(table, robot) or not _is_cartesian(table):
        read_joints(table, robot, "commanded", drop=None)
    return text, table


def _is_cartesian(table: DataTable) -> bool:
    """Whether the targets are poses of the tool."""
    return table.find("length", "x") is not None


def _correct_joints(
    table: DataTable, robot: Robot, identified: RobotModel, own: Conditions
) -> tuple[ProgramResult, _Targets]:
    """Joint targets corrected."""
    joints, nominal = read_joints(table, robot, "commanded", drop=None), robot.model
    at, assumed = of_targets(identified, own, joints.q)
    correction = compensate(nominal, identified, joints.q, robot.limits, at)
    q = np.where(correction.corrected[:, None], correction.q, joints.q)
    T, here = nominal.poses(joints.q), identified.poses(q, at)
    result = ProgramResult(
        status=correction.status,
        deviation_before=(identified.poses(joints.q, at) - T)[:, :3, 3],
        deviation=(here - T)[:, :3, 3],
        left_rotation=rotation_errors(T, here),
        q_before=joints.q,
        q=q,
        sentences=assumed,
        at=at,
    )
    return result, _Targets(joints.columns, q)


def _correct_poses(
    table: DataTable, robot: Robot, identified: RobotModel, own: Conditions
) -> tuple[ProgramResult, _Targets]:
    """Cartesian targets corrected, for a controller that keeps its nominal model."""
    nominal = robot.model
    columns, stated, T_base, odd = _poses(table)
    base = nominal.chain.T_world_base
    T = base @ T_base
    seeds, assumed = _configurations(table, robot, T)
    at, more = of_targets(identified, own, seeds)
    correction = corrected_poses(nominal, identified, T, seeds, robot.limits, at)
    q = np.where(correction.corrected[:, None], correction.q, correction.q_before)
    poses = inverse_transform(base) @ correction.T
    new = in_form(stated.form, np.asarray(stated.numbers), poses[:, :3, :3])
    if stated.form != VECTOR and columns.names[3].startswith("rx"):
        # the columns are x, y, z; the numbers follow the letters
        new = new[:, np.argsort(axes_of(stated.form))]
    here = identified.poses(q, at)
    result = ProgramResult(
        status=correction.status,
        deviation_before=(identified.poses(correction.q_before, at) - T)[:, :3, 3],
        deviation=(here - T)[:, :3, 3],
        left_rotation=rotation_errors(T, here),
        q_before=correction.q_before,
        q=q,
        sentences=(*odd, *assumed, *more),
        at=at,
    )
    return result, _Targets(columns, np.hstack([poses[:, :3, 3], new]))


def _poses(table: DataTable) -> tuple[Columns, Stated, Array, Sequence[str]]:
    """Columns, stated rotations and poses (m, 4, 4) of Cartesian targets [m], and what is odd."""
    place = table.find("length", "x", "y", "z")
    found = stated_in(table, None)
    if place is None or found is None:
        raise refusal(
            table.where, "frames", "has positions without rotations", code="M24",
            allowed="qw qx qy qz, r11 ... r33, rvx_deg ..., or rx_deg ry_deg rz_deg with euler",
            fix="a target needs its orientation: add the columns",
        )  # fmt: skip
    stated, turned = found
    columns = together(place, turned)
    good, _ = valid_rows(table, columns, drop=None)
    R, odd = checked_rotations(stated, table, good)
    return columns, stated, transform(R, table.values(place)), odd


def _configurations(table: DataTable, robot: Robot, T: Array) -> tuple[Array, tuple[str, ...]]:
    """Joints (m, n) near which the controller reaches its targets, and where they come from."""
    nominal = robot.model
    if joint_columns(table, robot):
        return read_joints(table, robot, "commanded", drop=None).q, ()
    seeds = np.empty((len(T), nominal.chain.n_joints))
    everywhere = spread(robot.limits, STARTS)
    before = robot.limits.mean(axis=1)
    for k in range(len(T)):
        near = inverse_kinematics(nominal, T[k : k + 1], before[None], robot.limits) if k else None
        if near is None or near.status != ("reached",):
            starts = np.concatenate([before[None], everywhere])[None]
            near = inverse_kinematics(nominal, T[k : k + 1], starts, robot.limits)
        seeds[k] = near.q[0]
        before = near.q[0] if near.reached[0] else before
    sentence = (
        "the program does not say in which configuration the arm stands: the first target is taken "
        "with the joints nearest to the middle of their ranges, each other one nearest to the one "
        "before; add the columns q1_deg ... if the controller does otherwise"
    )
    return seeds, (sentence,)
