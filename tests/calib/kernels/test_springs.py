"""Springs fitted by the loop, held to the fit by their products."""

import numpy as np
import pytest

from calib.identification.evidence.spring_products import ModelSprings, settled
from calib.identification.many.grounds import RowsLeft
from calib.identification.many.settle import SprungRows
from calib.kernels import loops


def model(rng, p, f):
    return ModelSprings(np.arange(p * (1 + f)), rng.uniform(1, 3, p), f, rng.uniform(0.5, 2, p + f))


@pytest.fixture(params=["written", "compiled"])
def loop(request):
    """The loop as it is written and compiled, imported by its tests: importing compiles."""
    from calib.kernels.springs import springs_of_rows

    written = getattr(springs_of_rows, "py_func", springs_of_rows)
    return written if request.param == "written" else springs_of_rows


@pytest.mark.parametrize(("p", "f"), [(1, 0), (3, 2), (4, 7)])
def test_by_rows_they_end_where_the_products_end(loop, p, f):
    """Also cut short: there the same steps as numpy's are taken."""
    rng = np.random.default_rng(p)
    m = 12
    for strength in (0.1, 1.0, 10.0):
        columns = strength * rng.normal(size=(m, 6, p))
        rows = SprungRows(model(rng, p, f), columns, rng.normal(size=(m, p, 1 + f)))
        spent = 0.9 * np.linalg.qr(rng.normal(size=(6 * m, 5)))[0].T
        left = RowsLeft(np.ascontiguousarray(spent), 3 * rng.normal(size=6 * m))
        one = rows.settled(left, loop=loop)
        P = rows.products()
        whole = settled(rows.springs, left.gram(P), left.v @ P)
        np.testing.assert_allclose(one.numbers, whole.numbers, rtol=1e-7, atol=1e-9)
        assert [one.loss, one.spread] == pytest.approx([whole.loss, whole.spread], rel=1e-10)
        np.testing.assert_allclose(one.inverse, whole.inverse, rtol=1e-7, atol=1e-10)
        most = 1.01 * float(np.sum((left.v - left.times(rows.bent(one.numbers))) ** 2))
        cut, plain = rows.settled(left, most, loop), rows.settled(left, most)
        np.testing.assert_allclose(cut.numbers, plain.numbers, rtol=1e-7, atol=1e-9)
        assert cut.loss >= one.loss


def test_without_a_compiler_there_is_no_loop(monkeypatch):
    monkeypatch.setattr(loops, "NUMBA", False)
    assert loops.spring_loop_for(10**6) is None
