"""A robot program's targets from CSV, corrected for the identified robot, row by row, into CSV.

Only the numbers of the targets change, and columns with the result of each row are added; all else
stays the same, including line ends and encoding. A target that cannot be corrected without
reservation stays unchanged, and its row states why.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.arrays import Array, Bool
from calib.compensation import compensate, corrected_poses
from calib.correction_words import status_sentences, turned_sentences
from calib.geometry.frames import inverse as inverse_transform
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.measurement.accuracy import rotation_errors
from calib.uncertainty.statement.conditions import Conditions
from calib.uncertainty.statement.departure import departure
from testbed.disk import atomic_write
from testbed.files.conditions import SetUp, first_stated, target_conditions
from testbed.files.joints import joint_columns, read_joints
from testbed.files.programs.columns import renamed_words
from testbed.files.programs.contradicted import TargetStatus, contradicted
from testbed.files.programs.motors import by_motors
from testbed.files.programs.mounted import carried_load, has_tip, known_tips, tool_words
from testbed.files.programs.read import (
    ADDED,
    configurations,
    in_other_units,
    is_cartesian,
    poses_of,
    read_program,
)
from testbed.files.programs.rewrite import rewritten
from testbed.files.programs.said import (
    LEFT,
    controller_words,
    frame_words,
    outcome_words,
    unknown_words,
    unused_words,
)
from testbed.files.refusal import refusal
from testbed.files.rotations import VECTOR, axes_of, in_form
from testbed.files.rows.targets import called, of_targets, target_names
from testbed.files.table import Columns, DataTable
from testbed.robots.catalog import Robot
from testbed.robots.controller import BEYOND
from testbed.robots.file_frames import base_of_poses
from testbed.scenario.tool_in_use import ToolInUse
from testbed.units import DEG

SAME = 1e-12
"""Change of a number up to which it is not written again [deg, rad, mm, m]."""


@dataclass(frozen=True, slots=True, eq=False)
class ProgramResult:
    """The outcome of each target of a program."""

    status: tuple[TargetStatus, ...]
    """(m,) "reached", or why the target stayed unchanged."""
    deviation_before: Array
    """(m, 3) identified minus nominal position with the original program, world axes [m]."""
    deviation: Array
    """(m, 3) the same with the corrected program [m]."""
    left_rotation: Array
    """(m,) rotation angle between both with the corrected program [rad]."""
    q_before: Array
    """(m, n) joint values of the original program [rad, m]."""
    q: Array
    """(m, n) joint values of the corrected program [rad, m]."""
    sentences: tuple[str, ...]
    """Summary and warnings."""
    conditions: tuple[str, ...] = ()
    """(m,) whether the target has the conditions of the measurements, in words."""
    at: OperatingConditions = AS_USUAL
    """Conditions of the targets for the model."""
    departed: Bool | None = None
    """(m,) whether the target has other conditions."""
    has_tip: Bool | None = None
    """(m,) whether what is stated there is of the tip of the tool in use."""
    names: tuple[str, ...] = ()
    """(m,) names of the targets in the program; empty if it has none."""
    places: tuple[str, ...] = ()
    """(m,) file and line of each target."""

    @property
    def before(self) -> Array:
        """(m,) position error of the robot with the original program [m]."""
        return np.asarray(np.linalg.norm(self.deviation_before, axis=1))

    @property
    def left(self) -> Array:
        """(m,) the same with the corrected program [m]."""
        return np.asarray(np.linalg.norm(self.deviation, axis=1))

    @property
    def corrected(self) -> Bool:
        """(m,) whether the target was changed."""
        return _reached(self.status)


@dataclass(frozen=True, slots=True, eq=False)
class _Targets:
    """New numbers (m, k) for the columns of targets [SI]."""

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
    in_use: ToolInUse | None = None,
) -> ProgramResult:
    """Correct the targets of a program file.

    Columns of joint targets are ``q1_deg`` ... (``_rad``, ``_mm``, ``_m``), those of Cartesian ones
    ``x_mm y_mm z_mm`` (``_m``) with a rotation as ``qw qx qy qz``, ``r11`` ... ``r33``, ``rvx_deg``
    ..., ``axis_x axis_y axis_z axis_angle_deg``, or ``rx_deg ry_deg rz_deg`` whose sequence is
    stated in a column ``euler``. Cartesian targets are poses of the tool in the base of robot.toml,
    or in the root of a URDF or MJCF, for a controller that keeps its nominal model; joint columns
    in the same rows then state the configuration in which it reaches them. ``payload_kg``, ``tool``
    and ``temperature_degC`` state the conditions at each target.

    Parameters
    ----------
    path : Path
        The program.
    robot : Robot
        Robot for whose nominal model it was written; its joint limits are respected.
    identified : RobotModel
        Identified model of the robot, with joint errors.
    out : Path
        The corrected program, which must not exist.
    measured : Conditions, optional
        Conditions of the rows that the statement is based on.
    set_up : SetUp, optional
        Conditions of targets that do not state theirs, and tolerances for differences.
    in_use : ToolInUse, optional
        A tool that was not measured, whose tip is known.

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
    correct = _correct_poses if is_cartesian(table) else _correct_joints
    m, set_up = len(table), set_up or SetUp()
    own = first_stated(target_conditions(table), set_up.use.rows(np.zeros(m, dtype=np.int64)))
    asked = own if measured is not None else Conditions()
    rows = measured or Conditions()
    tips = known_tips(in_use, robot, cartesian=is_cartesian(table))
    away = departure(rows, asked, m, set_up.tolerance, placed=tips)
    used = carried_load(own, rows, away)
    result, targets = correct(table, robot, identified, used)
    columns: tuple[Sequence[str] | Array, ...] = (
        result.status,
        1e3 * result.before,
        1e3 * result.left,
        DEG * result.left_rotation,
        away.words,
    )
    theirs = [table.names[name] for name in targets.columns.names]
    new, old = targets.numbers / targets.columns.factors, table.numbers(targets.columns.names)
    moved = result.corrected[:, None] & ~np.isclose(new, old, rtol=SAME, atol=SAME)
    numbers = dict(zip(theirs, new.T, strict=True))
    cells = dict(zip(theirs, moved.T, strict=True))
    added = dict(zip(ADDED, columns, strict=True))
    comma = table.decimal == ","
    written = rewritten(text, table.sheet, numbers, cells, added, comma=comma)
    counted = not robot.controller.plain and joint_columns(table, robot) is not None
    names = target_names(table)
    failed = status_sentences(result.status, LEFT, names=called(names))
    found = replace(
        result,
        sentences=(
            outcome_words(result.corrected, result.before, result.left, names),
            *controller_words(robot),
            *in_other_units(table, robot),
            *renamed_words(table.names, robot),
            *unused_words(table, robot, targets.columns),
            *([robot.controller.sentence] if counted else []),
            *failed,
            *turned_sentences(
                identified, result.status, result.left_rotation, len(robot.controller.held)
            ),
            *away.sentences,
            *away.unsaid,
            *unknown_words(away),
            *tool_words(away, in_use, tips),
            *result.sentences,
        ),
        conditions=away.words,
        departed=away.outside,
        has_tip=has_tip(own, rows, in_use, m),
        names=names,
        places=table.places,
    )
    atomic_write(out, written)
    return found


def _correct_joints(
    table: DataTable, robot: Robot, identified: RobotModel, own: Conditions
) -> tuple[ProgramResult, _Targets]:
    """Correct joint targets."""
    joints, nominal = read_joints(table, robot, "commanded", drop=None), robot.model
    at, assumed = of_targets(robot, identified, own, joints.q)
    T = nominal.poses(joints.q)
    correction = compensate(nominal, identified, joints.q, robot.limits, at)
    correction = by_motors(robot, identified, correction, T, joints.q, at)
    beyond = (joints.q < robot.limits[:, 0] - BEYOND) | (joints.q > robot.limits[:, 1] + BEYOND)
    outside = np.asarray(beyond.any(axis=1))
    status = tuple("limits" if outside[k] else one for k, one in enumerate(correction.status))
    q = np.where(_reached(status)[:, None], correction.q, joints.q)
    here = identified.poses(q, at)
    result = ProgramResult(
        status=status,
        deviation_before=(identified.poses(joints.q, at) - T)[:, :3, 3],
        deviation=(here - T)[:, :3, 3],
        left_rotation=rotation_errors(T, here),
        q_before=joints.q,
        q=q,
        sentences=(*joints.warnings, *assumed),
        at=at,
    )
    return result, _Targets(joints.columns, robot.controller.written(q))


def _correct_poses(
    table: DataTable, robot: Robot, identified: RobotModel, own: Conditions
) -> tuple[ProgramResult, _Targets]:
    """Correct Cartesian targets for a controller that keeps its nominal model."""
    nominal = robot.model
    columns, stated, T_base, odd = poses_of(table)
    base = base_of_poses(robot)
    T = base @ T_base
    seeds, assumed = configurations(table, robot, T)
    at, more = of_targets(robot, identified, own, seeds)
    correction = corrected_poses(nominal, identified, T, seeds, robot.limits, at)
    correction = by_motors(robot, identified, correction, T, correction.q_before, at)
    status, said = contradicted(table, robot, seeds, correction)
    q = np.where(_reached(status)[:, None], correction.q, correction.q_before)
    poses = inverse_transform(base) @ correction.T
    new = in_form(stated.form, np.asarray(stated.numbers), poses[:, :3, :3])
    if stated.form != VECTOR and columns.names[3].startswith("rx"):
        # the columns are x, y, z; the numbers follow the letters
        new = new[:, np.argsort(axes_of(stated.form))]
    here = identified.poses(q, at)
    result = ProgramResult(
        status=status,
        deviation_before=(identified.poses(correction.q_before, at) - T)[:, :3, 3],
        deviation=(here - T)[:, :3, 3],
        left_rotation=rotation_errors(T, here),
        q_before=correction.q_before,
        q=q,
        sentences=(*said, *odd, *frame_words(robot), *assumed, *more),
        at=at,
    )
    return result, _Targets(columns, np.hstack([poses[:, :3, 3], new]))


def _reached(status: Sequence[TargetStatus]) -> Bool:
    """(m,) whether the target is corrected."""
    return np.array([one == "reached" for one in status], dtype=np.bool_)
