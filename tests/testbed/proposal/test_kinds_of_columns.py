"""Targets, differences, distances and titles in the files of users: what `new session` makes of it.

Truth: the files are written here from poses that are known.
"""

import re
import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from testbed.files.columns import covariance_names
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.proposal.names import meanings
from testbed.proposal.naming.plain import without_unit
from tests.command import call
from tests.hangs import no_hang
from tests.testbed.files.made import ROBOT, csv
from tests.testbed.proposal.test_session import (
    JOINTS,
    M,
    data,
    joints,
    places,
    points,
    proposed,
    refused,
    write,
)

WISHED = np.round(points(), 1) + np.array([3.0, -2.0, 1.0])
"""Where the controller says it goes [mm]."""
AWAY = points() - WISHED
NAMES = {
    "thesis": ("{}_t", "{}_dif", "joint_{}"),
    "long": ("Target {} [mm]", "Difference {} (mm)", "J{}"),
    "deltas": ("nominal_{}", "d{}", "axis_{}"),
}


@pytest.mark.parametrize("form", NAMES, ids=str)
def test_targets_with_differences_are_read_as_their_sum(form, tmp_path):
    target, away, joint = NAMES[form]
    table = {"step_order": np.arange(M)}
    table |= places(*(target.format(axis) for axis in "xyz"), values=WISHED)
    table |= places(*(away.format(axis) for axis in "xyz"), values=AWAY)
    table |= joints(*(joint.format(k) for k in range(1, 7)))
    rows = csv(table).splitlines()
    # a table program leaves empty rows
    lines = [*rows[:9], "," * rows[0].count(","), *rows[9:], "", "," * rows[0].count(",")]
    said, text = proposed(tmp_path, write(tmp_path, a__csv="\n".join(lines)), "--robot", ROBOT.name)
    assert "none was measured as such; taken as the targets" in said
    assert "as measured - target; no fit tells the sign" in said
    session = read_session(tmp_path / "session.toml", ROBOT)
    np.testing.assert_allclose(session.measurements.position, points() / 1e3, rtol=0, atol=1e-12)
    np.testing.assert_allclose(session.measurements.q, data().q, rtol=0, atol=1e-12)
    probe(ROBOT, session).raise_if_wrong()
    reverse = text.replace(
        "\n[points.columns]", 'differences = "target - measured"\n[points.columns]'
    )
    (tmp_path / "session.toml").write_text(reverse)
    session = read_session(tmp_path / "session.toml", ROBOT)
    np.testing.assert_allclose(
        session.measurements.position, (WISHED - AWAY) / 1e3, rtol=0, atol=1e-12
    )


@pytest.mark.parametrize(
    ("away", "told"),
    [
        (AWAY, f"they are measured - target in all {M} rows"),
        (-AWAY, f"they are target - measured in all {M} rows"),
        (AWAY + np.array([0.0, 0.0, 0.05]), "they are neither measured - target nor the reverse"),
    ],
    ids=["difference", "reverse", "neither"],
)
def test_targets_and_differences_beside_readings_are_named_and_compared(away, told, tmp_path):
    """The readings count; targets in meters, their differences and the readings in millimeters."""
    table = places("measured_x", "measured_y", "measured_z") | joints(*JOINTS)
    table |= places("Goal x", "Goal y", "Goal z", values=WISHED / 1e3)
    table |= places("x error", "y error", "z error", values=away)
    rows = csv(table, form="{:.7f}")
    _, text = proposed(tmp_path, write(tmp_path, a__csv=rows), "--robot", ROBOT.name)
    assert '# targets, not used: "Goal x", "Goal y", "Goal z"\n' in text
    assert f'# differences, not used: "x error", "y error", "z error": {told}' in text
    if "neither" in told:
        assert "up to 0.05 mm off" in text
    named = tomllib.loads(text)["points"]["columns"]
    assert named == {f"{axis}_mm": f"measured_{axis}" for axis in "xyz"}
    session = read_session(tmp_path / "session.toml", ROBOT)
    # seven decimals of a millimeter are written
    np.testing.assert_allclose(session.measurements.position, points() / 1e3, rtol=0, atol=6e-11)


@pytest.mark.parametrize("form", ["{1} {0}", "{0}_{1}"])
@pytest.mark.parametrize(
    ("other", "measured"),
    [("theo", "meas"), ("predicted", "real"), ("fk", "SMR"), ("robot", "tracker"),
     ("actual", "laser"), ("controller", "Ist"), ("tcp", "ball")],
)  # fmt: skip
def test_places_that_a_controller_computes_are_no_second_target(other, measured, form, tmp_path):
    """They fit a nominal robot best, being made from it."""
    computed = 1e3 * ROBOT.model.poses(data().q)[:, :3, 3]
    table = joints(*(f"J{k}" for k in range(1, 7)))
    table |= places(*(form.format(axis, other) for axis in "XYZ"), values=computed)
    table |= places(*(form.format(axis, measured) for axis in "XYZ"))
    files = write(tmp_path, a__csv=csv(table))
    proposed(tmp_path, files, "--robot", ROBOT.name)
    seen = read_session(tmp_path / "session.toml", ROBOT).measurements
    assert len(seen) == M
    np.testing.assert_allclose(seen.position, points() / 1e3, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("measured", "sent", "away"),
    [("{}m", "{}", ""), ("{}m", "{}n", ""), ("{}a", "{}n", ""), ("{}", "{}n", ""),
     ("{}M", "{}N", "{}D"), ("{}a [mm]", "{} [mm]", "")],
)  # fmt: skip
def test_letters_behind_the_axes_tell_the_measured_place_from_the_nominal_one(
    measured, sent, away, tmp_path
):
    """Nominal places stand first and fit as well: it is their names that tell."""
    table = joints(*(f"J{k}" for k in range(1, 7)))
    table |= places(*(sent.format(axis) for axis in "XYZ"), values=WISHED)
    table |= places(*(measured.format(axis) for axis in "XYZ"))
    if away:
        table |= places(*(away.format(axis) for axis in "XYZ"), values=AWAY)
    proposed(tmp_path, write(tmp_path, a__csv=csv(table)), "--robot", ROBOT.name)
    seen = read_session(tmp_path / "session.toml", ROBOT).measurements
    assert len(seen) == M
    np.testing.assert_allclose(seen.position, points() / 1e3, rtol=0, atol=1e-12)


RZYX = ("Rz", "Ry", "Rx")


@pytest.mark.parametrize(
    ("names", "place", "turn"),
    [("ABC", "{}_meas", ""), (RZYX, "SMR {}", ""), (RZYX, "ball {}", ""),
     ("ABC", "tracker {}", "tracker R{}"), (RZYX, "tracker {}", "actual R{}")],
)  # fmt: skip
def test_turns_of_a_controller_never_stand_beside_places_of_a_tracker(names, place, turn, tmp_path):
    T = ROBOT.model.poses(data().q)
    table = joints(*(f"J{k}" for k in range(1, 7)))
    said = "tcp {}" if "ball" in place else "{}"
    table |= places(*(said.format(axis) for axis in "XYZ"), values=1e3 * T[:, :3, 3])
    table |= dict(
        zip(names, Rotation.from_matrix(T[:, :3, :3]).as_euler("ZYX", True).T, strict=True)
    )
    table |= places(*(place.format(axis) for axis in "XYZ"))
    own = Rotation.from_matrix(data().T[:, :3, :3]).as_euler("XYZ", True).T
    table |= {turn.format(axis): v for axis, v in zip("xyz", own, strict=True)} if turn else {}
    files = write(tmp_path, a__csv=csv(table))
    proposed(tmp_path, files, "--robot", ROBOT.name)
    seen = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(seen.position, points() / 1e3, rtol=0, atol=1e-12)
    whole = "tracker" in turn
    assert seen.is_pose.tolist() == [whole] * M
    if whole:
        np.testing.assert_allclose(seen.rotation, data().T[:, :3, :3], rtol=0, atol=1e-12)


LETTERS = {"KUKA": "CBA", "FANUC": "WPR", "KUKA with units": ("C [deg]", "B [deg]", "A [deg]")}
"""Names of the turns about x, y and z."""


@pytest.mark.parametrize("maker", LETTERS)
@pytest.mark.parametrize("tried", [True, False])
def test_turns_that_controllers_call_by_letters_are_read_beside_the_joints(maker, tried, tmp_path):
    R = data().T[:, :3, :3]
    # the second way: R = Rz(a) Ry(b) Rx(c), entry by entry
    a = np.degrees(np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    b = np.degrees(np.arctan2(-R[:, 2, 0], np.hypot(R[:, 0, 0], R[:, 1, 0])))
    c = np.degrees(np.arctan2(R[:, 2, 1], R[:, 2, 2]))
    table = {"Pose": np.arange(M)} | joints(*(f"A{k}" for k in range(1, 7)))
    table |= places(*"XYZ") | dict(zip(LETTERS[maker], (c, b, a), strict=True))
    robot = ("--robot", ROBOT.name) if tried else ()
    files = write(tmp_path, a__csv=csv({name: table[name] for name in reversed(table)}))
    said, _ = proposed(tmp_path, files, *robot)
    assert "assumed: ZYX" in said
    session = read_session(tmp_path / "session.toml", ROBOT)
    assert session.measurements.is_pose.all()
    np.testing.assert_allclose(session.measurements.rotation, R, rtol=0, atol=1e-12)
    np.testing.assert_allclose(session.measurements.q, data().q, rtol=0, atol=1e-12)


def test_targets_alone_are_no_readings(tmp_path):
    table = places("x_t", "y_t", "z_t", values=WISHED) | joints(*JOINTS)
    (file,) = write(tmp_path, a__csv=csv(table))
    said = refused(tmp_path, file)
    assert "x_t, y_t, z_t are targets or differences: give what was measured" in said


@pytest.mark.parametrize("unit", ["mm", "m", ""])
def test_distances_from_fixed_points_are_proposed(unit, tmp_path):
    anchors = {"A": [2000.0, 0.0, 0.0], "B": [0.0, 2500.0, 0.0], "C": [-1500.0, -1500.0, 1500.0]}
    at = np.array(list(anchors.values()))
    seen = np.linalg.norm(points()[:, None] - at, axis=2).ravel()
    name = f"Distance [{unit}]" if unit else "dist"
    table = {"Pose": np.repeat(np.arange(M), 3), "Fixed Point": list("ABC") * M}
    table |= {one: np.repeat(column, 3) for one, column in joints(*JOINTS).items()}
    table |= {name: seen / 1e3 if unit == "m" else seen}
    (file,) = write(tmp_path, a__csv=csv(table))
    said, text = proposed(tmp_path, [file], "--robot", ROBOT.name)
    assert "anchors: no file says where A, B, C stand" in said
    assert ("distances: no column states its unit; assumed: mm" in said) == (not unit)
    assert re.search(r"errors are [01]\.\d+ mm", text)
    told = tomllib.loads(text)
    assert told["ranges"]["anchors_mm"] == dict.fromkeys("ABC", "free")
    assert told["uncertainty"] == {"distance_um": 30, "assumed": True}
    session = read_session(tmp_path / "session.toml", ROBOT)
    np.testing.assert_allclose(session.measurements.distance, seen / 1e3, rtol=0, atol=1e-12)
    assert session.measurements.n_poses == M


def test_distances_from_a_point_that_no_column_names_are_from_one(tmp_path):
    seen = np.linalg.norm(points() - np.array([2000.0, 0.0, 0.0]), axis=1)  # a draw wire
    files = write(tmp_path, a__csv=csv(joints(*JOINTS) | {"Length [mm]": seen}))
    said, text = proposed(tmp_path, files, "--robot", ROBOT.name)
    assert "all distances are taken as those from one, A" in said
    assert re.search(r"errors are [01]\.\d+ mm", text)
    session = read_session(tmp_path / "session.toml", ROBOT)
    assert (session.anchor_names, session.measurements.anchor.tolist()) == (("A",), [0] * M)
    np.testing.assert_allclose(session.measurements.distance, seen / 1e3, rtol=0, atol=1e-12)
    two = text.replace('A = "free"', 'A = "free"\nB = "free"')  # which of them each is from, then?
    (tmp_path / "session.toml").write_text(two)
    with pytest.raises(InputError, match="name the fixed point of each distance"):
        read_session(tmp_path / "session.toml", ROBOT)


TITLES = {
    "one": ["Calibration of robot 7, hall 3"],
    "several": [
        "Measured by A. Person",
        "",
        "Date; 2026-01-05;;;",
        "Tracker; 4711",
        "Air [C]; 20,5",
    ],
    "padded": ["Report" + ";" * 8, "Station;1" + ";" * 7],
}


@pytest.mark.parametrize("kind", TITLES, ids=str)
def test_titles_above_a_table_are_seen(kind, tmp_path):
    table = joints(*(f"J{k}" for k in range(1, 7))) | places("X", "Y", "Z")
    rows = csv(table, separator=";", decimal=",").splitlines()
    (file,) = write(tmp_path, a__csv="\n".join([*TITLES[kind], *rows]))
    proposed(tmp_path, [file], "--robot", ROBOT.name)
    session = read_session(tmp_path / "session.toml", ROBOT)
    np.testing.assert_allclose(session.measurements.position, points() / 1e3, rtol=0, atol=1e-12)
    (said,) = [note for note in session.notes if "decimal comma" in note]
    assert said.endswith(f"{M} rows, under a title ({TITLES[kind][0].strip(';')})")
    assert session.place[0].endswith(f"a.csv:{len(TITLES[kind]) + 2}")
    # a row that is too long is still told by the names of its columns
    (tmp_path / "a.csv").write_text("\n".join([*TITLES[kind], rows[0], rows[1], rows[2] + ";1"]))
    done = call("check", tmp_path / "session.toml", "--robot", ROBOT.name)
    assert done.exit_code == 2
    assert f"a.csv:{len(TITLES[kind]) + 3}: has 10 cells; the first line names 9" in done.stderr


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("X [mm]", ("x", "mm")),
        ("Pos X (actual) [mm]", ("pos x actual", "mm")),
        ("X, mm", ("x", "mm")),
        ("x/mm)", ("x", "mm")),
        ("Vx (mm/s)", ("vx mm s", "")),
        ("Pos/X mm", ("pos x", "mm")),
        ("[mm]", ("", "mm")),
        ("", ("", "")),
        ("]", ("", "")),
    ],
)
def test_a_name_is_told_from_its_unit(name, meant):
    assert without_unit(name) == meant


@pytest.mark.parametrize("part", ["_", "(", "[x", "x)", " ", ","])
def test_a_long_name_is_read_in_time(part):
    """A line may have 65,000 letters; where all ends of a name are tried, one takes minutes."""
    with no_hang():
        meanings(["pose", part * (60_000 // len(part)) + "x", *(f"b{k} qx" for k in range(2000))])


def test_the_covariance_of_points_is_read_and_none_assumed(tmp_path):
    table = joints(*(f"J{k}" for k in range(1, 7))) | places("X", "Y", "Z", values=points())
    entries = np.full((M, 6), [4e-10, 1e-10, 0, 9e-10, 0, 1e-10])
    table |= dict(zip(covariance_names(3), entries.T, strict=True))
    said, text = proposed(tmp_path, write(tmp_path, a__csv=csv(table)), "--robot", ROBOT.name)
    assert "cov_" not in said
    assert "position_um =" not in text
    read = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(
        read.covariance[:, :3, :3], [np.array([[4, 1, 0], [1, 9, 0], [0, 0, 1]]) * 1e-10] * M
    )
