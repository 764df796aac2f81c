"""What can be told apart: every rank of the published table, the dependencies, the words."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import qr

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.jacobian import reflector_rows
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import CHARACTERISTIC_LENGTH, parameters_of
from calib.information import rank as independence
from calib.information.rank import practical_rank, rank, singular_values
from calib.information.reduction import Reduction, reduce
from calib.information.sizes import weak_prior_sd
from calib.measurement import tables
from calib.measurement.observations import joined
from calib.measurement.residual import linearize
from tests.reference import BASE6, DEG, READABLE30, SIGMA_POSITION, TOOL6, WEN24, pool_r, tx60

LINKS = tuple(name for name in tx60().names if "." not in name)
SETS = {
    "all": tx60().names,
    "links": LINKS,
    "base, links": (*BASE6, *LINKS),
    "links, tool": (*LINKS, *TOOL6),
    "paper": WEN24,
    "paper, beta6": (*WEN24, "beta6"),
    "readable": READABLE30,
}
ORIGIN, ON_AXIS, OFF_AXIS = [0, 0, 0], [0, 0, 0.05], [0.05, 0.03, 0.08]
OTHERS = ([-0.04, 0.02, 0.06], [0.01, -0.06, 0.03])
# rows: reflectors in the tool frame (none: full pose), links perturbed, ranks in the order of SETS
TABLE = {
    "full pose": ([], False, (30, 25, 29, 26, 24, 25, 30)),
    "reflector at the flange origin": ([ORIGIN], False, (25, 20, 24, 21, 20, 20, 25)),
    "reflector elsewhere on axis 6": ([ON_AXIS], False, (25, 21, 25, 21, 21, 21, 25)),
    "flange origin, links perturbed": ([ORIGIN], True, (27, 23, 27, 23, 23, 23, 27)),
    "on axis 6, links perturbed": ([ON_AXIS], True, (27, 23, 27, 23, 23, 23, 27)),
    "one reflector off axis": ([OFF_AXIS], False, (27, 23, 27, 23, 23, 23, 27)),
    "two reflectors": ([OFF_AXIS, OTHERS[0]], False, (29, 25, 29, 25, 24, 25, 29)),
    "three not in line": ([OFF_AXIS, *OTHERS], False, (30, 25, 29, 26, 24, 25, 30)),
}


def rows(model: RobotModel, q: Array, reflectors: list[list[float]] | None = None) -> Array:
    """Scaled rows (N, P) of full poses, or of reflectors."""
    T, J = model.poses_and_jacobian(q)
    if reflectors:
        J = np.concatenate(
            [reflector_rows(T, J, np.tile(c, (len(q), 1)))[1] for c in reflectors], axis=1
        )
    else:
        J = J * np.array([1.0, 1, 1, *[CHARACTERISTIC_LENGTH] * 3])[:, None]
    return (J * parameters_of(model).scale).reshape(-1, model.n_numbers)


def reduced(model: RobotModel, q: Array, free: tuple[str, ...] | None = None) -> Reduction:
    parameters = parameters_of(model, free)
    return reduce(rows(model, q)[:, parameters.free], parameters, model=model, q=q)


def perturbed(seed: int) -> RobotModel:
    rng, model = np.random.default_rng(seed), tx60()
    size = np.where(model.is_length, 0.3e-3, 0.1 * DEG)
    size[: len(BASE6)] = size[-len(TOOL6) :] = 0.0
    return model.moved(rng.normal(size=42) * size)


@pytest.mark.parametrize("measured", TABLE)
def test_every_rank_of_the_table_is_met(measured: str):
    reflectors, moved, expected = TABLE[measured]
    model = perturbed(1) if moved else tx60()
    A = rows(model, pool_r(61), reflectors)
    found = []
    for names in SETS.values():
        parameters = parameters_of(model, names)
        reduction = reduce(A[:, parameters.free], parameters, model=model)
        found.append(reduction.rank)
        # a second way: QR with pivoting; 1e-8 lies between the weakest direction of a
        # perturbed robot (6e-5) and rounding (1e-15)
        pivots = np.abs(np.diag(qr(A[:, parameters.free], mode="r", pivoting=True)[0]))
        assert reduction.rank == (pivots > 1e-8 * pivots[0]).sum() == len(reduction.kept)
    assert tuple(found) == expected


def test_the_twelve_dependencies_of_a_tx60_are_told_in_words():
    same, opposite = "the same", "the opposite"
    expected = [
        ("theta1", same, "base.rz"),
        ("d1", same, "base.z"),
        ("beta1", opposite, "base.rz"),
        ("d2", same, "d3"),
        ("beta3", same, "theta3"),
        ("beta4", opposite, "theta4"),
        ("beta5", same, "theta5"),
        ("theta6", same, "tool.rz"),
        ("d6", same, "tool.z"),
        ("a6", same, "tool.x"),
        ("alpha6", same, "tool.rx"),
        ("beta6", same, "tool.ry"),
    ]
    reduction = reduced(tx60(), pool_r(29))
    assert reduction.dropped == tuple(name for name, _, _ in expected)
    assert reduction.sentences == tuple(
        f"{name} cannot be told from {other}: any change of {name} looks like {how} change of "
        f"{other}"
        for name, how, other in expected
    )
    # straight from the Jacobian: exact but for the sine of 90 degrees in float64
    _, J = tx60().poses_and_jacobian(pool_r(29))
    column = {name: J[..., k] for k, name in enumerate(tx60().names)}
    for name, how, other in expected:
        sign = 1 if how == same else -1
        assert np.abs(column[name] - sign * column[other]).max() < 4e-15


def test_the_readable_thirty_are_kept_and_well_conditioned():
    reduction = reduced(tx60(), pool_r(1000))
    assert set(reduction.kept) == set(READABLE30)
    assert reduction.kept == tuple(name for name in tx60().names if name in READABLE30)
    # MATH 3 prints 5.31 and 5.30 for generic poses of its own; ours scatter by 1 % at this number
    few = pool_r(200)
    assert reduced(tx60(), few).condition == pytest.approx(5.31, rel=0.02)
    assert reduced(tx60(), few, WEN24).condition == pytest.approx(5.30, rel=0.02)
    # a second way: singular values of the kept columns by eigenvalues of their products
    A = rows(tx60(), few)[:, [name in READABLE30 for name in tx60().names]]
    values = np.linalg.eigvalsh(A.T @ A)
    assert reduced(tx60(), few).condition == pytest.approx(
        np.sqrt(values[-1] / values[0]), rel=1e-9
    )


def test_the_paper_holds_an_identifiable_number_fixed():
    A = rows(tx60(), pool_r(1000))
    paper = parameters_of(tx60(), WEN24)
    beta6 = A[:, paper.names.index("beta6")]
    inside = np.linalg.lstsq(A[:, paper.free], beta6)[0]
    rest = beta6 - A[:, paper.free] @ inside
    # MATH 3 says 96 %, for poses of its own
    assert np.linalg.norm(rest) / np.linalg.norm(beta6) == pytest.approx(0.96, abs=0.02)


@pytest.mark.parametrize("model", [tx60(), perturbed(3)], ids=["nominal", "perturbed"])
def test_mixing_sends_every_step_to_one_of_the_kept_numbers_that_looks_alike(model: RobotModel):
    q = pool_r(40)
    reduction = reduced(model, q)
    _, J = model.poses_and_jacobian(q)
    J = J.reshape(-1, 42)
    kept = [model.names.index(name) for name in reduction.kept]
    step = np.random.default_rng(0).normal(size=42)
    seen, told = J @ step, J[:, kept] @ (reduction.mixing @ step)
    # rounding of a 30 x 30 solution of condition 6 (perturbed: 6 too, the gauge stays the same)
    np.testing.assert_allclose(told, seen, atol=1e-12 * np.abs(seen).max())


def test_mixing_names_what_a_kept_number_stands_for():
    reduction, names = reduced(tx60(), pool_r(29)), tx60().names
    row = reduction.mixing[reduction.kept.index("base.rz")]
    expected = np.zeros(42)
    for name, value in (("base.rz", 1), ("theta1", 1), ("beta1", -1)):
        expected[names.index(name)] = value
    np.testing.assert_allclose(row, expected, atol=1e-12)


@pytest.mark.parametrize(("m", "expected"), [(2, 12), (3, 18), (4, 24), (5, 30), (6, 30)])
def test_a_pose_adds_six_directions_until_all_are_told(m: int, expected: int):
    reduction = reduced(tx60(), pool_r(m))
    assert reduction.rank == expected == len(reduction.kept)
    too_few = any("more poses may tell more" in sentence for sentence in reduction.sentences)
    assert too_few == (6 * m <= expected)


@pytest.mark.parametrize("joint", range(6))
def test_a_joint_that_never_moves_is_named_and_costs_four(joint: int):
    q = pool_r(40).copy()
    q[:, joint] = 0.3
    reduction = reduced(tx60(), q)
    assert reduction.rank == 26
    assert reduction.sentences[0].startswith(f"joint {joint + 1} never moves")


def test_one_orientation_in_all_poses_hides_the_tool_translation_and_says_so():
    model, rng = tx60(), np.random.default_rng(4)
    q = (
        np.array([0.2, 0.4, 1.1, 0.5, 0.8, -0.3])
        + np.c_[rng.uniform(-0.3, 0.3, (40, 3)), np.zeros((40, 3))]
    )
    goal = model.poses([[0.2, 0.4, 1.1, 0.5, 0.8, -0.3]])[0, :3, :3]
    theta = [model.names.index(f"theta{i}") for i in (4, 5, 6)]
    for _ in range(30):  # Newton on the wrist
        T, J = model.poses_and_jacobian(q)
        R = goal @ np.swapaxes(T[:, :3, :3], 1, 2)
        error = 0.5 * np.stack(
            [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], -1
        )
        q[:, 3:] += np.linalg.solve(J[:, 3:, theta], error[..., None])[..., 0]
    reduction = reduced(model, q, (*BASE6, *TOOL6))
    assert reduction.kept == (*BASE6, *TOOL6[3:])
    assert reduction.rank == 9
    assert reduction.sentences[0].startswith("the tool keeps one orientation in all poses: tool.x")
    assert reduction.dropped == TOOL6[:3]


def test_numbers_without_effect_are_unobservable_and_nothing_stands_for_them():
    model = tx60()
    parameters = parameters_of(model)
    reduction = reduce(rows(model, pool_r(40), [ORIGIN]), parameters, model=model)
    # the reflector sits at the tool origin: turning the tool about it moves nothing
    assert {"tool.rx", "tool.ry", "tool.rz"} <= set(reduction.unobservable)
    silent = [parameters.names.index(name) for name in reduction.unobservable]
    assert not reduction.mixing[:, silent].any()
    assert sum("no effect" in s for s in reduction.sentences) == len(silent)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kinds", ["RRRRRRR", "RRRRRP", "PRRPRR", "PPPRRR", "RRR"])
def test_any_arm_has_four_numbers_per_turning_joint_two_per_sliding_one_and_six(
    kinds: str, seed: int
):
    rng, n = np.random.default_rng(seed), len(kinds)
    joints = tuple("revolute" if kind == "R" else "prismatic" for kind in kinds)
    model = RobotModel(Chain(rng.uniform(-1, 1, (n, 5)) * [3, 0.5, 0.5, 3, 1], joints))
    reduction = reduced(model, rng.uniform(-1.5, 1.5, (40, n)))
    # classical count of independent geometric numbers: 4 R + 2 P + 6
    assert reduction.rank == 4 * kinds.count("R") + 2 * kinds.count("P") + 6
    assert len(reduction.kept) == reduction.rank


def test_a_term_listed_twice_is_found_out():
    model = RobotModel(tx60().chain, JointErrors((*gravity_terms(6), *harmonic_terms(6)), [0] * 27))
    reduction = reduced(model, pool_r(100))
    assert any(
        s.startswith("harmonic2.sin1 cannot be told from gravity2.upper")
        for s in reduction.sentences
    )
    # 30 geometric numbers; of the 27 terms, sin q2 stands twice
    assert "gravity2.upper" in reduction.kept


def test_weak_directions_raise_the_rank_but_teach_nothing():
    model = perturbed(1)
    parameters = parameters_of(model)
    A = rows(model, pool_r(61), [ORIGIN])
    assert rank(A) == 27
    whitened = A / parameters.scale / SIGMA_POSITION
    prior = weak_prior_sd(parameters)
    found = practical_rank(whitened, prior)
    # brute force: prior over posterior variance along the directions of prior-scaled information
    H = (whitened * prior).T @ (whitened * prior)
    values = np.linalg.eigvalsh(np.eye(42) + H)
    assert found == (1 / np.sqrt(values) < 0.5).sum() == 25
    both = reduce(A / SIGMA_POSITION, parameters, model=model, prior_sd=prior)
    assert (both.rank, both.practical_rank) == (27, 25)


def test_a_direction_counts_as_learned_when_its_sd_is_halved():
    # posterior over prior sd 1 / sqrt(1 + s^2): 0.507, 0.496, 0.1
    A = np.diag([1.70, 1.75, 9.95])
    assert practical_rank(A, np.ones(3)) == 2
    assert practical_rank(A / [2.0, 4.0, 8.0], [2.0, 4.0, 8.0]) == 2
    assert practical_rank(A, np.ones(3), ratio=0.2) == 1


@pytest.mark.parametrize(
    "free", [READABLE30, (*READABLE30, "d2")], ids=["all told apart", "one not"]
)
def test_one_triangle_keeps_what_columns_one_by_one_keep(free: tuple[str, ...], monkeypatch):
    model, q = perturbed(3), pool_r()[:29]
    quick = reduced(model, q, free)
    monkeypatch.setattr(independence, "PLAIN", np.inf)
    slow = reduced(model, q, free)
    assert (quick.kept, quick.sentences) == (slow.kept, slow.sentences)
    assert np.array_equal(quick.mixing, slow.mixing)
    assert quick.condition == slow.condition


def test_singular_values_are_those_of_the_definition():
    A = np.random.default_rng(0).normal(size=(50, 7))
    for matrix in (A, A.T):
        np.testing.assert_allclose(
            singular_values(matrix), np.sqrt(np.linalg.eigvalsh(A.T @ A)[::-1]), rtol=1e-12
        )


@pytest.mark.parametrize(
    ("A", "code"),
    [(np.full((12, 24), np.nan), "A2"), (np.ones((12, 23)), "A1"), (np.ones((0, 24)), "M27")],
    ids=["not finite", "a column short", "no rows"],
)
def test_a_matrix_that_does_not_fit_is_refused(A: Array, code: str):
    with pytest.raises(InputError) as caught:
        reduce(A, parameters_of(tx60(), WEN24), model=tx60())
    assert caught.value.code == code


def test_parameters_of_another_robot_are_refused():
    other = RobotModel(Chain([[0, 0, 0.5, 0, 0]]))
    with pytest.raises(InputError, match="different numbers"):
        reduce(np.ones((6, 42)), parameters_of(tx60()), model=other)


@pytest.mark.parametrize("line", [[1.6, 0.1, 0.1], [0.1, -1.6, 0.1], [0.3, 0.2, 2.0]])
def test_a_turn_that_distances_leave_free_holds_the_number_that_it_moves_most(line):
    """Held instead, rz of a turn about a level line left 0.4 to 6 mm of u to points 16 um off."""
    first = np.array([0.4, 0.7, 0.2])
    model = replace(tx60(), fixtures=Fixtures(anchors=[first, first + line]))
    q, T = pool_r(60), tx60().poses(pool_r(60))
    p = T[:, :3, 3] + T[:, :3, :3] @ OFF_AXIS
    table = joined(
        [
            tables.distances(q, np.linalg.norm(p - at, axis=1), sd=1e-5, anchor=k, offset=OFF_AXIS)
            for k, at in enumerate(model.fixtures.anchors)
        ]
    )
    parameters = parameters_of(model, [name for name in model.names if "anchor" not in name])
    A = linearize(model, table).A * parameters.scale
    found = reduce(A[:, parameters.free], parameters, model=model, q=q)
    axis = np.array(line) / np.linalg.norm(line)
    move = np.concatenate([np.cross(axis, -first), CHARACTERISTIC_LENGTH * axis])
    base = dict(zip(BASE6, np.abs(move), strict=True))
    held = [name for name in BASE6 if name in found.dropped]
    assert held == [max(base, key=base.__getitem__)]
