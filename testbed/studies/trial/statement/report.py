"""The statement of each calibration in the report: what to believe, why, and the secret."""

import re

import numpy as np

from calib.uncertainty.discrepancy import Discrepancy
from testbed.report.page import Block, Figure, Points, Section, Table, Text
from testbed.studies.trial import plots, plots_uncertainty
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.trial.statement.records import LEVEL, Statement
from testbed.units import (
    NARROW,
    counted,
    micrometres,
    millimetres,
    percent,
    sentence,
    significant,
    typeset,
)

WORDS = {
    "model": "model-based region",
    "bootstrap": "region of the bootstrap",
    "discrepancy": "region with discrepancy",
    "conformal": "conformal ball",
}
TINY = re.compile(r"p (= [0-9.]+e-[0-9]+|< 1e-300)")
"""A p-value that nobody reads."""
BUDGET_NOTE = (
    "u: 3-D standard uncertainty (k = 1) that the source alone leaves at the tool, root mean "
    "square over the held-out poses. share: of the variance. discrepancy: what measured held-out "
    "poses show beyond all of these, chance included; it is no part of the model-based statement."
)
AGREE = 0.05
"""p-value of the held-out errors from which their discrepancy counts as chance."""
MEANINGS = {
    "geometry": "link lengths, offsets and angles",
    "frames": "base and tool placement",
    "gravity": "joints that sag under the arm's own weight",
    "harmonics": "gear errors, once and twice a turn",
    "high_harmonics": "gear errors, three and seven times a turn",
    "encoder": "errors between two lines of the encoders",
    "backlash": "play of the gears",
    "thermal": "links that grow warm",
    "elastic": "drives and links that give way under load",
    "repeatability": "scatter of every new approach",
}
"""What each term of the truth stands for."""


def statement_section(campaign: Campaign) -> Section | None:
    """Every statement made, how much of the truth it holds, which to believe, and why."""
    made = ((trial, estimate.statement) for trial, estimate in campaign.estimates)
    statements = [(trial, statement) for trial, statement in made if statement is not None]
    if not statements:
        return None
    shown = statements[: plots.MOST_PANELS]
    blocks: list[Block] = [statement_table(campaign, statements)]
    for k, (trial, statement) in enumerate(shown):
        why = statement.why.partition(": ")[2]
        blocks.append(Text(f"{trial.name}, {statement.model} model: {why}."))
        blocks.append(Points(reasons(statement, brief=k > 0)))
    blocks.append(budget_table(shown))
    blocks.append(
        Figure(
            "What each source leaves at the tool point, standard uncertainty over the held-out "
            f"poses{plots.only(statements)}; open: the discrepancy, which no source explains.",
            plots_uncertainty.budget_bars([(trial.name, statement) for trial, statement in shown]),
        )
    )
    first, stated = shown[0]
    included = flat = ""
    if not stated.trust.model_valid:
        known = stated.discrepancy is not None
        included = ", discrepancy included" if known else "; model-based, which is not valid here"
        # nan where no discrepancy could be estimated
        if stated.discrepancy_u >= stated.combined_u:
            flat = " The discrepancy is one figure for the whole room, so the map is flat."
    blocks.append(
        Figure(
            f"Where the tool point of {first.name} is known how well: standard uncertainty "
            f"(3-D, k = 1{included}) over the postures of the pool that reach a cell of "
            f"{1e3 * plots_uncertainty.CELL:.0f} mm (root mean square over the cells behind it)."
            f"{flat}",
            plots_uncertainty.tool_maps(campaign, first),
        )
    )
    return Section("believe", "What to believe here, and why", tuple(blocks))


def statement_table(campaign: Campaign, statements: list[tuple[Trial, Statement]]) -> Table:
    """One row per statement: radius, what of the truth it holds, and whether to believe it."""
    rows: list[tuple[str, ...]] = []
    strong = []
    for trial, statement in statements:
        for k, name in enumerate(statement.names):
            believed = name == statement.trust.believe
            if believed:
                strong.append(len(rows))
            rows.append(
                (
                    trial.name if k == 0 else "",
                    WORDS[name],
                    micrometres(float(statement.radius[k])),
                    percent(float(statement.attained[k])),
                    "yes" if believed else refused(statement, name),
                )
            )
    judges = counted(len(campaign.validation.judge_q), "further pose")
    return Table(
        caption=f"Statements about the tool point at {LEVEL * 100:.0f}{NARROW}%",
        head=("trial", "statement", "radius µm", "share inside", "believe"),
        rows=tuple(rows),
        align="llrrl",
        strong=tuple(strong),
        note="radius: of the ball with the volume of the region, mean over poses. share "
        f"inside: of the true tool points, at {judges}, which no statement rests on; their "
        "errors hang together, so one robot may miss the promise by chance. believe: what residuals"
        ", repeats and the measured held-out poses say, without the truth.",
    )


def refused(statement: Statement, name: str) -> str:
    """Why a statement is not the one to believe, in a word."""
    if statement.trust.model_valid:
        return "not needed"
    return "NO" if name in ("model", "bootstrap") else "approximate"


def reasons(statement: Statement, *, brief: bool = False) -> tuple[str, ...]:
    """Sentences that weigh one calibration: verdict first, then shots, repeats, warnings.

    A brief account leaves out what says the same of every trial.
    """
    texts = [*statement.trust.sentences]
    if brief:
        return tuple(written(text) for text in (texts[0], *statement.outliers, *statement.warnings))
    lack = statement.lack_of_fit
    if lack is not None and statement.trust.model_valid:
        texts.append(
            "all visits fitted together, the misfit is what repeats scatter (F = "
            f"{lack.ratio:.2f}, p = {significant(lack.p_value, 2)})"
        )
    if statement.discrepancy is not None and statement.trust.believe != "discrepancy":
        texts.append(discrepancy_words(statement, statement.discrepancy))
    texts += [*statement.outliers, *statement.warnings]
    return tuple(map(written, texts))


def discrepancy_words(statement: Statement, discrepancy: Discrepancy) -> str:
    """What held-out poses show beyond the statement; or that it is no more than chance."""
    if statement.held_out.p_value < AGREE or not discrepancy.covariance.any():
        return discrepancy.sentence
    return (
        f"the discrepancy of {1e6 * statement.discrepancy_u:.0f} um (3-D, one standard deviation) "
        f"is no more than chance makes of {discrepancy.n_poses} held-out poses"
    )


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
    combined, left = ["combined"], ["discrepancy"]
    for _, statement in statements:
        u = statement.discrepancy_u
        combined += [micrometres(statement.combined_u), ""]
        left += ["–" if np.isnan(u) else micrometres(u), ""]
    rows += [tuple(combined), tuple(left)]
    return Table(
        caption="Uncertainty budget by source, at the tool point",
        head=("source", *[h for trial, _ in statements for h in (f"{trial.name} u µm", "share")]),
        rows=tuple(rows),
        align="l" + "rr" * len(statements),
        size="small" if len(statements) > 2 else "normal",
        strong=(len(names),),
        note=BUDGET_NOTE,
    )


def secret_section(campaign: Campaign) -> Section:
    """How far each term of the truth alone moves the tool."""
    validation = campaign.validation
    sizes = zip(validation.terms, validation.term_rms, strict=True)
    rows = [
        (term, MEANINGS.get(term, ""), millimetres(float(rms)))
        for term, rms in sorted(sizes, key=lambda pair: -pair[1])
    ]
    rows.append(("all together", "", millimetres(validation.together_rms)))
    table = Table(
        caption="Tool displacement by each term of the truth alone",
        head=("term", "what it is", "rms mm"),
        rows=tuple(rows),
        align="llr",
        strong=(len(rows) - 1,),
        note=f"True minus nominal tool position, root mean square over "
        f"{counted(len(campaign.setting.test_q), 'held-out pose')}. Terms add as vectors: beyond "
        f"their sum they do {millimetres(validation.interaction_rms, 2)} mm together.",
    )
    return Section(
        "secret",
        "The secret: what makes this robot wrong",
        (Text(secret_words(rows)), table),
        part="campaign",
    )


def secret_words(rows: list[tuple[str, str, str]]) -> str:
    """The largest term in words; what a model without it cannot follow."""
    if len(rows) == 1:
        return "Nothing: the true robot is the nominal one."
    name, meaning, size = rows[0]
    text = f"Most of this robot's error is {name.replace('_', ' ')} ({meaning}): {size} mm."
    unmodelled = [row for row in rows[:-1] if row[0] not in ("geometry", "frames", "repeatability")]
    if not unmodelled:
        return f"{text} Nothing that a geometric model cannot follow is switched on."
    texts = ", ".join(f"{row[0].replace('_', ' ')} {row[2]} mm" for row in unmodelled)
    return f"{text} Beyond any geometric model: {texts}."


def written(text: str) -> str:
    """The text as a sentence, numbers and units as the report writes them."""
    return sentence(TINY.sub("p < 0.001", typeset(text)), keep_name=True)
