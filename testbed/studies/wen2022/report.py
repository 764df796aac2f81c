"""The report's re-examination of the paper: the verdict, claim by claim, and what it rests on."""

from dataclasses import replace
from math import inf

import numpy as np
from scipy.special import gammaln

from testbed.report.page import Block, Figure, Points, Section, Text, Verdict
from testbed.studies.over_robots import plus_minus
from testbed.studies.protocol import Answer
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.verdict import trial_verdict
from testbed.studies.wen2022 import plots, tables
from testbed.studies.wen2022.claims import Examined, examine
from testbed.studies.wen2022.ratio import Split, printed_split
from testbed.studies.wen2022.report_paper import claim_table
from testbed.studies.wen2022.summary import Reexamination, of_kind, reexamination_of
from testbed.units import MM, NARROW, counted, fixed, plain

CENTRAL = (14, 15, 16, 13)
"""Claims that decide what the paper is worth, the first one above all."""


def verdict_of(again: Reexamination, examined: Examined, trial: Verdict) -> Verdict:
    """The verdict on the paper, from the findings; what the trials say stands behind it."""
    total, holds, found = len(examined.findings), examined.count("holds"), examined.findings
    central = found[CENTRAL[0]]
    said = {"holds": "holds", "in part": "holds in part"}.get(central.verdict, "does not hold")
    sentence = (
        f"{tally(examined)} The central one, that optimal poses cut the parameter "
        f"uncertainties to a ninth, {said}: {central.ours} where 0.11 is printed. "
        f"{chosen_kind(again)}"
    )
    reasons = (
        f"Claim {number} {found[number].verdict}. {found[number].sentence}"
        for number in CENTRAL
        if number in found
    )
    return replace(
        trial,
        sentence=plain(sentence),
        reasons=tuple(map(plain, (*reasons, trial.sentence))),
        mark=f"{'✓' if holds == total else '✗'} {holds} of {total} claims of the paper hold",
    )


def tally(examined: Examined) -> str:
    """How many claims hold, hold in part, do not, are misprints."""
    count = examined.count
    rest = {
        "in part": f"{count('in part')} in part",
        "does not hold": f"{count('does not hold')} do not",
        "misprint": counted(count("misprint"), "misprint"),
    }
    said = [said for verdict, said in rest.items() if count(verdict)]
    return ", ".join([f"{count('holds')} of {len(examined.findings)} claims hold", *said]) + "."


def chosen_kind(again: Reexamination) -> str:
    """On which kind of robots the claims are judged, and why."""
    if len(again.kinds) < 2:
        return f"Judged on {again.judged.truth} robots."
    left = ", ".join(
        f"{fixed(float(one.error[:, 0].mean()) * MM, 3)} mm on {one.truth} robots"
        for one in again.kinds
    )
    return (
        f"Judged on {again.judged.truth} robots, which keep an error like the paper's after "
        f"calibration ({left}; printed are 0.097 to 0.132 mm)."
    )


def next_step(again: Reexamination) -> str:
    """What to do instead."""
    worst = min(one.shares[1].value for one in of_kind(again.statements, again.judged))
    if worst >= 0.9:
        return "Compare pose sets of the same size, and count the same contributions on both sides."
    return (
        "Do not state an uncertainty from repeats alone. Compare pose sets of the same size, count "
        "the same contributions on both sides, and take the uncertainty from poses that were not "
        "fitted (scene coverage shows which statements hold)."
    )


def reexamined_section(again: Reexamination, examined: Examined) -> Section:
    """Claims, figures and tables."""
    blocks: list[Block] = [
        claim_table(examined),
        Text(procedure(again)),
        Figure(
            "Why the printed ratio is small. Left: what the variance of the random side is made "
            "of. Right: the ratio in geometric means, from 1 by way of repeats against repeats "
            "(blue) to the printed kind of ratio (diamond) by what only the random side counts.",
            plots.ratio_apart((printed_split(), *again.splits)),
        ),
        Figure(
            "Like for like: designed against random sets of the same size, with 95 % intervals "
            "over pools (left) and over pools and robots. Left of the line the designed set is "
            "better. The panels have scales of their own.",
            plots.like_for_like(again.predictions, again.errors),
        ),
        tables.predicted_table(again.predictions),
        tables.error_table(again.errors),
        Figure(
            f"Share of the truth inside 95{NARROW}% statements, with 95 % intervals; the line is "
            "the promise. Open: the interval does not reach it. The first three are of type A, "
            "as the paper's u best is; the others are what the covariance of a fit claims, which "
            "the paper does not state.",
            plots.what_u_best_holds(again.statements),
            on_paper=False,  # the table has these shares, and what is stated
        ),
        tables.held_table(again.statements),
        *tables.set_tables(again),
    ]
    if again.others:
        kinds = (of_kind(again.splits, kind)[0] for kind in again.kinds)
        blocks.insert(2, Points((repeats_alone(again), *map(number_and_place, kinds))))
    return Section(
        "reexamined", "Wen et al. 2022, re-examined claim by claim", tuple(blocks), part="answer"
    )


def number_and_place(split: Split) -> str:
    """How much number and place of the poses scatter on one kind of robots, and why."""
    printed = printed_split()
    why = (
        "Noise alone makes about as much, so they add little but a second and a third count of it."
        if max(split.p_over_r.value, split.w_over_r.value) < NOISE_ONLY
        else "Noise alone makes about as much as repeats: the rest is what the model lacks, seen "
        "from different poses."
    )
    return (
        f"On {split.truth} robots number and place of the poses scatter the estimates "
        f"{fixed(split.p_over_r.value, 1)} and {fixed(split.w_over_r.value, 1)} times as much as "
        f"repeats do (printed {fixed(printed.p_over_r.value, 1)} and "
        f"{fixed(printed.w_over_r.value, 1)}). {why}"
    )


def repeats_alone(again: Reexamination) -> str:
    """Whether the scatter of repeats is what noise predicts, and what is printed."""
    by_set = {one.trial: one for one in again.splits}
    said = [
        f"{fixed(one.numbers.value * few_repeats(again.repeats), 2)} for {one.trial}, and "
        f"{plus_minus(by_set[one.trial].repeats)} is found"
        for one in again.predictions
        if one.trial in by_set
        and one.against == again.sets.sets[-1].poses
        and one.estimator == "paper"
    ]
    return (
        f"Repeats see noise alone. For {again.repeats} of them noise predicts a mean u_r best / "
        f"u_r random of {'; '.join(said)}. Printed is {fixed(printed_split().repeats.value, 2)}."
    )


def few_repeats(count: int) -> float:
    """Expected ratio of two experimental standard deviations of equal sigmas, `count` values each.

    References
    ----------
    Chi distribution: E[s] E[1/s] = G(n/2) G((n-2)/2) / G((n-1)/2)^2, with n values; infinite for
    two.
    """
    if count < 3:
        return inf
    return float(
        np.exp(gammaln(count / 2) + gammaln((count - 2) / 2) - 2 * gammaln((count - 1) / 2))
    )


NOISE_ONLY = 1.5
"""Below this u_p and u_w are what noise makes of sets of such sizes and places."""


def procedure(again: Reexamination) -> str:
    """How the study was made."""
    sets, budget, (pools, n, _) = again.sets, again.budget, again.sets.pool_q.shape
    unit = (
        f"Every pool met {counted(again.robots // pools, 'robot')} of each kind, and the unit "
        "of intervals is the pool with its robots: they hold the luck of the designed sets too."
        if pools > 1
        else "There is one pool, and the unit of intervals is the robot: they do not hold the luck "
        "of the designed sets."
    )
    return (
        f"{counted(again.robots, 'robot')} of each kind were drawn and measured by the paper's "
        f"protocol: {again.repeats} repeats of each optimal set and of {budget.poses} random "
        f"poses, random sets of {min(budget.pose_numbers)} to {min(max(budget.pose_numbers), n)} "
        f"poses, and {budget.location_poses} poses, or all there are, in each of four regions. "
        f"{counted(pools, 'pool')} of {n} poses were drawn, and every designed "
        "set was chosen anew from each; random sets were drawn anew for each robot. The error is "
        f"that of the tool point against the noise-free truth at {sets.test_q.shape[1]} held-out "
        "poses of the pool. Robots of all kinds come from the same random numbers and meet the "
        f"same noise. {unit}"
    )


def answer(campaign: Campaign) -> Answer | None:
    """The first screen: how many claims hold; None where many robots were not played."""
    again, examined = reexamination_of(campaign), examine(campaign)
    if again is None or examined is None:
        return None
    verdict = verdict_of(again, examined, trial_verdict(campaign))
    return Answer(verdict, tables.split_table(again), next_step(again))
