"""Python programs as joints: the calls of known libraries, lists and loops that lead to them."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.dialects.controllers.read import joints_in, language_of
from testbed.files.dialects.numbers import floats
from testbed.gates.text import read_text

DEG = np.array([[10.0, -20.0, 30.5, 40.0, -50.0, 60.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.5]])
RAD = np.radians(DEG)
XARM = ["from xarm.wrapper import XArmAPI", "arm = XArmAPI('192.168.1.20')"]
RTDE = ["import rtde_control", "c = rtde_control.RTDEControlInterface('192.168.1.20')"]
DSR = ["from DSR_ROBOT import *"]


def listed(rows):
    return "[" + ", ".join(str(row.tolist()) for row in rows) + "]"


A, B = (str(row.tolist()) for row in DEG)
READ = {
    "xArm": ("deg", [*XARM, *(f"arm.set_servo_angle(angle={q}, wait=True)" for q in (A, B))]),
    "xArm by position": ("deg", [*XARM, *(f"arm.set_servo_angle(None, {q}, 30)" for q in (A, B))]),
    "xArm without its import": (
        "deg", [f"arm.set_servo_angle(servo_id=8, angle={q})" for q in (A, B)]
    ),
    "xArm in radians": ("rad", [
        *XARM, *(f"arm.set_servo_angle(angle={q.tolist()}, is_radian=True)" for q in RAD)
    ]),
    "xArm opened in radians": ("rad", [
        XARM[0], "arm = XArmAPI('a', is_radian=True)", f"for q in {listed(RAD)}:",
        "    arm.set_servo_angle_j(q)",
    ]),
    "a loop over a list": ("rad", [
        *RTDE, f"POSES = {listed(RAD)}", "for k, q in enumerate(POSES):", "    print(k)",
        "    c.moveJ(q, 0.5, 0.3)",
    ]),
    "a loop over places in a list": ("rad", [
        *RTDE, "import numpy as np", f"POSES = np.radians({listed(DEG)})",
        "for k in range(len(POSES)):", "    c.moveJ(POSES[k])",
    ]),
    "a list that grows": ("rad", [
        *RTDE, "poses = []", *(f"poses.append({q.tolist()})" for q in RAD),
        "for q in poses:", "    c.moveJ(q)",
    ]),
    "functions": ("deg", [
        *DSR, "def go(q, v=30):", "    movej(q, vel=v, acc=30)", "def main():",
        f"    a = {A}", "    go(a)", f"    go({B})", "if __name__ == '__main__':", "    main()",
    ]),
    "a function that nothing calls": ("deg", [
        "import time", "def run(arm):", f"    arm.set_servo_angle(angle={A})", "    time.sleep(1)",
        f"    arm.set_servo_angle(angle={B})",
    ]),
    "a move to a place between": ("rad", [
        *RTDE, f"c.moveJ({RAD[0].tolist()})", "c.moveL([0.1, 0.2, 0.3, 0, 0, 0])",
        f"c.moveJ({RAD[1].tolist()})",
    ]),
}  # fmt: skip


def joints(folder, lines):
    (folder / "a.py").write_text("\n".join(lines))
    text = read_text(folder / "a.py", "a.py")
    assert language_of(text) == "python"
    return joints_in(text, "python")


@pytest.mark.parametrize(("unit", "lines"), READ.values(), ids=READ)
def test_the_joints_of_calls_are_read_in_their_unit(unit, lines, tmp_path):
    found = joints(tmp_path, lines)
    assert found.sheet.head == tuple(f"q{k}_{unit}" for k in range(1, 7))
    numbers = np.array([floats(row) for row in found.sheet.rows])
    # written with all their digits, and turned by one multiplication at most
    np.testing.assert_allclose(numbers, DEG if unit == "deg" else RAD, rtol=1e-15)
    assert found.aside == sum("moveL" in line for line in lines)


REFUSED = {
    "no unit": ([f"import numpy as np\nposes = {listed(DEG)}"], "a.py:2: .*deg or in rad; write"),
    "nothing": (["import numpy as np", "x = 1"], "has no joint target in a call of a known"),
    "a sum": ([*XARM, f"arm.set_servo_angle(angle=home + {A})"], "a.py:3: .* a computed target"),
    "one joint": ([*XARM, "arm.set_servo_angle(servo_id=1, angle=45)"], "moves one joint alone"),
    "a difference": (
        [*XARM, f"arm.set_servo_angle(angle={A}, relative=True)"], "is a relative move"
    ),
    "a condition": (
        [*XARM, "if ok:", f"    arm.set_servo_angle(angle={A})"], "a move on a condition"
    ),
    "a list made on a condition": (
        [*RTDE, f"q = {A}", "if fast:", f"    q = {B}", "c.moveJ(q)"], "a computed target"
    ),
    "a list that grows on a condition": (
        [*RTDE, f"p = [{A}]", "if more:", f"    p.append({B})", "for q in p:", "    c.moveJ(q)"],
        "a move in a loop",
    ),
    "a list that another function may change": (
        [*RTDE, f"p = {listed(RAD)}", "shuffle(p)", "for q in p:", "    c.moveJ(q)"],
        "a move in a loop",
    ),
    "a list that is changed in its place": (
        [*RTDE, f"p = {listed(RAD)}", "p[0] = home", "for q in p:", "    c.moveJ(q)"],
        "a move in a loop",
    ),
    "some of a list": (
        [*RTDE, f"for q in {listed(RAD)}:", "    if bad(q):", "        continue", "    c.moveJ(q)"],
        "a move in a loop",
    ),
    "a unit that is set later": (
        [*XARM, "arm.default_is_radian = True", f"arm.set_servo_angle(angle={A})"], "is_radian of"
    ),
    "a stream": ([*RTDE, f"c.servoJ({A}, 0, 0, 0.002, 0.1, 300)"], "servoJ has a computed target"),
    "places alone": ([*RTDE, "c.moveL([0.1, 0.2, 0.3, 0, 0, 0])"], "1 Cartesian position and no"),
    "Python 2": (["import a", "print 'hello'"], "a.py:2: is no Python 3"),
    "endless calls": ([*RTDE, "def f():", "    f()", "f()"], "is no Python 3 that can be followed"),
    "deep brackets": (["import a", "x = " + 30_000 * "["], "is no Python 3"),
    "a program too large": (["import a", *["x = [1, 2, 3, 4]"] * 40_000], "more than 0.3 MB"),
    "endless loops": (
        ["import a", *(f"{k * ' '}for i in range(1000):" for k in range(3)), "    x = 1"],
        "takes more than",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("lines", "why"), REFUSED.values(), ids=REFUSED)
def test_what_only_the_running_program_knows_is_refused_by_file_and_line(lines, why, tmp_path):
    with pytest.raises(InputError, match=why):
        joints(tmp_path, lines)
