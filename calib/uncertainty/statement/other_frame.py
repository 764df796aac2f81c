"""Whether held-out readings stand in another frame: their errors as one rigid motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.identification.fit_statistics import RED
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, predicted_positions
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.shape import noise_and_misfit

FEWEST = 6
"""Held-out poses below which a motion of six numbers is not told from their noise."""


@dataclass(frozen=True, slots=True, eq=False)
class OtherFrame:
    """The rigid motion that explains held-out errors best, and whether there is one."""

    shift: Array
    """(3,) of the mean point of the poses, axes of the station [m]."""
    turn: Array
    """(3,) rotation vector about that point [rad]."""
    tool: Array
    """(3,) the same errors as an offset of the target, axes of the tool [m]."""
    size: float
    """Root mean square of what the motion does at the poses [m]."""
    tool_size: float
    """The same of the offset [m]."""
    p_base: float
    """Chance of as large a motion if there is none."""
    p_tool: float
    n_poses: int

    def __repr__(self) -> str:
        word = "another" if self.found else "the same"
        return f"OtherFrame({word}, {1e6 * self.size:.3g} um, p = {self.p_base:.2g})"

    @property
    def found(self) -> bool:
        """Whether held-out rows stand in another frame: they prove nothing then."""
        return min(self.p_base, self.p_tool) < RED

    @property
    def sentence(self) -> str:
        """The result in words."""
        if not self.found:
            return f"{self.n_poses} held-out poses stand in the frame of the calibration"
        angle = np.degrees(float(np.linalg.norm(self.turn)))
        if self.p_tool < self.p_base:
            what = f"{_length(self.tool_size)} from the calibration at the tool: another target"
        else:
            what = (
                f"{_length(self.size)} ({angle:.2g} deg) from the calibration as one piece: "
                "another base frame, or the station moved"
            )
        return f"the held-out readings stand {what}; they prove nothing until that is settled"


def other_frame(belief: Belief, held_out: Measurements) -> OtherFrame:
    """Ask whether a rigid motion explains the errors at held-out poses.

    Parameters
    ----------
    belief : Belief
        What is believed of errors there; its misfit is in their covariance.
    held_out : Measurements
        Poses and points, from one station.

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
    p = predicted_positions(belief.model, points)
    about = p - p.mean(axis=0)
    eye = np.broadcast_to(np.eye(3), (len(p), 3, 3))
    base = np.concatenate([eye, -np.cross(about[:, :, None], eye, axis=1)], axis=2)
    station = belief.model.fixtures.station_frames[points.station][:, :3, :3]
    tool = np.swapaxes(station, 1, 2) @ belief.model.poses(points.q)[:, :3, :3]
    # rows of another frame look like a misfit, too; it is no larger than the errors themselves
    size = min(belief.misfit.upper, float(np.sqrt((e**2).mean())))
    values, axes = np.linalg.eigh(belief.covariance + size**2 * belief.misfit_covariance)
    columns = (rows @ (axes * np.sqrt(np.maximum(values, 0.0))), e[:, :, None], base, tool)
    shared, error, of_base, of_tool = _whitened(belief, points, size, rows, columns)
    moved, p_base, moves = _explained(shared, error, of_base, base)
    offset, p_tool, tool_size = _explained(shared, error, of_tool, tool)
    return OtherFrame(
        frozen(moved[:3]), frozen(moved[3:]), frozen(offset), moves, tool_size, p_base, p_tool,
        points.n_poses,
    )  # fmt: skip


def _whitened(
    belief: Belief, points: Measurements, size: float, rows: Array, columns: Sequence[Array]
) -> list[Array]:
    """Columns (3 m, k) in units of noise and a misfit of `size`, which poses do not share."""
    noise = belief.misfit.larger_noise**2 * points.covariance
    whole = np.concatenate(columns, axis=2)
    white = np.empty_like(whole)
    order = np.argsort(points.pose_id, kind="stable")
    first = np.unique(points.pose_id[order], return_index=True)[1]
    for some in np.split(order, first[1:]):
        pose = points.pose_id[some]
        own = noise_and_misfit(belief.misfit.shape, size, rows[some], noise[some], pose)
        seen = np.linalg.solve(np.linalg.cholesky(own), whole[some].reshape(len(own), -1))
        white[some] = seen.reshape(len(some), 3, -1)
    edges = np.cumsum([part.shape[2] for part in columns])[:-1]
    return [part.reshape(3 * len(rows), -1) for part in np.split(white, edges, axis=2)]


def _explained(shared: Array, e: Array, motion: Array, plain: Array) -> tuple[Array, float, float]:
    """Numbers (k,) of a motion (m, 3, k) that explain errors best, their p, their size [m].

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
    P, k = shared.shape[1], motion.shape[1]
    prior = np.eye(P, P + k)
    A = np.concatenate([np.concatenate([shared, motion], axis=1), prior])
    b = np.concatenate([e[:, 0], np.zeros(P)])
    without, found = (np.linalg.lstsq(M, b, rcond=None)[0] for M in (A[:, :P], A))
    gain = float(((b - A[:, :P] @ without) ** 2).sum() - ((b - A @ found) ** 2).sum())
    numbers = found[P:]
    size = float(np.sqrt(((plain @ numbers) ** 2).sum() / len(plain)))
    return numbers, float(chdtrc(k, max(gain, 0.0))), size


def _length(metres: float) -> str:
    """In um below a millimetre, else in mm."""
    return f"{1e6 * metres:.0f} um" if metres < 1e-3 else f"{1e3 * metres:.4g} mm"
