"""Pictures of results on matplotlib axes of your own; each function draws, labels and returns them.

Blue is the result, vermilion the state before or a failure; they differ in gray as well.
"""

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, require_numbers
from calib.errors import refuse
from calib.uncertainty.regions import ellipsoid
from testbed.report.plots import log_ticks
from testbed.report.svg import DARK as AFTER
from testbed.report.svg import INK, SOFT
from testbed.report.svg import MIDDLE as BEFORE

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from matplotlib.axes import Axes

    from calib.design.pose_budget import PoseBudget
    from calib.design.pose_count import PoseCount
    from calib.shown import ResultTable

AXES = "xyz"


class Tabular(Protocol):
    """A result with tables."""

    def tables(self) -> "Mapping[str, ResultTable]":
        """Tables by their names."""


def residuals(axes: "Axes", result: Tabular) -> "Axes":
    """Measured minus predicted position, by component [um], row by row.

    Parameters
    ----------
    axes : matplotlib Axes
        To draw on.
    result : CalibratedRobot, Judgement or HeldOut
        For a calibration its training rows are drawn, for a judgement the held-out poses.
    """
    _require_axes(axes)
    table = _table(result, ("residuals", "errors"), "x_m")
    rows = np.arange(table.rows)
    for place, marker in enumerate("os^"):
        um, name = 1e6 * table[f"{AXES[place]}_m"], AXES[place]
        axes.plot(rows, um, marker, label=name, markersize=4, color=(INK, AFTER, BEFORE)[place])
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set(xlabel="row", ylabel="measured minus predicted [um]")
    axes.legend(ncols=3)
    return axes


def errors(axes: "Axes", result: Tabular, *, radius: float | None = None) -> "Axes":
    """Cumulative distributions of position errors before and after calibration [mm].

    Parameters
    ----------
    axes : matplotlib Axes
        To draw on.
    result : Campaign, Trial, Estimate or Calibration
        For a campaign the held-out errors against the truth are drawn, one line for each estimate;
        for a calibration those of the held-out rows, against the measurements.
    radius : float, optional
        A stated radius to mark, such as R95 [m].
    """
    _require_axes(axes)
    table = _table(result, ("errors",), "after_mm")
    kept = np.ones(table.rows, dtype=bool)
    if "role" in table and (table["role"] == "test").any():
        kept = table["role"] == "test"
    names = [table[name] for name in ("trial", "estimator") if name in table]
    labels = np.array([", ".join(words) or "after" for words in zip(*names, strict=True)])
    labels = labels if names else np.full(table.rows, "after")
    first = kept & (labels == labels[kept][0])
    _distribution(axes, table["before_mm"][first], "before", BEFORE, "--")
    for line, label in enumerate(dict.fromkeys(labels[kept].tolist())):
        chosen = kept & (labels == label)
        color, style = (AFTER, SOFT)[line // 3 % 2], ("-", "-.", ":")[line % 3]
        _distribution(axes, table["after_mm"][chosen], label, color, style)
    if radius is not None:
        axes.plot([1e3 * radius] * 2, [0, 1], color=INK, linewidth=1.2, label="stated radius")
    axes.set(xscale="log", xlabel="position error [mm]", ylabel="share of poses below")
    log_ticks(axes.xaxis, *axes.get_xlim())
    axes.set_yticks(np.linspace(0, 1, 6))
    axes.set_ylim(0, 1.05 + 0.12 * len(axes.lines))  # the legend lies above the curves
    axes.legend(loc="upper left", fontsize="small")
    return axes


def ellipse(
    axes: "Axes",
    covariance: ArrayLike,
    *,
    plane: str = "xy",
    probability: float = 0.95,
    center: ArrayLike = (0.0, 0.0),
    points: ArrayLike | None = None,
) -> "Axes":
    """Coverage ellipse of a point in a plane of two axes [um].

    Parameters
    ----------
    axes : matplotlib Axes
        To draw on.
    covariance : (3, 3) or (2, 2) array_like
        Covariance of the point [m^2]; of three axes, the marginal one of `plane` is drawn.
    plane : str
        Which two of x, y, z.
    probability : float
        Coverage probability of the region.
    center : (2,) array_like
        Center of the ellipse [m].
    points : (N, 3) or (N, 2) array_like, optional
        Points to draw as well [m]; the legend counts those inside.
    """
    _require_axes(axes)
    which = _plane(plane)
    S, middle = require_numbers("covariance", covariance), require_numbers("center", center)
    S = S[np.ix_(which, which)] if S.shape == (3, 3) else S
    check("2 2, 2", covariance=S, center=middle)
    half, turn = ellipsoid(S, probability=probability)
    angle = np.linspace(0.0, 2 * np.pi, 181)
    ring = middle + np.column_stack([np.cos(angle), np.sin(angle)]) * half @ turn.T
    axes.plot(*(1e6 * ring).T, color=AFTER, label=f"{100 * probability:g} % region")
    if points is not None:
        seen = require_numbers("points", points)
        seen = seen[:, which] if seen.shape[-1] == 3 else seen
        inside = (((seen - middle) @ turn / half) ** 2).sum(axis=1) <= 1.0
        label = f"{inside.sum()} of {len(seen)} inside"
        axes.plot(*(1e6 * seen[inside]).T, "o", markersize=3, color=INK, label=label)
        axes.plot(*(1e6 * seen[~inside]).T, "x", markersize=5, color=BEFORE)
    axes.set(xlabel=f"{plane[0]} [um]", ylabel=f"{plane[1]} [um]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend()
    return axes


def observability(axes: "Axes", count: "PoseCount") -> "Axes":
    """An observability index against the number of poses: mean and sd over random sets."""
    _require_axes(axes)
    _has(count, "PoseCount", "counts", "mean", "sd", "chosen", "criterion")
    low, high = count.mean - count.sd, count.mean + count.sd
    axes.fill_between(count.counts, low, high, color=AFTER, alpha=0.2, linewidth=0)
    axes.plot(count.counts, count.mean, color=AFTER, label="random sets: mean and sd")
    if count.chosen is not None:
        label = f"stable from {count.chosen} poses"
        axes.axvline(count.chosen, color=INK, linestyle="--", label=label)
    axes.set(xlabel="poses", ylabel=count.criterion)
    axes.legend()
    return axes


def pose_budget(axes: "Axes", budget: "PoseBudget") -> "Axes":
    """Uncertainty of designed sets against the number of poses, and its proven bound [um]."""
    _require_axes(axes)
    _has(budget, "PoseBudget", "counts", "reached", "possible", "target")
    axes.plot(budget.counts, 1e6 * budget.reached, "o-", color=AFTER, label="designed set")
    axes.plot(budget.counts, 1e6 * budget.possible, "--", color=INK, label="no set is better")
    axes.axhline(1e6 * budget.target, color=BEFORE, linewidth=1.2, label="target")
    axes.set(xlabel="poses", ylabel="u of the tool point [um]")
    axes.legend()
    return axes


def coverage(axes: "Axes", result: Tabular, *, level: float = 0.95) -> "Axes":
    """Share of true points inside the stated regions against the level promised; one row each.

    Parameters
    ----------
    axes : matplotlib Axes
        To draw on.
    result : Campaign
        Campaign of a scene with a study of coverage.
    level : float
        Coverage probability that was promised.
    """
    _require_axes(axes)
    table = _table(result, (), "statement")
    words = zip(table["truth"], table["model"], table["statement"], strict=True)
    names = [", ".join(row) for row in words]
    rows, share = np.arange(table.rows), table["inside"]
    spread = 2 * table["sd"] / np.sqrt(table["robots"])
    short = share + spread < level
    for which, color, label in ((~short, AFTER, "holds"), (short, BEFORE, "falls short")):
        axes.errorbar(
            share[which], rows[which], xerr=spread[which], fmt="s" if color == BEFORE else "o",
            color=color, label=label,
        )  # fmt: skip
    axes.axvline(level, color=INK, linestyle="--", label=f"promised: {100 * level:g} %")
    axes.set_yticks(rows, names)
    axes.set(xlabel="share of true points inside", xlim=(-0.02, 1.02))
    axes.invert_yaxis()
    axes.legend()
    return axes


def slide(path: "Path", painted: "Callable[[Axes], object]") -> None:
    """Draw one picture for a projector: large letters, thick lines.

    Parameters
    ----------
    path : path
        File to write; its ending ``.png``, ``.svg`` or ``.pdf`` decides the format.
    painted : callable
        Function that draws on the axes it is given.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    large: Any = {"font.size": 17, "lines.linewidth": 3, "lines.markersize": 10, "axes.grid": True}
    large |= {"axes.axisbelow": True, "grid.alpha": 0.35, "legend.frameon": False}
    with rc_context(large):
        figure = Figure(figsize=(12, 6.75), layout="constrained")
        painted(figure.add_subplot())
        figure.savefig(path, dpi=120)


def _table(result: Tabular, names: tuple[str, ...], column: str) -> "ResultTable":
    """The first table of these names, or of any, that has the column."""
    _has(result, "result with tables", "tables")
    tables = result.tables()
    for name in names or tables:
        if name in tables and column in tables[name]:
            return tables[name]
    of_names = f"{' or '.join(names)} " if names else ""
    message = f"{type(result).__name__} has no table {of_names}with {column}"
    have = f"it has {', '.join(tables) or 'none'}"
    raise refuse("result", None, have, code="A3", message=message)


def _has(thing: object, wanted: str, *names: str) -> None:
    """Raise an `InputError` (A3) if a result lacks an attribute that is drawn."""
    if not all(hasattr(thing, name) for name in names):
        message = f"{type(thing).__name__} cannot be drawn here"
        raise refuse("result", None, f"a {wanted} is wanted", code="A3", message=message)


def _require_axes(axes: object) -> None:
    """Raise an `InputError` (A3) unless `axes` is one set of axes of matplotlib."""
    if not all(hasattr(axes, name) for name in ("plot", "set", "axhline")):
        allowed = "axes of matplotlib, such as plt.gca(), or one of those of plt.subplots()"
        message = f"axes is of the type {type(axes).__name__}"
        raise refuse("axes", allowed=allowed, code="A3", message=message)


def _distribution(axes: "Axes", mm: Array, label: str, color: str, style: str) -> None:
    """Draw the empirical distribution function of values [mm]."""
    steps = np.arange(1, len(mm) + 1) / len(mm)
    axes.step(np.sort(mm), steps, style, where="post", color=color, label=label)


def _plane(plane: str) -> list[int]:
    """Indices of two axes by their letters."""
    which = [AXES.find(letter) for letter in plane]
    if len(which) != 2 or -1 in which or which[0] == which[1]:
        raise refuse("plane", plane, "two of the letters x, y and z, such as xy", code="A3")
    return which
