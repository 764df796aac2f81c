"""The tables of the re-examination: the ratio apart, like for like, what u_best holds, 1 to 3."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from testbed.report.intervals import change, plus_minus, printed_change, share, within
from testbed.report.page import Table
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.records import ESTIMATORS, PoolSets, Reexamined
from testbed.studies.wen2022.summary import (
    PRINTED,
    Errors,
    Held,
    Predicted,
    Split,
    over,
    paper_rows,
)
from testbed.units import DEG, MM, counted, fixed

ESTIMATOR_NAMES = {"paper": "paper", "whitened": "noise weighed"}


def of_columns(caption: str, columns: Mapping[str, Sequence[str]], **rest: Any) -> Table:
    """A table of columns, each under its head."""
    return Table(caption, tuple(columns), tuple(zip(*columns.values(), strict=True)), **rest)


def split_table(found: tuple[Split, ...], robots: int) -> Table:
    """The ratio of the protocol taken apart, printed and ours."""
    ours = [split.who != PRINTED for split in found]
    geometric = [[fixed(part, 2) for part in split.geometric] for split in found]
    columns = {
        "": [f"{s.who} robots" if own else s.who for s, own in zip(found, ours, strict=True)],
        "optimal set": [
            f"{s.trial} ({s.poses} poses)" if own else ""
            for s, own in zip(found, ours, strict=True)
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
        f"The ratio taken apart: Table 3 and the same protocol on {robots} robots of each kind",
        columns,
        align="llrrrrrrrrr",
        size="small",
        strong=(0,),
        note="Means over the 24 numbers, ± half of the 95 % interval over pools and robots. u "
        "best: repeats of the optimal set alone; u random: repeats of 50 random poses (u_r), "
        "number of poses (u_p) and their place (u_w). Shares are those of the variance of u "
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
        align="lrrrrrr",
        note="From measurement noise alone, by linear propagation at the nominal robot, so it is "
        "the same for every kind of robot. ± half of the 95 % interval over pools. paper: the "
        "paper's unweighted rows; noise weighed: rows whitened by their covariance. Rows with "
        "different numbers of poses compare a set with the paper's 50 random poses.",
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
        "stated u of |P| mm": [fixed(one.u.value * MM, 4) for one in found],
        "mean error mm": [within(one.error) for one in found],
        "|P| in 1.96 u": [share(one.shares[0]) for one in found],
        "point in 1.96 u": [share(one.shares[1]) for one in found],
        "in region of u best": [share(one.shares[2]) for one in found],
        "in region of the fit": [share(one.shares[3]) for one in found],
        "numbers in 1.96 u": [share(one.numbers) for one in found],
    }
    return of_columns(
        "What 95 % statements hold of the truth at the held-out poses",
        columns,
        align="llrrrrrrr",
        size="small",
        note="The first three statements are made from u best with independent numbers, as in the "
        "paper: about the distance of the tool point to the base; the same figure read as an "
        "uncertainty of the point; the 95 % ellipsoid. region of the fit: 95 % ellipsoid from the "
        "full covariance of the fit with weighed noise, the same 24 numbers. ± half of the 95 % "
        "interval over pools and robots.",
    )


def set_tables(studies: tuple[Reexamined, ...], sets: PoolSets) -> tuple[Table, ...]:
    """Tables 1 and 2 as printed beside every kind of robots; none unless all four were played."""
    played = [rows for study in studies if (rows := paper_rows(study, sets)) is not None]
    if len(played) < len(studies):
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
    for study, rows in zip(studies, played, strict=True):
        head = f"{study.truth} robots"
        own[head] = [f"{within(row.own_before)} to {within(row.own_after)}" for row in rows]
        before = over(study.before, study.pool)
        after[head] = [within(error) for error in (*(row.after for row in rows), before)]
    return (
        of_columns(
            "Table 1: mean position error on the calibration poses, before to after [mm], paper's "
            "estimator",
            own,
            align="lr" + "r" * len(studies),
        ),
        of_columns(
            "Table 2: mean position error on the held-out poses after calibration [mm], paper's "
            "estimator",
            after,
            align="lrr" + "r" * len(studies),
            note="Our errors are against the noise-free truth, those printed against what was "
            "measured. The optimal sets of the kinds of robots are the same.",
        ),
    )


def parameter_table(studies: tuple[Reexamined, ...], names: tuple[str, ...]) -> Table:
    """Table 3 beside every kind of robots, first optimal set."""
    parts = [(study.u_best[0], study.u_r, study.u_p, study.u_w) for study in studies]
    kinds = [[np.sqrt(np.mean(part**2, axis=0)) for part in one] for one in parts]
    ratios = [(study.u_best[0] / study.u_rand).mean(axis=0) for study in studies]
    rows = []
    for k, name in enumerate(names):
        row = next(one for one in paper.TABLE3 if one.name == name)
        scale = MM if row.is_length else DEG
        cells = [
            " / ".join([fixed(getattr(row, column), 4), *(fixed(u[k] * scale, 4) for u in ours)])
            for column, *ours in zip(paper.PARTS, *kinds, strict=True)
        ]
        ratio = " / ".join([fixed(row.ratio, 2), *(fixed(float(one[k]), 2) for one in ratios)])
        rows.append((name, "mm" if row.is_length else "deg", *cells, ratio))
    means = [fixed(float(one.mean()), 2) for one in ratios]
    mean = " / ".join([fixed(paper.PARAMETER_RATIO, 2), *means])
    rows.append(("mean", "", *[""] * 4, mean))
    order = " / ".join([PRINTED, *(study.truth for study in studies)])
    return Table(
        caption=f"Table 3: {order}; optimal set {studies[0].best[0]}",
        head=("", "unit", "u_r best", "u_r random", "u_p", "u_w", "ratio"),
        rows=tuple(rows),
        align="llrrrrr",
        size="small",
        strong=(len(rows) - 1,),
        note=f"Root mean square over {counted(studies[0].before.size, 'robot')} of each kind; the "
        "ratio u best / u random is the mean over robots. Repeats hardly see the kind of robot; "
        "number and place of the poses do.",
    )
