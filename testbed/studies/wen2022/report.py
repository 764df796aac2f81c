"""The report's re-examination of the paper: the verdict, claim by claim, and what it rests on."""

from dataclasses import dataclass
from math import inf

import numpy as np
from scipy.special import gammaln

from testbed.report.intervals import plus_minus
from testbed.report.page import Block, Figure, Points, Section, Table, Text, Verdict
from testbed.studies.protocol import Answer
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.verdict import trial_verdict
from testbed.studies.wen2022 import plots, tables
from testbed.studies.wen2022.claims import Examined, examine
from testbed.studies.wen2022.claims_many_robots import judged_kind
from testbed.studies.wen2022.records import pools_of, reexamined_of
from testbed.studies.wen2022.report_paper import claim_table
from testbed.studies.wen2022.summary import (
    Split,
    errors,
    predictions,
    printed_split,
    splits,
    statements,
)
from testbed.units import MM, NARROW, counted, fixed, plain

CENTRAL = (14, 15, 16, 13)
"""Claims that decide what the paper is worth, the first one above all."""


@dataclass(frozen=True, slots=True)
class Opening:
    """What the page says before anything else."""

    mark: str
    sentence: str
    reasons: tuple[str, ...]


def opening(campaign: Campaign, examined: Examined) -> Opening:
    """The verdict on the paper, from the findings."""
    total, holds = len(examined.findings), examined.count("holds")
    found = {finding.number: finding for finding in examined.findings}
    sign = "✓" if holds == total else "✗"
    central = found[14]
    said = {"holds": "holds", "in part": "holds in part"}.get(central.verdict, "does not hold")
    return Opening(
        mark=f"{sign} {holds} of {total} claims of the paper hold",
        sentence=(
            f"{tally(examined)} The central one, that optimal poses cut the parameter "
            f"uncertainties to a ninth, {said}: {central.ours} where 0.11 is printed. "
            f"{chosen_kind(campaign)}"
        ),
        reasons=tuple(
            f"Claim {number} {found[number].verdict}. {found[number].sentence}"
            for number in CENTRAL
            if number in found
        ),
    )


def tally(examined: Examined) -> str:
    """How many claims hold, hold in part, do not, are misprints."""
    count = examined.count
    parts = [f"{count('holds')} of {len(examined.findings)} claims hold"]
    if count("in part"):
        parts.append(f"{count('in part')} in part")
    if count("does not hold"):
        parts.append(f"{count('does not hold')} do not")
    if count("misprint"):
        parts.append(f"{counted(count('misprint'), 'misprint')}")
    return ", ".join(parts) + "."


def chosen_kind(campaign: Campaign) -> str:
    """On which kind of robots the claims are judged, and why."""
    study = judged_kind(campaign)
    if len(reexamined_of(campaign)) < 2:
        return f"Judged on {study.truth} robots."
    left = ", ".join(
        f"{fixed(float(one.error[:, 0].mean()) * MM, 3)} mm on {one.truth} robots"
        for one in reexamined_of(campaign)
    )
    return (
        f"Judged on {study.truth} robots, which keep an error like the paper's after calibration "
        f"({left}; printed are 0.097 to 0.132 mm)."
    )


def next_step(campaign: Campaign) -> str:
    """What to do instead."""
    found = statements(reexamined_of(campaign))
    study = judged_kind(campaign)
    worst = min(one.shares[1].value for one in found if one.truth == study.truth)
    if worst >= 0.9:
        return "Compare pose sets of the same size, and count the same contributions on both sides."
    return (
        "Do not state an uncertainty from repeats alone. Compare pose sets of the same size, count "
        "the same contributions on both sides, and take the uncertainty from poses that were not "
        "fitted (scene coverage shows which statements hold)."
    )


def summary_table(campaign: Campaign) -> Table:
    """The page's first table: the ratio of the paper taken apart."""
    found = (printed_split(), *splits(reexamined_of(campaign), pools_of(campaign)))
    return tables.split_table(found, reexamined_of(campaign)[0].before.size)


def reexamined_section(campaign: Campaign, examined: Examined) -> Section:
    """Claims, figures and tables."""
    studies, sets = reexamined_of(campaign), pools_of(campaign)
    apart = (printed_split(), *splits(studies, sets))
    predicted, true, held = predictions(sets), errors(studies, sets), statements(studies)
    blocks: list[Block] = [
        claim_table(examined),
        Text(procedure(campaign)),
        Figure(
            "Why the printed ratio is small. Left: what the variance of the random side is made "
            "of. Right: the ratio in geometric means, from 1 by way of repeats against repeats "
            "(blue) to the printed kind of ratio (diamond) by what only the random side counts.",
            plots.ratio_apart(apart),
        ),
        Figure(
            "Like for like: designed against random sets of the same size, with 95 % intervals "
            "over pools (left) and over pools and robots. Left of the line the designed set is "
            "better. The panels have scales of their own.",
            plots.like_for_like(predicted, true),
        ),
        tables.predicted_table(predicted),
        tables.error_table(true),
        Figure(
            f"Share of the truth inside 95{NARROW}% statements, with 95 % intervals; the line is "
            "the promise. Open: the interval does not reach it. The first three are made from the "
            "paper's u best, the last from the full covariance of a fit.",
            plots.what_u_best_holds(held),
        ),
        tables.held_table(held),
        *tables.set_tables(studies, sets),
        tables.parameter_table(studies, sets.names),
    ]
    if len(studies) > 1:
        blocks.insert(2, Points(lessons(campaign)))
    return Section(
        "reexamined", "Wen et al. 2022, re-examined claim by claim", tuple(blocks), part="answer"
    )


def lessons(campaign: Campaign) -> tuple[str, ...]:
    """What the kinds of robots tell about the protocol itself."""
    found = splits(reexamined_of(campaign), pools_of(campaign))
    by_kind = {split.who: split for split in reversed(found)}
    kinds = (by_kind[study.truth] for study in reexamined_of(campaign))
    return (*repeats_alone(campaign), *(number_and_place(split) for split in kinds))


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
        f"On {split.who} robots number and place of the poses scatter the estimates "
        f"{fixed(split.p_over_r.value, 1)} and {fixed(split.w_over_r.value, 1)} times as much as "
        f"repeats do (printed {fixed(printed.p_over_r.value, 1)} and "
        f"{fixed(printed.w_over_r.value, 1)}). {why}"
    )


def repeats_alone(campaign: Campaign) -> tuple[str, ...]:
    """Whether the scatter of repeats is what noise predicts, and what is printed."""
    repeats, sets = campaign.scenario.uncertainty.repeats, pools_of(campaign)
    by_set = {one.trial: one for one in splits(reexamined_of(campaign), sets)}
    said = []
    for one in predictions(sets):
        if one.trial in by_set and one.against == sets.sets[-1].poses and one.estimator == "paper":
            expected = one.numbers.value * few_repeats(repeats)
            said.append(
                f"{fixed(expected, 2)} for {one.trial}, and "
                f"{plus_minus(by_set[one.trial].repeats)} is found"
            )
    return (
        f"Repeats see noise alone. For {repeats} of them noise predicts a mean u_r best / u_r "
        f"random of {'; '.join(said)}. Printed is "
        f"{fixed(printed_split().repeats.value, 2)}.",
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


def procedure(campaign: Campaign) -> str:
    """How the study was made."""
    study, sets = reexamined_of(campaign)[0], pools_of(campaign)
    repeats, pools = campaign.scenario.uncertainty.repeats, len(sets.pool_q)
    robots = counted(study.before.size, "robot")
    unit = (
        f"Every pool met {counted(study.before.size // pools, 'robot')} of each kind, and the unit "
        "of intervals is the pool with its robots: they hold the luck of the designed sets too."
        if pools > 1
        else "There is one pool, and the unit of intervals is the robot: they do not hold the luck "
        "of the designed sets."
    )
    return (
        f"{robots} of each kind were drawn and measured by the paper's protocol: {repeats} repeats "
        f"of each optimal set and of 50 random poses, random sets of 30 to 150 poses, and 50 poses "
        f"in each of four regions. {counted(pools, 'pool')} of {sets.pool_q.shape[1]} poses were "
        f"drawn, and every designed set was chosen anew from each; random sets were drawn anew for "
        f"each robot. The error is that of the tool point against the noise-free truth at "
        f"{sets.test_q.shape[1]} held-out poses of the pool. Robots of all kinds come from the "
        f"same random numbers and meet the same noise. {unit}"
    )


def answer(campaign: Campaign) -> Answer | None:
    """The first screen: how many claims hold; None where many robots were not played."""
    examined = examine(campaign)
    if examined is None or not reexamined_of(campaign):
        return None
    said, own = opening(campaign, examined), trial_verdict(campaign)
    reasons = tuple(map(plain, (*said.reasons, own.sentence)))
    verdict = Verdict(own.believable, own.contradicted, plain(said.sentence), reasons, said.mark)
    return Answer(verdict, summary_table(campaign), next_step(campaign))
