"""Claims 12 to 16 over many robots and pools, each figure with its 95 % interval.

The paper measured one robot. Claims are judged on the kind of robots whose error after calibration
is nearest to the printed one; results on the other kinds follow it.
"""

from collections.abc import Callable, Iterable

import numpy as np

from testbed.studies.over_robots import change, plus_minus, printed_change, share, signed, within
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.finding import Finding, NotPlayedError, Verdict, graded, played
from testbed.studies.wen2022.ratio import Split, over, printed_split
from testbed.studies.wen2022.records import STATEMENTS, Reexamined
from testbed.studies.wen2022.summary import Errors, PaperRow, Reexamination, first_of, of_kind
from testbed.units import MM, NARROW, Mean, fixed

LEVEL = 0.95
SLACK = 0.05
"""How far a share of points may be below the stated level and still count as reaching it."""
NEAR = 1.5
"""Factor on the printed ratio up to which a ratio counts as equal to it."""


def own_errors(again: Reexamination) -> Finding:
    """Claim 12: Table 1."""
    study = again.judged
    rows = played(again.paper_rows(study) or None)
    places = [row.place for row in rows]
    before, after = study.own_before[places], study.own_after[places]
    reduced = bool((after < 0.5 * before).all())
    worse = over(np.log(after[0] / after[1]), study.pool)
    lower = over(np.log(before[2] / before[3]), study.pool)
    pattern = worse.low > 0 and lower.high < 0
    cut = before / after
    return Finding(
        graded(reduced and pattern, reduced),
        "; ".join(f"{within(r.own_before)} to {within(r.own_after)}" for r in rows) + " mm",
        f"{where(study)}: calibration cuts the error on its own poses {fixed(float(cut.min()), 1)} "
        f"to {fixed(float(cut.max()), 1)} times. Against random the error there is "
        f"{change(worse)} with the O1 set, and before calibration {change(lower)} with the O2 set "
        "(printed "
        f"{printed_change(rows[0].printed.after_mm, rows[1].printed.after_mm)} and "
        f"{printed_change(rows[2].printed.before_mm, rows[3].printed.before_mm)}). Errors at "
        "poses that were fitted do not show how good a calibration is.",
    )


def held_out_errors(again: Reexamination) -> Finding:
    """Claim 13: Table 2."""
    study = again.judged
    rows = played(again.paper_rows(study) or None)
    printed = [paper.SETS[k].held_out_mm / paper.SETS[k + 1].held_out_mm for k in (0, 2)]
    ratios = table2_ratios(study, rows)
    half = [np.log((1 + one) / 2) for one in printed]
    shown = [r.high < 0 and r.value <= bound for r, bound in zip(ratios, half, strict=True)]
    refuted = [r.low > bound for r, bound in zip(ratios, half, strict=True)]
    contrast = elsewhere(again, lambda kind: map(change, table2_ratios(kind, rows)))
    return Finding(
        decided(shown, refuted),
        f"{within(over(study.before, study.pool))} before; "
        f"{', '.join(within(row.after) for row in rows)} mm after",
        f"{where(study)}: the error of the optimal set is {change(ratios[0])} against random at "
        f"{rows[0].printed.poses} poses and {change(ratios[1])} at {rows[2].printed.poses}; "
        f"the paper prints {' and '.join(signed(one - 1) for one in printed)}"
        + added(contrast)
        + ".",
    )


def table2_ratios(study: Reexamined, rows: tuple[PaperRow, ...]) -> list[Mean]:
    """Logarithms of optimal over random held-out error, O1 then O2."""
    error = study.error[[row.place for row in rows], 0]
    return [over(np.log(error[k] / error[k + 1]), study.pool) for k in (0, 2)]


def parameter_ratio(again: Reexamination) -> Finding:
    """Claim 14: mean ratio of parameter uncertainties, and its parts."""
    study, printed = again.judged, printed_split()
    judged = first_of(of_kind(again.splits, study), again.paper_set)
    # Table 3 is about one set; the others are listed beside it
    ratio, near = judged[0].ratio, NEAR * printed.ratio.value
    contrast = elsewhere(
        again,
        lambda kind: (
            plus_minus(split.ratio)
            for split in first_of(of_kind(again.splits, kind), again.paper_set)
        ),
    )
    return Finding(
        decided([ratio.high <= near], [ratio.low > near]),
        f"mean ratio {each_of(judged, 'ratio', ', ')}",
        f"{where(study)}: the paper's own protocol gives {each_of(judged, 'ratio')}. Repeats "
        f"against repeats give {each_of(judged, 'repeats')} (printed "
        f"{fixed(printed.repeats.value, 2)}); the rest arises because only the random side counts "
        f"the number and the place of the poses: repeats are {share(judged[0].shares[0])} of its "
        f"variance (printed {share(printed.shares[0])})" + added(contrast) + ".",
    )


def like_for_like(again: Reexamination) -> Finding:
    """Claim 15: designed against random sets of the same size, predicted and true."""
    study = again.judged
    predicted = {(one.trial, one.estimator, one.against): one for one in again.predictions}
    judged = [
        (one, predicted[one.trial, one.estimator, one.poses]) for one in weighed(again, study)
    ]
    if not judged:
        raise NotPlayedError
    shown = [noise.numbers.high < 1 and one.ratio.high < 0 for one, noise in judged]
    refuted = [noise.numbers.low >= 1 or one.ratio.low >= 0 for one, noise in judged]
    parts = [
        f"{noise.poses} poses by {one.trial}: u {plus_minus(noise.numbers)} of random, true error "
        f"{change(one.ratio)}"
        for one, noise in judged
    ]
    contrast = elsewhere(again, lambda kind: (change(one.ratio) for one in weighed(again, kind)))
    return Finding(
        decided(shown, refuted),
        "u ratio " + ", ".join(plus_minus(noise.numbers) for _, noise in judged),
        f"{where(study)}, for sets of one size: {'; '.join(parts)}"
        + (f" (the error {', '.join(contrast)})" if contrast else "")
        + ". A tenth cannot be reached: the same noise acts on the same number of poses.",
    )


def weighed(again: Reexamination, kind: Reexamined) -> list[Errors]:
    """Comparisons of the paper's sets on one kind of robots, by the whitened estimator."""
    found = of_kind(again.errors, kind)
    return [one for one in found if one.by_paper and one.estimator == "whitened"]


def stated(again: Reexamination) -> Finding:
    """Claim 16: whether 95 % statements made from u_best contain the truth."""
    study, found = again.judged, first_of(again.statements, again.paper_set)
    judged = of_kind(found, study)
    distance, point, unweighted = map(STATEMENTS.index, ("distance", "point", "unweighted"))
    # the printed figure is about the set of Table 3 and the robot, so the tool point decides; if it
    # is inside, its distance is too
    said = judged[0].shares[point]
    contrast = elsewhere(
        again,
        lambda kind: (share(one.shares[point]) for one in of_kind(found, kind)),
        "the point lies there at ",
    )
    return Finding(
        decided([kept(said)], [said.high < LEVEL]),
        f"{', '.join(share(one.shares[point]) for one in judged)} inside instead of 95{NARROW}%",
        f"{where(study)}: by repeats (type A, as the paper states it) the true tool point lies "
        "within t u of |P| (Student's t) at "
        + " and ".join(f"{share(one.shares[point])} ({one.trial})" for one in judged)
        + f" of the held-out poses, its distance alone at "
        f"{' and '.join(share(one.shares[distance]) for one in judged)}; the stated u are "
        f"{' and '.join(fixed(one.u.value * MM, 4) for one in judged)} mm, the mean errors "
        f"{' and '.join(fixed(one.error.value * MM, 3) for one in judged)} mm"
        + added(contrast)
        + ". Repeats do not show what the model lacks. Not in the paper: the region by the "
        "covariance of the unweighted fit contains the point at "
        + " and ".join(share(one.shares[unweighted]) for one in judged)
        + ".",
    )


def decided(shown: list[bool], refuted: list[bool]) -> Verdict:
    """Holds if shown for every set, does not if refuted for every set, and is in part otherwise."""
    return graded(all(shown), not all(refuted))


def kept(part: Mean) -> bool:
    """Whether a share agrees with the stated level within its interval and `SLACK`."""
    return part.high >= LEVEL and part.value >= LEVEL - SLACK


def where(study: Reexamined) -> str:
    """The robots and pools behind a sentence."""
    pools = int(study.pool.max()) + 1
    return f"Over {study.before.size} {study.truth} robots" + (
        f" and {pools} pools" if pools > 1 else ""
    )


def each_of(found: list[Split], name: str, joint: str = " and ") -> str:
    """One figure for each optimal set, with the set's name."""
    return joint.join(f"{plus_minus(getattr(one, name))} ({one.trial})" for one in found)


def elsewhere(
    again: Reexamination, figures: Callable[[Reexamined], Iterable[str]], said: str = ""
) -> list[str]:
    """Figures of the optimal sets on the other kinds of robots."""
    return [f"on {kind.truth} robots {said}{' and '.join(figures(kind))}" for kind in again.others]


def added(contrast: Iterable[str]) -> str:
    """Clauses on other kinds of robots, to follow a sentence."""
    return "".join(f"; {said}" for said in contrast)
