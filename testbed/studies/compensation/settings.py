"""[compensation]: calibrated robots run a program as it was and corrected; both are measured."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field

from testbed.faults import Fault
from testbed.scenario.laboratory import At960Tracker
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import Point, RotationVector, Side
from testbed.studies.many_robots import TRUTHS, ManyRobots, TruthName, keys_of

if TYPE_CHECKING:
    from testbed.robots.robot import Robot


class CompensationSettings(ManyRobots):
    """[compensation]: the first trial's pose set corrects the five poses of an ISO 9283 test."""

    table: ClassVar[str] = "compensation"
    keys: ClassVar[tuple[str, ...]] = keys_of("compensation")

    truths: Annotated[tuple[TruthName, ...], Field(min_length=1, max_length=len(TRUTHS))] = (
        "rigid",
        "wen2022",
        "elastic",
    )
    """Kinds of robots: presets of [truth] as they ship, whatever this scenario's [truth] says."""
    cycles: Annotated[int, Field(ge=3, le=1000)] = 30
    """Visits of each pose, before and after."""
    center_mm: Point = (350.0, 0.0, 100.0)
    """Center of the cube, base frame."""
    side_mm: Side = 400.0
    """Side of the cube; its edges are parallel to the base's axes."""
    turn_deg: RotationVector = (0.0, 90.0, 0.0)
    """Orientation of the tool at all five poses: rotation vector in the base frame."""

    def own_contradictions(self, scenario: Scenario) -> Iterable[str]:
        """A tracker that misses readings, since every visit of a cycle is needed."""
        tracker = scenario.tracker
        if isinstance(tracker, At960Tracker) and tracker.missed:
            yield (
                f"[compensation] cycles needs every visit; [tracker] missed is {tracker.missed}; "
                "write missed = 0, or robots = 0"
            )

    def faults(self, scenario: Scenario, robot: "Robot") -> list[Fault]:
        """Faults of the table, and a cube that the robot cannot reach."""
        from testbed.studies.compensation.cube import cube_fault

        found = super().faults(scenario, robot)
        if found or not self.robots:
            return found
        fault = cube_fault(self, scenario.cell, robot)
        return [] if fault is None else [fault]


TABLE = CompensationSettings
