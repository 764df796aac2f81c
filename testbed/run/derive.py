"""The files that follow from the records of a campaign: result, arrays, report, recording."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from testbed.scenario.scenario import Scenario
from testbed.store import npz
from testbed.store.layout import ARRAYS, FORMAT, REPORT, RESULT
from testbed.studies.protocol import Records, Study
from testbed.versions import all_versions

if TYPE_CHECKING:
    from testbed.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A scenario and all its finished records."""

    scenario: Scenario
    robot: "Robot"
    studies: tuple[Study, ...]
    """Those that made the records, in the order of the register."""
    records: Records


Derive = Callable[[str, Played, Path], bytes | None]
"""Takes the name of a derived file, what was played and a path, and returns the content of the
file; None if it was written to the path instead."""


def derived_file(name: str, played: Played, path: Path) -> bytes | None:
    """Content of a derived file; the recording is written to `path`."""
    from testbed.run import results
    from testbed.studies.trial.records import campaign_of

    campaign = campaign_of(played.scenario, played.records)
    if name == RESULT:
        return npz.pretty_json(results.headline(campaign, played.studies))
    if name == ARRAYS:
        return npz.to_bytes({"format": FORMAT}, results.arrays(campaign, played.studies))
    if name == REPORT:
        from testbed.run.report import report_html

        html = report_html(campaign, versions=all_versions(), studies=played.studies)
        return html.encode()
    from testbed.run.recording import write_recording

    write_recording(campaign, played.robot, path, played.studies)
    return None
