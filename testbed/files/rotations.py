"""Rotations in the conventions of files, read into matrices and written back."""

import warnings
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, frozen
from calib.errors import InputError
from calib.geometry.frames import exp_so3, log_so3
from testbed.files.columns import find_all
from testbed.files.session import Stated
from testbed.files.table import Table
from testbed.strict import choice_of

EULER = tuple(
    "".join(triple)
    for letters in ("XYZ", "xyz")
    for triple in product(letters, repeat=3)
    if all(a != b for a, b in pairwise(triple))
)
"""Euler sequences: capitals turn about axes that turn along, small letters about fixed ones."""
MAKERS = {
    "kuka": "ZYX",
    "staubli": "XYZ",
    "fanuc": "xyz",
    "ur": "rotation_vector",
}
"""What some controllers mean by three angles; KUKA: A about Z, B about Y, C about X."""
QUATERNION, MATRIX, VECTOR = "quaternion", "matrix", "rotation_vector"
KEPT, QUIET, MENDED = 1e-12, 1e-6, 1e-3
"""Largest |R'R - I| of a matrix that is kept as it is, projected, projected with a warning."""


def rotations(form: str, numbers: ArrayLike) -> Array:
    """Rotation matrices (m, 3, 3) of numbers (m, k) in a form of `Stated.form`.

    Euler angles are in the order of the letters [rad]: ``ABC`` is R_A(a) R_B(b) R_C(c) and ``abc``
    is R_C(c) R_B(b) R_A(a). Quaternions have w first and any length. Matrices are by rows and are
    not mended.
    """
    values = np.asarray(numbers, dtype=np.float64)
    if form == MATRIX:
        return values.reshape(-1, 3, 3)
    if form == VECTOR:
        return exp_so3(values)
    if form == QUATERNION:
        return _from_quaternions(values)
    R = np.broadcast_to(np.eye(3), (len(values), 3, 3))
    for letter, angle in zip(form, values.T, strict=True):
        axis = np.eye(3)["xyz".index(letter.lower())]
        turn = exp_so3(angle[:, None] * axis)
        R = R @ turn if letter.isupper() else turn @ R
    return R


def stated_in(table: Table, euler: str | None) -> tuple[Stated, list[str]] | None:
    """How the rotations of a table stand in it, and the columns used; None if it has none.

    Raises
    ------
    InputError
        M24: three angles without their sequence. M35: two forms at once.
    """
    where = table.where
    angles = find_all(table.names, ("rx", "ry", "rz"), "angle", where)
    ordered = find_all(table.names, ("e1", "e2", "e3"), "angle", where)
    vector = find_all(table.names, ("rvx", "rvy", "rvz"), "angle", where)
    quaternion = _all_or_none(table, ("qw", "qx", "qy", "qz"))
    matrix = _all_or_none(table, tuple(f"r{i}{j}" for i in "123" for j in "123"))
    forms = [form for form in (angles, ordered, vector, quaternion, matrix) if form]
    if len(forms) > 1:
        raise InputError(
            f"has rotations in two forms ({forms[0][0][0]} and {forms[1][0][0]})",
            code="M35",
            where=where,
            field="frames",
            fix="keep one of them",
        )
    if not forms:
        return None
    names, factors = forms[0]
    numbers = table.numbers(names) * factors
    if matrix or quaternion:
        return Stated(MATRIX if matrix else QUATERNION, numbers), names
    if vector:
        return Stated(VECTOR, numbers), names
    form = sequence_of(euler if euler is not None else table.only("euler"), where)
    if form == VECTOR:
        return Stated(VECTOR, numbers), names
    if angles:
        if set(form.upper()) != set("XYZ"):
            raise InputError(
                f'euler = "{form}" turns about one axis twice; rx, ry, rz do not fit it',
                code="M24",
                where=where,
                field="euler",
                value=form,
                fix="name the columns e1_deg, e2_deg, e3_deg, in the order of the letters",
            )
        numbers = numbers[:, ["XYZ".index(letter) for letter in form.upper()]]
    return Stated(form, numbers), names


def sequence_of(euler: str | None, where: str) -> str:
    """The sequence that a word means: ``XYZ``, ``zyx``, or the name of a maker.

    Raises
    ------
    InputError
        M24: there is none, or the word means nothing.
    """
    if euler is not None and (euler in EULER or euler == VECTOR):
        return euler
    if euler is not None and euler in MAKERS:
        return MAKERS[euler]
    raise InputError(
        "three angles do not say in which order they turn"
        if euler is None
        else f'euler = "{euler[:20]}" means nothing',
        code="M24",
        where=where,
        field="euler",
        value=euler,
        allowed="XYZ ... capitals turn about axes that turn along, xyz ... small ones about fixed "
        "axes; or rotation_vector, kuka, staubli, fanuc, ur",
        fix='write euler = "XYZ" under [frames] in session.toml, or a column euler'
        if euler is None
        else choice_of(euler, (*EULER, VECTOR, *MAKERS))
        if len(euler) > 3
        else "",
    )


def checked_rotations(stated: Stated, table: Table, rows: Bool) -> tuple[Array, list[str]]:
    """Proper rotations (m, 3, 3) of a table's good rows, and what was odd about them.

    Parameters
    ----------
    stated : Stated
        Numbers of all rows.
    table : Table
        For the place of a row in messages.
    rows : (m,) array of bool
        Rows whose numbers are numbers.

    Raises
    ------
    InputError
        M22: a quaternion's length is off by more than 1e-3; M23: a matrix mirrors, or is off by
        more than 1e-3.
    """
    assert stated.numbers is not None  # a table of frames has rotations
    numbers = np.where(rows[:, None], stated.numbers, np.nan)
    if stated.form == QUATERNION:
        return rotations(QUATERNION, numbers), _check_lengths(numbers, table)
    if stated.form == MATRIX:
        return _checked_matrices(numbers.reshape(-1, 3, 3), table)
    return rotations(stated.form, numbers), []


def _check_lengths(numbers: Array, table: Table) -> list[str]:
    """Refuse quaternions that are none; warn of rounded ones."""
    length = np.nan_to_num(np.linalg.norm(numbers, axis=1), nan=1.0)
    off = np.abs(length - 1)
    worst = int(np.argmax(off)) if len(off) else 0
    if len(off) and off[worst] > MENDED:
        raise InputError(
            f"the quaternion has length {length[worst]:.6g}",
            code="M22",
            where=table.place(worst),
            field="qw",
            allowed="it should be 1, within 0.001",
            fix="check the columns qw, qx, qy, qz",
        )
    if len(off) and off[worst] > 1e-5:
        return [f"{table.where}: quaternions have lengths off 1 by up to {off[worst]:.1e}; scaled"]
    return []


def _checked_matrices(R: Array, table: Table) -> tuple[Array, list[str]]:
    """Refuse what is no rotation; project what is nearly one."""
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero(off > MENDED)
    mirrored = np.flatnonzero(np.nan_to_num(np.linalg.det(np.nan_to_num(R)), nan=1.0) < 0)
    if mirrored.size or bad.size:
        row = int(mirrored[0] if mirrored.size else bad[0])
        told = (
            "the matrix mirrors: its determinant is negative"
            if mirrored.size
            else f"the matrix is no rotation: R'R is off the unit matrix by {off[row]:.2g}"
        )
        raise InputError(
            told,
            code="M23",
            where=table.place(row),
            field="r11",
            allowed="rows r11 r12 r13 ... hold the orthonormal axes of a right-handed frame",
            fix="check the order and the signs of the columns",
        )
    out, far = np.array(R), np.flatnonzero(off > KEPT)
    U, _, Vt = np.linalg.svd(R[far])
    out[far] = U @ Vt
    worst = float(np.nanmax(np.append(off, 0.0)))
    told = f"{table.where}: matrices are off rotations by up to {worst:.1e}; set right"
    return frozen(out), [told] if worst > QUIET else []


def _from_quaternions(values: Array) -> Array:
    """Rotations (m, 3, 3) of quaternions (m, 4), w first, of any length."""
    unit = values / np.linalg.norm(values, axis=1, keepdims=True)
    vector = unit[:, 1:]
    half = np.linalg.norm(vector, axis=1)
    angle = 2 * np.arctan2(half, unit[:, 0])
    # the axis of a turn by nothing does not matter
    return exp_so3(vector / np.where(half > 0, half, 1.0)[:, None] * angle[:, None])


def _all_or_none(table: Table, names: tuple[str, ...]) -> tuple[list[str], list[float]] | None:
    """Columns that belong together; none if one of them is missing and it is not mostly there."""
    there = [name for name in names if name in table]
    if not there:
        return None
    if len(there) < len(names):
        missing = [name for name in names if name not in table]
        raise InputError(
            f"there is a column {there[0]} but none for {', '.join(missing)}",
            code="M35",
            where=table.where,
            field=missing[0],
            fix="give all of them or none",
        )
    return list(names), [1.0] * len(names)


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
