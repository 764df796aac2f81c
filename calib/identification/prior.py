"""Priors of the numbers of a model, in their own units, and as rows of a least-squares fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen, require_numbers
from calib.errors import refuse
from calib.geometry.frames import exp_so3, right_jacobian_inverse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.tangent import Believed
from calib.information.sizes import weak_prior_sd
from calib.kinds import checked_kinds, of_kind
from calib.shown import Shown

AGREE = 1e-6
"""Largest relative difference of `sd` from that of `precision`, where both are given."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior(Shown):
    """Normal prior of some numbers of a model, as the step from the nominal model.

    Give `sd` for independent numbers; for correlated ones use `Prior.of_precision`.

    Examples
    --------
    Two lengths are drawn to 0.1 mm, and the drawing says that one of them is 0.2 mm longer:

    >>> Prior([2e-4, 0.0], [1e-4, 1e-4], ["d1", "a2"])
    Prior(of 2 numbers)
    """

    mean: Array
    """(k,) prior mean of the step from the nominal model [m, rad]."""
    sd: Array
    """(k,) prior standard deviation of each number [m, rad]."""
    names: tuple[str, ...]
    """(k,) names of the numbers; all of them must be free in the fit."""
    precision: Array = ()  # type: ignore[assignment]  # becomes an array in __post_init__
    """(k, k) Lambda0, inverse covariance [1/m^2, 1/(m rad), 1/rad^2]; from `sd` unless given."""

    if TYPE_CHECKING:  # the fields are arrays; what is given need not be

        def __init__(
            self, mean: ArrayLike, sd: ArrayLike, names: Sequence[str], precision: ArrayLike = ...
        ) -> None: ...

    def __post_init__(self) -> None:
        names = of_kind("names", self.names, Sequence[str])
        mean, sd = check(f"{len(names)}, {len(names)}", mean=self.mean, sd=self.sd)
        if not names or len(set(names)) < len(names):
            twice = sorted({name for name in names if names.count(name) > 1})
            message = f"the prior names {', '.join(twice)} twice" if twice else "the prior is empty"
            allowed = "each name once, at least one"
            raise refuse("names", tuple(twice), allowed, code="A3", message=message)
        if (sd <= 0).any():
            k = int(np.argmin(sd))
            message = f"the prior sd of {names[k]} is {sd[k]:g}"
            fix = "hold a number fixed that is known exactly: do not free it"
            raise refuse("sd", float(sd[k]), "above zero", code="A3", message=message, fix=fix)
        if require_numbers("precision", self.precision).size:
            (precision,) = check(f"{len(names)} {len(names)}", precision=self.precision)
            stated = _sd_of(precision)
            off = np.abs(sd / stated - 1)
            if (off > AGREE).any():
                k = int(np.argmax(off))
                raise refuse(
                    "sd", float(sd[k]), "the same in both", code="A3",
                    message=f"the prior sd of {names[k]} is {sd[k]:.6g}, "
                    f"its precision says {stated[k]:.6g}",
                    fix="give the precision alone, with Prior.of_precision",
                )  # fmt: skip
        else:
            precision = frozen(np.diag(sd**-2.0))
        checked = {"mean": mean, "sd": sd, "names": names, "precision": precision}
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return f"Prior(of {len(self.names)} numbers)"

    @classmethod
    @checked_kinds
    def of_precision(cls, mean: ArrayLike, precision: ArrayLike, names: Sequence[str]) -> "Prior":
        """Prior of correlated numbers, from its precision (k, k), symmetric positive definite."""
        (precision,) = check("k k", precision=precision)
        return cls(require_numbers("mean", mean), _sd_of(precision), tuple(names), precision)

    def weighed(self, factor: float) -> "Prior":
        """The same prior with `factor` times the precision."""
        return Prior.of_precision(self.mean, self.precision * factor, self.names)

    def halved(self, rows: Array) -> Array:
        """Rows (n, k) times L, where L L' is the precision."""
        if _diagonal(self.precision):
            return np.asarray(rows * np.sqrt(np.diagonal(self.precision)))
        return np.asarray(rows @ _root(self.precision).T)

    def joined(self, other: "Prior") -> "Prior":
        """Both priors as one, independent of each other; they must be of different numbers."""
        a, b = len(self.names), len(other.names)
        precision = np.zeros((a + b, a + b))
        precision[:a, :a], precision[a:, a:] = self.precision, other.precision
        return Prior(
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.sd, other.sd]),
            (*self.names, *other.names),
            precision,
        )


@dataclass(frozen=True, slots=True, eq=False)
class PriorRows:
    """A prior as whitened rows of a least-squares problem about one nominal model."""

    nominal: RobotModel
    mean: Array
    """(k,) prior mean of the step from the nominal model [m, rad]."""
    index: Index
    """(k,) indices of the numbers in the full vector."""
    root: Array
    """(k, k) upper triangle U with U'U the precision."""

    @property
    def sizes(self) -> Array:
        """(k,) diagonal of U; for independent numbers it is 1 / sd."""
        return np.diagonal(self.root)

    @property
    def independent(self) -> bool:
        """Whether the numbers are independent, so that U is diagonal."""
        return _diagonal(self.root)

    def at(self, model: RobotModel) -> tuple[Array, Array]:
        """Residual U (mean - x) (k,) and derivative U dx (k, P) by a small step of every number.

        x is the whole step from the nominal model; in a turned frame a small step counts along the
        axes the frame has now, which the derivative takes into account.
        """
        step = self.nominal.step_to(model)
        rows, off = step_derivative(step, model)[self.index], self.mean - step[self.index]
        if self.independent:
            return self.sizes * off, self.sizes[:, None] * rows
        return self.root @ off, self.root @ rows

    def beside(self, model: RobotModel, columns: Index) -> Believed:
        """The rows by some numbers (p,) of the model, which include all that have a prior."""
        r, A = self.at(model)
        together = np.zeros(model.n_numbers, dtype=np.bool_)
        for k in frame_places(model):
            together[k : k + 6] = True
        some = together[self.index] if self.independent else np.ones(len(r), dtype=np.bool_)
        alone = np.zeros((2, model.n_numbers))
        alone[:, self.index[~some]] = r[~some], self.sizes[~some]
        return Believed(r[some], A[some][:, columns], *alone[:, columns])


@checked_kinds
def weak_prior(parameters: Parameters, model: RobotModel | None = None) -> Prior:
    """Weak prior of the free numbers of a carefully built arm, with the nominal model as its mean.

    The sd are 0.1 deg for angles, 0.6 mm for lengths, 1 mm and 0.1 deg for frames, some five times
    the usual errors, so that measurements overrule it. Joint errors of `model` have sd by kind: sag
    50 mdeg, waves of order 1 20 mdeg, of order 2 12 mdeg, higher ones 3 mdeg; see
    `sizes.usual_sizes`.
    """
    sd = weak_prior_sd(parameters, model)
    return Prior(np.zeros(len(sd)), sd, parameters.free_names)


def own_prior(parameters: Parameters, model: RobotModel) -> Prior | None:
    """The weak prior of the free joint errors of a model; None if none is free.

    Measurements hardly determine many of them, so that no fit frees them without it.
    """
    own = set(model.names[model.chain.n_numbers : model.first_fixture])
    free = [name for name in parameters.free_names if name in own]
    return weak_prior(parameters.freeing(free), model) if free else None


def own_words(model: RobotModel, parameters: Parameters) -> str:
    """Sentence on which joint errors of a model are free or held in a fit; empty without any."""
    own = model.joint_errors.names
    free = len(set(own) & set(parameters.free_names))
    both = ((free, "free under a prior"), (len(own) - free, "held as they are"))
    told = " and ".join(f"{count} {how}" for count, how in both if count)
    return told and f"of the joint errors that the robot has already {told}"


def prior_rows(prior: Prior, nominal: RobotModel, parameters: Parameters) -> PriorRows:
    """The rows that a prior adds to a fit that starts at `nominal`.

    Raises
    ------
    InputError
        A4: the prior names a number that the model does not have, or that is not free.
    """
    free = set(parameters.free_names)
    for name in prior.names:
        if name in free:
            continue
        close = get_close_matches(name, parameters.names, 1)
        which = "which the model does not have"
        fix = f'did you mean "{close[0]}"?' if close else "see the model's names"
        if name in parameters.names:
            which, fix = "which is not free", f'free it, or leave "{name}" out of the prior'
        message = f'the prior names "{name}", {which}'
        raise refuse("prior", name, "names of free numbers", code="A4", message=message, fix=fix)
    place = {name: k for k, name in enumerate(parameters.names)}
    index = np.array([place[name] for name in prior.names], dtype=np.int64)
    return PriorRows(nominal, prior.mean, index, _root(prior.precision))


def step_derivative(step: Array, model: RobotModel) -> Array:
    """Derivative (P, P) of the step (P,) that leads to `model`, by a small further step of it.

    It is the identity for links, joint terms and points, which are added. For a frame [t; r] it is
    Exp(r) for the translation and Jr^-1(r) for the rotation.

    References
    ----------
    Sola, Deray, Atchuthan, arXiv 1812.01537, eqs. (144) and (176).
    """
    derivative = np.eye(len(step))
    for k in frame_places(model):
        turn = step[k + 3 : k + 6]
        derivative[k : k + 3, k : k + 3] = exp_so3(turn)
        derivative[k + 3 : k + 6, k + 3 : k + 6] = right_jacobian_inverse(turn)
    return derivative


def frame_places(model: RobotModel) -> tuple[int, ...]:
    """Index of the first of the six numbers of each frame: base, tool, stations, further tools."""
    further = range(model.first_fixture + model.fixtures.first_station, model.n_numbers, 6)
    return 0, model.chain.n_numbers - 6, *further


def _root(precision: Array) -> Array:
    """Upper U (k, k) with U'U = precision; an `InputError` (A3) if not positive definite."""
    if _diagonal(precision):
        return np.diag(np.sqrt(np.diag(precision)))
    size = np.sqrt(np.abs(np.diag(precision)))
    scaled = precision / np.outer(np.where(size > 0, size, 1.0), np.where(size > 0, size, 1.0))
    if np.abs(scaled - scaled.T).max() > 1e-9:
        i, j = (int(k) for k in np.argwhere(np.abs(scaled - scaled.T) > 1e-9)[0])
        gap, message = (
            precision[i, j] - precision[j, i],
            f"precision[{i}, {j}] and [{j}, {i}] differ",
        )
        raise refuse("precision", float(gap), "a symmetric matrix", code="A3", message=message)
    lowest = float(np.linalg.eigvalsh(scaled)[0])
    if lowest < 1e-13:
        raise refuse(
            "precision", lowest, "a positive definite matrix", code="A3",
            message=f"the precision of the prior has the scaled eigenvalue {lowest:.3g}",
            fix="leave numbers out of which nothing is known beforehand",
        )  # fmt: skip
    return np.asarray(np.linalg.cholesky((scaled + scaled.T) / 2).T * size)


def _diagonal(M: Array) -> bool:
    """Whether a matrix (k, k) is diagonal with a positive diagonal."""
    return bool((np.diagonal(M) > 0).all()) and np.count_nonzero(M) == len(M)


def _sd_of(precision: Array) -> Array:
    """Marginal standard deviations (k,) of a precision (k, k)."""
    root = _root(precision)
    if _diagonal(root):
        return frozen(1 / np.diag(root))
    inverse = np.linalg.solve(root, np.eye(len(precision)))
    return frozen(np.linalg.norm(inverse, axis=1))
