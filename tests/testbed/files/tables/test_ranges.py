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


def test_a_long_table_of_points_and_then_distances_is_read_by_both_sections(tmp_path):
    """Its first thousand lines, by which long files are refused early, have no distance."""
    data, count = made(4, 2100), 1500
    away = 1e3 * np.linalg.norm(data.T[:, :3, 3], axis=1)
    table = {f"q{j + 1}_deg": np.degrees(data.q[:, j]) for j in range(6)}
    cells = [*(1e3 * data.T[:, :3, 3].T), away]
    for name, values in zip(("x_mm", "y_mm", "z_mm", "distance_mm"), cells, strict=True):
        here = np.arange(2100) >= count if name == "distance_mm" else np.arange(2100) < count
        table[name] = [f"{v:.9f}" if there else "" for v, there in zip(values, here, strict=True)]
    (tmp_path / "a.csv").write_text(csv(table | {"anchor": [""] * count + ["A"] * 600}))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "a.csv"\n[points]\nfile = "a.csv"\n[ranges]\nfile = "a.csv"\n'
        'anchors_mm = { A = "free" }\n[uncertainty]\nposition_um = 20\ndistance_um = 20\n'
    )
    session = read_session(tmp_path, ROBOT)
    seen = session.measurements
    assert (seen.is_distance == (np.arange(2100) >= count)).all()
    # nine decimals of a millimeter
    np.testing.assert_allclose(seen.position[:count], data.T[:count, :3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(1e3 * seen.distance[count:], away[count:], rtol=0, atol=1e-9)
    assert session.notes == (
        "a.csv: UTF-8, comma between cells, decimal point, 2100 rows",
        "a.csv: 600 of 2100 rows have nothing for [points]",
        "a.csv: 1500 of 2100 rows have nothing for [ranges]",
    )
