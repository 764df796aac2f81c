"""Two real arms and a laser tracker, public data: what chosen models reach where they never looked.

Studies at full size, run by hand: `pytest -m study tests/real`, nine minutes.
The bars are what independent sketches of such models reached, with 5 to 15 % of room. Found, means
over three draws of the training poses (UR10 B 100: five), held-out mean in mm:

* UR10, 100 poses: B 0.136 (0.129 to 0.149), C 0.128 (0.127 to 0.130), D 0.144 (0.136 to 0.149);
  400: B 0.103 (0.102 to 0.105), C 0.103 (0.102 to 0.104), D 0.098 (0.096 to 0.099);
* UR5, at 20 random poses: 50 grid poses 0.076, 100 0.068, 200 0.064; on the rest of its grid 0.076,
  0.064, 0.058;
* carried over, geometric and chosen: B to C 0.607 and 0.418, B to D 0.552 and 0.216, C to B 0.864
  and 0.397, C to D 0.659 and 0.392.
"""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.start.start import start_frames
from calib.measurement.prediction import predict
from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.robots.catalog import load_robot
from tests.testbed.identify.test_ur10 import read

DATA = Path(__file__).parents[3] / "shared" / "data"
UR5 = """
format = 1
name = "ur5"
title = "UR5, the maker's published Denavit-Hartenberg table"
""" + "".join(
    f"""
[[joints]]
kind = "revolute"
theta_deg = 0.0
d_mm = {d}
a_mm = {a}
alpha_deg = {alpha}
lower_deg = -360.0
upper_deg = 360.0
"""
    for d, a, alpha in (
        (89.159, 0.0, 90.0), (0.0, -425.0, 0.0), (0.0, -392.25, 0.0),
        (109.15, 0.0, 90.0), (94.65, 0.0, -90.0), (82.3, 0.0, 0.0),
    )
)  # fmt: skip
SESSION = """
name = "UR5, one reflector"
robot = "robot.toml"

[uncertainty]
position_um = 30.0
"""
pytestmark = [
    pytest.mark.study,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"the measured arms are not here: {DATA}"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("real")


def ur5(kind, folder):
    """Robot and readings; the data give a target and how far the reflector was from it."""
    (folder / "robot.toml").write_text(UR5)
    (folder / "session.toml").write_text(SESSION)
    file = DATA / "jacobi_ur5" / f"3D_UR5_uncalibrated_{kind}_cleaned.csv"
    with file.open(newline="") as lines:
        rows = [row for row in csv.DictReader(lines) if row["x_t"]]
    out = folder / f"{kind}.csv"
    with out.open("w", newline="") as lines:
        table = csv.writer(lines)
        table.writerow(["pose_id", *(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm"])
        for k, row in enumerate(rows):
            seen = [float(row[f"{axis}_t"]) + float(row[f"{axis}_dif"]) for axis in "xyz"]
            table.writerow([k, *(row[f"joint_{i}"] for i in range(1, 7)), *seen])
    robot = load_robot(str(folder / "robot.toml"))
    return robot, read_session(out, robot, config=folder / "session.toml")


@pytest.mark.parametrize(
    ("series", "poses", "bar", "draws"),
    [
        ("B", 100, 0.160, 5), ("C", 100, 0.145, 3), ("D", 100, 0.200, 3),
        ("B", 400, 0.115, 3), ("C", 400, 0.115, 3), ("D", 400, 0.140, 3),
    ],
)  # fmt: skip
def test_the_ur10_is_known_this_well_at_poses_held_out(series, poses, bar, draws, folder):
    robot, session = read(series, folder)
    found = [calibrate(robot, session, Options(train=poses, seed=k)) for k in range(draws)]
    reached = [1e3 * each.fit.test.position.mean for each in found]
    print(f"\nUR10 {series}, {poses} poses: {np.round(reached, 3)} mm, mean {np.mean(reached):.3f}")  # noqa: T201  # figures of a study
    assert np.mean(reached) <= bar


@pytest.mark.parametrize(
    ("poses", "of_random", "of_grid"),
    [(50, 0.095, np.inf), (100, 0.078, np.inf), (200, 0.070, 0.060)],
)
def test_the_ur5_is_known_this_well_at_twenty_random_poses_and_on_its_grid(
    poses, of_random, of_grid, folder
):
    robot, session = ur5("grid", folder)
    _, other = ur5("random", folder)
    reached = []
    for seed in range(3):
        found = calibrate(robot, session, Options(train=poses, seed=seed))
        misses = predict(found.fit.identification.model, other.measurements).misses
        reached.append([1e3 * misses.mean(), 1e3 * found.fit.test.position.mean])
    random, grid = np.mean(reached, axis=0)
    print(f"\nUR5, {poses} poses: random {random:.3f}, other grid {grid:.3f} mm")  # noqa: T201  # figures of a study
    assert random <= of_random
    assert grid <= of_grid


@pytest.mark.parametrize(
    ("here", "there", "geometric"),
    [("B", "C", 0.586), ("B", "D", 0.532), ("C", "B", 0.884), ("C", "D", 0.719)],
)
def test_the_joint_map_of_the_ur10_is_its_own_and_carries_over(here, there, geometric, folder):
    """Links and joint errors of one series, base and tool fitted at 60 poses of another."""
    robot, session = read(here, folder)
    found = calibrate(robot, session, Options(train=400, seed=0))
    _, other = read(there, folder)
    place = np.random.default_rng(2).permutation(len(other.measurements))
    few, rest = (other.measurements.rows(rows) for rows in (place[:60], place[60:]))
    carried = []
    for fit in found.fits:
        own = fit.identification.model
        start = start_frames(replace(own, chain=robot.model.chain), few).model
        placed = replace(
            own,
            chain=replace(
                own.chain,
                T_world_base=start.chain.T_world_base,
                T_flange_tool=start.chain.T_flange_tool,
            ),
        )
        frames = [name for name in placed.names if name.startswith(("base.", "tool."))]
        again = identify(placed, few, parameters_of(placed, frames)).model
        carried.append(1e3 * predict(again, rest).misses.mean())
    print(f"\nUR10 {here} -> {there}: geometric {carried[0]:.3f}, chosen {carried[1]:.3f} mm")  # noqa: T201  # figures of a study
    # the published sketch's figure, whose draws differ; a map of the data would not carry over
    assert carried[0] == pytest.approx(geometric, rel=0.25)
    assert carried[1] < carried[0]
