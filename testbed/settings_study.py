"""What the studies of many robots have in common: which robots, and how they are calibrated."""

from typing import Protocol

from testbed.settings_identification import IdentificationSettings
from testbed.settings_tracker import TrackerSettings


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
