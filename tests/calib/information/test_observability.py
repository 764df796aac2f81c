"""The five indices: the published check values, the units they hang on, and the laws they obey."""

from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.arrays import Array
from calib.design.blocks import information, paper_blocks
from calib.errors import InputError
from calib.geometry.jacobian import matrix_rows
from calib.geometry.parameters import parameters_of
from calib.information.observability import CRITERIA, Form, IndexName, index_of, indices
from calib.information.rank import singular_values
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60

MODEL = tx60()
PAPER = parameters_of(MODEL, WEN24)
SEEDS = st.integers(0, 2**32 - 1)
# MATH 7: means and standard deviations over random sets of 29 and 61 of pool R
WHOLE = (6.272, 3.552e-5, 0.6226, 2.211e-5, 0.2587)
RANDOM = {
    29: ((5.973, 3.498e-5, 0.1043, 3.65e-6, 0.0429), (0.099, 2.0e-6, 0.0036, 3e-7, 0.0008)),
    61: ((6.137, 3.524e-5, 0.1525, 5.38e-6, 0.0632), (0.064, 1.3e-6, 0.0034, 2.8e-7, 0.0007)),
}


@pytest.fixture(scope="module")
def twelve() -> Array:
    """(1000, 12, 24) the paper's own rows of pool R, mm and rad."""
    T, J = MODEL.poses_and_jacobian(pool_r())
    rows = matrix_rows(T, J)
    rows[:, 9:] *= 1e3
    return (rows * np.where(PAPER.is_length, 1e-3, 1.0))[:, :, PAPER.free]


def of_set(blocks: Array) -> tuple[float, ...]:
    """O1 to O5 of poses (m, r, p), in the correct form."""
    return astuple(
        indices(singular_values(blocks.reshape(-1, blocks.shape[-1])), len(blocks)).correct
    )


def test_the_whole_pool_has_the_printed_indices(twelve: Array):
    # the printed values have four digits
    np.testing.assert_allclose(of_set(twelve), WHOLE, rtol=1e-3)


@pytest.mark.parametrize("m", RANDOM)
def test_random_sets_have_the_printed_means(m: int, twelve: Array):
    rng = np.random.default_rng(m)
    count = 60
    found = np.mean([of_set(twelve[rng.choice(1000, m, replace=False)]) for _ in range(count)], 0)
    mean, sd = map(np.array, RANDOM[m])
    # three standard deviations of the mean, and the last printed digit
    assert (np.abs(found - mean) < 3 * sd / np.sqrt(count) + 1e-3 * mean).all()


def test_six_weighted_rows_are_worth_the_paper_s_twelve(twelve: Array):
    six = paper_blocks(MODEL, PAPER, pool_r())
    for j in (0, 17, 999):
        np.testing.assert_allclose(
            information(six[j : j + 1]),
            information(twelve[j : j + 1]),
            atol=1e-12 * np.abs(information(twelve[j : j + 1])).max(),
        )
    # the smallest singular value is 28 000 times below the largest: 1e-16 grows to 1e-11
    np.testing.assert_allclose(of_set(six[:29]), of_set(twelve[:29]), rtol=1e-9)


def test_the_condition_depends_on_the_units(twelve: Array):
    def condition(A: Array) -> float:
        return 1 / of_set(A)[1]

    degrees = np.where(PAPER.is_length[PAPER.free], 1.0, np.pi / 180)
    _, J = MODEL.poses_and_jacobian(pool_r())
    noise = np.array([SIGMA_POSITION] * 3 + [SIGMA_ROTATION] * 3)
    whitened = (J / noise[:, None])[:, :, PAPER.free] * PAPER.free_scale
    assert condition(twelve) == pytest.approx(28155, rel=1e-4)
    # MATH 7 rounds these two to "~660" and 9.7
    assert condition(twelve * degrees) == pytest.approx(660, rel=0.02)
    assert condition(whitened) == pytest.approx(9.7, abs=0.05)


def test_the_three_forms_are_what_they_say():
    found = indices([8.0, 4.0, 2.0], 4)
    # by hand: cube root of 64 over 2; 1/4; 2; 4/8; 1 / (1/8 + 1/4 + 1/2)
    assert astuple(found.correct) == pytest.approx((2.0, 0.25, 2.0, 0.5, 8 / 7), rel=1e-14)
    assert astuple(found.printed) == pytest.approx((2.0, 0.25, 2.0, 0.5, 7 / 8), rel=1e-14)
    assert astuple(found.per_pose) == pytest.approx((2.0, 0.25, 1.0, 0.25, 4 / 7), rel=1e-14)


def test_a_set_that_misses_a_direction_has_index_zero():
    assert astuple(indices([3.0, 1.0, 0.0], 5).correct) == (0.0,) * 5
    assert astuple(indices([0.0, 0.0], 5).correct) == (0.0,) * 5
    assert np.inf == indices([3.0, 1.0, 0.0], 5).printed.O5
    M = np.diag([4.0, 1.0, 0.0])
    assert [float(index_of(M, 5, c)) for c in CRITERIA] == [0.0] * 5


@pytest.mark.parametrize("form", ["correct", "per_pose", "printed"])
@pytest.mark.parametrize("criterion", CRITERIA)
def test_information_matrices_give_the_same_indices_as_singular_values(
    criterion: IndexName, form: Form, twelve: Array
):
    rng = np.random.default_rng(0)
    sets = [twelve[rng.choice(1000, 29, replace=False)] for _ in range(5)]
    batch = index_of(np.array([information(s) for s in sets]), 29, criterion, form)
    one_by_one = [
        getattr(getattr(indices(singular_values(s.reshape(-1, 24)), 29), form), criterion)
        for s in sets
    ]
    # squaring a condition of 3e4 leaves 1e-16 * 1e9 in the smallest eigenvalue
    np.testing.assert_allclose(batch, one_by_one, rtol=1e-6)


def test_the_product_of_many_large_singular_values_does_not_overflow():
    assert pytest.approx(1e5, rel=1e-12) == indices(np.full(200, 1e5), 1).correct.O1


@given(seed=SEEDS)
def test_the_order_of_the_poses_does_not_matter(seed: int):
    rng = np.random.default_rng(seed)
    blocks = rng.normal(size=(9, 3, 5))
    # a rotation of the stacked rows: rounding only
    np.testing.assert_allclose(of_set(blocks[rng.permutation(9)]), of_set(blocks), rtol=1e-10)


@given(seed=SEEDS)
def test_adding_a_pose_never_lowers_the_smallest_singular_value_nor_the_determinant(seed: int):
    blocks = np.random.default_rng(seed).normal(size=(9, 3, 5))
    smaller, larger = (
        singular_values(blocks[:8].reshape(-1, 5)),
        singular_values(blocks.reshape(-1, 5)),
    )
    # interlacing, for every singular value
    assert (larger >= smaller * (1 - 1e-12)).all()


@given(seed=SEEDS)
def test_measuring_every_pose_twice_leaves_the_indices_per_pose(seed: int):
    blocks = np.random.default_rng(seed).normal(size=(9, 3, 5))
    once = indices(singular_values(blocks.reshape(-1, 5)), 9).per_pose
    twice = indices(singular_values(np.tile(blocks, (2, 1, 1)).reshape(-1, 5)), 18).per_pose
    np.testing.assert_allclose(astuple(twice), astuple(once), rtol=1e-12)


@given(seed=SEEDS)
def test_the_ranking_by_o1_does_not_depend_on_column_units(seed: int):
    rng = np.random.default_rng(seed)
    one, other = rng.normal(size=(2, 9, 3, 5))
    units = np.exp(rng.normal(size=5))
    ratio = of_set(one)[0] / of_set(other)[0]
    assert of_set(one * units)[0] / of_set(other * units)[0] == pytest.approx(ratio, rel=1e-9)


@pytest.mark.parametrize("singular", [[], [1.0, 2.0], [1.0, -1.0], [np.nan]])
def test_what_cannot_be_singular_values_is_refused(singular: list[float]):
    with pytest.raises(InputError):
        indices(singular, 3)


def test_an_unknown_index_or_form_is_refused_by_name():
    with pytest.raises(InputError, match="O6"):
        index_of(np.eye(2), 1, "O6")
    with pytest.raises(InputError, match="mean"):
        index_of(np.eye(2), 1, "O1", "mean")
    with pytest.raises(InputError, match="n_poses is 0"):
        indices([1.0], 0)
