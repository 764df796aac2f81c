"""A campaign's page: the answer to the scene's question first, then the sections of all studies."""

from collections.abc import Mapping, Sequence

from testbed.report.page import PARTS, SIMULATED, Page, record_section, render
from testbed.scenario.read import dump_scenario
from testbed.studies import all_studies
from testbed.studies.protocol import Answer, Study
from testbed.studies.trial.records import Campaign
from testbed.units import sentence, typeset


def report_html(
    campaign: Campaign, *, versions: Mapping[str, str], studies: Sequence[Study] | None = None
) -> str:
    """The report of a campaign as one HTML page: no network, same bytes each time.

    Parameters
    ----------
    campaign : Campaign
        Played once.
    versions : mapping of str to str
        Program and packages, as the run folder's manifest has them.
    studies : sequence of Study, optional
        Those that made the records; by default the registered ones.

    Returns
    -------
    str
        UTF-8 text of one HTML page.
    """
    return render(page_of(campaign, versions, studies))


def page_of(
    campaign: Campaign, versions: Mapping[str, str], studies: Sequence[Study] | None = None
) -> Page:
    """The content of the page; sections without data are left out."""
    scenario, records = campaign.scenario, campaign.records
    studies = all_studies(scenario) if studies is None else studies
    asked, answer = headline_answer(campaign, studies)
    verdict = answer.verdict
    sections = [
        section
        for study in reversed(studies)
        for section in study.sections(scenario, records, first=study is asked)
    ]
    record = record_section(
        f"Seed {scenario.seed}. Every number of this report comes from the scenario below; "
        "playing it again with the same versions on the same kind of processor gives the same "
        "bytes.",
        versions,
        dump_scenario(scenario),
    )
    return Page(
        banner=SIMULATED,
        title=scenario.title or scenario.name,
        subtitle=f"Scenario {scenario.name}, seed {scenario.seed}, robot {scenario.robot}",
        believable=verdict.believable,
        mark=verdict.mark,
        verdict=typeset(verdict.sentence),
        reasons=tuple(typeset(sentence(reason)) for reason in verdict.reasons),
        headline=answer.table,
        next_step=answer.next_step,
        # sections of one part keep the order of their studies
        sections=(*sorted(sections, key=lambda section: PARTS.index(section.part)), record),
    )


def headline_answer(
    campaign: Campaign, studies: Sequence[Study] | None = None
) -> tuple[Study, Answer]:
    """The study that answers the question of the scene, the last one that can, and its answer."""
    for study in reversed(all_studies(campaign.scenario) if studies is None else studies):
        answer = study.answer(campaign.scenario, campaign.records)
        if answer is not None:
            return study, answer
    raise LookupError("the study of trials always has an answer")
