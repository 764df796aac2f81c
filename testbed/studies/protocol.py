"""How records and derived files are made: this program's own way, and what another must offer."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from testbed.scenario.read import Scenario
from testbed.store import npz
from testbed.store.layout import ARRAYS, FORMAT, REPORT, RESULT
from testbed.versions import all_versions

Get = Callable[[str], Any]
"""Hands over another record by key, making it first if need be."""


class Stages(Protocol):
    """What the runner needs of a campaign; `Real` is the shipped one, a test may bring its own."""

    def record_keys(self, scenario: Scenario) -> tuple[str, ...]:
        """Keys of all records, in the usual order."""

    def record_type(self, key: str) -> type:
        """Class of one record."""

    def compute(self, scenario: Scenario, key: str, get: Get) -> Any:
        """Make one record from others."""

    def gather(self, scenario: Scenario, get: Get) -> Any:
        """The campaign of all records."""

    def derive(self, name: str, campaign: Any, robot: Any, path: Path) -> bytes | None:
        """Content of a derived file; None if it was written to `path` instead."""


class Real:
    """`testbed.run.campaign` and `testbed.store`; the heavy parts are imported when needed."""

    def record_keys(self, scenario: Scenario) -> tuple[str, ...]:
        """Keys of all records, in the usual order."""
        from testbed.run import campaign

        return campaign.record_keys(scenario)

    def record_type(self, key: str) -> type:
        """Class of one record."""
        from testbed.run import campaign

        return campaign.record_type(key)

    def compute(self, scenario: Scenario, key: str, get: Get) -> Any:
        """Make one record from others."""
        from testbed.run import campaign

        return campaign.compute(scenario, key, get)

    def gather(self, scenario: Scenario, get: Get) -> Any:
        """The campaign of all records."""
        from testbed.run import campaign

        return campaign.gather(scenario, get)

    def derive(self, name: str, campaign: Any, robot: Any, path: Path) -> bytes | None:
        """Content of a derived file; the recording is written to `path`."""
        from testbed.run import results

        if name == RESULT:
            return npz.pretty_json(results.headline(campaign))
        if name == ARRAYS:
            return npz.to_bytes({"format": FORMAT}, results.arrays(campaign))
        if name == REPORT:
            from testbed.run.report import report_html

            html: str = report_html(campaign, versions=all_versions())
            return html.encode()
        from testbed.run.recording import write_recording

        write_recording(campaign, robot, path)
        return None
