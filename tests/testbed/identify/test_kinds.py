"""Other kinds of measurement than full poses go the same straight line."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import COLUMNS
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import inverse, transform_points
from calib.measurement import tables
from calib.measurement.observations import joined
from calib.uncertainty.judgement import Judgement
from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.stated_point import widened
from calib.uncertainty.trust import DATUM
from testbed.identify.applies.targets import datum_words
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.decisions import decision_words, would_decide
from testbed.identify.frames import frames_of
from testbed.identify.handback.states import tool_words
from testbed.identify.headline import kind
from testbed.identify.recording.story import calibration_story
from testbed.identify.report.plots import histogram
from testbed.identify.session import with_test
from testbed.identify.statements import statements_of
from testbed.identify.to_do.next_step import next_step
from testbed.identify.words import RANGED, UNTESTED, mark, verdict
from testbed.scenario.tolerance import Decision
from testbed.scenario.tool_in_use import ToolInUse
from testbed.store.codec import pack, unpack
from tests.calibrated import robot, session_of, true_model
from tests.reference import SIGMA_POSITION, pool_r

PLACES = np.array([[0.05, 0.03, 0.08], [-0.06, 0.02, 0.1], [0.01, -0.07, 0.05]])
ANCHORS = np.array([[3.0, 0.5, -0.3], [2.0, -3.0, 0.4], [3.5, -2.5, 1.2]])


def points(model, q, rng):
    """Three reflectors of unknown place at every pose."""
    T, parts = model.poses(q), []
    for k, place in enumerate(PLACES):
        p = T[:, :3, 3] + T[:, :3, :3] @ place
        seen = p + rng.normal(0, SIGMA_POSITION, p.shape)
        covariance = np.tile(SIGMA_POSITION**2 * np.eye(3), (len(q), 1, 1))
        parts.append(tables.points(q, seen, sd=covariance, reflector=k))
    return joined(parts)


def distances(model, q, rng):
    """One reflector at a known place, its distance to three known points at every pose."""
    T, parts = model.poses(q), []
    p = T[:, :3, 3] + T[:, :3, :3] @ PLACES[0]
    for k, anchor in enumerate(ANCHORS):
        d = np.linalg.norm(p - anchor, axis=1) + rng.normal(0, SIGMA_POSITION, len(q))
        parts.append(tables.distances(q, d, sd=SIGMA_POSITION, anchor=k, offset=PLACES[0]))
    return joined(parts)


def test_three_reflectors_of_unknown_place_are_enough():
    table = points(true_model(), pool_r(60), np.random.default_rng(1))
    session = session_of(
        table, fixtures=Fixtures(reflectors=np.zeros((3, 3))), reflector_names=("A", "B", "C")
    )
    found = calibrate(robot(), session, Options(seed=2))
    assert found.fit.identification.rank == 33  # MATH 3: base, links and three reflectors
    # noise of 17.5 um per axis is 28 um long on average
    assert found.fit.test.position.mean < 60e-6
    assert found.fit.test.rotation is None
    assert found.before_test.position.mean > 3 * found.fit.test.position.mean
    between = found.fit.identification.model.fixtures.reflectors
    for i, j in ((0, 1), (0, 2), (1, 2)):
        apart = np.linalg.norm(between[i] - between[j])
        assert apart == pytest.approx(np.linalg.norm(PLACES[i] - PLACES[j]), abs=1e-4)
    # of what was measured, the least known is stated: its region is that of its readings
    target, belief = found.target, found.proof.belief
    (said,) = (text for text in found.warnings if "no region includes errors of that" in text)
    assert f"all statements are about {'ABC'[target.reflector]}, the least" in said
    rows = [table.rows(table.reflector == k) for k in range(3)]
    radii = [distance_radius(widened(belief.seen_regions(one))).mean() for one in rows]
    own = distance_radius(widened(belief.regions(rows[0].q, target=target)))
    np.testing.assert_allclose(own.mean(), radii[target.reflector], rtol=1e-9)
    assert own.mean() > 0.95 * max(radii)  # by the noise alone: the misfit may say another
    # one radius per pose: three points of one pose share its error
    assert found.proof.conformal.n_poses == 20


def test_the_model_is_chosen_with_reflectors_to_be_found_too():
    table = points(true_model(), pool_r(15), np.random.default_rng(1))
    session = session_of(
        table,
        fixtures=Fixtures(reflectors=np.zeros((3, 3))),
        reflector_names=("A", "B", "C"),
        model="choose",
    )
    found = calibrate(robot(), session)
    assert np.isfinite(found.choice.log_evidence)
    # links and joint terms have a prior, the places of the reflectors have none, and of the last
    # link nothing is left to find
    prior = found.fits[1].identification.prior
    assert len(prior.names) == 52
    assert not any("." in name for name in prior.names[:25])


def test_what_the_targets_take_up_of_the_last_link_is_in_no_region():
    """A prior on its numbers would be of where the flange lies, which no reading speaks of."""
    table = points(true_model(), pool_r(12), np.random.default_rng(1))
    known = {"fixtures": Fixtures(reflectors=np.zeros((3, 3))), "reflector_names": ("A", "B", "C")}
    session = session_of(table, **known, link_sd=np.tile([1e-3, 5e-4, 5e-4, 1e-3, 1e-3], (6, 1)))
    found = calibrate(robot(), session, Options(seed=2))
    assert found.handback.why == "the session states it"
    last = [name + "6" for name in COLUMNS]
    identified = found.fit.identification
    assert identified.prior is not None
    assert not set(last) & set(identified.parameters.free_names)
    # u of d6 and a6 alone, 0.5 mm each, would make a radius of 0.5 sqrt(2) 2.8 / 1.7 > 1 mm
    assert found.proof.point is not None
    assert found.proof.point.radius_mean < 5e-4
    # a target whose place is known does speak of the flange: then they are found with the rest
    T = true_model().poses(pool_r(12))
    tip = T[:, :3, 3] + T[:, :3, :3] @ PLACES[0]
    both = joined([table, tables.points(pool_r(12), tip, sd=SIGMA_POSITION, offset=PLACES[0])])
    free = frames_of(robot(), session_of(both, **known), both).parameters.free_names
    assert set(last) <= set(free)


def test_held_out_targets_are_those_identified_from_by_name():
    table = points(true_model(), pool_r(15), np.random.default_rng(1))
    one, other = (
        session_of(table, fixtures=Fixtures(reflectors=np.zeros((3, 3))), reflector_names=names)
        for names in (("A", "B", "C"), ("B", "A", "C"))
    )
    with pytest.raises(InputError, match="looks at other reflectors"):
        with_test(one, other)


def test_distances_to_known_points_are_judged_as_distances():
    table = distances(true_model(), pool_r(90), np.random.default_rng(1))
    session = session_of(
        table,
        fixtures=Fixtures(anchors=ANCHORS),
        anchor_names=("P", "Q", "R"),
        fixed=tuple(f"anchor{k}.{axis}" for k in (1, 2, 3) for axis in "xyz"),
    )
    found = calibrate(robot(), session, Options(held_out=25))
    assert np.array_equal(found.fit.identification.model.fixtures.anchors, ANCHORS)
    assert found.proof.held_out is None
    # a distance shows an error along its own line only: no radius around a point comes of it
    assert found.proof.conformal is None
    assert "distances alone have tested it" in next_step(found)
    # 25 more distances would not help, though 19 positions would
    assert "Measure positions, not distances, of at least 19 held-out poses" in next_step(found)
    assert mark(found) == RANGED
    assert "distances at 25 held-out poses have tested it, in one direction each" in verdict(found)
    assert "Distances at 25 held-out poses widen the coverage factor" in found.proof.trust.sentence
    assert "19 poses measured as positions would guard all" in found.proof.trust.sentence
    # the anchors are known, and with them where the robot stands
    assert found.proof.belief.datum is None
    assert not found.proof.point.relative
    assert datum_words(found) == ()
    few = calibrate(robot(), session, Options(held_out=18))
    assert mark(few) == UNTESTED
    assert "few held-out distances, of one direction each, guard no radius" in verdict(few)
    assert "is used and measured as positions (a distance shows" in few.proof.trust.sentence
    # E|noise| of one distance is 14 um
    assert found.fit.test.position.mean < 40e-6
    assert kind(found) == "mean distance error"
    assert "orientation" not in verdict(found)
    # no proof looks at the joints of distances: the split does
    with pytest.raises(InputError, match="90 of 90 held-out poses stand at the same joints"):
        calibrate(robot(), with_test(session, session))


@pytest.mark.parametrize("known", [0, 1])
def test_anchors_are_found_where_the_base_is_held_as_well(known):
    """They were sought from the base itself, and left where they shrank the arm to its half."""
    table = distances(true_model(), pool_r(40), np.random.default_rng(1))
    base, held = true_model().chain.T_world_base, robot().model.chain.T_world_base
    true = transform_points(held @ inverse(base), ANCHORS)
    session = session_of(
        table,
        fixtures=Fixtures(anchors=np.where(np.arange(3)[:, None] < known, true, 0.0)),
        anchor_names=("P", "Q", "R"),
        fixed=tuple(f"anchor{k + 1}.{axis}" for k in range(known) for axis in "xyz"),
    )
    session = replace(session, wanted=session.wanted.model_copy(update={"base": "fixed"}))
    start = frames_of(robot(), session, session.measurements).start
    np.testing.assert_array_equal(start.chain.T_world_base, held)
    np.testing.assert_array_equal(start.fixtures.anchors[:known], true[:known])
    # seen by nominal links, which are off by tenths of a millimeter and hundredths of a degree
    np.testing.assert_allclose(start.fixtures.anchors, true, rtol=0, atol=5e-3)


def story_of(found):
    """All words of its recording's chapters."""
    chapters = calibration_story(found, robot()).chapters
    return "\n".join(line for chapter in chapters for line in chapter.text)


def test_distances_from_points_of_unknown_place_state_tool_points_to_each_other():
    """In the base, a radius of what is known there would be that of the prior of the links."""
    table = distances(true_model(), pool_r(90), np.random.default_rng(1))
    where = {"fixtures": Fixtures(anchors=ANCHORS), "anchor_names": ("P", "Q", "R")}
    loose = {"link_sd": np.tile([1e-3, 5e-4, 5e-4, 1e-3, 1e-3], (6, 1))}
    tool = ToolInUse("gripper", (0.0, 0.0, 0.15), (0.0, 0.0, 0.0), 0.0)
    session = session_of(table, **where, **loose, in_use=tool)
    found = calibrate(robot(), session, Options(held_out=25))
    point = found.proof.point
    assert point.relative
    # u of one link number alone, .5 mm, would make a radius of some .8 mm
    assert point.radius_mean < 5e-4
    assert "um relative to the others (the readings do not show where" in verdict(found)
    step = next_step(found)
    assert "and that it is of tool points to each other. Measure positions as well, of" in step
    # every other radius is of the same frame, and those beside no table say so
    radius = {one.key: one.radius for one in statements_of(found)}
    assert radius["parameters"] < radius["region_mean"]
    assert "in the frame that fits the tool points best" in tool_words(found)[0]
    assert "is that of tool points to each other" in datum_words(found)[0]
    assert re.search(r"tool point: R95 .* mm to the others\n", story_of(found))
    assert DATUM in found.proof.trust.sentences
    assert "would guard all" not in found.proof.trust.sentence
    assert "distance error [mm]" in histogram(found)
    # a tolerance is one in the base
    asked = replace(found, decision=Decision(1e-2, "guarded"))
    (said,) = decision_words(asked, SimpleNamespace(targets=None))
    assert said.endswith("UNDECIDED: the readings do not show where the robot stands.")
    assert would_decide(asked) == ""
    # its record keeps the frame
    kept = unpack(Judgement, pack(found.proof))
    ask = table.q[:5]
    for one in (kept.belief, kept.belief.proven):
        assert np.array_equal(one.datum.motion, found.proof.belief.datum.motion)
    covariance = found.proof.belief.regions(ask, target=found.target).covariance
    assert np.array_equal(kept.belief.regions(ask, target=found.target).covariance, covariance)
