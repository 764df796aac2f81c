"""[coverage]: many robots of several kinds, to see which stated uncertainty holds."""

import json
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from calib.uncertainty.conformal import fewest_poses
from calib.uncertainty.discrepancy import FEWEST
from testbed.settings_identification import IdentificationSettings
from testbed.settings_robot import facts_of, robot_of
from testbed.settings_study import study_contradictions
from testbed.settings_tracker import At960Tracker, TrackerSettings
from testbed.settings_truth import TruthSettings, resolved_truth
from testbed.settings_types import Settings

if TYPE_CHECKING:
    from testbed.settings import Scenario

TruthName = Literal["rigid", "wen2022", "soft", "elastic", "unmodelled"]
TRUTHS: tuple[TruthName, ...] = ("rigid", "wen2022", "soft", "elastic", "unmodelled")
"""Presets of the truth, from the one a geometric model knows to the one no model knows."""
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


def coverage_truth(scenario: "Scenario", truth: TruthName) -> TruthSettings:
    """[truth] of one kind of robot: its preset, as a file that names only the preset has it."""
    at960 = scenario.tracker.preset == "at960"
    robot = robot_of({"robot": scenario.robot})
    document = resolved_truth({"preset": truth}, **facts_of(robot), at960=at960)
    return TruthSettings.model_validate_json(json.dumps(document))
