"""Noisy copies of a table of poses, 32 replicates side by side (see `calib.kernels.replicates`)."""

from typing import Any

import numpy as np

from calib.kernels.compiled import array_in, array_out, compiled


@compiled(array_in(4), array_in(2), array_in(3), array_in(3), array_out(4))
def noisy_poses(normal: Any, position: Any, rotation: Any, factor: Any, observed: Any) -> None:
    """Poses observed with noise: p + n_p and Exp(n_r) R, with n = L z.

    Parameters
    ----------
    normal : (B, m, 6, 32) array
        Standard normal draws z.
    position, rotation : (m, 3), (m, 3, 3) array
        True poses in the world [m].
    factor : (m, 6, 6) array
        Lower factors L of the noise covariances [m, rad].
    observed : (B, m, 12, 32) array
        Receives the position [m], then the rotation row by row.
    """
    n = np.empty((6, 32))
    K = np.empty((9, 32))
    for b in range(normal.shape[0]):
        for j in range(normal.shape[1]):
            z, out = normal[b, j], observed[b, j]
            # noise n = L z
            n[:] = 0.0
            for r in range(6):
                for c in range(r + 1):
                    L = factor[j, r, c]
                    if L != 0.0:
                        for k in range(32):
                            n[r, k] += L * z[c, k]
            for r in range(3):
                for k in range(32):
                    out[r, k] = position[j, r] + n[r, k]
            # K = Exp(n_r), by Rodrigues
            for k in range(32):
                x, y, w = n[3, k], n[4, k], n[5, k]
                q = x * x + y * y + w * w
                # sine and versed sine of a small turn over the turn and its square
                s = 1.0 - q / 6 * (1.0 - q / 20 * (1.0 - q / 42))
                v = 0.5 - q / 24 * (1.0 - q / 30 * (1.0 - q / 56))
                K[0, k] = 1.0 - v * (y * y + w * w)
                K[1, k] = v * x * y - s * w
                K[2, k] = v * x * w + s * y
                K[3, k] = v * x * y + s * w
                K[4, k] = 1.0 - v * (x * x + w * w)
                K[5, k] = v * y * w - s * x
                K[6, k] = v * x * w - s * y
                K[7, k] = v * y * w + s * x
                K[8, k] = 1.0 - v * (x * x + y * y)
            # K R, row by row
            for r in range(3):
                for c in range(3):
                    R0, R1, R2 = rotation[j, 0, c], rotation[j, 1, c], rotation[j, 2, c]
                    for k in range(32):
                        out[3 + 3 * r + c, k] = (
                            K[3 * r, k] * R0 + K[3 * r + 1, k] * R1 + K[3 * r + 2, k] * R2
                        )
