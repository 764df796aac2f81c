"""The closed loop: calibrate a robot, correct its program, execute it, and measure the result.

Many robots of each kind are played. All random numbers come from the study's own streams, and robot
k of every kind is drawn from the same ones. The program is the test of ISO 9283: five poses in the
diagonal plane of a cube, and joint targets for them. The simulator executes it with the true robot;
only the figures `true` and `held_out` use the truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, frozen
from calib.compensation import compensate
from calib.geometry.model import RobotModel
from calib.identification.many.choices import choose_many
from calib.identification.model_choice import ModelChoice
from calib.measurement.accuracy import error_statistics, position_errors
from calib.measurement.iso9283 import (
    IsoFigure,
    accuracy,
    distance_accuracy,
    distance_repeatability,
    repeatability,
)
from calib.measurement.iso_rotations import rotation_accuracy
from calib.measurement.observations import Measurements
from calib.uncertainty.statement.applicability import proven_at
from testbed.laboratory.tracker.of_scenario import bias_size
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import Setting, validation_start
from testbed.scenario.scenario import Scenario
from testbed.studies.compensation.cube import cube_joints, cube_poses
from testbed.studies.compensation.settings import CompensationSettings
from testbed.studies.compensation.study import CompensationStudy
from testbed.studies.many_robots import alone, together, truth_of_kind
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


AXES = dict.fromkeys(("distances", "held_out", "extended", "step"), -1) | {
    "figures": 3,
    "true": 1,
    "corrected": 1,
    "targets": 1,
    "reach": 1,
    "place": 0,
}


def play_robots(
    scenario: Scenario, setting: Setting, kinds: Sequence[str], trial: Trial, robots: range
) -> dict[str, CompensationStudy]:
    """Play some robots of each kind; the readings are those of the first of them."""
    laboratory = open_laboratory(scenario, setting)
    T = cube_poses(scenario.table(CompensationSettings), laboratory.robot.model.chain.T_world_base)
    q, ladders = cube_joints(laboratory.robot, laboratory.simulator, T), laboratory.ladders
    found = {}
    for kind in kinds:
        measured = [measure_robot(laboratory, kind, trial, k) for k in robots]
        nominal, free = laboratory.setting.nominal, laboratory.free("whitened")
        choices = choose_many(nominal, [table for _, table in measured], free, ladders=ladders)
        each = zip(measured, choices, robots, strict=True)
        found[kind] = gather(
            [play_robot(*one, choice, kind, trial, T, q, k) for one, choice, k in each]
        )
    return found


def measure_robot(
    laboratory: Laboratory, truth: str, trial: Trial, robot: int
) -> tuple[Laboratory, Measurements]:
    """The laboratory with robot number `robot` of one kind, and its calibration measurements."""
    own = robot_of(laboratory, truth, robot)
    names = ("compensation", "identification", robot)
    return own, own.measure_pool(trial.selection.indices, *names)


def gather(parts: Sequence[CompensationStudy]) -> CompensationStudy:
    """The robots of all parts."""
    return together(parts, AXES)


def play_robot(
    own: Laboratory,
    seen: Measurements,
    choice: ModelChoice,
    truth: str,
    trial: Trial,
    T: Array,
    q: Array,
    robot: int,
) -> CompensationStudy:
    """Execute the program of one calibrated robot, unchanged and corrected.

    Parameters
    ----------
    own, seen
        Results of `measure_robot`.
    choice : ModelChoice
        Its models, chosen from `Laboratory.ladders`.
    truth : str
        Kind of robot.
    trial : Trial
        Trial whose poses calibrate it.
    T : (5, 4, 4) array
        Commanded poses [m].
    q : (5, n) array
        Nominal joint targets [rad, m].
    robot : int
        Number of the robot, for the streams.
    """
    nominal = own.setting.nominal
    models = [found.model for found in choice.identifications]
    extended = choice.chosen == "extended"
    runs = [execute(own, T, q, "before", robot)]
    corrected, targets = [np.ones(len(T), dtype=bool)], [q]
    for model in models if extended else models[:1]:
        found = compensate(nominal, model, q, own.robot.limits)
        # targets that cannot be corrected without reservation stay unchanged
        targets.append(np.where(found.corrected[:, None], found.q, q))
        corrected.append(found.corrected)
        runs.append(execute(own, T, targets[-1], "after", robot))
    # where a model is proven depends on the joint values of held-out poses alone
    proven = proven_at(choice.identifications[extended], seen, own.setting.test_q)
    reach = proven.applies(targets[-1])
    # if the geometric model is chosen, both corrected programs are the same
    variants = [0, 1, 2 if extended else 1]
    true = own.held_out(own.setting.test_q)
    judged = (nominal, models[0], models[extended])
    executed = np.array([targets[k] for k in variants])
    return CompensationStudy(
        truth=truth,
        trial=trial.name,
        poses=len(trial.selection),
        cycles=own.scenario.table(CompensationSettings).cycles,
        T=frozen(T),
        q=frozen(q),
        readings=np.stack([runs[k].offsets for k in variants]),
        pose_id=np.arange(1, len(T) + 1),
        **alone(
            AXES,
            figures=[runs[k].figures for k in variants],
            distances=[runs[k].distances for k in variants],
            true=[runs[k].true for k in variants],
            held_out=[_held_out(model, own, true) for model in judged],
            extended=extended,
            corrected=[corrected[k] for k in variants],
            reach=[reach.transfer, reach.leverage],
            place=reach.place,
            step=np.abs(executed - q).max(axis=(1, 2)),
            targets=executed,
        ),
    )


def robot_of(laboratory: Laboratory, truth: str, robot: int) -> Laboratory:
    """The laboratory with robot number `robot` of one kind in it."""
    kind = truth_of_kind(laboratory.scenario, truth)
    return laboratory.with_robot(kind, "compensation", "robot", robot)


def execute(laboratory: Laboratory, T: Array, q: Array, word: str, robot: int) -> Execution:
    """Execute a program of five joint targets for many cycles, with the figures of its readings.

    Both corrected programs have the same noise and approach scatter, by the stream of `word`.
    """
    scenario = laboratory.scenario
    cycles = scenario.table(CompensationSettings).cycles
    p, start = len(q), validation_start(scenario)
    if word != "before":
        start += cycles * p * scenario.tracker.pose_s
    numbers = np.tile(np.arange(p), cycles)
    seen = laboratory.measure(
        np.tile(q, (cycles, 1)), numbers, "compensation", word, robot, start=start
    )
    x = seen.position.reshape(cycles, p, 3).swapaxes(0, 1)
    R = seen.rotation.reshape(cycles, p, 3, 3).swapaxes(0, 1)
    command = T[:, :3, 3]
    noise = laboratory.tracker.own_covariance(command, T[:, :3, :3])
    common = shared_covariance(laboratory, T)
    gap = float(np.linalg.norm(command[SECOND] - command[FIRST]))
    ends = x[FIRST], x[SECOND]
    both = noise[FIRST, :3, :3] + noise[SECOND, :3, :3]
    return Execution(
        figures=np.stack(
            [
                _columns(accuracy(x, command, common=common[:, :3, :3])),
                _columns(repeatability(x, noise=noise[:, :3, :3])),
                _columns(rotation_accuracy(R, T[:, :3, :3], common=common[:, 3:, 3:])),
            ]
        ),
        distances=np.stack(
            [
                _columns(distance_accuracy(*ends, gap, common=shared_distance(laboratory, T))),
                _columns(distance_repeatability(*ends, noise=both)),
            ]
        ),
        true=position_errors(T, laboratory.held_out(q)),
        offsets=x - command[:, None],
    )


def shared_covariance(laboratory: Laboratory, T: Array) -> Array:
    """Covariance (p, 6, 6) [m, rad] of the station's errors, which all readings of a pose share."""
    B, variance = _shared(laboratory, T)
    return np.asarray(B * variance @ np.swapaxes(B, 1, 2))


def shared_distance(laboratory: Laboratory, T: Array) -> float:
    """Standard uncertainty of the distance from errors that all readings share [m]."""
    B, variance = _shared(laboratory, T)
    along = T[SECOND, :3, 3] - T[FIRST, :3, 3]
    row = along @ (B[SECOND, :3] - B[FIRST, :3]) / np.linalg.norm(along)
    return float(np.sqrt((row**2 * variance).sum()))


def _shared(laboratory: Laboratory, T: Array) -> tuple[Array, Array]:
    """Sensitivities (p, 6, k) to the station's numbers, and their variances (k,); zero if none."""
    settings, tracker = laboratory.scenario.tracker, laboratory.tracker
    if tracker.bias is None or settings.preset != "at960":
        return np.zeros((len(T), 6, 1)), np.zeros(1)
    size = bias_size(settings)
    return size.sensitivity(T[:, :3, 3], T[:, :3, :3], tracker.T_world_tracker), size.variance


def _held_out(model: RobotModel, laboratory: Laboratory, true: Array) -> tuple[float, float]:
    """Mean and 95th percentile [m] of the errors of predicted tool points at held-out poses."""
    found = error_statistics(position_errors(true, model.poses(laboratory.setting.test_q)))
    return found.mean, found.p95


def _columns(figure: IsoFigure) -> Array:
    """Value, uncertainty and floor (3, ...) of a figure."""
    return np.stack([figure.value, figure.uncertainty, figure.floor])
