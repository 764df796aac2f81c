"""Too few poses, or a single one, are told with the file that holds them, and what they lack."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError, TooFewPosesError
from calib.identification.climbing import ClimbStep
from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.errors import figures_of
from testbed.identify.splitting import with_poses_held_out
from testbed.identify.to_do.causes import CHECK
from testbed.identify.to_do.next_step import next_step
from testbed.identify.to_do.unconfirmed import NEEDED, unconfirmed
from tests.calibrated import sound
from tests.command import call
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
    done = call(*words)
    assert done.exit_code == 2
    assert done.stderr.strip().splitlines()[-1].endswith("[M27]")
    assert not out.exists()


STEP = ClimbStep("sag", "springs and bearings", 140.4, np.nan, np.nan, False)


def asking(**changes):
    """The same calibration, of readings that ask for more than too few poses confirm."""
    found = sound()
    choice = replace(found.choice, chosen="geometric", asked="choose", steps=(STEP,))
    return replace(found, choice=choice, **changes)


def worse(found):
    """The same, as if its nominal robot were better on held-out poses."""
    better = replace(found.before_misses, position=found.fit.misses.position / 2)
    figures = figures_of(better, found.measurements, found.split.is_test)
    return replace(found, before_misses=better, before_test=figures)


def test_a_model_that_lacks_joint_errors_is_not_blamed_on_the_file():
    said = next_step(worse(asking()))
    assert said.startswith("Do not use this model: on held-out poses it is worse than the nominal")
    assert "Joint errors (springs and bearings, log evidence +140.4)" in said
    assert f"(--train {NEEDED}, or measure more)" in said
    assert CHECK not in said
    assert next_step(worse(sound())).endswith(CHECK)  # where nothing more is asked for


def test_it_is_said_wherever_the_readings_are_not_explained():
    found, words = asking(), "may explain what is left: identify from"
    proof = found.proof
    refuted = replace(found, proof=replace(proof, trust=replace(proof.trust, refuted=True)))
    assert words in next_step(refuted)
    assert words not in next_step(found)


def test_what_poses_refused_is_not_asked_for_again():
    assert unconfirmed(sound()) == ""
    seen = replace(STEP, before=1e-4, after=2e-4)
    assert unconfirmed(replace(sound(), choice=replace(sound().choice, steps=(seen,)))) == ""


def test_poses_that_the_data_hold_out_or_that_are_too_few_are_not_offered():
    found = asking()
    stated = replace(found, split=replace(found.split, stated=True))
    assert "(hold out fewer poses, or measure more)" in unconfirmed(stated)
    few = found.measurements.pose_id < NEEDED - 1
    split = found.split
    split = replace(split, is_train=split.is_train & few, is_test=split.is_test & few)
    assert "(measure more)" in unconfirmed(replace(found, split=split))
