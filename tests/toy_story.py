"""The smallest recording, and what this process holds after it."""

from pathlib import Path

import numpy as np
import pytest

from testbed.recording.story import Chapter, Story
from testbed.robots.catalog import load_robot

STOPS = np.array([[0.0] * 6, [0.1] * 6, [-0.2] * 6])


def nothing(*_):
    """Draws nothing."""


def chapter(name, motion, draw=nothing):
    return Chapter(name, f"{name}_item", (1, 2, 3), motion, ("#### Toy", f"- {name}"), draw)


def story(*chapters):
    robot = load_robot("staubli_tx60")
    reach, station = np.ones((4, 3)) * np.arange(4)[:, None], np.array([3.0, 0, 1])
    return Story("toy-1", "toy", "sum", robot, robot.model.chain, reach, station, nothing, chapters)


def held():
    """Threads, memory [kB] and open files of this process, as Linux counts them."""
    status = Path("/proc/self/status")
    if not status.exists():
        pytest.skip("this system does not say what a process holds")
    pairs = (line.split(":") for line in status.read_text(encoding="utf-8").splitlines())
    found = {name: int(value.split()[0]) for name, value in pairs if name in ("Threads", "VmRSS")}
    return found | {"files": sum(1 for _ in status.with_name("fd").iterdir())}
