"""The statements of each calibration in the report, and the evidence for them."""

import re
from collections.abc import Sequence

import numpy as np

from calib.identification.result import Reason
from calib.uncertainty.statement.belief import Belief
from testbed.lengths import column_unit
from testbed.report.choice import choice_tables
from testbed.report.page import Block, Figure, Points, Table, Text, printed
from testbed.studies.trial import plots, plots_uncertainty
from testbed.studies.trial.estimator import AS_ASKED
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.trial.statement.records import SUMS, Statement, sums_of
from testbed.units import UM, counted, percent, probability, sentence, significant, typeset

NONE = "–"
COLUMNS = {
    "region": "believed",
    "move": "one move",
    "parameters": "parameters alone",
    "discrepancy": "with discrepancy",
    "conformal": "conformal ball",
}
"""Statements with a column; the bootstrap has those of the parameters alone."""
REFUTED = "✗"
TINY = re.compile(r"p (= [0-9.]+e-[0-9]+|< 1e-300)")
"""Pattern of a tiny p-value, which is shortened."""
BUDGET_NOTE = (
    "Over the held-out poses (3-D, k = 1, rms). noise beyond the stated: as repeats or angles "
    "show. believed: the sum, enlarged where held-out poses require a larger k. discrepancy: what "
    "these show beyond the parameters alone; not part of the sum."
)
QUESTIONS = {"misfit": "misfit p", "another frame": "another frame p", "drift": "drift p"}
LEAST_SOURCES = 3
"""Fewest sources of a budget for a figure."""


def statement_blocks(campaign: Campaign) -> list[Block]:
    """Every statement, its coverage of the truth, which one is believed, and why."""
    made = ((trial, estimate.statement) for trial, estimate in campaign.estimates)
    statements = [(trial, statement) for trial, statement in made if statement is not None]
    if not statements:
        return []
    shown = statements[: plots.MOST_PANELS]
    first, stated = shown[0]
    blocks: list[Block] = [statement_table(campaign, statements), Points(weighed(shown))]
    blocks += choice_tables(stated.offered, stated.steps)
    blocks += [question_table(shown), budget_table(shown)]
    if max(len(statement.sources) for _, statement in shown) >= LEAST_SOURCES:
        blocks.append(
            Figure(
                "What each source leaves at the tool point, u over the held-out poses"
                f"{plots.only(statements)}; open: not part of the sum.",
                plots_uncertainty.budget_bars([(trial.name, one) for trial, one in shown]),
            )
        )
    if stated.belief is not None:
        made_map = plots_uncertainty.tool_views(campaign, first)
        mapped = f"Believed u of the mean tool point of {first.name}"
        cells = f"root mean square in cells of {1e3 * plots_uncertainty.CELL:.0f} mm"
        ends = map_ends(campaign, stated.belief)
        if made_map.flat:
            scale, unit = column_unit(made_map.high / UM)
            low, high = (significant(u / UM * scale, 2) for u in (made_map.low, made_map.high))
            text = f"{mapped}: {low} to {high} {unit} everywhere in the pool ({cells}){ends}."
            blocks.append(Text(text))
        else:
            text = f"{mapped} over the postures of the pool, {cells}{ends}."
            blocks.append(Figure(text, plots_uncertainty.tool_maps(made_map), "half"))
    return blocks


def weighed(statements: list[tuple[Trial, Statement]]) -> tuple[str, ...]:
    """Reasons for each calibration: all for the first, for the others those not yet given."""
    found = []
    for k, (trial, statement) in enumerate(statements):
        chosen = Reason(statement.model, statement.levels, statement.because)
        if chosen.because and chosen != AS_ASKED:  # older records do not hold it
            found.append(f"{trial.name}: {chosen.model} model{chosen.levels}, {chosen.because}.")
        said = reasons(statement, brief=k > 0)
        found += said if k == 0 else [f"{trial.name}: {shorter(text, found)}" for text in said]
    return tuple(found)


def shorter(text: str, before: Sequence[str]) -> str:
    """A sentence without the part after its colon, if an earlier one has the same part."""
    first, colon, rest = text.partition(": ")
    return f"{first}." if colon and any(one.endswith(rest) for one in before) else text


ELSEWHERE = (
    "No test of the", "Apart from what stands out: no test of the",
    "The parameters alone do not explain the readings",
)  # fmt: skip
"""Beginnings of sentences that repeat the table of tests and the reasons of the verdict."""


def map_ends(campaign: Campaign, belief: Belief) -> str:
    """Postures of the pool at the edge of what was proven, and outside, in words."""
    place = belief.proven.applies(campaign.setting.pool_q).place
    edge, outside = (int((place == word).sum()) for word in ("edge", "outside"))
    text = ""
    if edge:
        text += f"; {edge} of {len(place)} postures lie at the edge of what was proven"
    if outside:
        text += f"; {counted(outside, 'posture')} outside of it are left out"
    return text


def statement_table(campaign: Campaign, statements: list[tuple[Trial, Statement]]) -> Table:
    """One row per trial: the radius of each statement, and its coverage of the truth."""
    names = [n for n in COLUMNS if any(n in one.names for _, one in statements)]
    rows = []
    scale, unit = column_unit([radius for _, one in statements for radius in one.radius])
    for trial, statement in statements:
        cells = []
        for name in names:
            if name not in statement.names:
                cells += [NONE, NONE]
                continue
            k = statement.names.index(name)
            mark = f" {REFUTED}" * (name == "parameters" and statement.trust.refuted)
            radius = significant(float(statement.radius[k]) * scale)
            cells += [f"{radius}{mark}", percent(float(statement.attained[k]))]
        rows.append((trial.name, *cells))
    judges = counted(len(campaign.validation.judge_q), "further pose")
    return Table(
        caption=(
            f"R95 of the tool point by each statement [{unit}], and the true points inside at "
            f"{judges}"
        ),
        head=("trial", *(h for name in names for h in (f"{COLUMNS[name]} {unit}", "inside"))),
        rows=tuple(rows),
        size="small",
        on_paper=printed(len(rows)),
        note="believed: mean of many moves, with misfit up to its limit, shared errors and drift. "
        "parameters alone: right if the model is complete and the noise is as stated; "
        f"{REFUTED}: contradicted. with discrepancy: right if model errors are alike everywhere. "
        "conformal ball: for a further reading with its noise; needs no model. inside: share of "
        "true points; the points of one robot share its error, so chance alone may miss 95 %.",
    )


def question_table(statements: list[tuple[Trial, Statement]]) -> Table:
    """The tests of the same readings, and their joint result."""
    asked = [name for name in QUESTIONS if any(name in s.questions.names for _, s in statements)]
    rows = []
    for trial, statement in statements:
        found = statement.questions
        adjusted = dict(zip(found.names, found.adjusted, strict=True))
        p = (probability(adjusted[name]) if name in adjusted else NONE for name in asked)
        rows.append((trial.name, *p, probability(found.combined), answer(statement)))
    return Table(
        caption="Tests of the readings",
        head=("trial", *(QUESTIONS[name] for name in asked), "all readings p", "answer"),
        rows=tuple(rows),
        align="l" + "r" * (len(asked) + 1) + "l",
        size="small",
        note="p: probability of such readings if nothing is wrong, adjusted (Holm). all "
        "readings: residuals and held-out errors against the stated noise (Fisher). That nothing "
        "is found proves nothing.",
    )


def answer(statement: Statement) -> str:
    """Joint result of the tests in a few words."""
    found, frame = statement.questions, statement.frame
    seen = []
    for name in found.said:
        by = ""
        if name == "another frame" and frame is not None and not frame.found:
            by = " in part" if frame.in_part else " by less than the region allows for"
        seen.append(f"{name}{by}")
    if statement.strays is not None:
        count = len(statement.strays.poses)
        seen.append(f"{counted(count, 'pose')} {'stands' if count == 1 else 'stand'} out")
    if not seen and not found.agree:
        return "larger than the noise"
    return ", ".join(seen) or "nothing found"


def reasons(statement: Statement, *, brief: bool = False) -> tuple[str, ...]:
    """Sentences on one calibration: parts of the region, then outliers, repeats and warnings.

    The radius itself is in a table. A brief account leaves out what tables have for every trial.
    """
    point = statement.point
    stated = point.sentence[1:] if point is not None else "\n"
    texts = [text for text in statement.trust.sentences if not text[1:].startswith(stated)]
    if point is not None:
        texts = [text for text in texts if not text.startswith(ELSEWHERE)]
    if brief:
        frame = statement.frame
        framed = frame is not None and (frame.found or frame.in_part)
        first = int(framed) + int(statement.strays is not None)
        texts = texts[: 1 if point is None else first]
        return tuple(map(written, (*texts, *statement.outliers, *statement.warnings)))
    if point is not None and np.isnan(point.u_move):
        texts.insert(
            0, "nothing is stated about single moves: the joints have no repeatability error here"
        )
    lack = statement.lack_of_fit
    if lack is not None and not statement.trust.refuted:
        texts.append(
            "all visits fitted together show no misfit beyond the scatter of repeats (F = "
            f"{lack.ratio:.2f}, p = {significant(lack.p_value, 2)})"
        )
    belief = statement.belief
    if belief is not None and (factor := belief.misfit.larger_noise) > 1:
        texts.append(
            f"readings and repeats show {factor:.2f} times the stated noise, which the region "
            "includes"
        )
    texts += [*statement.outliers, *statement.warnings]
    return tuple(map(written, texts))


def budget_table(statements: list[tuple[Trial, Statement]]) -> Table:
    """Sources in rows, trials in columns."""
    names = list(dict.fromkeys(name for _, statement in statements for name in statement.sources))
    scale, unit = column_unit(
        [u for _, one in statements for u in (*one.source_u, *sums_of(one).values())]
    )
    rows = []
    for name in names:
        cells = []
        for _, statement in statements:
            if name not in statement.sources:
                cells.append(NONE)
                continue
            u = float(statement.source_u[statement.sources.index(name)])
            cells.append(significant(u * scale))
        rows.append((name, *cells))
    sums: dict[str, list[str]] = {}
    for k, (_, statement) in enumerate(statements):
        for name, u in sums_of(statement).items():
            cells = sums.setdefault(name, [NONE] * len(statements))
            cells[k] = significant(u * scale)
    rows += [(name, *sums[name]) for name in SUMS if name in sums]
    return Table(
        caption=f"Uncertainty budget at the tool point, u [{unit}]",
        head=("source", *(trial.name for trial, _ in statements)),
        rows=tuple(rows),
        size="small" if len(statements) > 2 else "normal",
        strong=tuple(k for k, row in enumerate(rows) if row[0] in ("parameters alone", "believed")),
        note=BUDGET_NOTE,
    )


def written(text: str) -> str:
    """The text as a sentence, numbers and units as the report writes them."""
    return sentence(TINY.sub("p < 0.001", typeset(text)), keep_name=True)
