"""What each kind of measurement can tell, on every arm: ranks, words, and the numbers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import qr

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Identification, Status, identify
from calib.identification.lack_of_fit import lack_of_fit
from calib.identification.outliers.scores import inspect
from calib.identification.prior import Prior
from calib.information.reduction import Reduction, reduce
from calib.information.sizes import weak_prior_sd
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict
from calib.measurement.residual import linearize, table_whiteners
from tests.calib.kinds import (
    ARMS,
    KINDS,
    OFFSET,
    anywhere,
    distances,
    joints,
    measured,
    points,
    poses,
    true_robot,
)
from tests.reference import BASE6, TOOL6, pool_r, tx60

LINKS = tuple(name for name in tx60().names if "." not in name)
REFLECTORS = np.array([OFFSET, (-0.04, 0.02, 0.06), (0.01, -0.06, 0.03)])
ANCHORS = np.array([[1.5, -1, 0.3], [-1, 1.2, 0.5], [0.8, 1.6, -0.4], [-1.2, -1, 0.9]])


def reduced(
    model: RobotModel, table: Measurements, free: tuple[str, ...] | None = None
) -> Reduction:
    """Reduction of a table's rows, its rank checked a second way."""
    parameters = parameters_of(model, free)
    A = linearize(model, table).A[:, parameters.free_index] * parameters.free_scale
    found = reduce(A, parameters, model=model, q=table.q)
    pivots = np.abs(np.diag(qr(A, mode="r", pivoting=True)[0]))
    # 1e-8 lies between the weakest direction of these tables (1e-3) and rounding (1e-15)
    assert found.rank == (pivots > 1e-8 * pivots[0]).sum() == len(found.kept)
    return found


def with_reflectors(n: int) -> tuple[RobotModel, Measurements]:
    rng, model = np.random.default_rng(0), replace(tx60(), fixtures=Fixtures(REFLECTORS[:n]))
    return model, joined([points(model, pool_r(61), rng, reflector=k) for k in range(n)])


def with_anchors(n: int) -> tuple[RobotModel, Measurements]:
    rng, model = np.random.default_rng(0), replace(tx60(), fixtures=Fixtures(anchors=ANCHORS[:n]))
    return model, joined([distances(model, pool_r(100), rng, anchor=k) for k in range(n)])


@pytest.mark.parametrize(("n", "numbers", "rank"), [(1, 39, 27), (2, 42, 30), (3, 45, 33)])
def test_reflectors_of_unknown_place_tell_three_numbers_each(n: int, numbers: int, rank: int):
    model, table = with_reflectors(n)
    free = (*BASE6, *LINKS, *model.fixtures.names)
    assert len(free) == numbers
    assert reduced(model, table, free).rank == rank
    # a free tool adds nothing: it is held, and the reflectors are placed in it
    everything = reduced(model, table)
    assert everything.rank == rank
    assert set(TOOL6) <= set(everything.dropped)
    assert set(model.fixtures.names) <= set(everything.kept)


@pytest.mark.parametrize(("n", "rank"), [(1, 24), (2, 26), (3, 27), (4, 27)])
def test_distances_to_known_points_tell_a_frame_once_there_are_three(n: int, rank: int):
    model, table = with_anchors(n)
    assert reduced(model, table, tx60().names).rank == rank
    assert reduced(model, table, LINKS).rank == 23


def test_a_distance_to_one_unknown_point_tells_no_more_than_to_a_known_one_and_says_so():
    model, table = with_anchors(1)
    found = reduced(model, table)
    assert (found.rank, len(model.names)) == (24, 45)
    assert {"anchor1.x", "anchor1.y", "anchor1.z"} <= set(found.kept)
    assert set(BASE6) <= set(found.dropped)
    assert (
        "base.x cannot be told from anchor1.x: any change of base.x looks like the opposite change "
        "of anchor1.x"
    ) in found.sentences


@pytest.mark.parametrize(("n", "rank"), [(2, 29), (3, 30)])
def test_reflectors_of_known_place_tell_the_tool(n: int, rank: int):
    rng, q = np.random.default_rng(0), pool_r(61)
    table = joined(
        [replace(points(tx60(), q, rng), offset=np.tile(c, (61, 1))) for c in REFLECTORS[:n]]
    )
    assert reduced(tx60(), table).rank == rank


def test_a_second_station_adds_six_numbers_that_can_all_be_told():
    rng = np.random.default_rng(1)
    model = replace(tx60(), fixtures=Fixtures(stations=[anywhere(rng, 2.0)]))
    q = pool_r(40)
    table = joined([poses(model, q[:20], rng), poses(model, q[20:], rng, station=1)])
    found = reduced(model, table)
    assert (found.rank, len(model.names)) == (36, 48)
    assert set(model.fixtures.names) <= set(found.kept)
    # seen from the second station alone, base and station are one
    assert reduced(model, table.rows(table.station == 1)).rank == 30


@pytest.mark.parametrize(("arm", "rank"), [("tx60", 30), ("ur10", 30), ("iiwa", 34), ("scara", 20)])
def test_full_poses_tell_four_numbers_per_turning_joint_two_per_sliding_one_and_six(arm, rank):
    rng, model = np.random.default_rng(2), RobotModel(ARMS[arm])
    q = joints(arm, rng, 60)
    assert reduced(model, poses(model, q, rng)).rank == rank


def test_a_ur10_keeps_the_betas_of_its_three_parallel_axes():
    rng, model = np.random.default_rng(3), RobotModel(ARMS["ur10"])
    table = poses(model, joints("ur10", rng, 60), rng)
    found = reduced(model, table)
    assert (found.rank, len(model.names)) == (30, 42)
    assert [name for name in found.kept if name.startswith("beta")] == ["beta2", "beta3"]
    for other in ("d2", "d3"):
        assert (
            f"{other} cannot be told from d4: any change of {other} looks like the same change of "
            "d4"
        ) in found.sentences
    without = tuple(n for n in model.names if n not in ("beta1", "beta4", "beta5", "beta6"))
    fewer = reduced(model, table, without)
    assert (fewer.rank, len(without)) == (30, 38)
    assert fewer.dropped == ("theta1", "d1", "d2", "d3", "theta6", "d6", "a6", "alpha6")


def gantry() -> RobotModel:
    """Three slides at right angles: the tool keeps one orientation."""
    turn = np.pi / 2
    return RobotModel(
        Chain([[0, 0, 0, turn, 0], [turn, 0, 0, turn, 0], [0, 0.1, 0, 0, 0]], ("prismatic",) * 3)
    )


@pytest.mark.parametrize("reflector", [-1, 0], ids=["given", "of unknown place"])
def test_a_tool_that_never_turns_is_held_where_it_is_and_the_base_is_found(reflector: int):
    rng, model = np.random.default_rng(4), replace(gantry(), fixtures=Fixtures([OFFSET]))
    q = rng.uniform(-0.5, 0.5, (20, 3))
    table = points(model, q, rng, reflector=reflector)
    free = (*BASE6, *TOOL6[:3], *model.fixtures.names) if reflector == 0 else (*BASE6, *TOOL6[:3])
    found = reduced(model, table, free)
    assert found.kept == BASE6
    assert found.sentences[0].startswith("the tool keeps one orientation in all poses: tool.x")
    assert ("reflector1.z" in found.sentences[0]) == (reflector == 0)


def near(true: RobotModel, rng: np.random.Generator) -> RobotModel:
    """A nominal robot close enough for a fit: frames and fixtures off by a millimeter or two."""
    size = np.where(true.is_length, 0.5e-3, 2e-3)
    return true.moved(rng.normal(size=true.n_numbers) * size)


def fitted(kind: str, seed: int, m: int, noise: float) -> tuple[RobotModel, Identification]:
    """A TX60 identified from a table of one kind, all numbers of robot and fixtures free."""
    rng = np.random.default_rng(seed)
    q = joints("tx60", rng, m)
    true, _, table, unknown = measured(kind, "tx60", q, rng)
    seen = predict(true, table).residual
    if not noise:
        table = replace(
            table,
            position=table.position - np.where(table.is_distance[:, None], 0, seen[:, :3]),
            rotation=np.where(
                table.is_pose[:, None, None], _turned(-seen[:, 3:]) @ table.rotation, table.rotation
            ),
            distance=table.distance - np.where(table.is_distance, seen[:, 0], 0),
        )
    held = [f"anchor{k + 1}." for k in range(len(true.fixtures.anchors)) if k not in unknown]
    nominal = near(true, rng)
    fixed = replace(nominal.fixtures, anchors=true.fixtures.anchors) if held else nominal.fixtures
    nominal = replace(nominal, fixtures=fixed)
    free = [name for name in true.names if not name.startswith(tuple(held) or ("-",))]
    return true, identify(nominal, table, parameters_of(nominal, free))


def _turned(w: Array) -> Array:
    from calib.geometry.frames import exp_so3

    return exp_so3(w)


@pytest.mark.parametrize("kind", KINDS)
def test_perfect_measurements_of_every_kind_predict_what_was_not_measured(kind: str):
    true, found = fitted(kind, 5, 60, noise=0.0)
    assert found.status is Status.CONVERGED
    _, _, other, _ = measured(kind, "tx60", joints("tx60", np.random.default_rng(6), 30),
                              np.random.default_rng(5))  # fmt: skip
    # what it says of other joints is what the true robot says, to rounding over the worst
    # condition, 1e-16 x 1e3 meters, and the curvature left by 1e-10 standard deviations
    apart = predict(found.model, other).residual - predict(true, other).residual
    assert np.abs(apart).max() < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_noise_of_known_size_gives_a_chi_square_of_its_degrees_of_freedom(kind: str):
    _, found = fitted(kind, 7, 80, noise=1.0)
    assert found.status is Status.CONVERGED
    # four standard deviations of chi-square
    assert abs(found.chi_square - found.dof) < 4 * np.sqrt(2 * found.dof)
    assert len(found.names) == found.rank < len(found.parameters.names)


def test_reflectors_are_found_within_their_stated_uncertainty():
    """Errors of all 33 kept numbers of four robots, normalized by their own covariance."""
    score = 0.0
    for seed in range(4):
        (_, found), (_, exact) = (
            fitted("three reflectors", 20 + seed, 60, noise=noise) for noise in (1.0, 0.0)
        )
        # without noise the fit ends at the truth in the same gauge
        assert found.names == exact.names
        error = found.step - exact.step
        score += float(error @ np.linalg.solve(found.covariance, error))
    # chi-square with 4 x 33 degrees of freedom, four standard deviations
    assert abs(score - 4 * 33) < 4 * np.sqrt(2 * 4 * 33)


def test_a_prior_makes_up_for_what_no_measurement_tells():
    rng = np.random.default_rng(8)
    true, _, table, _ = measured("unknown anchor", "tx60", joints("tx60", rng, 80), rng)
    nominal = near(true, rng)
    parameters = parameters_of(nominal)
    prior = Prior(np.zeros(nominal.n_numbers), 5 * weak_prior_sd(parameters), parameters.names)
    found = identify(nominal, table, parameters, prior=prior)
    assert found.status is Status.CONVERGED
    assert len(found.names) == nominal.n_numbers


def refused(kind: str, m: int, free: tuple[str, ...]) -> InputError:
    rng = np.random.default_rng(9)
    true, _, table, _ = measured(kind, "tx60", joints("tx60", rng, m), rng)
    known = () if kind != "four anchors" else tuple(
        name for name in true.names if name.startswith("anchor")
    )  # fmt: skip
    names = [n for n in true.names if n.startswith(free) and n not in known]
    with pytest.raises(InputError) as caught:
        identify(near(true, rng), table, parameters_of(true, names))
    assert caught.value.code == "M27"
    return caught.value


@pytest.mark.parametrize(
    ("kind", "m", "said", "least"),
    [
        ("poses", 5, "5 different poses give 30 equations for 30 parameters", 6),
        ("one point", 9, "9 different poses give 27 equations for 27 parameters", 10),
        ("unknown anchor", 24, "24 different poses give 24 equations for 24 parameters", 25),
        ("known anchor", 24, "24 different poses give 24 equations for 24 parameters", 25),
        ("four anchors", 9, "9 different poses give 27 equations for 27 parameters", 10),
    ],
)
def test_too_few_are_refused_with_what_is_there_and_what_is_needed(kind, m, said, least):
    free = ("base", "tool", "theta", "d", "a", "beta", "reflector", "anchor")
    if kind == "known anchor":
        free = ("base", "tool", "theta", "d", "a1", "a2", "a3", "a4", "a5", "a6", "al", "beta")
    error = refused(kind, m, free)
    assert said in str(error)
    assert f"measure at least {least}" in str(error)


@pytest.mark.parametrize("joint", range(6))
def test_a_joint_that_never_moves_is_named_for_reflectors_too(joint: int):
    model, table = with_reflectors(3)
    q = table.q.copy()
    q[:, joint] = 0.3
    found = reduced(model, replace(table, q=q))
    assert found.sentences[0].startswith(f"joint {joint + 1} never moves")
    # four numbers of the joint, as with poses
    assert found.rank == 33 - 4


def test_repeats_are_told_apart_from_other_reflectors_and_anchors_at_the_same_joints():
    rng, true = np.random.default_rng(10), true_robot("tx60", np.random.default_rng(10))
    q = pool_r(20)
    once = joined([points(true, q, rng, reflector=0), distances(true, q, rng, anchor=2)])
    assert _lack(true, once) is None
    twice = joined([once, replace(points(true, q, rng, reflector=0), repeat=np.ones(20))])
    found = _lack(true, twice)
    assert found is not None
    # 20 points seen twice: 60 equations of pure scatter
    assert found.dof_error == 60
    assert found.p_value > 1e-3


def _lack(true: RobotModel, table: Measurements):
    return lack_of_fit(linearize(true, table).r, table, table_whiteners(table), 0.0)


def test_a_distance_that_is_wrong_is_named_by_its_row():
    rng = np.random.default_rng(11)
    true, _, table, _ = measured("four anchors", "tx60", joints("tx60", rng, 60), rng)
    distance = table.distance.copy()
    distance[33] += 1e-3
    table = replace(table, distance=distance)
    free = [name for name in true.names if not name.startswith("anchor")]
    found = identify(true, table, parameters_of(true, free), loss="huber")
    judged = inspect(true, found, table)
    assert np.flatnonzero(judged.suspect).tolist() == [33]
    assert "(row 33) does not fit" in judged.sentences(table)[0]
