"""The loop closed: calibrate a robot, correct its program, let it run, and measure what came of it.

Many robots of each kind; all random numbers come from streams of the study's own, and robot k of
every kind is drawn from the same ones. The program of the true robot is executed by the simulator;
only the last figures, `true` and `held_out`, know the secret.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.compensation import compensate
from calib.geometry.model import RobotModel
from calib.identification.model_choice import choose
from calib.measurement.accuracy import accuracy as summed_up
from calib.measurement.accuracy import position_errors
from calib.measurement.iso9283 import (
    Figure,
    accuracy,
    distance_accuracy,
    distance_repeatability,
    repeatability,
    rotation_accuracy,
)
from testbed.laboratory.tracker.tracker import bias_size
from testbed.laboratory.truth.laboratory import (
    Laboratory,
    Setting,
    open_laboratory,
    validation_start,
)
from testbed.laboratory.truth.robot import draw_truth
from testbed.scenario.read import Scenario
from testbed.streams import stream
from testbed.studies.compensation.cube import cube_joints, cube_poses
from testbed.studies.compensation.records import CompensationStudy
from testbed.studies.many_robots import TruthName, truth_of_kind
from testbed.studies.trial.records import Trial

FIRST, SECOND = 1, 3
"""Poses 2 and 4, between which AD and RD are taken."""


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """A program executed and read."""

    figures: Array
    """(3, 3, 5) AP, RP and AP of the angle; value, uncertainty, floor [m or rad]."""
    distances: Array
    """(2, 3) AD and RD; value, uncertainty, floor [m]."""
    true: Array
    """(5,) the secret: distance of the noise-free tool from the command [m]."""
    offsets: Array
    """(5, c, 3) read positions minus commanded ones [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """One robot: its program before, and corrected by either model."""

    executions: tuple[Execution, ...]
    held_out: Array
    """(3, 2) mean and 95th percentile, nominal, geometric, chosen [m]."""
    extended: bool
    corrected: Bool
    """(3, 5)"""
    targets: Array
    """(3, 5, n)"""


def compensation_study(
    scenario: Scenario, setting: Setting, truth: TruthName, get: Callable[[str], Any]
) -> CompensationStudy:
    """Play `compensation.robots` robots of one kind, calibrated by the first trial's pose set."""
    first: Trial = get(scenario.trial[0].name)
    bench = open_laboratory(scenario, setting)
    chain = setting.nominal.chain
    T = cube_poses(scenario.compensation, chain.T_world_base)
    q = cube_joints(bench.robot, bench.simulator, T)
    played = [
        play_robot(robot_bench(bench, truth, k), first, T, q, k)
        for k in range(scenario.compensation.robots)
    ]
    targets = np.stack([one.targets for one in played], axis=1)
    return CompensationStudy(
        truth=truth,
        trial=first.name,
        poses=len(first.selection),
        cycles=scenario.compensation.cycles,
        T=frozen(T),
        q=frozen(q),
        figures=_stacked(played, "figures").transpose(1, 2, 3, 0, 4),
        distances=_stacked(played, "distances").transpose(1, 2, 3, 0),
        true=_stacked(played, "true").transpose(1, 0, 2),
        held_out=np.stack([one.held_out for one in played], axis=-1),
        extended=np.array([one.extended for one in played]),
        corrected=np.stack([one.corrected for one in played], axis=1),
        step=np.abs(targets - q).max(axis=(2, 3)),
        targets=targets,
        readings=np.stack([one.offsets for one in played[0].executions]),
        pose_id=np.arange(1, len(T) + 1),
    )


def robot_bench(bench: Laboratory, truth: TruthName, robot: int) -> Laboratory:
    """The laboratory with robot number `robot` of one kind in it, and a station of its own."""
    scenario = bench.scenario
    seed = int(stream(scenario.seed, "compensation", "robot", robot).integers(2**62))
    drawn = draw_truth(bench.robot, truth_of_kind(scenario, truth), seed)
    return bench.with_robot(drawn, seed)


def play_robot(bench: Laboratory, trial: Trial, T: Array, q: Array, robot: int) -> Played:
    """Calibrate one robot, and execute its program as it was and corrected.

    Parameters
    ----------
    bench : Laboratory
        Its laboratory.
    trial : Trial
        Whose poses calibrate it.
    T : (5, 4, 4) array
        Commanded poses [m].
    q : (5, n) array
        Nominal joint targets [rad, m].
    robot : int
        Its number, for the streams.
    """
    nominal, limits = bench.setting.nominal, bench.robot.limits
    seen = bench.measure_pool(trial.selection.indices, "compensation", "identification", robot)
    choice = choose(nominal, seen, bench.free("whitened"))
    models = [found.model for found in choice.identifications]
    extended = choice.chosen == "extended"
    runs = [execute(bench, T, q, "before", robot)]
    corrected, targets = [np.ones(len(T), dtype=bool)], [q]
    for model in models if extended else models[:1]:
        found = compensate(nominal, model, q, limits)
        # what cannot be corrected without reserve stays as it was
        targets.append(np.where(found.corrected[:, None], found.q, q))
        corrected.append(found.corrected)
        runs.append(execute(bench, T, targets[-1], "after", robot))
    # with the geometric model chosen, both corrected programs are one
    last = [0, 1, 2 if extended else 1]
    true = bench.held_out(bench.setting.test_q)
    return Played(
        executions=tuple(runs[k] for k in last),
        held_out=np.array(
            [_held_out(model, bench, true) for model in (nominal, models[0], models[extended])]
        ),
        extended=extended,
        corrected=np.array([corrected[k] for k in last]),
        targets=np.array([targets[k] for k in last]),
    )


def execute(bench: Laboratory, T: Array, q: Array, word: str, robot: int) -> Execution:
    """Run a program of five joint targets for many cycles, read every stop, and sum it up.

    Both corrected programs meet the same noise and approach scatter, those of `word`.
    """
    scenario, cycles = bench.scenario, bench.scenario.compensation.cycles
    p, start = len(q), validation_start(scenario)
    if word != "before":
        start += cycles * p * scenario.tracker.pose_s
    seen = bench.measure(
        np.tile(q, (cycles, 1)),
        np.tile(np.arange(p), cycles),
        "compensation",
        word,
        robot,
        start=start,
    )
    x = seen.position.reshape(cycles, p, 3).swapaxes(0, 1)
    R = seen.rotation.reshape(cycles, p, 3, 3).swapaxes(0, 1)
    command = T[:, :3, 3]
    noise = bench.tracker.own_covariance(command, T[:, :3, :3])
    common = shared_covariance(bench, T)
    gap = float(np.linalg.norm(command[SECOND] - command[FIRST]))
    ends = x[FIRST], x[SECOND]
    both = noise[FIRST, :3, :3] + noise[SECOND, :3, :3]
    return Execution(
        figures=np.stack(
            [
                _worth(accuracy(x, command, common=common[:, :3, :3])),
                _worth(repeatability(x, noise=noise[:, :3, :3])),
                _worth(rotation_accuracy(R, T[:, :3, :3], common=common[:, 3:, 3:])),
            ]
        ),
        distances=np.stack(
            [
                _worth(distance_accuracy(*ends, gap, common=shared_distance(bench, T))),
                _worth(distance_repeatability(*ends, noise=both)),
            ]
        ),
        true=position_errors(T, bench.held_out(q)),
        offsets=x - command[:, None],
    )


def shared_covariance(bench: Laboratory, T: Array) -> Array:
    """Covariance (p, 6, 6) of what all readings of a pose share: the station's own errors."""
    B, variance = _shared(bench, T)
    return np.asarray(B * variance @ np.swapaxes(B, 1, 2))


def shared_distance(bench: Laboratory, T: Array) -> float:
    """Standard uncertainty that all readings of the distance share [m]."""
    B, variance = _shared(bench, T)
    along = T[SECOND, :3, 3] - T[FIRST, :3, 3]
    row = along @ (B[SECOND, :3] - B[FIRST, :3]) / np.linalg.norm(along)
    return float(np.sqrt((row**2 * variance).sum()))


def _shared(bench: Laboratory, T: Array) -> tuple[Array, Array]:
    """Sensitivities (p, 6, k) to the station's numbers, and their variances (k,); zero if none."""
    settings, tracker = bench.scenario.tracker, bench.tracker
    if tracker.bias is None or settings.preset != "at960":
        return np.zeros((len(T), 6, 1)), np.zeros(1)
    size = bias_size(settings)
    return size.sensitivity(T[:, :3, 3], T[:, :3, :3], tracker.T_world_tracker), size.variance


def _held_out(model: RobotModel, bench: Laboratory, true: Array) -> tuple[float, float]:
    """Mean and 95th percentile [m] of the errors of predicted tool points at held-out poses."""
    found = summed_up(position_errors(true, model.poses(bench.setting.test_q)))
    return found.mean, found.p95


def _worth(figure: Figure) -> Array:
    """Value, uncertainty and floor (3, ...) of a figure."""
    return np.stack([figure.value, figure.uncertainty, figure.floor])


def _stacked(played: list[Played], name: str) -> Array:
    """One figure of every robot and variant (R, 3, ...)."""
    return np.array([[getattr(run, name) for run in one.executions] for one in played])
