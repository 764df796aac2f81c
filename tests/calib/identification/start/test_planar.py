"""Distances to arms whose tool points stay in a plane: anchors are found on their sides of it."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.identification.prior import Prior, weak_prior
from calib.identification.start import one_tool
from calib.identification.start.closed_forms import beyond, lifted_arm, multilaterated
from calib.identification.start.start import start_frames
from calib.measurement import tables
from calib.measurement.observations import joined
from tests.reference import DEG

TURN, SLIDE = "revolute", "prismatic"
ARMS = {
    "RRR": [[0, 0.3, 0.4, 0, 0], [0, 0, 0.35, 0, 0], [0, 0, 0.2, 0, 0]],
    "RR": [[0, 0.3, 0.4, 0, 0], [0, 0, 0.35, 0, 0]],
    "PRR": [[0, 0.3, 0, 90 * DEG, 0], [0, 0, 0.4, 0, 0], [0, 0, 0.35, 0, 0]],
    "RPR": [[0, 0.3, 0, 90 * DEG, 0], [0, 0.5, 0, -90 * DEG, 0], [0, 0.1, 0.2, 0, 0]],
    "P": [[0, 0.3, 0.4, 0, 0]],
}
PLACES = np.array([[1.2, 0.5, 0.7], [-1.0, 0.8, -0.4], [0.3, -1.3, 0.9], [0.9, -0.9, -0.5],
                   [0.1, 1.4, 0.6], [-1.1, -0.7, 1.1], [1.3, 0.0, -0.8]])  # fmt: skip
NOISE = 20e-6
TOOL = np.array([0.05, 0.03, 0.08])


def campaign(arm, count, poses, seed=1):
    """True and nominal arm, and the distances of its tool from so many points."""
    rng, links = np.random.default_rng(seed), np.array(ARMS[arm])
    kinds = tuple(SLIDE if letter == "P" else TURN for letter in arm)
    wrong = rng.normal(size=links.shape) * [0.05 * DEG, 2e-4, 2e-4, 0.05 * DEG, 0.05 * DEG]
    tool = np.eye(4)
    tool[:3, 3] = TOOL
    anchors = PLACES[:count]
    true = RobotModel(
        Chain(links + wrong, kinds, np.eye(4), tool), fixtures=Fixtures(anchors=anchors)
    )
    nowhere = Fixtures(anchors=np.zeros_like(anchors))
    nominal = RobotModel(Chain(links, kinds), fixtures=nowhere)
    q = rng.uniform(-2, 2, (poses, len(arm))) * np.where(np.array([*arm]) == "P", 0.15, 1.0)
    p, parts = true.poses(q)[:, :3, 3], []
    for k, place in enumerate(anchors):
        d = np.linalg.norm(p - place, axis=1) + rng.normal(size=poses) * NOISE
        parts.append(tables.distances(q, d, sd=NOISE, anchor=k))
    table = joined([replace(part, pose_id=np.arange(poses)) for part in parts])
    return true, nominal, table


def chi_square(start, table, held):
    """What links and frames leave, all free but what the start held."""
    parameters = parameters_of(start)
    parameters = parameters.freeing([n for n in parameters.names if not n.startswith(held)])
    weak = weak_prior(parameters, start)
    wide = [100 * sd if "." in name else sd for name, sd in zip(weak.names, weak.sd, strict=True)]
    fit = identify(start, table, parameters, prior=Prior(weak.mean, wide, weak.names))
    assert fit.status is Status.CONVERGED
    return fit.chi_square


PLANAR = [
    ("RRR", 4, 40), ("RRR", 2, 40), ("RRR", 4, 14), ("RR", 3, 25), ("PRR", 4, 40), ("RPR", 4, 40),
    ("P", 4, 40), ("RRR", 7, 30),
]  # fmt: skip
"""Arms, points and poses. Two known points leave the base to turn about them."""


@pytest.mark.parametrize(
    ("arm", "count", "poses", "known"),
    [(*one, known) for one in PLANAR for known in (False, True) if one[1] > 2 or not known],
)
def test_a_fit_ends_where_one_from_the_true_places_ends(arm, count, poses, known):
    """Of free anchors none did: these were left in the plane, where no distance moves them."""
    true, nominal, table = campaign(arm, count, poses)
    if known:
        nominal = replace(nominal, fixtures=true.fixtures)
    start = start_frames(nominal, table, free_anchors=() if known else range(count))
    at = replace(nominal.chain, T_flange_tool=true.chain.T_flange_tool)
    here = RobotModel(at, fixtures=true.fixtures)
    held = "anchor" if known else "base."
    found, best = (chi_square(model, table, held) for model in (start.model, here))
    # a standard deviation of chi-square with some 60 degrees of freedom is 11; a wrong side costs
    # hundreds. The two begin with frames some millimeters apart, which the prior hardly feels
    assert found < best + 5


def test_a_point_beside_the_plane_of_centers_follows_from_its_distances():
    rng, place = np.random.default_rng(2), np.array([0.4, -0.3, 1.1])
    flat = np.column_stack([rng.normal(size=(20, 2)), np.zeros(20)])
    turned = flat @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for centers in (flat, turned):
        at = place if centers is flat else turned[0] + place
        found = multilaterated(centers, np.linalg.norm(centers - at, axis=1))
        image = beyond(centers, at)
        off = [np.abs(found - one).max() for one in (at, image)]
        # some 1e-15 of squares of meters, a root of which is taken
        assert min(off) < 1e-12
        for one in (at, image):
            np.testing.assert_allclose(
                np.linalg.norm(centers - one, axis=1), np.linalg.norm(centers - at, axis=1)
            )
    assert beyond(rng.normal(size=(20, 3)), place) is None
    # on a line each turn about it is an image
    assert beyond(np.outer(np.arange(5.0), place), np.ones(3)) is None


def test_the_lift_of_distances_of_a_planar_arm_finds_the_point_in_its_plane():
    """Columns of rounding errors, which the plane leaves, put it 1e14 m beside the plane."""
    true, nominal, table = campaign("RRR", 4, 40)
    exact = Chain(nominal.chain.links)
    F = RobotModel(exact).poses(table.q)
    point = (F[:, :3, :3] @ TOOL) + F[:, :3, 3]
    d = np.linalg.norm(point - true.fixtures.anchors[table.anchor], axis=1)
    arm = lifted_arm(F, d, table.anchor, 4)
    np.testing.assert_allclose(arm[:2], TOOL[:2], rtol=0, atol=1e-9)
    assert abs(arm[2]) < 1.0


def test_guesses_that_begin_alike_are_refined_once(monkeypatch):
    """The base, which is the world, was turned about free anchors in 24 ways, for nothing."""
    _, nominal, table = campaign("RRR", 2, 40)
    table = replace(table, distance=np.random.default_rng(3).uniform(0.5, 3.0, len(table)))
    begun, kept = [], one_tool.refine

    def refined(alignment, measurements, free, **more):
        begun.append(np.square(alignment.predict(measurements).residual).sum())
        return kept(alignment, measurements, free, **more)

    monkeypatch.setattr(one_tool, "refine", refined)
    start = start_frames(nominal, table, free_anchors=range(2))
    assert start.position_rms > 0.1  # nothing fits, so that every guess is tried
    first = np.sort(begun[:-1])  # the last is that of all rows
    assert len(first) > 2
    assert (np.diff(first) > 1e-9 * first[1:]).all()
