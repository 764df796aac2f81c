"""What a tracker reported: one row per observation, with its covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.arrays import Array, Bool, Index, check, frozen
from calib.errors import InputError

POSE, POINT = "pose", "point"
KINDS = (POSE, POINT)


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """A table of observations; row i was taken at commanded joints q[i].

    A *pose* row sees the position and rotation of the tool; a *point* row sees one reflector fixed
    at `offset` in the tool frame.
    """

    q: Array
    """(m, n) commanded joint values [rad, m]."""
    position: Array
    """(m, 3) seen position in the world: tool origin, or reflector for point rows [m]."""
    rotation: Array
    """(m, 3, 3) seen rotation R_world_tool; identity for point rows, where it is not used."""
    covariance: Array
    """(m, 6, 6) of [position (m); rotation vector (rad)], world axes; points use the first 3x3."""
    kind: NDArray[np.str_]
    """(m,) "pose" or "point"."""
    offset: Array
    """(m, 3) reflector in the tool frame [m]; zero for pose rows."""
    pose_id: Index
    """(m,) which pose of the plan or pool this row belongs to."""
    repeat: Index
    """(m,) which visit of that pose, from 0."""

    def __post_init__(self) -> None:
        q, position, rotation, covariance, offset = check(
            "m n, m 3, m 3 3, m 6 6, m 3",
            q=self.q,
            position=self.position,
            rotation=self.rotation,
            covariance=self.covariance,
            offset=self.offset,
        )
        kind = frozen(self.kind, np.str_)
        if kind.shape != (len(q),) or not set(np.unique(kind).tolist()) <= set(KINDS):
            raise InputError(
                f"kind has shape {kind.shape} and values {sorted(set(kind.ravel().tolist()))}",
                code="A3",
                field="kind",
                allowed=f"{len(q)} entries, each one of {', '.join(KINDS)}",
            )
        values = (q, position, rotation, covariance, offset, kind)
        fields = ("q", "position", "rotation", "covariance", "offset", "kind")
        for name, value in zip(fields, values, strict=True):
            object.__setattr__(self, name, value)
        for name in ("pose_id", "repeat"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))

    def __len__(self) -> int:
        return len(self.q)

    @property
    def is_pose(self) -> Bool:
        """(m,) True for pose rows."""
        return np.asarray(self.kind == POSE)

    @property
    def n_equations(self) -> int:
        """Independent scalar equations: six per pose row, three per point row."""
        return int(np.where(self.is_pose, 6, 3).sum())

    @property
    def n_poses(self) -> int:
        """Distinct poses visited."""
        return len(np.unique(self.pose_id))

    def rows(self, which: Sequence[int] | Bool | Index) -> "Measurements":
        """The table restricted to some rows (a mask or indices)."""
        index = np.asarray(which)
        return replace(self, **{name: getattr(self, name)[index] for name in self.__slots__})


def pose_measurements(
    q: Array,
    T_seen: Array,
    covariance: Array,
    *,
    pose_id: Index | None = None,
    repeat: int = 0,
) -> Measurements:
    """Table of full poses T_world_tool (m, 4, 4) with covariances (m, 6, 6)."""
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
    )
