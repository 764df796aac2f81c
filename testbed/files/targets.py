"""What was looked at and from where: reflectors, anchors and stations of all rows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.measurement.observations import GIVEN
from testbed.files.joints import Joints
from testbed.files.readings import Readings
from testbed.files.session_toml import ObservedTable, PointsTable, RangesTable
from testbed.strict import choice_of


@dataclass(frozen=True, slots=True, eq=False)
class Part:
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


def texts_of(parts: Sequence[Part], name: str) -> tuple[str, ...]:
    """A column of texts of all readings."""
    return tuple(text for part in parts for text in getattr(part.readings, name))


def targets_of(parts: Sequence[Part]) -> Targets:
    """Numbers and places of everything that was looked at."""
    station, station_names = _numbered(texts_of(parts, "station"))
    anchors, anchor_names = _numbered([name for name in texts_of(parts, "anchor") if name])
    known = _anchor_places(parts, anchor_names)
    places: dict[str, Array | None] = {}
    kinds = {part.readings.kind for part in parts}
    for part in parts:
        places |= _reflector_places(part)
    names = [
        name for part in parts if part.readings.kind != "pose" for name in part.readings.target
    ]
    lone = len(set(names)) < 2 and kinds == {"point"}
    stated = {name for part in parts for name in _stated_places(part)}
    free = [
        n for n in dict.fromkeys(names) if places.get(n) is None and not (lone and n not in stated)
    ]
    reflector, offset, at = [], [], {name: k for k, name in enumerate(free)}
    for part in parts:
        own = part.readings
        for row in range(len(part)):
            given = None if own.offset is None else own.offset[row]
            name = own.target[row]
            is_free = own.kind != "pose" and given is None and name in at
            reflector.append(at[name] if is_free else GIVEN)
            place = given if given is not None else places.get(name)
            offset.append(np.zeros(3) if own.kind == "pose" or is_free or place is None else place)
    used = iter(anchors)
    anchor = [int(next(used)) if name else GIVEN for name in texts_of(parts, "anchor")]
    far = [part.readings.kind == "distance" for part in parts for _ in range(len(part))]
    fixtures = Fixtures(
        np.zeros((len(free), 3)),
        np.array([np.zeros(3) if xyz is None else xyz for xyz in known]).reshape(-1, 3),
        np.tile(np.eye(4), (max(len(station_names) - 1, 0), 1, 1)),
    )
    fixed = tuple(
        f"anchor{k + 1}.{axis}" for k, xyz in enumerate(known) if xyz is not None for axis in "xyz"
    )
    return Targets(
        np.array(reflector, dtype=np.int64),
        np.array(offset).reshape(-1, 3),
        np.array(anchor, dtype=np.int64),
        np.where(far, 0, station),
        fixtures,
        fixed,
        tuple(free),
        anchor_names,
        station_names,
    )


def _numbered(names: Sequence[str]) -> tuple[Index, tuple[str, ...]]:
    """Number of each text in the order they come, and the texts."""
    known = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return np.array([known[name] for name in names], dtype=np.int64), tuple(known)


def _stated_places(part: Part) -> dict[str, object]:
    """[points] or [ranges] reflectors_mm."""
    section = part.section
    return dict(section.reflectors_mm) if isinstance(section, PointsTable | RangesTable) else {}


def _reflector_places(part: Part) -> dict[str, Array | None]:
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
            raise InputError(
                f'reflectors_mm says nothing of the target "{name}"',
                code="S37",
                where=part.readings.where,
                field="reflectors_mm",
                value=name,
                allowed='give its place in the tool frame [mm], or "free"',
                fix=choice_of(name, stated),
            )
        place = stated.get(name, "free")
        out[name] = None if place == "free" else np.array(place, dtype=np.float64) / 1e3
    return out


def _anchor_places(parts: Sequence[Part], names: Sequence[str]) -> list[Array | None]:
    """Place of each anchor in the world [m], None where it is to be found.

    Raises
    ------
    InputError
        S37: nothing is said of one.
    """
    stated: dict[str, object] = {}
    where = ""
    for part in parts:
        if isinstance(part.section, RangesTable):
            stated |= dict(part.section.anchors_mm)
        where = where or (part.readings.where if part.readings.kind == "distance" else "")
    for name in names:
        if name not in stated:
            raise InputError(
                f'nothing says where the anchor "{name}" is',
                code="S37",
                where=where,
                field="ranges.anchors_mm",
                value=name,
                allowed='give its place in the world [mm], or "free" where it is to be found',
                fix=f'write anchors_mm = {{ "{name}" = "free" }} under [ranges]',
            )
    return [
        None if stated[name] == "free" else np.array(stated[name], dtype=np.float64) / 1e3
        for name in names
    ]
