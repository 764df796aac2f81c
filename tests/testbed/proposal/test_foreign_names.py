"""Names of joints and rotations that stand in real files, each read as it was meant."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbed.files.read import read_session
from tests.testbed.files.made import made
from tests.testbed.proposal.test_odd_files import UR10
from tests.testbed.proposal.test_session import proposed

M = 16
DATA = made(5, M, robot=UR10)
DEG, MM = np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]
TURNED = DATA.T[:, :3, :3]
WXYZ = Rotation.from_matrix(TURNED).as_quat(scalar_first=True)
BY_COLUMNS = TURNED.transpose(0, 2, 1).reshape(M, 9)
COUNTED = [f"q{k}" for k in range(1, 7)]
PLACE = ["x", "y", "z"]

FILES = {
    "q0 beside qx is no joint": (
        [*COUNTED, *PLACE, "q0", "qx", "qy", "qz"], [DATA.q, MM / 1e3, WXYZ],
    ),
    "normal, orientation, approach": (
        [*COUNTED, *(f"{c}{a}" for c in "noap" for a in "xyz")], [DEG, BY_COLUMNS, MM],
    ),
    "joints counted in words": ([f"第{c}轴" for c in "一二三四五六"] + PLACE, [DEG, MM]),
    "joints counted behind the word": ([f"关节{c}" for c in "一二三四五六"] + PLACE, [DEG, MM]),
}  # fmt: skip


@pytest.mark.parametrize(("head", "blocks"), FILES.values(), ids=FILES)
def test_columns_are_what_their_names_say(head, blocks, tmp_path):
    rows = [",".join(f"{v:.11f}" for v in row) for row in np.hstack(blocks)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(head), *rows]), encoding="utf-8")
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", UR10.name)
    assert "to fix" not in said
    assert "Not used" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-10)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-10)
    assert table.is_pose.all() == (len(blocks) == 3)
    if len(blocks) == 3:
        np.testing.assert_allclose(table.rotation, TURNED, rtol=0, atol=1e-9)
