"""[coverage]: many robots of several kinds, to see which stated uncertainty holds."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, get_args

from pydantic import Field

from calib.held_out_counts import FEWEST, fewest_poses
from testbed.faults import Fault
from testbed.scenario.laboratory import At960Tracker, TruthSettings
from testbed.scenario.scenario import Scenario
from testbed.studies.many_robots import TRUTHS, ManyRobots, TruthName, keys_of, truth_of_kind

if TYPE_CHECKING:
    from testbed.robots.robot import Robot

KindName = Literal[
    TruthName, "slight", "hidden", "shift", "drifting", "loaded", "one_move"
]  # fmt: skip
"""Kinds in addition to the presets: misfit below the noise, errors that all readings share, use
elsewhere than measured, noise correlated in time, another payload in use, single moves."""
KINDS: tuple[KindName, ...] = get_args(KindName)
SLIGHT = ("slight", "shift", "one_move")
"""Kinds whose misfit is 0.25 to 0.75 of the noise, which tests of one robot often miss."""
DEFAULT: tuple[KindName, ...] = ("rigid", "wen2022", "soft", "elastic", "unmodelled", "slight")


class CoverageSettings(ManyRobots):
    """[coverage]: the first trial's pose set on many robots of each kind."""

    table: ClassVar[str] = "coverage"
    keys: ClassVar[tuple[str, ...]] = keys_of("coverage", KINDS)

    truths: Annotated[tuple[KindName, ...], Field(min_length=1, max_length=len(KINDS))] = DEFAULT
    """Kinds of robots, whatever this scenario's [truth] says: its presets as they ship, and
    "slight" (a misfit of 0.25 to 0.75 of the noise, which tests often miss), "hidden" (the
    station's own errors, drawn as it states them), "shift" (measured in one part, used in another),
    "drifting" (noise that is correlated in time), "loaded" (a payload at use only), "one_move"
    (judged where a single move ends)."""
    validation_poses: Annotated[int, Field(ge=1, le=5000)] = 40
    """Number of validation poses measured on each robot, drawn anew for each like the pool."""
    level: Annotated[float, Field(ge=0.5, le=0.999)] = 0.95
    """Probability that every statement promises."""

    def own_contradictions(self, scenario: Scenario) -> Iterable[str]:
        """Too few poses for a radius that needs no model of the error."""
        tracker = scenario.tracker
        missed = tracker.missed if isinstance(tracker, At960Tracker) else 0
        needed = max(FEWEST, fewest_poses(self.level)) + missed
        if self.validation_poses < needed:
            yield (
                f"[coverage] validation_poses is {self.validation_poses}; a radius that needs no "
                f"model of the error asks for at least {needed} at level = {self.level:g}; write "
                f"validation_poses = {needed} or more"
            )

    def truth_of(self, scenario: Scenario, kind: str) -> TruthSettings:
        """[truth] from which robots of a kind are drawn; slight ones get a misfit of their size."""
        preset = kind if kind in TRUTHS else "elastic" if kind == "loaded" else "rigid"
        truth = truth_of_kind(scenario, preset)
        if kind != "one_move":
            return truth
        return truth.model_copy(update={"joint_repeatability_mdeg": None})

    def _fault(self, scenario: Scenario, robot: "Robot", truth: str) -> Fault | None:
        """Fault of one kind; "hidden" needs a statement of the station's own errors."""
        if truth == "hidden" and not isinstance(scenario.tracker, At960Tracker):
            message = (
                '[coverage] truths has "hidden", and [tracker] preset is "paper", which states no '
                "errors that all readings share"
            )
            fix = 'write preset = "at960", or remove "hidden"'
            return Fault(("coverage", "truths"), message, fix=fix, value=truth)
        slides = bool(robot.model.chain.prismatic.any())
        if truth in SLIGHT and (slides or robot.model.joint_errors.springs is not None):
            has = "slides" if slides else "springs of its own"
            message = f'[coverage] truths has "{truth}", whose joints are sprung'
            message += f"; {robot.name} has {has}"
            fix = f'remove "{truth}"'
            return Fault(("coverage", "truths"), message, fix=fix, value=truth)
        return super()._fault(scenario, robot, truth)


TABLE = CoverageSettings
