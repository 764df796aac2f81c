"""Readings that an instrument did not take anew: the digits of another row where none can be."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.frames import length, target_points
from calib.geometry.model import RobotModel
from testbed.files.frames_fit import far_for, flange_poses
from testbed.files.readings import rows_said
from testbed.files.rows.exact import METERS, digit_steps, moved_by_digits, step_of
from testbed.files.rows.strays import FITS, trimmed_frames
from testbed.files.targets import TargetPart
from testbed.units import MM, significant

INCH = 0.0254
STEPS = (*METERS, *(INCH * 10.0**-k for k in range(1, 6)))
"""Steps to which coordinates are rounded in files [m]."""
FEWEST = 8
"""Different readings of a target that tell where it is in the flange."""
LEAST, LEAST_FINE = 5e-4, 2e-4
"""A target that moves by less may have been seen at one place, as where backlash holds an arm; the
same of digits so fine that even there no two readings are alike [m]."""
NOISES = 10.0
"""The same in units of noise and of what digits of readings and joints leave."""
MISSES, TRAVEL = 10.0, 0.05
"""The same in medians of what the nominal arm misses, or as a part of how far its joints move the
target one by one, where that is less: what links are off by grows with the way."""
ELSEWHERE = 3.0
"""How many times more a nominal arm misses, at most, by a place that rows elsewhere tell as well:
few rows that come from one side are fitted better than the arm is."""
HALF = 0.5
"""Part of the rows that have to be left: swapped columns of joints make most others look stale."""


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Where the nominal arm brings the target of each row, for rows whose target is told."""

    told: Bool
    """(m,) whether enough rows tell where the target is."""
    place: Array
    """(2, m, 3) of the target, by readings that differ and by all of them [m]."""
    miss: Array
    """(m,) how far the reading is from it [m]."""
    usual: Array
    """(m,) median of these for the target, of rows that differ [m]."""
    travel: Array
    """(m, n) how far a joint moves the target [m/rad or m/m]."""


def stale_rows(part: TargetPart, model: RobotModel, *, fine: bool) -> tuple[Bool, list[str]]:
    """Rows (m,) without those that were not measured, and a sentence on them.

    An instrument that stays on its last value repeats a reading to the last digit while the joints
    lead elsewhere: by more than noise, digits and the errors of a nominal arm explain, wherever the
    target is in the flange. Of such rows the first stays whose joints fit, in time where the file
    tells it. Points on the axis of a joint stay where they are, and those that the arm turns about;
    distances tell nothing, nor do joints that fit no reading.

    Parameters
    ----------
    part : TargetPart
        Rows of one file with their joints.
    model : RobotModel
        Nominal.
    fine : bool
        Whether the digits are so fine that no two good readings are alike, see `is_fine`.
    """
    readings, keep = part.readings, np.ones(len(part), dtype=np.bool_)
    station = np.unique(np.array(readings.station, dtype=str), return_inverse=True)[1]
    rotation = readings.rotation.reshape(-1, 9)
    key = np.column_stack([readings.position, rotation, station])
    _, alike = np.unique(key, axis=0, return_inverse=True)
    alike = alike.ravel()
    if readings.kind == "distance" or len(np.unique(alike)) == len(alike):
        return keep, []
    in_time = np.argsort(_times(part), kind="stable")
    seen = _seen(part, model, alike, in_time)
    least = max(LEAST_FINE if fine else LEAST, NOISES * _uncertain(part, model))
    far = list[float]()
    for rows in _parted(in_time[seen.told[in_time]], alike):
        if len(rows) < 2:
            continue
        fits = seen.miss[rows] < np.maximum(FITS * seen.usual[rows], LEAST)
        first = int(rows[np.argmax(fits)])
        moved = length(seen.place[:, rows] - seen.place[:, [first]]).min(axis=0)
        way = np.abs(part.joints.q[rows] - part.joints.q[first])
        travel = TRAVEL * (way * seen.travel[rows]).sum(axis=1)
        limit = np.maximum(np.minimum(MISSES * seen.usual[rows], travel), least)
        keep[rows[moved > limit]] = False
        far += moved[moved > limit].tolist()
    if keep.all() or keep.mean() < HALF:  # then rather something else is wrong with the file
        return np.ones_like(keep), []
    ends = [significant(size * MM, 2) for size in (min(far), max(far))]
    away = f"{ends[0]} to {ends[1]}" if ends[0] != ends[1] else ends[0]
    return keep, rows_said(
        readings.place, ~keep,
        f"digit for digit the readings of other rows, from which their joints lead {away} mm away: "
        "an instrument that stays on its last value measured nothing there",
    )  # fmt: skip


def _parted(rows: Index, group: Index) -> list[Index]:
    """Rows by the group (m,) that they are of, each in their order."""
    rows = rows[np.argsort(group[rows], kind="stable")]
    return np.split(rows, np.flatnonzero(np.diff(group[rows])) + 1)


def _times(part: TargetPart) -> Array:
    """Time (m,) of each row where a file tells it, else its place there."""
    for extras in (part.readings.extras, part.joints.extras):
        if extras.time is not None:
            return extras.time
    return part.readings.order.astype(np.float64)


def _uncertain(part: TargetPart, model: RobotModel) -> float:
    """What noise and the digits of readings and joints leave of a target's place [m]."""
    q, position = part.joints.q, part.readings.position
    noise = np.trace(part.readings.covariance[:, :3, :3], axis1=1, axis2=2).max()
    digits = moved_by_digits(model, q, digit_steps(model, q))
    return float(np.sqrt(noise + step_of(position, STEPS) ** 2 + digits**2))


def _seen(part: TargetPart, model: RobotModel, alike: Index, in_time: Index) -> _Seen:
    """Where the targets are, told by the first in time of the rows of each reading alone.

    Where these come from one side, as where points are touched from above and the tool is turned
    about them then, all rows tell more: a place by both, of which the nearer one counts.
    """
    readings, m = part.readings, len(part)
    F = flange_poses(model, part.joints.q)
    target, station = (np.array(names, dtype=str) for names in (readings.target, readings.station))
    told, place, miss, usual = np.zeros(m, dtype=np.bool_), np.zeros((2, m, 3)), *np.zeros((2, m))
    travel = np.zeros((m, part.joints.q.shape[1]))
    names = np.column_stack([target, station])
    if readings.kind == "pose":
        names[:, 0] = ""
    _, group = np.unique(names, axis=0, return_inverse=True)
    for rows in _parted(in_time, group.ravel()):
        first = rows[np.sort(np.unique(alike[rows], return_index=True)[1])]
        if len(first) < FEWEST:
            continue
        for k, some in enumerate((rows, first)):
            turned = readings.rotation[some] if readings.kind == "pose" else None
            frames, _ = trimmed_frames(F[some], readings.position[some], turned)
            place[1 - k, rows] = target_points(F[rows], frames.arm) @ frames.R.T + frames.t
        miss[rows] = length(readings.position[rows] - place[0, rows])
        by_all = length(readings.position[first] - place[1, first])
        own = float(np.median(miss[first]))
        usual[rows] = max(own, min(float(np.median(by_all)), ELSEWHERE * own))
        told[rows] = usual[first[0]] < far_for(readings.position[first])
        for j, step in enumerate(1e-6 * np.eye(part.joints.q.shape[1])):
            moved = target_points(flange_poses(model, part.joints.q[rows] + step), frames.arm)
            travel[rows, j] = length(moved - target_points(F[rows], frames.arm)) / 1e-6
    return _Seen(told, place, miss, usual, travel)
