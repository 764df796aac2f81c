"""Geometry alone, or joint errors as well: both identified, and the choice between them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import refuse
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.identify import identify
from calib.identification.joint_models import with_joint_terms
from calib.identification.outlier_search import HONEST, noise_factor
from calib.identification.prior import Prior, weak_prior
from calib.identification.result import Identification
from calib.identification.robust import Loss
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict

ASKED = float(np.log(20))
"""Log evidence from which the data ask for the extended model: odds of 20 to 1."""
TRIMMED = 0.95
"""Part of the errors at poses left out, the smaller ones, that counts."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelChoice:
    """Two models of one robot, identified from one table, and which of them to use."""

    chosen: Literal["geometric", "extended"]
    identifications: tuple[Identification, Identification]
    """Geometric and extended, both with the same geometric prior."""
    log_evidence: float
    """Natural logarithm of the odds that the measurements give the extended model."""
    sentence: str
    """What was chosen and why."""

    def __repr__(self) -> str:
        return f"ModelChoice({self.sentence})"

    @property
    def identification(self) -> Identification:
        """The one chosen."""
        return self.identifications[self.chosen == "extended"]


def choose(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters | None = None,
    *,
    prior: Prior | None = None,
    term_prior: Prior | None = None,
    loss: Loss = "squared",
    report: Callable[[int, float], None] | None = None,
    mounted: Chain | None = None,
) -> ModelChoice:
    """Identify the geometric and the extended model, and choose by evidence.

    The evidence rewards a better fit and charges for freedom: terms that the measurements do not
    ask for cost it about ln(prior sd / posterior sd) each. It is fooled by what neither model
    explains: `left_out_errors` confirms it, or not.

    Parameters
    ----------
    nominal : RobotModel
        Start of both.
    measurements : Measurements
        What both are identified from.
    parameters : Parameters, optional
        Which numbers of `nominal` are free; all by default.
    prior : Prior, optional
        Of all free numbers, the same in both models; `weak_prior(parameters)` by default.
    term_prior : Prior, optional
        Of the added joint terms; the weak one by default.
    loss : {"squared", "huber", "cauchy"}
        As in `identify`; a robust one keeps gross errors from calling for more terms.
    report : callable, optional
        As in `identify`, of both fits one after the other.
    mounted : Chain, optional
        The arm as it stands, where the world of `nominal` need not be level; see `extended_model`.

    Raises
    ------
    InputError
        If a free number has no prior, or if there is no joint term to add.

    References
    ----------
    MacKay 1992: evidence by Laplace's method.
    """
    parameters = parameters_of(nominal) if parameters is None else parameters
    prior = weak_prior(parameters) if prior is None else prior
    bare = [name for name in parameters.free_names if name not in prior.names]
    if bare:
        raise refuse(
            "prior", tuple(bare), code="A3", message=f"{bare[0]} is free and has no prior",
            allowed="a prior of every free number: evidence compares nothing else",
            fix="add them to the prior, or leave it out for the weak one",
        )  # fmt: skip
    wide, table, added = with_joint_terms(nominal, parameters, mounted)
    both = prior.joined(weak_prior(added) if term_prior is None else term_prior)
    geometric = identify(nominal, measurements, parameters, prior=prior, loss=loss, report=report)
    extended = identify(wide, measurements, table, prior=both, loss=loss, report=report)
    evidence = extended.log_evidence - geometric.log_evidence
    asked = evidence > ASKED
    ratios = " to ".join(
        f"{result.chi_square / result.dof_effective:.2f}" for result in (geometric, extended)
    )
    return ModelChoice(
        chosen="extended" if asked else "geometric",
        identifications=(geometric, extended),
        log_evidence=evidence,
        sentence=(
            f"{'extended' if asked else 'geometric'}: the measurements "
            f"{'ask' if asked else 'do not ask'} for joint errors (log evidence {evidence:+.1f}, "
            f"chi-square per degree of freedom {ratios})"
        ),
    )


def identify_extended(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    *,
    loss: Loss = "squared",
    mounted: Chain | None = None,
) -> Identification:
    """Identify geometry as the data show it, and joint terms under the weak prior.

    Where the residuals stay larger than the stated noise, the prior is weighed against the noise
    that they have: else it would be overruled by what is no information.
    """
    wide, table, added = with_joint_terms(nominal, parameters, mounted)
    terms = weak_prior(added)
    result = identify(wide, measurements, table, prior=terms, loss=loss)
    factor = noise_factor(result.model, measurements)
    if factor <= HONEST:
        return result
    tighter = Prior(terms.mean, terms.sd / factor, terms.names)
    return identify(wide, measurements, table, prior=tighter, loss=loss)


def left_out_errors(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    part: Index,
    *,
    rounds: int,
    loss: Loss = "squared",
    mounted: Chain | None = None,
) -> Array:
    """Trimmed mean error (2,) of both models at poses left out in turn, geometric first [m].

    Parameters
    ----------
    nominal : RobotModel
        Where fits begin.
    measurements : Measurements
        What is left out, part by part, and identified from.
    parameters : Parameters
        Of `nominal`.
    part : (m,) array of int
        Part that each row belongs to; rows of one pose are in one part.
    rounds : int
        So many parts are left out in turn, from 0.
    loss, mounted : optional
        As in `choose`.

    References
    ----------
    Cross-validation; the geometric model without a prior, the extended one by `identify_extended`.
    """
    errors: tuple[list[Array], list[Array]] = ([], [])
    for k in range(rounds):
        used, left_out = measurements.rows(part != k), measurements.rows(part == k)
        geometric = identify(nominal, used, parameters, loss=loss)
        extended = identify_extended(nominal, used, parameters, loss=loss, mounted=mounted)
        for own, result in zip(errors, (geometric, extended), strict=True):
            own.append(predict(result.model, left_out).misses)
    return frozen([_trimmed_mean(np.concatenate(own)) for own in errors])


def _trimmed_mean(errors: Array) -> float:
    """Mean without the largest twentieth: a number that rests on one pose may miss that by all."""
    return float(np.sort(errors)[: int(np.ceil(TRIMMED * len(errors)))].mean())
