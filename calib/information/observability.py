"""Observability indices O1 to O5 of a pose set: as printed by Wen et al., as meant, per pose."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, require_count
from calib.errors import refuse
from calib.kinds import checked_kinds, in_short
from calib.shown import ResultTable, Shown

IndexName = Literal["O1", "O2", "O3", "O4", "O5"]
CRITERIA: tuple[IndexName, ...] = ("O1", "O2", "O3", "O4", "O5")
Form = Literal["printed", "correct", "per_pose"]
FORMS: tuple[Form, ...] = ("printed", "correct", "per_pose")


@dataclass(frozen=True, slots=True)
class Indices:
    """The five indices of one pose set."""

    O1: float
    O2: float
    O3: float
    O4: float
    O5: float


@dataclass(frozen=True, slots=True, eq=False)
class Observability(Shown):
    """The five indices of a pose set in three forms.

    They depend on the weights of rows and the units of columns; of O1 the ratio between two sets
    does not depend on the latter.
    """

    n_poses: int
    """Number of poses stacked."""
    printed: Indices
    """As printed in Wen et al. 2022; its O5 grows as the set gets worse."""
    correct: Indices
    """Larger is better for all five; O5 is the inverse of the printed sum."""
    per_pose: Indices
    """`correct` with O3, O4, O5 divided by sqrt(poses): comparable between set sizes."""

    def __repr__(self) -> str:
        values = (f"{c} = {getattr(self.correct, c):.4g}" for c in CRITERIA)
        return f"Observability({self.n_poses} poses: {', '.join(values)})"

    def tables(self) -> dict[str, ResultTable]:
        """``indices`` O1 to O5 in the three forms."""
        forms = (self.printed, self.correct, self.per_pose)
        values = [[getattr(form, c) for c in CRITERIA] for form in forms]
        return {
            "indices": ResultTable(
                {"index": CRITERIA, **dict(zip(map(str, FORMS), values, strict=True))}
            )
        }


def index_of_singular(
    singular: ArrayLike, n_poses: int | Index, criterion: IndexName, form: Form = "correct"
) -> Array:
    """One observability index (...,) of identification Jacobians, from their singular values.

    - O1, mean radius of the information ellipsoid, per pose: (s_1 ... s_p)^(1/p) / sqrt(poses)
    - O2, inverse condition number: s_p / s_1
    - O3, smallest singular value: s_p
    - O4, noise amplification index: s_p^2 / s_1
    - O5: 1 / sum of 1 / s_k; Wen et al. print the sum, and maximizing that picks the worst set

    A singular value of zero makes each of them 0 (the printed O5 infinite).

    Parameters
    ----------
    singular : (..., p) array_like
        Singular values, largest first.
    n_poses : int or (...,) array
        Number of poses stacked in each Jacobian.
    criterion : {"O1", "O2", "O3", "O4", "O5"}
        Which index.
    form : {"printed", "correct", "per_pose"}
        As in `Observability`.

    Raises
    ------
    InputError
        A4: `criterion` or `form` does not exist.

    References
    ----------
    Wen et al. 2022, eq. (6), with the root 1/p in O1 and O5 inverted; Nahvi and Hollerbach 1996
    (O3, O4); Sun and Hollerbach 2008 (O5, assumed).
    """
    check_index(criterion, form)
    singular = np.asarray(singular, dtype=np.float64)
    # a set whose every singular value is zero: condition 0, not 0 / 0
    singular = np.where(singular[..., :1] > 0, singular, [1.0] + [0.0] * (singular.shape[-1] - 1))
    first, last = singular[..., 0], singular[..., -1]
    with np.errstate(divide="ignore"):
        if criterion == "O1":
            # mean of logs: the plain product overflows
            return np.asarray(np.exp(np.log(singular).mean(-1)) / np.sqrt(n_poses))
        if criterion == "O2":
            return np.asarray(last / first)
        if criterion == "O3":
            values = last
        elif criterion == "O4":
            values = last**2 / first
        else:
            values = 1.0 / (1.0 / singular).sum(-1)
            if form == "printed":
                return np.asarray(1.0 / values)
    # these three grow like sqrt(poses): only divided by it do they settle
    return np.asarray(values / np.sqrt(n_poses) if form == "per_pose" else values)


@checked_kinds
def indices(singular: ArrayLike, n_poses: int) -> Observability:
    """All five indices of the singular values (p,) of the Jacobian of `n_poses` poses.

    Parameters
    ----------
    singular : (p,) array_like
        Singular values of the stacked rows, whitened and scaled; largest first.
    n_poses : int
        Number of poses stacked.

    Raises
    ------
    InputError
        A3: there is none, or they are negative or do not descend.

    Examples
    --------
    The indices of the first twelve poses of a pool:

    >>> from calib import Chain, RobotModel, design
    >>> arm = RobotModel(Chain([[0, 0.4, 0.1, -1.57, 0], [0, 0, 0.5, 0, 0], [0, 0, 0.4, 0, 0]]))
    >>> pool = np.random.default_rng(0).uniform(-2, 2, (40, 3))
    >>> problem = design.Problem.of_poses(arm, pool, poses=12, criterion="O1")
    >>> rows = problem.rows(range(12))
    >>> found = indices(np.linalg.svd(rows, compute_uv=False), 12)
    >>> bool(found.correct.O1 < design.exchange(problem, np.random.default_rng(0)).value)
    True
    """
    (singular,) = check("p", singular=singular)
    if not singular.size or (singular < 0).any() or (np.diff(singular) > 0).any():
        message = "singular must be the singular values of a Jacobian"
        allowed = "at least one, none negative, largest first"
        raise refuse("singular", allowed=allowed, code="A3", message=message)
    n_poses = require_count("n_poses", n_poses)
    tables = (
        Indices(*(float(index_of_singular(singular, n_poses, c, form)) for c in CRITERIA))
        for form in FORMS
    )
    return Observability(n_poses, *tables)


@in_short
def index_of(
    M: ArrayLike, n_poses: int | Index, criterion: IndexName, form: Form = "correct"
) -> Array:
    """One observability index (...,) of information matrices M = A'A, to score many sets at once.

    Squaring costs digits: with the rows of Wen et al. (condition 3e4) O2 to O5 keep about seven.

    Parameters
    ----------
    M : (..., p, p) array_like
        Information matrices, trusted to be symmetric and finite.
    n_poses : int or (...,) array
        Number of poses in each.
    criterion : IndexName
        ``"O1"`` to ``"O5"``.
    form : Form
        ``"correct"``, ``"per_pose"`` or ``"printed"``.

    References
    ----------
    Wen et al. 2022, eq. (6): O1 = exp(log det M / 2p) / sqrt(poses), the others from eigenvalues.
    """
    check_index(criterion, form)
    M = np.asarray(M, dtype=np.float64)
    if criterion == "O1":
        sign, log_det = np.linalg.slogdet(M)
        log_det = np.where(sign > 0, log_det, -np.inf)
        return np.asarray(np.exp(log_det / (2 * M.shape[-1])) / np.sqrt(n_poses))
    return index_of_singular(singular_of_information(M), n_poses, criterion, form)


def singular_of_information(M: Array) -> Array:
    """Singular values (..., p) of A, largest first, from M = A'A (..., p, p)."""
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(M)[..., ::-1], 0.0)), np.float64)


def check_index(criterion: str, form: str = "correct") -> None:
    """Raise an `InputError` (A4) for an index or a form that does not exist."""
    for field, value, allowed in (("criterion", criterion, CRITERIA), ("form", form, FORMS)):
        if value not in allowed:
            message = f'{field} is "{value}"'
            raise refuse(field, value, f"one of {', '.join(allowed)}", code="A4", message=message)
