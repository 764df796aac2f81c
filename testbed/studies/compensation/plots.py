"""Figures of the compensation study: AP per pose before and after, and the readings of a robot."""

from typing import TYPE_CHECKING

import numpy as np

from testbed.report.plots import Look, legend_above, log_ticks
from testbed.report.svg import DARK, LIGHT, MIDDLE, SOFT, drawing, svg_of
from testbed.studies.compensation.study import VARIANTS, CompensationStudy
from testbed.studies.compensation.summary import FLOOR, VALUE
from testbed.units import UM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOOKS: dict[str, Look] = {
    "before": {"marker": "s", "color": LIGHT},
    "geometric": {"marker": "o", "color": DARK},
    "chosen": {"marker": "^", "color": MIDDLE},
}
NAMES = {
    "before": "program as it was",
    "geometric": "corrected, geometric model",
    "chosen": "corrected, chosen model",
}
APART = 0.22
"""Between the marks of one pose, in poses."""


def accuracy_by_pose(studies: tuple[CompensationStudy, ...]) -> str:
    """AP of each pose, median and 5-95 % over robots, on a logarithmic scale, with the floor."""
    with drawing(1, len(studies), height=2.9, sharey=True) as (figure, axes):
        for ax, study in zip(axes, studies, strict=True):
            for v, variant in enumerate(VARIANTS):
                values = study.figures[v, 0, VALUE] * UM
                low, median, high = np.percentile(values, [5, 50, 95], axis=0)
                x = study.pose_id + APART * (v - 1)
                look = LOOKS[variant]
                ax.vlines(x, low, high, color=look["color"], linewidth=1.4)
                ax.plot(x, median, linestyle="none", markersize=4.6, label=NAMES[variant], **look)
            floor = float(study.figures[1:, 0, FLOOR].mean() * UM)
            ax.axhline(floor, color=SOFT, linewidth=0.9, linestyle=(0, (4, 2)), label="noise floor")
            ax.set_yscale("log")
            ax.set_title(f"{study.truth} robots")
            ax.set_xlabel("pose of the test")
            ax.set_xticks(study.pose_id, [f"P{k}" for k in study.pose_id])
        every = np.concatenate([study.figures[:, 0, :, :].ravel() for study in studies]) * UM
        small = max(float(every.min()), 0.1)
        log_ticks(axes[0].yaxis, small / 2, 2 * float(every.max()))
        axes[0].set_ylim(small / 1.5, 1.5 * float(every.max()))
        axes[0].set_ylabel("AP [µm]")
        legend_above(figure, axes[0])
        return svg_of(figure)


def readings_of_one(study: CompensationStudy) -> str:
    """Read positions of one robot at its second pose about the command, before and after."""
    with drawing(1, 2, height=2.9) as (figure, axes):
        seen = study.readings[:, 1] * UM
        for v, variant in enumerate(VARIANTS):
            for ax in axes:
                ax.plot(
                    seen[v, :, 0], seen[v, :, 2], linestyle="none", markersize=3.0,
                    label=NAMES[variant], **LOOKS[variant],
                )  # fmt: skip
        for ax, span in zip(axes, (seen, seen[2]), strict=True):
            _around(ax, float(np.abs(span[..., [0, 2]]).max()) * 1.15)
        axes[0].set_title(f"first {study.truth} robot, pose P{study.pose_id[1]}")
        axes[1].set_title("the same, closer")
        legend_above(figure, axes[0])
        return svg_of(figure)


def _around(ax: "Axes", span: float) -> None:
    """Equal axes about the command."""
    ax.set_aspect("equal")
    ax.set_xlim(-span, span)
    ax.set_ylim(-span, span)
    ax.axhline(0, color=SOFT, linewidth=0.6)
    ax.axvline(0, color=SOFT, linewidth=0.6)
    ax.set_xlabel("x read minus commanded [µm]")
    ax.set_ylabel("z read minus commanded [µm]")
