"""Columns of programs in the words of a controller: what they may be, and what to call them."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.programs.read import read_program
from tests.testbed.files.test_program import ROBOT, Q, written
from tests.testbed.files.test_program_frames import JOINTS, PLACE

ANGLES = {
    "A,B,C": "A, B, C as rz_deg, ry_deg, rx_deg, with a column euler that says kuka",
    "W [deg],P [deg],R [deg]": "W [deg], P [deg], R [deg] as rx_deg, ry_deg, rz_deg, with a column "
    "euler that says fanuc",
    "u,v,w": "the columns of the rotation as well",
}


@pytest.mark.parametrize("angles", ANGLES)
def test_joints_beside_places_in_the_words_of_a_controller_are_no_targets(tmp_path, angles):
    """Rounded joints beside X, Y, Z were corrected, and the poses left as they were."""
    head = ["X", "Y [mm]", "Z_mm", *angles.split(","), *JOINTS]
    rows = [[1, 2, 3, 4, 5, 6, *np.round(np.degrees(q))] for q in Q]
    with pytest.raises(InputError) as caught:
        read_program(written(tmp_path / "p.csv", head, rows), ROBOT)
    assert str(caught.value).startswith("p.csv: has X, Y [mm], Z_mm beside joints, so that ")
    assert f"rename these as x_mm, y_mm, z_mm and {ANGLES[angles]}; or" in str(caught.value)


def test_angles_in_the_words_of_a_controller_are_told_what_they_are_called(tmp_path):
    path = written(tmp_path / "p.csv", [*PLACE, "A", "B", "C"], [[1, 2, 3, 4, 5, 6]])
    with pytest.raises(InputError) as caught:
        read_program(path, ROBOT)
    assert f"needs its orientation: rename {ANGLES['A,B,C']}" in str(caught.value)
