"""Files of an arm far from nominal: that draft is taken whose readings its links explain."""

import numpy as np

from testbed.files.frames_fit import Misfit
from testbed.files.read import read_session
from testbed.proposal.fits.tried import _fitting
from tests.testbed.files.made import ROBOT, columns, csv, made
from tests.testbed.proposal.test_session import proposed

FAR = made(3, 20, off=45.0)
"""Links some 7 mm and 2 deg from nominal."""


def test_a_draft_that_only_links_explain_is_taken_before_the_first_one(tmp_path):
    """Of two places in each row the first one belongs to another tool, which nothing explains."""
    own = columns(FAR, form="none", ids=False)
    joints = {f"J{k + 1}": own[f"q{k + 1}_deg"] for k in range(6)}
    places = 1e3 * FAR.T[:, :3, 3]
    vague = np.random.default_rng(0).uniform(-900, 900, places.shape)
    table = joints | dict(zip(("A x", "A y", "A z"), vague.T, strict=True))
    table |= dict(zip(("B x", "B y", "B z"), places.T, strict=True))
    (tmp_path / "a.csv").write_text(csv(table))
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", ROBOT.name)
    assert "far more than usual, and links up to" in said
    assert "is it the robot that was measured" not in said
    read = read_session(tmp_path / "session.toml", ROBOT).measurements
    # fifteen digits are written
    np.testing.assert_allclose(read.position, FAR.T[:, :3, 3], rtol=0, atol=1e-12)


def test_what_is_off_by_the_length_of_a_street_is_no_other_interpretation():
    """It said: with the best of 111 other interpretations, 313 m and 9.6 deg."""
    said = _fitting(ROBOT, Misfit(0.0024, 0.006), [Misfit(313.0, 0.17)], 111, 1)
    assert said.endswith("; none of 111 other interpretations comes near the robot")
    said = _fitting(ROBOT, Misfit(0.0024, 0.006), [Misfit(0.08, 0.17)], 111, 1)
    assert said.endswith("; with the best of 111 other interpretations, 80 mm and 9.7 deg")
