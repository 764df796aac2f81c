"""Joints that were swept one after the other, of a controller that counts one of them otherwise."""

import numpy as np

from testbed.robots.catalog import load_robot
from tests.testbed.proposal.test_session import proposed

ROBOT = load_robot("staubli_tx60")
SWEPT = {0: (-0.08, 0.08), 1: (-1.1, 0.55), 2: (-0.03, 0.04), 3: (-2.0, 0.5), 4: (-1.0, 0.3),
         5: (-2.4, 2.1)}  # fmt: skip
"""Ends of each sweep of ten poses, from where the other joints stand [rad]."""
PLACES = np.array([[0.15, 0.1, 0.12], [-0.12, 0.16, 0.1], [0.02, -0.2, 0.15]])


def test_rows_are_not_called_odd_where_joints_mean_something_else(tmp_path):
    """What is swept while joint 2 stands fits; the rows in which it moves are not to blame."""
    q = np.tile([0.4, 0.3, 1.2, -1.4, 0.6, 0.5], (60, 1))
    for joint, ends in SWEPT.items():
        q[10 * joint : 10 * joint + 10, joint] += np.linspace(*ends, 10)
    T = ROBOT.model.poses(q)
    seen = T[:, None, :3, 3] + np.einsum("mij,kj->mki", T[:, :3, :3], PLACES)
    counted = q - np.eye(6)[2] * q[:, 1:2]  # q3 = J3 + J2
    rows = np.hstack([np.degrees(counted), 1e3 * seen.reshape(60, 9)])
    head = [f"J{k}" for k in range(1, 7)] + [f"N{k}_{axis}" for k in (1, 2, 3) for axis in "xyz"]
    lines = [",".join(f"{v:.6f}" for v in row) for row in rows]
    (tmp_path / "a.csv").write_text("\n".join([",".join(head), *lines]))
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", "staubli_tx60")
    assert 'write joints = ["q3 = J3 + J2"] under [controller]' in " ".join(said.split())
    assert ": left out: " not in said
