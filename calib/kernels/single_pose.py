"""One tool pose at a time, compiled, for callers that need poses one after the other."""

import math
from typing import Any

from calib.kernels.compiled import array_in, array_out, compiled


@compiled(array_in(2), array_in(2), array_in(2), array_in(1), array_out(1), array_out(2))
def single_pose(links: Any, frames: Any, terms: Any, q: Any, moved: Any, T: Any) -> None:
    """Tool pose (4, 4) at joint values q (n,); inputs are not checked.

    Parameters
    ----------
    links : (n, 8) array
        theta [rad], d, a [m]; cos and sin of alpha; cos and sin of beta; 1 if the joint slides.
    frames : (2, 16) array
        Base in the world, tool in the flange, row by row [m].
    terms : (k, n + 3) array
        For each joint term its joint, its coefficient, 1 for a cosine, the weights of its wave.
    q : (n,) array
        Joint values [rad, m].
    moved : (n,) array
        Receives the joint values with the terms added [rad, m].
    T : (4, 4) array
        Receives the pose [m], without its last row.
    """
    n = q.shape[0]
    for i in range(n):
        moved[i] = q[i]
    for t in range(terms.shape[0]):
        phase = 0.0
        for i in range(n):
            phase += terms[t, 3 + i] * q[i]
        wave = math.cos(phase) if terms[t, 2] != 0.0 else math.sin(phase)
        moved[int(terms[t, 0])] += terms[t, 1] * wave
    base, tool = frames[0], frames[1]
    for r in range(3):
        x, y, z, p = base[4 * r], base[4 * r + 1], base[4 * r + 2], base[4 * r + 3]
        for i in range(n):
            link = links[i]
            turn, shift = link[0] + moved[i], link[1]
            if link[7] != 0.0:
                turn, shift = link[0], link[1] + moved[i]
            c, s = math.cos(turn), math.sin(turn)
            x, y = c * x + s * y, c * y - s * x
            p += shift * z + link[2] * x
            y, z = link[3] * y + link[4] * z, link[3] * z - link[4] * y
            x, z = link[5] * x - link[6] * z, link[6] * x + link[5] * z
        for k in range(4):
            T[r, k] = x * tool[k] + y * tool[4 + k] + z * tool[8 + k]
        T[r, 3] += p
