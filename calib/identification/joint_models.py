"""Geometry alone, or joint errors as well: the two models, and the choice by evidence."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
from calib.geometry.chain import Chain, forward
from calib.geometry.joint_errors import JointErrors, JointTerm, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.identify import identify
from calib.identification.prior import Prior, weak_prior
from calib.identification.result import Identification
from calib.identification.robust import Loss
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict

UPRIGHT = np.radians(1.0)
"""An arm this close to upright counts as upright [rad]."""


def extended_model(nominal: RobotModel, mounted: Chain | None = None) -> RobotModel:
    """The model with gravity and harmonic terms added, all of them zero: same poses as before.

    Three gravity terms where their closed form holds, and sin q, cos q, sin 2q, cos 2q for every
    revolute joint: 27 terms on a six-axis arm. Terms that `nominal` has already are kept.

    One wave of q2 stands twice, as sag and as harmonic: identify under a prior, and read their sum.

    Parameters
    ----------
    nominal : RobotModel
        What the terms are added to.
    mounted : Chain, optional
        The arm as it stands, with world z up, where `nominal` is not in such a world: a tracker's
        own frame need not be level, nor its target on the axis of the forearm.

    Examples
    --------
    >>> arm = RobotModel(Chain([[0, 0.3, 0.1, 0, 0]]))
    >>> extended_model(arm).joint_errors.names
    ('harmonic1.sin1', 'harmonic1.cos1', 'harmonic1.sin2', 'harmonic1.cos2')
    """
    chain, known = nominal.chain, nominal.joint_errors
    turning = [kind == "revolute" for kind in chain.kinds]
    wanted = [term for term in harmonic_terms(chain.n_joints) if turning[term.joint]]
    quarters = gravity_quarters(chain if mounted is None else mounted)
    if quarters is not None:
        wanted = [*gravity_terms(chain.n_joints, quarters), *wanted]
    added = tuple(term for term in wanted if term.name not in known.names)
    coefficients = np.concatenate([known.coefficients, np.zeros(len(added))])
    return replace(nominal, joint_errors=JointErrors((*known.terms, *added), coefficients))


def extended_parameters(
    nominal: RobotModel, extended: RobotModel, parameters: Parameters
) -> Parameters:
    """Parameter table of the extended model: what is free in `parameters`, and all added terms.

    Raises
    ------
    InputError
        If the extended model has no term that the nominal one lacks.
    """
    added = len(extended.names) - len(nominal.names)
    if not added:
        raise InputError(
            "there is no joint term to add to this model",
            code="A3",
            field="nominal",
            value=nominal.joint_errors.names,
            allowed="a model with a revolute joint whose harmonics are not in it yet",
            fix="identify the model as it is",
        )
    # the terms stand before the fixtures; they are angles, scaled like those of the base
    k = nominal.first_fixture
    return Parameters(
        extended.names,
        np.array(extended.is_length),
        np.insert(parameters.free, k, np.ones(added, dtype=bool)),
        np.insert(parameters.scale, k, np.full(added, parameters.scale[3])),
    )


def gravity_is_closed(chain: Chain) -> bool:
    """Whether the closed form of gravity holds for joints 2 and 3; see `gravity_quarters`."""
    return gravity_quarters(chain) is not None


def gravity_quarters(chain: Chain) -> tuple[int, int] | None:
    """Quarter turns from upright, about axis 2, at which upper arm and forearm lie at joint zero.

    None where waves of q2 and q2 + q3 are not the torques of gravity on joints 2 and 3. They are
    where axis 1 is upright, world z up, or slides, axes 2 and 3 are level and parallel, and both
    parts of the arm stand upright or lie level at zero. The forearm ends where axis 4 begins if
    that is parallel too, else at the tool.

    Examples
    --------
    >>> ur10 = [[0, 0.13, 0, np.pi / 2, 0], [0, 0, -0.6, 0, 0], [0, 0, -0.6, 0, 0]]
    >>> gravity_quarters(Chain(ur10))
    (1, 1)
    """
    if chain.n_joints < 3 or "prismatic" in chain.kinds[1:3]:
        return None
    near = np.cos(UPRIGHT)
    second, third, fourth, tip = (
        forward(Chain(chain.links[:k], chain.kinds[:k], chain.T_world_base), np.zeros((1, k)))[0]
        for k in (1, 2, 3, chain.n_joints)
    )
    tip = tip @ chain.T_flange_tool
    axis = second[:3, 2]
    if chain.kinds[0] == "revolute" and abs(chain.T_world_base[2, 2]) < near:
        return None
    # opposite axes are out as well: the forearm would lean by q2 - q3
    if abs(axis[2]) > np.sin(UPRIGHT) or axis @ third[:3, 2] < near:
        return None
    parallel = chain.n_joints > 3 and abs(axis @ fourth[:3, 2]) >= near
    end = fourth if parallel else tip
    found = []
    for arm in (third[:3, 3] - second[:3, 3], end[:3, 3] - third[:3, 3]):
        up, ahead = arm[2], np.cross(axis, [0.0, 0.0, 1.0]) @ arm  # the part that gravity turns
        quarters = round(np.arctan2(ahead, up) / (np.pi / 2))
        along = up * np.cos(quarters * np.pi / 2) + ahead * np.sin(quarters * np.pi / 2)
        if not 0 < near * np.hypot(up, ahead) <= along:
            return None
        found.append(quarters % 4)
    return found[0], found[1]


def shared_waves(found: Identification) -> tuple[str, ...]:
    """One sentence for each wave that stands in the model more than once: only its sum is known."""
    errors, names = found.model.joint_errors, found.names
    alike: dict[tuple[object, ...], list[JointTerm]] = {}
    for term in errors.terms:
        if term.name in names:
            alike.setdefault((term.joint, term.wave, term.weights), []).append(term)
    said = []
    for terms in alike.values():
        if len(terms) < 2:
            continue
        value = sum(errors.coefficients[errors.names.index(term.name)] for term in terms)
        places = [names.index(term.name) for term in terms]
        sd = np.sqrt(found.covariance[np.ix_(places, places)].sum())
        said.append(
            f"{' and '.join(term.name for term in terms)} are the same wave: only their sum is "
            f"known from the measurements, {1e3 * np.degrees(value):.1f} mdeg with a standard "
            f"uncertainty of {1e3 * np.degrees(sd):.1f} mdeg"
        )
    return tuple(said)


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
