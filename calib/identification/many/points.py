"""Tool points that many fits predict, with their stated covariances."""

import numpy as np

from calib.arrays import Array
from calib.identification.many.fit import blocks
from calib.identification.many.result import ManyFits
from calib.identification.many.tables import position_rows


def stated_points(fits: ManyFits, q: Array, target: Array | None = None) -> tuple[Array, Array]:
    """Predicted points (R, m, 3) [m] and their stated covariances (R, m, 3, 3) [m^2].

    Parameters
    ----------
    fits : ManyFits
        Fits of R robots.
    q : (R or 1, m, n) array
        Commanded joint values; 1 if they are the same for all robots [rad, m].
    target : (3,) array, optional
        Point in the tool frame, its origin if left out [m].

    References
    ----------
    Sigma = J C J'.
    """
    m, free = q.shape[1], fits.parameters.free_index
    points, sigma = np.empty((len(fits), m, 3)), np.empty((len(fits), m, 3, 3))
    for some in blocks(len(fits)):
        models, C = fits.models.some(some), fits.covariance[some]
        point, J = position_rows(models, q if len(q) == 1 else q[some], free, target)
        points[some] = np.swapaxes(point, 1, 2)
        CJ = (C @ J.reshape(*C.shape[:2], -1)).reshape(J.shape)
        for a in range(3):
            for b in range(a + 1):
                sigma[some, :, a, b] = np.einsum("rfm,rfm->rm", J[:, :, a], CJ[:, :, b])
                sigma[some, :, b, a] = sigma[some, :, a, b]
    return points, sigma
