"""[reexamined]: the protocol of Wen et al. 2022 on many robots of several kinds and pools."""

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from testbed.scenario.tables import Settings
from testbed.scenario.tracker import At960Tracker, TrackerSettings
from testbed.studies.many_robots import TRUTHS, TruthName, study_contradictions

if TYPE_CHECKING:
    from testbed.scenario.scenario import Scenario

SETS_KEY = "reexamined.sets"
"""Record of the pools and the pose sets chosen from them, which all kinds of robots share."""
REEXAMINED_KEYS = {f"reexamined.{truth}": truth for truth in TRUTHS}
"""Record names, one per kind of robot: a run can be resumed between them."""
FEWEST_POSES = 100
"""Poses of a pool below which its four regions are too poor to calibrate in each."""


class ReexaminedSettings(Settings):
    """[reexamined]: every trial's kind of set, chosen anew from each of several pools."""

    robots: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Virtual robots of each kind; 0 skips the study."""
    pools: Annotated[int, Field(ge=1, le=1000)] = 12
    """Pools, each with designed sets and held-out poses of its own; each meets as many robots."""
    truths: Annotated[tuple[TruthName, ...], Field(min_length=1, max_length=len(TRUTHS))] = (
        "rigid",
        "wen2022",
    )
    """Kinds of robots: presets of [truth] as they ship, whatever this scenario's [truth] says."""


def reexamined_keys(settings: ReexaminedSettings) -> tuple[str, ...]:
    """Keys of the study's records: the sets, then one per kind of robot; none if it is off."""
    if not settings.robots:
        return ()
    return (SETS_KEY, *(f"reexamined.{truth}" for truth in settings.truths))


def reexamined_contradictions(
    settings: ReexaminedSettings, tracker: TrackerSettings, scenario: "Scenario"
) -> list[str]:
    """Sentences, one per contradiction of [reexamined] with itself or other tables."""
    found = study_contradictions("reexamined", settings, tracker, scenario.identification)
    if not settings.robots:
        return found
    if settings.robots > 1 and settings.robots % settings.pools:
        nearest = max(1, round(settings.robots / settings.pools)) * settings.pools
        found.append(
            f"[reexamined] robots is {settings.robots} and pools is {settings.pools}; every pool "
            f"meets as many robots; write robots = {nearest}"
        )
    if isinstance(tracker, At960Tracker) and tracker.systematic:
        found.append(
            "[reexamined] asks what the paper's statements hold, which know no systematic part; "
            "[tracker] systematic is true; write systematic = false, or robots = 0"
        )
    if not any(trial.method == "detmax" and trial.rows == "paper" for trial in scenario.trial):
        found.append(
            "[reexamined] plays the protocol of the paper, and no [[trial]] chooses its set as "
            'there; write method = "detmax" and rows = "paper" in one, or robots = 0'
        )
    if scenario.pool.size < FEWEST_POSES:
        found.append(
            f"[pool] size is {scenario.pool.size}; [reexamined] calibrates in each quarter of the "
            f"pool; write size = {FEWEST_POSES} or more"
        )
    return found
