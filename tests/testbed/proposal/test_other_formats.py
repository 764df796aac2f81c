"""Formats that are no tables: each is called by its name, with how to make one of it."""

import json
import subprocess
import sys

import numpy as np
import pytest

from testbed.files.read import read_session
from testbed.gates.kinds import require_no_yaml
from tests.testbed.proposal.test_odd_files import DATA, UR10
from tests.testbed.proposal.test_session import call, proposed


def rct(q, place):
    """A pose by the moment when it was measured, as calibration packages of ROS write it."""
    of = "".join(f"    {a}: {v!r}\n" for a, v in zip("xyz", place.tolist(), strict=True))
    return f"'{1000 + len(of)}{place[0]:.9f}':\n  pose:\n{of}  joints:\n" + items(q, "  ")


def echo(q, place):
    """Messages of ROS as they are printed, one below the other."""
    of = "".join(f"  {a}: {v!r}\n" for a, v in zip("xyz", place.tolist(), strict=True))
    return f"header:\n  frame_id: ''\nposition:\n{items(q)}tracker:\n{of}---\n"


def items(values, before=""):
    return "".join(f"{before}- {v!r}\n" for v in values.tolist())


@pytest.mark.parametrize("form", [rct, echo])
@pytest.mark.parametrize("ending", [".yaml", ".txt"])
def test_yaml_is_told_how_to_become_json_which_is_read(form, ending, tmp_path):
    """It was "a YAML file", or in .txt a table without joints."""
    yaml = pytest.importorskip("yaml")
    file = tmp_path / f"a b{ending}"
    file.write_text("".join(map(form, DATA.q, DATA.T[:, :3, 3])))
    done = call("new", "session", file, "--robot", UR10.name, "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    assert "is YAML, and a table or JSON is wanted here; write it as JSON" in done.stderr
    command = done.stderr.partition("which is read: ")[2].rpartition(". [S39]")[0]
    command = command.replace("python3", sys.executable, 1)
    subprocess.run(command, shell=True, check=True, cwd=tmp_path)
    assert yaml.safe_load(file.read_text().partition("---")[0])
    proposed(tmp_path, [tmp_path / "a b.json"], "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_array_equal(table.q, DATA.q)
    np.testing.assert_array_equal(table.position, DATA.T[:, :3, 3])


def test_lists_of_numbers_in_json_are_a_table_without_names(tmp_path):
    rows = np.hstack([np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]])
    (tmp_path / "a.json").write_text(json.dumps(rows.tolist()))
    proposed(tmp_path, [tmp_path / "a.json"], "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    # degrees and millimeters with every bit
    np.testing.assert_allclose(table.q, DATA.q, rtol=1e-15)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "Name: P1\nX: 1.0\nY: 2.0\nZ: 3.0\n\nName: P2\nX: 1.0\nY: 2.0\nZ: 3.0\n",
        "Points:\nP1 1.0 2.0 3.0\nP2 - 2.0 3.0\n",
        "Notes:\nX,Y,Z\n- 1,2,3\n",
    ],
)
def test_reports_with_colons_are_no_yaml(text):
    require_no_yaml(text.splitlines(), "a.txt")


@pytest.mark.parametrize(
    ("first", "called"),
    [
        (b"#ROSBAG V2.0\n\0", "a bag of ROS"),
        (b"SQLite format 3\0", "a bag of ROS 2"),
        (b"\x89MCAP0\r\n\0", "a bag of ROS 2 (MCAP)"),
        (b"PAR1\x15\0", "a Parquet file"),
    ],
)
def test_bags_and_other_packed_tables_are_called_by_their_names(first, called, tmp_path):
    """They were "not text: byte 14 is zero"."""
    (tmp_path / "a.dat").write_bytes(first)
    done = call("new", "session", tmp_path / "a.dat", "--out", tmp_path / "session.toml")
    said = " ".join(done.stderr.split())
    assert called in said
    assert ("export its topics as CSV: with PlotJuggler" in said) is ("bag" in called)


def test_a_gpl_program_is_called_so(tmp_path):
    """Its second line "has 4 cells"."""
    lines = ["'GPL Generated Code.  Please do not edit", "Module GModule", "Public Sub Init"]
    lines += [f"collection({k}).Angles(17.3,-54.2,70.9,-3.2,44.6,{k},0,0)" for k in range(12)]
    (tmp_path / "a.gpo").write_text("\n".join(lines))
    done = call("new", "session", tmp_path / "a.gpo", "--out", tmp_path / "session.toml")
    assert "is a GPL program (Precise Automation)" in done.stderr
