"""Tables of the re-examination: ratio, sets of equal size, shares inside u_best, Tables 1 to 3."""

from collections.abc import Mapping, Sequence
from typing import Any

from testbed.report.page import Table
from testbed.studies.over_robots import change, plus_minus, printed_change, share, within
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.ratio import PRINTED, over, printed_split
from testbed.studies.wen2022.records import ESTIMATORS
from testbed.studies.wen2022.summary import Errors, Held, Predicted, Reexamination
from testbed.units import MM, fixed

ESTIMATOR_NAMES = {"paper": "paper", "whitened": "noise weighed"}


def of_columns(caption: str, columns: Mapping[str, Sequence[str]], **rest: Any) -> Table:
    """A table of columns, each under its head."""
    return Table(caption, tuple(columns), tuple(zip(*columns.values(), strict=True)), **rest)


def split_table(again: Reexamination) -> Table:
    """The ratio of the protocol split into parts, printed and ours."""
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
        f"The ratio split into parts: Table 3 and the same protocol on {again.robots} robots of "
        "each kind",
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
    """Uncertainty from noise alone of designed sets relative to random ones."""
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
        on_paper=0,
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
        on_paper=0,
        note="± half of the 95 % interval, over pools and robots; the ratio is the geometric mean "
        f"over pairs on the same robot. with all others: by intervals that hold for all "
        f"{len(found)} comparisons at once.",
    )


def held_table(found: tuple[Held, ...]) -> Table:
    """How often 95 % statements from u_best contain the truth."""
    columns = {
        "robots": [one.truth for one in found],
        "set": [one.trial for one in found],
        "type A: u of |P| mm": [fixed(one.u.value * MM, 4) for one in found],
        "mean error mm": [within(one.error) for one in found],
        "type A: |P| in t u": [share(one.shares[0]) for one in found],
        "type A: point in t u": [share(one.shares[1]) for one in found],
        "type A: numbers in t u": [share(one.numbers) for one in found],
        "unweighted fit: point in region": [share(one.shares[2]) for one in found],
        "weighted fit: point in region": [share(one.shares[3]) for one in found],
    }
    return of_columns(
        "How often 95 % statements contain the truth at the held-out poses",
        columns,
        align="llrrrrrrrr",
        size="small",
        note="type A: what the paper states, the scatter of repeated calibrations with independent "
        "numbers: of the distance of the tool point to the base; the same figure read as an "
        "uncertainty of the point; the numbers themselves. t: Student's factor, of as many "
        "degrees of freedom as repeats less one. fit: not in the paper, "
        "the 95 % ellipsoid by the full covariance of a "
        "fit: unweighted rows with s² = RSS / (12 m − 24), and rows weighted by "
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
            size="small",
        ),
        of_columns(
            "Table 2: mean position error on the held-out poses after calibration [mm], paper's "
            "estimator",
            after,
            size="small",
            note="Our errors are against the noise-free truth, those printed against what was "
            "measured. The optimal sets of the kinds of robots are the same.",
        ),
    )


def interval_mm(ends: tuple[float, float]) -> str:
    """Two lengths [m] in mm, as the paper prints its ranges."""
    return f"{fixed(ends[0] * MM, 4)} to {fixed(ends[1] * MM, 4)}"
