"""Common parts of the studies of many robots: kinds, blocks and stacking."""

import dataclasses
import json
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Protocol, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from testbed.faults import Fault
from testbed.scenario.laboratory import TruthSettings
from testbed.scenario.presets import resolved_truth, robot_of
from testbed.scenario.scenario import Scenario, StudyTable
from testbed.scenario.tables import PAPER_SET
from testbed.scenario.truth import truth_faults
from testbed.studies.protocol import Cut, Records

if TYPE_CHECKING:
    from testbed.robots.robot import Robot


T = TypeVar("T")
TruthName = Literal["rigid", "wen2022", "soft", "elastic", "unmodelled", "drives", "moving"]


TRUTHS: tuple[TruthName, ...] = get_args(TruthName)
"""Presets of the truth, from one that a geometric model can match to those that none can."""


BLOCK, LARGE_BLOCK, MANY = 25, 250, 2500
"""Robots in a piece of work: few, so that a stopped run has little to repeat; more for so many
robots in all that the common work of the pieces would cost too much."""


class ManyRobots(StudyTable):
    """The table of a study of many robots of several kinds."""

    totals: ClassVar[tuple[str, ...]] = ("robots",)
    needs_paper_set: ClassVar[bool] = False
    """Whether every robot needs the free set of the paper."""

    robots: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Virtual robots of each kind; 0 skips the study."""
    if TYPE_CHECKING:  # each study declares them, with its own defaults
        truths: tuple[Any, ...]
        """Names of kinds of robots."""

    def contradictions(self, scenario: Scenario) -> list[str]:
        """Sentences, one per contradiction with itself or other tables."""
        name, identification = self.table, scenario.identification
        found = []
        if len(set(self.truths)) < len(self.truths):
            found.append(f"[{name}] truths contains a name twice; remove the copy")
        if not self.robots:
            return found
        if self.robots == 1:
            found.append(
                f"[{name}] robots is 1; 0 skips it, and a spread needs at least 2; write robots = "
                "0 or more than 1"
            )
        if scenario.tracker.measures == "point":
            found.append(
                f'[{name}] robots needs full poses; [tracker] measures is "point"; write robots = 0'
            )
        elif scenario.fixtures is not None:
            found.append(
                f"[{name}] robots are seen from one station; remove [fixtures], or write robots = 0"
            )
        if identification.loss != "squared" or identification.prior is not None:
            key = "loss" if identification.prior is None else "prior"
            found.append(
                f"[{name}] robots plays least squares and the weak prior; [identification] {key} "
                f"says otherwise; remove {key}, or write robots = 0"
            )
        return [*found, *self.own_contradictions(scenario)]

    @abstractmethod
    def own_contradictions(self, scenario: Scenario) -> Iterable[str]:
        """Further contradictions of this table, if the study is on."""

    def faults(self, scenario: Scenario, robot: "Robot") -> list[Fault]:
        """Faults for kinds that are impossible for this robot; none if the study is off."""
        if not self.robots:
            return []
        faults = [found for truth in self.truths if (found := self._fault(scenario, robot, truth))]
        if self.needs_paper_set and PAPER_SET not in robot.free_sets:
            message = (
                f"[{self.table}] robots is {self.robots}, but {robot.name} has no free set "
                f'"{PAPER_SET}", the numbers that the paper identifies'
            )
            at, fix = (self.table, "robots"), "write robots = 0"
            faults.append(Fault(at, message, fix=fix, value=self.robots))
        return faults

    def truth_of(self, scenario: Scenario, kind: str) -> TruthSettings:
        """[truth] of one kind of robots, from which the hash of its record follows."""
        return truth_of_kind(scenario, kind)

    def _fault(self, scenario: Scenario, robot: "Robot", truth: str) -> Fault | None:
        """Fault if the robot cannot be of one kind; else None."""
        from calib.identification.joint_models import gravity_quarters

        quarters, joints = gravity_quarters(robot.model.chain), robot.model.chain.n_joints
        upright = truth == "unmodelled"  # its play goes by the closed form of an upright arm
        allowed = ""
        if truth in SAGGING and (quarters is None or (upright and quarters != (0, 0))):
            stands = "stands upright" if upright else "stands upright or lies level"
            said = f", whose joints sag by a closed form that does not hold for {robot.name}"
            allowed = f"an arm with level parallel axes 2 and 3 that {stands} at zero"
        elif upright and joints < 5:
            said = f", which has play in joint 5; {robot.name} has {joints} joints"
        elif other := [*truth_faults(self.truth_of(scenario, truth), robot)]:
            said = f": {other[0].message.removeprefix('[truth] ')}"
            allowed = other[0].allowed
        else:
            return None
        message, fix = f'[{self.table}] truths has "{truth}"{said}', f'remove "{truth}"'
        return Fault((self.table, "truths"), message, allowed=allowed, fix=fix, value=truth)


SAGGING = ("wen2022", "soft", "unmodelled")
"""Kinds of robots whose joints sag by the closed form of an upright arm."""


def keys_of(table: str, kinds: Sequence[str] = TRUTHS) -> tuple[str, ...]:
    """Record keys of a study of many robots, one per kind: it can be resumed between them."""
    return tuple(f"{table}.{kind}" for kind in kinds)


def cut_of(name: str, robots: int, reads: Mapping[str, Any]) -> Cut:
    """The pieces of work in which so many robots are played."""
    many = robots >= MANY
    return Cut(name, robots, LARGE_BLOCK if many else BLOCK, reads, single=many)


def kind_of(key: str) -> str:
    """The kind of robots of a record: ``coverage.rigid`` is about rigid ones."""
    return key.partition(".")[2]


def played_keys(table: ManyRobots) -> tuple[str, ...]:
    """Keys of the records of one scenario, in the order of its kinds; none if the study is off."""
    return tuple(f"{table.table}.{truth}" for truth in table.truths if table.robots)


def of_each_kind(records: Records, table: ManyRobots, kind: type[T]) -> tuple[T, ...]:
    """The finished records of a study, one per kind of robot, in the order of the scenario."""
    found = (records.find(f"{table.table}.{truth}", kind) for truth in table.truths)
    return tuple(study for study in found if study is not None)


def truth_of_kind(scenario: Scenario, truth: str) -> TruthSettings:
    """[truth] of one kind of robot: its preset without further keys."""
    at960 = scenario.tracker.preset == "at960"
    robot = robot_of({"robot": scenario.robot})
    document = resolved_truth({"preset": truth}, robot, at960=at960)
    return TruthSettings.model_validate_json(json.dumps(document))


class Dataclass(Protocol):
    """Any dataclass."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]


R = TypeVar("R", bound=Dataclass)
Axes = Mapping[str, int]
"""Arrays of a study's record with one figure per robot, and their axis of robots."""


def alone(axes: Axes, **figures: ArrayLike) -> dict[str, Any]:
    """Figures of one robot as arrays of a record of one robot."""
    return {name: np.expand_dims(value, axes[name]) for name, value in figures.items()}


def together(parts: Sequence[R], axes: Axes) -> R:
    """Join records of some robots each to one of all, in the given order.

    Fields without an axis of robots are taken from the first part. Parts are read one at a time,
    since there may be thousands.
    """
    first = parts[0]
    fields = [(name, axis % getattr(first, name).ndim) for name, axis in axes.items()]
    shapes = {name: [*getattr(first, name).shape] for name in axes}
    kinds = {name: getattr(first, name).dtype for name in axes}
    ends = dict.fromkeys(axes, 0)
    for part in parts:
        for name, axis in fields:
            array = getattr(part, name)
            ends[name] += array.shape[axis]
            if array.dtype != kinds[name]:
                kinds[name] = np.promote_types(kinds[name], array.dtype)
    for name, axis in fields:
        shapes[name][axis], ends[name] = ends[name], 0
    whole = {name: np.empty(shape, kinds[name]) for name, shape in shapes.items()}
    for part in parts:
        for name, axis in fields:
            array, begun = getattr(part, name), ends[name]
            ends[name] += array.shape[axis]
            whole[name][(slice(None),) * axis + (slice(begun, ends[name]),)] = array
    return dataclasses.replace(first, **whole)
