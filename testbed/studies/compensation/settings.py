"""[compensation]: calibrated robots run a program as it was and corrected; both are measured."""

from typing import Annotated

from pydantic import Field

from testbed.scenario.tables import IdentificationSettings, Point, RotationVector, Settings, Side
from testbed.scenario.tracker import At960Tracker, TrackerSettings
from testbed.studies.many_robots import TRUTHS, TruthName, study_contradictions

COMPENSATION_KEYS = {f"compensation.{truth}": truth for truth in TRUTHS}
"""Record names, one per kind of robot: a run can be resumed between them."""


class CompensationSettings(Settings):
    """[compensation]: the first trial's pose set corrects the five poses of an ISO 9283 test."""

    robots: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Virtual robots of each kind; 0 skips the study."""
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
    """How the tool stands at all five poses: rotation vector in the base frame."""


def compensation_keys(settings: CompensationSettings) -> tuple[str, ...]:
    """Keys of the study's records, one per kind of robot; none if it is off."""
    return tuple(f"compensation.{truth}" for truth in settings.truths if settings.robots)


def compensation_contradictions(
    settings: CompensationSettings,
    tracker: TrackerSettings,
    identification: IdentificationSettings,
) -> list[str]:
    """Sentences, one per contradiction of [compensation] with itself, tracker or estimator."""
    found = study_contradictions("compensation", settings, tracker, identification)
    if not settings.robots:
        return found
    if isinstance(tracker, At960Tracker) and tracker.missed:
        found.append(
            f"[compensation] cycles needs every visit; [tracker] missed is {tracker.missed}; "
            "write missed = 0, or robots = 0"
        )
    return found
