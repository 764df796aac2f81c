"""The report's section on what bends the true arm, beside what the model makes of it."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from testbed.report.page import Block, Figure, Section
from testbed.report.plots_joints import joint_maps
from testbed.robots.write.joint_map import JointMap, joint_map
from testbed.studies.trial.bending import plots
from testbed.studies.trial.bending.sag import sag_of, without_gravity
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.units import micrometres

RUBS = 1e-6
"""Width of the tool's loop below which there is nothing to see [m]."""


def bending_section(campaign: Campaign) -> Section | None:
    """Joint maps and sag of the first trial, and how the arm moves; None where nothing bends."""
    trial = campaign.trials[0]
    estimate = trial.estimates[0]
    blocks = (
        *map_figure(campaign, trial, estimate),
        *sag_figure(campaign, trial, estimate),
        *motion_figures(campaign),
    )
    return Section("bends", "What bends this arm", blocks) if blocks else None


def map_figure(campaign: Campaign, trial: Trial, estimate: Estimate) -> tuple[Block, ...]:
    """What each joint turns beside its command, by the model and in truth."""
    found, setting = estimate.identification, campaign.setting
    waves = replace(found.model, joint_errors=without_gravity(found.model.joint_errors))
    model = joint_map(waves, found.parameters, found.covariance)
    true = known_map(replace(setting.true, joint_errors=without_gravity(setting.true.joint_errors)))
    joints = sorted({*model.joints, *true.joints})
    if not joints:
        return ()
    text = (
        "How far each joint turns from its command over one turn, sag left out: in truth (broken) "
        f"and by the model of {trial.name}"
    )
    text += "; the band holds 2 u of the fit." if len(model.joints) else ", which has no waves."
    if campaign.scenario.truth.drive_nm_per_mrad:
        text += " Droop on springs is in no true map; waves of the model may follow some of it."
    drawn = (
        np.column_stack([column(values, one, joint) for joint in joints])
        for one, values in ((model, model.turn), (model, model.u), (true, true.turn))
    )
    return (Figure(text, joint_maps(np.array(joints), true.angle, *drawn), "half"),)


def known_map(model: RobotModel) -> JointMap:
    """The map of a model of which every number is known."""
    return joint_map(model, parameters_of(model).freeing([]), np.zeros((0, 0)))


def column(values: Array, of: JointMap, joint: int) -> Array:
    """Values (a,) of a joint in its map; zero where it has none."""
    return np.asarray(values[:, of.joints == joint].sum(axis=1))


def sag_figure(campaign: Campaign, trial: Trial, estimate: Estimate) -> tuple[Block, ...]:
    """How far gravity moves the tool over the plane of the arm."""
    sag = sag_of(campaign, estimate)
    if sag is None:
        return ()
    (mean, most), (left, worst) = (
        (micrometres(float(size.mean())), micrometres(float(size.max())))
        for size in (sag.size, sag.left)
    )
    text = (
        f"Left: how far gravity moves the true tool over the pool, {mean} µm on average, {most} µm "
        f"at most, in the upright plane through base and tool. Right: what the model of "
        f"{trial.name} leaves, {left} µm on average, {worst} µm at most; play, warmth and motion "
        "are in neither."
    )
    return (Figure(text, plots.sag_maps(sag), "half"),)


def motion_figures(campaign: Campaign) -> tuple[Block, ...]:
    """Hysteresis, and how what swings dies away."""
    motion, truth = campaign.motion, campaign.scenario.truth
    if motion is None:
        return ()
    blocks: list[Block] = []
    if motion.tool_width > RUBS:
        text = (
            "Friction holds every link back, on the side that it comes from: how far each turns "
            "beside where it would rest while all motors go slowly down (broken) and up about one "
            "held-out pose, and the tool along the line between its two ways; widths of the loops "
            "in the titles."
        )
        blocks.append(Figure(text, plots.loops(motion)))
    text = (
        f"How far the tool is from where it comes to rest, on {motion.away.shape[1]} ways to "
        f"held-out poses. When the tracker looks, after {truth.dwell_s:g} s, it is "
        f"{_mean_and_most(motion.seen)}. No wait takes away that reached from the other side a "
        f"pose lies elsewhere, by {_mean_and_most(motion.apart)}."
    )
    kinds = {"": (motion.away.mean(axis=1), motion.away.max(axis=1))}
    blocks.append(Figure(text, plots.dying_away(motion.dwell, kinds, truth.dwell_s)))
    return tuple(blocks)


def _mean_and_most(size: Array) -> str:
    """Lengths (k,) [m] by their mean and the largest."""
    mean, most = micrometres(float(size.mean()), 2), micrometres(float(size.max()), 2)
    return f"{mean} µm on average and {most} µm at most"
