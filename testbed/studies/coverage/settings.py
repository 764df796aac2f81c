"""[coverage]: many robots of several kinds, to see which stated uncertainty holds."""

from typing import Annotated

from pydantic import Field

from calib.uncertainty.conformal import fewest_poses
from calib.uncertainty.discrepancy import FEWEST
from testbed.scenario.tables import IdentificationSettings, Settings
from testbed.scenario.tracker import At960Tracker, TrackerSettings
from testbed.studies.many_robots import TRUTHS, TruthName, study_contradictions

COVERAGE_KEYS = {f"coverage.{truth}": truth for truth in TRUTHS}
"""Record names, one per kind of robot: a run can be resumed between them."""


class CoverageSettings(Settings):
    """[coverage]: the first trial's pose set on many robots of each kind."""

    robots: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Virtual robots of each kind; 0 skips the study."""
    truths: Annotated[tuple[TruthName, ...], Field(min_length=1, max_length=len(TRUTHS))] = TRUTHS
    """Kinds of robots: presets of [truth] as they ship, whatever this scenario's [truth] says."""
    validation_poses: Annotated[int, Field(ge=1, le=5000)] = 40
    """Measured on each robot beside its calibration; drawn anew for each as the pool is."""
    level: Annotated[float, Field(ge=0.5, le=0.999)] = 0.95
    """Content that every statement promises."""


def coverage_contradictions(
    coverage: CoverageSettings, tracker: TrackerSettings, identification: IdentificationSettings
) -> list[str]:
    """Sentences, one per contradiction of [coverage] with itself, the tracker or the estimator."""
    found = study_contradictions("coverage", coverage, tracker, identification)
    if not coverage.robots:
        return found
    missed = tracker.missed if isinstance(tracker, At960Tracker) else 0
    needed = max(FEWEST, fewest_poses(coverage.level)) + missed
    if coverage.validation_poses < needed:
        found.append(
            f"[coverage] validation_poses is {coverage.validation_poses}; a radius that needs no "
            f"model of the error asks for at least {needed} at level = {coverage.level:g}; write "
            f"validation_poses = {needed} or more"
        )
    return found
