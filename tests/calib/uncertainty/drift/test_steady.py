"""A steady drift that sorted poses hide: how large it may be, and what it leaves."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.stats

from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.prior import Prior
from calib.measurement.observations import joined
from calib.measurement.prediction import predict
from calib.uncertainty.drift.drifting import AGAIN, SURE, Drifting, drifting
from calib.uncertainty.drift.memory import SlowDrift
from calib.uncertainty.drift.steady import BENT, HIDDEN, SIZES, SteadyDrift, _course, steady_drift
from calib.uncertainty.statement.believe import adding, believe
from calib.uncertainty.statement.gain import estimator_gain
from calib.uncertainty.statement.misfit import DROP, misfit
from tests.calib import kinds

TX60 = RobotModel(kinds.ARMS["tx60"])
M, N = 60, 20


def in_front(rng, m):
    """Joints (m, 6) with the flange above the table, not below the arm and not stretched."""
    q = rng.uniform(-1, 1, (8 * m, 6)) * np.radians([90, 100, 120, 150, 110, 170])
    p = TX60.poses(q)[:, :3, 3]
    far = np.hypot(p[:, 0], p[:, 1])
    return q[(p[:, 2] > -0.15) & (far > 0.2) & (far < 0.62)][:m]


def campaign(seed, way, *, size=0.0, again=0, more=200):
    """What `drifting` is asked of, and true points of the mean of the session.

    Poses seen as points; the station goes `size` [m] some way from the first row to the last. The
    first poses come `again` at the end.
    """
    rng = np.random.default_rng([seed, 83])
    true = replace(kinds.true_robot("tx60", rng), fixtures=kinds.Fixtures())
    q = in_front(rng, M + N + more)
    order = np.argsort(np.argsort(q[: M + N, 0])) if way == "sorted" else rng.permutation(M + N)
    along = rng.normal(size=3)
    row = np.append(np.arange(M + N), np.argsort(order)[:again])
    order = np.append(order, M + N + np.arange(again))
    table = kinds.points(true, q[row], rng)
    drift = size * (order / order.max() - 0.5)[:, None] * along / np.linalg.norm(along)
    visit = np.arange(len(row)) // (M + N)
    table = replace(table, position=table.position + drift, pose_id=row, repeat=visit)
    held_out = np.isin(row, rng.permutation(M + N)[:N])
    train, test = table.rows(~held_out), table.rows(held_out)
    near = replace(true, chain=replace(true.chain, links=kinds.ARMS["tx60"].links))
    parameters = parameters_of(near)
    fit = identify(near, train, parameters)
    T = true.poses(q[M + N :])
    points = T[:, :3, 3] + T[:, :3, :3] @ kinds.OFFSET
    return (fit, train, order[~held_out], test, order[held_out]), q[M + N :], points


def shares(seed, way, **settings):
    """The answer, and the shares of true points in the region with a drift that forgets, and with a
    steady one as well, whose root mean square size is so many times as large."""
    asked, q, points = campaign(seed, way, **settings)
    plain = believe(asked[0], asked[1], asked[3], target=kinds.OFFSET)
    found = drifting(*asked, hidden=plain.misfit)
    slow = plain if found.drift is None else adding(plain, found.drift.covariance, asked[3])
    whole = plain if found.covariance is None else adding(plain, found.covariance, asked[3])
    there = [one.regions(q, target=kinds.OFFSET) for one in (slow, whole)]
    sizes = [float(np.sqrt(np.mean(one.point**2)) * one.factor) for one in there]
    return found, [one.holds(points).mean() for one in there], sizes[1] / sizes[0]


@pytest.mark.parametrize("seed", [1, 4, 8])
def test_a_region_holds_what_the_order_of_the_poses_hides(seed):
    """Sorted by the first joint, .3 mm over the session: it held 76, 86 and 70 % of the points."""
    found, (slow, whole), grown = shares(seed, "sorted", size=0.3e-3)
    assert found.void
    assert slow < 0.9
    assert whole > 0.95
    assert grown < 2
    assert found.steady.p_value < SURE
    assert found.hides_one
    # .3 mm some way: .17 mm per axis in the root mean square of three
    assert 0.1e-3 < found.steady.way < 0.3e-3


@pytest.mark.parametrize("seed", range(3))
def test_sorted_poses_of_a_still_station_are_hardly_stated_wider(seed):
    found, (_, whole), grown = shares(seed, "sorted")
    assert found.void
    assert found.drift is None
    assert not found.hides_one
    assert whole > 0.95
    assert grown < 1.15  # by what the noise leaves room for


@pytest.mark.parametrize("size", [0.0, 0.3e-3])
def test_a_random_order_hides_no_steady_drift(size):
    asked, *_ = campaign(1, "at random", size=size)
    hidden = believe(asked[0], asked[1], asked[3]).misfit
    assert steady_drift(*asked, shape=hidden.shape, misfit=hidden.best) is None
    assert drifting(*asked, hidden=hidden).steady is None


def test_of_few_poses_in_a_random_order_nothing_is_asked():
    """Where hardly a freedom is left, the numbers take most of any drift."""
    (fit, train, order, test, theirs), *_ = campaign(1, "at random")
    some = np.argsort(order)[::4]
    few = train.rows(some)
    fit = identify(fit.model, few, fit.parameters)
    hidden = believe(fit, few).misfit
    asked = fit, few, order[some], test.rows(theirs < 0), theirs[:0]
    assert steady_drift(*asked, shape=hidden.shape, misfit=hidden.best).hidden > HIDDEN
    assert drifting(*asked, hidden=hidden).steady is None


def test_poses_that_come_again_at_the_end_show_it():
    """The first twelve once more: visits then tell the drift, and less of it is hidden."""
    asked, *_ = campaign(1, "sorted", size=0.3e-3, again=AGAIN)
    hidden = believe(asked[0], asked[1], asked[3]).misfit
    found = drifting(*asked, hidden=hidden)
    assert found.seen
    assert found.steady is None
    assert not found.hides_one


def test_rows_at_two_times_or_each_from_a_station_of_its_own_are_no_failure():
    """A bent drift is none there; nor is any, where each row may stand anywhere."""
    (fit, train, order, test, theirs), *_ = campaign(1, "sorted", size=0.3e-3)
    hidden = believe(fit, train, test).misfit
    size = {"shape": hidden.shape, "misfit": hidden.best}
    half = (M + N) // 2
    halves = steady_drift(fit, train, order // half, test, theirs // half, **size)
    assert HIDDEN < halves.hidden <= 1
    assert np.isfinite(halves.covariance).all()
    assert steady_drift(fit, train, 0 * order, test, 0 * theirs, **size) is None
    apart = replace(train, station=np.arange(len(train)))
    others = np.tile(fit.model.chain.T_world_base, (len(train) - 1, 1, 1))
    model = replace(fit.model, fixtures=kinds.Fixtures(stations=others))
    each = replace(fit, model=model, parameters=parameters_of(model, fit.names))
    assert steady_drift(each, apart, order, test.rows(theirs < 0), theirs[:0], **size) is None


def test_a_drift_is_about_its_mean_over_the_rows_of_each_station():
    """Stations stand somewhere of their own: what a drift is between two of them moves no base."""
    order, station = np.arange(50) + 7, np.repeat([0, 3], [20, 30])
    some = np.array([3, 25, 40])
    found = _course(order, station, order, station)
    for one in (0, 3):
        np.testing.assert_allclose(found[station == one].mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.diff(found[:20, 0]), 2 * np.sqrt(3) / 49, rtol=1e-12)
    np.testing.assert_array_equal(_course(order, station, order[some], station[some]), found[some])


@pytest.mark.parametrize(("size", "believed"), [(0.0, 0), (0.1e-3, 0), (0.1e-3, 8)])
def test_size_and_what_is_left_are_those_of_the_whole_covariance(size, believed):
    """Restricted likelihood in contrasts that no number moves, and the posterior of the drift.

    Some numbers are `believed` beforehand, which no drift moves.
    """
    (fit, train, order, test, theirs), *_ = campaign(3, "sorted", size=size)
    links = np.arange(6, 6 + believed)  # behind the base
    if believed:
        sd = np.full(believed, 1e-5)
        prior = Prior(sd, sd, tuple(fit.names[k] for k in links))
        fit = identify(fit.model, train, fit.parameters, prior=prior)
    shape, misfit_size = misfit(fit, train, test).shape, 7e-6
    found = steady_drift(fit, train, order, test, theirs, shape=shape, misfit=misfit_size)
    both, place = joined([train, test]), np.concatenate([order, theirs])
    seen, t = predict(fit.model, both), 2 * place / (M + N - 1) - 1
    own = shape.rows(seen.rows[:, :3])
    noise = both.covariance[:, :3, :3] + misfit_size**2 * own @ np.swapaxes(own, 1, 2)
    V = scipy.linalg.block_diag(*noise, np.eye(believed))
    off = 1 - fit.step[links] / 1e-5
    y = np.concatenate([seen.residual[:, :3].ravel(), off])
    course = np.stack([np.sqrt(3) * t, BENT * np.sqrt(5) * (1.5 * t**2 - 0.5)], axis=1)
    course -= course.mean(axis=0)
    D = np.einsum("mp,ij->mipj", course, np.eye(3)).reshape(3 * (M + N), -1)
    A = seen.rows[:, :3, fit.parameters.free_index].reshape(len(D), -1)
    D = np.concatenate([D, np.zeros((believed, D.shape[1]))])
    A = np.concatenate([A, 1e5 * np.eye(A.shape[1])[links]]) * fit.parameters.free_scale
    Z = scipy.linalg.null_space(A.T)

    def likelihood(sd):
        W = Z.T @ (V + sd**2 * D @ D.T) @ Z
        r = Z.T @ y
        return -0.5 * (np.linalg.slogdet(W)[1] + r @ np.linalg.solve(W, r))

    tried = np.append(0.0, kinds.NOISE * SIZES)
    value = np.array([likelihood(sd) for sd in tried])
    sd = tried[np.flatnonzero(value >= value.max() - DROP)[-1]]
    assert found.sd == pytest.approx(sd, rel=1e-12)
    gain = value.max() - value[0]
    assert found.p_value == pytest.approx(scipy.stats.chi2.sf(2 * gain, 1) / 2, rel=1e-6)
    inner = Z @ np.linalg.inv(Z.T @ V @ Z) @ Z.T  # what the numbers leave
    C = np.linalg.inv(D.T @ inner @ D + np.eye(D.shape[1]) / sd**2)
    c = C @ D.T @ inner @ y
    taken = 1 - scipy.linalg.eigvalsh(D.T @ inner @ D, D.T @ np.linalg.inv(V) @ D)
    assert found.hidden == pytest.approx(taken.max(), rel=1e-6)
    assert found.hidden > HIDDEN
    F = estimator_gain(fit, train)[:, :, :3]
    left = np.einsum("mfi,mp->fpi", F, course[: len(train)]).reshape(F.shape[1], -1)
    expected = left @ (np.outer(c, c) + C) @ left.T
    index = fit.parameters.free_index
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # 1e-6: both solve systems of condition 1e6 or so in float64, by other ways
    np.testing.assert_allclose(
        found.covariance[np.ix_(index, index)] / size, expected / size, atol=1e-6
    )
    J = seen.rows[: len(train), :3, index]
    at_tool = np.sqrt(np.trace(J @ expected @ np.swapaxes(J, 1, 2), axis1=1, axis2=2).mean())
    assert found.at_tool == pytest.approx(at_tool, rel=1e-6)


def test_what_the_region_has_of_it_is_said():
    nothing = np.zeros((1, 1))
    steady, slow = SteadyDrift(30e-6, 0.001, 0.9, 40e-6, nothing), SlowDrift(5e-6, 30.0, nothing)
    words = (
        "a steady drift of up to 104 um per axis from the first row to the last, by which tool "
        "points may be off by 40 um (root mean square)"
    )
    alone = Drifting(np.nan, None, of_visits=True, steady=steady)
    assert f"; the region includes {words}; a second round in" in alone.sentence
    assert alone.sentence.endswith(
        "; the first 12 poses once more at the end would show the steady one"
    )
    both = Drifting(np.nan, slow, of_visits=True, steady=steady)
    assert (
        f"the region includes one of up to 5.0 um per axis over 30 rows, and {words};"
        in both.sentence
    )
    seen = Drifting(0.5, None, of_visits=True, steady=steady)
    assert seen.sentence.endswith(f"shows no drift (p = 0.5); the region includes {words}")
    assert not seen.hides_one
    assert Drifting(0.5, None).covariance is None
