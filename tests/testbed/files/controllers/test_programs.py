"""Programs of KUKA, FANUC and Universal Robots as joints: their moves, or what they declare."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.dialects.controllers.read import joints_in, language_of
from testbed.files.read import read_session
from testbed.gates.text import read_text
from tests.command import call
from tests.hangs import no_hang
from tests.testbed.files.made import ROBOT, csv, made
from tests.testbed.proposal.test_session import proposed

M = 30
DATA = made(4, M)
DEG, MM = np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]
EXTERNAL = ",".join(f"E{k} 0.0" for k in range(1, 7))


def axes(row, form, mark=","):
    return mark.join(form.format(k=k + 1, v=value) for k, value in enumerate(row))


def position(k, row):
    joints = axes(row, "J{k}= {v:.9f} deg", ",\n\t")
    return f'P[{k + 1}:"above"]{{\n  GP1:\n  UF : 0, UT : 1,\n\t{joints}\n}};'


KRL = [f"PTP {{{axes(row, 'A{k} {v:.9f}')}}} C_PTP ; stop" for row in DEG]
DAT = [f"DECL E6AXIS XP{k + 1}={{{axes(row, 'A{k} {v:.9f}')},{EXTERNAL}}}"
       for k, row in enumerate(DEG)]  # fmt: skip
TP = [f"{k + 1:4}:J P[{k + 1}:above] 20% FINE ;" for k in range(M)]
UR = [f"  movej([{axes(row, '{v:.12f}', ', ')}], a=1.2, v=0.3)  # stop" for row in DATA.q]
DEGREES = [f"p{k} = [{axes(row, 'd2r({v:.9f})', ', ')}]" for k, row in enumerate(DEG)]
PROGRAMS = {
    "moves of KRL": ("krl", False, ["&ACCESS RVP", "DEF CAL( )", ";FOLD INI", *KRL, "END"]),
    "a data list of KRL": ("krl", True, ["DEFDAT CAL PUBLIC", *DAT, "ENDDAT"]),
    "moves of KRL by name": ("krl", True, [
        "DEF CAL( )", *DAT, "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}",
        *(f"SPTP XP{k + 1} WITH $VEL_AXIS[1] = SVEL_JOINT(20.0)" for k in range(M)), "END",
    ]),
    "moves of TP": ("fanuc", True, ["/PROG CAL", "/MN", "   1:  !to P[1] ;", *TP, "/POS",
                                    *(position(k, row) for k, row in enumerate(DEG)), "/END"]),
    "positions of TP": ("fanuc", True, ["/POS", *(position(*one) for one in enumerate(DEG))]),
    "position registers": ("fanuc", True, [
        "[*POSREG*]$POSREG  Storage: CMOS  Access: RW  : ARRAY[1,60] OF Position Reg", "",
        *(f"    [1,{k + 1}] =  'P {k}'  Group: 1\n {axes(row[:3], 'J{k} = {v:.9f} deg', ' ')}\n"
          f" J4 = {row[3]:.9f} deg J5 = {row[4]:.9f} deg J6 = {row[5]:.9f} deg"
          for k, row in enumerate(DEG)),
        "    [1,58] =  ''  Group: 1  Config: N U T, 0, 0, 0\n X: 1.0 Y: 2.0 Z: 3.0 (LIN)",
        *(f"    [1,{k}] =   ''   Uninitialized" for k in (59, 60)),
    ]),
    "moves of URScript": ("urscript", False, ["def cal():", "  set_tcp(p[0,0,0,0,0,0])", *UR]),
    "names of URScript": ("urscript", True, [
        "def cal():", *DEGREES, *(f"  movej(p{k}, a=1)" for k in range(M)), "end",
    ]),
}  # fmt: skip


@pytest.mark.parametrize(("language", "named", "lines"), PROGRAMS.values(), ids=PROGRAMS)
def test_a_program_is_proposed_as_the_joints_of_its_stops(language, named, lines, tmp_path):
    (tmp_path / "cal.txt").write_text("\n".join(lines))
    (tmp_path / "seen.csv").write_text(
        csv({axis: MM[:, k] for k, axis in enumerate("XYZ")}, form="{:.9f}")
    )
    text = read_text(tmp_path / "cal.txt", "cal.txt")
    assert language_of(text) == language
    assert (joints_in(text, language).sheet.head[0] == "pose_id") is named
    files = [tmp_path / "cal.txt", tmp_path / "seen.csv"]
    said, written = proposed(tmp_path, files, "--robot", ROBOT.name)
    assert f'format = "{language}"' in written
    left = any("LIN" in line for line in lines)
    assert ("1 Cartesian position is not used" in said) is left
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-11)  # nine decimals of a degree
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-12)


PLACE = "{X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 10}"
REFUSED = {
    "places alone": (["DEFDAT A", f"DECL E6POS XP1={PLACE}"], "only the controller knows the"),
    "a name of another file": (["DEF A( )", "PTP XHOME"], 'moves to "XHOME", which is not'),
    "some axes": (["PTP {A1 10, A2 3}"], "names only A1, A2: other axis values"),
    "a difference": (["PTP {A1 1}".replace("PTP", "PTP_REL"), "DEF A()"], "is a relative move"),
    "a changed axis": (["DEF A()", DAT[0], "XP1.A3 = 30", "PTP XP1"], "xp1 is assigned another"),
    "a part of a joint": (["DEF A()", f"{DAT[0]}", DAT[0], "PTP XP1"], "xp1 is assigned another"),
    "a register": (["/PROG A", "/MN", "1:J PR[3] 20% FINE ;"], "moves to PR[3]: only the"),
    "what was not taught": (
        ["/POS", "P[1]{ GP1: J1= 1 deg, J2= ******* deg };"],
        "P1 was never taught: it has J2 = *******; teach it",
    ),
    "a joint that is no number": (
        ["/POS", "P[1]{ GP1: J1= 1 deg, J2= nan deg, J3= 3 deg };"],
        'a.txt:2: P1 has J2 = "nan"; write a number',
    ),
    "a joint that is written with a comma": (
        ["/POS", "P[1]{ GP1: J1= 1 deg, J2= 1,5 deg, J3= 3 deg };"],
        'a.txt:2: P1 has J2 = "1,5"; write a number',
    ),
    "a joint that is cut short by two points": (
        ["/POS", "P[1]{ GP1: J1= 1 deg, J2= 1.5.2 deg, J3= 3 deg };"],
        'a.txt:2: P1 has J2 = "1.5.2"; write a number',
    ),
    "a joint that is beyond TP": (
        ["/POS", "P[1]{ GP1: J1= 1 deg, J2= 1e5x deg, J3= 3 deg };"],
        'a.txt:2: P1 has J2 = "1e5x"; write a number',
    ),
    "positions of a tool": (
        ["/PROG A", "/MN", "1:L P[1] 9mm/sec FINE ;", "/POS", "P[1]{ GP1: X = 1 mm, Y = 2 mm };"],
        "1 Cartesian position and no joint target",
    ),
    "registers of places": (
        ["[*POSREG*]$POSREG", "[1,1] = '' Group: 1", "X = 1.0 mm Y = 2.0 mm"],
        "a.txt:2: has 1 Cartesian position and no joint target",
    ),
    "what Denso writes": (["Sub Main", "Move P, @E J(1, 2)"], "is a PacScript program (Denso)"),
    "what Epson writes": (["Function main", "Go JA(1, 2)"], "is a SPEL+ program (Epson)"),
    "Python of xArm": (
        ["from xarm.wrapper import XArmAPI", "arm.set_servo_angle(angle=[1, 2, 3, 4, 5, 6])"],
        "is a Python program, and a table is wanted here; write its joint targets as a CSV",
    ),
    "Python of UR": (
        ["# poses", "import rtde_control", "for q in poses:", "    c.moveJ(q)"],
        "is a Python program",
    ),
    "Python that moves": (["c.moveJ([1, 2, 3, 4, 5, 6])"], "is a Python program"),
    "points of Epson": (["Point1 {", "rX=1"], "is a file of SPEL+ points (Epson)"),
    "poses of UR": (["def a():", "  movej(p[1,2,3,0,0,0])"], "1 Cartesian position and no joint"),
    "an inverse": (["def a():", "  movej(get_inverse_kin(w, qnear=q))"], "1 Cartesian position"),
    "a sum": (["def a():", "  movej([0, 1+1, 2, 3, 4, 5])"], "movej has a computed target"),
    "a list that is filled": (
        ["def a():", "q=[0,0,0,0,0,0]", "q[1]=3", "movej(q)"], "q is assigned another value"
    ),
    "nothing": (["program a()", "begin"], "has no joint target"),
}  # fmt: skip


@pytest.mark.parametrize(("lines", "why"), REFUSED.values(), ids=REFUSED)
def test_what_only_the_running_program_knows_is_refused(lines, why, tmp_path):
    (tmp_path / "a.txt").write_text("\n".join(lines))
    done = call("new", "session", tmp_path / "a.txt", "--robot", ROBOT.name, "--out",
                tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    assert why in " ".join(done.stderr.split())


def test_axes_beside_the_robot_are_named_where_they_move(tmp_path):
    lines = ["DEF A( )", *(f"PTP {{{axes(range(6), 'A{k} {v}')}, E1 {rail}}}" for rail in (0, 700))]
    (tmp_path / "a.src").write_text("\n".join(lines))
    found = joints_in(read_text(tmp_path / "a.src", "a.src"), "krl").sheet
    assert found.head == (*(f"q{k}_deg" for k in range(1, 7)), "E1")


def test_a_program_is_no_table_of_readings(tmp_path):
    (tmp_path / "a.src").write_text("\n".join(["DEF A( )", *KRL]))
    with pytest.raises(InputError, match="is a KRL program"):
        read_session(tmp_path / "a.src", ROBOT)


@pytest.mark.parametrize("part", ["{A1 " * 9, "[" * 40, "GLOBAL " * 20, " = " * 30, "P[1:", "d2r("])
def test_a_long_line_that_says_nothing_is_read_in_time(part, tmp_path):
    for language, first in (("krl", "DEF A()"), ("fanuc", "/POS"), ("urscript", "def a():")):
        with no_hang():  # nothing is tried twice: a line is read once or a few times
            for lead in ("", "PTP ", "1:J ", "P[1]{", "movej(", "x=", "DECL E6AXIS a={"):
                line = f"{lead}{part * (60_000 // len(part))}\n"
                (tmp_path / "a.txt").write_text(f"{first}\n{line}")
                text = read_text(tmp_path / "a.txt", "a.txt")
                with pytest.raises(InputError, match="M35"):
                    joints_in(text, language)
