"""Recordings checked by the viewer: whole, equal, and shown without complaint."""

import subprocess
from contextlib import contextmanager
from dataclasses import dataclass
from unittest.mock import patch

import pytest

from calib.errors import MachineError
from testbed.cli import viewer, viewer_process

SMALL_WINDOW = (800, 500)
"""Every view is painted in it, each with a quarter of the pixels of a picture."""


@dataclass(frozen=True)
class Report:
    """What one view of the viewer has to say about its contents."""

    view: str
    severity: str
    text: str


@contextmanager
def needs_driver():
    """Skip a test where no Vulkan driver lets a viewer run."""
    try:
        yield
    except MachineError as error:
        pytest.skip(f"no headless viewer on this machine: {error}")


def verify(rrd):
    """Whether a recording is whole and readable; a file cut short is not."""
    return _status("verify", viewer.existing(rrd)) == 0


def compare(one, other):
    """Whether two recordings hold the same rows in any order; floats may differ by about 1e-8."""
    return _status("compare", "--unordered", viewer.existing(one), viewer.existing(other)) == 0


def view_reports(rrd, steps=(0,)):
    """Errors and warnings of any view at any of these steps; empty for a sound recording."""
    found = {}
    with (
        patch.object(viewer, "SIZE", SMALL_WINDOW),
        viewer.headless(viewer.existing(rrd)) as client,
    ):
        for step in steps:
            client.set_time("step", sequence=step, play_state="paused")
            viewer.paint(client)  # reports come with painting
            found |= dict.fromkeys(_reports(client.get_state()))
    return tuple(found)


def _reports(state):
    return [
        Report(str(view.name), str(report.severity), str(report.summary))
        for view in state.views
        for report in view.reports
    ]


def _status(verb, *words):
    """Exit status of a check of recordings."""
    command = [str(viewer.native()), "rrd", verb, *map(str, words)]
    with viewer_process.private_environment() as environment:
        done = subprocess.run(command, capture_output=True, check=False, env=environment)
    return done.returncode
