"""Margins from the lengths of words, against what a renderer measures."""

import os
import subprocess
import sys
from itertools import combinations

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg

from testbed.report.plots import legend_above, plain_log, rows_of
from testbed.report.svg import STYLE, drawing


def names(axes):
    for ax in axes:
        ax.barh(range(3), [1.0, 2.0, 3.0])
        ax.set_xlabel("u [µm]")
        ax.set_title("designed-29")
    rows_of(axes[0], ["tracker noise", "misfit up to its limit", "noise beyond the stated"])


def turned(axes):
    for ax in axes:
        ax.plot([0.0, 1.0, 2.0], [-3.0, 2.0, 1.0], "o", label="default estimator")
        ax.set_ylabel("intervals that\nheld the truth [%]")
    axes[-1].set_xticks(range(3), ["base.rx", "alpha6", "theta12"], rotation=90)


def powers(axes):
    for ax in axes:
        ax.plot([1.0, 150.0], [3.0e-5, 5.8e-5], label="O2")
        ax.set(title="O2: mean ± sd of 50 sets", xlabel="poses", ylabel="best O2, paper rows")
        ax.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4), useMathText=True)


def wide(axes):
    for ax in axes:
        ax.plot([-180.0, 180.0], [1e-3, 1e3], label="after")
        ax.set_yscale("log")
        plain_log(ax)
        ax.set(xlabel="command [deg]", ylabel="error [mm]")
        ax.set_xticks([-180, 0, 180])


@pytest.mark.parametrize("bar", [False, True], ids=["plain", "bar"])
@pytest.mark.parametrize("shape", [(1, 1), (2, 3)], ids=["one", "six"])
@pytest.mark.parametrize("fill", [names, turned, powers, wide])
def test_no_word_is_cut_or_meets_another_panel(fill, shape, bar):
    with drawing(*shape, height=1.9 * shape[0]) as (figure, axes):
        fill(axes)
        if axes[0].get_legend_handles_labels()[1]:
            legend_above(figure, axes[0])
        if bar:
            mesh = axes[0].scatter([0.0], [1.0], c=[20.0])
            figure.colorbar(mesh, ax=axes, label="u [µm]")
    FigureCanvasAgg(figure)
    with rc_context(STYLE):
        figure.canvas.draw()
        renderer = figure.canvas.get_renderer()
        boxes = [ax.get_tightbbox(renderer) for ax in figure.axes]
        boxes += [legend.get_tightbbox(renderer) for legend in figure.legends]
    width, height = figure.canvas.get_width_height()
    for box in boxes:
        # a pixel is for the line of a frame, which lies half outside
        assert box.x0 > -1
        assert box.y0 > -1
        assert box.x1 < width + 1
        assert box.y1 < height + 1
    for one, other in combinations(boxes, 2):
        apart = max(one.x0 - other.x1, other.x0 - one.x1, one.y0 - other.y1, other.y0 - one.y1)
        assert apart > -2
    inner = [ax.get_position() for ax in figure.axes[: shape[0] * shape[1]]]
    assert np.ptp([box.width for box in inner]) < 1e-12
    assert min(box.width * box.height for box in inner) * len(inner) > 0.25  # room for the data


def test_a_home_that_cannot_be_written_is_no_matter_for_a_person():
    """matplotlib keeps a list of fonts there, and tells at length where it may not."""
    script = "from testbed.report.svg import drawing\nwith drawing(): pass"
    home = {"HOME": "/dev/null/nowhere", "USERPROFILE": "/dev/null/nowhere"}
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("MPL", "XDG"))}
    done = subprocess.run(
        [sys.executable, "-c", script], env={**kept, **home}, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert done.stdout + done.stderr == ""
