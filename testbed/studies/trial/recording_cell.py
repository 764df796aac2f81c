"""The cell of a trial in the recording: the pool, what was measured, errors as arrows, regions."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import points_of_frames, target_points
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from calib.measurement.accuracy import point_distances
from calib.measurement.observations import Measurements
from calib.measurement.prediction import targets
from calib.uncertainty.regions import coverage_factor
from calib.uncertainty.tool_point import ToolStatement
from testbed.laboratory.truth.laboratory import resting_arm
from testbed.laboratory.truth.setting import Setting, held_out_conditions
from testbed.laboratory.truth.springs import ElasticArm
from testbed.recording import style
from testbed.recording.cell import draw_beam, draw_station
from testbed.recording.pen import Pen
from testbed.recording.timeline import Phase
from testbed.robots.placements import quaternion_wxyz
from testbed.studies.trial.records import Campaign, Estimate, Trial

GHOST_SIZE = 0.036
"""Mean drawn deviation of the ghost before calibration [m]: seen, and still a robot."""
SEEN_COLOR, ANCHOR_COLOR = (40, 46, 54), (110, 70, 150)
REGION_SIZE = 0.07
"""Longest drawn error or semi-axis of a stated region [m]."""
INSIDE_COLOR, OUTSIDE_COLOR = (*style.BLUE, 110), (*style.VERMILION, 150)
IN_REGION_COLOR, MOVE_COLOR = (30, 40, 90), (60, 66, 76, 160)
"""Of the errors that are drawn as large as the regions, and of the regions of one move."""
WORLD = "world"
"""Root of what is drawn of the trial that is shown first."""
ROBOT, TRACKER, ANCHORS, BEAM = "robot", "tracker", "anchors", "beam"
CHOSEN, LEAVES, MEASURED, HELD_OUT = "chosen", "leaves", "measured", "held_out"


@dataclass(frozen=True, slots=True, eq=False)
class ShownTrial:
    """The trial that is shown, and how many times larger than life."""

    setting: Setting
    trial: Trial
    estimate: Estimate
    ghost: int
    """Deviation of the true robot."""
    arrows: int
    """Errors, before and after."""
    regions: int
    """Stated regions, and the errors that are drawn in them."""
    stated: ToolStatement
    """Regions of the mean tool point at the held-out poses: those believed, else by the covariance
    of the fit."""
    moved: ToolStatement | None
    """The same of where one move ends; None where nothing tells."""
    arm: ElasticArm | None = None
    """The true arm at rest on its springs; None where nothing gives way."""
    root: str = WORLD
    """Of its entities in the cell."""
    words: str = ""
    """What the names of its planes begin with."""

    @property
    def error_name(self) -> str:
        """Entity of the errors that are measured, below its root."""
        return f"error_nominal_x{self.arrows}"

    @property
    def ghost_path(self) -> str:
        """Root of the ghost's entities."""
        return f"{self.root}/true_x{self.ghost}"

    @property
    def ghost_words(self) -> str:
        """What the ghost is, for a chapter before the model knows."""
        bent = ", bent by its weight" if self.arm else ""
        return (
            f"- purple ghost: the true robot{bent}, its deviation drawn {self.ghost} times larger"
        )


def show(campaign: Campaign, trial: Trial) -> ShownTrial:
    """Show a trial by its default estimator, the largest thing of each kind below its size."""
    setting = campaign.setting
    estimate = trial.estimates[0]
    judged = estimate.comparison
    seen = seen_places(estimate.identification.model, trial.measurements)
    away = point_distances(seen, predicted_places(setting.nominal, trial.measurements))
    before = max(float(judged.before.max()), float(away.max()))
    at = held_out_conditions(campaign.scenario, setting.test_q)
    stated, moved = stated_regions(setting, estimate, at)
    widest = stated if moved is None else moved
    axes, _ = widest.region
    return ShownTrial(
        setting,
        trial,
        estimate,
        ghost=style.nice_factor(GHOST_SIZE, float(judged.before.mean())),
        arrows=style.nice_factor(style.ARROW_SIZE, before),
        regions=style.nice_factor(REGION_SIZE, max(float(judged.after.max()), float(axes.max()))),
        stated=stated,
        moved=moved,
        arm=resting_arm(campaign.scenario, setting),
    )


def stated_regions(
    setting: Setting, estimate: Estimate, met: OperatingConditions
) -> tuple[ToolStatement, ToolStatement | None]:
    """Regions at the held-out poses of the mean of many moves, and of one move where stated.

    `met` is what is known of these poses.
    """
    q, target, belief = setting.test_q, setting.target, estimate.belief
    if belief is None:
        judged = estimate.comparison
        at = target_points(setting.test_true, target) - judged.error
        return ToolStatement(at, judged.covariance[:, :3, :3], coverage_factor(3), 0.95), None
    regions = partial(belief.regions, q, target=target, at=met)
    sd = setting.joint_repeatability
    return regions(), regions(repeatability=sd) if sd.any() else None


def tracked(setting: Setting, q: Array) -> Array:
    """The target (m, 3) that the tracker is looking at, where the nominal model has it [m]."""
    return target_points(setting.nominal.poses(q), setting.target)


def draw_measured(shown: ShownTrial, pen: Pen, phase: Phase) -> None:
    """The beam, what the tracker has seen so far, and its distance from the nominal prediction."""
    import rerun as rr

    setting, factor, root = shown.setting, shown.arrows, shown.root
    found = shown.estimate.identification.model.fixtures
    station, table = setting.T_world_tracker[:3, 3], shown.trial.measurements
    start, target = beam(setting.nominal, found, station, table, phase.at, pen.timeline.q)
    draw_beam(pen, phase, start, target, f"{root}/{BEAM}")
    seen = seen_places(shown.estimate.identification.model, table)
    points = predicted_places(setting.nominal, table)
    vectors = seen - points
    cloud, arrows = f"{root}/{MEASURED}", f"{root}/{shown.error_name}"
    look = {"radii": 0.010, "colors": SEEN_COLOR}
    pen.grow(cloud, phase, rr.Points3D, {"positions": seen}, look)
    pen.grow_arrows(arrows, phase, points, factor * vectors, style.BEFORE_COLOR, 0.0032)
    pen.clear(pen.timeline.phase("identify").stop, cloud, arrows)


def beam(
    model: RobotModel, fixtures: Fixtures, station: Array, table: Measurements, at: Index, q: Array
) -> tuple[Array, Array]:
    """Where (s, 3) what measures at every step stands, and the target (s, 3) it looks for [m].

    On the way to a pose it is that of the row to come.

    Parameters
    ----------
    model : RobotModel
        The robot that is drawn, with the reflectors on it.
    fixtures : Fixtures
        Where further stations and anchors stand.
    station : (3,) array
        The first station [m].
    table : Measurements
        What was measured, m rows.
    at : (m,) array of int
        Step of each row.
    q : (s, n) array
        Drawn joint values [rad, m].
    """
    row = np.minimum(np.searchsorted(at, np.arange(len(q))), len(at) - 1)
    starts = np.vstack([station, fixtures.stations[:, :3, 3]])[table.station]
    far = table.is_distance
    starts[far] = fixtures.anchors[table.anchor[far]]
    return starts[row], points_of_frames(model.poses(q), targets(model.fixtures, table)[row])


def draw_instruments(shown: ShownTrial, floor: float, pen: Pen) -> None:
    """The tracker that looks at the target; further stations and anchors, where they were found."""
    import rerun as rr

    fixtures, root = shown.estimate.identification.model.fixtures, shown.root
    target = tracked(shown.setting, pen.timeline.q)
    draw_station(pen, shown.setting.T_world_tracker, target, floor, f"{root}/{TRACKER}")
    for k, station in enumerate(fixtures.stations):
        draw_station(pen, station, target, floor, f"{root}/{TRACKER}{k + 2}")
    if len(fixtures.anchors):
        points = rr.Points3D(fixtures.anchors, radii=0.03, colors=ANCHOR_COLOR)
        pen.static(f"{root}/{ANCHORS}", points)


def predicted_places(model: RobotModel, table: Measurements) -> Array:
    """Where (m, 3) the model has the target of each row, in the world [m]."""
    T = model.poses(table.q)
    return points_of_frames(T, targets(model.fixtures, table))


def seen_places(model: RobotModel, table: Measurements) -> Array:
    """Where (m, 3) the target of each row was seen, in the world [m].

    What rows do not tell is taken from the model, the identified one: where further stations and
    anchors stand, of which a first guess may be millimeters off, and in which direction from its
    anchor a distance was measured.
    """
    seen = points_of_frames(model.fixtures.station_frames[table.station], table.position)
    far = np.flatnonzero(table.is_distance)
    anchor = model.fixtures.anchors[table.anchor[far]]
    line = predicted_places(model, table)[far] - anchor
    away = np.linalg.norm(line, axis=1)
    seen[far] = anchor + (table.distance[far] / away)[:, None] * line
    return seen


def draw_held_out(shown: ShownTrial, pen: Pen, phase: Phase) -> None:
    """What there is at held-out poses, as the robot comes to them."""
    drawn = held_out(shown)
    for path, (archetype, values, look) in drawn.items():
        pen.grow(path, phase, archetype, values, look)
    leaves = pen.timeline.moves_on(phase.stop)
    if leaves is not None:
        pen.clear(leaves, *drawn)


def held_out(shown: ShownTrial) -> dict[str, tuple[Any, dict[str, Array], Any]]:
    """True minus nominal, true minus identified, and the believed 95 % regions, of every pose.

    By entity: one of Rerun's archetypes, its rows, and what is alike for all. Before and after
    share one factor. Regions have a larger one, and so have the errors drawn from their centers: an
    arrow ends inside its ellipsoid exactly where the record says so.
    """
    import rerun as rr

    setting, root = shown.setting, f"{shown.root}/{HELD_OUT}"
    true = target_points(setting.test_true, setting.target)
    nominal, stated = tracked(setting, setting.test_q), shown.stated.position
    few, many, found = shown.arrows, shown.regions, dict[str, tuple[Any, dict[str, Array], Any]]()
    for path, origin, times, color, radius in (
        (f"{root}/before_x{few}", nominal, few, style.BEFORE_COLOR, 0.0024),
        (f"{root}/after_x{few}", stated, few, style.AFTER_COLOR, 0.004),
        (f"{root}/after_x{many}", stated, many, IN_REGION_COLOR, 0.002),
    ):
        arrows = {"origins": origin, "vectors": times * (true - origin)}
        found[path] = rr.Arrows3D, arrows, {"radii": radius, "colors": color}
    colors = np.where(shown.estimate.inside[:, None], INSIDE_COLOR, OUTSIDE_COLOR)
    drawn = [(f"{root}/region_95_x{many}", shown.stated, colors, "solid")]
    if shown.moved is not None:
        lines = np.broadcast_to(MOVE_COLOR, colors.shape)
        drawn.append((f"{root}/one_move_95_x{many}", shown.moved, lines, "majorwireframe"))
    for path, statement, own, fill in drawn:
        axes, turn = statement.region
        regions: dict[str, Array] = {
            "centers": statement.position,
            "half_sizes": many * axes,
            "quaternions": quaternion_wxyz(turn)[:, [1, 2, 3, 0]],
            "colors": np.asarray(own.astype(np.uint8)),
        }
        found[path] = rr.Ellipsoids3D, regions, {"fill_mode": fill}
    return found
