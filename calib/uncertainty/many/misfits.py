"""Size of the hidden misfit of many robots: rows whitened and likelihoods profiled together."""

from typing import NamedTuple

import numpy as np

from calib.arrays import Array
from calib.uncertainty.many.gains import ManyGains, many_whiteners
from calib.uncertainty.many.likelihoods import likelihoods_between
from calib.uncertainty.many.sights import ManySights
from calib.uncertainty.statement.evidence import PositionRows, believed_before
from calib.uncertainty.statement.misfit import DROP


class ManyMisfits(NamedTuple):
    """Sizes per axis [m]; see `misfit.HiddenMisfit`."""

    best: Array
    """(R,) most likely size; nan if there are too few rows."""
    upper: Array
    """(R,) upper limit; infinite if there are too few rows."""


def misfits(seen: ManySights, gains: ManyGains) -> ManyMisfits:
    """Sizes of misfit from the position rows of each robot, training and held-out together."""
    parts = []
    for table in (seen.train, seen.test):
        N = table.covariance[:, :, :3, :3]
        root = many_whiteners(N)
        lean = root @ gains.shapes(table.rows[:, :, :3])
        lam, U = np.linalg.eigh(lean @ np.swapaxes(lean, 2, 3))
        A, y = table.free[:, :, :3] * seen.scale, table.residual[:, :, :3, None]
        turned = (np.swapaxes(U, 2, 3) @ root) @ np.concatenate([A, y], axis=3)
        noise = np.trace(N, axis1=2, axis2=3).sum(axis=1)
        parts.append(
            (turned.reshape(len(seen), -1, A.shape[3] + 1), lam.reshape(len(seen), -1), noise)
        )
    X, lam = (np.concatenate(both, axis=1) for both in zip(*(p[:2] for p in parts), strict=True))
    noise, lam = parts[0][2] + parts[1][2], np.maximum(lam, 0.0)
    tables = [
        PositionRows(X[k, :, :-1], X[k, :, -1], lam[k], float(noise[k])) for k in range(len(seen))
    ]
    units = np.array([rows.unit for rows in tables])
    before = [believed_before(*one) for one in zip(seen.fits, seen.precision, strict=True)]
    found = np.full((2, len(seen)), [[np.nan], [np.inf]])
    for k, values in enumerate(likelihoods_between(tables, units, before)):
        if values is not None:
            sizes = values.size[np.argmax(values.value)], values.limit(DROP)
            found[:, k] = units[k] * np.array(sizes)
    return ManyMisfits(*found)
