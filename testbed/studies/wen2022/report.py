"""The report's re-examination of the paper: the verdict claim by claim, and its basis."""

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
"""The central claims of the paper, the most important first."""


def verdict_of(again: Reexamination, examined: Examined, trial: Verdict) -> Verdict:
    """The verdict on the paper from the findings, followed by that of the trials."""
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
    """Numbers of claims that hold, hold in part, do not hold, or are misprints."""
    count = examined.count
    rest = {
        "in part": f"{count('in part')} in part",
        "does not hold": f"{count('does not hold')} do not",
        "misprint": counted(count("misprint"), "misprint"),
    }
    said = [said for verdict, said in rest.items() if count(verdict)]
    return ", ".join([f"{count('holds')} of {len(examined.findings)} claims hold", *said]) + "."


def chosen_kind(again: Reexamination) -> str:
    """The kind of robots on which the claims are judged, and why."""
    if len(again.kinds) < 2:
        return f"Judged on {again.judged.truth} robots."
    left = ", ".join(
        f"{fixed(float(one.error[:, 0].mean()) * MM, 3)} mm on {one.truth} robots"
        for one in again.kinds
    )
    return (
        f"Judged on {again.judged.truth} robots, whose error after calibration is nearest to the "
        f"paper's ({left}; the paper prints 0.097 to 0.132 mm)."
    )


def next_step(again: Reexamination) -> str:
    """Recommendation of what to do instead."""
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
            "Why the printed ratio is small. Left: parts of the variance of the random side. "
            "Right: the ratio in geometric means, from 1 through repeats against repeats (blue) to "
            "the ratio as in the paper (diamond), with the parts that only the random side counts.",
            plots.ratio_apart((printed_split(), *again.splits)),
        ),
        Figure(
            "Like for like: designed against random sets of the same size, with 95 % intervals "
            "over pools (left) and over pools and robots. Left of the line the designed set is "
            "better. Each panel has its own scale.",
            plots.like_for_like(again.predictions, again.errors),
        ),
        tables.predicted_table(again.predictions),
        tables.error_table(again.errors),
        Figure(
            f"Share of the truth inside 95{NARROW}% statements, with 95 % intervals; the line is "
            "the stated level. Open: the interval does not reach it. The first three are of type "
            "A, as the paper's u best is; the others are regions by the covariance of a fit, which "
            "are not in the paper.",
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
    """Scatter from number and place of the poses on one kind of robots, and its cause."""
    printed = printed_split()
    why = (
        "Noise alone explains about as much, so they mostly count it a second and a third time."
        if max(split.p_over_r.value, split.w_over_r.value) < NOISE_ONLY
        else "Noise alone explains about as much as repeats: the rest is model error, which "
        "differs from pose to pose."
    )
    return (
        f"On {split.truth} robots estimates scatter with number and place of the poses "
        f"{fixed(split.p_over_r.value, 1)} and {fixed(split.w_over_r.value, 1)} times as much as "
        f"between repeats (printed {fixed(printed.p_over_r.value, 1)} and "
        f"{fixed(printed.w_over_r.value, 1)}). {why}"
    )


def repeats_alone(again: Reexamination) -> str:
    """Whether the scatter of repeats agrees with the noise, and with the printed one."""
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
        f"Repeats show noise alone. For {again.repeats} of them noise predicts a mean u_r best / "
        f"u_r random of {'; '.join(said)}. The paper has "
        f"{fixed(printed_split().repeats.value, 2)}."
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
"""Ratio to u_r below which u_p and u_w are explained by noise in sets of such sizes and places."""


def procedure(again: Reexamination) -> str:
    """How the study was made."""
    sets, budget, (pools, n, _) = again.sets, again.budget, again.sets.pool_q.shape
    unit = (
        f"Every pool was used with {counted(again.robots // pools, 'robot')} of each kind, and the "
        "unit of intervals is the pool with its robots: they include variation of designed sets."
        if pools > 1
        else "There is one pool, and the unit of intervals is the robot: they do not include "
        "variation of designed sets."
    )
    return (
        f"{counted(again.robots, 'robot')} of each kind were drawn and measured by the paper's "
        f"protocol: {again.repeats} repeats of each optimal set and of {budget.poses} random "
        f"poses, random sets of {min(budget.pose_numbers)} to {min(max(budget.pose_numbers), n)} "
        f"poses, and {budget.location_poses} poses, or all there are, in each of four regions. "
        f"{counted(pools, 'pool')} of {n} poses were drawn, and every designed "
        "set was chosen anew from each; random sets were drawn anew for each robot. The error is "
        f"that of the tool point against the noise-free truth at {sets.test_q.shape[1]} held-out "
        "poses of the pool. Robots of all kinds have the same random numbers and the same noise. "
        f"{unit}"
    )


def answer(campaign: Campaign) -> Answer | None:
    """The first screen: how many claims hold; None if many robots were not played."""
    again, examined = reexamination_of(campaign), examine(campaign)
    if again is None or examined is None:
        return None
    verdict = verdict_of(again, examined, trial_verdict(campaign))
    return Answer(verdict, tables.split_table(again), next_step(again))
