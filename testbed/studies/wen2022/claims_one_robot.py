"""Claims 12 to 17: errors before and after, parameter uncertainties, coverage, linearity."""

import numpy as np

from calib.information.propagation import point_uncertainty
from testbed.studies.trial.records import Campaign, Comparison, Estimate, Trial
from testbed.studies.trial.verdict import ALARM
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.finding import Finding, NotPlayedError, Verdict, graded, played
from testbed.studies.wen2022.paper_set import designed_trials
from testbed.studies.wen2022.records import OURS_BEST, paper_budget_of, tool_point_of
from testbed.units import MM, fixed, percent, significant

LOW_SHARE = 0.7
"""Below this a 95 % statement has failed on one robot. Its poses share one parameter error, so an
honest share is not binomial: single rigid robots of the shipped scenes hold 74 to 98 %."""


def estimate_of(trial: Trial, mode: str) -> Estimate | None:
    """The estimate of a trial by one estimator."""
    return next((estimate for estimate in trial.estimates if estimate.mode == mode), None)


def estimate_like(campaign: Campaign, printed: paper.SetErrors, mode: str) -> Estimate | None:
    """Our estimate from a set like a printed one, by one estimator."""
    for trial in campaign.trials:
        chosen, designed = trial.selection, trial.method != "random"
        if printed.is_like(len(chosen.indices), designed, chosen.criterion):
            return estimate_of(trial, mode)
    return None


def paper_sets(campaign: Campaign) -> list[Comparison]:
    """Rows of Tables 1 and 2 in paper mode, if all were played."""
    return [played(estimate_like(campaign, row, "paper")).comparison for row in paper.SETS]


def calibration_errors(campaign: Campaign) -> Finding:
    """Claim 12: Table 1."""
    rows = paper_sets(campaign)
    before = [row.identification_before.mean * MM for row in rows]
    after = [row.identification_after.mean * MM for row in rows]
    reduced = all(a < 0.5 * b for a, b in zip(after, before, strict=True))
    worse = after[0] > after[1]
    lower = before[2] < before[3]
    return Finding(
        graded(reduced and worse and lower, reduced),
        ", ".join(f"{fixed(b, 3)} to {fixed(a, 3)}" for b, a in zip(before, after, strict=True))
        + " mm",
        "This campaign: calibration cuts the error on its own poses "
        f"{significant(min(np.divide(before, after)), 2)} to "
        f"{significant(max(np.divide(before, after)), 2)} times; the O1 set looks "
        f"{'worse' if worse else 'no worse'} than the random one on its own poses, and the O2 set "
        f"{'starts' if lower else 'does not start'} lower than random (the paper shows both). "
        "Errors at the poses that were fitted do not say how good a calibration is.",
    )


def held_out_errors(campaign: Campaign) -> Finding:
    """Claim 13: Table 2."""
    rows = paper_sets(campaign)
    before = rows[0].accuracy_before.mean * MM
    first, second = paper.SETS[0].poses, paper.SETS[2].poses
    after = [row.accuracy_after.mean * MM for row in rows]
    gains = [1 - after[k] / after[k + 1] for k in (0, 2)]
    printed = [1 - paper.SETS[k].held_out_mm / paper.SETS[k + 1].held_out_mm for k in (0, 2)]
    # the printed gains are 24 and 26 %: half of that is not a quarter any more
    kept = all(gain >= 0.12 for gain in gains)
    return Finding(
        "holds" if kept else "in part",
        f"{fixed(before, 3)} before; {', '.join(fixed(a, 3) for a in after)} mm after",
        f"This campaign: optimal against random is {_gain(gains[0])} at {first} poses "
        f"and {_gain(gains[1])} at {second}; printed are gains of "
        f"{percent(printed[0])} and {percent(printed[1])}. From robot to robot such "
        "means scatter by some 15 %, so one robot "
        f"can neither prove nor disprove a gain of a quarter{_left_over(campaign)}.",
    )


def _left_over(campaign: Campaign) -> str:
    """That the remaining error is the model's, if the residuals of the default estimator say so."""
    tests = [estimate_of(trial, "whitened") for trial in campaign.trials]
    if any(e is not None and e.identification.p_value < ALARM for e in tests):
        return (
            "; what is left after calibration here is mostly model error, which no choice of poses "
            "removes"
        )
    return ""


def _gain(gain: float) -> str:
    """A relative difference in words."""
    return f"{percent(abs(gain))} {'more accurate' if gain >= 0 else 'less accurate'}"


def parameter_ratio(campaign: Campaign) -> Finding:
    """Claim 14: mean ratio of parameter uncertainties, and what it is made of."""
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
        f"give {fixed(repeats, 2)}; the rest is that only the random side counts the number "
        f"and the place of the poses ({percent(number)} and {percent(place)} of its "
        f"variance, repeats {percent(share)}).",
    )


def like_for_like(campaign: Campaign) -> Finding:
    """Claim 15: standard uncertainty of designed against random sets of the same size."""
    parts, ratios = [], []
    designed = [trial for trial in campaign.trials if trial.method != "random"]
    sized = {len(t.selection.indices): t for t in campaign.trials[::-1] if t.method == "random"}
    # where other designs are played beside the paper's, the claim is about the paper's
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
        f"This campaign: like for like, stated u of the designed over the random set is "
        f"{'; '.join(parts)}. A tenth is out of reach: the same noise falls on the same number of "
        "poses.",
    )


def coverage(campaign: Campaign) -> Finding:
    """Claim 16: whether the stated tool uncertainty of the optimal set holds the true error."""
    designed = designed_trials(campaign.scenario)[:1]
    trial = played(next((t for t in campaign.trials if t.name in designed), None))
    estimate = played(estimate_of(trial, "paper"))
    seen, runs = estimate.comparison, estimate.replications
    # one calibration's poses share its error; replications say what its region holds on average
    full = float(seen.inside.mean() if runs is None else runs.tool_coverage.mean())
    study, own = tool_point_of(campaign), ""
    share = full
    if study is not None and OURS_BEST in study.source:
        u = study.distance_sd[study.source.index(OURS_BEST), 1:]
        share = float((seen.after <= 2 * u).mean())
        own = (
            f"2 u of the paper's kind (mean u {fixed(float(u.mean() * MM), 4)} mm) holds the true "
            f"error at {percent(share)} of the held-out poses, and "
        )
    return Finding(
        claim_16(share, full),
        f"{percent(share)} inside instead of 95 %",
        f"This campaign, {trial.name} in paper mode: {own}the full 95 % region of the fit holds "
        f"{percent(full)}{'' if runs is None else f' in {runs.count} replications'}. The mean "
        "error after calibration is "
        f"{fixed(seen.accuracy_after.mean * MM, 3)} mm"
        + (": repeats cannot see what the model lacks." if own and share < LOW_SHARE else "."),
    )


def claim_16(share: float, full: float) -> Verdict:
    """Verdict from the share that 2 u of |P| holds, and the share in the fit's full 95 % region."""
    held = [part >= LOW_SHARE for part in (share, full)]
    return graded(all(held), any(held))


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
        f"{percent(noise)}: parameter errors of this size are linear, so the simple law is enough.",
    )
