"""The files that follow from the records of a campaign: result, arrays, report, recording.

Each is a loop over the studies that made the records; the last study of them with an answer to the
question of the scene has the first screen.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from calib.errors import refuse
from testbed.names import did_you_mean, some
from testbed.report.page import PARTS, SIMULATED, Page, Verdict, record_section, render
from testbed.scenario.scenario import Scenario
from testbed.store import npz
from testbed.store.layout import ARRAYS, FORMAT, OF_TRIAL, RECORDING, REPORT, RESULT
from testbed.store.quantities import as_arrays, as_json
from testbed.studies import all_studies
from testbed.studies.protocol import Answer, Records, Study
from testbed.studies.trial.study import STUDY as GROUND
from testbed.units import counted, sentence, typeset
from testbed.versions import all_versions

if TYPE_CHECKING:
    import numpy as np

    from testbed.recording.story import Chapter, Story
    from testbed.robots.robot import Robot
    from testbed.studies.trial.records import Campaign


MOST_FAILED = 6
"""Records whose failure the first screen tells; the log and result.json have all."""


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A scenario and all its finished records."""

    scenario: Scenario
    robot: "Robot"
    studies: tuple[Study, ...]
    """Those that made the records, in the order of the register."""
    records: Records


Derive = Callable[[str, Played], bytes]
"""Takes the name of a derived file and what was played, and returns the content of the file."""


def derived_file(name: str, played: Played) -> bytes:
    """Content of a derived file."""
    from testbed.studies.trial.records import campaign_of

    campaign = campaign_of(played.scenario, played.records)
    if name == RESULT:
        return npz.pretty_json(headline(campaign, played.studies))
    if name == ARRAYS:
        return npz.to_bytes({"format": FORMAT}, arrays(campaign, played.studies))
    if name == REPORT:
        return render(page_of(campaign, all_versions(), played.studies)).encode()
    if name != RECORDING:
        before, after = OF_TRIAL
        campaign = led_by(campaign, name.removeprefix(before).removesuffix(after))
    return recording_bytes(campaign, played.robot, played.studies)


def led_by(campaign: "Campaign", trial: str) -> "Campaign":
    """The campaign with the trial of this name first: the one that its recording shows.

    Raises
    ------
    InputError
        C41: there is no such trial, or it failed.
    """
    require_trial(trial, [one.name for one in campaign.trials], campaign.records.failed)
    return replace(campaign, trials=tuple(sorted(campaign.trials, key=lambda t: t.name != trial)))


def require_trial(name: str, known: Collection[str], failed: Mapping[str, str]) -> None:
    """Refuse the name of no trial, or of one that failed; C41."""
    if name in known:
        return
    message = f'there is no trial "{name}"'
    if name in failed:
        message = f'the trial "{name}" failed and cannot be shown ({failed[name]})'
    allowed, fix = f"one of {', '.join(known)}", did_you_mean(name, known)
    raise refuse("--trial", name, allowed, code="C41", message=message, fix=fix)


def headline_answer(
    campaign: "Campaign", studies: Sequence[Study] | None = None
) -> tuple[Study, Answer]:
    """The study that answers the question of the scene, the last one that can, and its answer."""
    for study in reversed(_studies(campaign, studies)):
        answer = study.answer(campaign.scenario, campaign.records)
        if answer is not None:
            return study, replace(answer, verdict=_with_failed(study, answer.verdict, campaign))
    raise LookupError("the study of trials always has an answer")


def _with_failed(study: Study, verdict: Verdict, campaign: "Campaign") -> Verdict:
    """A verdict that says which records failed; one over robots is none of those that are lost."""
    failed = campaign.records.failed
    why = [f"the record {key} failed: {reason}" for key, reason in failed.items()]
    if more := why[MOST_FAILED:]:
        why[MOST_FAILED:] = [f"{counted(len(more), 'record')} more failed"]
    verdict = replace(verdict, reasons=(*why, *verdict.reasons))
    lost = [one.key for one in study.records(campaign.scenario) if one.key in failed]
    if study.name == GROUND.name or not lost:  # each trial is judged by itself
        return verdict
    said = f"{some(lost, MOST_FAILED)} failed, and what follows is of the rest"
    mark = verdict.mark if verdict.contradicted else f"? {said}"
    return replace(verdict, believable=False, sentence=f"{said}. {verdict.sentence}", mark=mark)


def headline(campaign: "Campaign", studies: Sequence[Study] | None = None) -> dict[str, Any]:
    """Every headline number of a campaign as plain JSON values."""
    scenario, records = campaign.scenario, campaign.records
    _, answer = headline_answer(campaign, studies)
    verdict = answer.verdict
    return {
        "format": FORMAT,
        "notice": SIMULATED,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "robot": _robot_name(scenario.robot),
        "verdict": {
            "believable": verdict.believable,
            "contradicted": verdict.contradicted,
            "sentence": verdict.sentence,
            "reasons": list(verdict.reasons),
        },
        **as_json(
            one for study in _studies(campaign, studies) for one in study.results(scenario, records)
        ),
    }


def arrays(
    campaign: "Campaign", studies: Sequence[Study] | None = None
) -> dict[str, "np.ndarray[Any, Any]"]:
    """The main arrays of a campaign, names with units."""
    return as_arrays(
        one
        for study in _studies(campaign, studies)
        for one in study.arrays(campaign.scenario, campaign.records)
    )


def page_of(
    campaign: "Campaign", versions: Mapping[str, str], studies: Sequence[Study] | None = None
) -> Page:
    """The page of a campaign: the answer to its question first; sections without data are left out.

    Parameters
    ----------
    campaign : Campaign
        Played once.
    versions : mapping of str to str
        Program and packages, as the run folder's manifest has them.
    studies : sequence of Study, optional
        Those that made the records; by default the registered ones.
    """
    scenario = campaign.scenario
    asked, answer = headline_answer(campaign, studies)
    verdict = answer.verdict
    sections = [
        section
        for study in reversed(_studies(campaign, studies))
        for section in study.sections(scenario, campaign.records, first=study is asked)
    ]
    # names of trials stay as they are written, also where a sentence begins with one
    names = {trial.name for trial in campaign.trials}
    reasons = (
        sentence(reason, keep_name=reason.partition(" ")[0] in names) for reason in verdict.reasons
    )
    record = record_section(
        f"Seed {scenario.seed}. scenario.toml beside this page, played again with the same "
        "versions on the same kind of processor, gives the same bytes; result.json has every "
        "figure, arrays.npz every pose and parameter.",
        versions,
    )
    return Page(
        banner=SIMULATED,
        title=scenario.title or scenario.name,
        subtitle=f"Scenario {scenario.name}, seed {scenario.seed}, "
        f"robot {_robot_name(scenario.robot)}",
        believable=verdict.believable,
        mark=verdict.mark,
        verdict=typeset(verdict.sentence),
        reasons=tuple(typeset(reason) for reason in reasons),
        headline=answer.table,
        next_step=answer.next_step,
        # sections of one part keep the order of their studies
        sections=(*sorted(sections, key=lambda section: PARTS.index(section.part)), record),
        recording=RECORDING,
        picture=answer.picture() if answer.picture else None,
    )


def recording_bytes(
    campaign: "Campaign", robot: "Robot", studies: Sequence[Study] | None = None
) -> bytes:
    """The story of a campaign as a Rerun recording; arguments as of `campaign_story`."""
    from testbed.recording.write import story_bytes

    return story_bytes(campaign_story(campaign, robot, studies))


def campaign_story(
    campaign: "Campaign", robot: "Robot", studies: Sequence[Study] | None = None
) -> "Story":
    """The first trial of a campaign, with its default estimator, and windows on a few others.

    `led_by` puts another trial first.

    Parameters
    ----------
    campaign : Campaign
        Finished; nothing is computed again but poses of known models.
    robot : Robot
        Whose parts are drawn.
    studies : sequence of Study, optional
        Those that made the records; by default the registered ones.
    """
    from testbed.recording.story import Story
    from testbed.studies.trial import recording as trial
    from testbed.studies.trial.recording_cell import show
    from testbed.studies.trial.recording_others import MOST_OTHERS, other_windows
    from testbed.studies.trial.verdict import trial_verdict

    scenario, setting = campaign.scenario, campaign.setting
    shown = show(campaign, campaign.trials[0])
    asked, answer = headline_answer(campaign, studies)
    summaries = {}
    for one in campaign.trials[: 1 + MOST_OTHERS]:
        led = led_by(campaign, one.name)
        # where trials are the question, the answer is that of the trial which is shown
        own = asked.name == GROUND.name
        verdict = trial_verdict(led) if own else answer.verdict
        summaries[one.name] = trial.summary(led, verdict.sentence, own=own)
    return Story(
        identity=f"{scenario.name}-{scenario.seed}-{shown.trial.name}",
        name=f"{scenario.name}, seed {scenario.seed}, {shown.trial.name}",
        summary=summaries[shown.trial.name],
        robot=robot,
        chain=setting.nominal.chain,
        reach=setting.pool_nominal[:, :3, 3],
        station=setting.T_world_tracker[:3, 3],
        draw=lambda pen: trial.draw_scene(shown, scenario, robot, pen),
        chapters=chapters_of(campaign, studies),
        windows=other_windows(campaign, shown, robot, summaries),
    )


def chapters_of(
    campaign: "Campaign", studies: Sequence[Study] | None = None
) -> tuple["Chapter", ...]:
    """What every study shows, in its turn: the ground study the first trial of the campaign."""
    scenario, records, first = campaign.scenario, campaign.records, campaign.trials[0].name
    return tuple(
        chapter
        for study in _studies(campaign, studies)
        for chapter in (
            GROUND.recording(scenario, records, first)
            if study.name == GROUND.name
            else study.recording(scenario, records)
        )
    )


def _studies(campaign: "Campaign", studies: Sequence[Study] | None) -> Sequence[Study]:
    """Those that made the records; by default the registered ones."""
    return all_studies(campaign.scenario) if studies is None else studies


def _robot_name(robot: str) -> str:
    """Name of a shipped robot, or of one's own without the path of this machine."""
    path = PurePath(robot)
    return path.parent.name if path.suffix == ".toml" else path.name
