"""Too few poses, or a single one, are told with the file that holds them."""

import numpy as np
import pytest
from typer.testing import CliRunner

from calib.errors import InputError
from testbed.cli import app
from testbed.files.read import read_session
from testbed.identify.calibrate import calibrate
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread

TURNS = ("rx_deg", "ry_deg", "rz_deg")


def file_of(folder, poses, *, visits=1, points=False):
    """A table of so many poses, each shot so often."""
    rows = np.repeat(np.arange(poses), visits)
    table = {name: values[rows] for name, values in columns(made()).items()}
    if points:
        table = {name: values for name, values in table.items() if name not in TURNS}
    else:
        table["euler"] = ["XYZ"] * len(rows)
    table["x_mm"] = table["x_mm"] + 1e-3 * np.arange(len(rows))
    file = folder / "few.csv"
    file.write_text(csv(with_spread(table, turn=not points)))
    return file


@pytest.mark.parametrize(
    ("poses", "visits", "points", "told"),
    [
        (1, 1, False, "1 different pose gives 6 equations for"),
        (1, 9, False, "1 different pose gives 6 equations for"),
        (1, 1, True, "1 different pose gives 3 equations for"),
        (2, 1, False, "2 different poses give 12 equations for"),
        (3, 5, False, "3 different poses give 18 equations for"),
        (5, 1, False, "5 different poses give 30 equations for 30 parameters; measure at least 6"),
        (7, 1, True, "7 different poses give 21 equations for 27 parameters; measure at least 10"),
    ],
)
def test_too_few_poses_name_the_file(poses, visits, points, told, tmp_path):
    file = file_of(tmp_path, poses, visits=visits, points=points)
    with pytest.raises(InputError) as caught:
        calibrate(ROBOT, read_session(file, ROBOT))
    assert str(caught.value).startswith(f"{file}: {told}")
    assert caught.value.code == "M27"


def test_a_single_pose_ends_the_command_in_one_sentence(tmp_path):
    out = tmp_path / "out"
    words = ["identify", "staubli_tx60", str(file_of(tmp_path, 1)), "--out", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    assert done.stderr.strip().splitlines()[-1].endswith("[M27]")
    assert not out.exists()
