"""Directions and ranges of an instrument: read in their units and senses, or refused.

Truth: places that are written here as angles, by formulas of this file.
"""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.proposal.polar.names import polar_names
from tests.command import call
from tests.testbed.files.made import ROBOT, csv, made
from tests.testbed.proposal.test_session import proposed

M = 30
DATA = made(4, M)
X, Y, Z = DATA.T[:, :3, 3].T
RANGE, AZIMUTH = np.sqrt(X**2 + Y**2 + Z**2), np.arctan2(Y, X)
ZENITH = np.arccos(Z / RANGE)
JOINTS = {f"q{j + 1}_deg": np.degrees(DATA.q[:, j]) for j in range(6)}
GON = 200 / np.pi


def polar(azimuth, height, reach, names=("Azimuth", "Elevation", "Range")):
    return csv(JOINTS | dict(zip(names, (azimuth, height, reach), strict=True)))


WAYS = {
    "deg, above the horizon": (
        polar(np.degrees(AZIMUTH), 90 - np.degrees(ZENITH), 1e3 * RANGE,
              ("Azimuth [deg]", "Elevation [deg]", "Range [mm]")), 1, "", [],
    ),
    "a surveyor's, without a unit": (
        polar(-GON * AZIMUTH % 400, GON * ZENITH, RANGE, ("Hz", "V", "SD")), -1, "_gon",
        ["Hz is taken to grow clockwise", "V is taken as the angle from the zenith",
         "directions: no column states its unit; assumed: gon",
         "ranges: no column states its unit; assumed: m"],
    ),
    "counted the other way than its name says": (
        polar(GON * AZIMUTH % 400, 100 - GON * ZENITH, RANGE,
              ("Hz [gon]", "Vertical angle [gon]", "D [m]")), 1, "", ["above the horizon"],
    ),
    "radians": (polar(AZIMUTH, ZENITH, RANGE, ("az", "zenith", "dist")), 1, "_rad", []),
    "a unit of two languages": (
        polar(GON * AZIMUTH, GON * ZENITH, RANGE, ("Azimut [grad]", "Zenit [grad]", "Distanz [m]")),
        1, "_gon", ["directions: no column states its unit"],
    ),
    "the second face": (
        polar(np.degrees(AZIMUTH) + 180, 360 - np.degrees(ZENITH), RANGE,
              ("azimuth_deg", "zenith_deg", "range_m")), 1, "", [],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "sense", "unit", "told"), WAYS.values(), ids=WAYS)
def test_directions_and_ranges_are_proposed_as_they_were_meant(text, sense, unit, told, tmp_path):
    (tmp_path / "a.csv").write_text(text)
    said, written = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", ROBOT.name)
    assert "to fix" not in said
    assert "is not used" not in said  # SD, which might be a scatter
    assert ('azimuth = "clockwise"' in written) is (sense < 0)
    assert unit in written
    for one in told:
        assert one in said
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-12)
    # a mirror image would be seen where the azimuth grows the other way
    np.testing.assert_allclose(table.position, np.column_stack([X, Y, Z]), rtol=0, atol=1e-12)


def test_joints_of_another_file_are_matched_and_places_win_over_directions(tmp_path):
    names = {"pose_id": [f"P{k}" for k in range(M)]}
    (tmp_path / "j.csv").write_text(csv(names | JOINTS))
    angles = {"Hz [gon]": GON * AZIMUTH, "V [gon]": GON * ZENITH, "D [m]": RANGE}
    wrong = {axis: 1e3 * value for axis, value in zip("XYZ", (X, Y, Z), strict=True)}
    for table in (names | angles, names | angles | wrong):
        (tmp_path / "t.csv").write_text(csv(table))
        files = [tmp_path / "j.csv", tmp_path / "t.csv"]
        said, written = proposed(tmp_path, files, "--robot", ROBOT.name)
        assert ("azimuth_gon" in written) is ("X" not in table)
        assert ("columns Hz [gon], V [gon], D [m]" in said) is ("X" in table)
        found = read_session(tmp_path / "session.toml", ROBOT).measurements
        np.testing.assert_allclose(found.position, np.column_stack([X, Y, Z]), atol=1e-12)
        (tmp_path / "session.toml").unlink()


def test_a_direction_alone_and_degrees_with_minutes_are_refused(tmp_path):
    def refused(text):
        (tmp_path / "a.csv").write_text(text)
        done = call("new", "session", tmp_path / "a.csv", "--robot", ROBOT.name, "--out",
                    tmp_path / "session.toml")  # fmt: skip
        return done.exit_code, " ".join(done.stderr.split())

    code, said = refused(csv(JOINTS | {"Hz [gon]": GON * AZIMUTH, "D [m]": RANGE}))
    assert code == 2
    assert "beside Hz [gon], name one azimuth, one elevation (or zenith angle) and one" in said
    minutes = [f"{int(v)}°12'30" for v in np.degrees(ZENITH)]
    code, said = refused(csv(JOINTS | {"Hz": GON * AZIMUTH, "V": minutes, "D": RANGE}))
    assert code == 2
    assert "cells that are not numbers (line 2 V" in said


def test_a_sense_of_rotation_is_of_directions_alone(tmp_path):
    def read(text, points):
        (tmp_path / "a.csv").write_text(text)
        (tmp_path / "s.toml").write_text(f"[points]\n{points}\n[uncertainty]\nposition_um = 30\n")
        return read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml").measurements

    names = ("azimuth_deg", "elevation_deg", "range_mm")
    text = polar(-np.degrees(AZIMUTH), 90 - np.degrees(ZENITH), 1e3 * RANGE, names)
    found = read(text, 'azimuth = "clockwise"').position
    np.testing.assert_allclose(found, np.column_stack([X, Y, Z]), rtol=0, atol=1e-12)
    with pytest.raises(InputError, match="is of polar readings, and these are none"):
        read(csv(JOINTS | {"x_mm": X, "y_mm": Y, "z_mm": Z}), 'azimuth = "clockwise"')
    with pytest.raises(InputError, match='azimuth is of tables, not of format = "sa"'):
        read(text, 'azimuth = "clockwise"\nformat = "sa"')


def test_of_two_heights_or_ranges_none_is_taken():
    assert polar_names(("hz", "v", "d")) == {"hz": "azimuth", "v": "vertical", "d": "range"}
    for texts in (("hz", "v"), ("hz", "v", "d", "s"), ("hz", "v", "zenith", "d"), ("v", "d", "x")):
        assert polar_names(texts) == {}
