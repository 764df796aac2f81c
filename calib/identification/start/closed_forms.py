"""Closed forms for frames: rotations, shifts and points by linear algebra, without iterations.

F (m, 4, 4) are the poses of the flange in the base, from the nominal links. Along directions that
the data do not determine, results keep the value of `about`.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.frames import points_of_frames, transform

ROUNDING = 1e-9
"""Fraction of the largest column below which one is made of rounding errors."""
FLAT = 0.02
"""Fraction of their spread by which points lie beside a plane or a line at most: the error of a
nominal robot, some tenths of a millimeter, would place another point on one side or the other."""
FAINT = 1e-3
"""Fraction of an ordinary column below which a direction counts as undetermined: the error of a
nominal robot is about a millimeter, and divided by this fraction it is a meter."""
APART = 1e-5
"""Smallest relative gap below the largest singular value for it to be unique; rotations of some
milliradians give such a gap."""
NUDGE = 1e-9
"""Weight of the rotation `about`, which decides where points leave a rotation about a line open."""


def nearest_rotation(M: Array) -> Array:
    """The rotation (3, 3) nearest to a matrix; right-handed whatever the matrix is.

    References
    ----------
    Kabsch 1976; Umeyama 1991 for the determinant.
    """
    U, _, Vt = np.linalg.svd(M)
    R = U @ Vt
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0:
        R = (U * (1.0, 1.0, -1.0)) @ Vt
    return np.asarray(R)


def centroid(points: Array) -> Array:
    """Mean of rows, without the overhead of `numpy.mean`, which is larger for so few."""
    return np.asarray(np.add.reduce(points) / len(points))


def fitted_frame(measured: Array, known: Array, about: Array) -> Array:
    """Transform T (4, 4) with measured (k, 3) = R known (k, 3) + t, in the least-squares sense.

    One point gives the rotation `about` (3, 3), two the rotation nearest to it about their line.

    References
    ----------
    Umeyama 1991 (Procrustes).
    """
    center, own = centroid(measured), centroid(known)
    R = turned_onto((measured - center).T @ (known - own), about)
    return transform(R, center - R @ own)


def turned_onto(H: Array, about: Array) -> Array:
    """The rotation of `fitted_frame` from the sum H (3, 3) of measured known', less their means."""
    return nearest_rotation(H + NUDGE * max(float(np.abs(H).max()), 1e-12) * about)


def hand_eye_rotations(F: Array, measured: Array) -> tuple[Array, Array] | None:
    """Rotations X, Y (3, 3) with measured (m, 3, 3) = X R_F Y, from at least three poses.

    None if the rotations do not determine them: all are equal, or all are about one axis.

    References
    ----------
    Robot-world/hand-eye calibration by the Kronecker product: Li, Wang, Wu 2010; Shah 2013, eq.
    (13): the largest singular pair of sum R_seen (x) R_F.
    """
    # maximize the sum of tr(X' R_seen Y' R_F'), bilinear in X and Z = Y'
    m = len(F)
    K = measured.reshape(m, 9).T @ F[:, :3, :3].reshape(m, 9)
    K = K.reshape(3, 3, 3, 3).swapaxes(1, 2).reshape(9, 9)
    U, s, Vt = np.linalg.svd(K)
    if s[1] > (1 - APART) * s[0]:
        return None
    X, Z = U[:, 0].reshape(3, 3), Vt[0].reshape(3, 3)
    sign = 1.0 if np.linalg.det(X) > 0 else -1.0
    return nearest_rotation(sign * X), nearest_rotation(sign * Z).T


def tool_rotation(X: Array, F: Array, measured: Array) -> Array:
    """Rotation Y (3, 3) with measured (m, 3, 3) = X R_F Y, X known: the chordal mean."""
    return nearest_rotation(F[:, :3, :3].reshape(-1, 3).T @ (X.T @ measured).reshape(-1, 3))


@dataclass(frozen=True, slots=True, eq=False)
class PointColumns:
    """Factored columns of unknown points in the flange, which are the same for every base frame."""

    F: Array
    """(m, 4, 4) poses of the flange [m]."""
    target: Index
    """(m,) number of the point that each row measures."""
    free: Index
    """(u,) which of the k points are unknown."""
    factors: tuple[Array, Array, Array, Array] | None
    """Factors of the columns after eliminating the shift; see `factored`. None if none is free."""

    @classmethod
    def of(cls, F: Array, target: Index, fixed: Bool) -> "PointColumns":
        """Columns at poses F (m, 4, 4) of the points that are not `fixed` (k,)."""
        m, free, R = len(F), np.flatnonzero(~fixed), F[:, :3, :3]
        if not free.size:
            return cls(F, target, free, None)
        A: Array = np.zeros((m, 3, len(free), 3))
        for column, k in enumerate(free):
            A[target == k, :, column] = R[target == k]
        # eliminate the shift first: it takes what points could explain as well
        A = (A - centroid(A)).reshape(3 * m, -1)
        return cls(F, target, free, factored(A))

    def shift_and_arms(self, X: Array, measured: Array, about: Array) -> tuple[Array, Array]:
        """Shift t (3,) and points c (k, 3) with measured (m, 3) = X (R_F c + p_F) + t.

        This is linear, since X (3, 3) is given. Fixed points keep their value in `about` (k, 3), as
        does every direction that constant orientation leaves undetermined.
        """
        # p_F + R_F c = X' (measured - t): c from the differences, then t from the mean
        bare = measured @ X - self.F[:, :3, 3]
        rest = bare - self._turned(about)
        c = about.copy()
        if self.factors is not None:
            right = (rest - centroid(rest)).ravel()
            step = _solved(self.factors, right, FAINT * np.sqrt(len(self.F)))
            c[self.free] += step.reshape(-1, 3)
            rest = bare - self._turned(c)
        return X @ centroid(rest), c

    def _turned(self, arms: Array) -> Array:
        """Rotated `arms` (k, 3) for each row (m, 3), which add to the place of the flange [m]."""
        return np.asarray((self.F[:, :3, :3] @ arms[self.target][:, :, None])[:, :, 0])


def lifted_rotation(F: Array, measured: Array, target: Index, about: Array, fixed: Bool) -> Array:
    """Rotation X (3, 3) with measured (m, 3) = X (R_F c + p_F) + t, none of them known.

    Linear lift: X' measured - R_F c + t' = p_F with the nine entries of X' as free unknowns; the
    result is the rotation nearest to them. It needs five poses or more. Measured points in one
    plane leave one column of X' open, which the other two determine.
    """
    m, free = len(F), np.flatnonzero(~fixed)
    R = F[:, :3, :3]
    right = points_of_frames(F, about[target])
    apart = measured - centroid(measured)
    spread = max(float(np.sqrt(np.square(apart).sum(1).mean())), 1e-12)
    A: Array = np.zeros((m, 3, 9 + 3 * len(free)))
    for row in range(3):
        A[:, row, 3 * row : 3 * row + 3] = apart / spread
    for column, k in enumerate(free):
        rows = target == k
        A[rows, :, 9 + 3 * column : 12 + 3 * column] = -R[rows]
    A = (A - centroid(A)).reshape(3 * m, -1)
    G = _least(A, (right - centroid(right)).ravel(), FAINT * np.sqrt(m))[:9].reshape(3, 3)
    return nearest_rotation(G).T


def multilaterated(centers: Array, distance: Array) -> Array:
    """Point x (3,) at `distance` (m,) from `centers` (m, 3) [m], four or more of them.

    References
    ----------
    |x - c|^2 = d^2, linear in x and |x|^2; Navidi, Murphy, Hereman 1998. Of centers in a plane, x
    beside it from |x|^2, to one side.
    """
    middle = centroid(centers)
    c = centers - middle
    square = np.sum(c * c, axis=1) - distance**2
    A = 2 * (c - centroid(c))
    factors = factored(A)
    s, Vt = factors[2:]
    x = _solved(factors, square - square.mean(), FAINT * float(np.linalg.norm(A)))
    flat = s <= FLAT * s[0]
    if flat.any() and not flat.all():
        # what the plane of the centers leaves open follows from |x|^2, to either side of it
        inside, beside = Vt[~flat] @ x, Vt[flat] @ x
        # in the plane itself distances do not change to first order: no fit would leave it
        height = np.sqrt(
            max(
                -square.mean() - inside @ inside, (FLAT * float(np.sqrt((distance**2).mean()))) ** 2
            )
        )
        side = np.where(beside.any(), beside, np.eye(len(beside))[0])
        x = Vt[~flat].T @ inside + Vt[flat].T @ side * (height / np.linalg.norm(side))
    return np.asarray(middle + x)


def beyond(points: Array, place: Array) -> Array | None:
    """Image (3,) of a place beyond the plane of points (m, 3) [m]; None where they lie in none.

    Distances from points in a plane are the same to both.
    """
    normal = plane_normal(points)
    if normal is None:
        return None
    return np.asarray(place - 2 * normal * (normal @ (place - centroid(points))))


def plane_normal(points: Array) -> Array | None:
    """Unit normal (3,) of the plane in which points (m, 3) lie [m]; None where they lie in none."""
    _, s, Vt = np.linalg.svd(points - centroid(points), full_matrices=False)
    if len(s) < 3 or s[2] > FLAT * s[0] or s[1] <= FLAT * s[0]:
        return None
    return np.asarray(Vt[2])


def lifted_arm(F: Array, distance: Array, anchor: Index, n_anchors: int) -> Array:
    """Point c (3,) of the flange whose distances (m,) from unknown anchors were measured [m].

    Linear lift of |R_F c + p_F - a|^2 = d^2: c, and per anchor |c|^2 + |a|^2, a and the nine
    products a c' are free unknowns. It needs 3 + 13 distances for one anchor and 13 for each more.
    """
    R, middle = F[:, :3, :3], centroid(F[:, :3, 3])
    p = F[:, :3, 3] - middle
    m = len(F)
    A = np.zeros((m, 3 + 13 * n_anchors))
    A[:, :3] = 2 * (p[:, None, :] @ R)[:, 0]
    for k in range(n_anchors):
        rows = anchor == k
        block = A[rows, 3 + 13 * k : 16 + 13 * k]
        block[:, 0], block[:, 1:4] = 1.0, -2 * p[rows]
        block[:, 4:] = -2 * R[rows].reshape(-1, 9)
        A[rows, 3 + 13 * k : 16 + 13 * k] = block
    size = np.linalg.norm(A, axis=0)
    # rounding alone where all poses lie in a plane of the axes
    scale = np.where(size > ROUNDING * size.max(), size, np.inf)
    right = distance**2 - np.sum(p * p, axis=1)
    z = _least(A / scale, right, FAINT) / scale
    return np.asarray(z[:3])


def _least(A: Array, right: Array, faint: float) -> Array:
    """Least-squares solution of least norm; singular values of at most `faint` count as zero."""
    return _solved(factored(A), right, faint)


def factored(A: Array) -> tuple[Array, Array, Array, Array]:
    """Q, U, s and V' with A = Q U diag(s) V'."""
    Q, R = np.linalg.qr(A)
    U, s, Vt = np.linalg.svd(R, full_matrices=False)
    return Q, U, s, Vt


def _solved(factors: tuple[Array, Array, Array, Array], right: Array, faint: float) -> Array:
    """As `_least`, from the factors of the columns."""
    Q, U, s, Vt = factors
    counted = s > faint
    along = (U.T @ (Q.T @ right)) / np.where(counted, s, 1.0)
    return np.asarray(Vt.T @ np.where(counted, along, 0.0))
