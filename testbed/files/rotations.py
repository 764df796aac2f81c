"""Rotations in the conventions of files, read into matrices and written back."""

import warnings
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, frozen
from calib.geometry.frames import exp_so3, log_so3
from testbed.files.columns import AXIS_COLUMNS, MATRIX_COLUMNS, QUATERNION_COLUMNS
from testbed.files.refusal import refusal
from testbed.files.session import Stated
from testbed.files.table import Columns, DataTable, together
from testbed.names import choice_of

EULER = tuple(
    "".join(triple)
    for letters in ("XYZ", "xyz")
    for triple in product(letters, repeat=3)
    if all(a != b for a, b in pairwise(triple))
)
"""Euler sequences: capitals turn about axes that turn along, small letters about fixed ones."""
MAKERS = {
    "kuka": "ZYX", "staubli": "XYZ", "fanuc": "xyz", "ur": "rotation_vector", "kawasaki": "ZYZ"
}  # fmt: skip
"""What some controllers mean by three angles; KUKA: A about Z, B about Y, C about X; Kawasaki: O
about Z, A about the turned Y, T about the turned Z."""
QUATERNION, MATRIX, VECTOR = "quaternion", "matrix", "rotation_vector"
AXIS = "axis_angle"
KEPT, QUIET, MENDED = 1e-12, 1e-6, 1e-3
"""Largest |R'R - I| of a matrix that is kept as it is, projected, projected with a warning."""


def rotations(form: str, numbers: ArrayLike) -> Array:
    """Rotation matrices (m, 3, 3) of numbers (m, k) in a form of `Stated.form`.

    Euler angles are in the order of the letters [rad]: ``ABC`` is R_A(a) R_B(b) R_C(c) and ``abc``
    is R_C(c) R_B(b) R_A(a). Quaternions have w first and any length; axes, of any length, stand
    before their angle. Matrices are by rows and are not corrected.
    """
    values = np.asarray(numbers, dtype=np.float64)
    if form == MATRIX:
        return values.reshape(-1, 3, 3)
    if form == VECTOR:
        return exp_so3(values)
    if form == AXIS:
        return exp_so3(_unit(values[:, :3]) * values[:, 3:])
    if form == QUATERNION:
        return _from_quaternions(values)
    R = np.broadcast_to(np.eye(3), (len(values), 3, 3))
    for letter, axis, angle in zip(form, axes_of(form), values.T, strict=True):
        turn = exp_so3(angle[:, None] * np.eye(3)[axis])
        R = R @ turn if letter.isupper() else turn @ R
    return R


def _unit(vectors: Array) -> Array:
    """Vectors (m, k) of length 1, those of length 0 as they are."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def _from_quaternions(values: Array) -> Array:
    """Rotations (m, 3, 3) of quaternions (m, 4), w first, of any length."""
    unit = _unit(values)  # one of length 0 is refused elsewhere
    vector = unit[:, 1:]
    half = np.linalg.norm(vector, axis=1)
    angle = 2 * np.arctan2(half, unit[:, 0])
    # the axis of a turn by nothing does not matter
    return exp_so3(vector / np.where(half > 0, half, 1.0)[:, None] * angle[:, None])


def in_form(form: str, old: Array, R: Array) -> Array:
    """Numbers (m, k) of rotations (m, 3, 3), of all that mean the same those nearest to `old`.

    Parameters
    ----------
    form : str
        As in `Stated.form`: matrix, quaternion, rotation_vector, or an Euler sequence.
    old : (m, k) array
        Numbers that stood there before [rad where they are angles].
    R : (m, 3, 3) array
        Rotations.
    """
    if form == MATRIX:
        return R.reshape(-1, 9)
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(R)
    if form == QUATERNION:
        new = np.roll(turns.as_quat(), 1, axis=1)
        return np.asarray(new * np.where((new * old).sum(axis=1) < 0, -1.0, 1.0)[:, None])
    if form == VECTOR:
        new = log_so3(R)
        angle = np.linalg.norm(new, axis=1, keepdims=True)
        other = new * (1 - 2 * np.pi / np.maximum(angle, 1e-12))
        far = np.linalg.norm(new - old, axis=1) > np.linalg.norm(other - old, axis=1)
        return np.where(far[:, None], other, new)
    if form == AXIS:
        new = log_so3(R)
        angle = np.linalg.norm(new, axis=1, keepdims=True)
        axis = np.where(angle > 0, _unit(new), _unit(old[:, :3]))
        sign = np.where((axis * old[:, :3]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        turns = np.round((sign * angle - old[:, 3:]) / (2 * np.pi))
        return np.hstack([sign * axis, sign * angle - 2 * np.pi * turns])
    with warnings.catch_warnings():
        # where two axes line up only their sum counts: any split of it is right
        warnings.simplefilter("ignore")
        one = turns.as_euler(form)
    # proper Euler sequences (aba) flip their middle angle, the others mirror it
    middle = -one[:, 1] if form[0] == form[2] else np.pi - one[:, 1]
    two = np.stack([one[:, 0] + np.pi, middle, one[:, 2] + np.pi], axis=1)
    ways = [way - 2 * np.pi * np.round((way - old) / (2 * np.pi)) for way in (one, two)]
    far = np.abs(ways[0] - old).max(axis=1) > np.abs(ways[1] - old).max(axis=1)
    return np.where(far[:, None], ways[1], ways[0])


def stated_in(table: DataTable, euler: str | None) -> tuple[Stated, Columns] | None:
    """How the rotations of a table stand in it, and the columns used; None if it has none.

    Raises
    ------
    InputError
        M24: three angles without their sequence. M35: two forms at once.
    """
    angles = table.find("angle", "rx", "ry", "rz")
    ordered = table.find("angle", "e1", "e2", "e3")
    vector = table.find("angle", "rvx", "rvy", "rvz")
    quaternion = _plain_columns(table, QUATERNION_COLUMNS)
    matrix = _plain_columns(table, MATRIX_COLUMNS)
    axis, about = _plain_columns(table, AXIS_COLUMNS), table.find("angle", "axis_angle")
    if bool(axis) != bool(about):
        there = (axis or about or Columns()).names[0]
        raise table.incomplete(there, ["axis_angle_deg"] if axis else AXIS_COLUMNS)
    turn = together(axis, about) if axis else None
    forms = [form for form in (angles, ordered, vector, quaternion, matrix, turn) if form]
    if len(forms) > 1:
        message = f"has rotations in two forms ({forms[0].names[0]} and {forms[1].names[0]})"
        raise refusal(table.where, "frames", message, fix="keep one of them")
    if not forms:
        return None
    columns, numbers = forms[0], table.values(forms[0])
    if matrix or quaternion:
        return Stated(MATRIX if matrix else QUATERNION, numbers), columns
    if turn:
        return Stated(AXIS, numbers), columns
    if vector:
        return Stated(VECTOR, numbers), columns
    form = sequence_of(euler if euler is not None else table.only("euler"), table.where)
    if angles and form != VECTOR:
        if set(form.upper()) != set("XYZ"):
            message = f'euler = "{form}" turns about one axis twice, which rx, ry, rz cannot name'
            fix = "name the columns e1_deg, e2_deg, e3_deg, in the order of the letters"
            raise refusal(table.where, "euler", message, code="M24", value=form, fix=fix)
        numbers = numbers[:, axes_of(form)]
    return Stated(form, numbers), columns


def axes_of(form: str) -> list[int]:
    """Axis of each turn of an Euler sequence, from 0: ``ZYX`` is [2, 1, 0]."""
    return ["XYZ".index(letter) for letter in form.upper()]


def sequence_of(euler: str | None, where: str) -> str:
    """The sequence that a word means: ``XYZ``, ``zyx``, or the name of a maker.

    Raises
    ------
    InputError
        M24: there is none, or the word means nothing.
    """
    if euler in (*EULER, VECTOR):
        return euler
    if euler in MAKERS:
        return MAKERS[euler]
    if euler is None:
        message = "has three angles and no euler, which says how they turn the tool"
        fix = 'write for example euler = "kuka" under [frames] in session.toml, or a column euler'
    else:
        message = f'euler is "{euler[:20]}"'
        fix = choice_of(euler, (*EULER, VECTOR, *MAKERS)) if len(euler) > 3 else ""
    allowed = (
        "allowed are a controller (kuka, staubli, fanuc, ur, kawasaki), rotation_vector, or three "
        "axes in the order of the turns: XYZ about x, the turned y, the turned z; xyz about fixed "
        "x, y, z"
    )
    raise refusal(where, "euler", message, code="M24", value=euler, allowed=allowed, fix=fix)


def checked_rotations(stated: Stated, table: DataTable, rows: Bool) -> tuple[Array, list[str]]:
    """Proper rotations (m, 3, 3) of a table's good rows, and what was odd about them.

    Parameters
    ----------
    stated : Stated
        Numbers of all rows.
    table : DataTable
        For the place of a row in messages.
    rows : (m,) array of bool
        Rows whose numbers are numbers.

    Raises
    ------
    InputError
        M22: the length of a quaternion, or of an axis, is off by more than 1e-3; M23: a matrix
        mirrors, or is off by more than 1e-3.
    """
    assert stated.numbers is not None  # a table of frames has rotations
    numbers = np.where(rows[:, None], stated.numbers, np.nan)
    if stated.form == QUATERNION:
        return rotations(QUATERNION, numbers), _check_lengths(numbers, table, "quaternion")
    if stated.form == AXIS:
        # about no axis by no angle
        turned = np.where(np.any(numbers != 0, axis=1)[:, None], numbers[:, :3], np.nan)
        return rotations(AXIS, numbers), _check_lengths(turned, table, "axis")
    if stated.form == MATRIX:
        return _checked_matrices(numbers.reshape(-1, 3, 3), table)
    return rotations(stated.form, numbers), []


def _check_lengths(numbers: Array, table: DataTable, what: str) -> list[str]:
    """Refuse quaternions, or axes, that are none; warn of rounded ones."""
    columns = QUATERNION_COLUMNS if what == "quaternion" else AXIS_COLUMNS
    length = np.nan_to_num(np.linalg.norm(numbers, axis=1), nan=1.0)
    off = np.abs(length - 1)
    worst = int(np.argmax(off)) if len(off) else 0
    if len(off) and off[worst] > MENDED:
        raise refusal(
            table.place(worst), columns[0], f"the {what} has length {length[worst]:.6g}",
            code="M22", allowed="it should be 1, within 0.001",
            fix=f"check the columns {', '.join(columns)}",
        )  # fmt: skip
    if len(off) and off[worst] > 1e-5:
        many = "quaternions" if what == "quaternion" else "axes"
        return [f"{table.where}: {many} have lengths off 1 by up to {off[worst]:.1e}; scaled"]
    return []


def _checked_matrices(R: Array, table: DataTable) -> tuple[Array, list[str]]:
    """Refuse what is no rotation; project what is nearly one."""
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero(off > MENDED)
    mirrored = np.flatnonzero(np.nan_to_num(np.linalg.det(np.nan_to_num(R)), nan=1.0) < 0)
    if mirrored.size or bad.size:
        row = int(mirrored[0] if mirrored.size else bad[0])
        message = (
            "the matrix mirrors: its determinant is negative"
            if mirrored.size
            else f"the matrix is not a rotation: R'R is off the unit matrix by {off[row]:.2g}"
        )
        raise refusal(
            table.place(row), "r11", message, code="M23",
            allowed="rows r11 r12 r13 ... hold the orthonormal axes of a right-handed frame",
            fix="check the order and the signs of the columns",
        )  # fmt: skip
    out, far = np.array(R), np.flatnonzero(off > KEPT)
    U, _, Vt = np.linalg.svd(R[far])
    out[far] = U @ Vt
    worst = int(np.argmax(np.nan_to_num(off))) if off.size else 0
    most = float(np.nan_to_num(off[worst])) if off.size else 0.0
    if most <= QUIET:
        return frozen(out), []
    # one that stands out is a cell that was typed
    where = f"{table.where}: matrices are off rotations by up to {most:.1e}"
    return frozen(out), [f"{where} (line {table.sheet.lines[worst]}); set right"]


def _plain_columns(table: DataTable, names: tuple[str, ...]) -> Columns | None:
    """Columns without units that belong together; None if none of them is there."""
    there = [name for name in names if name in table]
    if not there:
        return None
    if len(there) < len(names):
        raise table.incomplete(there[0], [name for name in names if name not in table])
    return Columns(names)
