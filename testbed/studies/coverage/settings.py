"""[coverage]: many robots of several kinds, to see which stated uncertainty holds."""

from collections.abc import Iterable
from typing import Annotated, ClassVar

from pydantic import Field

from testbed.scenario.laboratory import At960Tracker
from testbed.scenario.scenario import Scenario
from testbed.studies.many_robots import TRUTHS, ManyRobots, TruthName, keys_of


class CoverageSettings(ManyRobots):
    """[coverage]: the first trial's pose set on many robots of each kind."""

    table: ClassVar[str] = "coverage"
    keys: ClassVar[tuple[str, ...]] = keys_of("coverage")

    truths: Annotated[tuple[TruthName, ...], Field(min_length=1, max_length=len(TRUTHS))] = TRUTHS
    """Kinds of robots: presets of [truth] as they ship, whatever this scenario's [truth] says."""
    validation_poses: Annotated[int, Field(ge=1, le=5000)] = 40
    """Measured on each robot beside its calibration; drawn anew for each as the pool is."""
    level: Annotated[float, Field(ge=0.5, le=0.999)] = 0.95
    """Content that every statement promises."""

    def own_contradictions(self, scenario: Scenario) -> Iterable[str]:
        """A radius that needs no model of the error asks for enough poses."""
        # reading a scenario without this study loads no uncertainty
        from calib.uncertainty.conformal import fewest_poses
        from calib.uncertainty.discrepancy import FEWEST

        tracker = scenario.tracker
        missed = tracker.missed if isinstance(tracker, At960Tracker) else 0
        needed = max(FEWEST, fewest_poses(self.level)) + missed
        if self.validation_poses < needed:
            yield (
                f"[coverage] validation_poses is {self.validation_poses}; a radius that needs no "
                f"model of the error asks for at least {needed} at level = {self.level:g}; write "
                f"validation_poses = {needed} or more"
            )


TABLE = CoverageSettings
