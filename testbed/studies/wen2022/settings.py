"""[reexamined]: the protocol of Wen et al. 2022 on many robots of several kinds and pools."""

from collections.abc import Iterable
from typing import Annotated, ClassVar

from pydantic import Field

from testbed.scenario.contradictions import of_budget
from testbed.scenario.laboratory import At960Tracker
from testbed.scenario.scenario import Scenario
from testbed.studies.many_robots import TRUTHS, ManyRobots, TruthName, keys_of
from testbed.studies.wen2022.paper_set import by_paper

SETS_KEY = "reexamined.sets"
"""Record of the pools and the pose sets chosen from them, which all kinds of robots share."""
FEWEST_POSES = 100
"""Fewest poses of a pool, so that each of its four regions has enough for a calibration."""


class ReexaminedSettings(ManyRobots):
    """[reexamined]: every trial's kind of set, chosen anew from each of several pools."""

    table: ClassVar[str] = "reexamined"
    keys: ClassVar[tuple[str, ...]] = (SETS_KEY, *keys_of("reexamined"))
    needs_paper_set: ClassVar[bool] = True

    pools: Annotated[int, Field(ge=1, le=1000)] = 12
    """Number of pools, each with its own designed sets and held-out poses, and as many robots."""
    truths: Annotated[tuple[TruthName, ...], Field(min_length=1, max_length=len(TRUTHS))] = (
        "rigid",
        "wen2022",
    )
    """Kinds of robots: presets of [truth] as they ship, whatever this scenario's [truth] says."""

    def own_contradictions(self, scenario: Scenario) -> Iterable[str]:
        """Missing pools or sets of the paper's protocol, or a tracker that it does not assume."""
        if self.robots > 1 and self.robots % self.pools:
            nearest = max(1, round(self.robots / self.pools)) * self.pools
            yield (
                f"[reexamined] robots is {self.robots} and pools is {self.pools}; every pool "
                f"meets as many robots; write robots = {nearest}"
            )
        if isinstance(scenario.tracker, At960Tracker) and scenario.tracker.systematic:
            yield (
                "[reexamined] asks what the paper's statements hold, which know no systematic "
                "part; [tracker] systematic is true; write systematic = false, or robots = 0"
            )
        if not any(map(by_paper, scenario.trial)):
            yield (
                "[reexamined] plays the protocol of the paper, and no [[trial]] chooses its set as "
                'there; write method = "detmax" and rows = "paper" in one, or robots = 0'
            )
        if not scenario.studies.paper_budget:  # else it is reported already
            yield from of_budget(scenario)
        if scenario.pool.size < FEWEST_POSES:
            yield (
                f"[pool] size is {scenario.pool.size}; [reexamined] calibrates in each quarter of "
                f"the pool; write size = {FEWEST_POSES} or more"
            )


TABLE = ReexaminedSettings
