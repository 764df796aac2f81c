"""The recording of a campaign: its first trial, and one chapter after another from its studies."""

from pathlib import Path

from testbed.recording.story import Chapter, Story
from testbed.recording.write import write_story
from testbed.robots.robot import Robot
from testbed.run.report import headline_verdict
from testbed.studies.compensation import recording as compensation
from testbed.studies.coverage import recording as coverage
from testbed.studies.trial import recording as trial
from testbed.studies.trial.recording_cell import ShownTrial, show
from testbed.studies.trial.records import Campaign


def write_recording(campaign: Campaign, robot: Robot, path: str | Path) -> None:
    """Write the first trial of a campaign, with its default estimator, as a Rerun recording.

    Parameters
    ----------
    campaign : Campaign
        Finished; nothing is computed again but poses of known models.
    robot : Robot
        Whose parts are drawn.
    path : path
        File to write, replaced if it is there.

    Raises
    ------
    MachineError
        If the file cannot be written.
    """
    scenario = campaign.scenario
    shown = show(campaign.setting, campaign.trials[0])
    verdict = headline_verdict(campaign).sentence
    story = Story(
        identity=f"{scenario.name}-{scenario.seed}",
        name=f"{scenario.name}, seed {scenario.seed}",
        summary=trial.summary(scenario, campaign.trials, verdict),
        robot=robot,
        chain=shown.setting.nominal.chain,
        reach=shown.setting.pool_nominal[:, :3, 3],
        station=shown.setting.T_world_tracker[:3, 3],
        draw=lambda pen: trial.draw_scene(shown, scenario, robot, pen),
        chapters=chapters_of(campaign, shown),
    )
    write_story(story, path)


def chapters_of(campaign: Campaign, shown: ShownTrial) -> tuple[Chapter, ...]:
    """What every study shows, in its turn: the one place that knows which studies there are."""
    return (
        *trial.chapters(shown, campaign.random_sets),
        *compensation.chapters(campaign.compensation, campaign.scenario),
        *coverage.chapters(campaign.coverage),
    )
