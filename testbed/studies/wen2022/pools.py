"""Pools, the pose sets chosen from each, and their uncertainty from noise alone, without the truth.

Results of a single designed set depend on chance. So every trial's method is used anew in each of
several pools, and figures have the scatter between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Index
from calib.design import Problem, pose_count, random_selection
from calib.geometry.parameters import Parameters
from calib.measurement.noise import whiteners
from calib.uncertainty.covariance import matrix_row_weights
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import TrialSettings
from testbed.streams import stream
from testbed.studies.many_robots import alone, together
from testbed.studies.trial.play import criterion_of, select
from testbed.studies.trial.random_sets import SPARE_POSES
from testbed.studies.wen2022.paper_set import by_paper
from testbed.studies.wen2022.records import PoolSets, TrialSets

RANDOM_SETS = 200
"""Random sets of each size whose predicted uncertainty is averaged, per pool."""


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Information of each pose of a pool on the free numbers, in scaled columns."""

    exact: Array
    """(N, f, f) J'S^-1 J: information of the whitened rows."""
    normal: Array
    """(N, f, f) J'WJ of the paper's unweighted rows."""
    scatter: Array
    """(N, f, f) J'W S WJ: the noise S propagated through these rows."""
    goal: Array
    """(f, f) mean over the held-out poses of J'J of the tool point."""
    scale: Array
    """(f,) units of the columns [m or rad]."""

    def predicted(self, sets: Index) -> tuple[Array, Array]:
        """Standard uncertainties (k, 2, f) and tool-point u (k, 2) of sets (k, m).

        References
        ----------
        C = inv(J'S^-1 J) and C = inv(H) J'W S WJ inv(H), H = J'WJ (sandwich).
        """
        exact, normal, scatter = (
            part[sets].sum(axis=1) for part in (self.exact, self.normal, self.scatter)
        )
        half = np.swapaxes(np.linalg.solve(normal, scatter), 1, 2)
        whole = np.broadcast_to(np.eye(len(self.scale)), exact.shape)
        C = np.stack([np.linalg.solve(normal, half), np.linalg.solve(exact, whole)], axis=1)
        variance = np.diagonal(C, axis1=2, axis2=3)
        tool = np.einsum("kefg,gf->ke", C, self.goal)
        return np.sqrt(variance) * self.scale, np.sqrt(tool)


def noise_of(laboratory: Laboratory, parameters: Parameters) -> Noise:
    """Noise of every pose of a laboratory's pool, at the nominal robot."""
    setting, free = laboratory.setting, parameters.free
    J = setting.nominal.poses_and_jacobian(setting.pool_q)[1][:, :, free] * parameters.free_scale
    # rows whitened, and rows with the paper's weights
    S = laboratory.covariance(setting.pool_q)
    A, W = whiteners(S) @ J, matrix_row_weights(len(J))
    WJ = W @ J
    # noise through those weights: J'W L L' W J
    across = np.swapaxes(np.linalg.cholesky(S), 1, 2) @ WJ
    # tool point at the held-out poses
    goals = setting.nominal.poses_and_jacobian(setting.test_q)[1][:, :3, free]
    rows = (goals * parameters.free_scale).reshape(-1, parameters.n_free)
    return Noise(
        exact=np.swapaxes(A, 1, 2) @ A,
        normal=np.swapaxes(J, 1, 2) @ WJ,
        scatter=np.swapaxes(across, 1, 2) @ across,
        goal=rows.T @ rows / len(goals),
        scale=parameters.free_scale,
    )


AXES = dict.fromkeys(("pool_q", "test_q", "pose_number"), 0)
SET_AXES = dict.fromkeys(("indices", "u", "tool_u"), 0)


def play_pools(scenario: Scenario, setting: Setting, pools: range) -> PoolSets:
    """Some of the pools with their sets."""
    laboratory = open_laboratory(scenario, setting)
    return gather([play_pool(laboratory, p) for p in pools])


def gather(parts: Sequence[PoolSets]) -> PoolSets:
    """The pools of all parts."""
    sets = zip(*(part.sets for part in parts), strict=True)
    joined = tuple(together(of_one_trial, SET_AXES) for of_one_trial in sets)
    return replace(together(parts, AXES), sets=joined)


def play_pool(laboratory: Laboratory, pool: int) -> PoolSets:
    """Draw one pool and the sets from it."""
    scenario, free = laboratory.scenario, laboratory.free("paper")
    N = scenario.pool.size
    rng = stream(scenario.seed, "reexamined", "pool", pool)
    q = laboratory.candidates().draw(rng, size=N + scenario.test.poses).q
    own = laboratory.with_poses(q[:N], q[N:])
    noise = noise_of(own, free)
    return PoolSets(
        names=free.free_names,
        sets=tuple(trial_sets(own, noise, trial, pool) for trial in (*scenario.trial, None)),
        **alone(AXES, pool_q=q[:N], test_q=q[N:], pose_number=pose_number(own, pool)),
    )


def trial_sets(own: Laboratory, noise: Noise, trial: TrialSettings | None, pool: int) -> TrialSets:
    """A trial's kind of set in one pool; without a trial the random set of the paper's budget.

    A designed set is chosen here. Random ones are drawn anew for each robot: their prediction is a
    mean over many sets, and they have no places in the pool.
    """
    seed, N = own.scenario.seed, len(noise.exact)
    size = min(own.scenario.budget.poses, N) if trial is None else trial.poses
    if designed := trial is not None and trial.method != "random":
        rng = stream(seed, "reexamined", "select", trial.name, pool)
        blocks = own.design_blocks(trial.rows)
        chosen = select(blocks, trial, rng, criterion_of(own, trial)).indices
        sets = chosen[None]
    else:
        rng = stream(seed, "reexamined", "random", size, pool)
        chosen = np.zeros(0, dtype=np.int64)
        sets = np.array([random_selection(N, size, rng) for _ in range(RANDOM_SETS)])
    u, tool_u = noise.predicted(sets)
    return TrialSets(
        trial=f"random-{own.scenario.budget.poses}" if trial is None else trial.name,
        poses=size,
        designed=designed,
        by_paper=trial is not None and by_paper(trial),
        criterion="" if trial is None else trial.criterion,
        **alone(SET_AXES, indices=chosen, u=u.mean(axis=0), tool_u=tool_u.mean(axis=0)),
    )


def pose_number(laboratory: Laboratory, pool: int) -> tuple[int, int]:
    """Numbers of poses at which O1 and O2 of random sets settle in the paper's rows; -1: never."""
    blocks = laboratory.design_blocks("paper")
    largest = min(laboratory.scenario.studies.pose_count_max, len(blocks))
    problem = Problem.of_blocks(blocks, len(blocks), "D")
    rng = stream(laboratory.scenario.seed, "reexamined", "pose_count", pool)
    curves = pose_count(problem, rng, counts=range(problem.fewest + SPARE_POSES, largest + 1))
    first, second = (-1 if curve.chosen is None else curve.chosen for curve in curves[:2])
    return first, second
