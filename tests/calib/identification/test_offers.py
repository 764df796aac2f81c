"""Nothing silent: each ladder of three odd arms is offered, or refused with the right reason."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions, approaches
from calib.geometry.parameters import parameters_of, shown_in
from calib.identification.identify import identify
from calib.identification.ladders import ladders_of
from calib.identification.model_choice import extended_by
from calib.identification.prior import weak_prior
from calib.identification.row_ladders import RowTerms, row_ladders
from calib.information.sizes import SCALE
from calib.measurement.tables import points, poses
from tests.calib.identification.test_gravity_ladder import IIWA, NOMINAL, SCARA, turned
from tests.reference import DEG

WALL = RobotModel(turned(NOMINAL.chain, 90 * DEG))
GANTRY = RobotModel(
    Chain(
        [[0, 1, 0, -np.pi / 2, 0], [-np.pi / 2, 1, 0, -np.pi / 2, 0], [0, 1, 0, 0, 0]],
        kinds=("prismatic",) * 3,
    )
)
TORQUES = ("sag by torques", "sag and small bearings", "sag and bearings")
SPRINGS = ("springs", "springs and bearings")
TILTED = tuple(f"{name} on a tilted base" for name in ("sag by torques", "sag and bearings"))
SPRINGS_TILTED = tuple(f"{name} on a tilted base" for name in SPRINGS)
WAVES = ("small waves", "waves", "waves 1 to 4", "joint map with small waves", "joint map")
CLOSED = "sag: waves of joints 2 and 3 are not what gravity does to this arm"
TURNS = "joint {} z: gravity never turns it".format
BENDS = "joint {} {}: gravity never bends it".format
SILENT = {
    "approach": "approach: the order of the poses is not known",
    "torque": "torque: the file has no such columns",
    "gear": "gear: no ratio or order is stated",
    "lengths": "lengths: the file gives no temperature",
}


def ladders(nominal, *, telling):
    """Levels and reasons of every ladder, of rows that say all or nothing beside their joints."""
    n = nominal.chain.n_joints
    q = np.random.default_rng(0).uniform(-1, 1, (30, n))
    table, known = poses(q, nominal.poses(q), sd=(1e-5, 1e-4)), RowTerms()
    if telling:
        load = np.random.default_rng(1).normal(size=q.shape) * 30
        warm = np.linspace(20, 35, 30)
        at = OperatingConditions(approach=approaches(q), torque=load, temperature=warm)
        table, known = replace(table, conditions=at), RowTerms(gear=((30.5,),) * n)
    return {
        ladder.name: (tuple(level.name for level in ladder.levels[1:]), ladder.why_not)
        for ladder in (*ladders_of(nominal), *row_ladders(nominal, table, known))
    }


@pytest.mark.parametrize(
    ("nominal", "gravity", "waves", "gear"),
    [
        (IIWA, ((*TORQUES, *SPRINGS, *TILTED, *SPRINGS_TILTED),
                (TURNS(1), BENDS(6, "y"), TURNS(7), CLOSED)),
         (WAVES, ()), ()),
        (WALL, ((*TORQUES, *SPRINGS, *TILTED, *SPRINGS_TILTED),
                (BENDS(5, "y"), TURNS(6), CLOSED)), (WAVES, ()), ()),
        (
            RobotModel(SCARA),
            (
                ("small bearings", "bearings", "springs and bearings",
                 "bearings on a tilted base", "springs and bearings on a tilted base"),
                (
                    TURNS(1), BENDS(2, "x"),
                    "joint 2 y: gravity always bends it alike, as an offset would",
                    TURNS(2), BENDS(3, "x"), BENDS(3, "y"),
                    "joint 3 z: gravity always pulls along it alike, as an offset would",
                    BENDS(4, "x"), BENDS(4, "y"), TURNS(4), CLOSED,
                ),
            ),
            (WAVES, ("joint 3: it does not turn",)), ("gear: joint 3 does not turn",),
        ),
    ],
    ids=["seven axes", "on a wall", "scara"],
)  # fmt: skip
def test_every_ladder_of_an_arm_is_offered_or_says_why_not(nominal, gravity, waves, gear):
    told, untold = (ladders(nominal, telling=telling) for telling in (True, False))
    slides = {"travel"} if "prismatic" in nominal.chain.kinds else set()
    assert set(told) == set(untold) == {"gravity", "waves", *SILENT, *slides}
    assert all(told[name] == (("travel",), ()) for name in slides)
    for each in (told, untold):
        assert each["gravity"] == gravity
        assert each["waves"] == waves
    for name, why in SILENT.items():
        assert told[name] == ((name,), gear if name == "gear" else ())
        assert untold[name] == ((), (why,))


def test_arms_that_do_not_turn_or_do_not_give_way_are_told_so():
    """Three slides: waves and gears need a turn. A mast on its own axis: nothing bends it."""
    told = ladders(GANTRY, telling=True)
    assert told["waves"] == ((), ("waves: no joint of this robot turns",))
    assert told["gear"] == ((), tuple(f"gear: joint {k} does not turn" for k in (1, 2, 3)))
    assert told["approach"] == (("approach",), ())
    assert told["travel"] == (("travel",), ())
    mast = ladders(RobotModel(Chain([[0, 0.3, 0, 0, 0]])), telling=True)
    assert mast["gravity"] == (
        (),
        (
            BENDS(1, "x"), BENDS(1, "y"), TURNS(1), CLOSED,
            "tilted base: nothing gives way that could show it",
        ),
    )  # fmt: skip


RAILS = RobotModel(
    Chain(
        [[0, 0, 0, -np.pi / 2, 0], [-np.pi / 2, 0, 0, -np.pi / 2, 0], [0, 0.5, 0.1, 0, 0]],
        kinds=("prismatic",) * 3,
    )
)
SCALES = np.array([90e-6, -60e-6, 30e-6])
ROOM = np.array([[-3.0, 3.0], [10.0, 12.0], [0.0, 0.6]])  # [m]


def travelled(m=40, seed=0):
    """Joints of a gantry (m, 3), and where its point is when they move by another distance [m]."""
    q = np.random.default_rng(seed).uniform(*ROOM.T, (m, 3))
    return q, RAILS.poses(q * (1 + SCALES))[:, :3, 3]


def travel_offered(q, xyz):
    return row_ladders(RAILS, points(q, xyz, sd=5e-6))[-1]


def test_a_scale_is_found_though_a_wave_stands_for_it():
    q, xyz = travelled()
    table, ladder = points(q, xyz, sd=5e-6), travel_offered(q, xyz)
    assert ladder.name == "travel"
    level = ladder.levels[1]
    assert level.names == ("scale1", "scale2", "scale3")
    free = parameters_of(RAILS)
    prior = weak_prior(free, RAILS)
    nominal, found = extended_by(RAILS, table, free, (level,), prior=prior)
    slopes = [
        term.order * value
        for term, value in zip(nominal.joint_errors.terms, found.model.joint_errors.coefficients,
                               strict=True)
    ]  # fmt: skip
    np.testing.assert_allclose(slopes, SCALES, rtol=0.02)  # the prior
    q, xyz = travelled(seed=1)
    missed = np.abs(found.model.poses(q)[:, :3, 3] - xyz).max()
    # noise of 5 um and 40 poses; 0.12 rad of a sine are straight within 0.24 % of 60 um/m on 12 m
    assert missed < 2e-6
    plain = identify(RAILS, table, free, prior=prior).model
    assert np.abs(plain.poses(q)[:, :3, 3] - xyz).max() > 100e-6


def test_a_scale_that_was_seen_on_a_short_travel_is_a_straight_line_far_beyond_it():
    q = np.linspace(0.0, 0.05, 9)[:, None] * np.ones(3)
    level = travel_offered(q, RAILS.poses(q)[:, :3, 3]).levels[1]
    per = np.array([term.order for term in level.errors.terms])
    arm = replace(RAILS, joint_errors=replace(level.errors, coefficients=SCALES / per))
    q = np.full((1, 3), 5.0)  # a hundred times as far
    missed = arm.poses(q)[:, :3, 3] - RAILS.poses(q * (1 + SCALES))[:, :3, 3]
    assert np.abs(missed).max() < 5e-4 * 90e-6 * 5.0  # 0.05 rad of a sine: 0.05^2 / 6


def test_a_scale_is_shown_in_um_per_meter():
    assert shown_in("scale2", True)[0] == "um/m"
    level = travel_offered(*travelled()).levels[1]
    for term in level.errors.terms:
        assert shown_in(term.name, True)[1] == pytest.approx(1e6 * term.order, rel=1e-15)
    for name in ("scale", "scale_of_a_gear1", "rescale1"):
        assert shown_in(name, True)[0] == "mm"


def test_its_prior_is_a_part_of_the_travel_however_long_that_is():
    q, xyz = travelled()
    (level,) = travel_offered(q, xyz).levels[1:]
    slopes = [term.order * sd for term, sd in zip(level.errors.terms, level.sd, strict=True)]
    np.testing.assert_allclose(slopes, SCALE, rtol=1e-12)


def test_a_slide_that_stands_still_is_told_so_and_arms_that_turn_are_offered_nothing():
    q, xyz = travelled()
    q[:, 1] = 11.0
    ladder = travel_offered(q, xyz)
    assert ladder.levels[1].names == ("scale1", "scale3")
    assert ladder.why_not == ("travel: joint 2 never moves",)
    arm = RobotModel(replace(RAILS.chain, kinds=("revolute",) * 3))
    assert "travel" not in [each.name for each in row_ladders(arm, points(q, xyz, sd=5e-6))]


@pytest.mark.parametrize("known", [True, False])
def test_a_scale_that_the_robot_has_already_is_not_offered_again(known):
    q, xyz = travelled()
    level = travel_offered(q, xyz).levels[1]
    nominal = replace(RAILS, joint_errors=level.errors) if known else RAILS
    ladder = row_ladders(nominal, points(q, xyz, sd=5e-6))[-1]
    assert len(ladder.levels) == (1 if known else 2)
    assert ("travel: the model has it already" in ladder.why_not) == known
