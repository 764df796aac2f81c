"""Claims 12 to 16 over many robots and pools, each figure with its 95 % interval.

The paper measured one robot. Judged is the kind of robots that keeps an error as large as printed
after calibration; the other kinds stand beside it.
"""

from collections.abc import Callable, Iterable

import numpy as np

from testbed.report.intervals import change, plus_minus, printed_change, share, signed, within
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022 import paper, summary
from testbed.studies.wen2022.finding import Finding, Verdict
from testbed.studies.wen2022.records import STATEMENTS, Reexamined, pools_of, reexamined_of
from testbed.studies.wen2022.summary import PaperRow, Split, like_the_paper, over, paper_rows
from testbed.units import MM, NARROW, Mean, fixed

LEVEL = 0.95
SLACK = 0.05
"""Of a share of points below the promise that still counts as kept."""
NEAR = 1.5
"""Times the printed ratio that a ratio may be and still count as it."""


def judged_kind(campaign: Campaign) -> Reexamined:
    """The kind on which the claims are judged."""
    return like_the_paper(reexamined_of(campaign))


def beside(campaign: Campaign) -> tuple[Reexamined, ...]:
    """The other kinds."""
    judged = judged_kind(campaign)
    return tuple(study for study in reexamined_of(campaign) if study is not judged)


def own_errors(campaign: Campaign) -> Finding | None:
    """Claim 12: Table 1."""
    study = judged_kind(campaign)
    rows = paper_rows(study, pools_of(campaign))
    if rows is None:
        return None
    places = [row.place for row in rows]
    before, after = study.own_before[places], study.own_after[places]
    reduced = bool((after < 0.5 * before).all())
    worse = over(np.log(after[0] / after[1]), study.pool)
    lower = over(np.log(before[2] / before[3]), study.pool)
    pattern = worse.low > 0 and lower.high < 0
    cut = before / after
    return Finding(
        12,
        "holds" if reduced and pattern else "in part" if reduced else "does not hold",
        "; ".join(f"{within(r.own_before)} to {within(r.own_after)}" for r in rows) + " mm",
        f"{where(study)}: calibration cuts the error on its own poses {fixed(float(cut.min()), 1)} "
        f"to {fixed(float(cut.max()), 1)} times. The O1 set leaves {change(worse)} there "
        f"against random, and the O2 set starts {change(lower)} (printed "
        f"{printed_change(rows[0].printed.after_mm, rows[1].printed.after_mm)} and "
        f"{printed_change(rows[2].printed.before_mm, rows[3].printed.before_mm)}). Errors at the "
        "poses that were fitted do not say how good a calibration is.",
    )


def held_out_errors(campaign: Campaign) -> Finding | None:
    """Claim 13: Table 2."""
    study = judged_kind(campaign)
    rows = paper_rows(study, pools_of(campaign))
    if rows is None:
        return None
    printed = [paper.SETS[k].held_out_mm / paper.SETS[k + 1].held_out_mm for k in (0, 2)]
    ratios = table2_ratios(study, rows)
    half = [np.log((1 + one) / 2) for one in printed]
    shown = [r.high < 0 and r.value <= bound for r, bound in zip(ratios, half, strict=True)]
    refuted = [r.low > bound for r, bound in zip(ratios, half, strict=True)]
    contrast = [on(one, map(change, table2_ratios(one, rows))) for one in beside(campaign)]
    return Finding(
        13,
        decided(shown, refuted),
        f"{within(over(study.before, study.pool))} before; "
        f"{', '.join(within(row.after) for row in rows)} mm after",
        f"{where(study)}: the error of the optimal set is {change(ratios[0])} against random at "
        f"{rows[0].printed.poses} poses and {change(ratios[1])} at {rows[2].printed.poses}; "
        f"printed are {' and '.join(signed(one - 1) for one in printed)}" + added(contrast) + ".",
    )


def table2_ratios(study: Reexamined, rows: tuple[PaperRow, ...]) -> list[Mean]:
    """Logarithms of optimal over random held-out error, O1 then O2."""
    error = study.error[[row.place for row in rows], 0]
    return [over(np.log(error[k] / error[k + 1]), study.pool) for k in (0, 2)]


def parameter_ratio(campaign: Campaign) -> Finding:
    """Claim 14: mean ratio of parameter uncertainties, and what it is made of."""
    study = judged_kind(campaign)
    found = summary.splits(reexamined_of(campaign), pools_of(campaign))
    judged = [split for split in found if split.who == study.truth]
    printed, first = summary.printed_split(), judged[0]
    shown = [split.ratio.high <= NEAR * printed.ratio.value for split in judged]
    refuted = [split.ratio.low > NEAR * printed.ratio.value for split in judged]
    contrast = [
        on(other, (plus_minus(split.ratio) for split in found if split.who == other.truth))
        for other in beside(campaign)
    ]
    return Finding(
        14,
        decided(shown, refuted),
        f"mean ratio {each_of(judged, 'ratio', ', ')}",
        f"{where(study)}: the paper's own protocol gives {each_of(judged, 'ratio')}. Repeats "
        f"against repeats give {each_of(judged, 'repeats')} (printed "
        f"{fixed(printed.repeats.value, 2)}); the rest is that only the random side counts the "
        f"number and the place of the poses: repeats are {share(first.shares[0])} of its variance "
        f"(printed {share(printed.shares[0])})" + added(contrast) + ".",
    )


def like_for_like(campaign: Campaign) -> Finding | None:
    """Claim 15: designed against random sets of the same size, predicted and true."""
    sets, study = pools_of(campaign), judged_kind(campaign)
    of_its_size = {one.trial: one.poses for one in sets.sets if summary.partner_of(sets, one)}
    noise_of = {
        (one.trial, one.estimator): one
        for one in summary.predictions(sets)
        if of_its_size.get(one.trial) == one.against
    }
    true = summary.errors(reexamined_of(campaign), sets)
    judged = [(one, noise_of[one.trial, one.estimator]) for one in true if counts(one, study.truth)]
    if not judged:
        return None
    shown = [noise.numbers.high < 1 and one.ratio.high < 0 for one, noise in judged]
    refuted = [noise.numbers.low >= 1 or one.ratio.low >= 0 for one, noise in judged]
    parts = [
        f"{noise.poses} poses by {one.trial}: u {plus_minus(noise.numbers)} of random, true error "
        f"{change(one.ratio)}"
        for one, noise in judged
    ]
    contrast = [
        on(other, (change(one.ratio) for one in true if counts(one, other.truth)))
        for other in beside(campaign)
    ]
    return Finding(
        15,
        decided(shown, refuted),
        "u ratio " + ", ".join(plus_minus(noise.numbers) for _, noise in judged),
        f"{where(study)}, like for like: {'; '.join(parts)}"
        + (f" (the error {', '.join(contrast)})" if contrast else "")
        + ". A tenth is out of reach: the same noise falls on the same number of poses.",
    )


def counts(one: summary.Errors, truth: str) -> bool:
    """Whether a comparison is about the paper's sets on one kind of robots, noise weighed."""
    return one.by_paper and one.truth == truth and one.estimator == "whitened"


def stated(campaign: Campaign) -> Finding:
    """Claim 16: whether 95 % statements made from u_best hold the truth."""
    study = judged_kind(campaign)
    found = summary.statements(reexamined_of(campaign))
    judged = [one for one in found if one.truth == study.truth]
    distance, point = (STATEMENTS.index(name) for name in ("distance", "point"))
    there = "the point lies there at "
    said = [(one.shares[distance], one.shares[point]) for one in judged]
    shown = [all(kept(part) for part in parts) for parts in said]
    refuted = [all(part.high < LEVEL for part in parts) for parts in said]
    contrast = [
        on(other, (share(one.shares[point]) for one in found if one.truth == other.truth), there)
        for other in beside(campaign)
    ]
    return Finding(
        16,
        decided(shown, refuted),
        f"{', '.join(share(one.shares[point]) for one in judged)} inside instead of 95{NARROW}%",
        f"{where(study)}: the true tool point lies within 1.96 u of |P| at "
        + " and ".join(f"{share(one.shares[point])} ({one.trial})" for one in judged)
        + f" of the held-out poses, its distance alone at "
        f"{' and '.join(share(one.shares[distance]) for one in judged)}; stated are u = "
        f"{' and '.join(fixed(one.u.value * MM, 4) for one in judged)} mm, the mean errors are "
        f"{' and '.join(fixed(one.error.value * MM, 3) for one in judged)} mm"
        + added(contrast)
        + ". Repeats cannot see what the model lacks.",
    )


EXAMINERS: dict[int, Callable[[Campaign], Finding | None]] = {
    12: own_errors,
    13: held_out_errors,
    14: parameter_ratio,
    15: like_for_like,
    16: stated,
}
"""Claims that rest on robots; the others are arithmetic, the nominal robot and its pools."""


def decided(shown: list[bool], refuted: list[bool]) -> Verdict:
    """Holds if shown of every set, not if refuted of every set; else in part, or not decided."""
    return "holds" if all(shown) else "does not hold" if all(refuted) else "in part"


def kept(part: Mean) -> bool:
    """Whether a share is about what was promised, as far as its interval tells."""
    return part.high >= LEVEL and part.value >= LEVEL - SLACK


def where(study: Reexamined) -> str:
    """Over which robots and pools a sentence speaks."""
    pools = int(study.pool.max()) + 1
    return f"Over {study.before.size} {study.truth} robots" + (
        f" and {pools} pools" if pools > 1 else ""
    )


def each_of(found: list[Split], name: str, joint: str = " and ") -> str:
    """One figure of each optimal set, with the set's name."""
    return joint.join(f"{plus_minus(getattr(one, name))} ({one.trial})" for one in found)


def on(study: Reexamined, figures: Iterable[str], said: str = "") -> str:
    """What the optimal sets give on another kind of robots."""
    return f"on {study.truth} robots {said}{' and '.join(figures)}"


def added(contrast: Iterable[str]) -> str:
    """What other kinds of robots give, behind a sentence."""
    return "".join(f"; {said}" for said in contrast)
