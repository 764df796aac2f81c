"""Errors in a recording: arrows before and after, and the regions that should hold the truth."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements
from calib.uncertainty.regions import ellipsoid
from testbed.comparison import target_points
from testbed.output.recording_story import Story, growing, nice_factor
from testbed.output.recording_writer import Writer, first, viridis
from testbed.robots.placements import quaternion_wxyz

ARROW_SIZE = 0.16
"""Longest drawn error before calibration [m]."""
REGION_SIZE = 0.07
"""Longest drawn error or semi-axis of a stated region [m]."""
BEFORE_COLOR, AFTER_COLOR = (200, 52, 52), (20, 140, 70)
INSIDE_COLOR, OUTSIDE_COLOR = (66, 112, 214, 120), (238, 136, 28, 150)


@dataclass(frozen=True, slots=True)
class Factors:
    """How many times larger than life things are drawn."""

    arrows: int
    regions: int


def seen_minus_predicted(model: RobotModel, measurements: Measurements) -> tuple[Array, Array]:
    """Predicted points (m, 3) and how far from them the tracker saw the target (m, 3) [m]."""
    T, offset = model.poses(measurements.q), measurements.offset
    predicted = T[:, :3, 3] + (T[:, :3, :3] @ offset[:, :, None])[..., 0]
    return predicted, measurements.position - predicted


def factors(story: Story) -> Factors:
    """Exaggerations that keep the largest drawn thing below its size."""
    judged = story.estimate.comparison
    _, seen = seen_minus_predicted(story.setting.nominal, story.trial.measurements)
    before = max(float(judged.before.max()), float(np.linalg.norm(seen, axis=1).max()))
    axes, _ = ellipsoid(judged.covariance[:, :3, :3])
    return Factors(
        arrows=nice_factor(ARROW_SIZE, before),
        regions=nice_factor(REGION_SIZE, max(float(judged.after.max()), float(axes.max()))),
    )


def draw_measured(writer: Writer, factor: int) -> None:
    """What the tracker has seen so far, and its distance from the nominal prediction."""
    import rerun as rr

    story = writer.story
    phase, end = story.phase("measure"), story.phase("identify").stop
    points, vectors = seen_minus_predicted(story.setting.nominal, story.trial.measurements)
    size = np.linalg.norm(vectors, axis=1)
    lengths = growing(len(points))
    cloud, arrows = "world/measured", f"world/error_nominal_x{factor}"
    writer.rows(
        cloud,
        phase,
        rr.Points3D.columns(
            positions=first(points, lengths), colors=first(viridis(size, size.max()), lengths)
        ).partition(lengths),
        lengths - 1,
    )
    writer.static(cloud, rr.Points3D.from_fields(radii=0.012))
    writer.rows(
        arrows,
        phase,
        rr.Arrows3D.columns(
            origins=first(points, lengths), vectors=first(factor * vectors, lengths)
        ).partition(lengths),
        lengths - 1,
    )
    writer.static(arrows, rr.Arrows3D.from_fields(radii=0.0032, colors=BEFORE_COLOR))
    writer.clear(end, [cloud, arrows])


def draw_held_out(writer: Writer, factor: Factors) -> None:
    """Held-out poses: true minus nominal, true minus identified, and the stated 95 % regions.

    Before and after share one factor. Regions have a larger one, and so have the errors drawn from
    their centers: an arrow ends inside its ellipsoid exactly where the record says so.
    """
    import rerun as rr

    story = writer.story
    judged, setting = story.estimate.comparison, story.setting
    phase = story.phase("evaluate")
    true = target_points(setting.test_true, setting.target)
    nominal = target_points(setting.nominal.poses(setting.test_q), setting.target)
    stated = true - judged.error
    axes, turn = ellipsoid(judged.covariance[:, :3, :3])
    lengths = growing(len(true))
    arrows = {
        f"world/held_out/before_x{factor.arrows}": (nominal, factor.arrows, BEFORE_COLOR, 0.0024),
        f"world/held_out/after_x{factor.arrows}": (stated, factor.arrows, AFTER_COLOR, 0.004),
        f"world/held_out/after_x{factor.regions}": (stated, factor.regions, (30, 40, 90), 0.002),
    }
    for path, (origin, times, color, radius) in arrows.items():
        writer.rows(
            path,
            phase,
            rr.Arrows3D.columns(
                origins=first(origin, lengths), vectors=first(times * (true - origin), lengths)
            ).partition(lengths),
            lengths - 1,
        )
        writer.static(path, rr.Arrows3D.from_fields(radii=radius, colors=color))
    path = f"world/held_out/region_95_x{factor.regions}"
    colors = np.where(judged.inside[:, None], INSIDE_COLOR, OUTSIDE_COLOR).astype(np.uint8)
    writer.rows(
        path,
        phase,
        rr.Ellipsoids3D.columns(
            centers=first(stated, lengths),
            half_sizes=first(factor.regions * axes, lengths),
            quaternions=first(quaternion_wxyz(turn)[:, [1, 2, 3, 0]], lengths),
            colors=first(colors, lengths),
        ).partition(lengths),
        lengths - 1,
    )
    writer.static(path, rr.Ellipsoids3D.from_fields(fill_mode="solid"))
    if any(later.name == "compensate" for later in story.phases):
        writer.clear(phase.stop, [*arrows, path])
