"""Lines that name each of their numbers, as logs of controllers do."""

from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from testbed.files.dialects.key_values import with_named_numbers
from testbed.files.read import read_session
from testbed.gates.text import FileText, SourceFile
from tests.hangs import no_hang
from tests.testbed.files.made import ROBOT, made
from tests.testbed.proposal.test_session import proposed

DATA = made()
DEG, MM = np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]


def kuka(q):
    outer = ", ".join(f"E{k} 0.0" for k in range(1, 7))
    return "{E6AXIS: " + ", ".join(f"A{k} {v:.9f}" for k, v in enumerate(q, 1)) + f", {outer}}}"


def equal_signs(q):
    return "  ".join(f"J{k}={v:.9f} deg" for k, v in enumerate(q, 1))


def quoted(q):
    return "{" + ", ".join(f'"q{k}": {v:.11e}' for k, v in enumerate(np.radians(q), 1)) + "}"


@pytest.mark.parametrize("line", [kuka, equal_signs, quoted])
def test_joints_that_each_line_names_are_read(line, tmp_path):
    """They left "no file has q1 to q6"."""
    (tmp_path / "log.txt").write_text("\n".join(["# of cell 7", *map(line, DEG)]))
    head = "X,Y,Z"
    np.savetxt(tmp_path / "tracker.csv", MM, "%.9f", ",", header=head, comments="")
    files = [tmp_path / "log.txt", tmp_path / "tracker.csv"]
    said, _ = proposed(tmp_path, files, "--robot", ROBOT.name)
    assert ("columns E1, E2, E3" in said) is (line is kuka)
    session = read_session(tmp_path / "session.toml", ROBOT)
    np.testing.assert_allclose(session.measurements.q, DATA.q, rtol=0, atol=2e-11)
    np.testing.assert_allclose(session.measurements.position, MM / 1e3, rtol=0, atol=1e-12)


def test_a_file_of_joints_and_places_is_told_by_the_lines_that_it_has(tmp_path):
    rows = [
        equal_signs(q) + "; " + ", ".join(f"{a}: {v:.6f} mm" for a, v in zip("XYZ", p, strict=True))
        for q, p in zip(DEG, MM + 9000.0 * (np.arange(len(MM)) == 6)[:, None], strict=True)
    ]
    (tmp_path / "log.txt").write_text("\n".join(rows))
    said, _ = proposed(tmp_path, [tmp_path / "log.txt"], "--robot", ROBOT.name)
    assert "log.txt:7: left out" in " ".join(said.split())


def text_of(*lines):
    source = SourceFile(Path("a.txt"), sha256(b"").hexdigest())
    return FileText("a.txt", lines, "UTF-8", source)


@pytest.mark.parametrize(
    "lines",
    [
        ("P1 1.0 2.0 3.0", "P2 1.0 2.0 3.0", "P3 1.0 2.0 3.0"),  # points behind names
        ("X=1 Y=2 Z=3", "X=1 Y=2 Z=3", "X=1 Y=2 W=3"),
        ("X=1 Y=2 Z=3", "stopped", "X=1 Y=2 Z=3", "X=1 Y=2 Z=3"),
        ("A B X=1 Y=2 Z=3", "C D X=1 Y=2 Z=3", "E F X=1 Y=2 Z=3"),
        ("at 1:00 X=1 Y=2 Z=3", "at X=1 Y=2 Z=3", "at 3:00 X=1 Y=2 Z=3"),
        ("X=1 X=2 Z=3",) * 3,
        ("X = 1",) * 3,
        ("X=1,5; Y=2,5; Z=3,5",) * 3,  # a decimal comma, or two numbers
        ("J1,J2,X", "1,2,3", "4,5,6"),
        ("X=1 Y=2 Z=3",) * 2,
    ],
)
def test_other_lines_stay_as_they_are(lines):
    text = text_of(*lines)
    assert with_named_numbers(text) is text


NUMBERS = "X=1 Y=2 Z=3"


@pytest.mark.parametrize(
    ("before", "names", "cells"),
    [
        ("P{} = {{E6AXIS: ", "name", "P{}"),
        ("Pose {}: ", "name", "{}"),
        ("P{}  ", "name", "P{}"),
        ("2026-03-02 10:0{}:00.5 $AXIS_ACT={{", "time", "2026-03-02 10:0{}:00.5"),
        ("P{0}; 10:0{0}:00 {{", "name\ttime", "P{0}\t10:0{0}:00"),
        ("$AXIS_ACT = {{", "", ""),
    ],
)
def test_a_name_and_a_time_before_the_numbers_are_columns(before, names, cells):
    """They left "there are no joints: nothing could be tried"."""
    lines = with_named_numbers(text_of(*(before.format(k) + NUMBERS for k in range(3)))).lines
    assert lines[0] == f"{names}\tX\tY\tZ".lstrip("\t")
    assert lines[1:] == tuple(f"{cells.format(k)}\t1\t2\t3".lstrip("\t") for k in range(3))


@pytest.mark.slow
@pytest.mark.parametrize(
    "line", ["A 1 " * 5000, "A" * 9000 + " 1", "A=1 " * 9000 + "!", "{" * 9000]
)
def test_long_lines_end_in_time(line):
    with no_hang(20):
        with_named_numbers(text_of(*[line] * 500))
