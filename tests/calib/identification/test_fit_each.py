"""Fits of many tables side by side, held to `identify`, to scipy and to what they say of each."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.identification import fit_each as module
from calib.identification.fit_each import Fits, fit_each
from calib.identification.identify import identify
from calib.identification.least_squares import Status
from calib.measurement.observations import joined
from calib.measurement.residual import linearize, paper_stack
from tests.reference import BASE6, TOOL6, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

POOL = pool_r()
WEN = parameters_of(tx60(), WEN24)
MODES = ("paper", "whitened")


def tables(count=8, seed=3, sizes=(29, 61)):
    """Visits of random sets of several sizes; every second robot is another one."""
    rng = np.random.default_rng(seed)
    robots = [rigid_truth(rng), rigid_truth(rng)]
    return [
        measured(robots[k % 2], POOL[rng.choice(len(POOL), sizes[k % len(sizes)])], rng)
        for k in range(count)
    ]


@pytest.mark.parametrize("mode", MODES)
def test_each_fit_is_the_one_that_identify_finds(mode):
    seen = tables()
    found = fit_each(tx60(), seen, WEN, mode=mode)
    assert found.status == (Status.CONVERGED,) * len(seen)
    # both stop when 1e-10 standard deviations are left, some 1e-13 m
    alone = [identify(tx60(), table, WEN, mode=mode) for table in seen]
    for k, one in enumerate(alone):
        assert (found.steps[k] - one.step) / one.standard_uncertainty == pytest.approx(0, abs=1e-9)
        assert found.models[k].poses(POOL[:5]) == pytest.approx(
            one.model.poses(POOL[:5]), abs=1e-12
        )
    # before the last step, which leaves a hundredth of that or its square
    assert (found.certificate < 1e-7).all()


@pytest.mark.parametrize("mode", MODES)
def test_plain_steps_are_enough_for_sets_of_the_paper_s_sizes(mode, monkeypatch):
    """The way of `identify` is closed: every fit must settle without it, and within few steps."""
    monkeypatch.setattr(module, "solve", None)
    assert fit_each(tx60(), tables(12), WEN, mode=mode).converged.all()
    monkeypatch.setattr(module, "known_to_many", lambda _: False)
    monkeypatch.setattr(module, "solve", None)
    monkeypatch.setattr(module, "FEW_STEPS", 8)
    assert fit_each(tx60(), tables(12), WEN, mode=mode).converged.all()


@pytest.mark.parametrize("mode", MODES)
def test_a_fit_depends_on_its_own_table_alone(mode):
    seen = tables(4)
    together = fit_each(tx60(), seen, WEN, mode=mode)
    backwards = fit_each(tx60(), seen[::-1], WEN, mode=mode)
    alone = fit_each(tx60(), seen[2:3], WEN, mode=mode)
    np.testing.assert_array_equal(together.steps, backwards.steps[::-1])
    np.testing.assert_array_equal(together.steps[2], alone.steps[0])


def test_base_and_tool_are_steps_from_nominal_as_identify_says():
    free = parameters_of(tx60(), (*BASE6, "a2", "alpha2", "theta3", "d3", *TOOL6))
    seen = tables(2)
    found = fit_each(tx60(), seen, free)
    for k, table in enumerate(seen):
        assert found.steps[k] == pytest.approx(identify(tx60(), table, free).step, rel=1e-9)


@pytest.mark.parametrize("mode", MODES)
def test_the_answer_is_the_minimum_that_scipy_finds(mode):
    (seen,) = tables(1)
    system = paper_stack if mode == "paper" else linearize

    def residual(x):
        return system(tx60().moved(WEN.expand(x * 1e-4)), seen).r

    # differences of its own instead of our derivatives: they leave 1e-5 of a deviation
    other = least_squares(residual, np.zeros(24), "3-point", method="lm", xtol=1e-15, ftol=1e-15)
    found = fit_each(tx60(), [seen], WEN, mode=mode)
    u = identify(tx60(), seen, WEN, mode=mode).standard_uncertainty
    assert (other.x * 1e-4 - found.steps[0]) / u == pytest.approx(0, abs=1e-4)
    assert np.square(residual(found.steps[0] * 1e4)).sum() <= 2 * other.cost * (1 + 1e-12)


def test_a_table_that_cannot_tell_is_said_and_bends_no_other():
    good = tables(2)
    few, alike = good[0].rows(range(3)), joined([good[0].rows([0])] * 29)
    found = fit_each(tx60(), [good[0], few, alike, good[1]], WEN)
    assert found.converged.tolist() == [True, False, False, True]
    assert found.status[1] is found.status[2] is Status.DEFICIENT
    assert found.steps[1:3] == pytest.approx(np.zeros((2, 24)))
    assert repr(found) == "Fits(4 fits, 2 converged)"
    apart = fit_each(tx60(), good, WEN)
    np.testing.assert_array_equal(found.steps[[0, 3]], apart.steps)


@pytest.mark.parametrize("mode", MODES)
def test_perfect_measurements_give_the_robot_back(mode):
    """Only rounding is left: the relative offset then says nothing, and is not asked."""
    step = np.linspace(-1, 1, 24) * 1e-3
    truth = tx60().moved(WEN.expand(step))
    found = fit_each(
        tx60(), [measured(truth, POOL[:29]), measured(truth, POOL[29:90])], WEN, mode=mode
    )
    assert found.converged.all()
    for own in found.steps:
        assert own == pytest.approx(step, abs=1e-13)


def test_where_plain_steps_do_not_settle_the_fit_goes_the_way_of_identify(monkeypatch):
    seen = tables(2)
    quick = fit_each(tx60(), seen, WEN)
    monkeypatch.setattr(module, "known_to_many", lambda _: False)
    alone = fit_each(tx60(), seen, WEN)
    assert alone.steps == pytest.approx(quick.steps, rel=1e-8, abs=1e-13)
    monkeypatch.setattr(module, "FEW_STEPS", 1)
    slow = fit_each(tx60(), seen, WEN)
    assert slow.converged.all()
    assert slow.steps == pytest.approx(quick.steps, rel=1e-9, abs=1e-14)
    monkeypatch.setattr(module, "MOST_STEPS", 1)
    stopped = fit_each(tx60(), seen, WEN)
    assert stopped.status == (Status.LIMIT,) * 2
    assert not stopped.converged.any()


def test_bad_input_is_refused_in_a_sentence():
    with pytest.raises(InputError, match="there is no table to fit"):
        fit_each(tx60(), [], WEN)
    with pytest.raises(InputError, match="no number is free"):
        fit_each(tx60(), tables(1), parameters_of(tx60(), ()))
    with pytest.raises(InputError, match='mode is "exact"'):
        fit_each(tx60(), tables(1), WEN, mode="exact")
    assert isinstance(fit_each(tx60(), tables(1), WEN), Fits)
