"""Points for some rows and distances for others: proposed as one session, and read as one."""

import tomllib

import numpy as np
import pytest

from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.delivered import Delivered
from testbed.identify.recording.story import calibration_story
from testbed.identify.report.page import page_of
from testbed.report.page import render
from tests.planes import unfitting
from tests.testbed.files.made import ROBOT, csv, made
from tests.testbed.proposal.test_session import proposed, write

M, FIRST = 60, 35
ARM, NEST = np.array([0.05, 0.03, 0.08]), np.array([3.0, 2.0, 0.5])
JOINTS = {f"q{j + 1}_deg": np.degrees(made(3, M).q[:, j]) for j in range(6)}
POSES = {"pose_id": np.arange(1, M + 1)}
TIP = made(3, M).T[:, :3, 3] + made(3, M).T[:, :3, :3] @ ARM
POINTS = dict(zip(("x_mm", "y_mm", "z_mm"), 1e3 * TIP.T, strict=True))
FAR = 1e3 * np.linalg.norm(TIP - NEST, axis=1)
RANGES = {"anchor": ["N1"] * M, "distance_mm": FAR}


def some(table, rows):
    return {name: np.asarray(values)[rows] for name, values in table.items()}


def blank(table, rows):
    """Text of each cell, empty but in some rows."""
    there = set(np.arange(M)[rows].tolist())
    text = {name: [v if isinstance(v, str) else f"{v:.9f}" for v in table[name]] for name in table}
    return {name: [v if k in there else "" for k, v in enumerate(text[name])] for name in text}


ONE, TWO = slice(0, FIRST), slice(FIRST, M)
FILES = {
    "two files with joints of their own": (
        {"p": some(JOINTS | POINTS, ONE), "r": some(JOINTS | RANGES, TWO)}, M, None,
    ),
    "two files of some poses each": (
        {"j": POSES | JOINTS, "p": some(POSES | POINTS, ONE), "r": some(POSES | RANGES, TWO)},
        M, "pose_id",
    ),
    "two files of all poses": (
        {"j": POSES | JOINTS, "p": POSES | POINTS, "r": POSES | RANGES}, 2 * M, "pose_id",
    ),
    "two files in the order of the joints": ({"j": JOINTS, "p": POINTS, "r": RANGES}, 2 * M,
                                             "order"),
    "points beside the joints": (
        {"p": POSES | JOINTS | POINTS, "r": POSES | RANGES}, 2 * M, "pose_id",
    ),
    "one file with both in each row": ({"p": JOINTS | POINTS | RANGES}, 2 * M, None),
    "one file with one of both in each row": (
        {"p": blank(JOINTS, slice(None)) | blank(POINTS, ONE) | blank(RANGES, TWO)}, M, None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(("tables", "rows", "match"), FILES.values(), ids=FILES)
def test_points_and_distances_are_proposed_as_one_session(tables, rows, match, backwards, tmp_path):
    files = [tmp_path / f"{name}.csv" for name in tables]
    for file, table in zip(files, tables.values(), strict=True):
        file.write_text(csv(table), encoding="utf-8")
    said, text = proposed(tmp_path, files[:: -1 if backwards else 1], "--robot", ROBOT.name)
    told = tomllib.loads(text)
    assert told["ranges"]["anchors_mm"] == {"N1": "free"}
    assert told["points"]["file"] == "p.csv"
    assert told["uncertainty"] == {"position_um": 30, "distance_um": 30, "assumed": True}
    assert told.get("match") == match
    assert "; the distances beside them leave 0." in said
    assert "unused" not in said
    assert "to fix" not in said
    session = read_session(tmp_path / "session.toml", ROBOT)
    seen = session.measurements
    assert len(seen) == rows
    far = seen.is_distance
    # each reading is beside its own joints: those of the pose that it was made of
    order = {q.tobytes(): k for k, q in enumerate(made(3, M).q.round(6))}
    at = np.array([order[q.tobytes()] for q in seen.q.round(6)])
    np.testing.assert_allclose(seen.position[~far], TIP[at[~far]], rtol=0, atol=1e-9)
    np.testing.assert_allclose(1e3 * seen.distance[far], FAR[at[far]], rtol=0, atol=1e-6)


@pytest.mark.slow
def test_a_calibration_of_such_a_session_finds_the_fixed_point(tmp_path):
    (tmp_path / "p.csv").write_text(csv(FILES["one file with one of both in each row"][0]["p"]))
    proposed(tmp_path, [tmp_path / "p.csv"], "--robot", ROBOT.name)
    session = read_session(tmp_path / "session.toml", ROBOT)
    found = calibrate(ROBOT, session, Options(model="geometric"))
    (place,) = found.fit.identification.model.fixtures.anchors
    # from one side and three meters away, by readings that scatter by 17 um
    np.testing.assert_allclose(place, NEST, rtol=0, atol=1.5e-4)
    assert "distance" in render(page_of(found, Delivered((), (), 0), {}))
    assert not unfitting(calibration_story(found, ROBOT))


def test_a_row_without_either_reading_is_left_out_and_named(tmp_path):
    table = FILES["one file with one of both in each row"][0]["p"]
    for name in (*POINTS, *RANGES):
        table = table | {name: ["" if k == 3 else cell for k, cell in enumerate(table[name])]}
    (tmp_path / "p.csv").write_text(csv(table))
    said, _ = proposed(tmp_path, [tmp_path / "p.csv"], "--robot", ROBOT.name)
    told = (
        "rows has nothing in the cells of the reading (line 5): nothing was seen there, and it is"
    )
    assert " ".join(said.split()).count(told) == 2  # among those of each kind
    seen = read_session(tmp_path / "session.toml", ROBOT).measurements
    assert len(seen) == len(table["q1_deg"]) - 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("far", "count", "why"),
    [
        (np.random.default_rng(0).uniform(1e3, 2e3, M), M, "leaves less than 20 mm beside these"),
        (1e3 * np.linalg.norm(TIP, axis=1), M, "they are the lengths of the positions beside them"),
        (FAR, 4, "fewer than 6 of them would have to find the place of N1"),
    ],
)
def test_distances_that_do_not_go_with_the_points_are_left_aside_in_words(
    far, count, why, tmp_path
):
    table = JOINTS | POINTS | RANGES | {"distance_mm": far}
    if count < M:
        table = blank(JOINTS | POINTS, slice(None)) | blank(RANGES, slice(0, count))
    (tmp_path / "p.csv").write_text(csv(table))
    said, text = proposed(tmp_path, [tmp_path / "p.csv"], "--robot", ROBOT.name)
    assert "ranges" not in tomllib.loads(text)
    words = " ".join(said.split())
    assert f"The distances in p.csv are not used: in one session with the others, {why}" in (
        words.replace("no reading of them ", "")
    )


def test_positions_that_fit_nothing_are_left_aside_for_distances_that_do(tmp_path):
    places = np.random.default_rng(0).uniform(-500, 500, (3, M))
    table = JOINTS | dict(zip(POINTS, places, strict=True)) | RANGES
    (tmp_path / "p.csv").write_text(csv(table))
    said, text = proposed(tmp_path, [tmp_path / "p.csv"], "--robot", ROBOT.name)
    assert "No interpretation of the positions in p.csv fits: not used" in said
    assert "points" not in tomllib.loads(text)
    far = read_session(tmp_path / "session.toml", ROBOT).measurements.distance
    np.testing.assert_allclose(1e3 * far, FAR, rtol=1e-12)


def test_without_a_robot_both_kinds_are_proposed_as_well(tmp_path):
    tables = FILES["two files of some poses each"][0]
    for name, table in tables.items():
        (tmp_path / f"{name}.csv").write_text(csv(table))
    _, text = proposed(tmp_path, [tmp_path / f"{name}.csv" for name in tables])
    told = tomllib.loads(text)
    assert (told["points"]["file"], told["ranges"]["file"]) == ("p.csv", "r.csv")


@pytest.mark.parametrize(("head", "of_poses"), [("Pose", True), ("No", False)])
def test_a_pose_that_comes_with_each_target_is_one_pose(head, of_poses, tmp_path):
    """Joints read back at each shot differ by microdegrees; numbers of rows name no pose."""
    rng, three = np.random.default_rng(1), range(3)
    q = np.repeat(np.column_stack(list(JOINTS.values())), 3, axis=0)
    q = q + rng.uniform(-2e-6, 2e-6, q.shape)
    number = np.repeat(np.arange(M), 3) if of_poses else np.arange(3 * M)
    corners = ARM + 0.05 * np.eye(3)
    T = made(3, M).T
    p = np.stack([T[:, :3, 3] + T[:, :3, :3] @ corner for corner in corners], axis=1)
    table = {head: number, "SMR": [f"S{k}" for k in three] * M}
    table |= {f"J{k + 1}": q[:, k] for k in range(6)}
    table |= dict(zip(("X", "Y", "Z"), 1e3 * p.reshape(-1, 3).T, strict=True))
    proposed(tmp_path, write(tmp_path, a__csv=csv(table)), "--robot", "staubli_tx60")
    told = tomllib.loads((tmp_path / "session.toml").read_text(encoding="utf-8"))
    assert told["points"]["columns"]["target"] == "SMR"
    assert (told["points"]["columns"].get("pose_id") == head) == of_poses
    if of_poses:
        assert read_session(tmp_path / "session.toml", ROBOT).measurements.n_poses == M
