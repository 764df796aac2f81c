"""Where less scatters than is stated, R95 is of what is stated: how much is enough is said."""

import re
from dataclasses import replace

import numpy as np
import pytest

from calib.measurement import tables
from testbed.files.read import read_session
from testbed.identify.applies.quiet import quiet_words
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.session import with_test
from tests.calibrated import robot, session_of, sound, table_of, true_model
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, pool_r
from tests.testbed.files.campaign import HEAD, session, visit, written
from tests.testbed.files.made import columns, csv

TRUE = 5e-6
"""Noise per axis [m]."""
GEOMETRIC = Options(model="geometric")


def seen(stated):
    """Sixty points that scatter by 5 um, and the noise that is stated of them."""
    q = pool_r(60)
    xyz = true_model().poses(q)[:, :3, 3]
    xyz = xyz + TRUE * np.random.default_rng(2).standard_normal((60, 3))
    return session_of(tables.points(q, xyz, sd=stated))


def told(found):
    """The sentence, and each number that it says to write."""
    said = [text for text in found.warnings if "residuals are smaller" in text]
    return said, dict(re.findall(r"(\w+_u?m\w*) = ([\d.]+)", " ".join(said)))


def test_the_noise_that_is_said_to_be_enough_narrows_r95_and_holds_the_truth():
    found = calibrate(robot(), seen(30e-6), Options(seed=1))
    (said,), numbers = told(found)
    assert "um per axis of positions, where 30 is stated (95 % probability)" in said
    enough = 1e-6 * float(numbers["position_um"])
    # of 120 equations less 30 numbers, an upper limit: 1.1 to 1.3 times the noise
    assert TRUE < enough < 1.4 * TRUE
    again = calibrate(robot(), seen(enough), Options(seed=1))
    assert told(again) == ([], {})
    before, after = (one.proof.point.radius_mean for one in (found, again))
    assert after < before / 2
    q = pool_r(300, seed=9)
    model = again.fit.identification.model
    off = np.linalg.norm(model.poses(q)[:, :3, 3] - true_model().poses(q)[:, :3, 3], axis=1)
    assert (off < after).mean() >= 0.95


def test_of_poses_only_the_part_that_is_quieter_than_stated_is_named():
    table = table_of(true_model(), pool_r(60))
    wide = table.covariance.copy()
    wide[:, 3:, 3:] *= 25
    (said,), numbers = told(calibrate(robot(), session_of(replace(table, covariance=wide))))
    assert set(numbers) == {"rotation_mdeg"}
    enough = np.radians(1e-3 * float(numbers["rotation_mdeg"]))
    assert SIGMA_ROTATION < enough < 1.3 * SIGMA_ROTATION
    assert "positions" not in said
    wide = table.covariance.copy()
    wide[:, :3, :3] *= 25
    (said,), numbers = told(calibrate(robot(), session_of(replace(table, covariance=wide))))
    assert set(numbers) == {"position_um"}
    assert SIGMA_POSITION < 1e-6 * float(numbers["position_um"]) < 1.4 * SIGMA_POSITION


@pytest.mark.parametrize("told_by", ["stated", "assumed"])
def test_where_joints_scatter_as_well_the_line_takes_their_part_off(told_by):
    found = sound()
    train = found.measurements.rows(found.is_used)
    twice = replace(train, covariance=9 * train.covariance)
    fit = replace(found.fit.identification, covariance=9 * found.fit.identification.covariance)
    (said,) = quiet_words(fit, twice, told_by)
    assert "noise of readings and joints together" in said
    assert ("is assumed, as the robot's file states none" in said) == (told_by == "assumed")
    assert said.endswith('and joint_repeatability = "included" under [uncertainty]')


def test_sound_noise_is_called_neither():
    found = sound()
    train = found.measurements.rows(found.is_used)
    assert quiet_words(found.fit.identification, train, "") == ()
    robust = replace(found.fit.identification, loss="cauchy")
    assert quiet_words(robust, replace(train, covariance=9 * train.covariance), "") == ()


@pytest.mark.parametrize("form", ["euler", "matrix"])
def test_of_inverse_transforms_it_is_not_said_which_keys_would_be_enough(form, tmp_path):
    """Each part of such a row has noise of both keys. It was said of visits and of two files."""
    half = [tables_of_inverse(visit(0, 30, seed=k), form) for k in range(2)]
    head = HEAD.replace("position_um = 17.5", "position_um = 200")
    head = head.replace('euler = "XYZ"', 'euler = "XYZ"\ngives = "T_tool_tracker"')
    found = written(tmp_path, dict(zip("ab", half, strict=True)), session("a"), session("b"),
                    head=head)  # fmt: skip
    (tmp_path / "one.toml").write_text(head)
    one, two = (
        read_session(tmp_path / f"{name}.csv", robot(), config=tmp_path / "one.toml")
        for name in "ab"
    )
    for several in (read_session(found, robot()), with_test(one, two), one):
        assert several.stated.inverted
        assert told(calibrate(robot(), several, GEOMETRIC)) == ([], {})


def tables_of_inverse(data, form):
    """A file of the inverses of poses."""
    return csv(columns(data, gives="T_tool_tracker", form=form), form="{:.9f}")
