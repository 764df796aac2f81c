"""A plan of the scene that truebed new scene writes for an arm whose joints turn on and on."""

import numpy as np
import pytest

from testbed.laboratory.route import moves
from testbed.laboratory.route.moves import Mover
from testbed.plan.plan import STEPS, plan
from testbed.proposal.scene import scene_text
from testbed.robots.catalog import load_robot, robot_names
from testbed.scenario.read import changed
from testbed.studies import parse_scenario

FEW = {"pool.size": 60, "plan.poses": 8, "plan.held_out": 0, "plan.method": "greedy"}


def proposed(name, **more):
    """The scene proposed for a robot with its plan taken out of the comment."""
    text = scene_text(load_robot(name), name, "arm")
    head, plan_lines = text.split("then type truebed plan FILE\n")
    lines = plan_lines.splitlines()
    assert all(line.startswith("# ") for line in lines)
    whole = head + "\n" + "\n".join(line[2:] for line in lines)
    return changed(parse_scenario(whole, where="scene.toml"), FEW | {"plan.goal.poses": 20} | more)


@pytest.mark.parametrize("name", robot_names())
def test_the_plan_proposed_for_a_robot_is_read_and_keeps_to_the_ranges_of_its_workspace(name):
    scenario = proposed(name)
    assert scenario.plan.poses == 8
    place = load_robot(name).workspace
    assert scenario.pool.joint_ranges_deg == (place.joint_ranges_deg if place else ())


def test_the_scene_proposed_counts_the_errors_that_its_comment_promises():
    """Those of the station and the target are most of a plan's u; without them it is too small."""
    assert "systematic errors of its data sheet" in scene_text(load_robot("staubli_tx60"), "x", "a")
    assert proposed("staubli_tx60").tracker.systematic


def test_a_plan_of_a_ur10_searches_for_no_way_in_vain(monkeypatch):
    searched, told = [], []
    search = Mover._search

    def watched(*all_):
        searched.append(search(*all_))
        return searched[-1]

    monkeypatch.setattr(Mover, "_search", watched)
    made = plan(proposed("universal_ur10"), progress=lambda *all_: told.append(all_))
    assert not made.tour.blocked
    assert all(way is not None for way in searched)
    # every move tested is told, inside the step
    assert told.count((STEPS[3], 3, len(STEPS))) > len(made.tour.q)


@pytest.mark.slow
def test_with_all_its_turns_it_ends_too_and_says_what_to_narrow(monkeypatch):
    monkeypatch.setattr(moves, "RESOLUTION", 0.05)  # a fifth of the postures, and of the patience
    monkeypatch.setattr(moves, "PATIENCE", 6_000)
    monkeypatch.setattr(moves, "NODES", 200)
    tested = []
    is_free = Mover.is_free
    monkeypatch.setattr(Mover, "is_free", lambda *all_: tested.append(1) or is_free(*all_))
    turns = {"pool.joint_ranges_deg": [[-360.0, 360.0]] * 6, "plan.held_out": 2}
    made = plan(proposed("universal_ur10", **turns))
    assert made.tour.blocked
    assert "narrow [pool] joint_ranges_deg" in made.tour.sentence
    # ten poses and the start: 55 pairs, each straight and by 40 stops at most, and the searches
    assert len(tested) < 55 * 81 + 10 * 200
    assert np.isfinite(made.u_mean)
