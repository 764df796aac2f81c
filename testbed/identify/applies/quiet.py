"""Residuals smaller than the stated noise: how large it is by them at most, and what to write."""

import numpy as np
from scipy.special import chdtr, chdtri

from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import length_unit
from testbed.units import MDEG, UM, listed, significant

PARTS = {
    "positions": (slice(0, 3), "position_um", " per axis", UM),
    "angles": (slice(3, 6), "rotation_mdeg", " mdeg per axis", MDEG),
    "distances": (slice(0, 1), "distance_um", "", UM),
}
"""Parts of readings: their numbers, the key under [uncertainty] that states them, what follows in a
sentence, the unit of the key."""
SURE = 0.95
"""Probability of the upper limit of the noise."""


def quiet_words(fit: Identification, train: Measurements, scatter: str) -> tuple[str, ...]:
    """A sentence on parts of the readings that scatter by less than is stated of them.

    Parameters
    ----------
    fit : Identification
        By least squares with stated noise.
    train : Measurements
        What it was identified from, the scatter of the joints in the covariances.
    scatter : str
        Who told that scatter, as `scatter_told` does.
    """
    said, lines = [], []
    for part, (stated, most) in quieter(fit, train).items():
        _, key, per, factor = PARTS[part]
        limit, whole = (significant(size * factor, 2) for size in (most, stated))
        lines.append(f"{key} = {limit}")
        if factor == UM:
            scale, unit = length_unit([most, stated])
            limit, whole = (significant(size * scale, 2) for size in (most, stated))
            per = f" {unit}{per}"
        said.append(f"{limit}{per} of {part}, where {whole} is stated")
    if not said:
        return ()
    of = "readings"
    if scatter:
        of += " and joints together"
        lines.append('joint_repeatability = "included"')
    assumed = " (that of the joints is assumed, as the robot's file states none)"
    return (
        f"the residuals are smaller than the stated noise of {of}{assumed * (scatter == 'assumed')}"
        f": they allow for {listed(said)} (95 % probability). R95 contains all that is stated. "
        "Unless that stands for errors that all readings share, which no residual shows, write "
        f"{listed(lines)} under [uncertainty]",
    )


def quieter(fit: Identification, train: Measurements) -> dict[str, tuple[float, float]]:
    """Noise of each part that is quieter than stated: as stated, and its upper limit [m, rad].

    Of a fit by least squares with stated noise; of others nothing is known.

    References
    ----------
    r'inv(N) r of a part is chi-square of as many degrees as it has numbers, less the trace of what
    they tell the fit, inv(N) J C J'.
    """
    if fit.mode != "whitened" or fit.loss != "squared":
        return {}
    seen, covariance = predict(fit.model, train), fit.full_covariance
    kinds = {
        "positions": ~train.is_distance, "angles": train.is_pose, "distances": train.is_distance
    }  # fmt: skip
    asked = [part for part, rows in kinds.items() if rows.any()]
    found = {}
    for part in asked:
        some = PARTS[part][0]
        rows = np.flatnonzero(kinds[part])
        J, r = seen.rows[rows, some], seen.residual[rows, some]
        N = train.covariance[rows, some, some]
        square = float((r * np.linalg.solve(N, r[..., None])[..., 0]).sum())
        told = np.trace(np.linalg.solve(N, J @ covariance @ np.swapaxes(J, 1, 2)), axis1=1, axis2=2)
        freedom = r.size - float(told.sum())
        if freedom < 1 or chdtr(freedom, square) > RED / len(asked):
            continue
        stated = float(np.sqrt(np.trace(N, axis1=1, axis2=2).mean() / r.shape[1]))
        found[part] = (stated, stated * float(np.sqrt(square / chdtri(freedom, SURE))))
    return found
