"""Base parameters of an arm under gravity: the moments of links that its torques tell apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.geometry.chain import Chain
from calib.geometry.gravity import AXES, DOWN, MOMENTS, Axis, axis_places, gravity_regressor

ALIKE = 1e-6
"""A moment is kept if more than this part of its column lies outside those of the kept moments."""


@dataclass(frozen=True, slots=True)
class FeltMoments:
    """The moments of links that gravity torques tell apart, and what the others act like."""

    kept: tuple[str, ...]
    """Names from the tip to the base: ``m6``, ``hx6`` ..."""
    sentences: tuple[str, ...]
    """One for each of the others: ``hz4 acts like +3.226 m6 -3.226 m4``, ``m2 is never felt``."""

    @property
    def rank(self) -> int:
        """Combinations of moments that can be told apart."""
        return len(self.kept)


def felt_moments(
    chain: Chain,
    q: ArrayLike,
    *,
    axes: Sequence[Axis] = AXES,
    gravity: ArrayLike = DOWN,
) -> FeltMoments:
    """Choose moments of the links that gravity torques over a pool of poses tell apart.

    The columns of the regressor are offered from the tip to the base, mass first; a moment is kept
    if its column is linearly independent of those kept before it.

    Parameters
    ----------
    chain : Chain
        Geometry of the arm.
    q : (m, n) array_like
        The pool of joint values [rad, m].
    axes : sequence of {"x", "y", "z"}
        Axes of every joint whose torques count; ``("z",)`` for the joint torques alone.
    gravity : (3,) array_like
        In the frame of the base [m/s^2].

    References
    ----------
    Base parameters of a rigid arm, here of gravity alone: Gautier & Khalil, IEEE Trans. Robotics
    and Automation 6(3), 1990, 368-373; the choice by columns instead of rules holds for any chain.
    """
    G = gravity_regressor(chain, q, gravity=gravity)[:, :, axis_places(axes)]
    n = chain.n_joints
    columns = G[..., :n, :].reshape(-1, n, 4)[:, ::-1].reshape(-1, 4 * n)
    names = [f"{moment}{i}" for i in range(n, 0, -1) for moment in MOMENTS]
    # no more rows than columns, and the same lengths and angles
    A = np.asarray(np.linalg.qr(columns, mode="r"))
    size = np.linalg.norm(A, axis=0)
    kept: list[int] = []
    basis, sentences = np.zeros((len(A), 0)), []
    for k, name in enumerate(names):
        if size[k] <= ALIKE * size.max():
            sentences.append(f"{name} is never felt")
            continue
        rest = A[:, k] / size[k]
        for _ in range(2):  # twice is enough
            rest = rest - basis @ (basis.T @ rest)
        if np.linalg.norm(rest) > ALIKE:
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
            kept.append(k)
            continue
        share = np.linalg.lstsq(A[:, kept] / size[kept], A[:, k] / size[k], rcond=None)[0]
        told = [
            f"{x * size[k] / size[j]:+.4g} {names[j]}"
            for x, j in zip(share, kept, strict=True)
            if abs(x) > ALIKE
        ]
        sentences.append(f"{name} acts like {' '.join(told)}")
    return FeltMoments(tuple(names[k] for k in kept), tuple(sentences))
