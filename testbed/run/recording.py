"""The recording of a campaign: its first trial, and one chapter after another from its studies."""

from collections.abc import Sequence
from pathlib import Path

from testbed.recording.story import Chapter, Story
from testbed.recording.write import write_story
from testbed.robots.robot import Robot
from testbed.run.report import headline_answer
from testbed.studies import all_studies
from testbed.studies.protocol import Study
from testbed.studies.trial import recording as trial
from testbed.studies.trial.recording_cell import show
from testbed.studies.trial.records import Campaign


def write_recording(
    campaign: Campaign, robot: Robot, path: str | Path, studies: Sequence[Study] | None = None
) -> None:
    """Write the first trial of a campaign, with its default estimator, as a Rerun recording.

    Parameters
    ----------
    campaign : Campaign
        Finished; nothing is computed again but poses of known models.
    robot : Robot
        Whose parts are drawn.
    path : path
        File to write, replaced if it is there.
    studies : sequence of Study, optional
        Those that made the records; by default the registered ones.

    Raises
    ------
    MachineError
        If the file cannot be written.
    """
    scenario = campaign.scenario
    shown = show(campaign.setting, campaign.trials[0])
    _, answer = headline_answer(campaign, studies)
    story = Story(
        identity=f"{scenario.name}-{scenario.seed}",
        name=f"{scenario.name}, seed {scenario.seed}",
        summary=trial.summary(scenario, campaign.trials, answer.verdict.sentence),
        robot=robot,
        chain=shown.setting.nominal.chain,
        reach=shown.setting.pool_nominal[:, :3, 3],
        station=shown.setting.T_world_tracker[:3, 3],
        draw=lambda pen: trial.draw_scene(shown, scenario, robot, pen),
        chapters=chapters_of(campaign, studies),
    )
    write_story(story, path)


def chapters_of(campaign: Campaign, studies: Sequence[Study] | None = None) -> tuple[Chapter, ...]:
    """What every study shows, in its turn."""
    scenario, records = campaign.scenario, campaign.records
    played = all_studies(scenario) if studies is None else studies
    return tuple(chapter for study in played for chapter in study.recording(scenario, records))
