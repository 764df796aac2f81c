"""The recording of a calibration: measured poses, the fit, held-out poses, and the verdict."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Index, evenly
from calib.geometry.frames import inverse, points_of_frames
from calib.measurement.prediction import targets, tool_poses
from testbed.identify.calibration import Calibration
from testbed.identify.headline import headline_rows, mm, r95
from testbed.identify.recording.regions import draw_regions, region_words, regions_at
from testbed.identify.records import RowErrors
from testbed.identify.words import notice, verdict
from testbed.recording import style
from testbed.recording.cell import draw_beam, draw_station
from testbed.recording.chart import Chart, Series, before_after, fit_chart
from testbed.recording.pen import Pen
from testbed.recording.story import Chapter, Story, floor_height, numbered, row_word, stance
from testbed.recording.timeline import Phase, spread, visit
from testbed.robots.robot import Robot
from testbed.units import counted

IDENTIFY_FRAMES = 48
AHEAD = np.array([3.0, 0.0, 0.0])
"""Without a tracker in sight the arm is looked at from its front [m]."""
MOST_POSES = 150
"""Poses the robot goes to in a phase; of more, this many evenly spread ones are shown."""
TRACKER_AWAY = 0.8
"""A measuring frame nearer to the base than this [m] is no tracker's own."""
UPRIGHT = np.cos(np.radians(20.0))
"""A tracker stands upright within 20 deg."""
AXIS_LENGTH = 0.12
AXES_COLORS = (style.VERMILION, style.LEAF, style.BLUE)


@dataclass(frozen=True, slots=True, eq=False)
class ShownCalibration:
    """A calibration as it is drawn: everything in the robot's base frame, turned to stand level."""

    calibration: Calibration
    measured: Index
    """(k,) rows identified from that the robot goes to."""
    judged: Index
    """(j,) rows whose errors are judged that the robot goes to."""
    station: Array
    """(4, 4) where the measuring frame is, seen from the base with z up [m]."""
    seen: Array
    """(m, 3) where the target was seen; of a distance row where it is predicted [m]."""
    factor: int
    """How many times larger than life errors are drawn: all but gross ones below their size."""
    buried: bool = False
    """Whether the measuring frame lies below the floor of the room, where the file gives it."""

    def vectors(self, misses: RowErrors) -> Array:
        """(m, 3) what a model misses, base axes [m]."""
        return np.asarray(misses.vector @ self.station[:3, :3].T)

    @property
    def has_tracker(self) -> bool:
        """Whether the measuring frame can be that of a tracker that stands beside the robot."""
        away = np.linalg.norm(self.station[:3, 3]) > TRACKER_AWAY
        return bool(away and self.station[2, 2] > UPRIGHT and not self.buried)


def show(calibration: Calibration) -> ShownCalibration:
    """Place a calibration in the base frame; an arm that the file hangs on a wall hangs there."""
    model, table = calibration.fit.identification.model, calibration.measurements
    station = stance(calibration.nominal.chain.T_world_base) @ inverse(model.chain.T_world_base)
    T, offset = station @ tool_poses(model, table), targets(model.fixtures, table)
    predicted = points_of_frames(T, offset)
    before = np.linalg.norm(calibration.before_misses.vector, axis=1)
    return ShownCalibration(
        calibration,
        evenly(np.flatnonzero(calibration.is_used), MOST_POSES),
        evenly(np.flatnonzero(calibration.is_judged), MOST_POSES),
        station,
        predicted + calibration.fit.misses.vector @ station[:3, :3].T,
        style.nice_factor(style.ARROW_SIZE, float(np.quantile(before, 0.98))),
    )


def calibration_story(calibration: Calibration, robot: Robot) -> Story:
    """What the recording of a calibration holds, in the base frame of the identified robot.

    Parameters
    ----------
    calibration : Calibration
        Finished; nothing is computed again but poses of known models.
    robot : Robot
        The identified one, as its folder holds it: its links and parts are drawn.
    """
    source, shown = calibration.source, show(calibration)
    # a robot whose numbers were chosen anew may count from another base
    base = shown.station @ robot.model.chain.T_world_base
    chain = replace(robot.model.chain, T_world_base=base)
    floor = robot.base_offset
    if base[2, 2] < UPRIGHT:
        floor = floor_height(chain, robot)
        buried = robot.mounting_height is not None and shown.station[2, 3] < floor
        shown = replace(shown, buried=buried)
    return Story(
        identity=f"{source.name}-calibration-{calibration.split.seed}",
        name=f"{source.name}, calibration of {source.robot}",
        summary=summary(calibration),
        robot=robot,
        chain=chain,
        reach=shown.seen,
        station=shown.station[:3, 3] if shown.has_tracker else AHEAD,
        has_tracker=shown.has_tracker,
        draw=lambda pen: draw_cell(shown, floor, pen),
        chapters=(_measure(shown), _identify(shown), _evaluate(shown)),
    )


def summary(calibration: Calibration) -> str:
    """The verdict first, then the errors of every model."""
    lines = [
        f"**{notice(calibration)}**: {calibration.source.robot_title}, {calibration.source.name}",
        "",
        verdict(calibration),
        "",
    ]
    lines += [
        f"- {row[0]}: mean {row[1]}, p95 {row[2]}, largest {row[3]} mm"
        + (f"; mean {row[4]} deg" if row[4] != "–" else "")
        for row in headline_rows(calibration)
    ]
    return "\n".join(lines)


def _measure(shown: ShownCalibration) -> Chapter:
    """Training poses, and their errors before and after."""
    total = int(shown.calibration.is_used.sum())

    def draw(pen: Pen, phase: Phase) -> None:
        draw_sight(shown, pen, phase)
        draw_measured(shown, pen, phase)

    return Chapter(
        name="measure",
        local="pose",
        color=style.MEASURE_PHASE,
        motion=visit(shown.calibration.measurements.q[shown.measured]),
        text=(
            f"#### 1 Measured: {counted(total, 'row')} to identify from",
            _part_shown(len(shown.measured), total),
            "- dark dots: where the target was measured",
            f"- vermilion arrows: errors of the nominal links, drawn {shown.factor} times larger",
            "- triad: the target on the tool",
        ),
        draw=draw,
        lines=_lines(shown, shown.measured),
        charts=(_errors(shown, "measure", "Training", shown.measured),),
    )


def _identify(shown: ShownCalibration) -> Chapter:
    """How the fit went."""
    calibration = shown.calibration
    found = calibration.fit.identification
    last = calibration.measurements.q[shown.measured[-1:]]
    return Chapter(
        name="identify",
        local="iteration",
        color=style.IDENTIFY_PHASE,
        motion=spread(len(found.trace), IDENTIFY_FRAMES, last),
        text=(
            f"#### 2 Identify: {calibration.choice.chosen}",
            f"- {found.parameters.n_free} numbers from {len(found.residual)} equations",
            f"- {found.status.value}",
            f"- {calibration.choice.sentence}",
        ),
        draw=lambda *_: None,
        lines=numbered("step", len(found.trace)),
        charts=(fit_chart(found.trace, found.dof),),
    )


def _evaluate(shown: ShownCalibration) -> Chapter:
    """Poses that judge the calibration, and their errors before and after."""
    calibration = shown.calibration
    judged, held = int(calibration.is_judged.sum()), calibration.split.is_test.any()
    point = calibration.proof.point
    within = f"- mean tool point: {r95(point)} = {mm(point.radius_mean)} mm" if point else ""
    within += " to the others" * (point is not None and point.relative)
    regions = regions_at(calibration, shown.judged, shown.station)

    def draw(pen: Pen, phase: Phase) -> None:
        draw_sight(shown, pen, phase)
        draw_judged(shown, pen, phase)
        if regions is not None:
            draw_regions(regions, pen, phase)

    return Chapter(
        name="evaluate",
        local="test",
        color=style.EVALUATE_PHASE,
        motion=visit(calibration.measurements.q[shown.judged]),
        text=(
            f"#### 3 {'Held out' if held else 'The same, none held out'}: {counted(judged, 'row')}",
            _part_shown(len(shown.judged), judged),
            f"- vermilion, blue: error before and after, both drawn {shown.factor} times larger",
            "- dots: all of them, brighter for larger errors after",
            within,
            region_words(regions),
        ),
        draw=draw,
        lines=_lines(shown, shown.judged),
        charts=(_errors(shown, "evaluate", "Held-out" if held else "Same", shown.judged),),
    )


def _part_shown(shown: int, total: int) -> str:
    """How many of the rows the robot goes to, unless it goes to all."""
    return "" if shown == total else f"- {shown} of them, evenly spread, are shown"


def _lines(shown: ShownCalibration, rows: Index) -> list[str]:
    """Number of each pose or reading shown, and its error before and after."""
    before, after = shown.calibration.before_misses, shown.calibration.fit.misses
    says = before_after(before.position[rows], after.position[rows])
    return numbered(row_word(shown.calibration.measurements.rows(rows)), len(rows), says)


def _errors(shown: ShownCalibration, origin: str, whose: str, rows: Index) -> Chart:
    """Errors of the poses shown, before and after [mm]."""
    before, after = shown.calibration.before_misses, shown.calibration.fit.misses
    curves = (
        Series("before", before.position[rows] * 1e3, style.BEFORE_COLOR),
        Series("after", after.position[rows] * 1e3, style.AFTER_COLOR),
    )
    return Chart(origin, f"{whose} error [mm] by pose shown", curves)


def draw_cell(shown: ShownCalibration, floor: float, pen: Pen) -> None:
    """The target on the tool, its holder, and the tracker where one stands."""
    import rerun as rr

    T = _tool(shown, pen)
    pen.transforms("world/target", T)
    axes = rr.Arrows3D(vectors=AXIS_LENGTH * np.eye(3), radii=0.004, colors=AXES_COLORS)
    pen.static("world/target", axes)
    tool = shown.calibration.fit.identification.model.chain.T_flange_tool
    flange = T @ inverse(tool)
    arm = [[[a, b]] for a, b in zip(flange[:, :3, 3], T[:, :3, 3], strict=True)]
    pen.every_step("world/holder", rr.LineStrips3D.columns(strips=arm))
    pen.static("world/holder", rr.LineStrips3D.from_fields(radii=0.006, colors=(90, 96, 104)))
    if shown.has_tracker:
        draw_station(pen, shown.station, T[:, :3, 3], floor)


def _tool(shown: ShownCalibration, pen: Pen) -> Array:
    """Identified tool poses (s, 4, 4) at every step [m]."""
    model = shown.calibration.fit.identification.model
    return np.asarray(shown.station @ model.poses(pen.timeline.q))


def draw_sight(shown: ShownCalibration, pen: Pen, phase: Phase) -> None:
    """The beam while poses are measured, where a tracker stands."""
    if shown.has_tracker:
        draw_beam(pen, phase, shown.station[:3, 3], _tool(shown, pen)[:, :3, 3])


def draw_measured(shown: ShownCalibration, pen: Pen, phase: Phase) -> None:
    """Training poses seen so far, and what the nominal links miss there."""
    import rerun as rr

    before = shown.vectors(shown.calibration.before_misses)[shown.measured]
    seen = shown.seen[shown.measured]
    cloud, arrows = "world/measured", f"world/error_before_x{shown.factor}"
    look = {"radii": 0.010, "colors": (40, 46, 54)}
    pen.grow(cloud, phase, rr.Points3D, {"positions": seen}, look)
    pen.grow_arrows(arrows, phase, seen - before, shown.factor * before, style.BEFORE_COLOR, 0.0032)
    pen.clear(pen.timeline.phase("identify").stop, cloud, arrows)


def draw_judged(shown: ShownCalibration, pen: Pen, phase: Phase) -> None:
    """Held-out poses: all of them as points, those visited with arrows before and after."""
    import rerun as rr

    calibration = shown.calibration
    judged, after = calibration.is_judged, calibration.fit.misses
    errors = after.position[judged]
    points = rr.Points3D(
        shown.seen[judged],
        radii=0.006 if judged.sum() < MOST_POSES else 0.0025,
        colors=style.viridis(errors, float(np.quantile(errors, 0.98))),
    )
    pen.at(phase.start, "world/held_out/all", points)
    seen = shown.seen[shown.judged]
    for name, misses, color, radius in (
        ("before", calibration.before_misses, style.BEFORE_COLOR, 0.0024),
        ("after", after, style.AFTER_COLOR, 0.0045),
    ):
        vectors = shown.vectors(misses)[shown.judged]
        path = f"world/held_out/{name}_x{shown.factor}"
        pen.grow_arrows(path, phase, seen - vectors, shown.factor * vectors, color, radius)
