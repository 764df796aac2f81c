"""What was seen of the robot: one row per observation, with its covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.arrays import Array, Bool, Index, check, frozen
from calib.errors import InputError, refuse

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

    def __repr__(self) -> str:
        rows = {kind: int((self.kind == kind).sum()) for kind in KINDS}
        counted = ", ".join(f"{count} {kind} rows" for kind, count in rows.items() if count)
        return f"Measurements({counted or 'no rows'}, {self.n_poses} poses)"

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

    def split(self, *, held_out: int = 20, seed: int = 0) -> tuple["Measurements", "Measurements"]:
        """Rows to identify from, and the rows of `held_out` poses drawn at random.

        Rows at the same joints, or of the same `pose_id`, stay together.
        """
        pose = _linked(_first_met(self.q), _first_met(self.pose_id[:, None]))
        several = np.unique(pose)
        if not 0 < held_out < len(several):
            raise refuse(
                "held_out", held_out, f"1 to {len(several) - 1}, of {len(several)} poses", code="A3"
            )
        drawn = np.random.default_rng(seed).choice(several, held_out, replace=False)
        is_test = np.isin(pose, drawn)
        return self.rows(~is_test), self.rows(is_test)


def joined(tables: Sequence[Measurements]) -> Measurements:
    """One table of the rows of several, in order; `pose_id` is kept."""
    return Measurements(
        **{
            name: np.concatenate([getattr(table, name) for table in tables])
            for name in Measurements.__slots__
        }
    )


def poses(
    q: ArrayLike,
    T: ArrayLike,
    *,
    sd: ArrayLike,
    station: ArrayLike = 0,
    pose_id: ArrayLike | None = None,
    repeat: ArrayLike | None = None,
) -> Measurements:
    """Table of full poses T_station_tool (m, 4, 4) at joints q (m, n).

    Parameters
    ----------
    q : (m, n) array_like
        Commanded joint values [rad, m].
    T : (m, 4, 4) array_like
        Poses seen, in the frame of the station [m].
    sd : array_like
        Standard deviations of position and rotation (2,), or of the six axes (6,) [m, rad]; or
        covariances, one (6, 6) or (m, 6, 6) [m^2, m rad, rad^2].
    station : int or (m,) array_like
        Which station saw it; 0 is the world.
    pose_id, repeat : int or (m,) array_like, optional
        Which pose and which visit of it; by default rows at the same joints are visits of one pose.
    """
    (T,) = check("m 4 4", T=T)
    sd = np.asarray(sd, dtype=np.float64)
    if sd.ndim == 0:
        raise refuse(
            "sd",
            float(sd),
            "two numbers, of position [m] and rotation [rad], or six, or covariances (6, 6)",
            code="A3",
        )
    covariance = _covariances(np.repeat(sd, 3) if sd.shape == (2,) else sd, 6, len(T))
    return _table(q, POSE, covariance, T[:, :3, 3], T[:, :3, :3], station=station,
                  pose_id=pose_id, repeat=repeat)  # fmt: skip


def points(
    q: ArrayLike,
    xyz: ArrayLike,
    *,
    sd: ArrayLike,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    reflector: ArrayLike = GIVEN,
    station: ArrayLike = 0,
    pose_id: ArrayLike | None = None,
    repeat: ArrayLike | None = None,
) -> Measurements:
    """Table of reflector positions (m, 3) at joints q (m, n).

    Parameters
    ----------
    q : (m, n) array_like
        Commanded joint values [rad, m].
    xyz : (m, 3) array_like
        Positions seen, in the frame of the station [m].
    sd : array_like
        Standard deviation of each axis: one number, or three [m]; or covariances, one (3, 3) or
        (m, 3, 3) [m^2].
    offset : (3,) or (m, 3) array_like
        Where the reflector lies in the tool frame [m].
    reflector : int or (m,) array_like
        Which reflector of the model's fixtures it is, from 0; -1: the one at `offset`.
    station, pose_id, repeat
        As in `poses`.
    """
    (xyz,) = check("m 3", xyz=xyz)
    covariance = np.tile(np.eye(6), (len(xyz), 1, 1))
    covariance[:, :3, :3] = _covariances(sd, 3, len(xyz))
    return _table(q, POINT, covariance, xyz, offset=offset, reflector=reflector, station=station,
                  pose_id=pose_id, repeat=repeat)  # fmt: skip


def distances(
    q: ArrayLike,
    d: ArrayLike,
    *,
    sd: ArrayLike,
    anchor: ArrayLike = 0,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    reflector: ArrayLike = GIVEN,
    pose_id: ArrayLike | None = None,
    repeat: ArrayLike | None = None,
) -> Measurements:
    """Table of distances (m,) from anchors to a reflector, at joints q (m, n).

    Parameters
    ----------
    q : (m, n) array_like
        Commanded joint values [rad, m].
    d : (m,) array_like
        Distances seen [m].
    sd : float or (m,) array_like
        Standard deviation of all, or of each [m].
    anchor : int or (m,) array_like
        Which anchor of the model's fixtures each was measured from, from 0.
    offset, reflector, pose_id, repeat
        As in `points`.
    """
    (d,) = check("m", d=d)
    covariance = np.tile(np.eye(6), (len(d), 1, 1))
    covariance[:, 0, 0] = np.square(np.broadcast_to(_positive(sd), len(d)))
    return _table(q, DISTANCE, covariance, np.zeros((len(d), 3)), offset=offset,
                  reflector=reflector, anchor=anchor, distance=d, pose_id=pose_id,
                  repeat=repeat)  # fmt: skip


def _table(
    q: ArrayLike,
    kind: str,
    covariance: Array,
    position: Array,
    rotation: Array | None = None,
    *,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    reflector: ArrayLike = GIVEN,
    station: ArrayLike = 0,
    anchor: ArrayLike = GIVEN,
    distance: ArrayLike = 0.0,
    pose_id: ArrayLike | None = None,
    repeat: ArrayLike | None = None,
) -> Measurements:
    """Table of one kind of rows; single values hold for all of them."""
    m = len(position)
    q, position = check("m n, m 3", q=q, position=position)

    def column(value: ArrayLike) -> Index:
        return np.array(np.broadcast_to(np.asarray(value, dtype=np.int64), (m,)))

    table = Measurements(
        q=q,
        position=position,
        rotation=np.tile(np.eye(3), (m, 1, 1)) if rotation is None else rotation,
        covariance=covariance,
        kind=np.full(m, kind),
        offset=np.broadcast_to(np.asarray(offset, dtype=np.float64), (m, 3)),
        pose_id=_first_met(q) if pose_id is None else column(pose_id),
        repeat=column(0 if repeat is None else repeat),
        reflector=column(reflector),
        station=column(station),
        anchor=column(anchor),
        distance=np.broadcast_to(np.asarray(distance, dtype=np.float64), (m,)),
    )
    if repeat is None:
        seen = np.column_stack([table.pose_id, table.target_key])
        table = replace(table, repeat=_earlier(_first_met(seen)))
    return table


def _linked(one: Index, other: Index) -> Index:
    """Group (m,) of each row, where rows that either numbering puts together are together."""
    group = one
    while True:
        lowest = np.full(len(group), len(group))
        np.minimum.at(lowest, other, group)
        joined_by_other = lowest[other]
        lowest = np.full(len(group), len(group))
        np.minimum.at(lowest, one, joined_by_other)
        if np.array_equal(lowest[one], group):
            return group
        group = lowest[one]


def _first_met(rows: Array | Index) -> Index:
    """Number (m,) of each distinct row, counted as they are met."""
    _, first, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[group.ravel()], dtype=np.int64)


def _earlier(group: Index) -> Index:
    """How many earlier rows (m,) are of the same group."""
    order = np.argsort(group, kind="stable")
    counts = np.bincount(group)
    out = np.empty(len(group), dtype=np.int64)
    out[order] = np.arange(len(group)) - np.repeat(np.cumsum(counts) - counts, counts)
    return out


def _covariances(sd: ArrayLike, size: int, m: int) -> Array:
    """Covariances (m, k, k), from deviations or from covariances."""
    sd = np.asarray(sd, dtype=np.float64)
    if sd.shape in ((), (size,)):
        sd = np.diag(np.square(np.broadcast_to(_positive(sd), size)))
    elif sd.shape not in ((size, size), (m, size, size)):
        raise refuse(
            "sd",
            sd.shape,
            f"one number, {size}, or covariances ({size}, {size}) or ({m}, {size}, {size})",
            code="A1",
            message=f"sd has shape {sd.shape}",
        )
    return np.broadcast_to(sd, (m, size, size))


def _positive(sd: ArrayLike) -> Array:
    """Standard deviations, all of them finite and above zero."""
    sd = np.asarray(sd, dtype=np.float64)
    if not (np.isfinite(sd) & (sd > 0)).all():
        raise refuse("sd", sd.tolist(), "finite standard deviations above zero", code="A3")
    return sd
