"""The files of a plan: table, numbers, report, recording, scenario and robot programs."""

from pathlib import Path

from testbed.plan.plan import plan as make_plan
from testbed.plan.programs import programs
from testbed.plan.recording import plan_story
from testbed.plan.records import Plan
from testbed.plan.report import plan_report_html
from testbed.plan.results import plan_numbers
from testbed.plan.table import plan_csv
from testbed.progress import Progress
from testbed.recording.write import write_story
from testbed.robots.catalog import Robot, load_robot
from testbed.scenario.read import Scenario, dump_scenario
from testbed.store.layout import PLAN, SCENARIO
from testbed.store.npz import pretty_json
from testbed.store.run_folder import check_free, whole_folder
from testbed.versions import all_versions

TABLE, REPORT, RECORDING = "plan.csv", "plan_report.html", "plan.rrd"


def play_plan(
    scenario: Scenario,
    out: Path,
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
    where: str = "scenario",
) -> Plan:
    """Make a plan and write its folder; the folder is checked first, and written last."""
    check_free(out, PLAN, overwrite=overwrite)
    made = make_plan(scenario, progress=progress, where=where)
    write_plan(made, load_robot(scenario.robot), out, overwrite=overwrite)
    return made


def write_plan(plan: Plan, robot: Robot, out: Path, *, overwrite: bool = False) -> None:
    """Write every file of a plan; the folder appears whole or not at all."""
    with whole_folder(out, PLAN, overwrite=overwrite) as folder:
        texts = {
            SCENARIO: dump_scenario(plan.scenario),
            TABLE: plan_csv(plan),
            **programs(plan),
            REPORT: plan_report_html(plan, robot, versions=all_versions()),
        }
        for name, text in texts.items():
            (folder / name).write_bytes(text.encode())
        write_story(plan_story(plan, robot), folder / RECORDING)
        (folder / PLAN).write_bytes(pretty_json(plan_numbers(plan, robot)))
