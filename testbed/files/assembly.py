"""Joints and readings that were matched, from all files, into one `Session` with its targets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.geometry.fixtures import Fixtures
from calib.measurement.observations import GIVEN, Measurements
from testbed.files.joints import Joints
from testbed.files.matching import numbered, pose_numbers, poses_of_joints, visits_of
from testbed.files.readings import Readings
from testbed.files.refusal import refusal
from testbed.files.session import Session, Stated
from testbed.files.session_toml import ObservedTable, Place, PointsTable, RangesTable, SessionFile
from testbed.robots.robot import Robot
from testbed.strict import choice_of

SAME_JOINTS = 1e-6
"""Commanded joints of one pose differ by rounding only [rad, m]."""


@dataclass(frozen=True, slots=True, eq=False)
class TargetPart:
    """Rows of one file with their joints."""

    joints: Joints
    readings: Readings
    section: ObservedTable

    def __len__(self) -> int:
        return len(self.readings)


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Where the reflectors, anchors and stations of all rows are."""

    reflector: Index
    offset: Array
    anchor: Index
    station: Index
    fixtures: Fixtures
    fixed: tuple[str, ...]
    reflector_names: tuple[str, ...]
    anchor_names: tuple[str, ...]
    station_names: tuple[str, ...]


def texts_of(parts: Sequence[TargetPart], name: str) -> tuple[str, ...]:
    """A column of texts of all readings."""
    return tuple(text for part in parts for text in getattr(part.readings, name))


def targets_of(parts: Sequence[TargetPart]) -> Targets:
    """Numbers and places of everything that was measured, and from where."""
    station, station_names = numbered(texts_of(parts, "station"))
    anchors = texts_of(parts, "anchor")
    anchor_names = tuple(dict.fromkeys(name for name in anchors if name))
    anchor = {name: k for k, name in enumerate(anchor_names)}
    known = _anchor_places(parts, anchor_names)
    places: dict[str, Array | None] = {}
    for part in parts:
        places |= _reflector_places(part)
    free = _free_reflectors(parts, places)
    at = {name: k for k, name in enumerate(free)}
    reflector, offset = [], []
    for part in parts:
        readings = part.readings
        is_pose = readings.kind == "pose"
        given = [None] * len(part) if readings.offset is None else readings.offset
        for name, xyz in zip(readings.target, given, strict=True):
            is_free = not is_pose and xyz is None and name in at
            place = places.get(name) if xyz is None else xyz
            reflector.append(at[name] if is_free else GIVEN)
            offset.append(np.zeros(3) if is_pose or is_free or place is None else place)
    far = [part.readings.kind == "distance" for part in parts for _ in range(len(part))]
    return Targets(
        reflector=np.array(reflector, dtype=np.int64),
        offset=np.array(offset).reshape(-1, 3),
        anchor=np.array([anchor.get(name, GIVEN) for name in anchors], dtype=np.int64),
        station=np.where(far, 0, station),
        fixtures=Fixtures(
            np.zeros((len(free), 3)),
            np.array([np.zeros(3) if xyz is None else xyz for xyz in known]).reshape(-1, 3),
            np.tile(np.eye(4), (max(len(station_names) - 1, 0), 1, 1)),
        ),
        fixed=tuple(
            f"anchor{k + 1}.{axis}"
            for k, xyz in enumerate(known)
            if xyz is not None
            for axis in "xyz"
        ),
        reflector_names=free,
        anchor_names=anchor_names,
        station_names=station_names,
    )


def _free_reflectors(
    parts: Sequence[TargetPart], places: Mapping[str, Array | None]
) -> tuple[str, ...]:
    """Reflectors whose place in the tool frame is to be identified.

    A single one that nothing is stated of is the tool itself.
    """
    optical = [part.readings for part in parts if part.readings.kind != "pose"]
    names = list(dict.fromkeys(name for readings in optical for name in readings.target))
    stated = {name for part in parts for name in _stated_places(part)}
    lone = len(names) < 2 and {part.readings.kind for part in parts} == {"point"}
    return tuple(n for n in names if places.get(n) is None and not (lone and n not in stated))


def _stated_places(part: TargetPart) -> dict[str, Place]:
    """[points] or [ranges] reflectors_mm."""
    section = part.section
    return section.reflectors_mm if isinstance(section, PointsTable | RangesTable) else {}


def _reflector_places(part: TargetPart) -> dict[str, Array | None]:
    """Place of each reflector in the tool frame [m], None where it is to be found.

    Raises
    ------
    InputError
        S37: some places are stated, and one is missing.
    """
    stated = _stated_places(part)
    out: dict[str, Array | None] = {}
    for name in dict.fromkeys(part.readings.target if part.readings.kind != "pose" else ()):
        if stated and name not in stated:
            raise refusal(
                part.readings.where, "reflectors_mm",
                f'reflectors_mm says nothing of the target "{name}"', code="S37", value=name,
                allowed='give its place in the tool frame [mm], or "free"',
                fix=choice_of(name, stated),
            )  # fmt: skip
        out[name] = _meters(stated.get(name, "free"))
    return out


def _anchor_places(parts: Sequence[TargetPart], names: Sequence[str]) -> list[Array | None]:
    """Place of each anchor in the world [m], None where it is to be found.

    Raises
    ------
    InputError
        S37: nothing is stated of one.
    """
    stated: dict[str, Place] = {}
    for part in parts:
        if isinstance(part.section, RangesTable):
            stated |= part.section.anchors_mm
    ranged = (part.readings.where for part in parts if part.readings.kind == "distance")
    where = next(ranged, "")
    for name in names:
        if name not in stated:
            raise refusal(
                where, "ranges.anchors_mm", f'nothing says where the anchor "{name}" is',
                code="S37", value=name,
                allowed='give its place in the world [mm], or "free" where it is to be found',
                fix=f'write anchors_mm = {{ "{name}" = "free" }} under [ranges]',
            )  # fmt: skip
    return [_meters(stated[name]) for name in names]


def _meters(place: Place) -> Array | None:
    """A stated place in SI units [m]; None where it is to be identified."""
    return None if place == "free" else np.array(place, dtype=np.float64) / 1e3


def assemble(
    parts: Sequence[TargetPart], robot: Robot, settings: SessionFile, *, name: str
) -> Session:
    """One session of all parts; what the reader knows besides is left empty.

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
    target = targets_of(parts)
    # joints number the poses
    named = _joined([part.joints.extras.pose for part in parts])
    if named is not None:
        pose, names = pose_numbers(named)
    else:
        pose = poses_of_joints(q)
        names = tuple(str(k + 1) for k in range(pose.max() + 1))
    source = parts[0].joints.source
    if named is not None and source == "commanded":
        _check_poses(pose, names, q, place)
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
    included = settings.uncertainty.joint_repeatability == "included"
    return Session(
        name=name,
        measurements=table,
        pose_names=names,
        is_test=is_test,
        split_stated=split,
        read_back=_stacked([part.joints.read_back for part in parts]),
        time=_stacked([_extra(part, "time") for part in parts]),
        temperature=_stacked([_extra(part, "temperature") for part in parts]),
        approach=_joined([_extra(part, "approach") for part in parts]),
        joint_source=source,
        uncertainty="; ".join(dict.fromkeys(part.readings.uncertainty for part in parts)),
        joint_scatter=frozen(np.zeros(q.shape[1]) if included else robot.repeatability),
        fixtures=target.fixtures,
        fixed=target.fixed,
        reflector_names=target.reflector_names,
        anchor_names=target.anchor_names,
        station_names=target.station_names,
        warnings=tuple(
            text for part in parts for text in (*part.joints.warnings, *part.readings.warnings)
        ),
        notes=tuple(note for part in parts for note in part.readings.notes),
        stated=parts[0].readings.stated if len(parts) == 1 else Stated(),
        simulated=settings.simulated,
        wanted=settings.identification,
        place=place,
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
            f"pose {names[pose[row]]}, visit {repeat[row]} is there twice, first in "
            f"line {place[row].rpartition(':')[2]}"
        )
        fix = "number the visits 0, 1, 2 ... in the column repeat"
        raise refusal(place[later], "repeat", message, code="M31", fix=fix)
    return repeat


def _check_poses(pose: Index, names: Sequence[str], q: Array, place: Sequence[str]) -> None:
    """Refuse one name for different commanded joints."""
    _, first, number = np.unique(pose, return_index=True, return_inverse=True)
    start = first[number.ravel()]
    off = np.abs(q - q[start]).max(axis=1)
    if (off > SAME_JOINTS).any():
        row = int(np.argmax(off > SAME_JOINTS))
        name, line = names[pose[row]], place[start[row]].rpartition(":")[2]
        message = f"pose {name} has other joints than in line {line}"
        fix = "give it a pose_id of its own"
        raise refusal(place[row], "pose_id", message, code="M31", value=name, fix=fix)


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
