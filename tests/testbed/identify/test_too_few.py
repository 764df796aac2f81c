"""Too few poses, or a single one, are told with the file that holds them."""

import numpy as np
import pytest
from typer.testing import CliRunner

from calib.errors import InputError, TooFewPosesError
from testbed.cli import app
from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.splitting import with_poses_held_out
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


@pytest.mark.parametrize(
    ("options", "least", "how"),
    [
        ({"train": 5}, 6, "--train 6 or more"),
        ({"held_out": 19}, 6, "--held-out 18 or fewer"),
        ({"train": 3}, 6, "--train 6 or more"),
    ],
)
def test_where_a_split_leaves_too_few_the_fix_is_the_split(options, least, how, tmp_path):
    """The poses are there already: nobody has to measure more."""
    file = file_of(tmp_path, 24)
    session = read_session(file, ROBOT)
    with pytest.raises(InputError) as caught:
        calibrate(ROBOT, session, options=Options(**options))
    assert caught.value.fix == f"identify from at least {least} of the 24: {how}"
    assert str(caught.value).startswith(f"{file}: ")
    # the advice is good, and the least that is
    enough = {"train": least} if "train" in options else {"held_out": 24 - least}
    calibrate(ROBOT, session, options=Options(**enough))


def test_a_split_that_the_data_state_is_told_too_and_more_poses_only_where_none_are_left(tmp_path):
    def said(poses, **options):
        error = TooFewPosesError("m", least=6, count=2)
        table = read_session(file_of(tmp_path, poses), ROBOT).measurements
        return with_poses_held_out(error, table, **options).fix

    assert said(8) == "identify from at least 6 of the 8: hold out fewer"
    assert said(5, train=2) == "measure at least 6"


def test_a_single_pose_ends_the_command_in_one_sentence(tmp_path):
    out = tmp_path / "out"
    words = ["identify", "staubli_tx60", str(file_of(tmp_path, 1)), "--out", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    assert done.stderr.strip().splitlines()[-1].endswith("[M27]")
    assert not out.exists()
