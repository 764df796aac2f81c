"""Observability indices O1 to O5 of a pose set: as printed by the paper, as meant, and per pose."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check
from calib.errors import InputError
from calib.information.rank import singular_values as singular_values

IndexName = Literal["O1", "O2", "O3", "O4", "O5"]
CRITERIA: tuple[IndexName, ...] = ("O1", "O2", "O3", "O4", "O5")
Form = Literal["printed", "correct", "per_pose"]
FORMS: tuple[Form, ...] = ("printed", "correct", "per_pose")
GROWS_WITH_POSES = ("O3", "O4", "O5")
"""These grow like sqrt(poses): only divided by it do they settle."""


@dataclass(frozen=True, slots=True)
class Indices:
    """The five indices of one pose set."""

    O1: float
    O2: float
    O3: float
    O4: float
    O5: float


@dataclass(frozen=True, slots=True, eq=False)
class Observability:
    """The five indices in three forms; they depend on row weights and column units (O1 least)."""

    n_poses: int
    """Poses stacked."""
    printed: Indices
    """As printed in the paper; its O5 grows as the set gets worse."""
    correct: Indices
    """Larger is better for all five; O5 is the inverse of the printed sum."""
    per_pose: Indices
    """`correct` with O3, O4, O5 divided by sqrt(poses): comparable between set sizes."""


def geometric_mean_index(singular: Array, n_poses: int | Index) -> Array:
    """O1: size of the information ellipsoid, per pose.

    Parameters
    ----------
    singular : (..., p) array
        Singular values of the scaled identification Jacobian, largest first.
    n_poses : int or (...,) array
        Poses stacked in that Jacobian.

    References
    ----------
    Wen et al. 2022, eq. (6), with the root 1/p.
    """
    with np.errstate(divide="ignore"):
        # mean of logs: the plain product overflows
        return np.asarray(np.exp(np.log(singular).mean(-1)) / np.sqrt(n_poses))


def inverse_condition_index(singular: Array) -> Array:
    """O2: roundness of the ellipsoid, smallest over largest singular value (..., p).

    References
    ----------
    Wen et al. 2022, eq. (6).
    """
    return np.asarray(singular[..., -1] / singular[..., 0])


def smallest_index(singular: Array) -> Array:
    """O3: the smallest singular value (..., p), strength of the weakest direction.

    References
    ----------
    Wen et al. 2022, eq. (6); Nahvi and Hollerbach 1996.
    """
    return np.asarray(singular[..., -1])


def noise_amplification_index(singular: Array) -> Array:
    """O4: smallest singular value squared over the largest (..., p).

    References
    ----------
    Wen et al. 2022, eq. (6); Nahvi and Hollerbach 1996.
    """
    return np.asarray(singular[..., -1] ** 2 / singular[..., 0])


def inverse_sum_index(singular: Array) -> Array:
    """O5: one over the sum of inverse singular values (..., p).

    The paper prints the sum itself; maximizing that would pick the worst set.

    References
    ----------
    Wen et al. 2022, eq. (6), inverted; Sun and Hollerbach 2008 (assumed).
    """
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (1.0 / singular).sum(-1))


_OF_SINGULAR: dict[IndexName, Callable[[Array], Array]] = {
    "O2": inverse_condition_index,
    "O3": smallest_index,
    "O4": noise_amplification_index,
    "O5": inverse_sum_index,
}


def index_of_singular(
    singular: Array, n_poses: int | Index, criterion: IndexName, form: Form = "correct"
) -> Array:
    """One index of singular values (..., p), largest first; a vanishing one gives 0."""
    check_index(criterion, form)
    # a set whose every singular value is zero tells nothing: condition 0, not 0 / 0
    singular = np.where(singular[..., :1] > 0, singular, [1.0] + [0.0] * (singular.shape[-1] - 1))
    if criterion == "O1":
        return geometric_mean_index(singular, n_poses)
    values = _OF_SINGULAR[criterion](singular)
    if form == "per_pose" and criterion in GROWS_WITH_POSES:
        return np.asarray(values / np.sqrt(n_poses))
    if form == "printed" and criterion == "O5":
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / values)
    return values


def indices(singular: ArrayLike, n_poses: int) -> Observability:
    """All five indices of the singular values (p,) of the Jacobian of `n_poses` poses."""
    (singular,) = check("p", singular=singular)
    if not singular.size or (singular < 0).any() or (np.diff(singular) > 0).any():
        raise InputError(
            "singular must be the singular values of a Jacobian",
            code="A3",
            field="singular",
            allowed="at least one, none negative, largest first",
        )
    if n_poses < 1:
        raise InputError(
            f"n_poses is {n_poses}", code="A3", field="n_poses", value=n_poses, allowed="at least 1"
        )
    tables = (
        Indices(*(float(index_of_singular(singular, n_poses, c, form)) for c in CRITERIA))
        for form in FORMS
    )
    return Observability(n_poses, *tables)


def index_of(M: Array, n_poses: int | Index, criterion: IndexName, form: Form = "correct") -> Array:
    """One index of information matrices M = A'A (..., p, p), for scoring many sets at once.

    Squaring costs digits: with the paper's rows (condition 3e4) O2 to O5 keep about seven.

    Parameters
    ----------
    M : (..., p, p) array
        Information matrices, trusted to be symmetric and finite.
    n_poses : int or (...,) array
        Poses in each.
    criterion : IndexName
        ``"O1"`` to ``"O5"``.
    form : Form
        ``"correct"``, ``"per_pose"`` or ``"printed"``.

    References
    ----------
    Wen et al. 2022, eq. (6): O1 = exp(log det M / 2p) / sqrt(poses), the others from eigenvalues.
    """
    check_index(criterion, form)
    if criterion == "O1":
        sign, log_det = np.linalg.slogdet(M)
        log_det = np.where(sign > 0, log_det, -np.inf)
        return np.asarray(np.exp(log_det / (2 * M.shape[-1])) / np.sqrt(n_poses))
    return index_of_singular(singular_of_information(M), n_poses, criterion, form)


def singular_of_information(M: Array) -> Array:
    """Singular values (..., p), largest first, of the Jacobians behind M = A'A (..., p, p)."""
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(M)[..., ::-1], 0.0)), np.float64)


def check_index(criterion: str, form: str = "correct") -> None:
    """Refuse an index or a form that does not exist."""
    for field, value, allowed in (("criterion", criterion, CRITERIA), ("form", form, FORMS)):
        if value not in allowed:
            raise InputError(
                f'{field} is "{value}"',
                code="A4",
                field=field,
                value=value,
                allowed=f"one of {', '.join(allowed)}",
            )
