"""What was seen of the robot: one row per observation, with its covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.arrays import Array, Bool, Index, check, frozen
from calib.errors import InputError

POSE, POINT, DISTANCE = "pose", "point", "distance"
KINDS = (POSE, POINT, DISTANCE)
GIVEN = -1
"""`reflector` of a row whose reflector lies where `offset` says; `anchor` of a row without one."""


def _whole() -> Index:
    """No entries: the column means what it meant before there were fixtures."""
    return frozen((), np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """A table of observations; row i was taken at commanded joints q[i].

    A *pose* row sees the position and rotation of the tool; a *point* row sees one reflector on the
    tool; a *distance* row sees how far a reflector is from a fixed point, an anchor. Columns left
    out mean: reflectors at `offset`, all seen from the first station, no distances.
    """

    q: Array
    """(m, n) commanded joint values [rad, m]."""
    position: Array
    """(m, 3) seen position in the frame of the station: tool origin, or reflector for point rows
    [m]; zero for distance rows."""
    rotation: Array
    """(m, 3, 3) seen rotation R_station_tool; identity for other than pose rows, not used there."""
    covariance: Array
    """(m, 6, 6) of [position (m); rotation vector (rad)], axes of the station; points use the first
    3 x 3, distances only the variance at [0, 0]."""
    kind: NDArray[np.str_]
    """(m,) "pose", "point" or "distance"."""
    offset: Array
    """(m, 3) reflector in the tool frame [m]; zero for pose rows and where `reflector` names it."""
    pose_id: Index
    """(m,) which pose of the plan or pool this row belongs to."""
    repeat: Index
    """(m,) which visit of that pose, from 0."""
    reflector: Index = field(default_factory=_whole)
    """(m,) which reflector of the fixtures, from 0; -1: the one at `offset`."""
    station: Index = field(default_factory=_whole)
    """(m,) which station saw it; 0 is the world frame."""
    anchor: Index = field(default_factory=_whole)
    """(m,) which anchor of the fixtures a distance was measured from, from 0; -1 for other rows."""
    distance: Array = field(default_factory=lambda: frozen(()))
    """(m,) seen distance from anchor to reflector [m]; zero for other rows."""

    def __post_init__(self) -> None:
        m = len(self.q)
        for name, value in (
            ("reflector", GIVEN),
            ("station", 0),
            ("anchor", GIVEN),
            ("distance", 0.0),
        ):
            if not np.size(getattr(self, name)):
                object.__setattr__(self, name, np.full(m, value))
        q, position, rotation, covariance, offset, distance = check(
            "m n, m 3, m 3 3, m 6 6, m 3, m",
            q=self.q,
            position=self.position,
            rotation=self.rotation,
            covariance=self.covariance,
            offset=self.offset,
            distance=self.distance,
        )
        kind = frozen(self.kind, np.str_)
        if kind.shape != (m,) or not set(np.unique(kind).tolist()) <= set(KINDS):
            raise InputError(
                f"kind has shape {kind.shape} and values {sorted(set(kind.ravel().tolist()))}",
                code="A3",
                field="kind",
                allowed=f"{m} entries, each one of {', '.join(KINDS)}",
            )
        values = (q, position, rotation, covariance, offset, kind, distance)
        fields = ("q", "position", "rotation", "covariance", "offset", "kind", "distance")
        for name, array in zip(fields, values, strict=True):
            object.__setattr__(self, name, array)
        for name in ("pose_id", "repeat"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))
        for name in ("reflector", "station", "anchor"):
            (checked,) = check(f"{m}", **{name: getattr(self, name)})
            object.__setattr__(self, name, frozen(checked, np.int64))
        self._require_sense()

    def _require_sense(self) -> None:
        """Refuse rows whose columns contradict their kind."""
        far = self.kind == DISTANCE
        for wrong, name, allowed in (
            (self.reflector < GIVEN, "reflector", "-1 (at offset) or a reflector, from 0"),
            (self.is_pose & (self.reflector != GIVEN), "reflector", "-1: a pose sees no reflector"),
            (self.station < 0, "station", "0 (the world) or a further station"),
            (far & (self.station != 0), "station", "0: a distance is seen from an anchor"),
            (self.anchor < GIVEN, "anchor", "-1 or an anchor, from 0"),
            (far & (self.anchor < 0), "anchor", "an anchor, from 0: this row is a distance"),
            (~far & (self.anchor >= 0), "anchor", "-1: this row is no distance"),
            (far & (self.distance <= 0), "distance", "above zero"),
            (~far & (self.distance != 0), "distance", "0: this row is no distance"),
        ):
            if wrong.any():
                row = int(np.argmax(wrong))
                value = getattr(self, name)[row]
                raise InputError(
                    f"{name}[{row}] of a {self.kind[row]} row is {value}",
                    code="A3",
                    field=name,
                    value=value.item(),
                    allowed=allowed,
                )

    def __len__(self) -> int:
        return len(self.q)

    @property
    def is_pose(self) -> Bool:
        """(m,) True for pose rows."""
        return np.asarray(self.kind == POSE)

    @property
    def is_distance(self) -> Bool:
        """(m,) True for distance rows."""
        return np.asarray(self.kind == DISTANCE)

    @property
    def equations(self) -> Index:
        """(m,) scalar equations of each row: six per pose, three per point, one per distance."""
        return np.where(self.is_pose, 6, np.where(self.is_distance, 1, 3))

    @property
    def n_equations(self) -> int:
        """Independent scalar equations of all rows."""
        return int(self.equations.sum())

    @property
    def n_poses(self) -> int:
        """Distinct poses visited."""
        return len(np.unique(self.pose_id))

    @property
    def target_key(self) -> Array:
        """(m, 7) what was looked at, and from where: alike in two rows that see the same thing."""
        return np.column_stack(
            [self.offset, self.equations, self.reflector, self.station, self.anchor]
        )

    def rows(self, which: Sequence[int] | Bool | Index) -> "Measurements":
        """The table restricted to some rows (a mask or indices)."""
        index = np.asarray(which)
        return replace(self, **{name: getattr(self, name)[index] for name in self.__slots__})


def joined(tables: Sequence[Measurements]) -> Measurements:
    """One table of the rows of several, in order; `pose_id` is kept."""
    return Measurements(
        **{
            name: np.concatenate([getattr(table, name) for table in tables])
            for name in Measurements.__slots__
        }
    )


def pose_measurements(
    q: Array,
    T_seen: Array,
    covariance: Array,
    *,
    pose_id: Index | None = None,
    repeat: int = 0,
    station: ArrayLike = 0,
) -> Measurements:
    """Table of full poses T_station_tool (m, 4, 4) with covariances (m, 6, 6)."""
    m = len(q)
    return Measurements(
        q=q,
        position=T_seen[:, :3, 3],
        rotation=T_seen[:, :3, :3],
        covariance=covariance,
        kind=np.full(m, POSE),
        offset=np.zeros((m, 3)),
        pose_id=np.arange(m) if pose_id is None else pose_id,
        repeat=np.full(m, repeat),
        station=_column(station, m),
    )


def point_measurements(
    q: Array,
    position: Array,
    covariance: Array,
    *,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    reflector: ArrayLike = GIVEN,
    station: ArrayLike = 0,
    pose_id: Index | None = None,
    repeat: int = 0,
) -> Measurements:
    """Table of reflector positions (m, 3) in the station's frame, covariances (m, 3, 3).

    The reflector lies at `offset` (3,) or (m, 3) in the tool frame, or is number `reflector`, one
    or (m,), of the model's fixtures.
    """
    (position,) = check("m 3", position=position)
    m = len(position)
    full = np.tile(np.eye(6), (m, 1, 1))
    full[:, :3, :3] = covariance
    return Measurements(
        q=q,
        position=position,
        rotation=np.tile(np.eye(3), (m, 1, 1)),
        covariance=full,
        kind=np.full(m, POINT),
        offset=np.broadcast_to(np.asarray(offset, dtype=np.float64), (m, 3)),
        pose_id=np.arange(m) if pose_id is None else pose_id,
        repeat=np.full(m, repeat),
        reflector=_column(reflector, m),
        station=_column(station, m),
    )


def distance_measurements(
    q: Array,
    distance: Array,
    sd: ArrayLike,
    *,
    anchor: ArrayLike = 0,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    reflector: ArrayLike = GIVEN,
    pose_id: Index | None = None,
    repeat: int = 0,
) -> Measurements:
    """Table of distances (m,) [m] with standard deviations `sd`, one or (m,) [m].

    Each from number `anchor`, one or (m,), of the model's fixtures to the reflector at `offset` in
    the tool frame, or to number `reflector` of the fixtures.
    """
    (distance,) = check("m", distance=distance)
    m = len(distance)
    full = np.tile(np.eye(6), (m, 1, 1))
    full[:, 0, 0] = np.square(np.asarray(sd, dtype=np.float64))
    return Measurements(
        q=q,
        position=np.zeros((m, 3)),
        rotation=np.tile(np.eye(3), (m, 1, 1)),
        covariance=full,
        kind=np.full(m, DISTANCE),
        offset=np.broadcast_to(np.asarray(offset, dtype=np.float64), (m, 3)),
        pose_id=np.arange(m) if pose_id is None else pose_id,
        repeat=np.full(m, repeat),
        reflector=_column(reflector, m),
        anchor=_column(anchor, m),
        distance=distance,
    )


def _column(value: ArrayLike, m: int) -> Index:
    """One whole number for all rows, or one for each (m,)."""
    return np.array(np.broadcast_to(np.asarray(value, dtype=np.int64), (m,)))
