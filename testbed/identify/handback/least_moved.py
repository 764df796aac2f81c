"""The robot that is handed out: of all robots of the same poses, the one nearest to nominal.

Some changes of the numbers together change no pose: the identification leaves one number of each
such group nominal and lets the others stand for it. The robot that leaves the house spends them so
that the links' numbers stay close to those of its maker.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.chain import Chain
from calib.geometry.inverse import spread
from calib.geometry.model import RobotModel
from calib.identification.identify import Identification
from calib.information.rank import RANK_TOLERANCE
from calib.measurement import tables
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, tool_poses

RULE = (
    "many sets of numbers give the same tool pose at every joint vector; the one handed back has "
    "link numbers nearest to nominal, each relative to its tolerance, and base and tool take up "
    "the rest"
)
FRAME = 10.0
"""How far base and tool may go, beside the tolerances of links [m, rad]."""
SAMPLES, STEPS = 41, 30
SETTLED, KEPT = 1e-12, 1e-10
"""Steps that are rounding, and what may be lost of a pose [m, rad]."""
ROUNDING = 1e-5
"""Part of a width below which a deviation is none."""


@dataclass(frozen=True, slots=True, eq=False)
class LeastMoved:
    """An identified robot in the numbers that are handed out."""

    model: RobotModel
    """The same poses as those identified, to rounding."""
    covariance: Array
    """(P, P) of all its numbers [m, rad]."""


def least_moved(
    nominal: Chain,
    result: Identification,
    tolerance: Array,
    limits: Array,
    *,
    covariance: Array | None = None,
) -> LeastMoved:
    """The equivalent of an identified robot whose links lie nearest to nominal.

    Only numbers of base, links and tools that the session freed are moved. Where the links have a
    prior, they lie nearest already, and the covariance stays that of the fit: it holds the prior's
    width.

    Parameters
    ----------
    nominal : Chain
        The maker's.
    result : Identification
        What was found.
    tolerance : (n, 5) array
        Standard deviations of the links' numbers about nominal [rad, m, m, rad, rad].
    limits : (n, 2) array
        Of the joints, over which poses are kept [rad, m].
    covariance : (f, f) array, optional
        Of the numbers identified, if not that of the fit [m, rad].

    References
    ----------
    min |inv(S) (x - x0)| over f(x) = f(x1), S the widths, by Gauss and Newton: each step from the
    singular values of J S; C = P C1 P', P = I - N N' inv(S S), N = S null(J S).
    """
    found, own = result.model, 6 + tolerance.size
    session = {*result.reduction.kept, *result.reduction.dropped}
    session |= {name for name in result.names if name.startswith("tool")}  # of held-out visits, too
    table = result.parameters.names
    free = np.array(
        [k for k, name in enumerate(table)
         if name in session and (k < own or name.startswith("tool"))], dtype=np.int64
    )  # fmt: skip
    width = np.full(found.n_numbers, FRAME)
    width[6:own] = tolerance.ravel()
    wanted, model = _everywhere(found, limits), found
    N = np.zeros((found.n_numbers, 0))
    for _ in range(STEPS):
        seen = predict(model, wanted)
        U, s, Vt = np.linalg.svd(seen.rows[:, :, free].reshape(-1, len(free)) * width[free])
        rank = int((s > RANK_TOLERANCE * s[0]).sum())
        back = Vt[:rank].T @ (U[:, :rank].T @ seen.residual.ravel() / s[:rank])
        away = np.zeros(found.n_numbers)
        away[6:own] = (model.chain.links - nominal.links).ravel() / width[6:own]
        null = Vt[rank:].T
        step = np.zeros(found.n_numbers)
        step[free] = width[free] * (back - null @ (null.T @ (away[free] + back)))
        N = np.zeros((found.n_numbers, null.shape[1]))
        N[free] = width[free, None] * null
        model = model.moved(step)
        if np.abs(step).max() < SETTLED:
            break
    C = result.full_covariance
    if covariance is not None:
        C[np.ix_(result.parameters.free_index, result.parameters.free_index)] = covariance
    if np.abs(predict(model, wanted).residual).max() > KEPT:  # links meters away, if anything
        return LeastMoved(found, frozen(C))
    if result.prior is None or not set(table[6:own]) & set(result.prior.names):
        P = np.eye(found.n_numbers) - N @ (N / width[:, None] ** 2).T
        C = P @ C @ P.T
        # links that base and tool stand for
        sure = 6 + np.flatnonzero(np.diag(C)[6:own] < (ROUNDING * width[6:own]) ** 2)
        C[sure], C[:, sure] = 0.0, 0.0
    return LeastMoved(model, frozen(C))


def _everywhere(model: RobotModel, limits: Array) -> Measurements:
    """The poses of every tool of a model at joints that fill their limits, as a table."""
    q, tools = spread(limits, SAMPLES)[1:], 1 + len(model.fixtures.tools)
    tool = np.repeat(np.arange(tools), len(q))
    nowhere = np.tile(np.eye(4), (len(tool), 1, 1))
    table = tables.poses(np.tile(q, (tools, 1)), nowhere, sd=(1.0, 1.0), tool=tool)
    T = tool_poses(model, table)
    return replace(table, position=T[:, :3, 3], rotation=T[:, :3, :3])
