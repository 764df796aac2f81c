"""Lists of joints of Doosan, Kawasaki, ROKAE, Yaskawa and Stäubli: read exactly, or refused.

Truth: joints that are written here as these languages write them.
"""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.dialects.controllers.read import joints_in, language_of
from testbed.files.read import read_session
from testbed.gates.text import read_text
from tests.hangs import no_hang
from tests.testbed.files.controllers.test_programs import DATA, DEG, MM, M, axes
from tests.testbed.files.made import ROBOT, csv
from tests.testbed.proposal.test_session import proposed

LISTS = [axes(row, "{v:.9f}", ", ") for row in DEG]
POSJ = [f"posj({one})" for one in LISTS]
LISTED = [f"#p{k} {one.replace(', ', '  ')}" for k, one in enumerate(LISTS)]
VALUES = [f'<Value key="{k}" {axes(row, chr(106) + "{k}={v:.9f}", " ")} />'
          for k, row in enumerate(DEG)]  # fmt: skip
QUOTED = [" ".join(f'{p[:3]}"{p[3:]}"' if p[:1] == "j" else p for p in one.split())
          for one in VALUES]  # fmt: skip


def job(kind, rows, moves=(), head="///TOOL 0"):
    return ["/JOB", "//NAME CAL", "//POS", f"///NPOS {len(rows)},0,0,0,0,0", head,
            f"///POSTYPE {kind}", *rows, "//INST", "///DATE 2026/03/01 14:05", "NOP", *moves,
            "END"]  # fmt: skip


ANGLES = [f"C{k:05d}={one.replace(' ', '')}" for k, one in enumerate(LISTS)]
DTX = ['<?xml version="1.0" encoding="utf-8"?>', "<Database>",
       '<Data name="nSpeed" type="num" size="1"><Value key="0" value="3" /></Data>',
       '<!-- <Data name="jOld" type="jointRx"><Value key="0" j1="1" /></Data>', "-->",
       f'<Data name="jP" access="private" type="jointRx" size="{M}">', *QUOTED, "</Data>",
       '<Data name="pA" type="pointRx"><Value key="0" x="1" y="2" z="3" /></Data>',
       "</Database>"]  # fmt: skip
PROGRAMS = {
    "moves of DRL": ("doosan", "a.py", False, [
        "def main():", *["  wait(1)"] * 20, *(f"  movej({one}, v=30, a=30)  # A" for one in POSJ),
        "  movel(posx(1, 2, 3, 0, 0, 0), v=9)", "main()",
    ]),
    "names of DRL": ("doosan", "a.drl", True, [
        "set_velj(30)", *(f"Global_p{k} = {one}" for k, one in enumerate(POSJ)),
        *(f"movej(Global_p{k}, 30, 30, 0, 0, 0)" for k in range(M)),
    ]),
    "lists of DRL": (
        "doosan", "a.txt", True, [f"q{k}=posj([{one}])" for k, one in enumerate(LISTS)],
    ),
    "blocks of comment in DRL": ("doosan", "a.drl", False, [
        "'''", f"movej({POSJ[0]}, v=3)", "don't \"\"\" go", "'''", "tp_log(\"''' # \")",
        *(f"movej({one}, v=3)" for one in POSJ), f'"""movej({POSJ[1]}) "quoted"', '"""', '# """',
    ]),
    "a program of AS": ("kawasaki", "a.as", True, [
        ".NETCONF 1", ".PROGRAM cal()", "  HOME ; first", *(f"  JMOVE #p{k}" for k in range(M)),
        ".END", ".TRANS", "t1 1 2 3 4 5 6", ".END", ".JOINTS", *LISTED, ".END",
    ]),
    "a list of AS": ("kawasaki", "a.txt", True, LISTED),
    "points of AS": ("kawasaki", "a.pg", False, [
        ".PROGRAM cal()", *(f"  LMOVE #PPOINT({one})" for one in LISTS), ".END",
    ]),
    "names of AS": ("kawasaki", "a.as", True, [
        ".PROGRAM cal()", *(f"  POINT #a[{k}] = #PPOINT({one})" for k, one in enumerate(LISTS)),
        *(f"  10 JMOVE #a[{k}],2" for k in range(M)), ".END",
    ]),
    "a job in degrees": ("inform", "a.JBI", True, job(
        "ANGLE", ANGLES, [f"MOVJ C{k:05d} VJ=10.00" for k in range(M)])),
    "positions of a job": ("inform", "a.jbi", True, job("ANGLE", ANGLES)),
    "moves of VAL3": ("val3", "a.txt", False, [
        "program start()", "begin", *(f"  movej({{{one}}}, tTool, mNom)" for one in LISTS),
        "  movel(pA, tTool, mNom)  // there", "end",
    ]),
    "names of VAL3": ("val3", "a.pgx", True, [
        '<?xml version="1.0"?>', "<Program>", "<![CDATA[", "begin",
        *(f"  jP[{k}] = {{{one}}}" for k, one in enumerate(LISTS)),
        *(f"  movej(jP[{k}], tTool, mNom)" for k in range(M)), "end", "]]>",
    ]),
    "Data of VAL3": ("val3", "a.dtx", True, DTX),
    "names of RL": ("rokae", "a.mod", True, [
        "MODULE MainModule",
        *(f"LOCAL VAR jointtarget j{k} = j:{{{one}}}{{EJ 0.000,0.000,0.000,0.000,0.000,0.000}}"
          for k, one in enumerate(LISTS)),
        'LOCAL VAR robtarget p1 = p:{{1,2,3},{1,0,0,0}}{cfg 0,0,0,0}{EJ 0,0,0,0,0,0}',
        "GLOBAL PROC main()", f"//  MoveAbsJ j{M},v100,fine,tool0", '  Print("MoveAbsJ ")',
        *(f"  MoveAbsJ j{k},v100,fine,tool0,wobj0" for k in range(M)), "  movel p1,v9,fine,tool0",
        "ENDPROC", "ENDMODULE",
    ]),
    "a list of RL": ("rokae", "a.csv", True, [
        f"LOCAL VAR jointtarget j{k} = j:{{\t {one}   ,\t0\t}}\t\t{{EJ 0,0,0,0,0,0}}"
        for k, one in enumerate(LISTS)
    ]),
    "lists of RL": ("rokae", "a.txt", False, [f"MoveAbsJ j:{{{one}}},v9" for one in LISTS]),
}  # fmt: skip


@pytest.mark.parametrize(("language", "name", "named", "lines"), PROGRAMS.values(), ids=PROGRAMS)
def test_joints_are_read_as_they_stand(language, name, named, lines, tmp_path):
    (tmp_path / name).write_text("\n".join(lines))
    (tmp_path / "seen.csv").write_text(csv({f"{a}_mm": MM[:, k] for k, a in enumerate("xyz")}))
    text = read_text(tmp_path / name, name, markup=True)
    assert language_of(text) == language
    found = joints_in(text, language)
    assert (found.sheet.head[0] == "pose_id") is named
    assert found.aside == (any("movel" in line or "HOME" in line for line in lines))
    (tmp_path / "session.toml").write_text(
        f'match = "order"\n[joints]\nfile = "{name}"\nformat = "{language}"\n'
        '[points]\nfile = "seen.csv"\n[uncertainty]\nposition_um = 30\n'
    )
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-11)  # nine decimals of a degree


def test_a_list_of_joints_is_proposed(tmp_path):
    (tmp_path / "a.dtx").write_text("\n".join(DTX))
    (tmp_path / "seen.csv").write_text(csv({axis: MM[:, k] for k, axis in enumerate("XYZ")}))
    files = [tmp_path / "a.dtx", tmp_path / "seen.csv"]
    said, written = proposed(tmp_path, files, "--robot", ROBOT.name)
    assert 'format = "val3"' in written
    assert "to fix" not in said


PULSES = [f"C{k:05d}=1200,-340,5600,0,77,-12" for k in range(3)]
REFUSED = {
    "pulses": (job("PULSE", PULSES), "C0 is in pulses: only parameters of the controller state"),
    "no kind": (["/JOB", "//POS", *PULSES], "no line ///POSTYPE states whether C0 has"),
    "places of a job": (job("BASE", PULSES, ["MOVL C00000 V=9"]), "1 Cartesian position and no"),
    "seven axes": (job("ANGLE", ["C00000=1,2,3,4,5,6,7"]), "C0 has 7 axes; expected at most 6"),
    "an increment": (
        job("ANGLE", ANGLES, ["IMOV C00000 VJ=1"]), "IMOV is a relative move, whose start"
    ),
    "a variable of a job": (job("ANGLE", ANGLES, ["MOVJ P001 VJ=1"]), 'moves to "P1", which is'),
    "a difference of DRL": ([f"movej({POSJ[0]}, v=3, mod=DR_MV_MOD_REL)"], "is a relative move"),
    "the same without a name": ([f"movej({POSJ[0]}, 3, 3, 0, 0, 1)"], "is a relative move"),
    "a sum of DRL": ([f"p = {POSJ[0]}", "movej(p + posj(1, 0, 0, 0, 0, 0))"], "a computed target"),
    "a sum of lists": ([f"movej({POSJ[0]} + {POSJ[1]}, v=3)"], "has a computed target"),
    "a changed point": ([f"p = {POSJ[0]}", "p[2] = 3", "movej(p)"], "p is assigned another value"),
    "a comment of DRL without an end": (
        ["x = 1", '"""', *(f"movej({one})" for one in POSJ)], 'a.txt:2: a block that begins with'
    ),
    "places of DRL": (["movel(posx(1,2,3,4,5,6))"], "1 Cartesian position and no joint target"),
    "an unknown point of AS": ([".PROGRAM a()", "JMOVE #p9", ".END"], 'moves to "p9", which is'),
    "a taught point of AS": (
        [".PROGRAM a()", "HERE #p0", "JMOVE #p0", ".JOINTS", LISTED[0]], "p0 is assigned another"
    ),
    "decimal commas of AS": (
        [".JOINTS", LISTED[0].replace(".", ",")], "#p0 is not followed by numbers with spaces"
    ),
    "places of AS": ([".PROGRAM a()", "LMOVE t1", ".TRANS", "t1 1 2 3 4 5 6"], "1 Cartesian pos"),
    "a point of VAL3": (["begin", "movej(pA, tTool, mNom)"], 'moves to "pA", which is not'),
    "a changed joint": (
        ["begin", f"j = {{{LISTS[0]}}}", "j.j2 = 4", "movej(j, tTool, m)"], "j is assigned another"
    ),
    "a joint that is left out": (
        ["<Database>", '<Data name="j" type="jointRx">', '<Value key="0" j1="1" j3="3" />'],
        "j[0] does not give all its joints",
    ),
    "a changed joint of RL": (
        [f"VAR jointtarget j1 = j:{{{LISTS[0]}}}", "j1.q2 = 4", "MoveAbsJ j1,v9"],
        "j1 is assigned another",
    ),
    "an array of RL": (
        [f"VAR jointtarget j[1] = {{j:{{{LISTS[0]}}}}}", f"VAR jointtarget j1 = j:{{{LISTS[0]}}}",
         "MoveAbsJ j[1],v9"], "MoveAbsJ has a computed target",
    ),
    "places of RL": (
        ["VAR robtarget p = p:{{1,2,3},{1,0,0,0}}", "MoveL p,v9,fine,tool0"], "1 Cartesian pos"
    ),
    "a value in two lines": (
        ["<Database>", '<Data type="jointRx" name="j">', '<Value key="0"', 'j1="1" />'],
        "<Value goes over several lines",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("lines", "why"), REFUSED.values(), ids=REFUSED)
def test_what_a_list_does_not_say_is_refused(lines, why, tmp_path):
    (tmp_path / "a.txt").write_text("\n".join(lines))
    text = read_text(tmp_path / "a.txt", "a.txt")
    language = language_of(text)
    assert language is not None
    with pytest.raises(InputError) as caught:
        joints_in(text, language)
    assert why in str(caught.value)


def test_a_seventh_joint_that_turns_is_one_of_the_arm(tmp_path):
    rows = [f"VAR jointtarget j{k} = j:{{{one},{k}}}" for k, one in enumerate(LISTS)]
    (tmp_path / "a.txt").write_text("\n".join(rows))
    found = joints_in(read_text(tmp_path / "a.txt", "a.txt"), "rokae").sheet
    assert found.head[-1] == "q7_deg"
    assert [row[-1] for row in found.rows] == [str(k) for k in range(M)]


def test_axes_of_a_track_are_named_beside_the_joints(tmp_path):
    rows = [line for k in range(2) for line in (ANGLES[k], f"BC{k:05d}={700 * k}")]
    (tmp_path / "a.jbi").write_text("\n".join(job("ANGLE", rows)))
    found = joints_in(read_text(tmp_path / "a.jbi", "a.jbi"), "inform").sheet
    assert found.head[-1] == "BC 1"
    assert [row[-1] for row in found.rows] == ["0", "700"]


@pytest.mark.parametrize(
    "part", ["posj(", "#p1 ", "1 ", "C0=", "{", "<Value ", "<!--", "j1=", "[", "616350656,"]
)
def test_a_long_line_that_says_nothing_is_read_in_time(part, tmp_path):
    with no_hang():  # nothing is tried twice: a line is read once or a few times
        for lead in ("", "posj(", "movej(", "#p 1 2 3 4 ", "JMOVE #", "C00001=", "<Data ", "x="):
            (tmp_path / "a.txt").write_text(f" {lead}{part * (60_000 // len(part))}\n")
            text = read_text(tmp_path / "a.txt", "a.txt")
            language_of(text)
            for language in ("doosan", "kawasaki", "inform", "val3", "rokae"):
                with pytest.raises(InputError):
                    joints_in(text, language)


def test_a_cell_of_many_digits_is_read_in_time(tmp_path):
    digits = "1" * 60_000 + "x"
    for line in ("posj({}, 1, 2, 3)", "movej([{}, 1, 2, 3])", "j = {{{}, 1, 2, 3}}", "#p {} 1 2 3",
                 "///POSTYPE ANGLE\nC1={},1,2,3", "PTP {{A1 {}, A2 1, A3 1}}"):  # fmt: skip
        (tmp_path / "a.txt").write_text(line.format(digits))
        text = read_text(tmp_path / "a.txt", "a.txt")
        for language in ("doosan", "kawasaki", "inform", "val3", "rokae", "urscript", "krl"):
            # where digits may be split before a point that is not there, it takes minutes
            with no_hang(), pytest.raises(InputError):
                joints_in(text, language)
