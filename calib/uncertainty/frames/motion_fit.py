"""The motion that explains errors best: beside what parameters, frames and a misfit do to them."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.frames.rigid import motions_of, rms_length
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.gain import estimator_gain
from calib.uncertainty.statement.shape import of_poses, same_count

FOLLOWED = 0.01
"""Part of a motion below which nothing of it is left: the model is not quite straight."""


def asked(
    belief: Belief, points: Measurements, size: float, about: Array,
    columns: tuple[Array, Array, Array], identification: Identification, train: Measurements,
) -> list[Array]:  # fmt: skip
    """Whitened: what the errors share (3 m, P), errors (3 m, 1), motions of base and target.

    Parameters
    ----------
    columns : tuple of arrays
        Errors (m, 3) [m] and the two motions (m, 3, 6), (m, 3, 3).
    """
    e, base, tool = columns
    rows = predict(belief.model, points).rows[:, :3]
    values, axes = np.linalg.eigh(belief.covariance + size**2 * belief.misfit_covariance)
    common, usual = _standing(belief, points, size, about, identification, train)
    parameters = np.tensordot(rows, axes * np.sqrt(np.maximum(values, 0.0)), 1)
    shares = np.concatenate([parameters, common], axis=2)
    return _whitened(belief, points, size, rows, (shares, (e - usual)[:, :, None], base, tool))


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
    seen, motions = predict(model, train), motions_of(model, train, about)
    followed = np.einsum("mfe,mek->fk", estimator_gain(fit, train), motions)
    left = motions - seen.rows[:, :, free] @ followed
    # gross errors tell nothing of a motion
    sound = fit.weights > 0.5 if len(fit.weights) else np.ones(len(train), dtype=bool)
    columns = [part[sound, :3] for part in (left, seen.residual[:, :, None], motions)]
    B, e, whole = _whitened(belief, train.rows(sound), size, seen.rows[sound, :3], columns)
    U, s, V = np.linalg.svd(B, full_matrices=False)
    kept = s > FOLLOWED * np.linalg.norm(whole, 2)
    there = predict(model, held_out).rows[:, :3, free]
    reach = motions_of(model, held_out, about)[:, :3] - there @ followed
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


def explained(shared: Array, e: Array, motion: Array, plain: Array) -> tuple[Array, float, float]:
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
    left, rest = _beside(shared, e, motion)
    numbers = np.linalg.lstsq(left, rest, rcond=None)[0]
    gain = float(rest @ rest - ((rest - left @ numbers) ** 2).sum())
    return np.asarray(numbers), max(gain, 0.0), rms_length(plain @ numbers)


def chi_square(shared: Array, e: Array, motion: Array) -> tuple[float, int]:
    """What the best motion leaves of whitened errors, and how many of its numbers they tell."""
    left, rest = _beside(shared, e, motion)
    if not motion.shape[1]:
        return float(rest @ rest), 0
    numbers = np.linalg.lstsq(left, rest, rcond=None)[0]
    return float(((rest - left @ numbers) ** 2).sum()), int(np.linalg.matrix_rank(motion))


def _beside(shared: Array, e: Array, motion: Array) -> tuple[Array, Array]:
    """Motion (k + 1, k) and errors (k + 1,) beside what is shared, turned: lengths are kept.

    The shared numbers are readings of zero; one triangle serves as all that least squares asks.
    """
    P = shared.shape[1]
    rows = np.concatenate([shared, motion, e], axis=1)
    prior = np.eye(P, rows.shape[1])
    left = np.asarray(np.linalg.qr(np.concatenate([rows, prior]), mode="r"))[P:, P:]
    return left[:, :-1], left[:, -1]
