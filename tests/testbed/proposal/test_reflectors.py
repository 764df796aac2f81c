"""Files of one reflector each: what `truebed new session` makes of them."""

import re
import tomllib

import numpy as np
import pytest

from testbed.proposal.data import look_at
from testbed.proposal.session import propose_session
from tests.testbed.files.made import ROBOT, csv
from tests.testbed.files.reflectors.test_own_files import NAMES, TURN, exported, joints, place, seen

NAMED = {"pose_id": NAMES}


def proposed(folder, files, robot=ROBOT):
    for name, table in files.items():
        (folder / name).write_text(table if isinstance(table, str) else csv(table))
    return propose_session(look_at([folder / name for name in files], folder), robot, folder)


def of_each(**more):
    return {f"{name}.csv": more | place(xyz) for name, xyz in zip("abc", seen(), strict=True)}


def test_files_whose_points_stay_together_are_of_a_reflector_each(tmp_path):
    """They were proposed as three stations, which left 55 mm at held-out poses."""
    apart = {"joints.csv": NAMED | joints()}
    each = {"a": "a.csv", "b": "b.csv", "c": "c.csv"}
    for files, match in (
        (apart | of_each(**NAMED), "pose_id"),
        ({"joints.csv": joints()} | of_each(), "order"),
        (of_each(**joints()), None),
        (apart | {f"{name}.csv": exported(k) for k, name in enumerate("abc")}, "pose_id"),
    ):
        found = proposed(tmp_path, files)
        assert found.document["points"]["reflector_files"] == each
        assert found.document.get("match") == match
        assert found.fits
        assert not found.unused
        assert not found.to_mend
        assert any(note.startswith("reflectors: each file is one") for note in found.assumed)
        assert not any("station" in note.partition(":")[0] for note in found.assumed)


def test_one_point_in_several_frames_is_one_of_several_stations(tmp_path):
    frames = [seen()[0] @ np.linalg.matrix_power(TURN, k).T + [500.0 * k, 0, 0] for k in range(3)]
    files = {f"{n}.csv": NAMED | place(xyz) for n, xyz in zip("abc", frames, strict=True)}
    found = proposed(tmp_path, {"joints.csv": NAMED | joints()} | files)
    assert found.document["points"]["files"] == ["a.csv", "b.csv", "c.csv"]


def test_a_file_that_cannot_be_one_more_reflector_is_left_aside_with_what_to_write(tmp_path):
    """Its rows are shifted: one file is read, and nothing is switched in silence."""
    files = {"joints.csv": joints()} | of_each()
    files["b.csv"] = place(np.roll(seen()[1], 1, axis=0))
    found = proposed(tmp_path, files)
    assert "file" in found.document["points"]
    assert any("write reflector_files = { " in one for one in found.unused)


def test_a_file_that_lacks_a_row_is_left_aside_with_the_reason(tmp_path):
    """The others were then taken as stations or not used, and nothing said why."""
    files = {"joints.csv": joints()} | of_each()
    files["c.csv"] = place(np.delete(seen()[2], 12, axis=0))
    found = proposed(tmp_path, files)
    assert found.document["points"]["reflector_files"] == {"a": "a.csv", "b": "b.csv"}
    assert found.fits
    assert [one for one in found.unused if one.startswith("c.csv: 29 rows where a.csv has 30, so")]


@pytest.mark.parametrize("names", [("a 1.csv", "b (left).csv"), ("a.csv", "a.txt")])
def test_what_is_to_be_written_of_a_file_left_aside_is_toml(names, tmp_path):
    """Of a.csv and a.txt it had the key a twice, and of names with blanks keys without quotes."""
    rows = [place(seen()[0]), place(np.roll(seen()[1], 1, axis=0))]
    found = proposed(tmp_path, {"joints.csv": joints()} | dict(zip(names, rows, strict=True)))
    line = re.search(r"reflector_files = \{.*\}", " ".join(found.unused))
    assert list(tomllib.loads(line[0])["reflector_files"].values()) == list(names)
