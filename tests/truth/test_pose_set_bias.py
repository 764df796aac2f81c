"""Why designed pose sets lose to random ones on robots that sag: where they sit, not how many.

The error of a noise-free calibration is split in two: what no value of the 24 numbers can follow
(the floor, the same for all sets), and what the calibration adds because the set's poses pull the
numbers away from the best ones (the excess). Then the model's errors are shuffled among the poses
of the pool, which cuts the link between a pose and how the robot is wrong there.
"""

from dataclasses import replace

import numpy as np
import pytest

from calib.design import Problem, exchange, random_selection
from calib.geometry.frames import log_so3
from calib.identification.identify import identify
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.setting import make_setting
from testbed.scenario.read import changed
from testbed.streams import stream
from testbed.studies import load_scenario

pytestmark = [pytest.mark.truth, pytest.mark.slow]
POSES, ROBOTS, DRAWS = 61, 8, 12


@pytest.fixture(scope="module")
def robots():
    """Bench, whitened rows (N, 6, 24) of the pool, rows (t, 3, 24) of the tool at other poses, and
    per robot what the best 24 numbers leave: whitened (N, 6) at the pool, [m] (t, 3) elsewhere."""
    scenario = changed(load_scenario("pose_sets"), {"test.poses": 600})
    setting = make_setting(scenario)
    bench = open_laboratory(scenario, setting)
    table, pool, other = bench.kept(), setting.pool_q, setting.test_q
    A = bench.whitened_rows(pool)[:, :, table.free] * table.free_scale
    J = setting.nominal.poses_and_jacobian(other)[1][:, :3, table.free] * table.free_scale
    L, left = np.linalg.cholesky(bench.covariance(pool)), []
    for k in range(ROBOTS):
        seed = int(stream(scenario.seed, "population", "robot", k).integers(2**62))
        truth = draw_truth(bench.robot, scenario.truth, seed)
        T = truth.poses(other)
        noisy = bench.measure(other, np.arange(len(other)), "any")
        exact = replace(noisy, position=T[:, :3, 3], rotation=T[:, :3, :3])
        best = identify(setting.nominal, exact, table).model
        true, fitted = truth.poses(pool), best.poses(pool)
        turn = log_so3(true[:, :3, :3] @ np.swapaxes(fitted[:, :3, :3], 1, 2))
        apart = np.concatenate([true[:, :3, 3] - fitted[:, :3, 3], turn], axis=1)
        elsewhere = T[:, :3, 3] - best.poses(other)[:, :3, 3]
        left.append((np.linalg.solve(L, apart[:, :, None])[..., 0], elsewhere))
    return bench, A, J, left


def added(A, J, chosen, left):
    """Tool error (t, 3) [m] that a set adds when its poses are wrong by `left` (m, 6)."""
    step = np.linalg.lstsq(A[chosen].reshape(-1, A.shape[2]), left.reshape(-1), rcond=None)[0]
    return J @ step


def rms(values):
    return float(np.sqrt(np.mean(np.sum(np.square(values), axis=-1))))


@pytest.fixture(scope="module")
def excess(robots):
    """Excess [m] of the D set and of random sets, with their own and with shuffled errors."""
    bench, A, J, left = robots
    rng, n = np.random.default_rng(6), len(A)
    blocks = bench.design_blocks("whitened")
    designed = exchange(Problem.of_blocks(blocks, POSES, "D"), np.random.default_rng(7)).indices
    own, shuffled = {"designed": [], "random": []}, {"designed": [], "random": []}
    for whitened, _ in left:
        for _ in range(DRAWS):
            sets = {"designed": designed, "random": random_selection(n, POSES, rng)}
            strangers = rng.choice(n, POSES, replace=False)
            for name, chosen in sets.items():
                own[name].append(added(A, J, chosen, whitened[chosen]))
                shuffled[name].append(added(A, J, chosen, whitened[strangers]))
    return designed, {k: rms(v) for k, v in own.items()}, {k: rms(v) for k, v in shuffled.items()}


def test_most_of_the_error_is_common_to_all_sets(robots, excess):
    _, _, _, left = robots
    floor = np.sqrt(np.mean([rms(elsewhere) ** 2 for _, elsewhere in left]))
    _, own, _ = excess
    # measured over 12 pools and 20 robots: floor 82 um, excess 26 um (random), 41 um (D)
    assert floor > 1.5 * own["designed"]


def test_the_designed_set_adds_more_error_than_random_sets_do(excess):
    _, own, _ = excess
    # 26 to 41 um over 12 pools, a ratio of 1.6 with a standard deviation below 0.1
    assert own["designed"] > 1.3 * own["random"]


def test_with_the_models_errors_shuffled_among_the_poses_it_adds_less(excess):
    """The same set, the same errors, but not where they belong: then the smaller variance wins."""
    _, own, shuffled = excess
    assert shuffled["designed"] < shuffled["random"]
    # for random sets the place of an error is of no account: only the scatter of 96 draws
    assert shuffled["random"] == pytest.approx(own["random"], rel=0.2)
    assert shuffled["designed"] < 0.75 * own["designed"]


def test_designed_poses_sit_where_the_model_is_most_wrong(robots, excess):
    _, _, _, left = robots
    chosen, _, _ = excess
    share = [np.mean(w[chosen] ** 2) / np.mean(w**2) for w, _ in left]
    # 1.6 over 12 pools; a random set of 61 stays within 1 +- 0.15
    assert np.mean(share) > 1.35
