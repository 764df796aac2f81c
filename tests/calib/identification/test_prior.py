"""Identification under a prior: against scipy, against Bayes written out, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import transform
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.identify import Identification, Status, identify
from calib.identification.prior import Prior, prior_rows, step_derivative, weak_prior
from calib.identification.tangent import System
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize
from calib.uncertainty.judgement import judge
from calib.uncertainty.statement.evidence import believed_before
from tests.calib.slopes import slopes
from tests.reference import BASE6, DEG, READABLE30, TX60_LINKS, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

POOL = pool_r()
HELD_OUT = POOL[500:800]


def table(seed: int, m: int = 29, truth: RobotModel | None = None) -> Measurements:
    rng = np.random.default_rng(seed)
    return measured(truth or rigid_truth(rng), POOL[:m], rng)


def correlated(k: int, seed: int, sd: Array) -> Array:
    """A precision whose numbers are correlated, each with about that sd."""
    root = np.random.default_rng(seed).normal(size=(k, 2 * k)) / np.sqrt(2 * k)
    return np.linalg.solve(sd[:, None] * (root @ root.T) * sd, np.eye(k))


def test_a_prior_in_units_is_the_diagonal_precision():
    prior = Prior([1e-3, 0.0], [2e-3, 0.5], ("a1", "theta1"))
    np.testing.assert_allclose(prior.precision, np.diag([2.5e5, 4.0]), rtol=1e-15)


def test_a_correlated_prior_knows_the_sd_of_each_number():
    P = correlated(5, 1, np.array([1e-3, 1e-4, 0.1, 1.0, 2.0]))
    prior = Prior.of_precision(np.zeros(5), P, tuple("abcde"))
    np.testing.assert_allclose(prior.sd, np.sqrt(np.diag(np.linalg.solve(P, np.eye(5)))), rtol=1e-9)
    again = Prior(prior.mean, prior.sd, prior.names, prior.precision)
    np.testing.assert_array_equal(again.precision, P)


def test_the_weak_prior_has_the_specified_units():
    """Angles .1 deg, lengths .6 mm, frames 1 mm and .1 deg, gravity 50 mdeg, harmonics 20, 12."""
    terms = JointErrors((*gravity_terms(6), *harmonic_terms(6)), np.zeros(27))
    model = RobotModel(tx60().chain, terms)
    prior = weak_prior(parameters_of(model), model)
    sd = dict(zip(prior.names, prior.sd, strict=True))
    expected = {
        "base.x": 1e-3, "tool.rz": 0.1 * DEG, "theta3": 0.1 * DEG, "a2": 0.6e-3, "d4": 0.6e-3,
        "beta2": 0.1 * DEG, "gravity2.fore": 0.05 * DEG, "harmonic5.cos1": 0.02 * DEG,
        "harmonic1.sin2": 0.012 * DEG,
    }  # fmt: skip
    for name, value in expected.items():
        assert sd[name] == pytest.approx(value, rel=1e-12)
    assert len(sd) == 69


def moved_by_scipy(x: Array) -> RobotModel:
    """A TX60 whose first 42 numbers are off by x, its frames made by scipy's own rotations."""
    frames = [transform(Rotation.from_rotvec(x[k + 3 : k + 6]).as_matrix(), x[k : k + 3])
              for k in (0, 36)]  # fmt: skip
    return RobotModel(
        Chain(TX60_LINKS + x[6:36].reshape(6, 5), T_world_base=frames[0], T_flange_tool=frames[1])
    )


def test_the_prior_counts_a_step_in_a_turned_frame_from_the_nominal_axes():
    """Against central differences of the whole step, far from the nominal frames."""
    x = np.zeros(42)
    x[:6], x[36:] = [0.3, -0.2, 0.1, 0.4, -0.7, 0.5], [0.1, 0.05, 0.2, -0.3, 0.9, 0.2]
    model = tx60().moved(x)
    numeric = slopes(lambda step: tx60().step_to(model.moved(step)), np.zeros(42))
    # central differences: h^2 from curvature, 1e-16/h from rounding
    np.testing.assert_allclose(step_derivative(x, model), numeric, atol=1e-9)


def scipy_map(seen: Measurements, prior: Prior, parameters: Parameters, start: Array) -> Array:
    """The stacked problem by scipy in absolute coordinates, by difference quotients."""
    index, unit = parameters.free_index, np.where(parameters.is_length[parameters.free], 1e-4, 1e-4)
    belief = [parameters.names.index(name) for name in prior.names]
    root = np.linalg.cholesky(prior.precision).T
    sigma = np.sqrt(np.diagonal(seen.covariance, axis1=1, axis2=2))

    def rows(y: Array) -> Array:
        x = np.zeros(42)
        x[index] = y * unit
        T = moved_by_scipy(x).poses(seen.q)
        turn = Rotation.from_matrix(seen.rotation @ np.swapaxes(T[:, :3, :3], 1, 2)).as_rotvec()
        r = np.hstack([seen.position - T[:, :3, 3], turn]) / sigma
        return np.concatenate([r.ravel(), root @ (prior.mean - x[belief])])

    tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    return least_squares(rows, start / unit, "3-point", method="lm", **tight).x * unit


@pytest.mark.parametrize("mounted", [0.0, 0.3], ids=["at the nominal frame", "0.3 rad away"])
def test_the_estimate_is_that_of_scipy_on_the_stacked_problem(mounted):
    """All 42 numbers with a correlated prior: the prior alone decides on the redundant twelve."""
    rng = np.random.default_rng(3)
    step = tx60().step_to(rigid_truth(rng))
    step[:6] += mounted * np.array([1, -1, 0.5, 0.4, -0.6, 0.7])
    seen = table(4, truth=tx60().moved(step))
    parameters = parameters_of(tx60())
    weak = weak_prior(parameters)
    sd = weak.sd * np.where(np.arange(42) < 6, 1 + 300 * mounted, 1)
    prior = Prior.of_precision(0.3 * sd, correlated(42, 5, sd), weak.names)
    ours = identify(tx60(), seen, parameters, prior=prior)
    theirs = scipy_map(seen, prior, parameters, step)
    # difference quotients leave 1e-5 of a posterior sd
    assert np.abs((ours.step - theirs) / ours.standard_uncertainty).max() < 1e-4
    assert ours.status is Status.CONVERGED
    assert ours.names == parameters.names


def written_out(found: Identification, seen: Measurements, prior: Prior) -> tuple[Array, Array]:
    """A of the free numbers at the answer and Lambda0, units 1e-4 m or rad."""
    A = linearize(found.model, seen).A[:, found.parameters.free_index] * 1e-4
    return A, prior.precision * 1e-8


def test_covariance_and_degrees_of_freedom_are_those_of_the_posterior():
    seen, parameters = table(6), parameters_of(tx60())
    prior = weak_prior(parameters)
    found = identify(tx60(), seen, parameters, prior=prior)
    A, precision = written_out(found, seen, prior)
    H = A.T @ A + precision
    np.testing.assert_allclose(1e8 * found.covariance @ H, np.eye(42), atol=1e-6)
    learned = float(np.trace(np.linalg.solve(H, A.T @ A)))
    assert found.dof_effective == pytest.approx(174 - learned, abs=1e-7)
    # thirty directions are told apart, all of them far better than the prior knows them
    assert 29.9 < learned < 30
    assert (found.dof, found.rank) == (144, 42)
    assert found.reduction.practical_rank == 30
    assert found.chi_square == pytest.approx(float(found.residual @ found.residual), rel=1e-12)
    assert len(found.residual) == 174


def test_evidence_is_the_density_that_the_prior_gives_the_measurements():
    """Near the nominal robot the model is linear: y is normal about A x0, I + A inv(Lambda0) A'."""
    seen, parameters = measured(tx60(), POOL[:12], np.random.default_rng(7)), parameters_of(tx60())
    weak = weak_prior(parameters)
    prior = Prior.of_precision(
        np.zeros(42), correlated(42, 8, weak.sd * 0.01), parameters.free_names
    )
    found = identify(tx60(), seen, parameters, prior=prior)
    stack = linearize(tx60(), seen)
    A, n = stack.A * 1e-4, len(stack.r)
    marginal = np.eye(n) + A @ np.linalg.solve(prior.precision * 1e-8, A.T)
    density = multivariate_normal(np.zeros(n), marginal).logpdf(stack.r)
    assert found.log_evidence == pytest.approx(density + n / 2 * np.log(2 * np.pi), abs=1e-3)


def test_predictions_under_a_weak_prior_are_those_of_the_identifiable_thirty():
    """MAP of all 42 against the readable 30: at most 1e-4 mm on other poses."""
    seen, parameters = table(9), parameters_of(tx60())
    plain = identify(tx60(), seen, parameters).model.poses(HELD_OUT)[:, :3, 3]
    prior = weak_prior(parameters)
    found = identify(tx60(), seen, parameters, prior=prior).model.poses(HELD_OUT)[:, :3, 3]
    shift = np.linalg.norm(found - plain, axis=1)
    assert 1e-12 < shift.max() < 1e-6
    assert shift.mean() < 1e-7


def test_two_calibrations_in_turn_are_one_of_both_tables():
    """The first one's answer as the prior of the second; links only, where steps add."""
    truth = rigid_truth(np.random.default_rng(10))
    one, two = (measured(truth, POOL[k : k + 20], np.random.default_rng(k)) for k in (100, 200))
    fields = ("q", "position", "rotation", "covariance", "kind", "offset", "pose_id", "repeat")
    both = Measurements(*(np.concatenate([getattr(one, f), getattr(two, f)]) for f in fields))
    parameters = parameters_of(tx60(), WEN24)
    first = identify(tx60(), one, parameters)
    A = linearize(first.model, one).A[:, parameters.free_index]
    prior = Prior.of_precision(first.step, A.T @ A, first.names)
    second = identify(tx60(), two, parameters, prior=prior)
    whole = identify(tx60(), both, parameters)
    # the first table's curvature is frozen where it ended: second order in a few sd
    assert np.abs((second.step - whole.step) / whole.standard_uncertainty).max() < 1e-3
    unit = np.outer(whole.standard_uncertainty, whole.standard_uncertainty)
    np.testing.assert_allclose(second.covariance / unit, whole.covariance / unit, atol=1e-3)


def test_a_prior_of_correlated_numbers_is_believed_in_the_judgement_as_in_the_fit():
    """As rows beside those of the readings: their squares and products are those of the prior."""
    truth = rigid_truth(np.random.default_rng(10))
    one, two, test = (
        measured(truth, POOL[k : k + 20], np.random.default_rng(k)) for k in (100, 200, 300)
    )
    parameters = parameters_of(tx60(), WEN24)
    first = identify(tx60(), one, parameters)
    A = linearize(first.model, one).A[:, parameters.free_index]
    order = np.random.default_rng(0).permutation(len(first.names))
    precision = (A.T @ A)[np.ix_(order, order)]
    prior = Prior.of_precision(first.step[order], precision, [first.names[k] for k in order])
    found = identify(tx60(), two, parameters, prior=prior)
    rows = believed_before(found)
    off = prior.mean - found.step[order]
    assert np.square(rows.y).sum() == pytest.approx(off @ precision @ off, rel=1e-9)
    told = (rows.A.T @ rows.A / np.outer(*[parameters.free_scale] * 2))[np.ix_(order, order)]
    assert np.abs(told - precision).max() < 1e-12 * precision.max()
    judged = judge(found, test, train=two)
    assert judged.trust.believe == "region"
    T = (each.poses(test.q)[:, :3, 3] for each in (found.model, truth))
    assert np.linalg.norm(next(T) - next(T), axis=1).mean() < judged.point.radius_mean


@pytest.mark.parametrize("m", [1, 3, 29])
def test_any_number_of_poses_will_do_where_every_number_has_a_prior(m):
    seen, parameters = table(11, m), parameters_of(tx60())
    found = identify(tx60(), seen, parameters, prior=weak_prior(parameters))
    assert found.status is Status.CONVERGED
    assert found.rank == 42
    assert 0 < found.dof_effective < 6 * m
    prior = weak_prior(parameters).sd
    assert (found.standard_uncertainty <= prior * (1 + 1e-9)).all()


def test_a_number_without_a_prior_is_never_invented():
    """theta1 and base.rz look alike: the prior on one frees the other; d2 and d3 have none."""
    seen = table(12)
    parameters = parameters_of(tx60())
    prior = Prior([0.0], [0.01 * DEG], ("theta1",))
    found = identify(tx60(), seen, parameters, prior=prior)
    assert set(found.names) == {*READABLE30, "theta1"}
    theta1 = found.standard_uncertainty[found.names.index("theta1")]
    # nothing but the prior tells theta1
    assert theta1 == pytest.approx(0.01 * DEG, rel=1e-6)
    assert np.isnan(found.log_evidence)
    assert found.reduction.dropped == identify(tx60(), seen, parameters).reduction.dropped
    covariance = found.full_covariance
    assert covariance[parameters.names.index("d2")].any() == np.False_


def test_numbers_without_a_prior_still_need_enough_poses():
    parameters = parameters_of(tx60())
    prior = weak_prior(parameters.freeing(BASE6))
    with pytest.raises(InputError, match="measure at least") as caught:
        identify(tx60(), table(13, 3), parameters, prior=prior)
    assert caught.value.code == "M27"


def test_a_tight_prior_holds_a_number_and_a_loose_one_leaves_it_to_the_data():
    seen, parameters = table(14), parameters_of(tx60(), WEN24)
    plain = identify(tx60(), seen, parameters)
    for sd, share in ((1e-9, 0.0), (1e3, 1.0)):
        prior = Prior(np.zeros(24), np.full(24, sd), parameters.free_names)
        found = identify(tx60(), seen, parameters, prior=prior)
        gap = np.abs(found.step - share * plain.step) / plain.standard_uncertainty
        assert gap.max() < 1e-3


def test_order_of_the_priors_names_does_not_matter():
    seen, parameters = table(15), parameters_of(tx60(), WEN24)
    sd = weak_prior(parameters).sd * 1e-2
    P, turn = correlated(24, 16, sd), np.random.default_rng(17).permutation(24)
    names = np.array(parameters.free_names)
    one, two = (
        identify(tx60(), seen, parameters, prior=Prior.of_precision(sd[o], P[o][:, o], names[o]))
        for o in (np.arange(24), turn)
    )
    np.testing.assert_allclose(two.step, one.step, atol=1e-8 * one.standard_uncertainty.min())


def test_the_prior_rows_are_the_prior():
    parameters = parameters_of(tx60())
    weak = weak_prior(parameters)
    prior = Prior.of_precision(0.1 * weak.sd, correlated(42, 18, weak.sd), weak.names)
    rows = prior_rows(prior, tx60(), parameters)
    r, A = rows.at(tx60())
    np.testing.assert_allclose(A.T @ A, prior.precision, rtol=1e-9, atol=1e-3)
    assert r @ r == pytest.approx(prior.mean @ prior.precision @ prior.mean, rel=1e-10)


@pytest.mark.parametrize("alone", [True, False], ids=["independent", "correlated"])
def test_rows_of_one_number_each_count_as_those_of_a_whole_matrix(alone):
    """About a turned base, in whose frame a small step is not one of the believed numbers."""
    parameters, weak = parameters_of(tx60()), weak_prior(parameters_of(tx60()))
    precision = np.diag(weak.sd**-2.0) if alone else correlated(42, 18, weak.sd)
    rows = prior_rows(Prior.of_precision(weak.sd, precision, weak.names), tx60(), parameters)
    rng = np.random.default_rng(4)
    model, columns = tx60().moved(0.1 * rng.normal(size=42)), np.arange(42)
    r, A = rng.normal(size=50), rng.normal(size=(50, 42))
    system = System(r, A, rows.beside(model, columns))
    both = [np.concatenate(pair) for pair in zip((r, A), rows.at(model), strict=True)]
    expected = both[1].T @ both[1], both[0] @ both[1], both[0] @ both[0]
    for seen in (system.normal, (system.whole[1].T @ system.whole[1], *system.normal[1:])):
        for one, other in zip(seen, expected, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())
    assert np.count_nonzero(system.believed.slope) == (30 if alone else 0)  # but for two frames


BAD = {
    "zero sd": (lambda: Prior([0.0], [0.0], ("a1",)), "A3", "sd", "hold a number fixed"),
    "negative sd": (lambda: Prior([0.0], [-1.0], ("a1",)), "A3", "sd", "hold a number fixed"),
    "sd of nan": (lambda: Prior([0.0], [np.nan], ("a1",)), "A2", "sd", "finite"),
    "infinite sd": (lambda: Prior([0.0], [np.inf], ("a1",)), "A2", "sd", "finite"),
    "mean of nan": (lambda: Prior([np.nan], [1.0], ("a1",)), "A2", "mean", "finite"),
    "too few sds": (lambda: Prior([0.0, 0.0], [1.0], ("a1", "a2")), "A1", "sd", "shape"),
    "empty": (lambda: Prior([], [], ()), "A3", "names", "at least one"),
    "twice": (lambda: Prior([0, 0], [1, 1], ("a1", "a1")), "A3", "names", "a1 twice"),
    "indefinite": (
        lambda: Prior.of_precision([0, 0], [[1, 2], [2, 1]], ("a1", "a2")),
        "A3", "precision", "positive definite",
    ),
    "semidefinite": (
        lambda: Prior.of_precision([0, 0], [[1, 1], [1, 1]], ("a1", "a2")),
        "A3", "precision", "leave numbers out",
    ),
    "nothing known": (
        lambda: Prior.of_precision([0, 0], np.diag([1.0, 0.0]), ("a1", "a2")),
        "A3", "precision", "leave numbers out",
    ),
    "lopsided": (
        lambda: Prior.of_precision([0, 0], [[1, 0.5], [0, 1]], ("a1", "a2")),
        "A3", "precision", "symmetric",
    ),
    "precision of nan": (
        lambda: Prior.of_precision([0.0], [[np.nan]], ("a1",)), "A2", "precision", "finite",
    ),
    "two stories": (
        lambda: Prior([0.0], [1.0], ("a1",), [[4.0]]), "A3", "sd", "Prior.of_precision",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD, ids=str)
def test_a_prior_that_is_none_is_refused_with_the_remedy(case):
    make, code, field, words = BAD[case]
    with pytest.raises(InputError) as caught:
        make()
    assert (caught.value.code, caught.value.field) == (code, field)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("name", "words"),
    [("thetta1", 'did you mean "theta1"?'), ("d2", "free it"), ("q", "see the model's names")],
)
def test_a_prior_on_what_is_not_free_is_refused(name, words):
    with pytest.raises(InputError, match=words.replace("?", r"\?")) as caught:
        identify(
            tx60(), table(19), parameters_of(tx60(), WEN24), prior=Prior([0.0], [1.0], (name,))
        )
    assert (caught.value.code, caught.value.field, caught.value.value) == ("A4", "prior", name)


def test_paper_mode_takes_no_prior():
    parameters = parameters_of(tx60(), WEN24)
    with pytest.raises(InputError, match='use the mode "whitened"') as caught:
        identify(tx60(), table(20), parameters, mode="paper", prior=weak_prior(parameters))
    assert caught.value.field == "prior"


@pytest.mark.parametrize("loss", ["squared", "huber"])
def test_noise_of_zero_is_refused_by_its_eigenvalue(loss):
    seen = table(21)
    covariance = seen.covariance.copy()
    covariance[5, 2, 2] = 0
    with pytest.raises(InputError, match="standard deviation above zero") as caught:
        identify(tx60(), replace(seen, covariance=covariance), parameters_of(tx60()), loss=loss)
    assert (caught.value.code, caught.value.field) == ("M34", "covariance")
    assert "[5]" in str(caught.value)
