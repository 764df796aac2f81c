"""Fits and visits of many robots at once, beside one after the other; run by hand, one thread.

``pytest tests/bench/bench_many.py --benchmark-only``. Bars, each group's second beside its first
per robot or replication: whitened fits 50 times as quick, the paper's 25 times, visits 15 times;
extended fits 5 times, the likelihood of a misfit 4 times.
"""

import numpy as np
import pytest

from calib.identification.identify import identify
from calib.identification.ladders import ladders_of
from calib.identification.many.extended import extended_many
from calib.identification.many.fit import fit_many
from calib.identification.many.tables import ManyTables
from calib.identification.model_choice import extended_by
from calib.identification.prior import weak_prior
from calib.uncertainty.many.likelihoods import likelihoods_between
from calib.uncertainty.statement.evidence import PositionRows
from calib.uncertainty.statement.likelihood import likelihood
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.studies import load_scenario

MANY, POSES = 200, 29


@pytest.fixture(scope="module")
def bench():
    """The laboratory of the paper's scene."""
    scenario = load_scenario("wen2022")
    return open_laboratory(scenario, make_setting(scenario))


@pytest.fixture(scope="module", params=["whitened", "paper"])
def begun(request, bench):
    """Mode, tables of many visits, and the first of them identified."""
    q = bench.pool_q[:POSES]
    tables = bench.visits(q[None], "bench", count=MANY)
    first = identify(
        bench.setting.nominal, tables.one(0), bench.free(request.param), mode=request.param
    )
    return request.param, tables, first


@pytest.mark.benchmark(group="fit")
def test_one_fit(benchmark, bench, begun):
    mode, tables, first = begun
    seen, free = tables.one(1), first.parameters
    benchmark(identify, bench.setting.nominal, seen, free, mode=mode)


@pytest.mark.benchmark(group="fit")
def test_200_fits_at_once(benchmark, bench, begun):
    mode, tables, first = begun
    nominal, free = bench.setting.nominal, first.parameters
    found = benchmark(fit_many, nominal, tables, free, mode=mode, start=first.model)
    assert found.converged.all()


@pytest.mark.benchmark(group="fit, poses of their own")
def test_100_fits_at_once_of_sets_of_their_own(benchmark, bench):
    q = bench.pool_q[np.random.default_rng(0).integers(len(bench.pool_q), size=(100, POSES))]
    tables, free = bench.visits(q, "bench", count=len(q)), bench.free("paper")
    benchmark(fit_many, bench.setting.nominal, tables, free, mode="paper")


@pytest.mark.benchmark(group="visit")
def test_one_visit(benchmark, bench):
    q, ids = bench.pool_q[:POSES], np.arange(POSES)
    benchmark(bench.measure, q, ids, "bench")


@pytest.mark.benchmark(group="visit")
def test_200_visits_at_once(benchmark, bench):
    tables = benchmark(bench.visits, bench.pool_q[:POSES][None], "bench", count=MANY)
    assert isinstance(tables, ManyTables)


@pytest.fixture(scope="module")
def extended(bench):
    """What 25 robots are fitted by, each under noise of its own: geometry, sag and waves."""
    tables = bench.visits(bench.pool_q[:POSES][None], "bench", count=25)
    ladders = ladders_of(bench.setting.nominal)
    levels = [next(level for level in ladder.levels if level.usual) for ladder in ladders]
    factors = 1 + np.arange(25) / 10
    return [tables.one(k) for k in range(25)], levels, factors.tolist()


@pytest.mark.benchmark(group="extended fits of 25 robots")
def test_extended_fits_one_by_one(benchmark, bench, extended):
    nominal, free, (tables, levels, factors) = (
        bench.setting.nominal,
        bench.free("whitened"),
        extended,
    )
    prior = weak_prior(free, nominal)

    def each():
        for table, factor in zip(tables, factors, strict=True):
            extended_by(nominal, table, free, levels, prior=prior, factor=factor)

    benchmark.pedantic(each, rounds=3)


@pytest.mark.benchmark(group="extended fits of 25 robots")
def test_extended_fits_at_once(benchmark, bench, extended):
    nominal, free, (tables, levels, factors) = (
        bench.setting.nominal,
        bench.free("whitened"),
        extended,
    )
    prior = weak_prior(free, nominal)
    benchmark(
        extended_many, nominal, tables, free, [levels] * 25,
        prior=prior, factors=factors, starts=[None] * 25,
    )  # fmt: skip


@pytest.mark.benchmark(group="likelihood of a misfit of 25 robots, 69 numbers and their prior")
@pytest.mark.parametrize("together", [False, True])
def test_likelihood(benchmark, together):
    rng, n, p = np.random.default_rng(3), 207, 69
    before = PositionRows(np.eye(p), np.zeros(p), np.zeros(p), 0.0)
    tables = [
        PositionRows(rng.normal(size=(n, p)), rng.normal(size=n), rng.uniform(0.5, 2.5, n), n)
        for _ in range(25)
    ]
    if together:
        benchmark(likelihoods_between, tables, np.ones(25), [before] * 25)
    else:
        benchmark(lambda: [likelihood(rows, 1.0, None, before) for rows in tables])
