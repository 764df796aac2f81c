"""The recording of a test: cycle after cycle around each pose, AP and RP, and drift."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from calib.arrays import Array, evenly
from calib.measurement.iso_drift import BLOCK
from calib.shown import length_unit
from testbed.iso9283.recording_path import DARK, FRAMES, PALE, path_chapter, rounded
from testbed.iso9283.shown import ShownTest
from testbed.recording import style
from testbed.recording.cell import box_edges
from testbed.recording.chart import Chart, Series
from testbed.recording.pen import Pen
from testbed.recording.story import Chapter, Story
from testbed.recording.timeline import Phase, spread, visit
from testbed.units import counted

MOST_VISITS = 600
"""Readings to which the recording goes; of more cycles, evenly spread ones are shown."""
REACH, CLOUD = 0.35, 0.14
"""Largest drawn AP, and radius of the largest sphere of RP, in distances between poses."""
FIGURE_FRAMES = 16
"""For each pose while its figures are shown."""
AHEAD = np.array([3.0, 1.3, 0.0])
"""The poses are looked at from their front, past the diagonal of a cube [m]."""
CURVES = (style.BLUE, style.ORANGE, style.LEAF, style.PINK, style.SKY)
"""Of the poses that scatter most."""
MOST_LIMITS = 8
"""Poses whose limits have room beside the cell."""
LABEL = (255, 255, 255)
DRIFT_PHASE = (176, 96, 40)


@dataclass(frozen=True, slots=True, eq=False)
class LargerThanLife:
    """A test with what is larger than life in it."""

    test: ShownTest
    unit: float
    """Typical distance between poses, or size of the paths [m]."""
    away: int
    """Factor of what is between a command and the middle of its readings."""
    wide: int
    """Factor of what is between that middle and a reading."""

    @property
    def middle(self) -> Array:
        """Barycenters (e, 3) [m]."""
        return np.asarray(self.test.position.mean(axis=1))

    @property
    def center(self) -> Array:
        """Where barycenters (e, 3) are drawn [m]."""
        command = self.test.command
        return np.asarray(command + self.away * (self.middle - command))

    def readings(self, position: Array) -> Array:
        """Where readings (e, k, 3) are drawn [m]."""
        return np.asarray(self.center[:, None] + self.wide * (position - self.middle[:, None]))


def drawn_test(test: ShownTest) -> LargerThanLife:
    """A test by factors that keep its poses apart."""
    places = [test.command, *(path.command for path in test.paths)]
    every = np.vstack(places)
    unit = float(np.ptp(every, axis=0).max()) or 1.0
    if len(test.command) > 1:
        apart = np.linalg.norm(test.command[:, None] - test.command, axis=2)
        nearest = (apart + np.where(apart > 0, 0.0, np.inf)).min(axis=1)
        if np.isfinite(nearest).any():
            unit = float(np.median(nearest[np.isfinite(nearest)]))
    largest = [float(figure.max()) if len(figure) else 0.0 for figure in (test.AP, test.RP)]
    away, wide = (
        style.nice_factor(part * unit, size)
        for part, size in zip((REACH, CLOUD), largest, strict=True)
    )
    return LargerThanLife(test, unit, away, wide)


def test_story(test: ShownTest) -> Story:
    """What the recording of a test holds, in the frame of its commands."""
    shown = drawn_test(test)
    chapters: list[Chapter] = []
    if test.poses:
        chapters += [_visits(shown), _figures(shown)]
        if test.position.shape[1] >= 2 * BLOCK:
            chapters.append(_drift(shown))
    chapters += [path_chapter(path, k) for k, path in enumerate(test.paths)]
    reach = [path.command for path in test.paths]
    if test.poses:
        reach += [test.command, shown.readings(test.position).reshape(-1, 3)]
    return Story(
        identity=f"{test.name}-iso9283",
        name=f"{test.name}, ISO 9283",
        summary="\n".join([f"**{test.notice}**: {test.name}", "", test.mark, "", test.verdict]),
        robot=None,
        chain=None,
        reach=np.vstack(reach),
        station=AHEAD,
        draw=partial(_draw_cell, shown),
        chapters=chapters,
        has_tracker=False,
    )


def _draw_cell(shown: LargerThanLife, pen: Pen) -> None:
    """The commanded poses with their names, and the tool that goes to them."""
    import rerun as rr

    test, size = shown.test, 0.03 * shown.unit
    T = np.broadcast_to(np.eye(4), (pen.timeline.n_steps, 4, 4)).copy()
    T[:, :3, 3] = pen.timeline.q
    pen.transforms("world/tool", T)
    pen.static("world/tool", rr.Points3D([[0, 0, 0]], radii=1.3 * size, colors=DARK))
    if not test.poses:
        return
    low, high = test.command.min(axis=0), test.command.max(axis=0)
    edges = box_edges((low + high) / 2, high - low)
    lines = rr.LineStrips3D(edges, radii=0.1 * size, colors=style.MUTED_COLOR)
    pen.static("world/box", lines)
    pen.static("world/commanded", rr.Points3D(test.command, radii=size, colors=DARK))
    # a label has the color of its point, and stands on gray
    labels = test.labels
    names = rr.Points3D(
        test.command[list(labels)] - [0, 0, 2 * size], radii=1e-6, colors=LABEL,
        labels=list(labels.values()), show_labels=True,
    )  # fmt: skip
    pen.static("world/names", names)


def _visits(shown: LargerThanLife) -> Chapter:
    """The tool goes from pose to pose, cycle after cycle; each reading stays."""
    test = shown.test
    count, all_of_them = len(test.poses), test.position.shape[1]
    cycles = evenly(np.arange(all_of_them), max(2, MOST_VISITS // count))
    position = test.position[:, cycles]
    off = np.linalg.norm(position - test.command[:, None], axis=2)
    scale, unit = length_unit(largest := float(off.max()))
    named = sorted(np.argsort(-test.RP, kind="stable")[: len(CURVES)].tolist())
    items = np.arange(len(cycles)) * count
    some = f"- {len(cycles)} of {all_of_them} cycles, evenly spread, are shown"
    readings = shown.readings(position).transpose(1, 0, 2).reshape(-1, 3)

    def draw(pen: Pen, phase: Phase) -> None:
        import rerun as rr

        look = {"radii": 0.011 * shown.unit, "colors": style.BLUE}
        pen.grow("world/readings", phase, rr.Points3D, {"positions": readings}, look)

    return Chapter(
        name="visit",
        local="visit",
        color=style.MEASURE_PHASE,
        motion=visit(np.tile(test.command, (len(cycles), 1))),
        text=(
            f"#### 1 Visit: {counted(count, 'pose')}, {counted(all_of_them, 'cycle')}",
            some if len(cycles) < all_of_them else "",
            "- dark: where the robot was sent; the dark ball: where it is sent now",
            f"- blue: readings, drawn {shown.wide} times larger than life about their middle",
            f"- that middle is drawn {shown.away} times as far from the command as it is",
            "- curves: distance of every reading from its command"
            + (f", of the {len(named)} poses that scatter most" if len(named) < count else ""),
        ),
        draw=draw,
        lines=[
            f"cycle {cycles[k // count] + 1} of {all_of_them}, {test.called[k % count]}: "
            f"{rounded(away, largest)} off"
            for k, away in enumerate(off.T.ravel())
        ],
        charts=(
            Chart(
                "visit",
                f"Distance from the command [{unit}] by cycle",
                [
                    Series(f"off{e + 1}", scale * off[e], color, test.called[e], items + e)
                    for e, color in zip(named, CURVES, strict=False)
                ],
                np.repeat(cycles + 1.0, count),
            ),
        ),
    )


def _figures(shown: LargerThanLife) -> Chapter:
    """AP as an arrow and RP as a sphere, pose after pose."""
    test, count = shown.test, len(shown.test.poses)
    AP, RP = test.AP, test.RP
    scale, unit = length_unit(largest := float(max(AP.max(), RP.max())))

    def draw(pen: Pen, phase: Phase) -> None:
        import rerun as rr

        vectors, thin = shown.center - test.command, 0.01 * shown.unit
        path = f"world/AP_x{shown.away}"
        pen.grow_arrows(path, phase, test.command, vectors, style.VERMILION, thin)
        spheres = {
            "centers": shown.center,
            "half_sizes": np.repeat(shown.wide * test.RP[:, None], 3, axis=1),
        }
        look = {"fill_mode": "solid", "colors": PALE}
        pen.grow(f"world/RP_x{shown.wide}", phase, rr.Ellipsoids3D, spheres, look)

    return Chapter(
        name="figures",
        local="pose",
        color=style.EVALUATE_PHASE,
        motion=visit(test.command, FIGURE_FRAMES),
        text=(
            "#### 2 Figures: accuracy and repeatability",
            f"- vermilion arrows: AP, from the command to the middle, drawn {shown.away} times",
            f"- blue spheres: RP about the middle, drawn {shown.wide} times",
            *(
                f"- {name}: {said}"
                for name, said in zip(test.called[:MOST_LIMITS], test.said, strict=False)
            ),
            "- in brackets: 95 % confidence limits",
        ),
        draw=draw,
        lines=[
            f"{name}: AP {rounded(a, largest)}, RP {rounded(r, largest)}"
            for name, a, r in zip(test.called, AP, RP, strict=True)
        ],
        charts=(
            Chart(
                "figures",
                f"AP and RP [{unit}] by pose",
                (Series("AP", scale * AP, style.VERMILION), Series("RP", scale * RP, style.BLUE)),
                np.arange(1.0, count + 1),
            ),
        ),
    )


def _drift(shown: LargerThanLife) -> Chapter:
    """Where the last ten readings of each pose lie, cycle after cycle."""
    test, n = shown.test, shown.test.position.shape[1]
    ends = evenly(np.arange(BLOCK, n + 1), FRAMES)
    moving = np.array([test.position[:, end - BLOCK : end].mean(axis=1) for end in ends])
    AP = np.linalg.norm(moving - test.command, axis=2)
    first, center = moving[0], shown.center
    worst = int(np.abs(AP - AP[0]).max(axis=0).argmax())
    most, others, changes = AP[:, worst], AP.mean(axis=1), f"{test.called[worst]}, changes most"
    scale, unit = length_unit(largest := float(max(most.max(), others.max())))

    def draw(pen: Pen, phase: Phase) -> None:
        import rerun as rr

        at, thin = phase.start, 0.01 * shown.unit
        pen.clear(at, "world/readings", f"world/AP_x{shown.away}")
        clouds = [
            shown.readings(test.position[:, end - BLOCK : end]).reshape(-1, 3) for end in ends
        ]
        columns = rr.Points3D.columns(positions=np.concatenate(clouds))
        pen.rows("world/last_ten", phase, columns.partition([len(one) for one in clouds]))
        look = rr.Points3D.from_fields(radii=0.011 * shown.unit, colors=style.BLUE)
        pen.static("world/last_ten", look)
        start = center + shown.wide * (first - shown.middle)
        path = f"world/drift_x{shown.wide}"
        vectors = shown.wide * (moving - first)
        arrows = rr.Arrows3D.columns(
            origins=np.tile(start, (len(ends), 1)), vectors=vectors.reshape(-1, 3)
        )
        pen.rows(path, phase, arrows.partition([len(start)] * len(ends)))
        pen.static(path, rr.Arrows3D.from_fields(radii=thin, colors=style.VERMILION))
        pen.clear(phase.stop, "world/last_ten", path, f"world/RP_x{shown.wide}")

    return Chapter(
        name="drift",
        local="cycle",
        color=DRIFT_PHASE,
        motion=spread(len(ends), FRAMES, test.command[:1]),
        text=(
            f"#### 3 Drift: the last {BLOCK} cycles, one further each time",
            f"- blue: these readings; vermilion: the path of their mean, {shown.wide} times larger",
            f"- curves: AP of the last {BLOCK} cycles",
            f"- {test.drift}",
        ),
        draw=draw,
        lines=[
            f"cycles {end - BLOCK + 1} to {end} of {n}, {test.called[worst]}: "
            f"AP {rounded(value, largest)}"
            for end, value in zip(ends, most, strict=True)
        ],
        charts=(
            Chart(
                "drift",
                f"AP [{unit}] of {BLOCK} cycles, by the last of them",
                (
                    Series("most", scale * most, style.VERMILION, changes),
                    Series("mean", scale * others, style.BLUE, "mean of all poses"),
                ),
                ends * 1.0,
            ),
        ),
    )
