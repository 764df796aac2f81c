"""Targets of a session: which reflectors, anchors and stations its rows speak of, and where."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import slide
from calib.measurement.observations import GIVEN
from testbed.files.dialects.tables import ObservedTable, Place, PointsTable, RangesTable
from testbed.files.joints import Joints
from testbed.files.matching import numbered
from testbed.files.readings import Readings
from testbed.files.refusal import refusal
from testbed.files.session_toml import StartTable
from testbed.names import choice_of


@dataclass(frozen=True, slots=True, eq=False)
class TargetPart:
    """Rows of one file with their joints."""

    joints: Joints
    readings: Readings
    section: ObservedTable

    def __len__(self) -> int:
        return len(self.readings)

    def rows(self, which: Bool | Index) -> "TargetPart":
        """The same for some rows (a mask or indices)."""
        index = np.arange(len(self))[which]
        return TargetPart(self.joints.rows(index), self.readings.rows(index), self.section)


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Where the reflectors, anchors and stations of all rows are."""

    reflector: Index
    offset: Array
    anchor: Index
    station: Index
    fixtures: Fixtures
    placed: bool
    fixed: tuple[str, ...]
    reflector_names: tuple[str, ...]
    anchor_names: tuple[str, ...]
    station_names: tuple[str, ...]


def texts_of(parts: Sequence[TargetPart], name: str) -> tuple[str, ...]:
    """A column of texts of all readings."""
    return tuple(text for part in parts for text in getattr(part.readings, name))


def targets_of(parts: Sequence[TargetPart], start: StartTable | None = None) -> Targets:
    """Numbers and places of everything that was measured, and from where."""
    # a distance has an anchor, no station
    far = [part.readings.kind == "distance" for part in parts for _ in range(len(part))]
    stated = [
        name for name, apart in zip(texts_of(parts, "station"), far, strict=True) if not apart
    ]
    numbers, station_names = numbered(stated)
    station = np.zeros(len(far), dtype=np.int64)
    station[~np.array(far, dtype=np.bool_)] = numbers
    anchors = texts_of(parts, "anchor")
    anchor_names = tuple(dict.fromkeys(name for name in anchors if name))
    anchor = {name: k for k, name in enumerate(anchor_names)}
    known = _anchor_places(parts, anchor_names)
    places = _reflector_places(parts)
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
    about, placed = _started(start, free, known, anchor_names, station_names)
    return Targets(
        reflector=np.array(reflector, dtype=np.int64),
        offset=np.array(offset).reshape(-1, 3),
        anchor=np.array([anchor.get(name, GIVEN) for name in anchors], dtype=np.int64),
        station=station,
        fixtures=about,
        placed=placed,
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


def _started(
    start: StartTable | None,
    free: Sequence[str],
    known: Sequence[Array | None],
    anchors: Sequence[str],
    stations: Sequence[str],
) -> tuple[Fixtures, bool]:
    """Fixtures where they are known or [start] has them, and whether it has all that is free.

    Raises
    ------
    InputError
        S37: it names what no row has, or what is known.
    """
    start = StartTable() if start is None else start
    loose = [name for name, xyz in zip(anchors, known, strict=True) if xyz is None]
    for key, places, names in (
        ("reflectors_mm", start.reflectors_mm, free),
        ("anchors_mm", start.anchors_mm, loose),
        ("stations_mm", start.stations_mm, stations[1:]),
    ):
        for name in places:
            if name not in names:
                raise refusal(
                    "session.toml", f"start.{key}", f'[start] {key} has "{name}"', code="S37",
                    value=name, allowed=f"free ones are {', '.join(names) or 'none'}",
                    fix=choice_of(name, names) if names else "remove it",
                )  # fmt: skip

    def about(places: Mapping[str, Place], names: Sequence[str]) -> Array:
        rows = [_meters(places.get(name, (0.0, 0.0, 0.0))) for name in names]
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    given = [
        about(start.anchors_mm, [name])[0] if xyz is None else xyz
        for name, xyz in zip(anchors, known, strict=True)
    ]
    frames = [slide(*place) for place in about(start.stations_mm, stations[1:])]
    every = (*start.reflectors_mm, *start.anchors_mm, *start.stations_mm)
    return (
        Fixtures(
            about(start.reflectors_mm, free),
            np.array(given, dtype=np.float64).reshape(-1, 3),
            np.array(frames, dtype=np.float64).reshape(-1, 4, 4),
        ),
        len(every) == len(free) + len(loose) + len(stations[1:]),
    )


def _free_reflectors(
    parts: Sequence[TargetPart], places: Mapping[str, Array | None]
) -> tuple[str, ...]:
    """Reflectors whose place in the tool frame is to be identified.

    A single one that nothing is stated of is the tool itself.
    """
    optical = [part.readings for part in parts if part.readings.kind != "pose"]
    names = list(dict.fromkeys(name for readings in optical for name in readings.target))
    lone = len(names) < 2 and {part.readings.kind for part in parts} == {"point"}
    return tuple(n for n in names if places.get(n) is None and not (lone and n not in places))


def _stated_places(part: TargetPart) -> dict[str, Place]:
    """[points] or [ranges] reflectors_mm."""
    section = part.section
    return section.reflectors_mm if isinstance(section, PointsTable | RangesTable) else {}


def _reflector_places(parts: Sequence[TargetPart]) -> dict[str, Array | None]:
    """Stated place of each reflector in the tool frame [m], None where it is to be found.

    Raises
    ------
    InputError
        S37: two places are stated of one, or some are stated and one is missing.
    """
    stated: dict[str, Place] = {}
    for part in parts:
        for name, place in _stated_places(part).items():
            if stated.setdefault(name, place) != place:
                raise refusal(
                    "session.toml", f"{part.section.name}.reflectors_mm",
                    f'the reflector "{name}" is {_shown(stated[name])} in one table and '
                    f"{_shown(place)} in [{part.section.name}]",
                    code="S37", value=name, fix="state only one of them",
                )  # fmt: skip
    for part in parts:
        for name in part.readings.target if part.readings.kind != "pose" and stated else ():
            if name not in stated:
                raise refusal(
                    part.readings.where, "reflectors_mm",
                    f'reflectors_mm says nothing of the target "{name}"', code="S37", value=name,
                    allowed='give its place in the tool frame [mm], or "free"',
                    fix=choice_of(name, stated),
                )  # fmt: skip
    return {name: _meters(place) for name, place in stated.items()}


def _shown(place: Place) -> str:
    """A place as a sentence has it."""
    return "free" if place == "free" else f"at ({', '.join(f'{x:g}' for x in place)}) mm"


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
                where, "ranges.anchors_mm", f'nothing states where the anchor "{name}" is',
                code="S37", value=name,
                allowed='give its place in the world [mm], or "free" where it is to be found',
                fix=f'write anchors_mm = {{ "{name}" = "free" }} under [ranges]',
            )  # fmt: skip
    return [_meters(stated[name]) for name in names]


def _meters(place: Place) -> Array | None:
    """A stated place in SI units [m]; None where it is to be identified."""
    return None if place == "free" else np.array(place, dtype=np.float64) / 1e3
