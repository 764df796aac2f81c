"""Whether held-out readings stand in another frame: their errors as one rigid motion."""

from dataclasses import dataclass
from typing import Any

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
    root = np.linalg.cholesky(_joint_covariance(belief, points, rows, e))
    p = predicted_positions(belief.model, points)
    about = p - p.mean(axis=0)
    eye = np.broadcast_to(np.eye(3), (len(p), 3, 3))
    base = np.concatenate([eye, -np.cross(about[:, :, None], eye, axis=1)], axis=2)
    station = belief.model.fixtures.station_frames[points.station][:, :3, :3]
    tool = np.swapaxes(station, 1, 2) @ belief.model.poses(points.q)[:, :3, :3]
    moved, p_base, size = _explained(root, base, e)
    offset, p_tool, tool_size = _explained(root, tool, e)
    return OtherFrame(
        frozen(moved[:3]), frozen(moved[3:]), frozen(offset), size, tool_size, p_base, p_tool,
        points.n_poses,
    )  # fmt: skip


def _joint_covariance(belief: Belief, points: Measurements, rows: Array, e: Array) -> Array:
    """Covariance (3 m, 3 m) of errors e (m, 3) together, misfit at its upper limit [m^2]."""
    # rows of another frame look like a misfit, too; it is no larger than the errors themselves
    size = min(belief.misfit.upper, float(np.sqrt((e**2).mean())))
    G = rows.reshape(3 * len(points), -1)
    shared = G @ (belief.covariance + size**2 * belief.misfit_covariance) @ G.T
    noise = belief.misfit.larger_noise**2 * points.covariance
    own = noise_and_misfit(belief.misfit.shape, size, rows, noise, points.pose_id)
    return np.asarray(shared + own)


def _explained(root: Any, motion: Any, e: Array) -> tuple[Array, float, float]:
    """Numbers (k,) of a motion (m, 3, k) that explain errors (m, 3), their p, their size [m]."""
    G = motion.reshape(-1, motion.shape[2])
    A, b = np.linalg.solve(root, G), np.linalg.solve(root, e.ravel())
    numbers = np.linalg.lstsq(A, b, rcond=None)[0]
    gain = float(b @ b - ((b - A @ numbers) ** 2).sum())
    size = float(np.sqrt(((G @ numbers) ** 2).sum() / len(e)))
    return numbers, float(chdtrc(G.shape[1], max(gain, 0.0))), size


def _length(metres: float) -> str:
    """In um below a millimetre, else in mm."""
    return f"{1e6 * metres:.0f} um" if metres < 1e-3 else f"{1e3 * metres:.4g} mm"
