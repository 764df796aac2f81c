"""Fits and visits of many robots at once, beside one after the other; run by hand, one thread.

``pytest tests/bench/bench_many.py --benchmark-only``. Bars, each group's second beside its first
per robot or replication: whitened fits 50 times as quick, the paper's 25 times, visits 15 times.
"""

import numpy as np
import pytest

from calib.identification.identify import identify
from calib.identification.many.fit import fit_many
from calib.identification.many.tables import ManyTables
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
