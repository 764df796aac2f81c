"""A table whose line names its columns beside one without: a header each, and markers in a row."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from testbed.files.read import read_session
from tests.command import call
from tests.testbed.files.made import csv, made
from tests.testbed.proposal.test_odd_files import UR10, joints
from tests.testbed.proposal.test_session import proposed

M = 12
DATA = made(5, M, robot=UR10)
NAMED = csv(joints("J{} [deg]", np.degrees(DATA.q)))
ARMS = 1e-3 * np.array([[60, 0, 0], [0, 60, 0], [0, 0, 60], [40, 40, 0]])
SEEN = DATA.T[:, None, :3, 3] + np.einsum("mij,kj->mki", DATA.T[:, :3, :3], ARMS)
"""(m, 4, 3) [m]."""
COUNT, CLOCK = np.arange(1, M + 1)[:, None], np.arange(M)[:, None] / 100


def lines(*blocks):
    """Numbers with eight decimals, tabs between them."""
    rows = np.column_stack(blocks)
    return "\n".join("\t".join(f"{value:.8f}" for value in row) for row in rows)


MARKERS = {
    "three in mm": (3, [1e3 * SEEN[:, :3].reshape(M, -1)]),
    "four in mm, as many numbers as a transform": (4, [1e3 * SEEN.reshape(M, -1)]),
    "a frame and a time before four in m": (4, [COUNT, CLOCK, SEEN.reshape(M, -1)]),
}


@pytest.mark.parametrize(("count", "blocks"), MARKERS.values(), ids=MARKERS)
def test_markers_that_stay_apart_are_points_of_one_pose(count, blocks, tmp_path):
    (tmp_path / "joints.csv").write_text(NAMED)
    (tmp_path / "qtm.tsv").write_text(lines(*blocks))
    files = [tmp_path / "joints.csv", tmp_path / "qtm.tsv"]
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert f"taken as {count} markers" in said
    assert "too close to tell them apart" not in said
    assert "header = false" in (tmp_path / "session.toml").read_text()
    read = read_session(tmp_path / "session.toml", UR10)
    assert len(read.reflector_names) == count
    table = read.measurements
    np.testing.assert_allclose(table.q, np.repeat(DATA.q, count, axis=0), rtol=0, atol=1e-9)
    # eight decimals of a meter
    np.testing.assert_allclose(table.position, SEEN[:, :count].reshape(-1, 3), rtol=0, atol=1e-8)


@pytest.mark.parametrize("mark", [" ", ";"])
def test_places_without_names_stand_beside_named_joints(mark, tmp_path):
    """As photogrammetry writes them: a number, a place, and the scatter of each axis."""
    (tmp_path / "joints.csv").write_text(NAMED)
    text = lines(COUNT, 1e3 * DATA.T[:, :3, 3], np.full((M, 3), 0.012)).replace("\t", mark)
    (tmp_path / "points.obc").write_text(text.replace(".00000000", ""))
    files = [tmp_path / "joints.csv", tmp_path / "points.obc"]
    proposed(tmp_path, files, "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-11)
    assert not table.is_pose.any()


def test_an_export_has_no_header_to_speak_of(tmp_path):
    (tmp_path / "joints.csv").write_text(NAMED)
    (tmp_path / "s.toml").write_text(
        '[joints]\nfile = "joints.csv"\n[points]\nfile = "p.txt"\nformat = "sa"\nheader = false\n'
    )
    with pytest.raises(InputError, match='header is of tables, not of format = "sa"'):
        read_session(tmp_path / "s.toml", UR10)
    assert call("check", tmp_path / "s.toml").exit_code == 2


QUATERNION = Rotation.from_matrix(DATA.T[:, :3, :3]).as_quat(scalar_first=True)


def test_what_a_second_tool_says_again_names_no_column_twice(tmp_path):
    """A tracker of markers writes frame and state of each tool, and nothing of one that is lost."""
    head = "Tools,Port 1,Frame,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error,Port 2,Frame,State"
    rows = [",".join(map(str, (2, "0A", k, "OK", *QUATERNION[k], *1e3 * DATA.T[k, :3, 3], 0.1,
                               "0B", k, "Missing"))) for k in range(M)]  # fmt: skip
    (tmp_path / "joints.csv").write_text(NAMED)
    (tmp_path / "ndi.csv").write_text("\n".join([head, *rows]))
    proposed(tmp_path, [tmp_path / "joints.csv", tmp_path / "ndi.csv"], "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.rotation, DATA.T[:, :3, :3], rtol=0, atol=1e-12)


def test_places_that_come_twice_are_refused_by_their_columns(tmp_path):
    head, cells = "Frame,Tx,Ty,Tz,State,Tx,Ty,Tz,State", "{0},1{0},2,3,OK,4{0},5,6,OK"
    rows = [cells.format(k) for k in range(M)]
    (tmp_path / "ndi.csv").write_text("\n".join([head, *rows]))
    done = call("new", "session", tmp_path / "ndi.csv", "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    assert 'ndi.csv:1: columns 2 and 6 are both called "Tx"' in " ".join(done.stderr.split())
