"""A campaign's page: the answer to the scene's question first, then every section."""

from collections.abc import Mapping

from testbed.report.page import SIMULATED, Page, plain, record_section, render
from testbed.scenario.read import dump_scenario
from testbed.studies.compensation import report as report_compensation
from testbed.studies.compensation.summary import outcomes
from testbed.studies.coverage import report as report_coverage
from testbed.studies.coverage import tables as report_coverage_tables
from testbed.studies.coverage.summary import cells
from testbed.studies.pose_sets import report as report_pose_sets
from testbed.studies.pose_sets import report_population
from testbed.studies.pose_sets.compare import contest_of, has_contest
from testbed.studies.trial import report as report_headline
from testbed.studies.trial import report as report_results
from testbed.studies.trial import report_design, report_parameters
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.statement import report as report_statement
from testbed.studies.trial.verdict import Verdict, trial_verdict
from testbed.studies.wen2022 import report as report_reexamined
from testbed.studies.wen2022 import report_paper
from testbed.studies.wen2022.claims import examine
from testbed.units import counted, sentence, typeset


def report_html(campaign: Campaign, *, versions: Mapping[str, str]) -> str:
    """The report of a campaign as one HTML page: no network, same bytes each time.

    Parameters
    ----------
    campaign : Campaign
        Played once.
    versions : mapping of str to str
        Program and packages, as the run folder's manifest has them.

    Returns
    -------
    str
        UTF-8 text of one HTML page.
    """
    return render(page_of(campaign, versions))


def page_of(campaign: Campaign, versions: Mapping[str, str]) -> Page:
    """The content of the page; sections without data are left out."""
    scenario = campaign.scenario
    verdict = headline_verdict(campaign)
    # with many pose sets the question is which one; the single robot comes after it
    many, covered = has_contest(campaign), bool(campaign.coverage)
    each = report_headline.headline_table(campaign)
    headline = each
    if covered:
        headline = report_coverage_tables.summary_table(campaign.coverage)
    elif many:
        headline = report_pose_sets.summary_table(campaign)
    examined = examine(campaign)
    again = examined if examined is not None and campaign.reexamined else None
    if again is not None:
        headline = report_reexamined.summary_table(campaign)
    looped = bool(campaign.compensation)
    if looped:
        headline = report_compensation.summary_table(campaign.compensation)
    kept = many or covered or looped or again is not None
    sections = (
        report_compensation.compensation_section(campaign),
        None if again is None else report_reexamined.reexamined_section(campaign, again),
        report_coverage.coverage_section(campaign),
        report_pose_sets.pose_sets_section(campaign) if many else None,
        report_statement.statement_section(campaign),
        report_results.accuracy_section(campaign, each if kept else None),
        report_results.belief_section(campaign),
        report_parameters.identifiable_section(campaign),
        report_design.design_section(campaign),
        None if many else report_population.population_section(campaign),
        report_statement.secret_section(campaign),
        report_paper.tool_section(campaign),
        report_paper.paper_section(campaign, examined),
        report_parameters.parameter_section(campaign),
        record_section(
            f"Seed {scenario.seed}. Every number of this report comes from the scenario below; "
            "playing it again with the same versions on the same kind of processor gives the same "
            "bytes.",
            versions,
            dump_scenario(scenario),
        ),
    )
    return Page(
        banner=SIMULATED,
        title=scenario.title or scenario.name,
        subtitle=f"Scenario {scenario.name}, seed {scenario.seed}, robot {scenario.robot}",
        believable=verdict.believable,
        mark=verdict.mark,
        verdict=typeset(verdict.sentence),
        reasons=tuple(typeset(sentence(reason)) for reason in verdict.reasons),
        headline=headline,
        next_step=next_step(campaign),
        sections=tuple(section for section in sections if section is not None),
    )


def headline_verdict(campaign: Campaign) -> Verdict:
    """The answer to the scene's own question; without one, the verdict on its first trial."""
    if campaign.reexamined and (examined := examine(campaign)) is not None:
        opening, own = report_reexamined.opening(campaign, examined), trial_verdict(campaign)
        said = tuple(map(plain, (*opening.reasons, own.sentence)))
        return Verdict(
            own.believable, own.contradicted, plain(opening.sentence), said, opening.mark
        )
    if campaign.compensation:
        return compensation_verdict(campaign)
    if campaign.coverage:
        return coverage_verdict(campaign)
    if has_contest(campaign):
        return contest_verdict(campaign)
    return trial_verdict(campaign)


def next_step(campaign: Campaign) -> str:
    """What a person should do after reading the answer."""
    if campaign.reexamined and examine(campaign) is not None:
        return report_reexamined.next_step(campaign)
    if campaign.compensation:
        return (
            "Correct a program of your own with what measurements identify: truebed identify ROBOT "
            "DATA --program CSV. Where a figure is near its noise floor, only more cycles or a "
            "better tracker can show it smaller."
        )
    if campaign.coverage:
        return (
            "In a run of your own let the evidence choose the model ([identification] model = "
            '"choose"), measure 19 held-out poses or more, and believe what the report says to '
            f"believe. {report_coverage.obeyed(campaign.coverage)}"
        )
    if has_contest(campaign):
        return report_pose_sets.advice(contest_of(campaign))
    return report_headline.next_step(campaign)


def compensation_verdict(campaign: Campaign) -> Verdict:
    """On which kinds of robots the corrected program is better, and by how much."""
    found = [outcomes(study) for study in campaign.compensation]
    better = sum(chosen.ap.value < before.ap.value for before, _, chosen in found)
    kinds = f"{better} of {counted(len(found), 'kind')} of robots"
    mark = f"{'✓' if better == len(found) else '✗'} The corrected program is better on {kinds}"
    first, *rest = [text for rows in found for text in report_compensation.sentences(rows)]
    own = trial_verdict(campaign)
    said = tuple(plain(text) for text in (*rest, own.sentence))
    return Verdict(own.believable, own.contradicted, plain(first), said, mark)


def coverage_verdict(campaign: Campaign) -> Verdict:
    """On which kinds of robots the model-based region keeps its promise, and what does instead."""
    studies, found = campaign.coverage, cells(campaign.coverage)
    short = {cell.truth for cell in found if cell.statement == "model" and not cell.believable}
    kinds = f"{len(studies)} kind{'s' if len(studies) > 1 else ''} of robots"
    mark = (
        f"✗ The model-based interval falls short on {len(short)} of {kinds}"
        if short
        else f"✓ The model-based interval holds on {kinds}"
    )
    reasons = report_coverage.consequences(studies, found)
    sentence = report_coverage.believable_sentence(found)
    return Verdict(not short, bool(short), plain(sentence), tuple(map(plain, reasons)), mark)


def contest_verdict(campaign: Campaign) -> Verdict:
    """How many chosen pose sets beat random ones; the stated uncertainty comes last."""
    first, *rest = report_pose_sets.in_short(contest_of(campaign))
    own = trial_verdict(campaign)
    rivals = [e.outcome for e in contest_of(campaign).entries if e.ratio is not None]
    better, worse = rivals.count("better"), rivals.count("worse")
    mark = f"{'✓' if better > worse else '✗'} {better} of {len(rivals)} chosen pose sets beat "
    mark += f"random ones of their size, {worse} are worse"
    said = tuple(plain(text) for text in (*rest, own.sentence))
    return Verdict(own.believable, own.contradicted, plain(first), said, mark)
