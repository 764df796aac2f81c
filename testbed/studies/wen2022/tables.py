"""The tables of the re-examination: the ratio apart, like for like, what u_best holds, 1 to 3."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from calib.arrays import Array
from testbed.report.page import Table, heads
from testbed.studies.many_robots import change, plus_minus, printed_change, share, within
from testbed.studies.trial.report_accuracy import NONE
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.cloud.draws import (
    CONFIDENCE,
    Cloud,
    mean_half_width,
    predicted_band,
    ranges_of,
)
from testbed.studies.wen2022.ratio import PRINTED, combined, over, printed_split
from testbed.studies.wen2022.records import ESTIMATORS
from testbed.studies.wen2022.summary import Errors, Held, Predicted, Reexamination
from testbed.units import DEG, MM, NARROW, counted, fixed, unit_of

ESTIMATOR_NAMES = {"paper": "paper", "whitened": "noise weighed"}
HEADS = dict(
    zip(paper.COLUMNS[1:7], heads("u_r best, u_r random, u_p, u_w, u best, u random"), strict=True)
)
"""Of the columns of Table 3."""


def of_columns(caption: str, columns: Mapping[str, Sequence[str]], **rest: Any) -> Table:
    """A table of columns, each under its head."""
    return Table(caption, tuple(columns), tuple(zip(*columns.values(), strict=True)), **rest)


def split_table(again: Reexamination) -> Table:
    """The ratio of the protocol taken apart, printed and ours."""
    found = (printed_split(), *again.splits)
    geometric = [[fixed(part, 2) for part in split.geometric] for split in found]
    columns = {
        "": [s.truth if s.truth == PRINTED else f"{s.truth} robots" for s in found],
        "optimal set": [
            "" if s.truth == PRINTED else f"{s.trial} ({s.poses} poses)" for s in found
        ],
        "u best / u random": [plus_minus(split.ratio) for split in found],
        "u_r best / u_r random": [plus_minus(split.repeats) for split in found],
        "u_r / u random": [plus_minus(split.counted) for split in found],
        "geometric": [f"{one} × {other} = {whole}" for whole, one, other in geometric],
        "share of u_r": [share(split.shares[0]) for split in found],
        "of u_p": [share(split.shares[1]) for split in found],
        "of u_w": [share(split.shares[2]) for split in found],
        "u_p / u_r": [plus_minus(split.p_over_r) for split in found],
        "u_w / u_r": [plus_minus(split.w_over_r) for split in found],
    }
    return of_columns(
        f"The ratio taken apart: Table 3 and the same protocol on {again.robots} robots of each "
        "kind",
        columns,
        align="llrrrrrrrrr",
        size="small",
        strong=(0,),
        note="Means over the 24 numbers, ± half of the 95 % interval over pools and robots. u "
        f"best: repeats of the optimal set alone; u random: repeats of {again.budget.poses} random "
        "poses (u_r), number of poses (u_p) and their place (u_w). Shares are of the variance of u "
        "random. geometric: with geometric means the ratio is exactly the product of its two "
        "parts.",
    )


def predicted_table(found: tuple[Predicted, ...]) -> Table:
    """What noise alone makes of designed sets against random ones."""
    first = [one for one in found if one.estimator == ESTIMATORS[0]]
    columns: dict[str, list[str]] = {
        "set": [one.trial for one in first],
        "poses": [str(one.poses) for one in first],
        "random poses": [str(one.against) for one in first],
    }
    for figure in ("numbers", "tool"):
        for mode, name in ESTIMATOR_NAMES.items():
            cells = [plus_minus(getattr(one, figure)) for one in found if one.estimator == mode]
            columns[f"{figure}, {name}"] = cells
    return of_columns(
        "Like for like, predicted: standard uncertainty of a designed set over that of random sets",
        columns,
        note="From measurement noise alone, by linear propagation at the nominal robot, so it is "
        "the same for every kind of robot. ± half of the 95 % interval over pools. paper: the "
        "paper's unweighted rows; noise weighed: rows whitened by their covariance. Rows with "
        "different numbers of poses compare a set with the random poses of the paper's budget.",
    )


def error_table(found: tuple[Errors, ...]) -> Table:
    """True held-out error of designed sets against random ones of their size."""
    columns: dict[str, list[str]] = {
        "robots": [one.truth for one in found],
        "set": [one.trial for one in found],
        "poses": [str(one.poses) for one in found],
        "estimator": [ESTIMATOR_NAMES[one.estimator] for one in found],
        "designed mm": [within(one.error) for one in found],
        "random mm": [within(one.other) for one in found],
        "designed / random − 1": [change(one.ratio) for one in found],
        "with all others": [one.outcome for one in found],
    }
    return of_columns(
        "Like for like, true: mean held-out error of a designed set and of random sets of its size",
        columns,
        align="llrlrrrl",
        size="small",
        note="± half of the 95 % interval, over pools and robots; the ratio is the geometric mean "
        f"over pairs on the same robot. with all others: by intervals that hold for all "
        f"{len(found)} comparisons at once.",
    )


def held_table(found: tuple[Held, ...]) -> Table:
    """What 95 % statements made from u_best hold."""
    columns = {
        "robots": [one.truth for one in found],
        "set": [one.trial for one in found],
        "type A: u of |P| mm": [fixed(one.u.value * MM, 4) for one in found],
        "mean error mm": [within(one.error) for one in found],
        "type A: |P| in 1.96 u": [share(one.shares[0]) for one in found],
        "type A: point in 1.96 u": [share(one.shares[1]) for one in found],
        "type A: point in region": [share(one.shares[2]) for one in found],
        "type A: numbers in 1.96 u": [share(one.numbers) for one in found],
        "unweighted fit: point in region": [share(one.shares[3]) for one in found],
        "weighted fit: point in region": [share(one.shares[4]) for one in found],
    }
    return of_columns(
        "What 95 % statements hold of the truth at the held-out poses",
        columns,
        align="llrrrrrrrr",
        size="small",
        note="type A: what the paper states, the scatter of repeated calibrations with independent "
        "numbers: of the distance of the tool point to the base; the same figure read as an "
        "uncertainty of the point; the 95 % ellipsoid; the numbers themselves. fit: what the paper "
        "does not state and we judge beside it, the 95 % ellipsoid from the full covariance that a "
        "fit claims of itself: unweighted rows with s² = RSS / (12 m − 24), and rows weighted by "
        "their noise; the same 24 numbers. ± half of the 95 % interval over pools and robots.",
    )


def set_tables(again: Reexamination) -> tuple[Table, ...]:
    """Tables 1 and 2 as printed beside every kind of robots; none unless all four were played."""
    if not again.paper_rows(again.judged):
        return ()
    kinds = [printed.kind for printed in paper.SETS]
    held_out = [printed.held_out_mm for printed in paper.SETS]
    own = {
        "poses": kinds,
        "printed": [f"{fixed(r.before_mm, 3)} to {fixed(r.after_mm, 3)}" for r in paper.SETS],
    }
    first, second = (printed_change(*held_out[k : k + 2]) for k in (0, 2))
    after = {
        "poses": [*kinds, "before"],
        "printed": [fixed(mm, 3) for mm in (*held_out, paper.TABLE2_BEFORE_MM)],
        "against random": [first, "", second, "", ""],
    }
    for kind in again.kinds:
        head, rows = f"{kind.truth} robots", again.paper_rows(kind)
        own[head] = [f"{within(row.own_before)} to {within(row.own_after)}" for row in rows]
        before = over(kind.before, kind.pool)
        after[head] = [within(error) for error in (*(row.after for row in rows), before)]
    return (
        of_columns(
            "Table 1: mean position error on the calibration poses, before to after [mm], paper's "
            "estimator",
            own,
        ),
        of_columns(
            "Table 2: mean position error on the held-out poses after calibration [mm], paper's "
            "estimator",
            after,
            note="Our errors are against the noise-free truth, those printed against what was "
            "measured. The optimal sets of the kinds of robots are the same.",
        ),
    )


def table3(
    caption: str,
    note: str,
    names: tuple[str, ...],
    ours: Mapping[paper.Column, Sequence[Array]],
    ratios: Sequence[Array],
) -> Table:
    """Table 3 as printed beside ours (f,), one or several, of each of `names` [m or rad]."""

    def cell(column: paper.Column, places: int, name: str, values: Iterable[float]) -> str:
        """The printed figure before ours."""
        row = paper.TABLE3.get(name)
        said = NONE if row is None else fixed(row[paper.COLUMNS.index(column)], places)
        return " / ".join([said, *(fixed(float(value), places) for value in values)])

    rows = []
    for k, name in enumerate(names):
        length = paper.is_length(name)
        scale = MM if length else DEG
        cells = [cell(column, 4, name, [u[k] * scale for u in us]) for column, us in ours.items()]
        ratio = cell("ratio", 2, name, [one[k] for one in ratios])
        rows.append((name, unit_of(length), *cells, ratio))
    means = [fixed(paper.PARAMETER_RATIO, 2), *(fixed(float(one.mean()), 2) for one in ratios)]
    rows.append(("mean", "", *[""] * len(ours), " / ".join(means)))
    return Table(
        caption=caption,
        head=("", "unit", *(HEADS[column] for column in ours), "ratio"),
        rows=tuple(rows),
        align="ll" + "r" * (len(ours) + 1),
        size="small",
        strong=(len(rows) - 1,),
        note=note,
    )


def parameter_table(again: Reexamination) -> Table:
    """Table 3 beside every kind of robots, with the set that stands for the paper's."""
    best = [kind.u_best[kind.best.index(again.paper_set)] for kind in again.kinds]
    parts = [(u, kind.u_r, kind.u_p, kind.u_w) for u, kind in zip(best, again.kinds, strict=True)]
    ours = [[np.sqrt(np.mean(part**2, axis=0)) for part in one] for one in parts]
    order = " / ".join([PRINTED, *(kind.truth for kind in again.kinds)])
    return table3(
        f"Table 3: {order}; optimal set {again.paper_set}",
        f"Root mean square over {counted(again.robots, 'robot')} of each kind; the "
        "ratio u best / u random is the mean over robots. Repeats hardly see the kind of robot; "
        "number and place of the poses do.",
        again.sets.names,
        dict(zip(paper.PARTS, zip(*ours, strict=True), strict=True)),
        [
            (combined(again.u_c, u) / combined(again.u_c, *random)).mean(axis=0)
            for u, *random in parts
        ],
    )


def range_table(clouds: Mapping[str, Sequence[Cloud]]) -> Table:
    """Ranges of the tool point at the zero pose, printed and drawn, beside what M draws reach."""
    found, best = ranges_of(clouds), next(iter(clouds.values()))[0]
    draws, printed = len(best.points), any(one.printed for one in found)
    expected, (low, high) = mean_half_width([draws])[0], predicted_band(draws, len(found))
    columns = {
        "uncertainties from": [one.source for one in found],
        "axis": [one.axis for one in found],
        "range": ["printed" if one.printed else "drawn" for one in found],
        "smallest to largest [mm]": [interval_mm(one.ends) for one in found],
        "u, linear [mm]": [fixed(one.u * MM, 4) for one in found],
        "ends / u": [
            f"{fixed(one.ends[0] / one.u, 2)}, {fixed(one.ends[1] / one.u, 2)}" for one in found
        ],
        "half / u": [fixed(one.half_width, 2) for one in found],
        "judged": ["as predicted" if one.good else "not as predicted" for one in found],
    }
    known = (
        "Of the six ranges that the paper prints, our sources hold that of x for the optimal set "
        "alone; the other five are not judged, and nothing printed stands beside ours. "
        if printed
        else ""
    )
    return of_columns(
        f"Ranges of the tool point at the zero pose over {draws} draws, from nominal",
        columns,
        align="lllrrrrl",
        size="small",
        strong=tuple(k for k, one in enumerate(found) if one.printed),
        note=f"{known}u is that of linear propagation, J diag(u²) J': no draw is in it. The range "
        f"of {draws} normal numbers has a half width of {fixed(float(expected), 2)} standard "
        f"deviations on average; all {len(found)} lie between {fixed(low, 2)} and {fixed(high, 2)} "
        f"with {100 * CONFIDENCE:g}{NARROW}% (exact distribution of the range).",
    )


def interval_mm(ends: tuple[float, float]) -> str:
    """Two lengths [m] in mm, as the paper prints its ranges."""
    return f"{fixed(ends[0] * MM, 4)} to {fixed(ends[1] * MM, 4)}"
