"""What a scene asks, answered first: the verdict of the report's first screen and the next step."""

from testbed.compensation_summary import outcomes
from testbed.contest import contest_of, has_contest
from testbed.coverage_summary import cells
from testbed.output import (
    report_compensation,
    report_coverage,
    report_headline,
    report_pose_sets,
    report_reexamined,
)
from testbed.output.claims import examine
from testbed.output.quantities import NARROW, counted
from testbed.output.verdict import Verdict, trial_verdict
from testbed.records import Campaign


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


def plain(text: str) -> str:
    """A sentence of the report as plain text, for the terminal as well."""
    return text.replace(NARROW, " ").replace("µ", "u").replace("−", "-")
