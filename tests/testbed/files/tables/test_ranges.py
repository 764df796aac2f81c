"""Distances from anchors, some near and some far: what they span is that of each anchor."""

import numpy as np
import pytest

from testbed.files.frames_fit import FAR
from testbed.files.probe import probe
from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, csv, made

M = 30
DATA = made(4, M)
MIDDLE = DATA.T[:, :3, 3].mean(axis=0)
ANCHORS = {"near": MIDDLE + np.array([1.5, 0.5, 0.2]), "far": MIDDLE + np.array([-3.0, 5.0, 1.5])}


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, 1e-3], ids=["as they are", "in another unit"])
def test_anchors_at_different_distances_are_of_one_robot(factor, tmp_path):
    joints = {f"q{j + 1}_deg": np.tile(np.degrees(DATA.q[:, j]), 2) for j in range(6)}
    away = [np.linalg.norm(DATA.T[:, :3, 3] - place, axis=1) for place in ANCHORS.values()]
    anchors = [name for name in ANCHORS for _ in range(M)]
    # apart by more than the robot reaches, though each anchor sees less
    assert np.ptp(away) > 4 > max(map(np.ptp, away))
    distance = {"anchor": anchors, "distance_mm": 1e3 * factor * np.concatenate(away)}
    (tmp_path / "a.csv").write_text(csv(joints | distance))
    free = ", ".join(f'{name} = "free"' for name in ANCHORS)
    (tmp_path / "s.toml").write_text(
        f"[ranges]\nanchors_mm = {{ {free} }}\n[uncertainty]\ndistance_um = 30\n"
    )
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    found = probe(ROBOT, session)
    assert found.stated is not None
    assert (found.stated.score < FAR) is (factor == 1)
