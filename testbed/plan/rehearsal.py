"""A plan rehearsed: the radius that the statement after it will have, by virtual calibrations."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.frames import exp_so3
from calib.geometry.parameters import Parameters
from calib.identification.identify import identify
from calib.measurement.observations import Measurements
from calib.uncertainty.circumstances import Circumstances
from calib.uncertainty.judgement import judge
from calib.uncertainty.statement.distance import radius_over
from calib.uncertainty.statement.shared import SharedErrors
from calib.uncertainty.statement.stated_point import widened
from testbed.laboratory.bench import Bench
from testbed.laboratory.goal import Goal
from testbed.streams import stream

DRAWS = 20
"""Rehearsals: the median of their radii is known to a few percent."""


def rehearsed(
    bench: Bench,
    goal: Goal,
    parameters: Parameters,
    train: Measurements,
    held_out: Measurements,
    shared: SharedErrors | None,
) -> Array:
    """Radii (k,) that calibrations of a robot without misfit state over the goal, ascending [m].

    The nominal robot is read with the stated noise, identified and judged as `identify` does it: a
    misfit that noise may hide is in the region, and so is the doubt of what the robot's file says
    of how joints come back. Postures where nothing will be stated are left out; empty where no
    statement is made at all.

    Parameters
    ----------
    bench : Bench
        The laboratory, at the plan's station.
    goal : Goal
        Where the tool must be right.
    parameters : Parameters
        The numbers to be identified.
    train, held_out : Measurements
        What the tracker would read of the nominal robot, with its noise.
    shared : SharedErrors, optional
        What all readings share, as stated.
    """
    if not len(held_out):
        return frozen(np.zeros(0))
    rng = stream(bench.scenario.seed, "plan", "rehearsal")
    held_out = replace(held_out, pose_id=held_out.pose_id + len(train))
    tables = (train, held_out)
    scatter = _joint_scatter(bench, train), _joint_scatter(bench, held_out)
    known = Circumstances(
        shared=None if shared is None else shared.covariance,
        target=(float(goal.point[0]), float(goal.point[1]), float(goal.point[2])),
        doubted=scatter if bench.sigma_q.any() else None,
    )
    radii = []
    for _ in range(DRAWS):
        own, theirs = (_read(table, rng) for table in tables)
        found = identify(bench.robot.model, own, parameters)
        belief = judge(found, theirs, train=own, circumstances=known).belief
        if belief is None:
            continue
        reached = belief.proven.applies(goal.q).place != "outside"
        if reached.any():
            region = belief.regions(goal.q[reached], target=known.target)
            share = goal.weights[reached] / goal.weights[reached].sum()
            radii.append(radius_over(widened(region), share))
    return frozen(np.sort(radii))


def _read(table: Measurements, rng: np.random.Generator) -> Measurements:
    """A table with noise of its covariances on what it reads."""
    noise = np.linalg.cholesky(table.covariance) @ rng.standard_normal((len(table), 6, 1))
    moved, turned = noise[:, :3, 0], exp_so3(noise[:, 3:, 0])
    poses = table.is_pose[:, None, None]
    return replace(
        table,
        position=frozen(table.position + moved),
        rotation=frozen(np.where(poses, turned @ table.rotation, table.rotation)),
    )


def _joint_scatter(bench: Bench, table: Measurements) -> Array:
    """Part (m, 6, 6) of the covariances that the robot's file states, of how joints come back."""
    T = bench.robot.model.poses(table.q)
    own = bench.tracker.own_covariance(bench.tracker.targets(T), T[:, :3, :3])
    size = 6 if bench.tracker.measures == "pose" else 3
    out = np.zeros_like(own)
    out[:, :size, :size] = (table.covariance - own)[:, :size, :size]
    return out
