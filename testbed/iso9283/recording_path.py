"""A path of a test in the recording: as commanded, and its mean run far larger than life."""

from dataclasses import replace

import numpy as np

from calib.arrays import evenly
from calib.shown import length_unit, length_words
from testbed.iso9283.shown import ShownPath
from testbed.recording import style
from testbed.recording.chart import Chart, Series
from testbed.recording.pen import Pen
from testbed.recording.story import Chapter
from testbed.recording.timeline import Phase, glide, spread

TUBE = 0.12
"""Largest drawn error of a path, in sizes of the path."""
FRAMES = 144
"""About, for all cycles or all points of a path."""
ROUNDING = 1e-9
"""What nothing but rounding makes is drawn as zero [m]."""
DARK, PALE = (40, 46, 54), (*style.BLUE, 46)
"""Of commands, and of what scatters about a middle."""


def rounded(length: float, largest: float) -> str:
    """A length [m] of a curve that goes up to the largest, micrometers as whole ones."""
    return length_words(length, largest, um=".0f")


def path_chapter(path: ShownPath, k: int) -> Chapter:
    """Point after point, how far the mean run is from the command and how far runs scatter."""
    size, largest = float(np.ptp(path.command, axis=0).max()), float((path.AT + path.RT).max())
    times = style.nice_factor(TUBE * size, largest)
    mean = path.command + times * (path.mean - path.command)
    items, root = evenly(np.arange(len(mean)), FRAMES), f"world/path{k + 1}"
    AT, RT = (np.where(one > ROUNDING, one, 0.0)[items] for one in (path.AT, path.RT))
    largest = float(max(AT.max(), RT.max()))
    scale, unit = length_unit(largest)
    motion = spread(len(items), FRAMES)
    way = glide(path.command[items], motion.steps)

    def draw(pen: Pen, phase: Phase) -> None:
        import rerun as rr

        thin = 0.006 * size
        strip = rr.LineStrips3D([path.command], radii=thin, colors=DARK)
        pen.at(phase.start, f"{root}/commanded", strip)
        vectors = (mean - path.command)[items]
        arrows = f"{root}/AT_x{times}"
        pen.grow_arrows(arrows, phase, path.command[items], vectors, style.VERMILION, 0.5 * thin)
        tube = {
            "centers": mean[items],
            "half_sizes": np.repeat(times * path.RT[items][:, None], 3, axis=1),
        }
        look = {"fill_mode": "solid", "colors": PALE}
        pen.grow(f"{root}/RT_x{times}", phase, rr.Ellipsoids3D, tube, look)
        names = ("commanded", f"AT_x{times}", f"RT_x{times}")
        pen.clear(phase.stop, *(f"{root}/{name}" for name in names))

    return Chapter(
        name=f"path{k + 1}",
        local=f"point{k + 1}",
        color=style.MOVE_PHASE,
        motion=replace(motion, q=way),
        text=(
            f"#### Path {path.name}",
            "- dark: as commanded",
            f"- vermilion: from there to the mean run, drawn {times} times",
            f"- blue: RT about the mean run, drawn {times} times",
            f"- {path.said}",
        ),
        draw=draw,
        lines=[
            f"point {item + 1} of {len(mean)}: {rounded(a, largest)} off, RT {rounded(r, largest)}"
            for item, a, r in zip(items, AT, RT, strict=True)
        ],
        charts=(
            Chart(
                f"path{k + 1}",
                f"AT and RT [{unit}] by point",
                (Series("AT", scale * AT, style.VERMILION), Series("RT", scale * RT, style.BLUE)),
                items + 1.0,
            ),
        ),
    )
