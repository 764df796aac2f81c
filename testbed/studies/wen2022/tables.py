"""The tables of the re-examination: the ratio apart, like for like, what u_best holds, 1 to 3."""

import numpy as np

from calib.arrays import Array
from testbed.report.intervals import change, plus_minus, printed_change, share, within
from testbed.report.page import Table
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.claims_many_robots import paper_rows
from testbed.studies.wen2022.records import ESTIMATORS, PoolSets, Reexamined
from testbed.studies.wen2022.summary import (
    PRINTED,
    Errors,
    Held,
    Predicted,
    Split,
    over,
    rms_over_robots,
)
from testbed.units import DEG, MM, counted, fixed

ESTIMATOR_NAMES = {"paper": "paper", "whitened": "noise weighed"}


def split_table(found: tuple[Split, ...], robots: int) -> Table:
    """The ratio of the protocol taken apart, printed and ours."""
    rows = tuple(
        (
            split.who if split.who == PRINTED else f"{split.who} robots",
            "" if split.who == PRINTED else f"{split.trial} ({split.poses} poses)",
            plus_minus(split.ratio),
            plus_minus(split.repeats),
            plus_minus(split.counted),
            f"{fixed(split.geometric[1], 2)} × {fixed(split.geometric[2], 2)} = "
            f"{fixed(split.geometric[0], 2)}",
            *(share(part) for part in split.shares),
            plus_minus(split.p_over_r),
            plus_minus(split.w_over_r),
        )
        for split in found
    )
    return Table(
        caption=f"The ratio taken apart: Table 3 and the same protocol on {robots} robots of each "
        "kind",
        head=(
            "",
            "optimal set",
            "u best / u random",
            "u_r best / u_r random",
            "u_r / u random",
            "geometric",
            "share of u_r",
            "of u_p",
            "of u_w",
            "u_p / u_r",
            "u_w / u_r",
        ),
        rows=rows,
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
    keys = list(dict.fromkeys((one.trial, one.poses, one.against) for one in found))
    rows = []
    for trial, poses, against in keys:
        of = {
            one.estimator: one
            for one in found
            if (one.trial, one.poses, one.against) == (trial, poses, against)
        }
        cells = [
            plus_minus(getattr(of[estimator], figure))
            for figure in ("numbers", "tool")
            for estimator in ESTIMATORS
        ]
        rows.append((trial, str(poses), str(against), *cells))
    return Table(
        caption="Like for like, predicted: standard uncertainty of a designed set over that of "
        "random sets",
        head=(
            *("set", "poses", "random poses"),
            *("numbers, paper", "numbers, noise weighed", "tool, paper", "tool, noise weighed"),
        ),
        rows=tuple(rows),
        align="lrrrrrr",
        note="From measurement noise alone, by linear propagation at the nominal robot, so it is "
        "the same for every kind of robot. ± half of the 95 % interval over pools. paper: the "
        "paper's unweighted rows; noise weighed: rows whitened by their covariance. Rows with "
        "different numbers of poses compare a set with the paper's 50 random poses.",
    )


def error_table(found: tuple[Errors, ...]) -> Table:
    """True held-out error of designed sets against random ones of their size."""
    rows = tuple(
        (
            one.truth,
            one.trial,
            str(one.poses),
            ESTIMATOR_NAMES[one.estimator],
            within(one.error),
            within(one.other),
            change(one.ratio),
            one.outcome,
        )
        for one in found
    )
    return Table(
        caption="Like for like, true: mean held-out error of a designed set and of random sets of "
        "its size",
        head=(
            *("robots", "set", "poses", "estimator", "designed mm", "random mm"),
            *("designed / random − 1", "with all others"),
        ),
        rows=rows,
        align="llrlrrrl",
        size="small",
        note="± half of the 95 % interval, over pools and robots; the ratio is the geometric mean "
        f"over pairs on the same robot. with all others: by intervals that hold for all "
        f"{len(found)} comparisons at once.",
    )


def held_table(found: tuple[Held, ...]) -> Table:
    """What 95 % statements made from u_best hold."""
    rows = tuple(
        (
            one.truth,
            one.trial,
            f"{fixed(one.u.value * MM, 4)}",
            within(one.error),
            *(share(part) for part in one.shares),
            share(one.numbers),
        )
        for one in found
    )
    return Table(
        caption="What 95 % statements hold of the truth at the held-out poses",
        head=(
            *("robots", "set", "stated u of |P| mm", "mean error mm", "|P| in 1.96 u"),
            *("point in 1.96 u", "in region of u best", "in region of the fit"),
            "numbers in 1.96 u",
        ),
        rows=rows,
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
    first, second = [], []
    played = [paper_rows(study, sets) for study in studies]
    if any(rows is None for rows in played):
        return ()
    known = [rows for rows in played if rows is not None]
    for k, (one, two) in enumerate(zip(paper.TABLE1, paper.TABLE2, strict=True)):
        kind = f"{one.poses} {'optimal (' + one.index + ')' if one.optimal else 'random'}"
        own = [f"{within(rows[k].own_before)} to {within(rows[k].own_after)}" for rows in known]
        printed = f"{fixed(one.before_mm, 3)} to {fixed(one.after_mm, 3)}"
        first.append((kind, printed, *own))
        gain = printed_change(two.after_mm, paper.TABLE2[k + 1].after_mm) if two.optimal else ""
        after = [within(rows[k].after) for rows in known]
        second.append((kind, fixed(two.after_mm, 3), gain, *after))
    before = [within(over(study.before, study.pool)) for study in studies]
    second.append(("before", fixed(paper.TABLE2_BEFORE_MM, 3), "", *before))
    truths = [f"{study.truth} robots" for study in studies]
    return (
        Table(
            "Table 1: mean position error on the calibration poses, before to after [mm], paper's "
            "estimator",
            ("poses", "printed", *truths),
            tuple(first),
            "lr" + "r" * len(truths),
        ),
        Table(
            "Table 2: mean position error on the held-out poses after calibration [mm], paper's "
            "estimator",
            ("poses", "printed", "against random", *truths),
            tuple(second),
            "lrr" + "r" * len(truths),
            note="Our errors are against the noise-free truth, those printed against what was "
            "measured. The optimal sets of the kinds of robots are the same.",
        ),
    )


def parameter_table(studies: tuple[Reexamined, ...], names: tuple[str, ...]) -> Table:
    """Table 3 beside every kind of robots, first optimal set."""
    columns = [
        [rms_over_robots(part) for part in (study.u_best[0], study.u_r, study.u_p, study.u_w)]
        for study in studies
    ]
    ratios = [ratio_of(study) for study in studies]
    rows = []
    for k, name in enumerate(names):
        row = next(one for one in paper.TABLE3 if one.name == name)
        scale = MM if row.is_length else DEG
        printed = (row.u_r_best, row.u_r_random, row.u_p_random, row.u_w_random)
        cells = [
            " / ".join([fixed(said, 4), *(fixed(kind[j][k] * scale, 4) for kind in columns)])
            for j, said in enumerate(printed)
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


def ratio_of(study: Reexamined) -> Array:
    """u_best / u_rand (f,) of the first optimal set, mean over robots."""
    random = np.sqrt(study.u_r**2 + study.u_p**2 + study.u_w**2)
    return np.asarray((study.u_best[0] / random).mean(axis=0))
