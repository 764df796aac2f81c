"""Claims 12 to 17: errors before and after, parameter uncertainties, coverage, linearity."""

from itertools import starmap

import numpy as np

from calib.information.propagation import point_uncertainty
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.verdict import ALARM
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.calibrated_sets.records import AgainstRandom
from testbed.studies.wen2022.calibrated_sets.summary import (
    TableRow,
    estimate_of,
    rank_of,
    set_like,
    table_rows,
)
from testbed.studies.wen2022.finding import Finding, NotPlayedError, Verdict, graded, played
from testbed.studies.wen2022.paper_set import designed_trials
from testbed.studies.wen2022.records import ESTIMATORS, paper_budget_of, tool_point_of
from testbed.studies.wen2022.stated import judged_statements
from testbed.units import MM, fixed, percent, significant

LOW_SHARE = 0.7
"""Share of poses below which a 95 % statement has failed on one robot. The poses share one
parameter error, so that the share of a correct statement is not binomial: for single rigid robots
of the shipped scenes it is 74 to 98 %."""


def paper_sets(campaign: Campaign) -> list[TableRow]:
    """Rows of Tables 1 and 2 in paper mode, if all were played."""
    return [played(row) for row in table_rows(campaign)]


def calibration_errors(campaign: Campaign) -> Finding:
    """Claim 12: Table 1."""
    rows = paper_sets(campaign)
    cut = [row.own_before.mean / row.own_after.mean for row in rows]
    reduced = min(cut) > 2
    worse = rows[0].own_after.mean > rows[1].own_after.mean
    lower = rows[2].own_before.mean < rows[3].own_before.mean
    if both := among_random(campaign):
        first, second = (rank_of(one, "paper") for one in both)
        looks = (
            f"there the O1 set has a larger error than {first.sets - first.own_lower_than} of "
            f"{first.sets} random sets, and before calibration the O2 set has a smaller one than "
            f"{second.starts_lower_than} of {second.sets}"
        )
    else:
        looks = (
            f"there the O1 set has {'a larger' if worse else 'no larger'} error than the random "
            f"one, and before calibration the O2 set has {'a' if lower else 'no'} smaller one"
        )
    return Finding(
        graded(reduced and worse and lower, reduced),
        ", ".join(f"{row.own_before.millimetres} to {row.own_after.millimetres}" for row in rows)
        + " mm",
        "This campaign: calibration cuts the error on its own poses "
        f"{significant(min(cut), 2)} to {significant(max(cut), 2)} times; {looks} (in the paper a "
        "larger and a smaller one, each against one random set). "
        "Errors at poses that were fitted do not show how good a calibration is.",
    )


def held_out_errors(campaign: Campaign) -> Finding:
    """Claim 13: Table 2."""
    rows = paper_sets(campaign)
    gains = [1 - rows[k].error.mean / rows[k + 1].error.mean for k in (0, 2)]
    printed = [1 - paper.SETS[k].held_out_mm / paper.SETS[k + 1].held_out_mm for k in (0, 2)]
    # the printed gains are 24 and 26 %: half of that is not a quarter any more
    kept = [gain >= 0.12 for gain in gains]
    said = " and ".join(percent(gain) for gain in printed)
    if both := among_random(campaign):
        verdict = graded(all(kept), any(kept))
        where = "; ".join(starmap(_among, zip(both, gains, strict=True)))
        alike = " and ".join(
            f"{gained(one, gain) or 'none'} of {len(one.random.indices)}"
            for one, gain in zip(both, printed, strict=True)
        )
        sentence = (
            f"{where}. The paper's gains are {said}, each against one random set; here such a gain "
            f"occurs against {alike}"
        )
    else:
        verdict = "holds" if all(kept) else "in part"
        sentence = (
            f"the optimal set is {_gain(gains[0])} than the random one at {paper.SETS[0].poses} "
            f"poses and {_gain(gains[1])} at {paper.SETS[2].poses}; the paper prints gains of "
            f"{said}. Such means scatter by some 15 % between robots, and also between random "
            "sets, so one of each can neither prove nor disprove a gain of a quarter"
        )
    before = fixed(held_out_before(campaign) * MM, 3)
    return Finding(
        verdict,
        f"{before} before; {', '.join(row.error.millimetres for row in rows)} mm after",
        f"This campaign: {sentence}{_left_over(campaign)}.",
    )


def among_random(campaign: Campaign) -> list[AgainstRandom]:
    """The paper's O1 and O2 sets among random ones; none unless both were played."""
    found = [set_like(campaign, row) for row in paper.SETS if row.optimal]
    both = [one for one in found if one is not None]
    return both if len(both) == len(found) else []


def _among(one: AgainstRandom, gain: float) -> str:
    """Comparison of a designed set with random ones, by the paper's estimator."""
    rank = rank_of(one, "paper")
    return (
        f"the {rank.criterion} set of {rank.poses} poses is {_gain(gain)} than the mean of "
        f"{rank.sets} random sets, and better than {rank.better_than or 'none'} of them"
    )


def gained(one: AgainstRandom, gain: float) -> int:
    """Number of random sets that the designed set beats by `gain`, with the paper's estimator."""
    k = ESTIMATORS.index("paper")
    return int((one.designed.error[k, 0] <= (1 - gain) * one.random.error[k]).sum())


def held_out_before(campaign: Campaign) -> float:
    """Mean held-out error of the nominal model [m]."""
    return campaign.trials[0].estimates[0].comparison.accuracy_before.mean


def _left_over(campaign: Campaign) -> str:
    """Clause on model error in what remains, if residuals of the default estimator show it."""
    tests = [estimate_of(trial, "whitened") for trial in campaign.trials]
    if any(e is not None and e.identification.p_value < ALARM for e in tests):
        return (
            "; the error left after calibration here is mostly model error, which no choice of "
            "poses removes"
        )
    return ""


def _gain(gain: float) -> str:
    """A relative difference in words."""
    return f"{percent(abs(gain))} {'more accurate' if gain >= 0 else 'less accurate'}"


def parameter_ratio(campaign: Campaign) -> Finding:
    """Claim 14: mean ratio of parameter uncertainties, and its parts."""
    budget = played(paper_budget_of(campaign))
    ratio, repeats = float(budget.ratio[0]), float(budget.repeats_ratio[0])
    others = "".join(
        f", {fixed(float(one), 2)} with {name}"
        for name, one in zip(budget.trials[1:], budget.ratio[1:], strict=True)
    )
    share, number, place = (
        float((part**2 / budget.random**2).mean())
        for part in (budget.repeatability, budget.pose_number, budget.location)
    )
    return Finding(
        "holds" if ratio <= 0.17 else "does not hold",
        f"mean ratio {fixed(ratio, 2)} ({budget.trials[0]})",
        f"This campaign: the paper's own protocol gives {fixed(ratio, 2)} with {budget.trials[0]}"
        f"{others}. Repeats of {budget.trials[0]} against repeats of the random set "
        f"give {fixed(repeats, 2)}; the rest arises because only the random side counts the number "
        f"and the place of the poses ({percent(number)} and {percent(place)} of its "
        f"variance, repeats {percent(share)}).",
    )


def like_for_like(campaign: Campaign) -> Finding:
    """Claim 15: standard uncertainty of designed against random sets of the same size."""
    parts, ratios = [], []
    designed = [trial for trial in campaign.trials if trial.method != "random"]
    sized = {len(t.selection.indices): t for t in campaign.trials[::-1] if t.method == "random"}
    # if other designs are played as well, the claim is about those of the paper
    for trial in [trial for trial in designed if trial.rows == "paper"] or designed:
        poses = len(trial.selection.indices)
        own = estimate_of(trial, "whitened")
        other = estimate_of(sized[poses], "whitened") if poses in sized else None
        if own is None or other is None or own.identification.names != other.identification.names:
            continue
        u, v = (e.identification.standard_uncertainty for e in (own, other))
        tool, spread = (point_uncertainty(e.comparison.covariance).mean() for e in (own, other))
        ratios.append(float(np.mean(u / v)))
        parts.append(
            f"{poses} poses by {trial.selection.criterion}: parameters "
            f"{fixed(ratios[-1], 2)}, tool point {fixed(float(tool / spread), 2)}"
        )
    if not ratios:
        raise NotPlayedError
    return Finding(
        graded(max(ratios) < 0.3, min(ratios) < 1),
        f"ratio {', '.join(fixed(ratio, 2) for ratio in ratios)}",
        f"This campaign: for sets of one size, stated u of the designed over the random set is "
        f"{'; '.join(parts)}. A tenth cannot be reached: the same noise acts on the same number "
        "of poses.",
    )


def coverage(campaign: Campaign) -> Finding:
    """Claim 16: whether the stated tool uncertainty of the optimal set covers the true error."""
    designed = designed_trials(campaign.scenario)[:1]
    trial = played(next((t for t in campaign.trials if t.name in designed), None))
    seen = played(judged_statements(campaign, trial))
    distance, point = seen.type_a
    verdict = claim_16(point)
    runs = f" in {seen.replications} replications" if seen.replications else ""
    return Finding(
        verdict,
        f"{percent(point)} inside instead of 95 %",
        f"This campaign, {seen.trial}: by repeats (type A, as the paper states it) the true tool "
        f"point lies within t u of |P| (Student's t, {fixed(seen.factor, 2)}) at {percent(point)} "
        f"of the held-out poses, its distance alone at {percent(distance)}; the mean stated u is "
        f"{fixed(seen.distance_u * MM, 4)} mm, the mean error {fixed(seen.error * MM, 3)} mm. "
        + ("" if verdict == "holds" else "Repeats do not show what the model lacks. ")
        + "Not in the paper: the region by the covariance of the unweighted fit contains the "
        f"point at {percent(seen.unweighted)}{runs}.",
    )


def claim_16(point: float) -> Verdict:
    """Verdict from the share of tool points within t u of |P|; |P| itself is so more often."""
    return "holds" if point >= LOW_SHARE else "does not hold"


def nonlinear(campaign: Campaign) -> Finding:
    """Claim 17: Monte Carlo against linear propagation of the same covariance."""
    study = played(tool_point_of(campaign))
    drawn, linear = (
        np.sqrt(np.trace(c, axis1=2, axis2=3)) for c in (study.covariance, study.linear)
    )
    off = float(np.abs(drawn / linear - 1).max())
    noise = float(1 / np.sqrt(2 * study.draws))
    return Finding(
        "does not hold" if off < 5 * noise else "holds",
        f"largest difference {percent(off)} of u",
        f"Linear propagation gives the 3-D uncertainty of all {drawn.shape[1]} poses within "
        f"{percent(off)} of Monte Carlo, and {study.draws} draws alone scatter by "
        f"{percent(noise)}: parameter errors of this size act linearly, so it is enough.",
    )
