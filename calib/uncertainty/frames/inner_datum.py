"""The frame in which tool points are stated where no reading shows one: that which fits them best.

Distances from points of unknown place look the same wherever robot and points stand together. In
the base, a tool point is then known no better than the prior of the links; how tool points lie to
each other is known as well as the readings tell. That is stated.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.fixtures import Fixtures
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.tool_target import ToolTarget
from calib.uncertainty.frames.rigid import turning
from calib.uncertainty.held_out import first_of_pose

ON_LINE = 1e-3
"""Part of their spread by which points lie off a line at most: places are known to some tenths of a
millimeter over meters, so that these errors would tell the turn about it, and no reading."""


@dataclass(frozen=True, slots=True, eq=False)
class InnerDatum:
    """The frame in which the tool points at given postures are least off, as a rigid motion."""

    center: Annotated[Array, 3]
    """(3,) mean of these tool points in the base [m]."""
    motion: Annotated[Array, 6, "P"]
    """(6, P) shift [m] and turn about the center [rad] of that frame, by the model's numbers."""

    def relative(self, position: Array, rows: Array) -> Array:
        """Rows (N, 3, P) of tool points at (N, 3) [m] as seen from this frame.

        References
        ----------
        S = I - A (A'A)^-1 A', of Helmert's free network: Baarda 1973 (S-transformation), Meissl
        1969 (inner constraints); here for points that took no part in choosing the frame, too.
        """
        return np.asarray(rows - turning(position - self.center) @ self.motion)


def inner_datum(
    identification: Identification, train: Measurements, target: ToolTarget
) -> InnerDatum:
    """The frame that fits the tool points best at the poses identified from, each counted once."""
    once, model = first_of_pose(train), identification.model
    T, J = model.poses_and_jacobian(once.q, once.conditions)
    position, rows = target.positions_and_rows(model, T, J)
    center = position.mean(axis=0)
    return InnerDatum(frozen(center), frozen(best_motion(position - center, rows)))


def best_motion(arms: Array, rows: Array) -> Array:
    """Motions (6, P) that follow P displacements, rows (N, 3, P), of points at `arms` best.

    A turn about a line on which all points lie moves none of them: then it is none.
    """
    columns = turning(arms).reshape(-1, 6)
    return np.asarray(np.linalg.lstsq(columns, rows.reshape(len(columns), -1), rcond=None)[0])


def shows_no_frame(identification: Identification, train: Measurements) -> bool:
    """Whether nothing that was identified from shows where the base stands.

    Among distances, only places that are known in the world do: anchors, and points that were read.
    A free base still turns about two of them, or about a line. Held-out rows moved no number.
    """
    if not train.is_distance.any() or train.is_pose.any():
        return False
    asked = {*identification.parameters.free_names, *identification.reduction.dropped}
    fixtures = identification.model.fixtures
    used = np.unique(train.anchor[train.is_distance])
    known = fixtures.anchors[[k for k in used if f"anchor{k + 1}.x" not in asked]]
    places = np.unique(np.concatenate([known, _places_read(fixtures, train, asked)]), axis=0)
    if not len(places):
        return True
    return any(name.startswith("base.") for name in asked) and on_line(places)


def _places_read(fixtures: Fixtures, train: Measurements, asked: set[str]) -> Array:
    """Places (k, 3) in the world at which points were read, each target of a pose once [m]."""
    held = [s for s in np.unique(train.station) if f"station{s + 1}.x" not in asked]
    points = train.rows(~train.is_distance & np.isin(train.station, held))
    targets = np.column_stack([points.pose_id, points.target_key])
    points = points.rows(np.unique(targets, axis=0, return_index=True)[1])
    T = fixtures.station_frames[points.station]
    return np.asarray(np.einsum("mij,mj->mi", T[:, :3, :3], points.position) + T[:, :3, 3])


def on_line(places: Array) -> bool:
    """Whether points (k, 3) lie on one line, as one or two of them always do."""
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(len(places) < 3 or spread[1] <= ON_LINE * spread[0])
