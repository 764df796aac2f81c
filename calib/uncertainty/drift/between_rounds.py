"""Whether visits of one pose differ from round to round: a drift, or joints that all turn alike.

Joints that come back badly scatter anew at each visit, and the mean of many moves is free of it.
Joints that warm, or that a whole round approached from another side, are displaced at all poses of
the round; so is the mean of many moves by an arm that is then used so.
"""

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from calib.information.rank import RANK_TOLERANCE
from calib.measurement.noise import whiteners
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.drift.between_repeats import APART, RepeatDrift, beyond_noise, repeat_drift
from calib.uncertainty.statement.repeats import FEWEST_FREEDOM, repeated, sound

SEED = 20_223
"""Of the permutations: the same readings give the same answer."""
SHOWN = 0.01
"""Chance of visits that differ so, if they scatter, below which rounds are said to differ: R95 of
one set in a hundred then has a part that scatter alone made, which is as small as that is."""
PERMUTATIONS, BLOCK = 2000, 1_000_000
"""Orders of the visits that are tried, and numbers in memory at a time."""


def visits_apart(model: RobotModel, visits: Measurements, order: Index) -> RepeatDrift | None:
    """What visits of the same poses differ by beyond scatter; None where nothing is shown.

    A drift as `repeat_drift` finds it, else turns of the joints from round to round.

    Parameters
    ----------
    model : RobotModel
        Identified.
    visits : Measurements
        Poses and points (m,), no distances.
    order : (m,) array of int
        Place of each row in time.
    """
    found = repeat_drift(model, visits, order)
    if found is not None:
        return found
    seen, N = predict(model, visits), visits.covariance[:, :3, :3]
    y, at = seen.residual[:, :3], np.argsort(np.argsort(order, kind="stable"))
    groups = _of_rounds(visits, sound(y, N, repeated(visits)), at)
    if sum(3 * (rows.size - len(rows)) for rows in groups) < FEWEST_FREEDOM:
        return None
    p = _chance(model, y, seen.rows[:, :3], visits, groups)
    sd = float(np.sqrt(max(beyond_noise(y, N, groups), 0.0)))
    if p >= SHOWN or sd == 0:
        return None
    apart = float(np.sqrt(6)) * sd  # two visits, three axes
    return RepeatDrift(p, False, False, apart, frozen(np.zeros_like(y)), sd, joints=True)


def _of_rounds(visits: Measurements, groups: list[Index], at: Index) -> list[Index]:
    """Rows (g, r) of each pose and target in time, without shots that follow each other at a stop.

    None where these are most of them, or visits of a pose lie in one part of the time.
    """
    pose = visits.pose_id[np.argsort(at)]
    stop = np.cumsum(np.concatenate([[0], pose[1:] != pose[:-1]]))[at]
    found, count = [], sum(len(rows) for rows in groups)
    for rows in groups:
        in_time = np.take_along_axis(rows, np.argsort(at[rows], axis=1), axis=1)
        found.append(in_time[(np.diff(stop[in_time], axis=1) > 0).all(axis=1)])
    found = [rows for rows in found if len(rows)]
    if not found or 2 * sum(len(rows) for rows in found) < count:
        return []
    apart = np.concatenate([np.ptp(at[rows], axis=1) for rows in found])
    return found if np.median(apart) >= APART * max(len(at) - 1, 1) else []


def _chance(
    model: RobotModel, y: Array, rows: Array, visits: Measurements, groups: list[Index]
) -> float:
    """Chance that the k-th visits of all poses differ so by turns of each joint, if they scatter.

    References
    ----------
    Permutation test: what turns of the joints in each round explain of the whitened differences
    from the means of poses, against the same with the visits of each pose in another order, which
    scatter alone makes as likely. All targets of a pose keep one order: joints come back once.
    """
    joints = rows[:, :, joint_columns(model.chain)]
    W, n = whiteners(visits.covariance[:, :3, :3]), joints.shape[2]
    most = max(some.shape[1] for some in groups)
    A, b = [], []
    for some in groups:
        of = np.arange(some.shape[1])[:, None] == np.arange(1, most)
        turns = (of[None, :, None, :, None] * joints[some][:, :, :, None, :]).reshape(
            *some.shape, 3, (most - 1) * n
        )
        A.append(W[some] @ (turns - turns.mean(axis=1, keepdims=True)))
        b.append(y[some] - y[some].mean(axis=1, keepdims=True))
    flat = np.concatenate([one.reshape(-1, one.shape[-1]) for one in A])
    size = np.sqrt(np.square(flat).sum(axis=0))
    U, s, _ = np.linalg.svd(flat / np.where(size > 0, size, 1.0), full_matrices=False)
    U = U[:, s > RANK_TOLERANCE * s.max(initial=0.0)]

    def explained(orders: list[Index]) -> Array:
        """(k,) of the differences (k, g, r, 3), visits in these orders (k, g, r)."""
        mixed = [
            (W[some] @ np.take_along_axis(one[None], order[..., None], axis=2)[..., None])[..., 0]
            for some, one, order in zip(groups, b, orders, strict=True)
        ]
        whole = np.concatenate([one.reshape(len(one), -1) for one in mixed], axis=1)
        return np.asarray(np.square(whole @ U).sum(axis=1))

    as_seen = [np.broadcast_to(np.arange(some.shape[1]), (1, *some.shape)) for some in groups]
    seen = float(explained(as_seen)[0])
    rng, larger = np.random.default_rng(SEED), 0
    block = max(1, min(PERMUTATIONS, BLOCK // len(flat)))
    for k in range(0, PERMUTATIONS, block):
        count = min(block, PERMUTATIONS - k)
        orders = []
        for some in groups:
            poses, which = np.unique(visits.pose_id[some[:, 0]], return_inverse=True)
            drawn = np.argsort(rng.random((count, len(poses), some.shape[1])), axis=2)
            orders.append(drawn[:, which.ravel()])
        larger += int((explained(orders) >= seen * (1 - 1e-12)).sum())
    return (1 + larger) / (1 + PERMUTATIONS)
