"""Whether what visits of one pose differ by is a drift: of the readings as a whole, or of the tool.

Joints that come back badly scatter from visit to visit; a drift goes with time.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import fdtrc

from calib.arrays import Array, FloatOrNan, Index, frozen
from calib.geometry.model import RobotModel
from calib.measurement.noise import whiteners
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, tool_poses
from calib.shown import Shown
from calib.uncertainty.statement.repeats import FEWEST_FREEDOM, repeated, sound

SHOWN = 1e-3
"""A p-value below which visits are said to differ by a drift."""
ODDS = 20.0
"""Readings or tool: which of them drifts is said at odds of so many to one."""


@dataclass(frozen=True, slots=True, eq=False)
class RepeatDrift(Shown):
    """A drift that visits of the same poses show."""

    p_value: FloatOrNan
    """Chance of visits that differ so in step with time, if they scatter; of both kinds asked."""
    of_tool: bool
    """Whether it is one in the axes of the tool, else in those of the station."""
    or_else: bool
    """Whether the other explains the differences about as well."""
    size: float
    """Distance between where it was at the first and at the last of the visits [m]."""
    shift: Annotated[Array, "m", 3]
    """(m, 3) what it adds to each position, about its mean over the rows [m]."""

    def __repr__(self) -> str:
        return f"RepeatDrift({1e6 * self.size:.3g} um, {'tool' if self.of_tool else 'readings'})"

    @property
    def what(self) -> str:
        """What drifts, in words."""
        both = ("the tool", "the base, the instrument or the warming arm")
        one, other = both if self.of_tool else both[::-1]
        return f"{one} or {other}" if self.or_else else one

    @property
    def sentence(self) -> str:
        """The finding in words."""
        return (
            "visits of the same poses differ in step with time (p < 0.001): "
            f"{self.what} drifted by {1e6 * self.size:.2g} um between the first row and the last; "
            "this is no scatter of the joints, and is not counted as one"
        )


def repeat_drift(model: RobotModel, visits: Measurements, order: Index) -> RepeatDrift | None:
    """A drift that goes with time between visits of the same poses; None where none is shown.

    Parameters
    ----------
    model : RobotModel
        Identified.
    visits : Measurements
        Poses and points (m,), no distances.
    order : (m,) array of int
        Place of each row in time.

    References
    ----------
    Whitened positions about the means of their poses, regressed on t and t^2 (also about these
    means) in axes of the station, or of the tool: F of 6 and sum 3 (r - 1) - 6 degrees of freedom,
    the smaller p of the two, doubled.
    """
    groups = repeated(visits)
    freedom = sum(3 * (rows.size - len(rows)) for rows in groups)
    if freedom < FEWEST_FREEDOM:
        return None
    y, N = predict(model, visits).residual[:, :3], visits.covariance[:, :3, :3]
    at = np.argsort(np.argsort(order, kind="stable"), kind="stable") / max(len(order) - 1, 1) - 0.5
    powers = np.stack([at, at**2], axis=1)
    axes = {False: np.broadcast_to(np.eye(3), (len(y), 3, 3)),
            True: tool_poses(model, visits)[:, :3, :3]}  # fmt: skip
    groups = sound(y, N, groups)
    W, found = whiteners(N), {}
    for of_tool, R in axes.items():
        X = (R[:, :, None, :] * powers[:, None, :, None]).reshape(len(y), 3, 6)
        rows = [_about_means(np.concatenate([X, y[..., None]], axis=2), some) for some in groups]
        whole = np.concatenate([
            (W[some] @ about).reshape(-1, 7) for some, about in zip(groups, rows, strict=True)
        ])  # fmt: skip
        A, b = whole[:, :6], whole[:, 6]
        x = np.linalg.lstsq(A, b, rcond=None)[0]
        found[of_tool] = (float(np.square(b - A @ x).sum()), float(b @ b), x, X @ x)
    freedom = sum(3 * (rows.size - len(rows)) for rows in groups) - 6
    of_tool = found[True][0] < found[False][0]
    left, square, x, shift = found[of_tool]
    if freedom <= 0 or left <= 0:
        return None
    p = min(1.0, 2 * float(fdtrc(6, freedom, (square - left) / 6 / (left / freedom))))
    if p >= SHOWN:
        return None
    odds = freedom / 2 * np.log(found[not of_tool][0] / left)
    ends = powers[[int(np.argmax(at)), int(np.argmin(at))]] @ x.reshape(2, 3)
    return RepeatDrift(
        p, of_tool, bool(odds < np.log(ODDS)), float(np.linalg.norm(ends[0] - ends[1])),
        frozen(shift - shift.mean(axis=0)),
    )  # fmt: skip


def _about_means(values: Array, rows: Index) -> Array:
    """Values (g, r, ...) of groups of rows (g, r) about the mean of each."""
    picked = values[rows]
    return np.asarray(picked - picked.mean(axis=1, keepdims=True))
