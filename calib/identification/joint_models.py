"""The extended model: geometry with gravity terms and with harmonics of every revolute joint."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.chain import Chain, after_links
from calib.geometry.felt_springs import Felt, postures
from calib.geometry.gravity import weight_of
from calib.geometry.joint_errors import JointErrors, JointTerm, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.result import Identification

UPRIGHT = np.radians(1.0)
"""An arm this close to upright counts as upright [rad]."""


def extended_model(nominal: RobotModel, mounted: Chain | None = None) -> RobotModel:
    """The model with gravity terms and harmonics added, all of them zero.

    Gravity has three terms where the closed form holds, which makes 27 in all for a six-axis arm;
    for other arms it has a spring in each joint that gravity loads, with assumed masses. Harmonics
    are sin q, cos q, sin 2q and cos 2q of every revolute joint. Terms of `nominal` are kept.

    One wave of q2 is both sag and harmonic: identify with a prior, and read the sum of the two.

    Parameters
    ----------
    nominal : RobotModel
        Model that the terms are added to.
    mounted : Chain, optional
        The arm in a world whose z axis points up, if the world of `nominal` is another one: the
        frame of a tracker need not be level, nor its target on the axis of the forearm.

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
    springs = None
    if quarters is not None:
        wanted = [*gravity_terms(chain.n_joints, quarters), *wanted]
    elif known.springs is None:
        springs, _ = Felt.of(weight_of(chain, mounted), postures(chain)).springs(("z",))
    held = set(known.names)
    added = tuple(term for term in wanted if term.name not in held)
    sag = springs if springs is not None and len(springs.load) else None
    return replace(nominal, joint_errors=known.joined(JointErrors(added, springs=sag)))


def extended_parameters(
    nominal: RobotModel, extended: RobotModel, parameters: Parameters
) -> Parameters:
    """Parameter table of the extended model: free as in `parameters`, and so are all added terms.

    Raises
    ------
    InputError
        A3: the extended model has no term that the nominal one lacks.
    """
    added = len(extended.names) - len(nominal.names)
    if not added:
        raise refuse(
            "nominal", nominal.joint_errors.names, code="A3",
            message="there is no joint term to add to this model",
            allowed="a model with a revolute joint whose harmonics are not in it yet",
            fix="identify the model as it is",
        )  # fmt: skip
    # scaled like the lengths and the angles of the base
    place = {name: k for k, name in enumerate(parameters.names)}
    like = [
        place.get(name, 0 if is_length else 3)
        for name, is_length in zip(extended.names, extended.is_length, strict=True)
    ]
    return Parameters(
        extended.names,
        np.array(extended.is_length),
        np.array([name not in place or parameters.free[place[name]] for name in extended.names]),
        parameters.scale[like],
    )


def with_joint_terms(
    nominal: RobotModel, parameters: Parameters, mounted: Chain | None = None
) -> tuple[RobotModel, Parameters, Parameters]:
    """Extended model, its parameter table, and a table with only the added terms free."""
    wide = extended_model(nominal, mounted)
    table = extended_parameters(nominal, wide, parameters)
    # by name: the added terms stand before the fixtures
    return wide, table, table.freeing(set(wide.names) - set(nominal.names))


def gravity_is_closed(chain: Chain) -> bool:
    """Whether the closed form of gravity holds for joints 2 and 3; see `gravity_quarters`."""
    return gravity_quarters(chain) is not None


def gravity_quarters(chain: Chain) -> tuple[int, int] | None:
    """Quarter turns from upright, about axis 2, of upper arm and forearm at zero joint values.

    None unless the gravity torques of joints 2 and 3 are waves of q2 and q2 + q3: axis 1 has to be
    vertical (world z up) or prismatic, axes 2 and 3 horizontal and parallel, and both parts of the
    arm vertical or horizontal at zero. The forearm ends at axis 4 if that is parallel too, else at
    the tool.

    Examples
    --------
    >>> ur10 = [[0, 0.13, 0, np.pi / 2, 0], [0, 0, -0.6, 0, 0], [0, 0, -0.6, 0, 0]]
    >>> gravity_quarters(Chain(ur10))
    (1, 1)
    """
    if chain.n_joints < 3 or "prismatic" in chain.kinds[1:3]:
        return None
    near = np.cos(UPRIGHT)
    still = np.zeros((1, chain.n_joints))
    frames = [np.column_stack(parts) for parts in after_links(chain, still)]
    (axis, second), (of_third, third), (of_fourth, fourth) = (T[:, 2:].T for T in frames[1:4])
    tip = frames[-1] @ chain.T_flange_tool[:, 3]
    if chain.kinds[0] == "revolute" and abs(chain.T_world_base[2, 2]) < near:
        return None
    # opposite axes are out as well: the forearm would lean by q2 - q3
    if abs(axis[2]) > np.sin(UPRIGHT) or axis @ of_third < near:
        return None
    parallel = chain.n_joints > 3 and abs(axis @ of_fourth) >= near
    end = fourth if parallel else tip
    of_parts = []
    for arm in (third - second, end - third):
        up, ahead = arm[2], axis[1] * arm[0] - axis[0] * arm[1]  # the part that gravity turns
        quarters = round(np.arctan2(ahead, up) / (np.pi / 2))
        along = up * np.cos(quarters * np.pi / 2) + ahead * np.sin(quarters * np.pi / 2)
        if not 0 < near * np.hypot(up, ahead) <= along:
            return None
        of_parts.append(quarters % 4)
    return of_parts[0], of_parts[1]


def shared_waves(result: Identification) -> tuple[str, ...]:
    """One sentence for each wave that several terms of the model share: only their sum is known."""
    errors, names = result.model.joint_errors, result.names
    alike: dict[tuple[object, ...], list[JointTerm]] = {}
    for term in errors.terms:
        if term.name in names:
            alike.setdefault((term.joint, term.wave, term.weights), []).append(term)
    sentences = []
    for terms in alike.values():
        if len(terms) < 2:
            continue
        value = sum(errors.coefficients[errors.names.index(term.name)] for term in terms)
        places = [names.index(term.name) for term in terms]
        sd = np.sqrt(result.covariance[np.ix_(places, places)].sum())
        sentences.append(
            f"{' and '.join(term.name for term in terms)} are the same wave: only their sum is "
            f"known from the measurements, {1e3 * np.degrees(value):.1f} mdeg with a standard "
            f"uncertainty of {1e3 * np.degrees(sd):.1f} mdeg"
        )
    return tuple(sentences)


def against_gravity(
    errors: JointErrors, names: Sequence[str], covariance: Array
) -> tuple[str, ...]:
    """A sentence where springs bend against their load by more than two standard uncertainties.

    Parameters
    ----------
    errors : JointErrors
        Identified joint errors.
    names : sequence of str
        Names of the f numbers that were estimated.
    covariance : (f, f) array
        Covariance of these.
    """
    springs = errors.springs
    if springs is None:
        return ()
    p, told = len(springs.load), []
    sd = dict(zip(names, np.sqrt(np.diag(covariance)), strict=True))
    for name, bend, load, length in zip(
        springs.names[:p], errors.of_springs, springs.load, springs.is_length, strict=False
    ):
        if name in sd and bend < -2 * sd[name]:
            unit, scale = ("um", 1e6) if length else ("mdeg", 1e3 * float(np.degrees(1.0)))
            told.append(
                f"{name} by {-scale * bend:.1f} {unit} (U = {2 * scale * sd[name]:.1f}) at "
                f"{load:.3g} {'N' if length else 'N m'}"
            )
    if not told:
        return ()
    return (
        f"bends against gravity: {', '.join(told)}; a joint gives way to its load, so that gravity "
        "points elsewhere than stated, or the term stands for something else",
    )
