"""Joints and readings that were matched, from all files, into one `Session` with its targets."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.measurement.corrections import Corrections
from calib.measurement.observations import Measurements
from testbed.files.conditions import SetUp, first_stated, of_session
from testbed.files.matching import pose_numbers, poses_of_joints, visits_of
from testbed.files.refusal import refusal
from testbed.files.rows.beside import BesideJoints
from testbed.files.rows.operating import RowsOfFile, operating_conditions, stated_order
from testbed.files.rows.stops import NEAR, NEAR_SLIDE, one_stop
from testbed.files.session import Session, Stated
from testbed.files.session_toml import SessionFile
from testbed.files.targets import TargetPart, targets_of, texts_of
from testbed.robots.robot import Robot

SHIFTS = (1, -1, 2, -2, 3, -3)
"""Rows by which joints may stand beside the names of their poses."""
READ, READ_SLIDE = float(np.radians(0.5)), 5e-3
"""Read-back joints farther apart belong to two poses: play and the rest of a controller's error
leave a tenth of a degree at one [rad, m]."""


def assemble(
    parts: Sequence[TargetPart], robot: Robot, settings: SessionFile, *, where: str
) -> Session:
    """One session of all parts, `where` in messages; what the reader knows besides is left empty.

    Raises
    ------
    InputError
        M27: no row is left; M31: one name for two poses, or a visit twice; M35: a pose is split.
    """
    if not sum(len(part) for part in parts):
        where, fix = parts[0].readings.where, "see what was left out, and measure again"
        raise refusal(where, "measurements", "no row is left", code="M27", fix=fix)
    q = np.concatenate([part.joints.q for part in parts])
    place = texts_of(parts, "place")
    target = targets_of(parts, settings.start)
    # joints number the poses
    named = _joined([part.joints.extras.pose for part in parts])
    if named is not None:
        pose, names = pose_numbers(named)
    else:
        pose = poses_of_joints(q)
        names = tuple(str(k + 1) for k in range(pose.max() + 1))
    source = parts[0].joints.source
    if named is not None:
        slides = robot.model.chain.prismatic > 0
        near, slide = (NEAR, NEAR_SLIDE) if source == "commanded" else (READ, READ_SLIDE)
        _check_poses(pose, names, q, place, np.where(slides, slide, near))
    split = settings.split == "column" and any(_extra(part, "split") for part in parts)
    words = [word for part in parts for word in _extra(part, "split") or [""] * len(part)]
    is_test = np.array([split and word == "test" for word in words])
    _check_split(pose, is_test, names, place)
    table = Measurements(
        q=q,
        position=np.concatenate([part.readings.position for part in parts]),
        rotation=np.concatenate([part.readings.rotation for part in parts]),
        covariance=np.concatenate([part.readings.covariance for part in parts]),
        kind=np.concatenate([np.full(len(part), part.readings.kind) for part in parts]),
        offset=target.offset,
        pose_id=pose,
        repeat=np.zeros(len(pose), dtype=np.int64),
        reflector=target.reflector,
        station=target.station,
        anchor=target.anchor,
        distance=np.concatenate([part.readings.distance for part in parts]),
    )
    table = replace(table, repeat=_repeats(parts, table, names, place))
    conditions = of_session(
        [
            (
                part.readings.where,
                first_stated(part.readings.extras.conditions, part.joints.extras.conditions),
            )
            for part in parts
            if len(part)
        ],
        settings.conditions,
        len(q),
    )
    table, names, odd = one_stop(table, conditions, names, robot.model.chain.prismatic > 0)
    files = [_rows(part) for part in parts]
    operating, said, notes = operating_conditions(
        files, conditions, robot, settings.identification.order,
        where if settings.conditions.payload_kg is not None else "",
    )  # fmt: skip
    order = stated_order(files)
    inverted = any(part.readings.stated.inverted for part in parts)
    included = settings.uncertainty.joint_repeatability == "included"
    return Session(
        name=settings.name,
        measurements=replace(table, conditions=operating),
        pose_names=names,
        is_test=is_test,
        split_stated=split,
        read_back=_stacked([part.joints.read_back for part in parts]),
        # several files begin their clocks at different times
        time=_stacked([_extra(part, "time") for part in parts]) if len(parts) == 1 else None,
        order=order,
        numbered=order is not None,
        conditions=conditions,
        set_up=SetUp(
            use=settings.use.rows(1),
            tolerance=settings.conditions.tolerance,
            date=settings.conditions.date or _span(parts),
            stations=tuple(filter(None, target.station_names)),
            job=settings.job.sheet,
        ),
        approach=_joined([_extra(part, "approach") for part in parts]),
        joint_source=source,
        uncertainty="; ".join(dict.fromkeys(part.readings.uncertainty for part in parts)),
        noise_assumed=settings.uncertainty.assumed,
        systematic=settings.uncertainty.systematic,
        corrections=Corrections.stacked([(len(one), one.readings.corrections) for one in parts]),
        joint_scatter=frozen(np.zeros(q.shape[1]) if included else robot.repeatability),
        fixtures=target.fixtures,
        placed=settings.start is not None and target.placed,
        fixed=target.fixed,
        reflector_names=target.reflector_names,
        anchor_names=target.anchor_names,
        station_names=target.station_names,
        warnings=(
            *(text for part in parts for text in (*part.joints.warnings, *part.readings.warnings)),
            *(f"{place[0].rpartition(':')[0]}: {text}" for text in odd if named),
        ),
        notes=(
            *filter(None, [robot.controller.sentence]),
            *(note for part in parts for note in part.readings.notes),
            *notes,
        ),
        unread=tuple(dict.fromkeys(one for part in parts for one in part.readings.unread)),
        stated=parts[0].readings.stated if len(parts) == 1 else Stated(inverted=inverted),
        simulated=settings.simulated,
        wanted=settings.identification,
        rows_say=said,
        gear=settings.gear.of_joints(q.shape[1], where),
        decision=settings.tolerance.decision if settings.tolerance else None,
        place=place,
    )


def _span(parts: Sequence[TargetPart]) -> str:
    """The day, or the first and the last one, where the times of all files say it."""
    days = [part.readings.extras.days or part.joints.extras.days for part in parts]
    if not all(days):
        return ""
    first, last = min(one[0] for one in days), max(one[1] for one in days)
    return first if first == last else f"{first} to {last}"


def _rows(part: TargetPart) -> RowsOfFile:
    """What the rows of one file say for a model."""
    extras = [part.readings.extras, part.joints.extras]
    torque = next((one.beside for one in extras if one.beside.torque is not None), BesideJoints())
    order = next((one.beside.order for one in extras if one.beside.order is not None), None)
    time = _extra(part, "time")
    return RowsOfFile(
        part.joints.q,
        part.readings.place,
        part.readings.order,
        time if isinstance(time, np.ndarray) else None,
        replace(torque, order=order),
    )


def _extra(part: TargetPart, name: str) -> Array | tuple[str, ...] | None:
    """A column of the readings, else of the joints."""
    columns: list[Array | tuple[str, ...] | None]
    columns = [getattr(extras, name) for extras in (part.readings.extras, part.joints.extras)]
    return next((column for column in columns if column is not None), None)


def _stacked(columns: Sequence[Array | tuple[str, ...] | None]) -> Array | None:
    """A column of numbers that all parts have, or None."""
    there = [column for column in columns if isinstance(column, np.ndarray)]
    return frozen(np.concatenate(there)) if len(there) == len(columns) else None


def _joined(columns: Sequence[Array | tuple[str, ...] | None]) -> tuple[str, ...] | None:
    """A column of texts that all parts have, or None."""
    there = [column for column in columns if isinstance(column, tuple)]
    return tuple(t for column in there for t in column) if len(there) == len(columns) else None


def _repeats(
    parts: Sequence[TargetPart], table: Measurements, names: Sequence[str], place: Sequence[str]
) -> Index:
    """Which visit of its pose each row is; stated, or counted for each target.

    Raises
    ------
    InputError
        M31: one visit comes twice.
    """
    pose = table.pose_id
    _, what = np.unique(table.target_key, axis=0, return_inverse=True)
    stated = [_extra(part, "repeat") for part in parts]
    if any(column is None for column in stated):
        _, both = np.unique(np.column_stack([pose, what.ravel()]), axis=0, return_inverse=True)
        return visits_of(both.ravel().tolist())
    repeat = np.concatenate([np.asarray(column) for column in stated])
    key = np.column_stack([pose, what.ravel(), repeat])
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        row = int(first[np.argmax(count > 1)])
        later = next(int(k) for k in np.flatnonzero((key == key[row]).all(axis=1)) if k != row)
        message = (
            f"pose {names[pose[row]]}, visit {repeat[row]} appears twice, first in "
            f"line {place[row].rpartition(':')[2]}"
        )
        fix = "number the visits 0, 1, 2 ... in the column repeat"
        raise refusal(place[later], "repeat", message, code="M31", fix=fix)
    return repeat


def _check_poses(
    pose: Index, names: Sequence[str], q: Array, place: Sequence[str], near: Array
) -> None:
    """Refuse one name for joints that differ by more than `near` (n,) [rad, m]."""
    _, first, number = np.unique(pose, return_index=True, return_inverse=True)
    start = first[number.ravel()]
    off = (np.abs(q - q[start]) > near).any(axis=1)
    if off.any():
        row = int(np.argmax(off))
        name, file = names[pose[row]], place[row].rpartition(":")[0]
        other, _, line = place[start[row]].rpartition(":")
        of = f" of {other}" * (other != file)
        message = f"pose {name} has other joints than in line {line}{of}"
        here = [k for k, one in enumerate(place) if one.rpartition(":")[0] == file]
        shift = next((k for k in SHIFTS if _agree(pose[here], q[here], k, near)), None)
        if shift is not None:
            rows = "one row" if abs(shift) == 1 else f"{abs(shift)} rows"
            message += (
                f"; taken from {rows} further {'down' if shift > 0 else 'up'}, the joints of every "
                "pose are the same throughout"
            )
            fix = f"move the joints {rows} {'up' if shift > 0 else 'down'}, beside their pose_id"
        else:
            fix = "give it a pose_id of its own"
        raise refusal(place[row], "pose_id", message, code="M31", value=name, fix=fix)


def _agree(pose: Index, q: Array, shift: int, near: Array) -> bool:
    """Whether rows of one name have one joint vector, that some rows further on."""
    low, high = max(0, -shift), len(pose) - max(0, shift)
    _, first, number = np.unique(pose[low:high], return_index=True, return_inverse=True)
    moved = q[low + shift : high + shift]
    apart = len(first) < high - low and len(np.unique(moved[first], axis=0)) > len(first) // 2
    return apart and bool((np.abs(moved - moved[first[number.ravel()]]) <= near).all())


def _check_split(pose: Index, is_test: Bool, names: Sequence[str], place: Sequence[str]) -> None:
    """Refuse a pose that judges what it was used for."""
    both = np.intersect1d(pose[is_test], pose[~is_test])
    if both.size:
        row, name = int(np.flatnonzero((pose == both[0]) & is_test)[0]), names[both[0]]
        message = f"pose {name} is for identification and for test"
        raise refusal(
            place[row], "split", message, value=name, allowed="visits of one pose stay together",
            fix="write one word for all its rows",
        )  # fmt: skip
