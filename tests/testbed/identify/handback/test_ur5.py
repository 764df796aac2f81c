"""A measured UR5 with its one reflector on the last axis: what is handed back keeps its links.

Data: P. Jacobi, master's thesis, Tsinghua University, 2025 (MIT license); read where it lies.
"""

import csv
from pathlib import Path

import numpy as np
import pytest

from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.states import hand_back_warnings, handed_numbers, handed_robot
from testbed.robots.catalog import load_robot
from tests.testbed.identify.handback.test_other_tool import write_ur5

DATA = Path(__file__).parents[5] / "shared" / "data" / "jacobi_ur5"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the public data are not here")


def session(folder, count, extra=""):
    """`count` poses of the grid to identify from, the random ones held out."""
    rows = []
    for which, word in (("grid", "identify"), ("random", "test")):
        path = DATA / f"3D_UR5_uncalibrated_{which}_cleaned.csv"
        with path.open(encoding="utf-8") as file:
            lines = [row for row in list(csv.reader(file))[1:] if row and row[0]]
        if word == "identify":
            lines = [
                lines[k] for k in np.sort(np.random.default_rng(0).permutation(len(lines))[:count])
            ]
        for row in lines:
            number = np.array(row[1:], dtype=float)
            cells = [*(number[:3] + number[3:6]), 30.0, 30.0, 30.0, *number[6:]]
            rows.append([f"{which}{row[0]}", word, *(repr(float(cell)) for cell in cells)])
    head = ["pose_id", "split", "x_mm", "y_mm", "z_mm", "ux_um", "uy_um", "uz_um"]
    with (folder / "ur5.csv").open("w", encoding="utf-8") as file:
        csv.writer(file).writerows([head + [f"q{k}_deg" for k in range(1, 7)], *rows])
    (folder / "session.toml").write_text(
        '[joints]\nfile = "ur5.csv"\n[points]\nfile = "ur5.csv"\n'
        f'[identification]\nmodel = "geometric"\n{extra}'
    )
    ur5 = load_robot(write_ur5(folder))
    return ur5, read_session(folder, ur5)


def require_bars(folder, count, bar):
    """Converged, links near nominal, and the published poses met."""
    ur5, read = session(folder, count)
    found = calibrate(ur5, read, Options())
    assert found.converged
    moved = np.abs(handed_robot(found).model.chain.links - ur5.model.chain.links)
    assert 1e3 * moved[:, 1:3].max() < 1.0  # mm
    assert np.degrees(moved[:, [0, 3, 4]]).max() < 0.8
    assert 1e3 * found.fit.test.position.mean <= bar
    return found


def test_fifty_poses_hand_back_a_robot_near_nominal(tmp_path):
    found = require_bars(tmp_path, 50, 0.115)
    assert "runs away" in found.handback.why
    told = {one.row.name: one for one in handed_numbers(found)}
    # the thesis's robot: axis 4 is not parallel to axis 3
    assert told["alpha3"].held_by == "measurements, beyond its tolerance"
    assert told["theta5"].held_by == told["d5"].held_by == "prior"


def test_a_prior_that_holds_nothing_lets_a_number_run_away_and_it_is_named(tmp_path):
    ur5, read = session(tmp_path, 50, "[prior]\nlength_mm = 1000\nangle_deg = 100\n")
    found = calibrate(ur5, read, Options())
    assert found.handback.why == "the session states it"
    if found.converged:  # then it is known by no more than that width
        held = [one for one in handed_numbers(found) if one.row.name in ("theta5", "d5", "alpha5")]
        assert {one.held_by for one in held} == {"prior"}
    else:
        assert any("runs away" in text for text in hand_back_warnings(found))


@pytest.mark.study
@pytest.mark.parametrize(("count", "bar"), [(200, 0.105), (1000, 0.105)])
def test_more_poses_do_so_too(count, bar, tmp_path):
    require_bars(tmp_path, count, bar)
