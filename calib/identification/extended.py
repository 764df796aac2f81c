"""The extended model: a chain with the joint errors that most arms have beyond their geometry."""

import numpy as np

from calib.errors import InputError
from calib.geometry.chain import Chain, forward
from calib.geometry.joint_errors import JointErrors, JointTerm, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.result import Identification

UPRIGHT = np.radians(1.0)
"""An arm this close to upright counts as upright [rad]."""


def extended_model(nominal: RobotModel) -> RobotModel:
    """The model with gravity and harmonic terms added, all of them zero: same poses as before.

    Three gravity terms where their closed form holds, and sin q, cos q, sin 2q, cos 2q for every
    revolute joint: 27 terms on a six-axis arm. Terms that `nominal` has already are kept.

    sin q2 stands twice, as sag and as harmonic: identify under a prior, and read their sum.

    Examples
    --------
    >>> arm = RobotModel(Chain([[0, 0.3, 0.1, 0, 0]]))
    >>> extended_model(arm).joint_errors.names
    ('harmonic1.sin1', 'harmonic1.cos1', 'harmonic1.sin2', 'harmonic1.cos2')
    """
    chain, known = nominal.chain, nominal.joint_errors
    turning = [kind == "revolute" for kind in chain.kinds]
    wanted = [term for term in harmonic_terms(chain.n_joints) if turning[term.joint]]
    if gravity_is_closed(chain):
        wanted = [*gravity_terms(chain.n_joints), *wanted]
    added = tuple(term for term in wanted if term.name not in known.names)
    return RobotModel(
        chain,
        JointErrors(
            (*known.terms, *added), np.concatenate([known.coefficients, np.zeros(len(added))])
        ),
    )


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
    return Parameters(
        extended.names,
        np.concatenate([parameters.is_length, extended.is_length[-added:]]),
        np.concatenate([parameters.free, np.ones(added, dtype=bool)]),
        # the terms are angles, scaled like those of the base
        np.concatenate([parameters.scale, np.full(added, parameters.scale[3])]),
    )


def gravity_is_closed(chain: Chain) -> bool:
    """Whether sin q2 and sin(q2 + q3) are the torques of gravity on joints 2 and 3.

    So where these turn about level parallel axes, world z up, and the arm stands upright at joint
    zero.
    """
    if chain.n_joints < 3 or "prismatic" in chain.kinds[1:3]:
        return False
    second, third, tip = (
        forward(Chain(chain.links[:k], chain.kinds[:k], chain.T_world_base), np.zeros((1, k)))[0]
        for k in (1, 2, chain.n_joints)
    )
    tip = tip @ chain.T_flange_tool
    axis = second[:3, 2]
    # opposite axes are out as well: the forearm would lean by q2 - q3
    upright = axis @ third[:3, 2] >= np.cos(UPRIGHT)
    for arm in (third[:3, 3] - second[:3, 3], tip[:3, 3] - third[:3, 3]):
        # the part that gravity turns; where it stands upright, the axis is level
        across = arm - axis * (axis @ arm)
        upright = upright and 0 < np.cos(UPRIGHT) * np.linalg.norm(across) <= across[2]
    return bool(upright)


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
