"""The figures of a plan's report, one function each: the plan in, one SVG element out."""

from typing import TYPE_CHECKING

import numpy as np

from calib.arrays import Array
from testbed.plan.lengths import curve_unit, unit_of
from testbed.plan.promises import factor_words
from testbed.plan.records import Plan
from testbed.report.plots import (
    BARS,
    SHADES,
    VIEWS,
    dots,
    label,
    labels_apart,
    legend_above,
    marked_line,
    toward,
    view_of,
)
from testbed.report.svg import DARK, FAINT, INK, LIGHT, MIDDLE, SOFT, drawing, svg_of
from testbed.units import MM, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUTERMOST = (0.02, 0.98)
"""Quantiles of the leverage between which the shades change."""
PARTS = ("of it: noise", "of it: systematic errors")
NUMBERED = 45
"""More poses than this are not numbered."""
ROOM = (190.0, 215.0)
"""Width and height of a panel of the tour, at least [pt]."""


def tool_points(plan: Plan, q: Array) -> Array:
    """Tool positions (m, 3) of the nominal robot [mm]."""
    if not len(q):
        return np.zeros((0, 3))
    return np.asarray(plan.nominal.poses(q)[:, :3, 3] * MM)


def leverage_map(plan: Plan) -> str:
    """The pool colored by leverage, and the chosen poses in it."""
    pool, level = plan.pool.T[:, :3, 3] * MM, levels(plan.leverage)
    chosen = pool[plan.places]
    with drawing(1, 2, height=3.4) as (figure, axes):
        for ax, (i, j, view) in zip(axes, VIEWS, strict=True):
            for k, shade in enumerate(SHADES):
                here = pool[level == k]
                if len(here):
                    dots(ax, here[:, [i, j]], shade)
            _mark(ax, chosen[:, [i, j]], "o", MIDDLE, "chosen")
            view_of(ax, i, j, view)
        toward(axes[0], plan.T_world_tracker[:2, 3])
        return svg_of(figure)


def levels(leverage: Array) -> Array:
    """Which shade (N,) each leverage gets: equal steps over all but the few outermost."""
    low, high = np.quantile(leverage, OUTERMOST)
    part = (leverage - low) / max(float(high - low), 1e-300)
    return np.asarray(np.clip(np.floor(part * len(SHADES)), 0, len(SHADES) - 1), dtype=np.int64)


def order_map(plan: Plan) -> str:
    """The tour: poses in measuring order, numbered, held-out ones apart."""
    tour = plan.tour
    points = tool_points(plan, tour.q)
    test = np.array([role == "test" for role in tour.roles])
    stops = [tool_points(plan, np.vstack([*tour.vias[k], tour.q[k]])) for k in range(len(tour))]
    way = np.vstack([tool_points(plan, tour.start[None]), *stops])
    with drawing(1, 2, height=4.4) as (figure, axes):
        for ax, (i, j, view) in zip(axes, VIEWS, strict=True):
            ax.plot(way[:, i], way[:, j], color=FAINT, linewidth=0.7, zorder=1)
            ax.plot(*way[:1, [i, j]].T, "s", color=INK, markersize=4.5, label="start")
            _mark(ax, points[~test][:, [i, j]], "o", DARK, "to identify")
            _mark(ax, points[test][:, [i, j]], "^", LIGHT, "held out")
            if len(points) <= NUMBERED:
                numbers = [str(k + 1) for k in range(len(points))]
                labels_apart(ax, numbers, points[:, [i, j]], ROOM, besides=way[:1, [i, j]])
            view_of(ax, i, j, view)
        legend_above(figure, axes[0])
        return svg_of(figure)


def budget(plan: Plan) -> str:
    """Expanded uncertainty against the number of poses, with what no set can go below."""
    curve, k = plan.curve, plan.scenario.plan.coverage
    scale, unit = curve_unit(plan)
    m = len(plan.places)
    with drawing(1, 1, height=2.75) as (figure, (ax,)):
        x = curve.counts
        if np.isfinite(curve.random).any():
            random = k * curve.random * scale
            ax.plot(x, random, ":", color=SOFT, label="random sets, median", marker="^")
        ax.plot(x, k * curve.u * scale, color=DARK, marker="o", label="designed")
        if curve.shared.any():
            parts = np.sqrt(np.maximum(curve.u**2 - curve.shared**2, 0.0)), curve.shared
            for part, dashes, name in zip(parts, ("-.", "-"), PARTS, strict=True):
                ax.plot(x, k * part * scale, dashes, color=SOFT, linewidth=1.0, label=name)
        if np.isfinite(curve.bound).any():
            bound = k * curve.bound * scale
            ax.plot(x, bound, "--", color=MIDDLE, label="no set goes below")
            ax.fill_between(x, 0, bound, color="#f3ded2", linewidth=0)
        if curve.target is not None:
            target = k * curve.target * scale
            ax.axhline(target, color=INK, linewidth=0.8)
            label(
                ax, f"target {target:.3g} {unit}", (1.0, target), (-2, 3),
                xycoords=("axes fraction", "data"), ha="right",
            )  # fmt: skip
        marked_line(ax, m, f"the plan: {m}", -4, color=LIGHT, linewidth=1.2)
        ax.set_ylim(0, _top(k * scale * curve.u, k * scale * (curve.target or 0.0)))
        already = " beyond those measured already" if len(plan.measured_q) else ""
        ax.set_xlabel(f"poses{already}")
        ax.locator_params(axis="x", integer=True)
        ax.set_ylabel(f"U, {factor_words(k)} [{unit}]")
        ax.legend(loc="upper right")
        return svg_of(figure)


def _top(values: Array, target: float) -> float:
    """Upper end of the axis: the first, ill-conditioned sets would flatten all the others."""
    ordered = np.sort(values[np.isfinite(values)])
    typical = float(np.median(ordered)) if len(ordered) else 1.0
    return max(1.6 * target, min(float(ordered[-1]) * 1.05, 4.0 * typical))


def prediction(plan: Plan) -> str:
    """Left: uncertainty while poses are measured. Right: its spread over the goal."""
    k = plan.scenario.plan.coverage
    scale, unit = unit_of(plan, plan.u_worst)
    with drawing(1, 2, height=2.3) as (figure, (left, right)):
        steps = np.arange(1, len(plan.u_of_step) + 1)
        seen = np.isfinite(plan.u_of_step)
        left.plot(steps[seen], k * plan.u_of_step[seen] * scale, color=DARK, marker="o")
        if seen.any():
            left.set_ylim(0, _top(k * scale * plan.u_of_step[seen], 0.0))
        left.set_xlim(0, len(steps) + 1)
        left.set_title("while measuring, in the order of the plan")
        left.set_xlabel("identification poses measured")
        left.locator_params(axis="x", integer=True)
        left.set_ylabel(f"U over the goal [{unit}]")
        right.hist(k * plan.u * scale, bins=20, weights=plan.goal.weights, **BARS)
        right.set_ylim(0, 1.15 * right.get_ylim()[1])  # room for the two words
        for value, name in ((plan.u_mean, "RMS"), (plan.u_worst, "worst")):
            marked_line(right, k * value * scale, name, -3, color=MIDDLE, linewidth=1.2)
        right.set_title("over the goal, after all poses")
        right.set_xlabel(f"U, {factor_words(k)} [{unit}]")
        right.set_ylabel("share of the goal")
        return svg_of(figure)


def stations(plan: Plan) -> str:
    """Stations from above, the uncertainty of the best design from each beside them."""
    seen = plan.stations
    if seen is None:
        return ""
    k = plan.scenario.plan.coverage
    scale, unit = unit_of(plan, seen.u_mean[seen.best])
    u = k * seen.u_mean * scale
    order = np.argsort(np.where(np.isfinite(u), u, np.inf), kind="stable")
    with drawing(1, 2, height=2.6) as (figure, (left, right)):
        dots(left, plan.pool.T[:, :2, 3] * MM)
        left.plot(0, 0, "s", color=INK, markersize=5)
        label(left, "robot", (0, 0), (4, 4), size=7)
        for number, place in enumerate(seen.stations):
            good = number == seen.best
            blind = not np.isfinite(u[number])
            look = "x" if blind else "o"
            left.plot(*place[:2] * MM, look, color=MIDDLE if good else SOFT if blind else DARK)
            label(left, str(number + 1), tuple(place[:2] * MM), (4, 2), size=7)
        view_of(left, 0, 1, "stations from above, base frame")
        shown = [int(n) for n in order if np.isfinite(u[n])][:16]
        colors = [MIDDLE if n == seen.best else DARK for n in shown]
        right.barh(range(len(shown)), u[shown], color=colors, height=0.65)
        right.set_yticks(range(len(shown)), [f"{n + 1}" for n in shown])
        right.invert_yaxis()
        right.set_xlabel(f"U over the goal, {factor_words(k)} [{unit}]")
        right.set_ylabel("station")
        right.grid(axis="y", visible=False)
        return svg_of(figure)


def _mark(ax: "Axes", points: Array, marker: str, color: str, label: str) -> None:
    """Points (m, 2) with one marker."""
    if len(points):
        ax.plot(points[:, 0], points[:, 1], marker, color=color, markersize=4, label=label,
                markeredgecolor="white", markeredgewidth=0.5)  # fmt: skip


def shade_range(plan: Plan) -> tuple[str, str]:
    """Leverages where the shades begin and end, for the caption."""
    low, high = np.quantile(plan.leverage, OUTERMOST)
    return significant(float(low)), significant(float(high))
