"""Turns of the base that no reading tells: about one place, and about the line through two."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.model import RobotModel
from calib.identification.start.on_a_line import extents_told, untold_turns
from calib.measurement import tables
from calib.measurement.observations import joined
from tests.calib import kinds

NOISE = 50e-6
PLACE, OTHER, ASIDE = np.array([[0.4, 0.1, 0.3], [0.4, 0.15, 0.3], [0.45, 0.1, 0.3]])


def touches(*places, m=12, seed=0):
    """Readings of places, with joints that need not lead there."""
    rng = np.random.default_rng(seed)
    q = kinds.joints("tx60", rng, m * len(places))
    return tables.points(q, np.repeat(places, m, axis=0), sd=NOISE)


def standing(*places):
    """A TX60 whose readings show its base as if all places were true."""
    model = RobotModel(kinds.ARMS["tx60"])
    return model, touches(*places)


def test_one_place_tells_no_turn_and_a_line_all_but_that_about_it():
    assert untold_turns(*standing(PLACE)) == ("base.rx", "base.ry", "base.rz")
    (about,) = untold_turns(*standing(PLACE, OTHER))
    assert about.startswith("base.r")


def test_three_places_that_are_no_line_tell_all_turns():
    assert not untold_turns(*standing(PLACE, OTHER, ASIDE))
    # within noise they are one
    held = untold_turns(*standing(PLACE, OTHER, PLACE + 0.3 * (OTHER - PLACE) + 0.5 * NOISE))
    assert len(held) == 1


@pytest.mark.parametrize("m", [12, 118])
@pytest.mark.parametrize(
    "sd", [NOISE * np.ones(3), NOISE * np.array([0.2, 0.2, 5])], ids=["", "deep"]
)
def test_places_that_are_read_with_their_noise_are_as_few_as_they_are(m, sd):
    """Noise of the size stated made a line of one place, and a plane of two, in most sessions."""
    for seed in range(20):
        rng = np.random.default_rng([seed, m])
        for extents, places in enumerate(([PLACE], [PLACE, OTHER], [PLACE, OTHER, ASIDE])):
            rows = touches(*places, m=m // len(places), seed=seed)
            noisy = rows.position + sd * rng.standard_normal(rows.position.shape)
            read = tables.points(rows.q, noisy, sd=np.diag(sd**2))
            assert extents_told(read) == extents


def test_rotations_tell_turns_wherever_the_tool_is():
    model, rows = standing(PLACE)
    T = model.poses(rows.q)
    T[:, :3, 3] = rows.position
    assert not untold_turns(model, tables.poses(rows.q, T, sd=(NOISE, 1e-4)))


def test_each_station_is_asked_for_itself():
    model, rows = standing(PLACE, OTHER, ASIDE)
    fixtures = replace(model.fixtures, stations=np.eye(4)[None])
    both = joined([rows, replace(touches(PLACE, seed=1), station=np.full(12, 1))])
    held = untold_turns(replace(model, fixtures=fixtures), both)
    assert held == ("station2.rx", "station2.ry", "station2.rz")


@pytest.mark.parametrize("along", [[1, 0, 0], [0, 1, 0], [0, 0, 1]], ids="xyz")
def test_the_turn_that_is_held_points_along_the_line(along):
    model = RobotModel(kinds.ARMS["tx60"])
    rng = np.random.default_rng(2)
    q = kinds.joints("tx60", rng, 400)
    p = model.poses(q)[:, :3, 3]
    # joints that really lead near a line: what the model predicts tells the axes of the base
    off = p - p[0] - np.outer((p - p[0]) @ along, along)
    near = np.argsort(np.linalg.norm(off, axis=1))[:12]
    line = p[0] + np.outer((p[near] - p[0]) @ along, along)
    (held,) = untold_turns(model, tables.points(q[near], line, sd=NOISE))
    assert held == "base.r" + "xyz"[along.index(1)]
