"""Many true arms at rest on their springs as arrays: what `springs.ElasticArm` is, without a tree.

The same iteration of the springs' angles, x = tau(q, x) / k, of all robots at all poses at once. A
pose that rests stays: it does not hang on how long others take.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.gravity import moments_of
from calib.geometry.many import Link, ManyModels
from testbed.laboratory.truth.springs import BENT, MOST, SETTLED, gives_way
from testbed.laboratory.truth.terms import Springs


@dataclass(frozen=True, slots=True, eq=False)
class ManyTrueSprings:
    """Weights and springs of R arms whose joints all turn."""

    moments: Array
    """(R, n + 1, 4) mass and first moments of bodies and payload, each in its frame [kg, kg m]."""
    compliance: Array
    """(n, 3, R, 1) of every joint about x, y, z of its body; zero where it is stiff [rad/(N m)]."""
    gravity: Array
    """(R, 3) in the world [m/s^2]."""

    @classmethod
    def of(cls, springs: Sequence[Springs]) -> "ManyTrueSprings":
        """Those of R arms, under payloads that stay."""
        masses = np.array([[*one.masses, one.payload] for one in springs])
        centers = np.array([[*one.centers, one.payload_center] for one in springs])
        moments = [moments_of(*each) for each in zip(masses, centers, strict=True)]
        drive = np.array([one.drive for one in springs])
        give = np.zeros((*drive.shape, 3))
        give[:, :, 2] = 1 / drive
        for own, one in zip(give, springs, strict=True):
            if len(one.bearing):
                own[:, :2] = 1 / one.bearing[:, None]
        gravity = np.array([one.gravity for one in springs])
        return cls(np.array(moments), np.moveaxis(give, 0, 2)[..., None], gravity)

    def some(self, which: slice | Index) -> "ManyTrueSprings":
        """Those of some arms."""
        return replace(
            self,
            moments=self.moments[which],
            compliance=self.compliance[:, :, which],
            gravity=self.gravity[which],
        )

    def links(self, models: ManyModels, joints: Array) -> list[Link]:
        """Links of the arms at rest, from their motors' joints (n, R or 1, m) [rad]."""
        n, m = len(joints), joints.shape[2]
        bends, moves = np.zeros((n, 3, len(models), m)), np.ones((len(models), m), dtype=np.bool_)
        for _ in range(MOST):
            found = self.compliance * self.torques(models, models.bent(joints, bends))
            step = np.abs(found - bends).max(axis=(0, 1))
            bends = np.where(moves, found, bends)
            if not (np.abs(bends) < BENT).all():
                break
            moves &= step >= SETTLED
            if not moves.any():
                return models.bent(joints, bends)
        far = ~(np.abs(bends).max(axis=(0, 1)) < BENT)
        robot, row = np.argwhere(far if far.any() else moves)[0].tolist()
        raise gives_way(row, 1 / self.compliance[:, :, robot].max(axis=(1, 2)))

    def torques(self, models: ManyModels, links: Sequence[Link]) -> Array:
        """Torques (n, 3, R, m) of gravity about x, y and z of every joint, as it stands [N m].

        About the axis a of a joint at o a . (sum of m_j c_j - o m_j) x g, over all bodies beyond.

        Parameters
        ----------
        models : ManyModels
            The arms.
        links : sequence of Link
            From `ManyModels.bent`.
        """
        x, y, z, p = (models.base[:, :, k].T[:, :, None] for k in range(4))
        axes, feet, first = [], [], []

        def weighed(body: int) -> Array:
            mass, *h = self.moments[:, body].T[:, :, None]
            return np.asarray(mass * p + h[0] * x + h[1] * y + h[2] * z)

        for i, (turn, link) in enumerate(zip(links[::2], links[1::2], strict=True)):
            (c, s), (cx, sx, cy, sy), about = turn[:2], turn[4:], z
            x, y = c * x + s * y, c * y - s * x
            about_x = x
            y, z = cx * y + sx * z, cx * z - sx * y
            axes.append((about_x, y, about))
            x, z = cy * x - sy * z, sy * x + cy * z
            feet.append(p)
            first.append(weighed(i))
            _, _, d, a, ca, sa, cb, sb = link
            p = p + d * z + a * x
            y, z = ca * y + sa * z, ca * z - sa * y
            x, z = cb * x - sb * z, sb * x + cb * z
        beyond, mass = weighed(len(feet)), self.moments[:, -1, 0]
        g = self.gravity.T[:, :, None]
        found = np.empty((len(feet), 3, *beyond.shape[1:]))
        for i in reversed(range(len(feet))):
            beyond, mass = beyond + first[i], mass + self.moments[:, i, 0]
            arm = beyond - mass[:, None] * feet[i]
            for k, axis in enumerate(axes[i]):
                found[i, k] = sum(
                    axis[a] * (arm[b] * g[c] - arm[c] * g[b])
                    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
                )
        return found
