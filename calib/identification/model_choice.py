"""Geometry alone, or joint errors as well? Climb only when the measurements ask for it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.extended import extended_model, extended_parameters, shared_waves
from calib.identification.identify import identify
from calib.identification.prior import Prior, weak_prior
from calib.identification.result import Identification
from calib.identification.robust import Loss
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict

ASKED = float(np.log(20))
"""Log evidence from which the data ask for the extended model: odds of 20 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelChoice:
    """Two models of one robot, identified from one table, and which of them to use."""

    chosen: Literal["geometric", "extended"]
    identifications: tuple[Identification, Identification]
    """Geometric and extended, both with the same geometric prior."""
    log_evidence: float
    """Natural logarithm of the odds that the measurements give the extended model."""
    held_out_error: Array
    """(2,) mean distance of seen and predicted positions of both models on held-out poses, noise
    included [m]; empty without such poses."""
    sentence: str
    """What was chosen and why."""
    notes: tuple[str, ...] = ()
    """What a reader of the extended model's numbers must know."""

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
    held_out: Measurements | None = None,
    loss: Loss = "squared",
    report: Callable[[int, float], None] | None = None,
    mounted: Chain | None = None,
) -> ModelChoice:
    """Identify the geometric and the extended model, and choose by evidence.

    The evidence rewards a better fit and charges for freedom: terms that the measurements do not
    ask for cost it about ln(prior sd / posterior sd) each. Held-out poses, if given, must confirm.

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
    held_out : Measurements, optional
        Poses of their own that confirm the choice; never used to identify.
    loss : {"squared", "huber", "cauchy"}
        As in `identify`; a robust one keeps gross errors from calling for more terms.
    report : callable, optional
        As in `identify`, of both fits one after the other.
    mounted : Chain, optional
        The arm as it stands, where the world of `nominal` need not be level; see `extended_model`.

    Raises
    ------
    InputError
        If a free number has no prior, if held-out poses are among those identified from, or if
        there is no joint term to add.

    References
    ----------
    MacKay 1992: evidence by Laplace's method.
    """
    parameters = parameters_of(nominal) if parameters is None else parameters
    prior = weak_prior(parameters) if prior is None else prior
    bare = [name for name in parameters.free_names if name not in prior.names]
    if bare:
        raise InputError(
            f"{bare[0]} is free and has no prior",
            code="A3",
            field="prior",
            value=tuple(bare),
            allowed="a prior of every free number: evidence compares nothing else",
            fix="add them to the prior, or leave it out for the weak one",
        )
    if held_out is not None:
        _require_disjoint(measurements, held_out)
    wide = extended_model(nominal, mounted)
    table = extended_parameters(nominal, wide, parameters)
    # by name: the added terms stand before the fixtures
    added = table.freeing(set(wide.names) - set(nominal.names))
    both = prior.joined(weak_prior(added) if term_prior is None else term_prior)
    geometric = identify(nominal, measurements, parameters, prior=prior, loss=loss, report=report)
    extended = identify(wide, measurements, table, prior=both, loss=loss, report=report)
    asked = extended.log_evidence - geometric.log_evidence
    error = frozen(
        ()
        if held_out is None
        else [_mean_distance(found.model, held_out) for found in (geometric, extended)]
    )
    confirmed = held_out is None or bool(error[1] < error[0])
    climb = asked > ASKED and confirmed
    return ModelChoice(
        chosen="extended" if climb else "geometric",
        identifications=(geometric, extended),
        log_evidence=asked,
        held_out_error=error,
        sentence=_sentence(climb, asked, geometric, extended, error, held_out),
        notes=shared_waves(extended),
    )


def _require_disjoint(measurements: Measurements, held_out: Measurements) -> None:
    """Refuse held-out poses that were identified from."""
    known = {row.tobytes() for row in measurements.q + 0.0}
    same = [k for k, row in enumerate(held_out.q + 0.0) if row.tobytes() in known]
    if same or not len(held_out):
        raise InputError(
            f"row {same[0]} of the held-out poses is among those identified from"
            if same
            else "there are no held-out poses",
            code="A3",
            field="held_out",
            value=len(same),
            allowed="poses of their own",
            fix="split the table before identifying",
        )


def _mean_distance(model: RobotModel, table: Measurements) -> float:
    """Mean miss [m] of seen positions and distances by what is predicted."""
    return float(predict(model, table).misses.mean())


def _sentence(
    climb: bool,
    asked: float,
    geometric: Identification,
    extended: Identification,
    error: Array,
    held_out: Measurements | None,
) -> str:
    """The choice in words, with the numbers it rests on."""
    ratios = " to ".join(
        f"{found.chi_square / found.dof_effective:.2f}" for found in (geometric, extended)
    )
    evidence = f"log evidence {asked:+.1f}, chi-square per degree of freedom {ratios}"
    judged = (
        ""
        if held_out is None
        else f" on {len(held_out)} held-out poses the mean error goes from {1e3 * error[0]:.4f} mm "
        f"to {1e3 * error[1]:.4f} mm"
    )
    if climb:
        confirmed = f"; confirmed:{judged}" if judged else ""
        return f"extended: the measurements ask for joint errors ({evidence}){confirmed}"
    if asked > ASKED:
        return f"geometric: the measurements ask for joint errors ({evidence}), but{judged}"
    judged = f";{judged}" if judged else ""
    return f"geometric: the measurements do not ask for joint errors ({evidence}){judged}"
