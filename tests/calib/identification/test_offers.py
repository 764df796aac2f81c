"""Nothing silent: each ladder of three odd arms is offered, or refused with the right reason."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions, approaches
from calib.identification.ladders import ladders_of
from calib.identification.row_ladders import RowTerms, row_ladders
from calib.measurement.tables import poses
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
    assert set(told) == set(untold) == {"gravity", "waves", *SILENT}
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
    mast = ladders(RobotModel(Chain([[0, 0.3, 0, 0, 0]])), telling=True)
    assert mast["gravity"] == (
        (),
        (
            BENDS(1, "x"), BENDS(1, "y"), TURNS(1), CLOSED,
            "tilted base: nothing gives way that could tell of it",
        ),
    )  # fmt: skip
