"""The report's comparison with Wen et al. 2022: Tables 1 to 3, claim by claim."""

import re
from collections.abc import Callable, Sequence

from testbed.report.page import Block, Figure, Section, Table, Text, table_of
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.report_accuracy import NONE
from testbed.studies.wen2022 import paper, plots
from testbed.studies.wen2022.budget import fewer_than_usual
from testbed.studies.wen2022.calibrated_sets.summary import OverSets, TableRow, table_rows
from testbed.studies.wen2022.claims import CLAIMS, Examined, plays_paper
from testbed.studies.wen2022.claims_one_robot import held_out_before
from testbed.studies.wen2022.finding import Finding
from testbed.studies.wen2022.paper_set import stand_in
from testbed.studies.wen2022.ratio import printed_split
from testbed.studies.wen2022.records import PaperBudget, paper_budget_of
from testbed.studies.wen2022.stated import Judged, judged_statements
from testbed.studies.wen2022.tables import of_columns
from testbed.units import MM, counted, fixed, listed, percent

THIS = "this campaign"


def error_table(campaign: Campaign) -> Table | None:
    """Tables 1 and 2 as printed beside ours; None if the campaign plays no set of the paper."""
    ours = table_rows(campaign)
    if all(own is None for own in ours):
        return None
    kinds = [
        printed.kind + (f", {counted(own.sets, 'set')}" if own and own.sets > 1 else "")
        for printed, own in zip(paper.SETS, ours, strict=True)
    ]

    def cells(figure: Callable[[TableRow], OverSets | None]) -> list[str]:
        """One figure of each row [mm]."""
        found = [None if own is None else figure(own) for own in ours]
        return [NONE if one is None else one.millimetres for one in found]

    columns = {
        "poses": kinds,
        "Table 1: before, printed": [fixed(printed.before_mm, 3) for printed in paper.SETS],
        "ours": cells(lambda row: row.own_before),
        "after, printed": [fixed(printed.after_mm, 3) for printed in paper.SETS],
        "ours ": cells(lambda row: row.own_after),
        "Table 2: after, printed": [fixed(printed.held_out_mm, 3) for printed in paper.SETS],
        "ours  ": cells(lambda row: row.error),
    }
    before = fixed(held_out_before(campaign) * MM, 3)
    many = any(own is not None and own.sets > 1 for own in ours)
    spread = "; ± standard deviation between random sets" * many
    return of_columns(
        f"Mean position error [mm] on the fitted poses (Table 1) and held out (Table 2){spread}",
        columns,
        size="small",
        note=f"Held out before: printed {fixed(paper.TABLE2_BEFORE_MM, 3)}, ours {before}. The "
        "true robot is drawn, not the paper's: figures agree in kind, not in digits.",
    )


def ratio_table(budget: PaperBudget, unlike: str) -> Table:
    """The ratio of every designed set to the random side, the printed one first."""
    printed = (paper.PARAMETER_RATIO, printed_split().repeats.value)
    columns = {
        "optimal set": ["printed", *budget.trials],
        "u best / u random": [fixed(one, 2) for one in (printed[0], *budget.ratio.tolist())],
        "u_r best / u_r random": [
            fixed(one, 2) for one in (printed[1], *budget.repeats_ratio.tolist())
        ],
    }
    return of_columns(
        f"Table 3: mean ratios over the {len(budget.names)} numbers",
        columns,
        strong=(0,),
        note="u_r: repeats. u best is u_r of the optimal set alone, u random has number and place "
        f"of the poses as well: not like for like. {unlike}".rstrip(),
    )


def paper_section(campaign: Campaign, examined: Examined | None) -> Section | None:
    """The claims, then printed figures beside ours; None if nothing of the paper is played."""
    if examined is None or not (examined.robots or plays_paper(campaign.scenario)):
        return None
    # with many robots the claims come first in the report
    blocks: list[Block] = [] if examined.robots else [claim_table(examined)]
    if examined.silent:
        silent = listed([str(number) for number in examined.silent])
        blocks.append(Text(f"Not examined: claims {silent}, not played here (scene wen2022 does)."))
    errors = error_table(campaign)
    blocks += [] if errors is None else [errors]
    budget = paper_budget_of(campaign)
    if budget is not None:
        caption = (
            f"Combined parameter uncertainties of the optimal set, ours {budget.trials[0]}, and of "
            "the random protocol."
        )
        fewer = fewer_than_usual(campaign.setting, campaign.scenario.budget)
        said = f"{fewer} {stand_in(campaign.scenario)}".strip()
        blocks += [ratio_table(budget, said), Figure(caption, plots.parameter_budget(budget))]
    stated = [one for trial in campaign.trials if (one := judged_statements(campaign, trial))]
    if stated:
        blocks.append(statement_table(stated))
    blocks.append(Text(misprints()))
    many = bool(examined.robots)
    title = "on this campaign's robot" if many else "claim by claim"
    return Section(
        "paper", f"Wen et al. 2022, {title}", tuple(blocks), part="detail", on_paper=not many
    )


def statement_table(found: Sequence[Judged]) -> Table:
    """The 95 % statements of each set, and how often they contain the truth on this robot."""
    columns = {
        "set": [one.trial for one in found],
        "mean error mm": [fixed(one.error * MM, 3) for one in found],
        "type A: u of |P| mm": [fixed(one.distance_u * MM, 4) for one in found],
        "type A: t": [fixed(one.factor, 2) for one in found],
        "type A: |P| in t u": [percent(one.type_a[0]) for one in found],
        "type A: point in t u": [percent(one.type_a[1]) for one in found],
        "unweighted fit: point in region": [percent(one.unweighted) for one in found],
    }
    runs = found[0].replications
    over = f"over {runs} replications" if runs else "on this one calibration"
    return of_columns(
        "Statements of the paper, and by the covariance of its fit: shares that contain the truth, "
        "of 95 % stated",
        columns,
        size="small",
        note="type A, the scatter of repeats, is what the paper states (t: Student's factor of "
        "the repeats); the covariance of its fit, "
        f"s² inv(J'WJ) with s² = RSS / (12 m − f), is not in the paper and judged as well, {over}. "
        "Neither includes what the model lacks.",
    )


def misprints() -> str:
    """Differences between the printed forms and those used here, with reasons (`paper`)."""
    return f"Not used as printed: {'; '.join(one.what for one in paper.MISPRINTS)}."


def claim_table(examined: Examined) -> Table:
    """Each claim: printed, ours, verdict, and the reason if it does not hold as printed."""
    speaks, here = f"{THIS} says", THIS
    note = (
        "One true robot can contradict a general statement, but not prove an average over robots."
    )
    if examined.robots:
        speaks, here = f"{examined.robots} robots of each kind say", "here"
        note = (
            "Claims 9 and 12 to 16 were examined over pools and robots, with 95 % intervals; 1 to "
            "8, 10, 11 and 17 are arithmetic on what is printed, the nominal robot and its indices."
        )
    rows = [
        {
            "#": str(number),
            "claim": CLAIMS[number].statement,
            "verdict": found.verdict,
            here: found.ours if measured(number, found) else clause(found.sentence),
        }
        for number, found in examined.findings.items()
    ]
    caption = (
        f"What the paper says and what {speaks}: {examined.count('holds')} of {len(rows)} examined "
        "claims hold"
    )
    note += " Reasons in full: result.json."
    return table_of(rows, caption, align="rlll", size="small", note=note)


def measured(number: int, found: Finding) -> bool:
    """Whether the figure is enough: the claim holds, or many robots were measured for it."""
    return found.verdict == "holds" or CLAIMS[number].over is not None


def clause(text: str) -> str:
    """The first clause of some sentences, with the reason against a claim."""
    return f"{re.split(r'[.:;] ', text)[0].rstrip('.')}."
