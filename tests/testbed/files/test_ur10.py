"""Files of a real robot, read through a session.toml: nobody's simulation."""

from pathlib import Path

import numpy as np
import pytest

from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.robots.catalog import load_robot

HERE = Path(__file__).parent
DATA = HERE.parents[2].parent / "shared" / "data" / "ipa_ur10"
SERIES = {
    "B": ("measurements_joint_configurations.csv", 1495, 2, 291),
    "C": ("measurements_random_poses.csv", 2773, 0, 0),
    "D": ("measurements_iso_cubes.csv", 632, 0, 57),
}
"""File, rows, copies of a row, and rows that visit an earlier pose once more: poses of B are run
forwards and backwards, corners of the cubes of D in turn, by commands 0.04 deg apart at most."""
pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="the UR10 measurements are not part of this repository"
)


@pytest.mark.parametrize("series", SERIES)
def test_a_published_file_is_read_as_it_was_meant(series):
    file, count, copies, again = SERIES[series]
    robot = load_robot("universal_ur10")
    session = read_session(DATA / f"Series_{series}" / file, robot, config=HERE / "ur10.toml")
    # series B holds two rows whose digits are those of an earlier one
    assert len(session.measurements) == count - copies
    assert session.measurements.n_poses == count - copies - again
    assert len(session.masked) == (copies > 0)
    assert "semicolon between cells, decimal comma" in session.notes[0]
    # time stamps were saved as 2,02011E+13
    assert session.time is None
    assert 15 < session.conditions.temperature.min() <= session.conditions.temperature.max() < 30
    found = probe(robot, session)
    found.raise_if_wrong()
    # the data's page has 1.03, 0.90 and 0.72 mm for the mean; a root mean square is larger
    assert {"B": 1.0, "C": 0.85, "D": 0.7}[series] < found.stated.position * 1e3 < 1.2
    assert np.degrees(found.stated.rotation) < 0.15
    assert not found.warnings


def test_columns_of_short_scatter_can_be_kept_above_a_least_value():
    file = DATA / "Series_C" / SERIES["C"][0]
    robot = load_robot("universal_ur10")
    session = read_session(file, robot, config=HERE / "ur10_columns.toml")
    u = np.sqrt(np.diagonal(session.measurements.covariance, axis1=1, axis2=2))
    assert u[:, :3].min() == pytest.approx(30e-6)
    assert u[:, 3:].min() == pytest.approx(np.radians(0.005))
    assert "at least 30 um" in session.uncertainty
    assert session.joint_scatter.any()
