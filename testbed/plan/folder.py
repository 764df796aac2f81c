"""The files of a plan: table, numbers, report, recording, scenario and robot programs."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.errors import one_line
from testbed.plan.cautions import has_program, tests_contact
from testbed.plan.plan import STEPS
from testbed.plan.plan import plan as make_plan
from testbed.plan.promises import PLANNED
from testbed.plan.recording import plan_story
from testbed.plan.records import Plan
from testbed.plan.report import plan_report_html
from testbed.plan.results import Stop, goal_csv, plan_csv, plan_numbers, stops_of
from testbed.progress import Progress
from testbed.recording.write import story_bytes
from testbed.robots.catalog import Robot, load_robot
from testbed.scenario.read import dump_scenario
from testbed.scenario.scenario import Scenario
from testbed.store.layout import PLAN, PLAYED_PLAN, SCENARIO
from testbed.store.npz import pretty_json
from testbed.store.whole_folder import check_free, whole_folder
from testbed.units import counted
from testbed.versions import all_versions

ACCELERATION = 1.4
"""Of the joint that turns farthest, URScript [rad/s^2]."""
TABLE, REPORT, RECORDING = "plan.csv", "plan_report.html", PLAYED_PLAN
GOAL = "goal.csv"


def programs(plan: Plan) -> dict[str, str]:
    """File names and texts of the robot programs.

    There are none if the arm is not of six turning joints, nor if a move is blocked: a program that
    hits something is worse than none.
    """
    if not has_program(plan) or plan.tour.blocked:
        return {}
    stops = stops_of(plan)
    return {
        name: "\n".join(map(one_line, write(plan, stops))) + "\n" for name, write in WRITERS.items()
    }


def robot_called(robot: str) -> str:
    """What people call the robot of a scenario: its shipped name, its folder, or its file.

    Examples
    --------
    >>> [robot_called(name) for name in ("staubli_tx60", "cell/mine/robot.toml", "cell/arm.urdf")]
    ['staubli_tx60', 'mine', 'arm']
    """
    path = Path(robot)
    return path.parent.name if path.name == "robot.toml" and path.parent.name else path.stem


def _notes(plan: Plan, mark: str) -> list[str]:
    """Comment lines that head every program."""
    scenario, tour = plan.scenario, plan.tour
    robot = robot_called(scenario.robot)
    whose = f"Joint values are those of robot {robot}, not of this controller: check signs and"
    own = plan.controller.statements
    lines = [
        f"{whose} zeros." if not own else f"Joint values are as the file of robot {robot} says of",
        *([f"its controller ({', '.join(own)}): check signs and zeros."] if own else []),
        PLANNED,
        f"Plan {scenario.name}, seed {scenario.seed}, robot {robot}: {counted(len(tour), 'pose')},",
        f"{100 * scenario.plan.speed_share:g} % joint speed, {tour.settle:g} s at each pose.",
        "First bring the robot by hand to the start, joints",
        f"({_list(_degrees(plan, tour.start), 3)}) deg:",
        "the first move was checked only from there. The program begins with a move to the start.",
        "Moves were checked against the nominal robot and the obstacles of the scenario only:"
        if tests_contact(plan)
        else "No move was checked for collisions, since the file gives the links no shapes:",
        "run it once at low speed with a hand on the stop.",
    ]
    return [f"{mark} {line}" for line in lines]


def _degrees(plan: Plan, q: Array) -> Array:
    """Joints (n,) as the controller counts them [deg], of those of the arm [rad]."""
    return np.degrees(plan.controller.of_arm(q))


def _list(values: Sequence[float] | Array, digits: int = 6) -> str:
    """Numbers separated by commas."""
    return ", ".join(f"{value:.{digits}f}" for value in values)


def val3(plan: Plan, stops: Sequence[Stop]) -> list[str]:
    """VAL3: joint points with the names used, then the moves."""
    lines = [
        *_notes(plan, "//"),
        "// Data: joint jPose[], mdesc mSpeed (vel = share of the joint speed), tool tTool.",
        "begin",
        f"  mSpeed.vel={100 * plan.scenario.plan.speed_share:g}",
        "  mSpeed.blend=off",
    ]
    for k, stop in enumerate(stops):
        lines.append(f"  jPose[{k}]={{{_list(_degrees(plan, stop.q))}}}")
        lines.append(f"  movej(jPose[{k}],tTool,mSpeed) // {stop.name}")
        if stop.measured:
            lines += ["  waitEndMove()", f"  delay({plan.tour.settle:g})"]
    return [*lines, "end"]


def rapid(plan: Plan, stops: Sequence[Stop]) -> list[str]:
    """RAPID: one module with one procedure."""
    lines = ["MODULE TruebedPlan", *(f"  {line}" for line in _notes(plan, "!")), "  PROC Measure()"]
    lines += [f"    VelSet {100 * plan.scenario.plan.speed_share:g}, 5000;"]
    for stop in stops:
        target = f"[[{_list(_degrees(plan, stop.q))}],[9E9,9E9,9E9,9E9,9E9,9E9]]"
        # never a zone: a rounded corner is not the move that was checked
        lines.append(f"    MoveAbsJ {target}, v7000, fine, tool0; ! {stop.name}")
        if stop.measured:
            lines.append(f"    WaitTime {plan.tour.settle:g};")
    return [*lines, "  ENDPROC", "ENDMODULE"]


def krl(plan: Plan, stops: Sequence[Stop]) -> list[str]:
    """KRL: one program of PTP moves."""
    lines = ["DEF truebed_plan()", *_notes(plan, ";"), "BAS(#INITMOV, 0)"]
    lines.append(f"BAS(#VEL_PTP, {100 * plan.scenario.plan.speed_share:g})")
    for stop in stops:
        axes = ", ".join(f"A{k + 1} {value:.6f}" for k, value in enumerate(_degrees(plan, stop.q)))
        lines.append(f"PTP {{{axes}}} ; {stop.name}")
        if stop.measured:
            lines.append(f"WAIT SEC {plan.tour.settle:g}")
    return [*lines, "END"]


def urscript(plan: Plan, stops: Sequence[Stop]) -> list[str]:
    """URScript: moves in radians; `v` is that of the joint that turns farthest.

    It is such that the slowest joint, which decides the time, keeps its share of its largest speed.
    """
    lines = ["def truebed_plan():", *(f"  {line}" for line in _notes(plan, "#"))]
    counts = plan.controller
    # of the controller's joints, so that none of the arm's is faster than the slowest
    most = 1.0 if counts.plain else float(np.abs(counts.matrix).sum(axis=1).max())
    slowest, before = float(plan.tour.speeds.min()) / most, counts.of_arm(plan.tour.start)
    for stop in stops:
        J = counts.of_arm(stop.q)
        turn = float(np.abs(J - before).max())
        # nobody knows from where the start is reached: there no joint is faster than the slowest
        v = turn / stop.seconds if stop.seconds > 0 else slowest
        lines.append(f"  movej([{_list(J, 9)}], a={ACCELERATION:g}, v={v:.6f}) # {stop.name}")
        before = J
        if stop.measured:
            lines.append(f"  sleep({plan.tour.settle:g})")
    return [*lines, "end"]


WRITERS: dict[str, Callable[[Plan, Sequence[Stop]], list[str]]] = {
    "program.val3.txt": val3,
    "program.rapid.txt": rapid,
    "program.krl.txt": krl,
    "program.urscript.txt": urscript,
}
"""What each file name is written by."""


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
    tell = progress or (lambda *_: None)
    tell(STEPS[-1], len(STEPS) - 1, len(STEPS))
    write_plan(made, load_robot(scenario.robot), out, overwrite=overwrite)
    tell("", len(STEPS), len(STEPS))
    return made


def write_plan(plan: Plan, robot: Robot, out: Path, *, overwrite: bool = False) -> None:
    """Write every file of a plan; the folder appears whole or not at all."""
    with whole_folder(out, PLAN, overwrite=overwrite) as folder:
        texts = {
            SCENARIO: dump_scenario(plan.scenario),
            TABLE: plan_csv(plan),
            GOAL: goal_csv(plan),
            **programs(plan),
            REPORT: plan_report_html(plan, robot, versions=all_versions()),
        }
        for name, text in texts.items():
            (folder / name).write_bytes(text.encode())
        (folder / RECORDING).write_bytes(story_bytes(plan_story(plan, robot)))
        (folder / PLAN).write_bytes(pretty_json(plan_numbers(plan, robot)))
