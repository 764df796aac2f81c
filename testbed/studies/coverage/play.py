"""The coverage study: many robots of each kind are calibrated, validated and judged.

Poses of one robot share its parameter error, so the robot is the unit. Robot k of every kind has
the same random numbers, noise, validation poses and judging poses, from its own streams. Only the
judging uses the truth; statements are computed from the tracker's readings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calib.arrays import Index
from calib.identification.identify import Identification, identify
from calib.identification.levels import Ladder
from calib.identification.many.choices import choose_many
from calib.identification.many.single import identify_many
from calib.identification.model_choice import ModelChoice, choose
from calib.identification.prior import own_prior
from calib.measurement.accuracy import point_distances
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.studies.coverage.errors import Errors, many_parameter_errors, parameter_errors
from testbed.studies.coverage.judge import OF_A_MODEL, MeasuredRobot, judge_model, judge_models
from testbed.studies.coverage.settings import CoverageSettings
from testbed.studies.coverage.study import CoverageStudy
from testbed.studies.coverage.visits import measure_robot, measure_robots, poses_of
from testbed.studies.many_robots import BLOCK, alone, together
from testbed.studies.trial.records import Trial

OF_NUMBERS = ("normal_error", "nees")
OF_A_ROBOT = ("extended", "log_evidence", "before", *OF_NUMBERS)
AT_ONCE = BLOCK
"""Robots of a kind that are fitted at once; larger arrays are not faster. It is the number in a
piece of a small study, so that a robot has the same results in a large one, to rounding."""
AXES = dict.fromkeys((*OF_A_MODEL, *OF_A_ROBOT), -1)


def play_robots(
    scenario: Scenario, setting: Setting, kinds: Sequence[str], trial: Trial, robots: range
) -> dict[str, CoverageStudy]:
    """Play a trial's pose set on some robots of each kind."""
    laboratory = open_laboratory(scenario, setting)
    ladders, chosen = laboratory.ladders, trial.selection.indices
    found: dict[str, list[CoverageStudy]] = {kind: [] for kind in kinds}
    for k in range(0, len(robots), AT_ONCE):
        some = robots[k : k + AT_ONCE]
        poses = [poses_of(laboratory, robot) for robot in some]  # the same for every kind
        for kind in kinds:
            measured = measure_robots(laboratory, kind, chosen, some, poses)
            found[kind].append(_play_some(kind, measured, ladders, len(robots)))
    return {kind: gather(parts) for kind, parts in found.items()}


def _play_some(
    kind: str, measured: Sequence[MeasuredRobot], ladders: Sequence[Ladder], robots: int
) -> CoverageStudy:
    """Play some of the robots of one kind, few enough for their fits to have room in memory."""
    level = measured[0].laboratory.scenario.table(CoverageSettings).level
    found = many_models(measured, ladders, robots)
    errors = many_parameter_errors([fits[0] for fits, *_ in found], measured)
    judged = zip(
        *(judge_models([fits[k] for fits, *_ in found], measured, level) for k in range(2)),
        strict=True,
    )
    each = zip(measured, found, errors, judged, _before(measured), strict=True)
    return gather([_played(kind, *one) for one in each])


def gather(parts: Sequence[CoverageStudy]) -> CoverageStudy:
    """The robots of all parts; numbers that some robot's model cannot match are judged on none."""
    if all(part.names for part in parts):
        return together(parts, AXES)
    found = together(parts, {name: axis for name, axis in AXES.items() if name not in OF_NUMBERS})
    none = np.zeros((0, len(found.before)))
    return replace(found, names=(), normal_error=none, nees=none[:, 0])


def play_robot(laboratory: Laboratory, truth: str, chosen: Index, robot: int) -> CoverageStudy:
    """Calibrate, validate and judge one robot."""
    measured = measure_robot(laboratory, truth, chosen, robot)
    found = models(measured, laboratory.ladders)
    level = laboratory.scenario.table(CoverageSettings).level
    errors = parameter_errors(found[0][0], measured)
    judged = [judge_model(fit, measured, level) for fit in found[0]]
    return _played(truth, measured, found, errors, judged, *_before([measured]))


def _before(measured: Sequence[MeasuredRobot]) -> list[float]:
    """Mean errors of robots at their judging poses before any calibration [m]."""
    nominal = measured[0].laboratory.setting.nominal
    p = nominal.poses(np.concatenate([one.judge_q for one in measured]))[:, :3, 3]
    parts = np.split(p, np.cumsum([len(one.judge_q) for one in measured[:-1]]))
    each = zip(measured, parts, strict=True)
    return [float(point_distances(one.true, there).mean()) for one, there in each]


def _played(
    truth: str,
    measured: MeasuredRobot,
    found: tuple[tuple[Identification, ...], float, bool],
    errors: Errors | None,
    judged: Sequence[Mapping[str, Any]],
    before: float,
) -> CoverageStudy:
    """The record of one robot from its models and judgements."""
    scenario = measured.laboratory.scenario
    fits, evidence, extended = found
    normal_error, nees = errors or (np.zeros(0), np.nan)
    return CoverageStudy(
        truth=truth,
        level=scenario.table(CoverageSettings).level,
        judged=scenario.test.poses,
        names=fits[0].names if len(normal_error) else (),
        **alone(
            AXES,
            extended=extended,
            log_evidence=evidence,
            before=before,
            normal_error=normal_error,
            nees=nees,
            **{name: [one[name] for one in judged] for name in OF_A_MODEL},
        ),
    )


def many_models(
    measured: Sequence[MeasuredRobot], ladders: Sequence[Ladder], robots: int = 0
) -> list[tuple[tuple[Identification, ...], float, bool]]:
    """Results of `models` for each robot of a kind, with `robots` played in all."""
    own, seen = measured[0].laboratory, [one.seen for one in measured]
    nominal, free = own.setting.nominal, own.free("whitened")
    bare = identify_many(nominal, seen, free, prior=own_prior(free, nominal))
    choices = choose_many(nominal, seen, free, ladders=ladders, robots=robots)
    return [_found(*one) for one in zip(bare, choices, strict=True)]


def models(
    measured: MeasuredRobot, ladders: Sequence[Ladder]
) -> tuple[tuple[Identification, ...], float, bool]:
    """Geometric and extended model of a robot, the log evidence, and whether the latter is chosen.

    The geometric one has the identifiable numbers, without a prior; the extended one has the weak
    prior. Validation poses are not used for the choice, or they would no longer be a test.
    """
    nominal, free = measured.laboratory.setting.nominal, measured.laboratory.free("whitened")
    choice = choose(nominal, measured.seen, free, ladders=ladders)
    bare = identify(nominal, measured.seen, free, prior=own_prior(free, nominal))
    return _found(bare, choice)


def _found(
    bare: Identification, choice: ModelChoice
) -> tuple[tuple[Identification, ...], float, bool]:
    """The models, log evidence and outcome of a choice."""
    return (bare, choice.identifications[1]), choice.log_evidence, choice.chosen == "extended"
