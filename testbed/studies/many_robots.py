"""What the studies of many robots share."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import Field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from calib.arrays import Array
from testbed.scenario.tables import PAPER_SET, IdentificationSettings, facts_of, robot_of
from testbed.scenario.tracker import TrackerSettings
from testbed.scenario.truth import TruthSettings, resolved_truth, truth_faults
from testbed.strict import Fault
from testbed.units import Mean

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot
    from testbed.scenario.scenario import Scenario


TruthName = Literal["rigid", "wen2022", "soft", "elastic", "unmodelled"]


TRUTHS: tuple[TruthName, ...] = ("rigid", "wen2022", "soft", "elastic", "unmodelled")
"""Presets of the truth, from the one a geometric model knows to the one no model knows."""


class StudySettings(Protocol):
    """What every such table has."""

    @property
    def robots(self) -> int:
        """Robots of each kind; 0 skips the study."""

    @property
    def truths(self) -> tuple[str, ...]:
        """Kinds of robots."""


def study_contradictions(
    table: str,
    study: StudySettings,
    tracker: TrackerSettings,
    identification: IdentificationSettings,
) -> list[str]:
    """Sentences, one per contradiction of a study's table with itself, tracker or estimator."""
    found = []
    if len(set(study.truths)) < len(study.truths):
        found.append(f"[{table}] truths names one twice; remove the copy")
    if not study.robots:
        return found
    if study.robots == 1:
        found.append(
            f"[{table}] robots is 1; 0 skips it, and a spread needs at least 2; write robots = 0 "
            "or more than 1"
        )
    if tracker.measures == "point":
        found.append(
            f'[{table}] robots needs full poses; [tracker] measures is "point"; write robots = 0'
        )
    if identification.loss != "squared" or identification.prior is not None:
        key = "loss" if identification.prior is None else "prior"
        found.append(
            f"[{table}] robots plays least squares and the weak prior; [identification] {key} "
            f"says otherwise; remove {key}, or write robots = 0"
        )
    return found


SAGGING = ("wen2022", "soft", "unmodelled")
"""Kinds of robots whose joints sag by the closed form of an upright arm."""


def coverage_faults(scenario: "Scenario", robot: "Robot") -> list[Fault]:
    """Faults of the lists of truths that this robot cannot have; none if the studies are off."""
    coverage, again, loop = scenario.coverage, scenario.reexamined, scenario.compensation
    faults = []
    if coverage.robots:
        faults += truths_faults(scenario, robot, "coverage", coverage.truths)
    if loop.robots:
        faults += truths_faults(scenario, robot, "compensation", loop.truths)
    if again.robots:
        faults += truths_faults(scenario, robot, "reexamined", again.truths)
        if PAPER_SET not in robot.free_sets:
            faults.append(
                Fault(
                    ("reexamined", "robots"),
                    f"[reexamined] robots is {again.robots}, but {robot.name} has no free set "
                    f'"{PAPER_SET}", the numbers that the paper identifies',
                    fix="write robots = 0",
                    value=again.robots,
                )
            )
    return faults


def truths_faults(
    scenario: "Scenario", robot: "Robot", table: str, truths: tuple[TruthName, ...]
) -> list[Fault]:
    """Faults of one table's list of truths that this robot cannot have."""
    from calib.identification.joint_models import gravity_quarters

    faults = []
    quarters = gravity_quarters(robot.model.chain)
    for truth in truths:
        upright = truth == "unmodelled"  # its play goes by the closed form of an upright arm
        if truth in SAGGING and (quarters is None or (upright and quarters != (0, 0))):
            stands = "stands upright" if upright else "stands upright or lies level"
            faults.append(
                Fault(
                    (table, "truths"),
                    f'[{table}] truths has "{truth}", whose joints sag by a closed form that does '
                    f"not hold for {robot.name}",
                    allowed=f"an arm with level parallel axes 2 and 3 that {stands} at zero",
                    fix=f'remove "{truth}"',
                    value=truth,
                )
            )
        elif truth == "unmodelled" and robot.model.chain.n_joints < 5:
            faults.append(
                Fault(
                    (table, "truths"),
                    f'[{table}] truths has "unmodelled", which has play in joint 5; {robot.name} '
                    f"has {robot.model.chain.n_joints} joints",
                    fix='remove "unmodelled"',
                    value=truth,
                )
            )
        elif other := truth_faults(truth_of_kind(scenario, truth), robot):
            said = other[0].message.removeprefix("[truth] ")
            faults.append(
                Fault(
                    (table, "truths"),
                    f'[{table}] truths has "{truth}": {said}',
                    allowed=other[0].allowed,
                    fix=f'remove "{truth}"',
                    value=truth,
                )
            )
    return faults


def truth_of_kind(scenario: "Scenario", truth: TruthName) -> TruthSettings:
    """[truth] of one kind of robot: its preset, as a file that names only the preset has it."""
    at960 = scenario.tracker.preset == "at960"
    robot = robot_of({"robot": scenario.robot})
    document = resolved_truth({"preset": truth}, **facts_of(robot), at960=at960)
    return TruthSettings.model_validate_json(json.dumps(document))


def mean_over_robots(values: Array, *, probability: float = 0.95) -> Mean:
    """Mean and confidence interval of one figure per robot (R,), R at least 2.

    References
    ----------
    Student's t with R - 1 degrees of freedom; JCGM 100:2008, G.3.
    """
    count = len(values)
    t = float(stdtrit(count - 1, (1 + probability) / 2))
    return Mean(float(values.mean()), t * float(values.std(ddof=1)) / count**0.5)


def log_ratio_over_robots(one: Array, other: Array, *, probability: float = 0.95) -> Mean:
    """Geometric mean of one/other over paired robots (R,), as a logarithm with its interval."""
    return mean_over_robots(np.log(one / other), probability=probability)


Outcome = Literal["better", "worse", "undecided"]


def outcome_of(ratio: Mean) -> Outcome:
    """Better or worse if an interval of a logarithm lies below or above zero."""
    return "worse" if ratio.low > 0 else "better" if ratio.high < 0 else "undecided"


def family_confidence(comparisons: int) -> float:
    """Confidence of each of several intervals that hold together with 95 % (Bonferroni)."""
    return 1 - (1 - CONFIDENCE) / max(comparisons, 1)


CONFIDENCE = 0.95


class Dataclass(Protocol):
    """Any dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


R = TypeVar("R", bound=Dataclass)
Axes = Mapping[str, int]
"""The arrays of a study's record that hold one figure per robot, and which axis counts robots."""


def alone(axes: Axes, **figures: ArrayLike) -> dict[str, Any]:
    """Figures of one robot as arrays of a record of one robot."""
    return {name: np.expand_dims(value, axes[name]) for name, value in figures.items()}


def together(parts: Sequence[R], axes: Axes) -> R:
    """Records of some robots each as one of all, in the order given.

    What counts no robots is taken from the first part.
    """
    return replace(
        parts[0],
        **{
            name: np.concatenate([getattr(part, name) for part in parts], axis=axis)
            for name, axis in axes.items()
        },
    )
