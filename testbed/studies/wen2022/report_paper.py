"""The report's comparison with Wen et al. 2022: Tables 1 to 3, claim by claim."""

from collections.abc import Callable, Sequence

from testbed.report.page import Block, Figure, Section, Table, Text, table_of
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.report_accuracy import NONE
from testbed.studies.wen2022 import paper, plots
from testbed.studies.wen2022.budget import fewer_than_usual
from testbed.studies.wen2022.calibrated_sets.summary import OverSets, TableRow, table_rows
from testbed.studies.wen2022.claims import CLAIMS, Examined
from testbed.studies.wen2022.claims_one_robot import held_out_before
from testbed.studies.wen2022.paper_set import stand_in
from testbed.studies.wen2022.records import (
    PaperBudget,
    paper_budget_of,
)
from testbed.studies.wen2022.stated import Judged, judged_statements
from testbed.studies.wen2022.tables import of_columns, table3
from testbed.units import MM, counted, fixed, percent

THIS = "this campaign"


def error_tables(campaign: Campaign) -> tuple[Table, ...]:
    """Tables 1 and 2 as printed beside ours; none if the campaign plays no set of the paper."""
    ours = table_rows(campaign)
    if all(own is None for own in ours):
        return ()
    kinds = [
        printed.kind + (f", {counted(own.sets, 'set')}" if own and own.sets > 1 else "")
        for printed, own in zip(paper.SETS, ours, strict=True)
    ]

    def cells(figure: Callable[[TableRow], OverSets | None]) -> list[str]:
        """One figure of each row [mm]."""
        found = [None if own is None else figure(own) for own in ours]
        return [NONE if one is None else one.millimetres for one in found]

    own_poses = {
        "poses": kinds,
        "before, printed": [fixed(printed.before_mm, 3) for printed in paper.SETS],
        "before, ours": cells(lambda row: row.own_before),
        "after, printed": [fixed(printed.after_mm, 3) for printed in paper.SETS],
        "after, ours": cells(lambda row: row.own_after),
    }
    before = fixed(held_out_before(campaign) * MM, 3)
    held_out = {
        "poses": kinds,
        "before, printed": [fixed(paper.TABLE2_BEFORE_MM, 3)] * len(kinds),
        "before, ours": [NONE if own is None else before for own in ours],
        "after, printed": [fixed(printed.held_out_mm, 3) for printed in paper.SETS],
        "after, ours": cells(lambda row: row.error),
        "after, noise weighed": cells(lambda row: row.weighed),
    }
    unit = " [mm]; ours in paper mode on our own true robot"
    many = any(own is not None and own.sets > 1 for own in ours)
    spread = "; ± is the standard deviation between random sets" if many else ""
    return (
        of_columns(
            f"Table 1: mean position error on the calibration poses{unit}{spread}", own_poses
        ),
        of_columns(
            f"Table 2: mean position error on the held-out poses{unit}{spread}",
            held_out,
            note="The true robot is drawn, not the paper's: figures agree in kind, not in digits.",
        ),
    )


def budget_table(budget: PaperBudget, unlike: str) -> Table:
    """Table 3: contributors and combined uncertainty of each parameter, printed and ours."""
    return table3(
        f"Table 3: parameter uncertainties, printed / ours with {budget.trials[0]} as optimal set",
        "u_r: repeats; u_p: number of poses; u_w: place of the poses. u best combines u_r of the "
        "optimal set alone, u random all three: not like for like. The printed u random of beta2 "
        f"(0.0036) is not the root sum of squares of its components (0.0025). {unlike}".rstrip(),
        budget.names,
        {
            "u_r_best": [budget.best_repeatability[0]],
            "u_r_random": [budget.repeatability],
            "u_p_random": [budget.pose_number],
            "u_w_random": [budget.location],
            "u_best": [budget.best[0]],
            "u_random": [budget.random],
        },
        [budget.best[0] / budget.random],
    )


def ratio_table(budget: PaperBudget) -> Table:
    """The ratio of every designed set to the random side, the paper's first."""
    columns = {
        "optimal set": list(budget.trials),
        "u best / u random": [fixed(float(ratio), 2) for ratio in budget.ratio],
        "u_r best / u_r random": [fixed(float(ratio), 2) for ratio in budget.repeats_ratio],
    }
    return of_columns(
        f"Mean ratio over the {len(budget.names)} numbers, for every designed set",
        columns,
        strong=(0,),
        note="The random side is the same for all: one random set repeated, and random sets of "
        "other sizes and places. The first set is the one of Table 3 above.",
    )


def paper_section(campaign: Campaign, examined: Examined | None) -> Section | None:
    """Printed tables beside ours, then the claims."""
    if examined is None:
        return None
    blocks: list[Block] = list(error_tables(campaign))
    budget = paper_budget_of(campaign)
    if budget is not None:
        caption = (
            f"Combined parameter uncertainties of the optimal set, ours {budget.trials[0]}, and of "
            "the random protocol."
        )
        fewer = fewer_than_usual(campaign.setting, campaign.scenario.budget)
        said = budget_table(budget, f"{fewer} {stand_in(campaign.scenario)}".strip())
        blocks += [said, ratio_table(budget), Figure(caption, plots.parameter_budget(budget))]
    stated = [one for trial in campaign.trials if (one := judged_statements(campaign, trial))]
    if stated:
        blocks.append(statement_table(stated))
    blocks.append(misprint_table())
    if not examined.robots:  # else they stand first in the report
        blocks.append(claim_table(examined))
    if examined.silent:
        listed = ", ".join(str(number) for number in examined.silent)
        text = (
            f"Not examined here: claims {listed}, which need pose sets or studies that this "
            "campaign does not play (scene wen2022 plays them all)."
        )
        blocks.append(Text(text))
    title = "its tables on this campaign's robot" if examined.robots else "claim by claim"
    return Section("paper", f"Wen et al. 2022, {title}", tuple(blocks), part="detail")


def statement_table(found: Sequence[Judged]) -> Table:
    """What is stated at 95 % of each set, and what of it holds on this robot."""
    columns = {
        "set": [one.trial for one in found],
        "mean error mm": [fixed(one.error * MM, 3) for one in found],
        "type A: u of |P| mm": [fixed(one.distance_u * MM, 4) for one in found],
        "type A: |P| in 1.96 u": [percent(one.type_a[0]) for one in found],
        "type A: point in 1.96 u": [percent(one.type_a[1]) for one in found],
        "type A: point in region": [percent(one.type_a[2]) for one in found],
        "type A: numbers in 1.96 u": [percent(one.numbers) for one in found],
        "unweighted fit: point in region": [percent(one.unweighted) for one in found],
        "unweighted fit: numbers inside": [percent(one.unweighted_numbers) for one in found],
    }
    runs = found[0].replications
    over = f"{runs} replications" if runs else "this one calibration"
    return of_columns(
        "What the paper states, and what its fit claims: shares that hold the truth, of 95 % "
        "promised",
        columns,
        size="small",
        note="type A is what the paper states: the standard deviation of repeated calibrations, "
        "with independent numbers, judged on this one calibration and its held-out poses. The "
        "covariance that the unweighted fit claims, s² inv(J'WJ) with s² = RSS / (12 m − f), is "
        f"not in the paper; we judge it beside, over {over}. Neither can see what the model lacks.",
    )


def misprint_table() -> Table:
    """Where the printed form differs from the one used here, and why."""
    rows = [
        {"what": one.what, "printed": one.printed, "used here": one.used, "why": one.why}
        for one in paper.MISPRINTS
    ]
    caption = "Where the paper's printed form is not the one that is used"
    return table_of(rows, caption, align="llll", size="small")


def claim_table(examined: Examined) -> Table:
    """Each claim: printed, ours, verdict, one sentence."""
    speaks, here = f"{THIS} says", THIS
    note = (
        "One campaign has one true robot: it can repeat arithmetic and contradict a general "
        "statement, but not prove an average over robots."
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
            "printed": CLAIMS[number].printed,
            here: found.ours,
            "verdict": found.verdict,
            "in one sentence": found.sentence,
        }
        for number, found in examined.findings.items()
    ]
    caption = (
        f"What the paper says and what {speaks}: {examined.count('holds')} of {len(rows)} examined "
        "claims hold"
    )
    return table_of(rows, caption, align="rlllll", size="small", note=note)
