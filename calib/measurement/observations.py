"""What was measured of the robot: one row per observation, with its covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from calib.arrays import (
    LATER,
    Array,
    Bool,
    Index,
    Labels,
    check,
    frozen,
    require_numbers,
    whole_numbers,
    wrong_shape,
)
from calib.errors import refuse
from calib.geometry.operating import AS_USUAL, OperatingConditions, joined_conditions
from calib.kinds import checked_kinds
from calib.measurement.grouping import first_met, spans, united
from calib.shown import ResultTable, Shown

POSE, POINT, DISTANCE = "pose", "point", "distance"
KINDS = (POSE, POINT, DISTANCE)
GIVEN = -1
"""`reflector` of a row whose reflector is given by `offset`; `anchor` of a row without one."""


def _whole() -> Index:
    """An empty column, which `Measurements` fills with the default of that column."""
    return frozen((), np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Measurements(Shown):
    """A table of observations; row i was taken at commanded joints q[i].

    A *pose* row has the position and rotation of the tool; a *point* row the position of one
    reflector on the tool; a *distance* row the distance of a reflector from a fixed point, an
    anchor. Columns left out mean reflectors at `offset`, the first station, no distances, and the
    tool of the chain.
    """

    q: Annotated[Array, "m", "n"]
    """(m, n) commanded joint values [rad, m]."""
    position: Annotated[Array, "m", 3]
    """(m, 3) measured position in the frame of the station: tool origin, or reflector for point
    rows [m]; zero for distance rows."""
    rotation: Annotated[Array, "m", 3, 3]
    """(m, 3, 3) measured rotation R_station_tool; identity for other than pose rows, unused."""
    covariance: Annotated[Array, "m", 6, 6]
    """(m, 6, 6) covariance of [position (m); rotation vector (rad)] in axes of the station; points
    use the first 3 x 3, distances only the variance at [0, 0]."""
    kind: Annotated[Labels, "m"]
    """(m,) "pose", "point" or "distance"."""
    offset: Annotated[Array, "m", 3]
    """(m, 3) reflector in the tool frame [m]; zero for pose rows and where `reflector` names it."""
    pose_id: Annotated[Index, "m"]
    """(m,) which pose of the plan or pool this row belongs to."""
    repeat: Annotated[Index, "m"]
    """(m,) which visit of that pose, from 0."""
    reflector: Annotated[Index, "m"] = field(default_factory=_whole)
    """(m,) which reflector of the fixtures, from 0; -1: the one at `offset`."""
    station: Annotated[Index, "m"] = field(default_factory=_whole)
    """(m,) which station measured the row; 0 is the world frame."""
    anchor: Annotated[Index, "m"] = field(default_factory=_whole)
    """(m,) which anchor of the fixtures a distance was measured from, from 0; -1 for other rows."""
    distance: Annotated[Array, "m"] = field(default_factory=lambda: frozen(()))
    """(m,) measured distance from anchor to reflector [m]; zero for other rows."""
    tool: Annotated[Index, "m"] = field(default_factory=_whole)
    """(m,) which tool was mounted: 0 is that of the chain, the others are of the fixtures."""
    conditions: Annotated[OperatingConditions, LATER] = AS_USUAL
    """Operating conditions of the rows, such as payload and temperature."""

    def __post_init__(self) -> None:
        m = len(self.q)
        for name, value in (
            ("reflector", GIVEN),
            ("station", 0),
            ("anchor", GIVEN),
            ("distance", 0.0),
            ("tool", 0),
        ):
            if not np.size(getattr(self, name)):
                object.__setattr__(self, name, np.full(m, value))
        names = ("q", "position", "rotation", "covariance", "offset", "distance")
        arrays = check(
            "m n, m 3, m 3 3, m 6 6, m 3, m", **{name: getattr(self, name) for name in names}
        )
        kind = frozen(self.kind, np.str_)
        if kind.shape != (m,) or not set(np.unique(kind).tolist()) <= set(KINDS):
            values = sorted(set(kind.ravel().tolist()))
            message = f"kind has shape {kind.shape} and values {values}"
            allowed = f"{m} entries, each one of {', '.join(KINDS)}"
            raise refuse("kind", allowed=allowed, code="A3", message=message)
        for name, array in zip((*names, "kind"), (*arrays, kind), strict=True):
            object.__setattr__(self, name, array)
        for name in ("pose_id", "repeat", "reflector", "station", "anchor", "tool"):
            column = whole_numbers(name, getattr(self, name))
            if column.shape != (m,):
                raise wrong_shape(name, column.shape, f"expected ({m},)")
            object.__setattr__(self, name, column)
        self.conditions.require_rows(*arrays[0].shape)
        self._require_sense()

    def _require_sense(self) -> None:
        """Refuse rows whose columns contradict their kind."""
        far = self.kind == DISTANCE
        for wrong, name, allowed in (
            (self.reflector < GIVEN, "reflector", "-1 (at offset) or a reflector, from 0"),
            (
                (self.reflector != GIVEN) & self.offset.any(axis=1),
                "offset",
                "zero: the place of a reflector of the fixtures is theirs",
            ),
            (self.is_pose & (self.reflector != GIVEN), "reflector", "-1: a pose sees no reflector"),
            (self.station < 0, "station", "0 (the world) or a further station"),
            (self.tool < 0, "tool", "0 (of the chain) or a further tool"),
            (far & (self.station != 0), "station", "0: a distance is seen from an anchor"),
            (self.anchor < GIVEN, "anchor", "-1 or an anchor, from 0"),
            (far & (self.anchor < 0), "anchor", "an anchor, from 0: this row is a distance"),
            (~far & (self.anchor >= 0), "anchor", "-1: this row is no distance"),
            (far & (self.distance <= 0), "distance", "above zero"),
            (~far & (self.distance != 0), "distance", "0: this row is no distance"),
        ):
            if wrong.any():
                row = int(np.argmax(wrong))
                value = getattr(self, name)[row].tolist()
                message = f"{name}[{row}] of a {self.kind[row]} row is {value}"
                raise refuse(name, value, allowed, code="A3", message=message)

    def __len__(self) -> int:
        return len(self.q)

    def __repr__(self) -> str:
        rows = {kind: int((self.kind == kind).sum()) for kind in KINDS}
        counted = ", ".join(f"{count} {kind} rows" for kind, count in rows.items() if count)
        return f"Measurements({counted or 'no rows'}, {self.n_poses} poses)"

    def tables(self) -> dict[str, ResultTable]:
        """``rows``: pose, kind, joints as commanded [rad, m], what was measured [m]."""
        joints = {f"q{k + 1}": q for k, q in enumerate(self.q.T)}
        seen = dict(zip(("x_m", "y_m", "z_m"), self.position.T, strict=True))
        far = {"distance_m": self.distance} if self.is_distance.any() else {}
        return {
            "rows": ResultTable({"pose": self.pose_id, "kind": self.kind, **joints, **seen, **far})
        }

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
        """(m,) scalar equations of each row: six of a pose, three of a point, one of a distance."""
        return np.where(self.is_pose, 6, np.where(self.is_distance, 1, 3))

    @property
    def n_equations(self) -> int:
        """Number of scalar equations of all rows."""
        return int(self.equations.sum())

    @property
    def n_poses(self) -> int:
        """Number of distinct poses, by `pose_id`."""
        return len(np.unique(self.pose_id))

    def largest_of_poses(self, values: Array) -> Array:
        """Largest of the values (m,), none negative, over the rows of each pose (p,)."""
        _, pose = np.unique(self.pose_id, return_inverse=True)
        largest = np.zeros(self.n_poses)
        np.maximum.at(largest, pose.ravel(), values)
        return largest

    @property
    def target_key(self) -> Array:
        """(m, 8) what was measured, and from where: equal for two rows with the same target."""
        return np.column_stack(
            [self.offset, self.equations, self.reflector, self.station, self.anchor, self.tool]
        )

    def rows(self, which: Sequence[int] | Bool | Index) -> "Measurements":
        """The table restricted to some rows, given by a mask or by indices.

        Raises
        ------
        InputError
            A3: `which` is no mask of the rows and no list of their indices.
        """
        index = self._places(which)
        every = np.ones(len(self), bool) if index.dtype == np.bool_ else np.arange(len(self))
        if np.array_equal(index, every):
            return self
        some = {name: getattr(self, name)[index] for name in COLUMNS}
        return replace(self, **some, conditions=self.conditions.rows(index))

    def _places(self, which: Sequence[int] | Bool | Index) -> Bool | Index:
        """A mask of the rows, or checked indices; negative ones count from the end."""
        m, there = len(self), require_numbers("which", which).size
        index = np.asarray(which) if there else np.zeros(0, dtype=np.int64)
        if index.dtype == np.bool_:
            sound = index.shape == (m,)
        else:
            sound = index.ndim == 1 and index.dtype.kind in "iu"
            sound = sound and bool(((index >= -m) & (index < m)).all())
        if not sound:
            allowed = f"a mask of {m} rows, or places from 0 to {m - 1}"
            raise refuse("which", allowed=allowed, code="A3", message="which names no such rows")
        return index

    @property
    def together(self) -> Index:
        """(m,) number of the group of each row; rows with equal q or equal `pose_id` share one."""
        return united(first_met(self.q), first_met(self.pose_id[:, None]))

    def split(self, *, held_out: int = 20, seed: int = 0) -> tuple["Measurements", "Measurements"]:
        """Rows to identify from, and the rows of `held_out` poses drawn at random.

        Rows at the same joints, or of the same `pose_id`, stay together.

        Raises
        ------
        InputError
            A3: `held_out` or `seed` is not a whole number in its range.
        """
        pose = self.together
        several = np.unique(pose)
        whole = isinstance(held_out, int | np.integer) and not isinstance(held_out, bool)
        if not whole or not 0 < held_out < len(several):
            allowed = f"1 to {len(several) - 1}, of {len(several)} poses"
            fix = "" if whole else "give a number of poses, not a share of them"
            raise refuse("held_out", held_out, allowed, code="A3", fix=fix)
        if not isinstance(seed, int | np.integer) or seed < 0:
            raise refuse("seed", seed, "a whole number, 0 or more", code="A3")
        drawn = np.random.default_rng(seed).choice(several, held_out, replace=False)
        is_test = np.isin(pose, drawn)
        return self.rows(~is_test), self.rows(is_test)


ONE_POSE = 1e-2
"""Joint values read back at visits of one pose differ by less than this [rad, m]."""
COLUMNS = tuple(name for name in Measurements.__slots__ if name != "conditions")
"""Fields of a table that have one entry per row."""


@checked_kinds
def joined(tables: Sequence[Measurements]) -> Measurements:
    """Stack the rows of several tables, in order.

    `pose_id` is kept, unless tables use one number for different poses because each was numbered by
    itself: then rows of one pose of a table, or at the same joints, get a new number.

    Raises
    ------
    InputError
        A3: there are no tables; A1: their robots differ in the number of joints.
    """
    if not len(tables):
        raise refuse("tables", 0, "at least one", code="A3", message="there are no tables to join")
    joints = [table.q.shape[1] for table in tables]
    if len(set(joints)) > 1:
        message = f"tables have rows of {' and '.join(map(str, dict.fromkeys(joints)))} joints"
        raise refuse("tables", tuple(joints), "rows of one robot", code="A1", message=message)
    columns = {name: np.concatenate([getattr(table, name) for table in tables]) for name in COLUMNS}
    counts = [len(table) for table in tables]
    own = np.repeat(np.arange(len(tables)), counts)
    if _called_alike(columns["q"], columns["pose_id"], own):
        alone = first_met(np.column_stack([own, columns["pose_id"]]))
        columns["pose_id"] = united(first_met(columns["q"]), alone)
    conditions = joined_conditions([table.conditions for table in tables], counts)
    return Measurements(**columns, conditions=conditions)


def _called_alike(q: Array, pose_id: Index, table: Index) -> bool:
    """Whether two tables use one `pose_id` for poses far apart, though no table alone does."""
    if len(q) == 0 or table[0] == table[-1]:
        return False
    _, pose = np.unique(pose_id, return_inverse=True)
    alone = np.unique(np.column_stack([table, pose.ravel()]), axis=0, return_inverse=True)[1]
    within, visits = (spans(q, each.ravel()).max(initial=0.0) for each in (pose, alone))
    return bool(within > ONE_POSE >= visits)
