"""The believed regions of a calibration in its recording, at the held-out poses."""

from dataclasses import dataclass

from calib.arrays import Array, Index
from calib.geometry.frames import transform_points
from testbed.identify.calibration import Calibration
from testbed.recording import style
from testbed.recording.pen import Pen
from testbed.recording.timeline import Phase
from testbed.robots.placements import quaternion_wxyz

LARGEST = 0.07
"""Longest drawn semi-axis of a region [m]."""
COLOR = (*style.BLUE, 110)
"""As stated regions are drawn elsewhere, where the truth lies inside."""


@dataclass(frozen=True, slots=True, eq=False)
class ShownRegions:
    """Regions at the poses that the robot goes to, in its base frame."""

    centers: Array
    """(k, 3) predicted tool points [m]."""
    half: Array
    """(k, 3) semi-axes [m]."""
    turn: Array
    """(k, 3, 3) their directions in columns."""
    factor: int
    """How many times larger than life they are drawn."""


def regions_at(calibration: Calibration, rows: Index, station: Array) -> ShownRegions | None:
    """Believed regions at some rows; None where nothing is believed.

    Parameters
    ----------
    calibration : Calibration
        Of the identified robot.
    rows : (k,) array
        Rows of its table.
    station : (4, 4) array
        Where the measuring frame is, seen from the base [m].
    """
    belief = calibration.proof.belief
    if belief is None or calibration.elsewhere:
        return None
    table = calibration.measurements.rows(rows)
    stated = belief.regions(table.q, target=belief.proven.target, at=table.conditions)
    half, turn = stated.region
    return ShownRegions(
        transform_points(station, stated.position),
        half,
        station[:3, :3] @ turn,
        style.nice_factor(LARGEST, float(half.max())),
    )


def draw_regions(regions: ShownRegions, pen: Pen, phase: Phase) -> None:
    """Ellipsoids that come with their poses, and stay."""
    import rerun as rr

    values = {
        "centers": regions.centers,
        "half_sizes": regions.factor * regions.half,
        "quaternions": quaternion_wxyz(regions.turn)[:, [1, 2, 3, 0]],
    }
    look = {"fill_mode": "solid", "colors": COLOR}
    pen.grow(f"world/held_out/region_95_x{regions.factor}", phase, rr.Ellipsoids3D, values, look)


def region_words(regions: ShownRegions | None) -> str:
    """What the ellipsoids are."""
    if regions is None:
        return "- no region can be believed"
    return (
        "- ellipsoids: believed 95 % regions of the mean tool point (in three dimensions), drawn "
        f"{regions.factor} times larger"
    )
