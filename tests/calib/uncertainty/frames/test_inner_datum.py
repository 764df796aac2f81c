"""Where no reading shows a frame, tool points are stated in the one that fits them best."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, norm

from calib.calibration import calibrate
from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import exp_so3, transform_points
from calib.geometry.model import RobotModel
from calib.identification.identify import identify
from calib.identification.start.closed_forms import fitted_frame
from calib.measurement import tables
from calib.measurement.observations import joined
from calib.measurement.prediction import predict
from calib.measurement.tool_target import ToolTarget
from calib.uncertainty.frames.inner_datum import inner_datum, shows_no_frame
from calib.uncertainty.statement.applicability import proven_at
from calib.uncertainty.statement.believe import adding, believe, scores_of_distances
from calib.uncertainty.statement.misfit import UNGUARDED_DROP, misfit
from calib.uncertainty.trust import DATUM
from tests.calib import kinds
from tests.reference import TX60_LINKS

CORNERS = np.array([[0.9, 0.5, 0.0], [0.9, -0.6, 0.1], [-0.3, 0.9, 0.3], [0.2, 0.1, 1.2]])
RAIL = np.array([[0.0, 2.0, 0.1], [0.5, 2.0, 0.1], [1.5, 2.0, 0.1]])
NOISE = 30e-6
K3 = np.sqrt(chi2.ppf(0.95, 3))
ROBOTS = 8


def bent_rail(off):
    """Three points, the middle one beside the line of the others by a part of their spread."""
    return RAIL + off * 0.75 * np.array([[0, 0, 0], [0, 0, 1], [0, 0, 0]])


def seen_from(places, m=40):
    """Distances at some postures from each of some points; what they are does not matter here."""
    q, at = np.zeros((m, 6)), np.arange(m) % len(places)
    return tables.distances(q, np.ones(m), sd=NOISE, anchor=at)


def fit_with(places, free, dropped=()):
    """As much of an identification as tells which numbers were asked for."""
    model = SimpleNamespace(fixtures=Fixtures(anchors=places))
    asked = SimpleNamespace(free_names=tuple(free)), SimpleNamespace(dropped=dropped)
    return SimpleNamespace(model=model, parameters=asked[0], reduction=asked[1])


ANCHORS_FREE = [f"anchor{k + 1}.x" for k in range(4)]


@pytest.mark.parametrize(
    ("places", "free", "none"),
    [(CORNERS, ["base.x", *ANCHORS_FREE], True), (CORNERS, ANCHORS_FREE, True),
     (CORNERS, ["base.x"], False), (CORNERS, [], False),
     (CORNERS[:1], ["base.x"], True), (CORNERS[:1], [], False),
     (CORNERS[:2], ["base.rx"], True), (CORNERS[[0, 1, 0]], ["base.x"], True),
     (RAIL, ["base.x"], True), (bent_rail(1e-4), ["base.x"], True),
     (bent_rail(1e-2), ["base.x"], False), (CORNERS, ["base.x", *ANCHORS_FREE[:2]], True),
     (CORNERS, ["base.x", *ANCHORS_FREE[:1]], False), (CORNERS, ANCHORS_FREE[:3], False)],
)  # fmt: skip
def test_which_distances_show_where_the_base_stands(places, free, none):
    assert shows_no_frame(fit_with(places, free), seen_from(places)) == none


def test_only_anchors_that_were_measured_from_show_a_frame():
    places = np.concatenate([RAIL, CORNERS])
    assert shows_no_frame(fit_with(places, ["base.x"]), seen_from(RAIL))
    assert not shows_no_frame(fit_with(places, ["base.x"]), seen_from(places))


def test_a_base_that_no_reading_tells_from_other_numbers_was_asked_for():
    assert shows_no_frame(fit_with(RAIL, [], ("base.x",)), seen_from(RAIL))


SHOTS = CORNERS[[0, 0, 0, 0]] + 1e-5 * np.eye(4, 3)


@pytest.mark.parametrize(
    ("places", "ids", "base", "none"),
    [(CORNERS[:1], [50], ["base.x"], True), (CORNERS[:2], [50, 51], ["base.x"], True),
     (SHOTS, [50] * 4, ["base.x"], True), (RAIL, [50, 51, 52], ["base.x"], True),
     (CORNERS[:3], [50, 51, 52], ["base.x"], False), (CORNERS[:1], [50], [], False)],
    ids=["one", "two", "shots of one", "on a line", "three", "base held"],
)  # fmt: skip
def test_points_read_beside_distances_show_a_frame_as_known_places_do(places, ids, base, none):
    """One leaves three turns of a free base about it: true errors of 1.3 m beside R95 of .16 mm."""
    fit, table = fit_with(CORNERS, [*base, *ANCHORS_FREE]), seen_from(CORNERS)
    points = tables.points(np.ones((len(ids), 6)), places, sd=NOISE)
    points = replace(points, pose_id=np.array(ids))
    assert shows_no_frame(fit, joined([table, points])) == none
    assert not shows_no_frame(fit, points)


def test_a_point_read_by_a_station_of_unknown_place_shows_no_frame():
    station = np.eye(4)
    station[:3, 3] = 1.0, 2.0, 0.5
    point = replace(
        tables.points(np.ones((1, 6)), np.ones((1, 3)), sd=NOISE), station=np.ones(1, int)
    )
    for free, none in ((["station2.x"], True), ([], False)):
        fit = fit_with(CORNERS, [*free, *ANCHORS_FREE])
        fit.model.fixtures = Fixtures(anchors=CORNERS, stations=station[None])
        assert shows_no_frame(fit, joined([seen_from(CORNERS), point])) == none


@pytest.mark.parametrize(("places", "turns"), [(RAIL, True), (CORNERS, False)])
def test_a_turn_about_all_points_changes_no_distance(places, turns):
    """The turn itself: of tool points about the line through the first two."""
    rng = np.random.default_rng(1)
    at, axis = rng.normal(size=(20, 3)), places[1] - places[0]
    turned = (at - places[0]) @ exp_so3(0.3 * axis / np.linalg.norm(axis)).T + places[0]
    assert np.linalg.norm(turned - at, axis=1).min() > 0.01
    before, after = (np.linalg.norm(x[:, None] - places, axis=2) for x in (at, turned))
    assert np.allclose(before, after, rtol=0, atol=1e-12) == turns  # rounding
    assert shows_no_frame(fit_with(places, ["base.x"]), seen_from(places)) == turns


def campaign(seed):
    """Distances of a true arm from four points of unknown place: true arm, result, held out."""
    rng = np.random.default_rng([seed, 5])
    beside = Fixtures(anchors=CORNERS)
    nominal = RobotModel(Chain(TX60_LINKS), fixtures=beside)
    of_links = np.array(["." not in name for name in nominal.names])
    true = nominal.moved(4e-4 * of_links * rng.normal(size=len(of_links)))  # m, rad
    q = kinds.joints("tx60", rng, 70)
    p, parts = true.poses(q)[:, :3, 3], []
    for k, place in enumerate(CORNERS):
        d = np.linalg.norm(p - place, axis=1) + rng.normal(size=len(q)) * NOISE
        parts.append(tables.distances(q, d, sd=NOISE, anchor=k))
    table = joined([replace(part, pose_id=np.arange(len(q))) for part in parts])
    test = table.pose_id >= 45
    found = calibrate(nominal, table.rows(~test), free_tool=False, free_anchors=range(4))
    return true, found, table.rows(test)


def aligned(seen, places, others):
    """Other points moved as the rigid motion that moves seen points (n, 3) best onto places."""
    return transform_points(fitted_frame(places, seen, np.eye(3)), others)


def test_rows_are_what_a_motion_onto_the_points_leaves_of_each_number():
    """By Procrustes' closed form and finite steps, at postures that took no part."""
    _, found, _ = campaign(0)
    fit, rng, target = found.identification, np.random.default_rng(2), ToolTarget((0.1, 0, 0.05))
    datum, model = inner_datum(fit, found.measured, target), fit.model
    first = np.unique(found.measured.pose_id, return_index=True)[1]
    there, q = found.measured.q[first], kinds.joints("tx60", rng, 12)
    T, J = model.poses_and_jacobian(q)
    rows = datum.relative(*target.positions_and_rows(model, T, J))
    before, step = (target.positions(model, model.poses(x)) for x in (there, q)), 1e-6
    at, free = tuple(before), 0.0
    for number in (*range(6), 7, 12, 20, 25):
        moved = model.moved(step * np.eye(model.n_numbers)[number])
        after = [target.positions(moved, moved.poses(x)) for x in (there, q)]
        left = (aligned(after[0], at[0], after[1]) - at[1]) / step
        # one-sided differences of 1e-6: some 1e-6 of lengths of 1 m
        np.testing.assert_allclose(rows[:, :, number], left, rtol=0, atol=1e-5)
        free = max(free, float(np.abs(left).max()))
    assert free > 0.1
    # moving the base moves everything alike
    assert np.abs(rows[:, :, :6]).max() < 1e-12


@pytest.mark.slow
def test_regions_hold_true_points_once_these_are_moved_onto_the_identified_ones():
    """Robots are the unit; in the base the points are off by what the links were, which none tell.

    Rigid arms that only noise keeps from being found: parameters alone hold 95 %.
    """
    shares, alone, ratios, in_base = [], [], [], []
    for seed in range(ROBOTS):
        true, found, test = campaign(seed)
        judged = found.judge(test)
        belief, model = judged.belief, found.identification.model
        assert belief is not None
        assert belief.datum is not None
        assert (belief.n_guards, belief.n_ranged) == (0, 25)
        assert DATUM in judged.trust.sentences
        assert "in the frame that fits the tool points best" in judged.point.sentence
        q = kinds.joints("tx60", np.random.default_rng([seed, 6]), 100)
        first = np.unique(found.measured.pose_id, return_index=True)[1]
        seen, own = (m.poses(found.measured.q[first])[:, :3, 3] for m in (true, model))
        points = true.poses(q)[:, :3, 3]
        truth, stated = aligned(seen, own, points), belief.regions(q)
        shares.append(stated.holds(truth).mean())
        none = replace(belief, misfit=replace(belief.misfit, upper=0.0), factor=K3)
        alone.append(none.regions(q).holds(truth).mean())
        errors = np.linalg.norm(stated.position - truth, axis=1)
        ratios.append(judged.point.radius_mean / np.quantile(errors, 0.95))
        in_base.append(np.linalg.norm(stated.position - points, axis=1).mean())
    assert min(shares) >= 0.95
    error = np.std(alone, ddof=1) / np.sqrt(ROBOTS)
    assert abs(np.mean(alone) - 0.95) < 3 * error
    # the misfit that may hide, and what is told least, make it wider than the errors; not by much
    assert 1 < np.median(ratios) < 3
    assert np.median(in_base) > 1e-4


def test_held_out_distances_widen_the_factor_where_they_are_further_off_than_stated():
    """Put together again, by scipy's distributions; then all are off four times as far."""
    _, found, test = campaign(1)
    belief = found.judge(test).belief
    assert belief is not None
    seen = predict(belief.model, test)
    growth = belief.proven.applies(test.q).growth
    each = []
    for A, r, more in zip(seen.rows[:, 0], seen.residual[:, 0], growth, strict=True):
        own = A[belief.misfit.shape.columns] * belief.misfit.shape.sd
        hidden = belief.misfit.upper**2 * more
        V = A @ (belief.covariance + hidden * belief.misfit_covariance) @ A + hidden * own @ own
        z = abs(r) / np.sqrt(V + NOISE**2)
        each.append(np.sqrt(chi2.isf(2 * norm.sf(z), 3)))
    worst = test.largest_of_poses(np.array(each))
    rare = worst > K3
    # of the four distances of a pose the worst, as one alone is that chance makes as rarely
    worst[rare] = np.sqrt(chi2.isf(1 - chi2.cdf(worst[rare] ** 2, 3) ** 4, 3))
    # no direction but theirs is guarded: the misfit is bounded as where nothing guards
    strict = misfit(found.identification, found.measured, test, drop=UNGUARDED_DROP)
    assert belief.misfit.upper == strict.upper
    drawn, alone = scores_of_distances(belief, test)
    # the largest of some 100 normal numbers has a tail of 1e-3: twelve digits of it are left
    np.testing.assert_allclose(alone, worst, rtol=1e-9)
    rows = test.pose_id == np.unique(test.pose_id)[:, None]
    near = np.abs(np.where(rows, each, np.inf) - drawn[:, None]).min(axis=1)
    np.testing.assert_allclose(near, 0, atol=1e-9)
    # 25 poses: 95 % of them and one more ask for the largest
    assert belief.factor == max(K3, drawn.max(), alone.max())
    # noise that repeats show to be twice as large is in what they are compared with
    louder = replace(belief, misfit=replace(belief.misfit, noise_scale=2.0, repeated=True))
    loud = replace(test, covariance=4 * test.covariance)
    np.testing.assert_array_equal(
        scores_of_distances(louder, test), scores_of_distances(belief, loud)
    )
    off = replace(test, distance=test.distance + 4 * seen_errors(belief.model, test))
    wider = adding(belief, np.zeros_like(belief.covariance), off)
    assert wider.factor == scores_of_distances(belief, off).max() > 1.5 * belief.factor


def seen_errors(model, table):
    """Measured minus predicted distances (m,) [m]."""
    return predict(model, table).residual[:, 0]


def test_each_pose_is_counted_once_in_the_frame_of_the_point_that_is_stated():
    _, found, test = campaign(0)
    fit, table, point = found.identification, found.measured, (0.1, 0.0, 0.05)
    datum = inner_datum(fit, table, ToolTarget(point))
    # all four distances of half of the poses, and one of each other
    some = inner_datum(
        fit, table.rows((table.pose_id < 20) | (table.anchor == 0)), ToolTarget(point)
    )
    np.testing.assert_allclose(some.motion, datum.motion, rtol=0, atol=1e-12)
    stated = believe(fit, table, test, target=point, drawn=False)
    np.testing.assert_array_equal(stated.datum.motion, datum.motion)
    assert stated.n_ranged == 0  # designed poses widen nothing


def test_held_out_points_show_no_frame_to_what_was_identified_without_them():
    """In the base, true points were off by .5 mm where R95 was .23 mm."""
    true, found, _ = campaign(2)
    q = kinds.joints("tx60", np.random.default_rng(4), 1)
    point = tables.points(q, true.poses(q)[:, :3, 3], sd=NOISE)
    belief = found.judge(replace(point, pose_id=point.pose_id + 100)).belief
    assert belief is not None
    assert belief.datum is not None


def test_what_is_left_of_a_wave_is_counted_beside_a_motion_of_everything():
    """Whole: distances of an arm with a tiny wave, identified; then points at other postures."""
    _, found, _ = campaign(0)
    fit, size, rng = found.identification, 1e-6, np.random.default_rng(3)
    target, table = ToolTarget(), found.measured
    first = np.unique(table.pose_id, return_index=True)[1]
    q = kinds.joints("tx60", rng, 30)
    datum = inner_datum(fit, table, target)
    proven = proven_at(fit, table, q, datum=datum)
    np.testing.assert_array_equal(proven.left(q).mean(axis=1), proven.usual)
    term = [proven.wide.names[k] for k in proven.columns].index("harmonic3.cos2")
    part = [term, -1]
    own = replace(
        proven,
        columns=proven.columns[[term]],
        absorbed=proven.absorbed[:, part],
        of_terms=replace(proven.of_terms, motion=proven.of_terms.motion[:, part]),
    )
    amplitude = np.zeros(proven.wide.n_numbers)
    amplitude[proven.columns[term]] = size
    waving = proven.wide.moved(amplitude)
    p = waving.poses(table.q)[:, :3, 3]
    anchors = waving.fixtures.anchors[table.anchor]
    seen = replace(table, distance=np.linalg.norm(p - anchors, axis=1))
    again = identify(fit.model, seen, fit.parameters).model
    at, here = (model.poses(table.q[first])[:, :3, 3] for model in (waving, again))
    errors = aligned(at, here, waving.poses(q)[:, :3, 3]) - again.poses(q)[:, :3, 3]
    left = (errors**2).sum(axis=1) / size**2
    # what 1 urad does to second order, some 1e-6 of it, and rounding of distances, 1e-16 / 1e-6
    np.testing.assert_allclose(own.left(q)[0], left, rtol=1e-5)
    # in the base it is more or less, by the motion of everything
    assert np.abs(replace(own, datum=None).left(q)[0] / left - 1).max() > 0.1
