"""Which joints belong to which reading: by row, by pose_id, or by order if that is stated."""

from collections import Counter
from collections.abc import Collection, Hashable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from calib.arrays import Array, Index
from calib.errors import InputError
from calib.geometry.model import RobotModel
from testbed.files.dialects.pose_names import counted_alike, plain, stay_apart, written_alike
from testbed.files.joints import Extras, Joints
from testbed.files.readings import Readings
from testbed.files.refusal import refusal, require_names
from testbed.files.slips import parted
from testbed.units import named

LARGEST_ID = 100_000
"""Whole numbers up to this are kept as pose numbers."""
SHOWN = 8


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """Joints and readings that belong together."""

    joints: Index
    """(m,) place in the joints."""
    readings: Index
    """(m,) place in the readings."""
    warnings: tuple[str, ...] = ()
    masked: tuple[str, ...] = ()
    """On rows that are left out."""


def by_row(joints: Joints, readings: Readings) -> Match:
    """Both stand in one line of one file."""
    at = {int(row): k for k, row in enumerate(joints.row)}
    both = [(at[int(row)], k) for k, row in enumerate(readings.order) if int(row) in at]
    pairs = np.array(both, dtype=np.int64).reshape(-1, 2)
    return Match(pairs[:, 0], pairs[:, 1])


def by_order(
    joints: Joints, readings: Readings, model: RobotModel, written: Sequence[str] = ()
) -> Match:
    """The k-th joint vector belongs to the k-th line of readings, which may hold several targets.

    Lines of missed shots and invalid rows, among those `written`, count where there are as many as
    joint vectors only with them: else these poses were measured again.

    Raises
    ------
    InputError
        M31: there are not as many of both.
    """
    changes = [one != other for one, other in pairwise(readings.place)]
    line = np.cumsum([0, *changes])[: len(readings)]
    lines = len(np.unique(line))
    if lines < len(joints) == len(written):
        at = {place: k for k, place in enumerate(written)}
        return Match(np.array([at[place] for place in readings.place]), np.arange(len(readings)))
    if len(joints) != lines:
        most = Counter(readings.target).most_common(1)[0][0] if len(readings) else ""
        rows = np.flatnonzero(np.array(readings.target) == most)
        where, parting = parted(model, joints, readings, rows)
        timed = joints.extras.moments is not None and readings.extras.moments is not None
        more = ', or let match = "time" hold their times against each other' if timed else ""
        times, rest = divmod(lines, max(len(joints), 1))
        fix = "remove the extra rows, or number both files in a column pose_id"
        if times > 1 and not rest and not parting:
            fix = (
                f"if each joint vector has {times} readings, of several targets or of one again, "
                "number both files in a column pose_id, and name the targets in a column target"
            )
        raise refusal(
            where, "match",
            f"there are {len(readings)} readings for {len(joints)} joint vectors in {joints.where}"
            + parting,
            code="M31", allowed='match = "order" needs as many of both',
            fix=f"{fix}{more}",
        )  # fmt: skip
    return Match(line, np.arange(len(readings)))


def by_cycle(joints: Joints, readings: Readings, model: RobotModel) -> Match:
    """The k-th reading of a target belongs to the k-th joint vector.

    Raises
    ------
    InputError
        M31: targets were not measured equally often, or not as often as there are joint vectors.
    """
    counts = Counter(readings.target)
    number = np.array([int(k) for k in readings.extras.pose or ()], dtype=np.int64)
    # a row that was left out makes the count go on past the joints
    if set(counts.values()) != {len(joints)} or number.max() >= len(joints):
        shown = ", ".join(f"{name or 'it'} {count}" for name, count in sorted(counts.items())[:8])
        odd = next((name for name, count in counts.items() if count != len(joints)), "")
        rows = np.flatnonzero(np.array(readings.target) == odd)
        where, parting = parted(model, joints, readings, rows)
        raise refusal(
            where, "target",
            f"targets were shot {shown} times for {len(joints)} joint vectors{parting}", code="M31",
            allowed="cycling names count poses only if all counts agree",
            fix="correct the export, or give each pose a group of its own",
        )  # fmt: skip
    return Match(number, np.arange(len(readings)))


def by_pose(
    joints: Joints, readings: Readings, *, drop: bool, elsewhere: Collection[str] = ()
) -> Match:
    """Rows with the same pose_id, and the same repeat where both files count visits.

    Where they do not, and joints come several times for a pose, its k-th reading belongs to its
    k-th joints. Poses of `elsewhere` were measured in other files, from other stations: they may be
    missing here.

    Raises
    ------
    InputError
        M25: a row without a name; M31: readings without joints, joints without readings (unless
        `drop`), joints twice.
    """
    for part in (joints, readings):
        if part.extras.pose is None:
            fix = 'number the poses in both files, or write match = "order" in session.toml'
            raise refusal(part.where, "pose_id", "has no column pose_id", fix=fix)
        require_names("pose_id", part.extras.pose, part.place)
    visits = joints.extras.repeat is not None and readings.extras.repeat is not None
    where = readings.where
    commanded, measured = _keys(joints.extras, visits=visits), _keys(readings.extras, visits=visits)
    if not {key[0] for key in measured} <= {key[0] for key in commanded} and not elsewhere:
        commanded, measured = _written_alike(commanded, measured)
    others = {plain(name) for name in elsewhere}
    once = _stops(commanded, joints.q)
    at = {commanded[k]: k for k in once}
    if len(at) < len(once):
        keys = [commanded[k] for k in once]
        stops = joints.rows(np.array(once))
        keys, measured = _by_visit(keys, measured, stops, readings, others)
        at = dict(zip(keys, once, strict=True))
    without = [key for key in dict.fromkeys(measured) if key not in at]
    if without:
        raise _mismatch(where, f"{joints.where} has no joints for", without)
    there = set(measured)
    missing = [key for key in at if key not in there]
    lost = [key for key in missing if key[0] not in others]
    if lost and not drop:
        raise _mismatch(where, "there is no reading of", lost, " or add --drop-invalid")
    warnings = [f"{where}: there is no reading of {_listed(lost)}; left out"] if lost else []
    if measured and (apart := {key[0] for key in missing if key[0] in others}):
        warnings.append(f"{where}: {len(apart)} poses are in other files only")
    rows = np.array([at[key] for key in measured], dtype=np.int64)
    return Match(rows, np.arange(len(measured)), tuple(warnings))


def _stops(keys: Sequence[tuple[str, int]], q: Array) -> list[int]:
    """The first row of each stop: a file of several targets says its joints beside each of them."""
    again = [
        False,
        *(keys[k] == keys[k - 1] and (q[k] == q[k - 1]).all() for k in range(1, len(q))),
    ]
    return [k for k in range(len(q)) if not again[k]]


def _by_visit(
    commanded: Sequence[tuple[str, int]],
    measured: Sequence[tuple[str, int]],
    stops: Joints,
    readings: Readings,
    others: Collection[str],
) -> tuple[list[tuple[str, int]], list[tuple[str, int]]]:
    """Keys of stops and readings, with the visit in those of poses that have several stops.

    Raises
    ------
    InputError
        M31: some target was not read as often as the robot stood there, or a file numbers its
        visits otherwise.
    """
    count = Counter(commanded)
    twice = {key for key, often in count.items() if often > 1}
    shown = list(zip(measured, readings.target, readings.anchor, readings.station, strict=True))
    odd = {key for (key, *_), often in Counter(shown).items() if often != count[key]}
    odd |= {key for key in twice - set(measured) if key[0] not in others}
    found = []
    for keys, visit, stated in (
        (commanded, visits_of(commanded), stops.extras.repeat),
        (measured, visits_of(shown), readings.extras.repeat),
    ):
        if stated is not None:
            odd |= {keys[k] for k in np.flatnonzero(stated != visit).tolist()}
        found.append([(key[0], int(k)) if key in twice else key
                      for key, k in zip(keys, visit, strict=True)])  # fmt: skip
    odd &= twice
    if wrong := [key for key in count if key in odd]:
        more = ", or number the visits in both files in a column repeat"
        raise _mismatch(readings.where, f"{stops.where} has joints twice for", wrong, more)
    return found[0], found[1]


def pose_numbers(names: Sequence[str]) -> tuple[Index, tuple[str, ...]]:
    """Number of each row's pose (m,) and the name of each number.

    Whole numbers stay what they are; other names are numbered as they come.
    """
    if all(name.isascii() and name.isdigit() and int(name) <= LARGEST_ID for name in names):
        ids = np.array([int(name) for name in names], dtype=np.int64)
        there = set(ids.tolist())
        return ids, tuple(str(k) if k in there else "" for k in range(ids.max(initial=-1) + 1))
    return numbered(names)


def numbered(names: Sequence[str]) -> tuple[Index, tuple[str, ...]]:
    """Number (m,) of each text in the order they come, and the texts."""
    known = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return np.array([known[name] for name in names], dtype=np.int64), tuple(known)


def poses_of_joints(q: Array) -> Index:
    """Pose (m,) of rows without names: equal joints are one pose, visited again."""
    _, first, pose = np.unique(q, axis=0, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[pose.ravel()]


def visits_of(poses: Iterable[Hashable]) -> Index:
    """Which visit (m,) of its pose each row is, from 0, in the order of the rows."""
    count: Counter[Hashable] = Counter()
    visits = []
    for pose in poses:
        visits.append(count[pose])
        count[pose] += 1
    return np.array(visits, dtype=np.int64)


def _keys(extras: Extras, *, visits: bool) -> list[tuple[str, int]]:
    """Pose and visit of each row; numbers are equal however they are written."""
    names = extras.pose or ()
    repeat = extras.repeat if visits and extras.repeat is not None else np.zeros(len(names))
    return [(plain(name), int(k)) for name, k in zip(names, repeat, strict=True)]


def _written_alike(
    commanded: Sequence[tuple[str, int]], measured: Sequence[tuple[str, int]]
) -> tuple[list[tuple[str, int]], list[tuple[str, int]]]:
    """Keys as two programs would write them alike, where that brings all readings to joints."""
    files = [[name for name, _ in keys] for keys in (commanded, measured)]
    one, other = ([(written_alike(name), k) for name, k in keys] for keys in (commanded, measured))
    found = {name for name, _ in other} <= {name for name, _ in one}
    if found and all(stay_apart(names) for names in files):
        return one, other
    numbers = counted_alike(*files)
    if numbers is not None:
        keys = zip((commanded, measured), numbers, strict=True)
        one, other = ([(own[name], k) for name, k in each] for each, own in keys)
        return one, other
    return list(commanded), list(measured)


def _listed(keys: Sequence[tuple[str, int]]) -> str:
    """Poses in words."""
    shown = [f"{name[:20]}{f' visit {k}' if k else ''}" for name, k in keys[:SHOWN]]
    return named("pose", shown, len(keys))


def _mismatch(where: str, what: str, keys: Sequence[tuple[str, int]], more: str = "") -> InputError:
    """The error of poses that do not match."""
    message, fix = f"{what} {_listed(keys)}", f"correct the column pose_id{more}"
    names = [name for name, _ in keys[:SHOWN]]
    return refusal(where, "pose_id", message, code="M31", value=names, fix=fix)
