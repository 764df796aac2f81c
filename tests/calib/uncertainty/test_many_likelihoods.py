"""The likelihood of a misfit by few systems and polynomials, held to that of a system per size."""

import numpy as np
import pytest

from calib.uncertainty.many.likelihoods import ALIKE, POOLS, likelihoods_between, pooled
from calib.uncertainty.statement.evidence import NoiseRepeats, PositionRows
from calib.uncertainty.statement.likelihood import HOPELESS, likelihood
from calib.uncertainty.statement.misfit import DROP

ASKED = ((20, 0.0, 0), (20, 3.0, 0), (20, 300.0, 0), (20, 0.5, 20), (21, 0.5, 21))
"""Numbers, sizes of misfit and rows of a prior of tables that are asked together."""


def rows(n, p, size, spread, *, priors=0, seed=1):
    """Rows with a misfit of some size whose shares differ by `spread`, and those of a prior."""
    rng = np.random.default_rng(seed)
    lam = np.exp(rng.uniform(-spread, spread, n) / 2)
    y = rng.normal(size=n) * np.sqrt(1 + size**2 * lam)
    A = rng.normal(size=(n, p)) * np.exp(rng.uniform(0, 4, p))
    root = np.triu(rng.normal(size=(priors, p))) / 4 + 3 * np.eye(priors, p)
    before = PositionRows(root, rng.normal(size=priors), np.zeros(priors), 0.0)
    return PositionRows(A, y, lam, float(n)), before if priors else None


def between(own, before=None):
    """The likelihood of one table."""
    (found,) = likelihoods_between([own], np.ones(1), [before])
    return found


@pytest.mark.parametrize(("size", "spread"), [(0.0, 1.6), (0.5, 0.0), (3.0, 6.0), (300.0, 2.0)])
@pytest.mark.parametrize(("p", "priors"), [(20, 0), (20, 20), (20, 7), (80, 80)])
def test_few_sizes_say_what_all_say(size, spread, p, priors):
    """By numbers, with prior or without, and by rows. Limits to what a fall of 1e-9 moves them."""
    own, before = rows(90, p, size, spread, priors=priors)
    found, every = between(own, before), likelihood(own, 1.0, None, before)
    near = every.value > every.value.max() - 5
    fallen = [one.value[near] - one.value.max() for one in (found, every)]
    assert fallen[0] == pytest.approx(fallen[1], abs=3e-9)
    assert found.value.argmax() == every.value.argmax()
    np.testing.assert_array_equal(found.size, every.size)
    np.testing.assert_array_equal(found.noise_scale[near], every.noise_scale[near])
    assert found.limit(DROP) == pytest.approx(every.limit(DROP), rel=1e-9)


def test_tables_asked_together_have_their_own_likelihoods_in_any_order():
    """Of other sizes, with a prior or none; one has too few rows. The same to the bit."""
    made = [rows(90, p, size, 1.6, priors=k, seed=p) for p, size, k in ASKED]
    made.insert(2, rows(6, 6, 0.0, 1.0))
    units = np.linspace(1.0, 2.0, len(made))
    together = likelihoods_between([own for own, _ in made], units, [one for _, one in made])
    for (own, before), unit, found in zip(made, units, together, strict=True):
        (alone,) = likelihoods_between([own], np.array([unit]), [before])
        assert (found is None) is (alone is None) is (len(own.y) == 6)
        if found is not None:
            kept = found.value > found.value.max() - HOPELESS  # less is not looked at by each alike
            for name in ("size", "value", "noise_scale"):
                np.testing.assert_array_equal(
                    getattr(found, name)[kept], getattr(alone, name)[kept]
                )
            assert found.limit(DROP) == alone.limit(DROP)


def test_a_size_that_was_looked_at_keeps_how_unlikely_it_is():
    """Repeats that tell the noise, and rows without any misfit: the limit lies before the first."""
    rng = np.random.default_rng(4)
    A = rng.normal(size=(400, 2))
    own = PositionRows(A, np.zeros(400), np.full(400, 1e6), 400.0)
    found = likelihood(own, 1.0, NoiseRepeats(3000.0, 3000.0))
    fall = found.value[0] - found.value[1]
    # of 398 free rows, each with 1 + 0.03^2 1e6 times the variance of the noise
    assert fall == pytest.approx(398 / 2 * np.log1p(found.size[1] ** 2 * 1e6), rel=0.01)
    assert fall > 2 * HOPELESS
    assert found.limit(DROP) == pytest.approx(found.size[1] * np.sqrt(DROP / fall), rel=1e-9)


def test_rows_that_say_nothing_have_no_likelihood():
    few, none = rows(6, 6, 0.0, 1.0)
    assert none is None
    assert between(few) is None
    flat, _ = rows(40, 5, 1.0, 1.0)
    flat = PositionRows(flat.A, flat.y, np.zeros(40), flat.noise)
    assert between(flat).limit(DROP) == np.inf == likelihood(flat, 1.0, None).limit(DROP)


@pytest.mark.parametrize("spread", [0.0, 1.0, 2.0])
def test_few_sums_over_rows_serve_all_sizes(spread):
    """`pooled` promises 1e-12 of a weight; ten times that where weights are small."""
    own, _ = rows(90, 6, 1.0, spread)
    pools = pooled(own.A, own.lam)
    assert len(pools.lam) <= POOLS
    sizes = np.array([0.0, 0.1, 1.0, 30.0])
    for t, H in zip(sizes, pools.normal(sizes), strict=True):
        weighed = own.A.T @ (own.A / (1 + t**2 * own.lam)[:, None])
        np.testing.assert_allclose(H, weighed, rtol=0, atol=1e-11 * np.abs(weighed).max())
    wide, _ = rows(90, 6, 1.0, 9.0)  # shares that differ by a factor exp(9)
    assert pooled(wide.A, wide.lam) is None


@pytest.mark.parametrize("seed", range(3))
def test_a_second_peak_is_not_missed_behind_rows_that_deny_it(seed):
    """Two rows of small shares lie 20 standard deviations off; sixty of large ones are noise.

    Shares within the factor exp(`ALIKE`) alone would let the search end behind the first peak, with
    a limit of 0.1 for the first seed.
    """
    rng = np.random.default_rng(seed)
    lam, off = np.r_[np.full(60, 19.0), np.ones(2)], rng.choice([-1.0, 1.0], 2)
    assert lam.max() / lam.min() < np.exp(ALIKE)
    y = np.r_[rng.normal(size=60), 20.5 * off]
    own = PositionRows(1e-3 * rng.normal(size=(62, 2)), y, lam, 62.0)
    found, every = between(own), likelihood(own, 1.0, None)
    assert found.limit(DROP) == pytest.approx(every.limit(DROP), rel=1e-9)  # as above
    assert every.limit(DROP) > 1.0
