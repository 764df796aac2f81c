"""Errors at poses that the identification never used, and whether the covariance explains them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from calib.arrays import Array, check, frozen
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.kinds import checked_kinds
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import ResultTable, Shown, length_words, mean_of
from calib.uncertainty.covariance import covariance_factor

SAME_POSE = 1e-4
"""Largest difference of joint values [rad, m] within which two poses are the same one: joints that
were read back at one pose differ by less, and a robot hardly comes back more closely."""

AT_ONCE = 256
"""Held-out poses compared at once with all that identified."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut(Shown):
    """Position errors at n held-out poses, and what was predicted for them."""

    error: Annotated[Array, "n", 3]
    """(n, 3) measured minus predicted position, axes of the station, most often the world [m]."""
    predicted: Annotated[Array, "n", 3, 3]
    """(n, 3, 3) Sigma_t, from the covariance of the parameters [m^2]."""
    measured: Annotated[Array, "n", 3, 3]
    """(n, 3, 3) of the measurements themselves [m^2]."""
    chi_square: float
    """Of all errors together; the parameter error they share is taken into account."""
    p_value: float
    """Chance of a larger one if model, covariance and noise are right."""

    def __len__(self) -> int:
        return len(self.error)

    def __repr__(self) -> str:
        mean = length_words(mean_of(self.distance), um=".3g")
        return f"HeldOut({len(self)} poses, mean error {mean}, p = {self.p_value:.2g})"

    def tables(self) -> dict[str, ResultTable]:
        """``errors``, pose by pose [m]; u is stated of them, 3-D, the reading's noise in it."""
        spread = np.trace(self.predicted + self.measured, axis1=1, axis2=2)
        x, y, z = self.error.T
        columns = {"x_m": x, "y_m": y, "z_m": z, "distance_m": self.distance}
        return {"errors": ResultTable({**columns, "u_m": np.sqrt(spread)})}

    @property
    def distance(self) -> Array:
        """(n,) length of the errors [m]."""
        return np.asarray(np.linalg.norm(self.error, axis=1))


@checked_kinds
def held_out(
    model: RobotModel, covariance: ArrayLike, validation: Measurements, used_q: ArrayLike
) -> HeldOut:
    """Predict held-out poses and compare.

    Parameters
    ----------
    model : RobotModel
        Identified.
    covariance : (P, P) array_like
        Of its full parameter vector, `Identification.full_covariance` [m^2, m rad, rad^2].
    validation : Measurements
        Poses or points drawn from where the robot will be used, never from the designed set.
    used_q : (m, n) array_like
        Joints that the identification used [rad, m].

    Raises
    ------
    InputError
        If a pose was used for the identification, too.

    References
    ----------
    e' inv(J C J' + Sigma) e over all poses together, chi-square with 3 n degrees of freedom.
    """
    require_disjoint(validation.q, used_q)
    (covariance,) = check(f"{model.n_numbers} {model.n_numbers}", covariance=covariance)
    if not len(validation):
        message, fix = "there are no validation poses", "hold some out, measured where it is used"
        raise refuse("validation", 0, "at least one", code="A3", message=message, fix=fix)
    if validation.is_distance.any():
        row = int(np.argmax(validation.is_distance))
        message = f"validation row {row} is a distance; it shows no position"
        raise refuse("validation", row, "poses and points", code="A3", message=message)
    prediction = predict(model, validation)
    rows, error = prediction.rows[:, :3], prediction.residual[:, :3]
    sigma = validation.covariance[:, :3, :3]
    G = np.tensordot(rows, covariance_factor(covariance), 1)  # (n, 3, P)
    try:
        root = np.linalg.cholesky(sigma)
    except np.linalg.LinAlgError:
        raise refuse(
            "validation.covariance",
            allowed="every direction must scatter a little",
            code="M34",
            message="a validation measurement has a covariance that is not positive definite",
            fix="give each axis a standard deviation above zero",
        ) from None
    white = np.linalg.solve(root, error[..., None])[..., 0].ravel()
    U = np.linalg.solve(root, G).reshape(len(white), -1)
    # one shared parameter error: inverse of I + U U' by the small system
    pull = U.T @ white
    chi_square = float(white @ white - pull @ np.linalg.solve(np.eye(len(pull)) + U.T @ U, pull))
    return HeldOut(
        frozen(error),
        frozen(G @ np.swapaxes(G, -1, -2)),
        frozen(sigma),
        chi_square,
        float(chdtrc(len(white), chi_square)),
    )


def require_disjoint(q: ArrayLike, used_q: ArrayLike) -> None:
    """Refuse validation poses (n, j) that the identification (m, j) used: they are no test."""
    q, used_q = check("n j, m j", q=q, used_q=used_q)
    telling = int(np.argmax(q.std(axis=0))) if len(q) else 0  # alike in few pairs of poses
    for start in range(0, len(q), AT_ONCE):
        some = q[start : start + AT_ONCE]
        row, used = np.nonzero(np.abs(used_q[:, telling] - some[:, telling, None]) <= SAME_POSE)
        same = (np.abs(used_q[used] - some[row]) <= SAME_POSE).all(axis=1)
        if same.any():
            at = int(np.argmax(same))
            raise refuse(
                "validation", start + row[at],
                "a test needs poses that the identification did not use",
                code="A3",
                message=f"validation pose {start + row[at]} is pose {used[at]} of the "
                "identification",
                fix="measure other poses, or leave these out of the identification",
            )  # fmt: skip


def first_of_pose(test: Measurements) -> Measurements:
    """The first row of every pose, by its number: others repeat the same error of the model."""
    return test.rows(np.unique(test.pose_id, return_index=True)[1])


def errors_of_poses(model: RobotModel, test: Measurements) -> Array:
    """Largest position error (p,) of each pose [m]: poses are alike, rows of one not independent.

    A distance shows an error along one line only: no radius around a point comes of it.
    """
    points = test.rows(~test.is_distance)
    if not len(points):
        return np.zeros(0)
    return points.largest_of_poses(predict(model, points).misses)
