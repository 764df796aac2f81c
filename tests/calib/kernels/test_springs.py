"""Springs fitted by loops, held to the fit that takes one problem after the other."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from calib.identification.many.grounds import RowsLeft
from calib.identification.many.settle import SprungRows, settled_many
from calib.identification.spring_products import ModelSprings, settled
from calib.kernels import loops, springs

COMPILED = loops.SpringLoops(springs.springs_of_products, springs.springs_of_rows)
WRITTEN = loops.SpringLoops(*(getattr(loop, "py_func", loop) for loop in COMPILED))
LOOPS = pytest.mark.parametrize("own", [WRITTEN, COMPILED], ids=["written", "compiled"])


def model(rng, p, f):
    return ModelSprings(np.arange(p * (1 + f)), rng.uniform(1, 3, p), f, rng.uniform(0.5, 2, p + f))


@LOOPS
@pytest.mark.parametrize(("p", "f"), [(1, 0), (3, 2), (4, 7)])
def test_by_products_they_end_where_each_ends(own, p, f):
    """Of weak and strong springs, where steps are halved and where Newton's has no minimum."""
    rng = np.random.default_rng(p)
    alike = model(rng, p, f)
    A = rng.normal(size=(9, 3 * p * (1 + f), p * (1 + f)))
    normal = A.swapaxes(1, 2) @ A * np.geomspace(0.01, 10, 9)[:, None, None]
    pull = 30 * rng.normal(size=(9, p * (1 + f)))
    found = settled_many(alike, normal, pull, own)
    for k in range(9):
        one = settled(alike, normal[k], pull[k])
        np.testing.assert_allclose(found.numbers[k], one.numbers, rtol=1e-7, atol=1e-9)
        assert [found.loss[k], found.spread[k]] == pytest.approx([one.loss, one.spread], rel=1e-10)
    some = settled_many(alike, normal[4:6], pull[4:6], own)
    np.testing.assert_array_equal(some.numbers, found.numbers[4:6])


@LOOPS
@pytest.mark.parametrize(("p", "f"), [(1, 0), (3, 2), (4, 7)])
def test_by_rows_they_end_where_the_products_end(own, p, f):
    """Also cut short: there the same steps as numpy's are taken."""
    rng = np.random.default_rng(p)
    m = 12
    for strength in (0.1, 1.0, 10.0):
        columns = strength * rng.normal(size=(m, 6, p))
        rows = SprungRows(model(rng, p, f), columns, rng.normal(size=(m, p, 1 + f)))
        spent = 0.9 * np.linalg.qr(rng.normal(size=(6 * m, 5)))[0].T
        left = RowsLeft(np.ascontiguousarray(spent), 3 * rng.normal(size=6 * m))
        one = rows.settled(left, loops=own)
        P = rows.products()
        whole = settled(rows.springs, left.gram(P), left.v @ P)
        np.testing.assert_allclose(one.numbers, whole.numbers, rtol=1e-7, atol=1e-9)
        assert [one.loss, one.spread] == pytest.approx([whole.loss, whole.spread], rel=1e-10)
        np.testing.assert_allclose(one.inverse, whole.inverse, rtol=1e-7, atol=1e-10)
        most = 1.01 * float(np.sum((left.v - left.times(rows.bent(one.numbers))) ** 2))
        cut, plain = rows.settled(left, most, own), rows.settled(left, most)
        np.testing.assert_allclose(cut.numbers, plain.numbers, rtol=1e-7, atol=1e-9)
        assert cut.loss >= one.loss


@pytest.mark.skipif(not loops.NUMBA, reason="numba is not installed")
def test_few_robots_load_no_compiler():
    code = (
        "import sys; from calib.kernels.loops import MANY_SPRUNG as many, spring_loops_for;"
        "print(spring_loops_for(many - 1), 'numba' in sys.modules);"
        "print(spring_loops_for(many) is None, 'numba' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[3], capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    assert done.stdout.split() == ["None", "False", "False", "True"]


def test_without_a_compiler_the_loops_are_numpys(monkeypatch):
    monkeypatch.setattr(loops, "NUMBA", False)
    assert loops.spring_loops_for(10**6) is None
