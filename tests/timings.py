"""Write testbed/cli/timings.json again: how long each step of the shipped scenes takes.

``python -m tests.timings`` plays all of them; with names of scenes it plays these and keeps the
others. Seconds are those of the processor, which other work on the machine does not lengthen.
"""

import json
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from testbed.assets import scene_names
from testbed.cli.course import TimeLeft, Took
from testbed.cli.timings import SHIPPED, shipped
from testbed.files.read import read_session
from testbed.identify.folder import play_calibration
from testbed.plan.folder import play_plan
from testbed.robots.catalog import load_robot
from testbed.run.export import export_campaign
from testbed.run.play import planned_steps, play_run
from testbed.scenario.read import changed
from testbed.studies import load_scenario

MEASURED = ("quick", "wen2022")
"""Scenes whose measurements are identified from as well."""
FEWER: dict[str, dict[str, Any]] = {"million": {"coverage.robots": 2500}}
"""What is played of a scene that takes a night; its pieces are alike."""


def played(name: str, folder: Path) -> dict[str, dict[str, Took]]:
    """What the works of one scene took."""
    scenario, took = load_scenario(name), {}
    if name.startswith("plan"):
        course = TimeLeft(clock=time.process_time)
        play_plan(scenario, folder / "plan", progress=course)
        took[f"plan {name}"] = course.took
    whole, scenario = planned_steps(scenario), changed(scenario, FEWER.get(name, {}))
    planned = {step: Took(0.0, pieces) for step, pieces in planned_steps(scenario).items()}
    course = TimeLeft(planned, clock=time.process_time)
    campaign = play_run(scenario, folder / "run", progress=course).campaign
    took[f"run {name}"] = {
        step: one.scaled(whole.get(step, one.pieces)) for step, one in course.took.items()
    }
    if name in MEASURED:
        robot = load_robot(scenario.robot)
        export_campaign(campaign, robot, folder / "data")
        session = read_session(folder / "data", robot)
        course = TimeLeft(clock=time.process_time)
        play_calibration(robot, session, folder / "identified", progress=course)
        took[f"identify {session.name}"] = course.took
    return took


def main(names: list[str]) -> None:
    """Play scenes and write the file; several are played each in a process of its own.

    There it imports what it needs, as every run does.
    """
    if len(names) != 1:
        for name in names or scene_names():
            subprocess.run([sys.executable, "-m", "tests.timings", name], check=True)
        return
    with TemporaryDirectory() as folder:
        works = {**shipped(), **played(names[0], Path(folder))}
    lines = []
    for work, steps in sorted(works.items()):
        took = {step: [round(one.seconds, 3), one.pieces] for step, one in steps.items()}
        lines.append(f" {json.dumps(work)}: {json.dumps(took)}")
    SHIPPED.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
