"""The bars of the believed region on foreign arms, 200 robots a cell; hours, run by hand.

Found, mean share of the points in the believed region of 200 robots a cell, and in parentheses what
the parameters alone hold:

* rigid 100.0 % (94), 100 + 50 poses 100.0 % (93); a misfit seen at p < .01 on 0 to 1 %;
* slight 99.6 to 100.0 % in all 21 cells at 40 + 20 poses (31 to 86), 99.2 to 100.0 % in all 21 at
  100 + 50 poses (12 to 73);
* large 98.8 to 99.8 % (0 to 8); more poses 100 % at 60, 150, 500 (51, 30, 10);
* hidden 98.7, 98.8, 98.9 % (25, 18, 10), not stated 74.3 %; drifting 99.2, 99.6, 99.9 % (47 to 70),
  seen on 96 to 100 %;
* shift 94.3 to 100 % where it reaches (2 to 71), least at the other elbow with waves of twice the
  noise: 22 % of the places refused in the other half of the room and of joint 1; of 21 to 38 % of
  these sets more than a quarter is, whose other places are held at 97.9 to 100 % (40 and 60 robots
  a cell); none refused at the same place;
* models chosen by the readings, sizes 1, 2 and 4 of all kinds, 60 + 40 poses: 96.9 to 100 % (1 to
  95), least with play of four noises; 150 + 50 poses 98.5 to 100 %; 16 robots each;
* one reflector of a UR5 99.7 to 99.9 % (71 to 95); one move 94.3 to 100 %, least where the mean is.

No cell falls short in what it holds; the region is wider than asked for, by two parts. Growth adds
16 to 27 % at the very places of the proof, because the larger of one and of two numbers with mean
one is 1.3 to 1.6 on average; without it the other elbow is held at 56 %, and divided by its mean at
83 %. Noise on trust within 10 % adds 10 to 15 % and does not fade with more poses.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.truth.foreign import KINDS, PLACES
from tests.truth.foreign_cells import Cell
from tests.truth.test_foreign import error_of_mean, judged

pytestmark = [pytest.mark.truth, pytest.mark.study]
MANY = 200
"""Robots a cell."""
POSES = ((40, 20), (100, 50))
LEAST = {"lengths": 0.92, "play": 0.92, "bearings": 0.92}
"""Bars of kinds that share their shape with nothing in the rule; of all others 94 %."""


def poses(cell, m, n):
    """The cell with other numbers of poses."""
    return replace(cell, train=m, held_out=n)


@pytest.mark.parametrize(("m", "n"), POSES)
def test_rigid_arms(m, n):
    believed, found = judged(poses(Cell(), m, n), MANY)
    assert believed.mean() >= 0.95
    assert (found.seen < 0.01).mean() <= 0.02
    assert found.move.mean() >= 0.95


@pytest.mark.xfail(strict=True, reason="growth and noise on trust: 2.3 and 1.7 times as wide")
@pytest.mark.parametrize(("cell", "most"), [(Cell(), 2.0), (Cell("sag", 0.5), 1.35)])
def test_it_is_hardly_wider_than_what_knows_the_size_of_the_misfit(cell, most):
    found = judged(cell, MANY)[1]
    assert found.radius.mean() <= most * found.oracle.mean()


@pytest.mark.parametrize(("m", "n"), POSES)
@pytest.mark.parametrize("size", [0.25, 0.5, 0.75])
@pytest.mark.parametrize("kind", KINDS)
def test_slight(kind, size, m, n):
    believed, found = judged(poses(Cell(kind, size), m, n), MANY)
    assert believed.mean() >= LEAST.get(kind, 0.94)
    assert found.move.mean() >= 0.95


@pytest.mark.parametrize("size", [2.0, 4.0])
@pytest.mark.parametrize("kind", ["sag", "waves", "mixture", "play"])
def test_large(kind, size):
    believed, _ = judged(Cell(kind, size), MANY)
    assert believed.mean() >= 0.94


WIDE = pytest.mark.xfail(strict=True, reason="1.03 times as wide, all of it growth")


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        *[(kind, size) for kind in ("sag", "mixture") for size in (2.0, 4.0)],
        ("waves", 2.0),
        ("waves", 4.0),
        ("play", 2.0),
        pytest.param("play", 4.0, marks=WIDE),
    ],
)
def test_large_misfit_costs_no_more_than_a_radius_that_needs_no_model(kind, size):
    _, found = judged(Cell(kind, size), MANY)
    assert found.radius.mean() <= found.conformal_radius.mean()


@pytest.mark.parametrize("cell", [Cell(), Cell("sag", 0.5), poses(Cell(), 100, 50)])
def test_hidden(cell):
    believed, _ = judged(replace(cell, constants=True), MANY)
    assert believed.mean() >= 0.94


def test_hidden_and_not_stated():
    """What the report names: no held-out pose of the same instrument can show it."""
    believed, _ = judged(Cell(constants=True, stated=False), MANY)
    assert believed.mean() < 0.80


@pytest.mark.parametrize("cell", [Cell(), Cell("sag", 0.5), poses(Cell(), 100, 50)])
def test_drifting(cell):
    believed, found = judged(replace(cell, memory=15.0), MANY)
    assert (found.remembers < 0.05).mean() >= 0.8
    assert believed.mean() >= 0.90


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("size", [0.5, 2.0])
@pytest.mark.parametrize("kind", ["sag", "waves"])
def test_shift(kind, size, place):
    believed, found = judged(Cell(kind, size, 60, 40, place), MANY)
    if len(believed) > 1:
        assert believed.mean() >= 0.90
    if place == "same":
        assert np.mean(found.outside) <= 0.01


@pytest.mark.parametrize("off_axis", [0.0, 0.01, 0.04, 0.08])
@pytest.mark.parametrize("kind", ["rigid", "sag", "mixture"])
def test_one_reflector_of_a_ur5(kind, off_axis):
    believed, _ = judged(Cell(kind, 0.5 * (kind != "rigid"), off_axis=off_axis), MANY)
    assert believed.mean() >= 0.94


@pytest.mark.parametrize("kind", ["sag", "mixture"])
def test_more_poses_are_never_worse(kind):
    sets = [(60, 30), (150, 50), (500, 100)]
    shares = [judged(poses(Cell(kind, 0.5), m, n), MANY)[0] for m, n in sets]
    for believed in shares:
        assert believed.mean() >= 0.94
    for fewer, more in pairwise(shares):
        assert more.mean() >= fewer.mean() - 3 * np.hypot(error_of_mean(more), error_of_mean(fewer))


@pytest.mark.parametrize("size", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("kind", KINDS)
def test_a_model_chosen_by_the_readings_keeps_its_promise(kind, size):
    """The choice costs no coverage: of sag and waves little is left, of others what misfit is."""
    believed, _ = judged(replace(Cell(kind, size, 60, 40), chosen=True), MANY)
    assert believed.mean() >= LEAST.get(kind, 0.94)
