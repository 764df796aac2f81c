"""Whether held-out readings stand in another frame: their errors as one rigid motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.geometry.frames import log_so3
from calib.geometry.model import RobotModel
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification
from calib.identification.start.closed_forms import fitted_frame
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, predicted_positions, tool_poses
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.gain import estimator_gain
from calib.uncertainty.statement.shape import of_poses, same_count

FOLLOWED = 0.01
"""Part of a motion below which nothing of it is left: the model is not quite straight."""
PLAIN = 5.0
"""One kind of motion that leaves so many times less than the other is plainly the one."""
FEWEST = 6
"""Held-out poses below which a motion of six numbers is not told from their noise."""


@dataclass(frozen=True, slots=True, eq=False)
class OtherFrame:
    """The rigid motion that explains held-out errors best, and whether there is one."""

    shift: Annotated[Array, 3]
    """(3,) of the mean point of the poses, axes of the station [m]."""
    turn: Annotated[Array, 3]
    """(3,) rotation vector about that point [rad]."""
    tool: Annotated[Array, 3]
    """(3,) the same errors as an offset of the target, axes of the tool [m]."""
    size: float
    """Root mean square of what the motion does at the poses [m]."""
    tool_size: float
    """The same of the offset [m]."""
    p_base: float
    """Chance of as large a motion if there is none."""
    p_tool: float
    n_poses: int
    at_tool: bool
    """Whether an offset of the target explains the errors better than a motion of the base."""
    station: int = 0
    """Which station saw the poses; 0 is the world."""
    within: float = 0.0
    """A motion up to this size is in the believed region anyway [m]."""

    def __repr__(self) -> str:
        word = "another" if self.found else "the same"
        return f"OtherFrame({word}, {1e6 * self.size:.3g} um, p = {self.p_base:.2g})"

    @property
    def found(self) -> bool:
        """Whether held-out rows stand in another frame: they prove nothing then.

        What bends the arm moves all held-out points a little, too, more than chance and less than
        is believed of them.
        """
        size = self.tool_size if self.at_tool else self.size
        return min(self.p_base, self.p_tool) < RED and size > self.within

    @property
    def sentence(self) -> str:
        """The result in words."""
        if not self.found:
            return f"{self.n_poses} held-out poses stand in the frame of the calibration"
        return self.said_of(
            "the held-out rows" + f" of station {self.station + 1}" * bool(self.station)
        )

    def said_of(self, rows: str) -> str:
        """That they stand elsewhere, in words; `rows` is what they are called."""
        if self.at_tool:
            what = (
                f"see another target: {_length(self.tool_size)} from where the calibration has it, "
                "at the tool"
            )
        else:
            angle = np.degrees(float(np.linalg.norm(self.turn)))
            what = (
                f"stand in another frame: {_length(self.size)}, {angle:.{1 if angle >= 1 else 3}f} "
                "deg, as one piece "
                "(another base, or the station moved)"
            )
        return f"{rows} {what}; they prove nothing: state a session of their own"


def other_frame(
    belief: Belief, held_out: Measurements, identification: Identification, train: Measurements
) -> OtherFrame:
    """Ask whether a rigid motion explains errors at held-out poses, beyond those identified from.

    Parameters
    ----------
    belief : Belief
        What is believed of errors there; its misfit is in their covariance.
    held_out : Measurements
        Poses and points, from one station.
    identification : Identification
        From `train`.
    train : Measurements
        What was identified from. A frame that was held fixed, and does not fit, shows in all
        readings: it is no other frame.

    References
    ----------
    Generalized least squares with V = G C G' (the parameter error, common to all) + N + sigma_U^2
    Q; fall of chi-square, six numbers for the base, three for the tool.
    """
    points = held_out.rows(~held_out.is_distance)
    if points.n_poses < FEWEST:
        raise refuse(
            "held_out", points.n_poses, f"{FEWEST} poses or more", code="A3",
            message=f"{points.n_poses} held-out poses cannot show another frame",
        )  # fmt: skip
    seen = predict(belief.model, points)
    rows, e = seen.rows[:, :3], seen.residual[:, :3]
    about = predicted_positions(belief.model, points).mean(axis=0)
    base, tool = np.split(_motions(belief.model, points, about)[:, :3], [6], axis=2)
    # rows of another frame look like a misfit, too; it is no larger than the errors themselves
    size = min(belief.misfit.upper, float(np.sqrt((e**2).mean())))
    values, axes = np.linalg.eigh(belief.covariance + size**2 * belief.misfit_covariance)
    common, usual = _standing(belief, points, size, about, identification, train)
    parameters = rows @ (axes * np.sqrt(np.maximum(values, 0.0)))
    shares = np.concatenate([parameters, common], axis=2)
    columns = (shares, (e - usual)[:, :, None], base, tool)
    shared, error, of_base, of_tool = _whitened(belief, points, size, rows, columns)
    moved, gain, moves = _explained(shared, error, of_base, base)
    offset, tool_gain, tool_size = _explained(shared, error, of_tool, tool)
    p_base, p_tool = float(chdtrc(6, gain)), float(chdtrc(3, tool_gain))
    at_tool = p_tool < p_base
    if min(p_base, p_tool) < RED:
        # a misfit as large as gross errors explains them, too, and no derivative a large turn
        whole, whole_size, left = _whole_motion(belief.model, points, about)
        plain, plain_size, plain_left = _plain_offset(e, tool)
        if max(left, plain_left) > PLAIN * min(left, plain_left):
            at_tool = plain_left < left
            if at_tool:
                offset, tool_size = plain, plain_size
            else:
                moved, moves = whole, whole_size
    return OtherFrame(
        frozen(moved[:3]), frozen(moved[3:]), frozen(offset), moves, tool_size, p_base, p_tool,
        points.n_poses, at_tool, int(points.station[0]),
    )  # fmt: skip


def _whole_motion(
    model: RobotModel, table: Measurements, about: Array
) -> tuple[Array, float, float]:
    """Shift and turn (6,) of the motion from predicted to seen positions; its size, what it leaves.

    By Procrustes, whatever the turn [m, rad].
    """
    p = predicted_positions(model, table)
    T = fitted_frame(table.position, p, np.eye(3))
    moved = p @ T[:3, :3].T + T[:3, 3] - p
    shift = T[:3, :3] @ about + T[:3, 3] - about
    turn = log_so3(T[None, :3, :3])[0]
    return np.concatenate([shift, turn]), _rms(moved), _rms(table.position - p - moved)


def _plain_offset(e: Array, tool: Array) -> tuple[Array, float, float]:
    """Offset (3,) of the target that errors (m, 3) show alone; its size, what it leaves [m]."""
    offset = np.linalg.lstsq(tool.reshape(-1, 3), e.ravel(), rcond=None)[0]
    return np.asarray(offset, np.float64), _rms(tool @ offset), _rms(e - tool @ offset)


def _rms(vectors: Array) -> float:
    """Root mean square length of vectors (m, 3)."""
    return float(np.sqrt((vectors**2).sum() / len(vectors)))


def _motions(model: RobotModel, table: Measurements, about: Array) -> Array:
    """Rows (m, 6, 9) of a station that shifts, or turns about a point, and of a target that shifts.

    In the axes of the station; the target in those of the tool.
    """
    p = predicted_positions(model, table) - about
    station = model.fixtures.station_frames[table.station][:, :3, :3]
    motions = np.zeros((len(p), 6, 9))
    motions[:, :3, :3] = np.eye(3)
    motions[:, :3, 3:6] = -np.cross(p[:, :, None], np.eye(3)[None], axis=1)
    motions[:, 3:, 3:6] = table.is_pose[:, None, None] * np.eye(3)
    motions[:, :3, 6:] = np.swapaxes(station, 1, 2) @ tool_poses(model, table)[:, :3, :3]
    return motions


def _standing(
    belief: Belief, held_out: Measurements, size: float, about: Array, fit: Identification,
    train: Measurements,
) -> tuple[Array, Array]:  # fmt: skip
    """What a motion of all readings leaves at held-out rows, because the estimate cannot follow it.

    Returns columns (m, 3, k) for independent numbers of variance one, and what the training rows
    say of the motion as an error (m, 3) [m]; no column where the estimate follows every motion.
    """
    model, free = belief.model, fit.parameters.free_index
    if train.is_distance.any() or (train.station != held_out.station[0]).any():
        return np.zeros((len(held_out), 3, 0)), np.zeros((len(held_out), 3))
    seen, motions = predict(model, train), _motions(model, train, about)
    followed = np.einsum("mfe,mek->fk", estimator_gain(fit, train), motions)
    left = motions - seen.rows[:, :, free] @ followed
    # gross errors tell nothing of a motion
    sound = fit.weights > 0.5 if len(fit.weights) else np.ones(len(train), dtype=bool)
    columns = [part[sound, :3] for part in (left, seen.residual[:, :, None], motions)]
    B, e, whole = _whitened(belief, train.rows(sound), size, seen.rows[sound, :3], columns)
    U, s, V = np.linalg.svd(B, full_matrices=False)
    kept = s > FOLLOWED * np.linalg.norm(whole, 2)
    there = predict(model, held_out).rows[:, :3, free]
    reach = _motions(model, held_out, about)[:, :3] - there @ followed
    common = reach @ (V[kept].T / s[kept])
    return common, common @ (U[:, kept].T @ e[:, 0])


def _whitened(
    belief: Belief, points: Measurements, size: float, rows: Array, columns: Sequence[Array]
) -> list[Array]:
    """Columns (3 m, k) in units of noise and a misfit of `size`, which poses do not share."""
    noise = belief.misfit.larger_noise**2 * points.covariance
    whole = np.concatenate(columns, axis=2)
    white = np.empty_like(whole)
    for some in same_count(points.pose_id):  # (poses, rows of each)
        own = of_poses(belief.misfit.shape, size, rows[some], noise[some])
        flat = whole[some].reshape(*own.shape[:2], -1)
        white[some] = np.linalg.solve(np.linalg.cholesky(own), flat).reshape(whole[some].shape)
    edges = np.cumsum([part.shape[2] for part in columns])[:-1]
    return [part.reshape(3 * len(rows), -1) for part in np.split(white, edges, axis=2)]


def _explained(shared: Array, e: Array, motion: Array, plain: Array) -> tuple[Array, float, float]:
    """Numbers (k,) of a motion (m, 3, k) that explain errors best, fall of chi-square, size [m].

    Parameters
    ----------
    shared : (3 m, P) array
        Whitened derivative of the errors by independent numbers of variance one, which they share.
    e : (3 m, 1) array
        Whitened errors.
    motion : (3 m, k) array
        Whitened motion.
    plain : (m, 3, k) array
        The motion itself.
    """
    P = shared.shape[1]
    prior = np.eye(P, P + motion.shape[1])
    A = np.concatenate([np.concatenate([shared, motion], axis=1), prior])
    b = np.concatenate([e[:, 0], np.zeros(P)])
    without, found = (np.linalg.lstsq(M, b, rcond=None)[0] for M in (A[:, :P], A))
    gain = float(((b - A[:, :P] @ without) ** 2).sum() - ((b - A @ found) ** 2).sum())
    numbers = found[P:]
    return numbers, max(gain, 0.0), _rms(plain @ numbers)


def _length(metres: float) -> str:
    """In um below a millimetre, else in mm."""
    return f"{1e6 * metres:.0f} um" if metres < 1e-3 else f"{1e3 * metres:.4g} mm"
