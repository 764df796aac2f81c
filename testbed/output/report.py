"""report.html: one self-contained page that says how good a calibration is, verdict first."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from testbed.contest import has_contest
from testbed.output import (
    report_compensation,
    report_coverage,
    report_coverage_tables,
    report_design,
    report_headline,
    report_paper,
    report_parameters,
    report_population,
    report_pose_sets,
    report_reexamined,
    report_results,
    report_statement,
)
from testbed.output.claims import examine
from testbed.output.quantities import typeset
from testbed.output.question import headline_verdict, next_step
from testbed.output.report_parts import Code, Section, Table, Text, versions_table
from testbed.records import Campaign
from testbed.scenario import dump_scenario

BANNER = "SIMULATED - not a calibration certificate"
TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True)
class Page:
    """Everything the template prints."""

    banner: str
    title: str
    subtitle: str
    believable: bool
    mark: str
    """The verdict in a few words, behind a tick or a cross."""
    verdict: str
    reasons: tuple[str, ...]
    headline: Table
    next_step: str
    sections: tuple[Section, ...]


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


def render(page: Page) -> str:
    """The page as HTML; whatever a user wrote is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.j2").render(page=page)


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
        record_section(campaign, versions),
    )
    return Page(
        banner=BANNER,
        title=scenario.title or scenario.name,
        subtitle=f"Scenario {scenario.name}, seed {scenario.seed}, robot {scenario.robot}",
        believable=verdict.believable,
        mark=verdict.mark,
        verdict=typeset(verdict.sentence),
        reasons=tuple(
            typeset(reason[:1].upper() + reason[1:].rstrip(".") + ".") for reason in verdict.reasons
        ),
        headline=headline,
        next_step=next_step(campaign),
        sections=tuple(section for section in sections if section is not None),
    )


def record_section(campaign: Campaign, versions: Mapping[str, str]) -> Section:
    """What is needed to play the campaign again: versions, seed, the scenario in full."""
    table = versions_table(versions)
    text = (
        f"Seed {campaign.scenario.seed}. Every number of this report comes from the scenario "
        "below; playing it again with the same versions on the same kind of processor gives the "
        "same bytes."
    )
    scenario = dump_scenario(campaign.scenario)
    return Section("record", "Scenario and versions", (Text(text), table, Code(scenario)))
