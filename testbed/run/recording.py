"""The recording of a campaign: its first trial told on one timeline, scene, numbers and screen."""

from pathlib import Path

import numpy as np

from testbed.recording.cell import draw_ghost, draw_pool, draw_robot, draw_tracker, floor_height
from testbed.recording.curves import draw_curves, draw_parameters
from testbed.recording.layout import blueprint
from testbed.recording.pen import Pen, Writer, open_stream, strict_mode
from testbed.recording.story import tell
from testbed.robots.catalog import Robot
from testbed.run.report import headline_verdict
from testbed.studies.compensation.recording import draw_compensation, program, shown
from testbed.studies.coverage.recording import draw_coverage
from testbed.studies.trial.recording import draw_held_out, draw_measured, draw_texts, factors
from testbed.studies.trial.records import Campaign


def write_recording(campaign: Campaign, robot: Robot, path: str | Path) -> None:
    """Write the first trial of a campaign, with its default estimator, as a Rerun recording.

    The same campaign gives the same content each time, though not the same bytes: the format gives
    every row an identifier of its own.

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
    trial = campaign.trials[0]
    robots = campaign.coverage[0].before.size if campaign.coverage else 0
    study = shown(campaign.compensation, campaign.scenario)
    moves = None if study is None else program(study)
    story = tell(campaign.setting, trial, trial.estimates[0], program=moves, robots=robots)
    scenario = campaign.scenario
    identity, name = f"{scenario.name}-{scenario.seed}", f"{scenario.name}, seed {scenario.seed}"
    floor = floor_height(story.setting.nominal.chain, robot)
    screen = blueprint(story, floor, len(campaign.coverage))
    with strict_mode(), open_stream(Path(path), identity, name, screen) as stream:
        writer = Pen(stream, story)
        _send_properties(writer, campaign)
        box = scenario.pool
        factor = factors(story)
        ghost = draw_ghost(writer, robot)
        draw_texts(writer, campaign, headline_verdict(campaign).sentence, factor, ghost)
        draw_robot(writer, robot)
        draw_tracker(writer, robot)
        draw_pool(writer, np.array(box.box_center_mm) / 1e3, np.array(box.box_size_mm) / 1e3)
        draw_measured(writer, factor.arrows)
        draw_held_out(writer, factor)
        matching = (sets for sets in campaign.random_sets if sets.trial == trial.name)
        draw_curves(writer, next(matching, None))
        draw_parameters(writer)
        if study is not None:
            draw_compensation(writer, study, story.phase("compensate"))
        if campaign.coverage:
            draw_coverage(writer, campaign.coverage, story.phase("coverage"))


def _send_properties(writer: Writer, campaign: Campaign) -> None:
    """The numbers behind the pictures as properties, in float64 and SI."""
    import rerun as rr

    story, scenario = writer.story, campaign.scenario
    setting, found = story.setting, story.estimate.identification
    writer.stream.send_property(
        "campaign",
        rr.AnyValues(
            scenario=scenario.name,
            robot=scenario.robot,
            seed=scenario.seed,
            trial=story.trial.name,
            estimator=story.estimate.mode,
            parameters=list(found.parameters.free_names),
            step=found.step,
            standard_uncertainty=found.standard_uncertainty,
            true_step=story.estimate.comparison.true_step,
            true_links=setting.true.chain.links.ravel(),
            true_T_world_base=setting.true.chain.T_world_base.ravel(),
            true_T_flange_tool=setting.true.chain.T_flange_tool.ravel(),
            true_joint_errors=setting.true.joint_errors.coefficients,
            nominal_links=setting.nominal.chain.links.ravel(),
            T_world_tracker=setting.T_world_tracker.ravel(),
        ),
    )
