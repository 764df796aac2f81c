"""Exports of instruments, retyped, whose names say more than one word each."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT
from tests.testbed.proposal.test_session import M, data, proposed

EXPANDED_MM = (0.018, 0.012, 0.026)
LEICA = (
    "X  [mm],Y  [mm],Z  [mm],U(95)  [mm],U(95) X  [mm],U(95) Y  [mm],U(95) Z  [mm],Tilt  [deg],"
    "Q0 ,Q1 ,Q2 ,Q3 ,Image RMS  [µm],Target,Temperature  [°C],Pressure  [mBar],Humidity  [%],"
    "Time Stamp,OTG Applied,Delete"
)


def of_leica(folder):
    """What a 6-D target of a tracker of Leica leaves, and joints without names."""
    place = 1e3 * data().T[:, :3, 3]
    turn = Rotation.from_matrix(data().T[:, :3, :3]).as_quat(scalar_first=True)
    rows = [
        ",".join([*(f"{v:.9f}" for v in p), "0.034", *map(str, EXPANDED_MM), "29.9"]
                 + [f"{v:.9f}" for v in q]
                 + ["0.22", "TMC 30-B #1", "22.8", "1018", "32", f"'11.10.2022 15:{k:02d}:48.043",
                    "FALSE", ""])
        for k, (p, q) in enumerate(zip(place, turn, strict=True))
    ]  # fmt: skip
    (folder / "leica.csv").write_text("\n".join([LEICA, *rows]), encoding="utf-8")
    np.savetxt(folder / "theta.csv", np.degrees(data().q), delimiter=",", fmt="%.12f")
    return [folder / "theta.csv", folder / "leica.csv"]


def test_what_a_tracker_of_leica_states_with_95_percent_is_read_so(tmp_path):
    """It was taken as k = 1, and times behind an apostrophe were not read."""
    said, _ = proposed(tmp_path, of_leica(tmp_path), "--robot", ROBOT.name)
    assert "(k = 1)" not in said
    assert "times cannot be read" not in said
    session = read_session(tmp_path / "session.toml", ROBOT)
    table = session.measurements
    np.testing.assert_allclose(table.position, data().T[:, :3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.rotation, data().T[:, :3, :3], rtol=0, atol=1e-8)
    sd = np.sqrt(np.diagonal(table.covariance, axis1=1, axis2=2))[:, :3]
    np.testing.assert_allclose(sd, np.tile(np.divide(EXPANDED_MM, 2e3), (M, 1)), rtol=0.03)
    np.testing.assert_allclose(session.time, 60.0 * np.arange(M), rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "is_expanded"),
    [
        ("U(95) {}", True), ("U95 {}", True), ("U {} (k=2)", True), ("U (k = 2) {}", True),
        ("Uncertainty {} (95%)", True), ("u({})", False), ("U{}", False),
    ],
)  # fmt: skip
def test_the_factor_that_a_name_states_is_that_of_its_uncertainty(name, is_expanded, tmp_path):
    names = [*(f"J{k}" for k in range(1, 7)), *"XYZ", *(name.format(a) for a in "XYZ")]
    table = np.hstack([np.degrees(data().q), 1e3 * data().T[:, :3, 3], np.full((M, 3), 0.04)])
    head = ",".join(names)
    np.savetxt(tmp_path / "a.csv", table, "%.9f", ",", header=head, comments="")
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", ROBOT.name)
    assert ("(k = 1)" in said) is not is_expanded
    found = read_session(tmp_path / "session.toml", ROBOT).measurements.covariance
    sd = 1e3 * np.sqrt(found[:, 0, 0])
    np.testing.assert_allclose(sd, 0.02 if is_expanded else 0.04, rtol=0.03)
