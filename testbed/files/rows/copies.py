"""Readings that add nothing: copies of earlier ones where that is certain, means of others."""

import numpy as np
from scipy.special import bdtrc

from calib.arrays import Array, Bool, Index
from calib.identification.fit_statistics import RED
from testbed.files.readings import Readings, copied_rows, rows_said
from testbed.files.targets import TargetPart

INCH = 0.0254
GRIDS = {"point": (1e-6, 1e-5 * INCH), "pose": (1e-5, 1e-3 * INCH)}
"""Coordinates that lie on one of these are coarse: three decimals of a millimeter or five of an
inch for points, whose three numbers good readings of one pose may share; two and three for poses,
which have three angles besides [m]."""
ON_GRID = 1e-10
"""Rounding of numbers in float64 to some kilometers [m]."""
NEAR = 0.1
"""How far a mean may lie from that of the others, as a part of their scatter: by chance readings of
three poses do so in all axes less than once in 10^9."""
FEWEST = 3
"""Poses with a mean, and rows of each."""
MOST = 0.8
"""Share of the poses with so many rows that have a mean."""
ASKED = 50
"""Poses of a long file that show whether it has means."""


def is_fine(readings: Readings) -> bool:
    """Whether readings, as they stand in the file, are so fine that no two good ones are alike.

    The one number of a distance is not. Of polar points the range tells it.
    """
    if not len(readings) or readings.kind not in GRIDS:
        return False
    reach = np.linalg.norm(readings.position, axis=1)
    grids = GRIDS[readings.kind]
    return not any(_on(grid, numbers) for grid in grids for numbers in (readings.position, reach))


def _on(grid: float, numbers: Array) -> bool:
    """Whether most numbers are multiples of a grid [m]."""
    off = np.abs(numbers - grid * np.round(numbers / grid))
    return bool((off < ON_GRID).mean() > 0.5)


def without_copies(part: TargetPart, *, fine: bool) -> tuple[TargetPart, list[str], list[str]]:
    """Rows with their joints without copies, a sentence on these, and one on what is only alike.

    A copy has the digits and the target of an earlier row, and is `fine`. Points must have its
    joints, too: one on the axis of a joint stays where it is while that joint turns. A pose that
    does not turn with the joints is an old reading.
    """
    readings = part.readings
    earlier: Bool = ~copied_rows(readings)[0]
    if not earlier.any():
        return part, [], []
    keep, said = np.ones(len(part), dtype=np.bool_), list[str]()
    if fine:
        _, target = np.unique(np.array(readings.target, dtype=str), return_inverse=True)
        joints = () if readings.kind == "pose" else (part.joints.q,)
        keep, said = copied_rows(readings, target.ravel(), *joints)
    alike = "the digits of earlier readings; that alone leaves none out, as good ones may be alike"
    odd = rows_said(readings.place, earlier & keep & ~_by_chance(part), alike, left="")
    return part.rows(keep), said, odd


def _by_chance(part: TargetPart) -> Bool:
    """Rows (m,) with the digits of an earlier visit of their pose, where that is mere chance.

    All such rows, or none: whether successive visits are alike no more often than is likely where
    each axis agrees as often as it does where the two others do not, and the axes by themselves.
    """
    position, again = part.readings.position, np.zeros(len(part), dtype=np.bool_)
    if part.readings.kind != "point":
        return again
    visits = [one for one in _visits(part) if len(one) > 1]
    same = [position[one[1:]] == position[one[:-1]] for one in visits]
    alike = np.concatenate([np.zeros((0, 3), dtype=np.bool_), *same])
    count, chance = int(alike.all(axis=1).sum()), 1.0
    for k in range(3):  # copies agree in all of them
        rest = alike[~np.delete(alike, k, axis=1).all(axis=1), k]
        chance *= float(rest.mean()) if len(rest) else 0.0
    if count and bdtrc(count - 1, len(alike), chance) < RED:
        return again
    for rows in visits:
        first = np.unique(position[rows], axis=0, return_index=True)[1]
        again[np.delete(rows, first)] = True
    return again


def _visits(part: TargetPart) -> list[Index]:
    """Rows of each pose, target and station, in their order."""
    names = (part.readings.target, part.readings.station)
    labels = [np.unique(np.array(one, dtype=str), return_inverse=True)[1] for one in names]
    key = np.column_stack([part.joints.q, *labels])
    _, group, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    return np.split(np.argsort(group.ravel(), kind="stable"), np.cumsum(count)[:-1])


def without_averages(part: TargetPart) -> tuple[TargetPart, list[str]]:
    """Rows with their joints without such means, where most poses have one, and a sentence on them.

    A mean adds nothing to the readings that it is made of. It stands right above or below them.
    """
    readings = part.readings
    if readings.kind == "distance" or len(part) < FEWEST * FEWEST:
        return part, []
    several = [one for one in _visits(part) if len(one) >= FEWEST]
    keep = np.ones(len(part), dtype=np.bool_)
    for k, rows in enumerate(several):
        if k == ASKED and int((~keep).sum()) < MOST * ASKED:
            return part, []
        for own in (0, -1) if rows[-1] - rows[0] < len(rows) else ():
            others = np.delete(readings.position[rows], own, axis=0)
            off = np.abs(readings.position[rows[own]] - others.mean(axis=0))
            keep[rows[own]] = not (off < NEAR * others.std(axis=0)).all()
    means = int((~keep).sum())
    if means < FEWEST or means < MOST * len(several):
        return part, []
    said = rows_said(readings.place, ~keep, "the mean of the other readings of their pose")
    return part.rows(keep), said
