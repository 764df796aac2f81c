"""Base and tool that the robot's file holds somewhere else than they are."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import step_transform
from testbed.files.read import read_session
from testbed.identify.applies.stated_frames import stated_frame_words
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.frames import frames_of
from tests.testbed.files.made import ROBOT, columns, csv, made


def said(folder, held, offset=(0,) * 6, *, points=False, data=None, whole=False, more=""):
    """What is said of frames that are held there, moved by an offset [m, rad] of the first one."""
    data = made(4, 40) if data is None else data
    base, tool = data.truth.chain.T_world_base, data.truth.chain.T_flange_tool
    moved = {"base": base, "tool": tool}
    moved[held[0]] = moved[held[0]] @ step_transform(np.array(offset))
    chain = ROBOT.model.chain
    chain = replace(chain, T_world_base=moved["base"], T_flange_tool=moved["tool"])
    robot = replace(ROBOT, model=replace(ROBOT.model, chain=chain))
    kind, noise = ("points", "") if points else ("frames", "rotation_mdeg = 10\n")
    (folder / "a.csv").write_text(csv(columns(data, form="none" if points else "euler")))
    (folder / "s.toml").write_text(
        f"[{kind}]\n" + 'euler = "XYZ"\n' * (not points)
        + f"[uncertainty]\nposition_um = 20\n{noise}[identification]\n"
        + "".join(f'{name} = "fixed"\n' for name in held) + more
    )  # fmt: skip
    session = read_session(folder / "a.csv", robot, config=folder / "s.toml")
    if whole:
        return calibrate(robot, session, Options(model="geometric")).warnings
    table = session.measurements
    return stated_frame_words(session, frames_of(robot, session, table).before, table)


@pytest.mark.parametrize("points", [False, True])
def test_a_tool_that_is_not_where_the_file_holds_it_is_named(points, tmp_path):
    """It was taken into the last link without a word, and programs were moved by 20 mm."""
    (text,) = said(tmp_path, ["tool"], (0, 12e-3, 16e-3, 0, 0, 0), points=points)
    assert "with nominal links and tool as the robot's file has it, the readings miss" in text
    # links that are 0.15 mm off leave the place known to a tenth of a millimeter
    assert "with the tool about 20 mm elsewhere: if that is so, correct robot.toml" in text
    assert 'or write tool = "free" under [identification]' in text


def test_a_base_is_named_with_how_far_it_is_turned(tmp_path):
    (text,) = said(tmp_path, ["base", "tool"], (0, 0, 0, 0, 0, np.radians(1.0)))
    assert "with the base about 1.0 deg elsewhere" in text
    assert 'base = "free" and tool = "free"' in text


@pytest.mark.parametrize("held", [["tool"], ["base"], ["base", "tool"]])
def test_nothing_is_said_of_frames_that_are_there(held, tmp_path):
    assert said(tmp_path, held) == ()
    # an arm that is far from nominal, by its links, is not taken for one on another base
    assert said(tmp_path, held, data=made(3, 40, off=10.0)) == ()


def test_it_is_among_the_warnings_of_a_calibration(tmp_path):
    found = said(tmp_path, ["tool"], (0, 12e-3, 16e-3, 0, 0, 0), points=True, whole=True)
    assert any("about 20 mm elsewhere" in text for text in found)


def test_links_that_are_not_identified_make_up_for_nothing(tmp_path):
    (text,) = said(tmp_path, ["tool"], (0, 12e-3, 16e-3, 0, 0, 0), more='free = "frames"\n')
    assert text.endswith("as it is, nothing makes up for it, because links are not identified")
