"""Reports with a block of lines for each point are read as tables, and uneven ones are refused."""

from contextlib import suppress

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.dialects.blocks import with_block_rows
from testbed.files.read import read_session
from testbed.gates.text import read_text
from tests.hangs import no_hang
from tests.testbed.files.made import csv, made
from tests.testbed.proposal.test_odd_files import UR10, joints
from tests.testbed.proposal.test_session import proposed

M = 12
DATA = made(5, M, robot=UR10)
MM = np.round(1e3 * DATA.T[:, :3, 3], 6)
AWAY = np.array([0.3, 0.1, -0.2])


def axis_a_line(name, place):
    rows = zip("XYZ", place, place - AWAY, AWAY, strict=True)
    numbers = [f"{axis}  {at:.6f}  {meant:.6f}  {off:.6f}" for axis, at, meant, off in rows]
    return [f"Point: {name}", "     Actual   Nominal   Deviation", *numbers, ""]


def kind_a_line(name, place):
    kinds = {"Actual": place, "Nominal": place - AWAY, "Dev.": AWAY}
    rows = ["\t".join([kind, *(f"{v:.6f}" for v in own)]) for kind, own in kinds.items()]
    return [name, "Type: Point", "\tX\tY\tZ", *rows]


def axis_alone(name, place):
    return [name, *(f"  {axis} = {v:.6f}" for axis, v in zip("XYZ", place, strict=True))]


def with_commas(name, place):
    return [line.replace(".", ",") for line in axis_a_line(name, place)]


SHAPES = [axis_a_line, kind_a_line, axis_alone, with_commas]
TITLE = ["Report of an arm", "Units: millimeters", ""]


def report(block):
    return [*TITLE, *(line for k in range(M) for line in block(f"M_P{k + 1:03d}", MM[k]))]


@pytest.mark.parametrize("block", SHAPES)
def test_blocks_are_a_row_for_each_point(block, tmp_path):
    (tmp_path / "joints.csv").write_text(csv(joints("J{} [deg]", np.degrees(DATA.q))))
    (tmp_path / "arm.txt").write_text("\n".join(report(block)))
    files = [tmp_path / "joints.csv", tmp_path / "arm.txt"]
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "positions: no column states its unit" not in said
    read = read_session(tmp_path / "session.toml", UR10)
    # six decimals of a millimeter are written
    np.testing.assert_allclose(read.measurements.position, MM / 1e3, rtol=0, atol=1e-12)
    at = int(read.place[1].rpartition(":")[2])
    assert f"{MM[1, 2]:.6f}" in report(block)[at - 1].replace(",", ".") or block is kind_a_line


def told(folder, lines):
    (folder / "a.txt").write_text("\n".join(lines))
    text = read_text(folder / "a.txt", "a.txt")
    return text, with_block_rows(text)


@pytest.mark.parametrize(
    ("odd", "why"),
    [
        (lambda lines: [*lines[:20], "shot again", *lines[20:]], "a.txt:2.: the block of a point "
         "has 2 lines of words above it and 3 numbers; most have 1 and 3; give each"),
        (lambda lines: [*lines, "Units: inches"], "a.txt:52: states mm and in; export"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named_by_its_line(odd, why, tmp_path):
    with pytest.raises(InputError, match=why):
        told(tmp_path, odd(report(axis_alone)))


@pytest.mark.parametrize(
    "lines",
    [
        ["X Y Z", *(f"P{k} 1 2 3" for k in range(9))],
        ["name,x,y,z", *(f"P{k},1,2,3" for k in range(9))],
        [*axis_alone("A", MM[0]), *(f"P{k} 1 2 3" for k in range(9))],
    ],
)
def test_other_files_come_back_as_they_are(lines, tmp_path):
    text, same = told(tmp_path, lines)
    assert same is text


@pytest.mark.parametrize("begin", ["X", "Actual", "Units"])
def test_long_blanks_take_no_time(begin, tmp_path):
    lines = report(axis_alone)
    long = 4 * [begin + 65_000 * " " + "!"]  # half a minute each by squares, by cubes for ever
    with no_hang(), suppress(InputError):
        told(tmp_path, [*long, *lines])
