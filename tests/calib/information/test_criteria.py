"""Criteria: gains are those of a fresh computation, and the bounded search finds the same pose."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from calib.arrays import Array
from calib.design.blocks import information
from calib.errors import InputError
from calib.information.criteria.base import Criterion, Pool
from calib.information.criteria.lazy import TIE, best_swap, first_best
from calib.information.criteria.named import NAMES, criterion_named
from calib.information.observability import index_of
from tests.calib.design.design_cases import (
    BruteForce,
    goal_set,
    paper_pool,
    small_criterion,
    small_goals,
    small_pool,
    whitened_pool,
)

ALL = ("D", "A", "V", "G", "E", "O2", "O4", "O5")
SEEDS = st.integers(0, 2**32 - 1)


def nearly_singular(rng: np.random.Generator, p: int, condition: float, scale: float) -> Array:
    """Information (p, p) of a given condition, its columns in uneven units."""
    Q = np.linalg.qr(rng.normal(size=(p, p)))[0]
    units = 10.0 ** rng.uniform(-scale, scale, p)
    M = (Q * np.geomspace(1 / condition, 1, p)) @ Q.T
    return (M + M.T) / 2 * units * units[:, None]


@pytest.mark.parametrize("name", ALL)
@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, decades=st.floats(0, 5), units=st.floats(0, 2))
def test_gains_are_those_of_a_fresh_computation(name: str, seed: int, decades: float, units: float):
    rng, criterion = np.random.default_rng(seed), small_criterion(name)
    p, r = 5, int(rng.integers(1, 7))
    rest = nearly_singular(rng, p, 10**decades, units)
    # rows in the same units as the information: a pose seen in none would drown the others
    blocks = rng.normal(size=(7, r, p)) * np.sqrt(np.diag(rest)) * 10 ** rng.uniform(-1, 1)
    M = rest + information(blocks[:3])
    here, gram = float(criterion.value(M)), np.swapaxes(blocks, 1, 2) @ blocks

    def compare(gains: Array, changed: Array) -> None:
        after = criterion.value(changed)
        # float64 loses as many digits as M has: 1e-9 holds to condition 1e6
        size = np.maximum(np.abs(after), abs(here)) * max(1.0, np.linalg.cond(_unit(rest)) / 1e6)
        assert (np.abs(gains - (after - here)) <= 1e-9 * size + 1e-300).all()

    compare(criterion.add(M, blocks[3:]), M + gram[3:])
    compare(criterion.drop(M, blocks[:3]), M - gram[:3])
    compare(
        criterion.swap(M, blocks[:3], blocks[3:]).ravel(),
        (M - gram[:3, None] + gram[None, 3:]).reshape(-1, p, p),
    )


def _unit(M: Array) -> Array:
    size = np.sqrt(np.diag(M))
    return M / size / size[:, None]


class Exact:
    """The same values in rational arithmetic: no rounding at all before the last step."""

    def __init__(self, name: str, p: int) -> None:
        self.name, rows = name, small_goals(99, p).rows
        self.goals = [[[Fraction(x) for x in row] for row in J] for J in rows.tolist()]

    def value(self, M: list[list[Fraction]]) -> Fraction:
        """The determinant for D; otherwise a variance."""
        det, inverse = solved(M)
        if self.name == "D":
            return det
        if self.name == "A":
            return sum(inverse[k][k] for k in range(len(M)))
        seen = [sum(form(inverse, row) for row in J) for J in self.goals]
        return max(seen) if self.name == "G" else sum(seen) / len(seen)

    def gain(self, before: list[list[Fraction]], after: list[list[Fraction]]) -> float:
        one, two = self.value(before), self.value(after)
        return math.log(two / one) if self.name == "D" else float(one - two)


def solved(M: list[list[Fraction]]) -> tuple[Fraction, list[list[Fraction]]]:
    """Determinant and inverse by elimination."""
    n, det = len(M), Fraction(1)
    rows = [list(row) + [Fraction(int(i == j)) for j in range(n)] for i, row in enumerate(M)]
    for k in range(n):
        pivot = rows[k][k]
        det *= pivot
        rows[k] = [x / pivot for x in rows[k]]
        for i in range(n):
            if i != k and rows[i][k]:
                f = rows[i][k]
                rows[i] = [x - f * y for x, y in zip(rows[i], rows[k], strict=True)]
    return det, [row[n:] for row in rows]


def form(X: list[list[Fraction]], row: list[Fraction]) -> Fraction:
    return sum(a * X[i][j] * b for i, a in enumerate(row) for j, b in enumerate(row))


def plus(M: Array, *signed: tuple[int, Array]) -> list[list[Fraction]]:
    """M with the information of blocks added or taken away, without rounding."""
    out = [[Fraction(x) for x in row] for row in M.tolist()]
    for sign, B in signed:
        F = [[Fraction(x) for x in row] for row in B.tolist()]
        for i in range(len(out)):
            for j in range(len(out)):
                out[i][j] += sign * sum(row[i] * row[j] for row in F)
    return out


@pytest.mark.parametrize("name", ["D", "A", "V", "G"])
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS, decades=st.floats(0, 9), units=st.floats(0, 3))
@example(seed=717626, decades=9.0, units=0.0)  # 2e-11 are left, known to five digits
def test_gains_of_nearly_singular_information_are_exact(
    name: str, seed: int, decades: float, units: float
):
    rng, p = np.random.default_rng(seed), 4
    criterion, exact, r = small_criterion(name, p), Exact(name, p), int(rng.integers(1, 5))
    rest = nearly_singular(rng, p, 10**decades, units)
    blocks = rng.normal(size=(4, r, p)) * np.sqrt(np.diag(rest)) * 10 ** rng.uniform(-1, 1)
    M = rest + information(blocks[:1])
    none, here = plus(M), abs(float(criterion.value(M)))

    def compare(gain: float, changed: list[list[Fraction]], swapped: bool = False) -> None:
        true = exact.gain(none, changed)
        after = np.array([[float(x) for x in row] for row in changed])
        # rounding M moves its weakest direction by eps times its condition, and what is left of a
        # pose there once more: a few hundred eps in all
        condition = max(np.linalg.cond(_unit(M)), np.linalg.cond(_unit(after)))
        digits = 1e-9 + 1e-13 * condition
        both = here + abs(float(criterion.value(after)))
        # G is a difference of two maxima, whose size counts; D one of logarithms, of size one
        size = abs(true) + {"G": both, "D": 1.0}.get(name, 0.0)
        # what a pose takes and the other gives may cancel: each is known to a few eps of its own
        cancelled = 4 * np.finfo(np.float64).eps * condition * both if swapped else 0.0
        assert abs(gain - true) <= digits * size + cancelled

    for gain, B in zip(criterion.add(M, blocks[1:]), blocks[1:], strict=True):
        compare(gain, plus(M, (1, B)))
    compare(criterion.drop(M, blocks[:1])[0], plus(M, (-1, blocks[0])))
    for gain, B in zip(criterion.swap(M, blocks[:1], blocks[1:])[0], blocks[1:], strict=True):
        compare(gain, plus(M, (-1, blocks[0]), (1, B)), swapped=True)


@pytest.mark.parametrize("name", ALL)
@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, weight=st.sampled_from([1.0, 1e-3]))
def test_among_equal_poses_the_first_is_taken_whatever_the_bounds(
    name: str, seed: int, weight: float
):
    # rows of -1, 0, 1: many poses tie, exactly or not at all
    rng = np.random.default_rng(seed)
    r, p = int(rng.integers(1, 4)), int(rng.integers(1, 6))
    blocks = rng.integers(-1, 2, (40, r, p)).astype(float)
    chosen = np.sort(rng.choice(40, 8, replace=False))
    M, criterion = weight * np.eye(p) + information(blocks[chosen]), small_criterion(name, p)
    outside, gram = ~np.isin(np.arange(40), chosen), np.swapaxes(blocks, 1, 2) @ blocks
    here = abs(float(criterion.value(M)))

    def first(places: Array, after: Array) -> int | None:
        """The lowest place of the best, if rounding leaves no doubt about it."""
        values = criterion.value(after)
        top = values.max()
        cond = max(np.linalg.cond(M), np.linalg.cond(after[values.argmax()]))
        apart = 1e-13 * cond * max(abs(top), here)
        return int(places[np.argmax(values >= top - apart)]) if cond < 1e4 else None

    added = first(np.flatnonzero(outside), (M + gram)[outside])
    if added is not None:
        assert criterion.best_add(M, Pool(blocks), outside).place == added
    dropped = first(np.arange(8), M - gram[chosen])
    if dropped is not None:
        assert criterion.best_drop(M, blocks[chosen]).place == dropped


@pytest.mark.parametrize("name", ["D", "A", "V"])
def test_a_swap_is_exact_where_dropping_alone_leaves_nothing(name: str):
    # saturated: each of five poses of one row is the only one to see some direction
    blocks, criterion = small_pool(4, 12, 1, 5), small_criterion(name)
    M = information(blocks[:5])
    assert np.isneginf(criterion.drop(M, blocks[:5])).all()
    gains = criterion.swap(M, blocks[:5], blocks[5:])
    gram = np.swapaxes(blocks, 1, 2) @ blocks
    fresh = criterion.value(M - gram[:5, None] + gram[None, 5:]) - criterion.value(M)
    # condition of these M: up to 1e4, of the swapped ones up to 1e6
    np.testing.assert_allclose(gains, fresh, rtol=1e-7)


def near_optimal(criterion: Criterion, blocks: Array, m: int, rng: np.random.Generator) -> Array:
    """A random set after a few exchanges: there the candidates lie close together."""
    chosen, pool = rng.choice(len(blocks), m, replace=False), Pool(blocks)
    for _ in range(int(rng.integers(0, 8))):
        outside = ~np.isin(np.arange(len(blocks)), chosen)
        place = criterion.best_add(information(blocks[chosen]), pool, outside).place
        larger = np.append(chosen, place)
        out = criterion.best_drop(information(blocks[larger]), blocks[larger]).place
        chosen = np.delete(larger, out)
    return np.sort(chosen)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("make", [paper_pool, whitened_pool])
def test_bounds_never_miss_the_best_pose(make, name: str):
    blocks, rng, evaluated = make(250), np.random.default_rng(8), 0
    criterion, pool = criterion_named(name, goals=goal_set(n=30)), Pool(blocks)
    brute, rounds = BruteForce(criterion), 5
    for _ in range(rounds):
        chosen = near_optimal(criterion, blocks, 20, rng)
        outside, M = ~np.isin(np.arange(250), chosen), information(blocks[chosen])
        added, best = criterion.best_add(M, pool, outside), brute.best_add(M, pool, outside)
        assert added.place == best.place
        # paper rows have condition 3e4, squared in M: their gains keep seven digits
        assert added.gain == pytest.approx(best.gain, rel=1e-6, abs=1e-9 * abs(criterion.value(M)))
        dropped = criterion.best_drop(M, blocks[chosen])
        assert dropped.place == brute.best_drop(M, blocks[chosen]).place
        evaluated += added.evaluated
    # the point of the bounds: most candidates are never evaluated
    assert evaluated < 0.6 * rounds * 250


@pytest.mark.parametrize("name", ALL)
def test_the_best_swap_is_that_of_brute_force(name: str):
    criterion, blocks = criterion_named(name, goals=goal_set(n=20)), whitened_pool(60)
    for seed in range(4):
        chosen = np.sort(np.random.default_rng(seed).choice(60, 10, replace=False))
        outside, M = ~np.isin(np.arange(60), chosen), information(blocks[chosen])
        places = np.flatnonzero(outside)
        gains = criterion.swap(M, blocks[chosen], blocks[places])
        i, j = np.unravel_index(gains.argmax(), gains.shape)
        swap = best_swap(criterion, M, blocks[chosen], Pool(blocks), outside)
        assert (swap.leaving, swap.entering) == (i, places[j])
        assert swap.gain == pytest.approx(gains[i, j], rel=1e-8)
        assert swap.evaluated < gains.size or name == "G"


@pytest.mark.parametrize("name", ALL)
def test_a_floor_hides_only_what_stays_below_it(name: str):
    criterion, blocks = small_criterion(name), small_pool(1, 30)
    M, pool, allowed = information(blocks[:6]), Pool(blocks), np.arange(30) >= 6
    best = criterion.best_add(M, pool, allowed)
    top = float(criterion.value(M)) + best.gain
    assert criterion.best_add(M, pool, allowed, top - 1e-9 * abs(top)).place == best.place
    assert criterion.best_add(M, pool, allowed, top + 1e-6 * abs(top)).place == -1


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (7, 5), (2, 9)])
def test_blocks_of_any_shape_will_do(shape: tuple[int, int], name: str):
    r, p = shape
    criterion = small_criterion(name, p)
    brute = BruteForce(criterion)
    for seed in range(8):
        blocks = small_pool(seed, 30, r, p)
        chosen = np.arange(-(-p // r) + 2)
        outside, M = ~np.isin(np.arange(30), chosen), information(blocks[chosen])
        # O3 of one number, and the like, can tie exactly: compare the gains, not the places
        gain = criterion.best_add(M, Pool(blocks), outside).gain
        best = brute.best_add(M, Pool(blocks), outside).gain
        assert gain == pytest.approx(best, rel=1e-7, abs=1e-12)
        gain, best = (c.best_drop(M, blocks[chosen]).gain for c in (criterion, brute))
        assert gain == pytest.approx(best, rel=1e-7, abs=1e-12)


@pytest.mark.parametrize("name", ALL)
def test_of_equal_poses_the_lowest_place_wins(name: str):
    blocks, criterion = np.tile(small_pool(3, 10), (3, 1, 1)), small_criterion(name)
    outside = np.arange(30) >= 4
    assert criterion.best_add(information(blocks[:4]), Pool(blocks), outside).place < 14
    twice = blocks[[0, 1, 2, 3, 10, 11, 12, 13]]
    assert criterion.best_drop(information(twice), twice).place < 4


def test_values_within_rounding_are_a_tie():
    assert first_best(np.array([1.0, 2.0, 2.0 * (1 + TIE / 2)])) == 1
    assert first_best(np.array([1.0, 2.0, 2.0 * (1 + 4 * TIE)])) == 2
    assert first_best(np.array([-3.0, -1.0, -2.0])) == 1


@pytest.mark.parametrize("name", ALL)
def test_a_pose_that_may_not_be_taken_is_never_added(name: str):
    blocks, criterion = small_pool(0, 12), small_criterion(name)
    for outside in range(12):
        allowed = np.arange(12) == outside
        assert criterion.best_add(information(blocks), Pool(blocks), allowed).place == outside


@pytest.mark.parametrize("name", ["D", "E", "O2", "O4", "O5"])
def test_a_pose_strong_in_one_direction_does_not_hide_one_good_in_many(name: str):
    # D gains: log(1 + 20) = 3.0 for twenty strong rows, 4 log(1 + 8/4) = 4.4 for the even pose
    strong = np.zeros((20, 4, 4))
    strong[:, 0, 0] = np.sqrt(20)
    blocks = np.concatenate([strong, np.sqrt(2) * np.eye(4)[None]])
    added = criterion_named(name).best_add(np.eye(4), Pool(blocks), np.ones(21, dtype=bool))
    assert added.place == 20


@pytest.mark.parametrize("name", NAMES)
def test_figures_are_what_they_say(name: str):
    blocks, criterion = small_pool(7, 8), small_criterion(name)
    M, covariance = information(blocks), np.linalg.inv(information(blocks))
    found = criterion.figure(M, 8)
    assert criterion.name == name
    if criterion.index is not None:
        assert found == pytest.approx(float(index_of(M, 8, criterion.index)), rel=1e-9)
    if name == "A":
        assert found == pytest.approx(np.sqrt(np.trace(covariance)), rel=1e-9)
    if name in "VG":
        J = small_goals(99).rows
        u2 = np.trace(J @ covariance @ np.swapaxes(J, 1, 2), axis1=1, axis2=2)
        expected = u2.mean() if name == "V" else u2.max()
        assert found == pytest.approx(np.sqrt(expected), rel=1e-9)
    assert criterion.rises(float(criterion.value(2 * M)), float(criterion.value(M))) or name == "O2"


@pytest.mark.parametrize(("name", "says"), [("O9", "one of D, A"), ("v", 'did you mean "V"')])
def test_an_unknown_criterion_is_refused(name: str, says: str):
    with pytest.raises(InputError, match=says):
        criterion_named(name)


def test_v_without_a_goal_is_refused():
    with pytest.raises(InputError, match="needs goal poses"):
        criterion_named("V")
