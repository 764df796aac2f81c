"""A robot program's targets from CSV, corrected for the identified robot, row by row, into CSV.

Rows, columns, comments, separator and decimal mark stay as they are; the numbers of the targets
change, and columns that say what came of each row are added. A target that cannot be corrected
without reserve stays as it was: the robot then does what it did before, and the row says why.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.compensation import compensate, corrected_poses, told
from calib.errors import InputError
from calib.geometry.frames import inverse as inverse_transform
from calib.geometry.frames import transform
from calib.geometry.inverse import Outcome, inverse_kinematics, spread
from calib.geometry.model import RobotModel
from calib.measurement.accuracy import position_errors, rotation_errors
from testbed.disk import atomic_write
from testbed.files.columns import ANGLES, find, find_all
from testbed.files.joints import read_joints
from testbed.files.rewrite import rewritten
from testbed.files.rotations import VECTOR, checked_rotations, in_form, stated_in
from testbed.files.table import Table, refuse_bad, table_of
from testbed.files.text import read_sheet, read_text
from testbed.robots.catalog import Robot

ADDED = ("status", "before_mm", "left_mm", "left_deg")
"""Columns that are added: outcome, what the target missed and misses by the identified model."""
WORDS: dict[Outcome, str] = {
    "singular": "left as written: the posture is nearly singular, and its correction would move a "
    "joint far; move the target",
    "limits": "left as written: the corrected posture is outside the joint limits",
    "out of reach": "left as written: the robot does not reach it from a posture near this one",
}
STARTS = 64
DEGREES = 180 / np.pi


@dataclass(frozen=True, slots=True, eq=False)
class ProgramResult:
    """What came of a program."""

    kind: Literal["joints", "poses"]
    out: Path
    status: tuple[Outcome, ...]
    """(m,) per target: "reached", or why it stayed as it was."""
    corrected: Bool
    """(m,) whether the target was changed."""
    before: Array
    """(m,) how far the robot misses the meant positions with the program as it was [m]."""
    left: Array
    """(m,) the same with the corrected program [m]."""
    left_rotation: Array
    """(m,) the same of the angle, with the corrected program [rad]."""
    q: Array
    """(m, n) joints that the corrected program takes [rad, m]."""
    step: Array
    """(m, n) what the correction moves them by [rad, m]."""
    sentences: tuple[str, ...]
    """What was done, and what is to be looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class _Written:
    """New numbers of some columns, in the file's units, and what came of the rows."""

    kind: Literal["joints", "poses"]
    columns: tuple[str, ...]
    numbers: Array
    """(m, k)"""
    status: tuple[Outcome, ...]
    before: Array
    left: Array
    left_rotation: Array
    q: Array
    step: Array
    notes: tuple[str, ...]

    @property
    def corrected(self) -> Bool:
        """(m,) rows that change."""
        return np.array([one == "reached" for one in self.status], dtype=np.bool_)


def correct_program(
    path: Path,
    robot: Robot,
    identified: RobotModel,
    out: Path,
    *,
    nominal: RobotModel | None = None,
    euler: str | None = None,
    overwrite: bool = False,
) -> ProgramResult:
    """Correct the targets of a program file.

    Joint targets stand in ``q1_deg`` ... (``_rad``, ``_mm``, ``_m``). Cartesian ones in ``x_mm y_mm
    z_mm`` (``_m``) with a rotation as ``qw qx qy qz``, ``r11`` ... ``r33``, ``rvx_deg`` ..., or
    ``rx_deg ry_deg rz_deg`` whose sequence is stated in a column ``euler`` or by `euler`: poses of
    the tool in the base frame, for a controller that keeps its nominal model. Joint columns beside
    Cartesian ones say in which configuration the controller reaches them.

    Parameters
    ----------
    path : Path
        The program.
    robot : Robot
        Its robot; joint limits are respected.
    identified : RobotModel
        What the robot really is, joint errors included.
    out : Path
        The corrected program.
    nominal : RobotModel, optional
        The model the program was written for, in the world of `identified`; the robot's own by
        default.
    euler : str, optional
        Sequence of three angles: capitals turn about axes that turn along, small letters about
        fixed ones.
    overwrite : bool
        Whether an existing file `out` may be replaced; the program itself never is.

    Raises
    ------
    InputError
        C40: `out` exists, or is the program itself. M20, M22-M25, M35: the program is not
        understood; nothing is written.
    """
    _check_out(path, out, overwrite=overwrite)
    where = path.name
    text = read_text(path, where)
    sheet = read_sheet(text)
    if any(name in sheet.head for name in ADDED):
        name = next(name for name in ADDED if name in sheet.head)
        raise InputError(
            f'has a column "{name}" already, as a corrected program has', code="M35", where=where,
            field=name, fix="correct the program as it was, not a corrected one",
        )  # fmt: skip
    numeric = [name for name in sheet.head if "_" in name or name[:1] in "qr"]
    table = table_of(sheet, {}, numeric)
    if not len(table):
        raise InputError(
            "has no targets", code="M35", where=where, field="file", fix="write one target a line"
        )
    model = robot.model if nominal is None else nominal
    cartesian = find(table, "x", "length", where) is not None
    made = (
        _poses(table, robot, model, identified, euler)
        if cartesian
        else _joints(table, robot, model, identified)
    )
    worth = (made.status, 1e3 * made.before, 1e3 * made.left, DEGREES * made.left_rotation)
    new = rewritten(
        text, table, made.columns, made.numbers, made.corrected,
        dict(zip(ADDED, worth, strict=True)),
    )  # fmt: skip
    atomic_write(out, new.encode("utf-8"))
    count, changed = len(made.status), int(made.corrected.sum())
    kept = f"; the other {count - changed} stay as they were" if changed < count else ""
    done = (
        f"{changed} of {count} targets corrected{kept}: by the identified model they miss "
        f"{1e3 * made.before.mean():.3f} mm before and {1e3 * made.left.mean():.3g} mm after on "
        "average"
    )
    return ProgramResult(
        kind=made.kind,
        out=out,
        status=made.status,
        corrected=frozen(made.corrected, np.bool_),
        before=frozen(made.before),
        left=frozen(made.left),
        left_rotation=frozen(made.left_rotation),
        q=frozen(made.q),
        step=frozen(made.step),
        sentences=(done, *told(made.status, "target", WORDS), *made.notes),
    )


def _check_out(path: Path, out: Path, *, overwrite: bool) -> None:
    """Refuse to write over the program, or over anything unasked."""
    same = out.exists() and path.exists() and out.samefile(path)
    if same or (out.exists() and not (overwrite and out.is_file())):
        raise InputError(
            f"{out.name} {'is the program itself' if same else 'exists'}",
            code="C40",
            field="out",
            value=str(out),
            fix="choose another file"
            if same or not out.is_file()
            else "choose another file, or add --overwrite",
        )


def _joints(table: Table, robot: Robot, nominal: RobotModel, identified: RobotModel) -> _Written:
    """Joint targets corrected."""
    joints = read_joints(table, robot, "commanded", drop=False)
    n = robot.model.chain.n_joints
    names = joints.columns[:n]
    found = compensate(nominal, identified, joints.q, robot.limits)
    ok = found.corrected[:, None]
    q = np.where(ok, found.q, joints.q)
    T, here = nominal.poses(joints.q), identified.poses(q)
    factors = [_factor(table, f"q{j + 1}", kind) for j, kind in enumerate(robot.model.chain.kinds)]
    return _Written(
        "joints",
        names,
        q / factors,
        found.status,
        found.position_before,
        position_errors(T, here),
        rotation_errors(T, here),
        q,
        q - joints.q,
        (),
    )


def _poses(
    table: Table, robot: Robot, nominal: RobotModel, identified: RobotModel, euler: str | None
) -> _Written:
    """Cartesian targets corrected, for a controller that keeps its nominal model."""
    where = table.where
    place = find_all(table, ("x", "y", "z"), "length", where)
    stated = stated_in(table, euler)
    if place is None or stated is None:
        raise InputError(
            "has positions without rotations", code="M24", where=where, field="frames",
            allowed="qw qx qy qz, r11 ... r33, rvx_deg ..., or rx_deg ry_deg rz_deg with euler",
            fix="a target needs its orientation: add the columns",
        )  # fmt: skip
    rotation, turned = stated
    good, _ = refuse_bad(table, [*place[0], *turned], drop=False)
    R, notes = checked_rotations(rotation, table, np.asarray(good))
    base = nominal.chain.T_world_base
    T = base @ transform(R, table.numbers(place[0]) * place[1])
    seeds, said = _configurations(table, robot, nominal, np.asarray(T))
    found = corrected_poses(nominal, identified, T, seeds, robot.limits)
    ok = found.corrected
    q = np.where(ok[:, None], found.q, found.q_before)
    told_poses = inverse_transform(base) @ found.T
    new = in_form(rotation.form, np.asarray(rotation.numbers), told_poses[:, :3, :3])
    if len(turned) == 3 and rotation.form != VECTOR and turned[0].startswith("rx"):
        # the columns are x, y, z; the numbers follow the letters
        order = ["XYZ".index(letter) for letter in rotation.form.upper()]
        new = new[:, np.argsort(order)]
    factors = [_turn_factor(name) for name in turned]
    numbers = np.hstack([told_poses[:, :3, 3] / place[1], new / factors])
    here, before = identified.poses(q), identified.poses(found.q_before)
    return _Written(
        "poses",
        (*place[0], *turned),
        numbers,
        found.status,
        position_errors(T, before),
        position_errors(T, here),
        rotation_errors(T, here),
        q,
        q - found.q_before,
        (*notes, *said),
    )


def _configurations(
    table: Table, robot: Robot, nominal: RobotModel, T: Array
) -> tuple[Array, tuple[str, ...]]:
    """Joints (m, n) near which the controller reaches its targets, and where they come from."""
    kinds = robot.model.chain.kinds
    if any(_factor(table, f"q{j + 1}", kind, needed=False) for j, kind in enumerate(kinds)):
        return read_joints(table, robot, "commanded", drop=False).q, ()
    seeds = np.empty((len(T), len(kinds)))
    everywhere = spread(robot.limits, STARTS)
    before = robot.limits.mean(axis=1)
    for k in range(len(T)):
        near = inverse_kinematics(nominal, T[k : k + 1], before[None], robot.limits) if k else None
        if near is None or near.status != ("reached",):
            starts = np.concatenate([before[None], everywhere])[None]
            near = inverse_kinematics(nominal, T[k : k + 1], starts, robot.limits)
        seeds[k] = near.q[0]
        before = near.q[0] if near.reached[0] else before
    said = (
        "the program does not say in which configuration the arm stands: the first target is taken "
        "with the joints nearest to the middle of their ranges, each other one nearest to the one "
        "before; add the columns q1_deg ... if the controller does otherwise"
    )
    return seeds, (said,)


def _factor(table: Table, stem: str, kind: str, *, needed: bool = True) -> float:
    """Factor to SI of a joint's column; 0 if there is none and none is needed."""
    at = find(table, stem, "length" if kind == "prismatic" else "angle", table.where)
    if at is None and needed:
        raise RuntimeError(f"{stem} was read and is not there")
    return at[1] if at else 0.0


def _turn_factor(name: str) -> float:
    """Factor to SI of a rotation's column."""
    return ANGLES.get(name.rpartition("_")[2], 1.0)
