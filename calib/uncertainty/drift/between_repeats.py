"""Whether what visits of one pose differ by is a drift: of the readings as a whole, or of the tool.

Joints that come back badly scatter from visit to visit; a drift goes with time. So does backlash,
where one round came from one side and the next from the other: it turns joints, and is no drift.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import fdtrc

from calib.arrays import LATER, Array, FloatOrNan, Index, frozen
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from calib.geometry.operating import approaches
from calib.measurement.noise import whiteners
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, tool_poses
from calib.shown import Shown, length_words
from calib.uncertainty.statement.repeats import FEWEST_FREEDOM, repeated, sound

SHOWN = 1e-3
"""A p-value below which visits are said to differ by a drift."""
ODDS = 20.0
"""A drift is told from joints that a round approached from another side at odds of so many to one;
so is which of readings and tool drifts."""
LEFT = 1e-3
"""Part of a column about the means of poses below which it is the same at all visits."""
APART = 0.05
"""Part of the session that lies between visits of one pose at least: those of one stop show how an
arm settles, and nothing of the hours."""


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
    """Largest distance that it makes between two visits of one pose [m]."""
    shift: Annotated[Array, "m", 3]
    """(m, 3) what it adds to each position, about its mean over the rows [m]."""
    sd: Annotated[float, LATER] = 0.0
    """Standard deviation per axis of where a visit stands, beyond the noise of readings: what a
    tool point of an arm that drifts has beside that of the session's mean [m]."""
    joints: Annotated[bool, LATER] = False
    """Whether it is told by turns of all joints from round to round, which a drift explains no
    better: they warm, or come from another side. `shift` is zero, and `size` the root mean square
    distance of two visits [m]."""

    def __repr__(self) -> str:
        size = length_words(self.size, um=".3g")
        return f"RepeatDrift({size}, {'tool' if self.of_tool else 'readings'})"

    @property
    def what(self) -> str:
        """What drifts, in words."""
        both = ("the tool", "the base, the instrument or the warming arm")
        one, other = both if self.of_tool else both[::-1]
        return f"{one} or {other}" if self.or_else else one

    @property
    def sentence(self) -> str:
        """The finding in words."""
        if self.joints:
            return (
                "visits of the same poses differ from round to round, by "
                f"{length_words(self.size)} (root mean square), as where joints warm or come from "
                f"another side (p = {self.p_value:.2g}); R95 contains it, since the robot may be "
                "used in the one state or in the other"
            )
        return (
            "visits of the same poses differ in step with time (p < 0.001): "
            f"{self.what} drifted by up to {length_words(self.size)} from one to another; "
            "this is no scatter of the joints, and is not counted as one; R95 contains it, since "
            "it may be the arm that stands elsewhere at another time"
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
    means) in axes of the station, or of the tool, beside half the backlash of each joint: F of 6
    and sum 3 (r - 1) - 6 degrees of freedom less those of the backlash, the smaller p of the two,
    doubled. Rows of one stop share how the joints came: c of them count as one, with chi-square and
    degrees of freedom divided by c (design effect: Kish 1965). None, too, where a turn of each
    joint in each round, as of approaches that the order does not tell, explains about as much.
    """
    groups = repeated(visits)
    freedom = sum(3 * (rows.size - len(rows)) for rows in groups)
    if freedom < FEWEST_FREEDOM:
        return None
    seen, N = predict(model, visits), visits.covariance[:, :3, :3]
    y, in_time = seen.residual[:, :3], np.argsort(order, kind="stable")
    at = np.argsort(in_time) / max(len(order) - 1, 1) - 0.5
    groups = sound(y, N, groups)
    apart = np.concatenate([np.ptp(at[rows], axis=1) for rows in groups])
    if not len(apart) or np.median(apart) < APART:
        return None
    pose, W = visits.pose_id[in_time], whiteners(N)
    alike = len(pose) / (1 + int((np.diff(pose) != 0).sum()))
    sides, rounds = _by_joints(model, seen.rows, visits, order, _visit(at, groups))
    drifts = _drifts(model, visits, at)

    def about(columns: Array) -> Array:
        """Whitened columns (m, 3, k) about the means of poses, rows one under the other."""
        parts = [W[some] @ _about_means(columns, some) for some in groups]
        return np.concatenate([part.reshape(-1, columns.shape[2]) for part in parts])

    beside = _basis(about(sides), W @ sides)

    def left_of(columns: Array) -> Array:
        """The same off what backlash explains."""
        A = about(columns)
        return np.asarray(A - beside @ (beside.T @ A))

    b = left_of(y[..., None])[:, 0]
    freedom = sum(3 * (rows.size - len(rows)) for rows in groups) - 6 - beside.shape[1]
    found = {}
    for of_tool, columns in drifts.items():
        A = left_of(columns)
        x = np.linalg.lstsq(A, b, rcond=None)[0]
        found[of_tool] = (float(np.square(b - A @ x).sum()), x)
    of_tool = found[True][0] < found[False][0]
    left, x = found[of_tool]
    if freedom <= 0 or left <= 0:
        return None
    fall = (float(b @ b) - left) / 6 / (left / freedom)
    p = min(1.0, 2 * float(fdtrc(6, freedom / alike, fall / alike)))
    turned = _basis(left_of(rounds), W @ rounds)
    turned_left = float(np.square(b - turned @ (turned.T @ b)).sum())

    def worse(than: float) -> bool:
        """Whether an explanation that leaves so much is ruled out."""
        return bool(freedom / alike / 2 * np.log(max(than, left * 1e-9) / left) >= np.log(ODDS))

    if p >= SHOWN or not worse(turned_left):
        return None
    shift = drifts[of_tool] @ x
    size = max(
        float(np.linalg.norm(shift[rows][:, :, None] - shift[rows][:, None], axis=3).max())
        for rows in groups if len(rows)
    )  # fmt: skip
    shift = shift - shift.mean(axis=0)
    sd = np.sqrt(max(beyond_noise(y, N, groups), float(np.square(shift).mean())))
    return RepeatDrift(p, of_tool, not worse(found[not of_tool][0]), size, frozen(shift), float(sd))


def beyond_noise(y: Array, covariance: Array, groups: list[Index]) -> float:
    """Variance per axis between visits (g, r) of the same poses, less that of their noise [m^2]."""
    freedom = 3 * sum(rows.size - len(rows) for rows in groups)
    square = sum(float(np.square(_about_means(y, rows)).sum()) for rows in groups)
    seen = np.concatenate([rows.ravel() for rows in groups])
    return square / freedom - float(np.trace(covariance[seen], axis1=1, axis2=2).mean()) / 3


def _by_joints(
    model: RobotModel, rows: Array, visits: Measurements, order: Index, visit: Array
) -> tuple[Array, Array]:
    """Positions (m, 3, n) by half the backlash of each joint, (m, 3, k) by its turn in each round.

    `rows` (m, r, P) is the derivative of the prediction, `visit` (m, r - 1) as `_visit` has it.
    """
    joints = rows[:, :3, joint_columns(model.chain)]
    came = visits.conditions.approach
    sides = joints * (approaches(visits.q, order) if came is None else came)[:, None, :]
    return sides, (visit[:, None, :, None] * joints[:, :, None, :]).reshape(len(rows), 3, -1)


def _drifts(model: RobotModel, visits: Measurements, at: Array) -> dict[bool, Array]:
    """Positions (m, 3, 6) by t and t^2 along each axis: of the station, and (True) of the tool."""
    powers = np.stack([at, at**2], axis=1)
    axes = {False: np.broadcast_to(np.eye(3), (len(at), 3, 3)),
            True: tool_poses(model, visits)[:, :3, :3]}  # fmt: skip
    return {of_tool: (R[:, :, None, :] * powers[:, None, :, None]).reshape(len(at), 3, 6)
            for of_tool, R in axes.items()}  # fmt: skip


def _visit(at: Array, groups: list[Index]) -> Array:
    """Which visit of its pose a row is (m, r - 1), in time, by columns of ones; none the first."""
    most = max(rows.shape[1] for rows in groups)
    number = np.zeros(len(at), dtype=np.int64)
    for rows in groups:
        number[rows] = np.argsort(np.argsort(at[rows], axis=1), axis=1)
    return np.asarray(number[:, None] == np.arange(1, most), dtype=np.float64)


def _basis(whitened: Array, whole: Array) -> Array:
    """Orthonormal basis (k, f) of columns of which something is left about the means."""
    size = np.sqrt(np.square(whole).sum(axis=(0, 1)))
    U, s, _ = np.linalg.svd(whitened / np.where(size > 0, size, 1.0), full_matrices=False)
    return np.asarray(U[:, s > LEFT])


def _about_means(values: Array, rows: Index) -> Array:
    """Values (g, r, ...) of groups of rows (g, r) about the mean of each."""
    picked = values[rows]
    return np.asarray(picked - picked.mean(axis=1, keepdims=True))
