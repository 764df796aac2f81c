"""The statement of each calibration in the report: what to believe, and why."""

import re

import numpy as np

from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.questions import LEVEL as QUESTION_LEVEL
from testbed.report.choice import choice_tables
from testbed.report.glossary import GLOSSARY
from testbed.report.page import Block, Figure, Points, Section, Table, Text
from testbed.studies.trial import plots, plots_uncertainty
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.trial.statement.records import BELIEVED, LEVEL, SUMS, Statement, sums_of
from testbed.units import (
    NARROW,
    counted,
    micrometres,
    percent,
    probability,
    sentence,
    significant,
    typeset,
)

WORDS = {
    "region": "believed region, mean of many moves",
    "move": "believed region, one move",
    "parameters": "parameters alone",
    "bootstrap": "bootstrap",
    "discrepancy": "parameters and discrepancy",
    "conformal": "conformal ball",
}
PROMISES = {
    "region": "mean tool point, a misfit up to its limit, shared errors and drift included",
    "move": "where a single move ends, the same included",
    "parameters": "mean tool point, if the model lacks nothing and the noise is as stated",
    "bootstrap": "the same, without linear propagation",
    "discrepancy": "mean tool point, if what the model lacks is alike everywhere",
    "conformal": "a further reading, its noise included; needs no model",
}
TINY = re.compile(r"p (= [0-9.]+e-[0-9]+|< 1e-300)")
"""A p-value that nobody reads."""
BUDGET_NOTE = (
    "u: 3-D standard uncertainty (k = 1) that the source alone leaves at the tool, root mean "
    "square over the held-out poses. share: of the variance of the parameters alone. noise "
    "beyond the stated: what repeats ask for. misfit up to its limit: the largest that the "
    "evidence allows, in the joints and at the target. believed: "
    "all of it, times the factor of the region over 2.80 where held-out poses ask for more. "
    "discrepancy: what measured held-out poses show beyond the parameters alone, chance and all; "
    "it is no part of the sum."
)
QUESTIONS = {
    "misfit": "does the robot do what the model cannot follow?",
    "another frame": "do the held-out readings stand in another frame?",
    "drift": "do readings follow their neighbors in time?",
}


def statement_section(campaign: Campaign) -> Section | None:
    """Every statement made, how much of the truth it holds, which is believed, and why."""
    made = ((trial, estimate.statement) for trial, estimate in campaign.estimates)
    statements = [(trial, statement) for trial, statement in made if statement is not None]
    if not statements:
        return None
    shown = statements[: plots.MOST_PANELS]
    blocks: list[Block] = [statement_table(campaign, statements)]
    for k, (trial, statement) in enumerate(shown):
        name, _, why = statement.why.partition(": ")
        levels = name.removeprefix(statement.model)
        blocks.append(Text(f"{trial.name}, {statement.model} model{levels}: {why}."))
        blocks += choice_tables(statement.offered, statement.steps)
        blocks.append(Points(reasons(statement, brief=k > 0)))
    blocks += [tests_table(shown), budget_table(shown)]
    blocks.append(
        Figure(
            "What each source leaves at the tool point, standard uncertainty (3-D, k = 1) over the "
            f"held-out poses{plots.only(statements)}; open: the discrepancy, which is no part of "
            "the sum.",
            plots_uncertainty.budget_bars([(trial.name, statement) for trial, statement in shown]),
        )
    )
    first, stated = shown[0]
    if stated.belief is not None:
        blocks.append(
            Figure(
                map_caption(campaign, first, stated.belief),
                plots_uncertainty.tool_maps(campaign, first),
            )
        )
    blocks.append(Points(GLOSSARY))
    return Section("believe", "What to believe here, and why", tuple(blocks))


def map_caption(campaign: Campaign, trial: Trial, belief: Belief) -> str:
    """What the map shows, and where it ends."""
    place = belief.proven.applies(campaign.setting.pool_q).place
    edge, outside = (int((place == word).sum()) for word in ("edge", "outside"))
    text = (
        f"Where the mean tool point of {trial.name} is known how well: believed standard "
        "uncertainty (3-D, k = 1; parameters and hidden misfit, which grows where more of it "
        "reaches the tool than at the held-out poses) over the postures of the pool that reach a "
        f"cell of {1e3 * plots_uncertainty.CELL:.0f} mm (root mean square over the cells behind "
        "it)."
    )
    if edge:
        text += f" {counted(edge, 'posture')} of {len(place)} lie at the edge of what was proven."
    if outside:
        text += f" {counted(outside, 'posture')} outside of it are left out."
    return text


def statement_table(campaign: Campaign, statements: list[tuple[Trial, Statement]]) -> Table:
    """One row per statement: what it promises, its radius, what of the truth it holds."""
    rows: list[tuple[str, ...]] = []
    strong = []
    for trial, statement in statements:
        for k, name in enumerate(statement.names):
            if name in BELIEVED:
                strong.append(len(rows))
            rows.append(
                (
                    trial.name if k == 0 else "",
                    WORDS[name],
                    PROMISES[name],
                    micrometres(float(statement.radius[k])),
                    percent(float(statement.attained[k])),
                    "believed" if name in BELIEVED else standing(statement, name),
                )
            )
    judges = counted(len(campaign.validation.judge_q), "further pose")
    return Table(
        caption=f"Statements about the tool point at {LEVEL * 100:.0f}{NARROW}%",
        head=("trial", "statement", "of what, and on which terms", "radius µm", "share inside", ""),
        rows=tuple(rows),
        align="lllrrl",
        strong=tuple(strong),
        size="small",
        note="radius: 3-D radius that holds the point with 95 % probability at poses like the "
        "held-out ones (R95). share inside, known in a simulation only: of the true tool points, "
        f"or of the ends of single moves, at {judges}, on which no statement rests; poses of one "
        "robot share its error, so a share may miss the promise by chance. contradicted: by "
        "residuals, repeats or held-out poses. not needed: "
        "nothing contradicts it, and what hides behind the noise is not in it.",
    )


def standing(statement: Statement, name: str) -> str:
    """How a statement stands beside the believed one, in a word or two."""
    if name == "conformal":
        return "not needed" if statement.belief is not None else "needs no model"
    if name == "discrepancy":
        return "approximate"
    return "contradicted" if statement.trust.refuted else "not needed"


def tests_table(statements: list[tuple[Trial, Statement]]) -> Table:
    """Distinct questions asked of the same readings, and what comes of them together."""
    rows = []
    for trial, statement in statements:
        asked = statement.questions
        names = (trial.name, *[""] * len(asked.names))
        answers = zip(asked.names, asked.p_values, asked.adjusted, strict=True)
        for first, (name, p, adjusted) in zip(names, answers, strict=False):
            answer = "yes" if adjusted < QUESTION_LEVEL else "not seen"
            frame = statement.frame
            if answer == "yes" and name == "another frame" and frame and not frame.found:
                answer = "in part" if frame.in_part else "by less than the region holds"
            rows.append((first, QUESTIONS[name], probability(p), probability(adjusted), answer))
        answer = "nothing seen, which is no proof" if asked.agree else "larger than the noise"
        first = "" if asked.names else trial.name
        rows.append((first, "all readings together", probability(asked.combined), "", answer))
    return Table(
        caption="Tests, together",
        head=("trial", "question", "p", "p, adjusted", "answer"),
        rows=tuple(rows),
        align="llrrl",
        size="small",
        note="p: chance of as much if nothing is wrong. adjusted (Holm): so that all questions "
        "together raise a false alarm in one campaign of a hundred. all readings together: "
        "residuals and held-out errors against the stated noise (Fisher). No test sees a misfit "
        "much below the noise: what is not seen is not ruled out, and the believed region has it "
        "up to the limit of the evidence.",
    )


def reasons(statement: Statement, *, brief: bool = False) -> tuple[str, ...]:
    """Sentences that weigh one calibration: what is believed first, then shots, repeats, warnings.

    A brief account leaves out what says the same of every trial.
    """
    texts, point = [*statement.trust.sentences], statement.point
    if brief:
        moves = texts[1:2] if point is not None and point.move_sentence else []
        return tuple(map(written, (texts[0], *moves, *statement.outliers, *statement.warnings)))
    if point is not None and np.isnan(point.u_move):
        texts.insert(
            1,
            "where one move ends is not stated: this scenario gives the joints no scatter of their "
            "own, it is part of the stated noise",
        )
    lack = statement.lack_of_fit
    if lack is not None and not statement.trust.refuted:
        texts.append(
            "all visits fitted together, no more misfit is seen than repeats scatter (F = "
            f"{lack.ratio:.2f}, p = {significant(lack.p_value, 2)})"
        )
    if statement.larger_noise_u and statement.belief is not None:
        factor = statement.belief.misfit.larger_noise
        texts.append(
            f"readings and repeats ask for {factor:.2f} times the stated noise: it is in the region"
        )
    texts += [*statement.outliers, *statement.warnings]
    return tuple(map(written, texts))


def budget_table(statements: list[tuple[Trial, Statement]]) -> Table:
    """Sources in rows, trials in columns."""
    names = list(dict.fromkeys(name for _, statement in statements for name in statement.sources))
    rows = []
    for name in names:
        cells = []
        for _, statement in statements:
            if name not in statement.sources:
                cells += ["–", "–"]
                continue
            u = float(statement.source_u[statement.sources.index(name)])
            cells += [micrometres(u), percent((u / statement.combined_u) ** 2)]
        rows.append((name, *cells))
    sums: dict[str, list[str]] = {}
    for k, (_, statement) in enumerate(statements):
        for name, u in sums_of(statement).items():
            cells = sums.setdefault(name, ["–", ""] * len(statements))
            cells[2 * k] = micrometres(u)
    rows += [(name, *sums[name]) for name in SUMS if name in sums]
    return Table(
        caption="Uncertainty budget by source, at the tool point",
        head=("source", *[h for trial, _ in statements for h in (f"{trial.name} u µm", "share")]),
        rows=tuple(rows),
        align="l" + "rr" * len(statements),
        size="small" if len(statements) > 2 else "normal",
        strong=tuple(k for k, row in enumerate(rows) if row[0] in ("parameters alone", "believed")),
        note=BUDGET_NOTE,
    )


def written(text: str) -> str:
    """The text as a sentence, numbers and units as the report writes them."""
    return sentence(TINY.sub("p < 0.001", typeset(text)), keep_name=True)
