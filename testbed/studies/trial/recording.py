"""A trial in the recording: four chapters from its pool to its held-out poses, and the summary."""

from collections.abc import Sequence
from functools import partial
from itertools import compress

import numpy as np

from calib.uncertainty.statement.stated_point import widened
from testbed.recording import parameters, style
from testbed.recording.cell import draw_box
from testbed.recording.chart import Chart, Series, before_after, fit_chart
from testbed.recording.pen import Pen
from testbed.recording.story import Chapter, floor_height, numbered, row_word
from testbed.recording.timeline import Phase, spread, visit
from testbed.report.page import SIMULATED
from testbed.robots.robot import Robot
from testbed.scenario.scenario import Scenario
from testbed.studies.trial import recording_cell as cell
from testbed.studies.trial.compare import measured_distance
from testbed.studies.trial.recording_cell import ShownTrial
from testbed.studies.trial.recording_ghost import draw_ghost, known
from testbed.studies.trial.recording_select import select_chapter
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.set_records import RandomSets

IDENTIFY_FRAMES = 72
"""Length of the phase in which the robot stays."""
MOST_TRIALS = 3
"""Rows of the summary, which has to fit its window."""


def chapters(shown: ShownTrial, random_sets: Sequence[RandomSets]) -> tuple[Chapter, ...]:
    """Select, measure, identify and evaluate."""
    mine = (sets for sets in random_sets if sets.trial == shown.trial.name)
    first = select_chapter(shown, next(mine, None))
    return first, _measure(shown), _identify(shown), _evaluate(shown)


def draw_scene(shown: ShownTrial, scenario: Scenario, robot: Robot, pen: Pen) -> None:
    """The ghost, the tracker that looks at the target, the box, and the numbers behind them."""
    setting, pool = shown.setting, scenario.pool
    chain = setting.nominal.chain
    draw_ghost(shown, robot, pen)
    cell.draw_instruments(shown, floor_height(chain, robot), pen)
    center, size = np.array(pool.box_center_mm) / 1e3, np.array(pool.box_size_mm) / 1e3
    draw_box(pen, "world/box", chain, center, size)
    _send_properties(shown, scenario, pen)


def _send_properties(shown: ShownTrial, scenario: Scenario, pen: Pen) -> None:
    """The numbers behind the pictures as properties, in float64 and SI."""
    import rerun as rr

    setting, found = shown.setting, shown.estimate.identification
    pen.stream.send_property(
        "campaign",
        rr.AnyValues(
            scenario=scenario.name,
            robot=scenario.robot,
            seed=scenario.seed,
            trial=shown.trial.name,
            estimator=shown.estimate.mode,
            parameters=list(found.parameters.free_names),
            step=found.step,
            standard_uncertainty=found.standard_uncertainty,
            true_step=shown.estimate.comparison.true_step,
            true_links=setting.true.chain.links.ravel(),
            true_T_world_base=setting.true.chain.T_world_base.ravel(),
            true_T_flange_tool=setting.true.chain.T_flange_tool.ravel(),
            true_joint_errors=setting.true.joint_errors.coefficients,
            nominal_links=setting.nominal.chain.links.ravel(),
            T_world_tracker=setting.T_world_tracker.ravel(),
        ),
    )


def _measure(shown: ShownTrial) -> Chapter:
    """What the tracker sees, and its distance from both models [mm]."""
    measurements = shown.trial.measurements
    row = row_word(measurements)
    models = (
        ("nominal", shown.setting.nominal, style.BEFORE_COLOR),
        ("identified", shown.estimate.identification.model, style.AFTER_COLOR),
    )
    seen = measured_distance(measurements, shown.setting.nominal) * 1e3
    curves = [
        Series(name, measured_distance(measurements, model) * 1e3, color)
        for name, model, color in models
    ]

    return Chapter(
        name="measure",
        local="pose",
        color=style.MEASURE_PHASE,
        motion=visit(measurements.q),
        text=(
            f"#### 2 Measure: {shown.trial.name}",
            f"- the tracker measures {measurements.n_poses} poses",
            "- blue: the chosen poses; dark: where the target was measured",
            f"- vermilion arrows: measured minus nominal, drawn {shown.arrows} times larger",
            shown.ghost_words,
        ),
        draw=partial(cell.draw_measured, shown),
        lines=numbered(row, len(seen), (f"{mm:.2f} mm off" for mm in seen)),
        charts=(Chart("measure", f"Measured minus predicted [mm] by {row} number", curves),),
    )


def _identify(shown: ShownTrial) -> Chapter:
    """The fit, and the error of every estimated parameter from nominal to identified."""
    found, judged = shown.estimate.identification, shown.estimate.comparison

    def draw(pen: Pen, phase: Phase) -> None:
        u = np.where(found.standard_uncertainty > 0, found.standard_uncertainty, np.inf)
        steps = np.concatenate([[0], phase.steps])
        error = judged.true_step - known(pen.timeline)[steps, None] * found.step
        covered = np.abs(error) <= parameters.BAND * u
        covered[-1] = judged.parameter_inside
        alone = shown.estimate.judged
        names = tuple(compress(found.parameters.free_names, alone.tolist()))
        z, root = (error / u)[:, alone], f"{shown.words}{parameters.PARAMETERS}"
        parameters.draw_parameters(pen, names, z, covered[:, alone], steps, root)

    return Chapter(
        name="identify",
        local="iteration",
        color=style.IDENTIFY_PHASE,
        motion=spread(len(found.trace), IDENTIFY_FRAMES, shown.trial.measurements.q[-1:]),
        text=(
            f"#### 3 Identify: {shown.estimate.mode}",
            f"- {found.parameters.n_free} numbers from {len(found.residual)} equations",
            f"- {found.status.value}",
            "- the ghost shrinks to what the model cannot describe",
            "- parameters: error over stated uncertainty moves into the gray 95 % band",
        ),
        draw=draw,
        lines=numbered("step", len(found.trace)),
        charts=(fit_chart(found.trace, found.dof),),
        panel=parameters.parameter_panel(
            found.parameters.n_free, f"{shown.words}{parameters.PARAMETERS}"
        ),
    )


def _evaluate(shown: ShownTrial) -> Chapter:
    """Held-out errors, before and after, and the stated ones [mm]."""
    judged = shown.estimate.comparison
    held, count = int(shown.estimate.inside.sum()), len(shown.estimate.inside)
    believed = shown.estimate.belief is not None
    whose = "believed" if believed else "the fit's, not believed:"
    one_move = ("- lines around them: where 95 % of single moves end",) if shown.moved else ()
    # as a distance, like the errors beside it
    stated = np.sqrt(np.trace(widened(shown.stated), axis1=1, axis2=2))
    curves = (
        Series("before", judged.before * 1e3, style.BEFORE_COLOR),
        Series("after", judged.after * 1e3, style.AFTER_COLOR),
        Series("stated", stated * 1e3, style.STATED_COLOR, "stated u, 3-D, k = 1"),
    )

    return Chapter(
        name="evaluate",
        local="test",
        color=style.EVALUATE_PHASE,
        motion=visit(shown.setting.test_q),
        text=(
            f"#### 4 Evaluate {shown.trial.name}: {count} held-out poses",
            f"- vermilion, blue: error before and after, both drawn {shown.arrows} times larger",
            f"- ellipsoids: {whose} 95 % regions of the mean, drawn {shown.regions} times larger",
            f"- blue where the truth is inside: {held} of {count}",
            *one_move,
            f"- ghost: the remaining deviation, drawn {shown.ghost} times larger",
        ),
        draw=partial(cell.draw_held_out, shown),
        lines=numbered("pose", count, before_after(judged.before, judged.after)),
        charts=(Chart("evaluate", "Held-out error [mm] by pose number", curves),),
    )


def summary(campaign: Campaign, verdict: str, *, own: bool) -> str:
    """Verdict first, then a row for each of some trials, by its default estimator.

    The first trial is shown, and has no row where the verdict is its own.
    """
    scenario, trials = campaign.scenario, campaign.trials
    lines = [f"**{SIMULATED}**: {scenario.name}, seed {scenario.seed}. {verdict}", ""]
    for trial in trials[own : own + MOST_TRIALS]:
        estimate = trial.estimates[0]
        judged = estimate.comparison
        held = f"{int(estimate.inside.sum())}/{len(estimate.inside)}"
        before, after = judged.accuracy_before.mean * 1e3, judged.accuracy_after.mean * 1e3
        lines.append(
            f"- {trial.name}: {before:.3f} to {after:.3f} mm, {held} regions contain the truth"
        )
    return "\n".join(lines)
