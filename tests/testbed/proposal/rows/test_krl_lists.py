"""Programs of KUKA with their data lists, where an export calls P12 what the list calls XP12.

Truth: joints from which both files are written.
"""

import numpy as np
import pytest

from testbed.files.dialects.pose_names import counted_alike
from testbed.files.read import ReadOptions, read_session
from testbed.proposal.rows.krl_lists import without_programs
from tests.testbed.files.made import ROBOT, made
from tests.testbed.proposal.test_session import proposed, refused

M = 30
DATA = made(m=M)


def files(folder, *, shots=range(M), order=range(M)):
    """A program, its data list and the points of some shots."""
    names = "A1 {:.9f},A2 {:.9f},A3 {:.9f},A4 {:.9f},A5 {:.9f},A6 {:.9f},E1 0.0"
    rows = [names.format(*row) for row in np.degrees(DATA.q)]
    (folder / "cal.dat").write_text("\n".join([
        "&ACCESS RVP", "DEFDAT CAL", *(f"DECL E6AXIS XP{k + 1}={{{rows[k]}}}" for k in order),
        "ENDDAT",
    ]))  # fmt: skip
    moves = [
        f";FOLD PTP P{k + 1} Vel=20 % PDAT1 Tool[1] Base[0]\nPTP XP{k + 1}\n;ENDFOLD"
        for k in range(M)
    ]
    (folder / "cal.src").write_text("\n".join(["&ACCESS RVP", "DEF cal( )", *moves, "END"]))
    points = 1e3 * DATA.T[:, :3, 3]
    lines = [f"A, Robot, P{k + 1}, {x:.6f}, {y:.6f}, {z:.6f}"
             for k, (x, y, z) in enumerate(points) if k in shots]  # fmt: skip
    (folder / "sa.txt").write_text("\n".join(["// Units: mm", *lines]))
    return folder / "cal.src", folder / "cal.dat", folder / "sa.txt"


@pytest.mark.parametrize("lost", [(), (0, 7, 20)])
def test_points_of_an_inline_form_are_those_of_its_list(lost, tmp_path):
    """Three missed shots were refused: "no joints for poses P1, P2 ..."."""
    left = [k for k in range(M) if k not in lost]
    _, lists, export = files(tmp_path, shots=left, order=range(M)[::-1])
    said, written = proposed(tmp_path, [lists, export], "--robot", ROBOT.name)
    assert 'match = "pose_id"' in written
    assert ("--drop-invalid" in said.partition("Next")[2]) == bool(lost)
    assert "states no unit" not in said  # // Units: mm
    session = read_session(tmp_path / "session.toml", ROBOT, options=ReadOptions(drop_invalid=True))
    np.testing.assert_allclose(session.measurements.q, DATA.q[left], rtol=0, atol=2e-11)


def test_names_with_an_x_are_the_same_without_it():
    assert counted_alike(["XP1", "XP02", "XHOME"], ["P2", "p1"]) is not None
    assert counted_alike(["XP1", "XP2"], ["P3"]) is None
    assert counted_alike(["XP1", "P2"], ["P1", "P2"]) is None
    assert counted_alike(["XP1", "XP2", "XP3"], ["P1"]) is None  # fewer than half
    assert counted_alike(["X", "XP1"], ["P1"]) is None


@pytest.mark.parametrize("turned", [False, True])
def test_a_program_is_left_aside_where_its_list_is_given(turned, tmp_path):
    """Both together were refused in any order: "declare it in the same file"."""
    program, lists, export = files(tmp_path)
    pair = [lists, program] if turned else [program, lists]
    said, written = proposed(tmp_path, [*pair, export], "--robot", ROBOT.name)
    assert "cal.src: the joints of its moves stand in cal.dat" in said
    assert 'file = "cal.dat"' in written
    np.testing.assert_allclose(
        read_session(tmp_path / "session.toml", ROBOT).measurements.q, DATA.q, rtol=0, atol=2e-11
    )


def test_a_program_alone_is_told_of_its_list(tmp_path):
    program, lists, export = files(tmp_path)
    said = refused(tmp_path, program, export, "--robot", ROBOT.name)
    assert "give its data list, the .dat of the same name, in place of the program" in said
    # a list of another program, or one without joints, takes the place of none
    lists.write_text("DEFDAT CAL\nDECL E6POS XP1={X 1,Y 2,Z 3,A 0,B 0,C 0}\nENDDAT")
    assert without_programs([program, lists]) == ([program, lists], ())
    other = lists.with_name("other.dat")
    other.write_text("DECL E6AXIS XP1={A1 0,A2 0,A3 0,A4 0,A5 0,A6 0}")
    assert without_programs([program, other]) == ([program, other], ())


def test_a_session_is_renamed_where_a_new_one_is_to_take_its_place(tmp_path):
    """The other verbs had --overwrite, this one did not."""
    _, lists, export = files(tmp_path)
    old = tmp_path / "session.toml"
    for kept in ("one", "two"):
        old.write_text(kept)
        said = refused(tmp_path, lists, export)
        assert "exists already; choose another --out, or rename the old one by --overwrite" in said
        proposed(tmp_path, [lists, export], "--overwrite", "--robot", ROBOT.name)
        assert 'file = "cal.dat"' in old.read_text()
    assert [(tmp_path / f"session.toml.old-{k}").read_text() for k in (1, 2)] == ["one", "two"]
    # what is refused leaves the old one in place
    (tmp_path / "none.csv").write_text("a,b\n1,2\n")
    before = old.read_text()
    refused(tmp_path, tmp_path / "none.csv", "--overwrite")
    assert old.read_text() == before
