"""Whether a table holds enough independent equations for what is to be identified from it."""

import numpy as np

from calib.arrays import Array, check
from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.reduction import reduce
from calib.measurement.observations import Measurements
from calib.measurement.residual import stacked


def require_equations(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
) -> None:
    """Refuse a table without more independent equations than numbers to be found.

    Numbers are counted as the directions that many poses of this kind would tell apart; one
    equation more than that leaves a residual to judge the fit by.
    """
    count, have = _independent(measurements)
    if have > parameters.n_free:
        return
    numbers = _generic_rank(nominal, measurements, parameters)
    if have > numbers:
        return
    poses = f"{count} different pose{'s' if count != 1 else ''}"
    raise InputError(
        f"{poses} give{'s' if count == 1 else ''} {have} equations for {numbers} parameters",
        code="M27",
        field="measurements",
        value=count,
        fix=f"measure at least {numbers * count // have + 1}",
    )


def _independent(measurements: Measurements) -> tuple[int, int]:
    """Different joint vectors, and the equations they can give: a repeat adds none of its own.

    Several reflectors seen at one joint vector give no more than the six of its pose.
    """
    key = np.column_stack([measurements.q, measurements.offset, measurements.is_pose])
    first = np.unique(key, axis=0, return_index=True)[1]
    _, pose = np.unique(measurements.q[first], axis=0, return_inverse=True)
    rows = np.bincount(pose.ravel(), np.where(measurements.is_pose[first], 6, 3))
    return len(rows), int(np.minimum(rows, 6).sum())


def _generic_rank(nominal: RobotModel, measurements: Measurements, parameters: Parameters) -> int:
    """Free numbers that many poses of this kind, spread over the joints, would tell apart."""
    m = 2 * parameters.n_free
    (q,) = check(f"m {nominal.chain.n_joints}", q=_spread(m, nominal.chain.n_joints))
    like = measurements.rows(np.arange(m) % len(measurements))
    table = Measurements(
        q=q,
        position=like.position,
        rotation=nominal.poses(q)[:, :3, :3],
        covariance=like.covariance,
        kind=like.kind,
        offset=like.offset,
        pose_id=np.arange(m),
        repeat=np.zeros(m, dtype=np.int64),
    )
    A = stacked(nominal, table).A[:, parameters.free_index] * parameters.free_scale
    return reduce(A, parameters, model=nominal).rank


def _spread(m: int, n: int) -> Array:
    """Joint vectors (m, n) [rad, m] spread evenly over [-2, 2]: multiples of roots of primes."""
    primes = np.array([k for k in range(2, 8 * n + 8) if all(k % d for d in range(2, k))])[:n]
    return 4 * (np.outer(np.arange(1, m + 1), np.sqrt(primes)) % 1) - 2
