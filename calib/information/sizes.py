"""Prior standard deviations of the numbers of a model before measuring: one for each kind.

All other rooms take them from here: the levels of ladders, the joint errors that a robot has
already, and the sizes in a scenario.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.bodies import Z
from calib.geometry.chain import JointKind, chain_names
from calib.geometry.gravity import Weight
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.model import RobotModel
from calib.geometry.parameters import CHARACTERISTIC_LENGTH, Parameters, is_scale
from calib.geometry.springs import UNSAID

MDEG = float(np.radians(1e-3))
SAG = 50 * MDEG
"""Deflection of a joint about its axis at its largest gravity or reported drive torque [rad]."""
BEARING = SAG / 2
"""Deflection across the axis of a joint at its largest gravity torque [rad]."""
FIRST, SECOND = 20 * MDEG, 12 * MDEG
"""Amplitudes of one and of two waves per revolution, as eccentric gears and encoders cause them
[rad]."""
MAP = 3 * MDEG
"""Amplitude of each wave of a joint from the third on; together these waves are a stationary
Gaussian process on the circle [rad]."""
GEAR = 6 * MDEG
"""Amplitude of a wave at a stated order of a drive [rad]."""
PLAY = 10 * MDEG
"""Half the backlash of a joint [rad]."""
SCALE = 1e-4
"""Relative error of the travel of a slide: pitch of a rack, a belt or a screw, growth of a rule."""
GROWTH = 15e-6
"""Deviation of the thermal expansion of an arm from that of the material of its links [1/K]."""
TILT = np.radians(1.0)
"""Error of the stated mounting of an arm, in each of two directions [rad]."""
UNSURE = 0.5
"""Relative error of the stated or assumed mass of a link."""
BESIDE = 0.1
"""Distance of an unstated payload from the flange, and shortest length that a link's moments are
judged by [m]."""
FRAMES = ("base.", "tool", "reflector", "anchor", "station")
"""Prefixes of the names of numbers of base, tool and fixtures."""


def usual_sizes(
    errors: JointErrors,
    kinds: Sequence[JointKind],
    *,
    waves: tuple[float, float] = (FIRST, SECOND),
    sag: float = SAG,
) -> Array:
    """Prior sd (k + s,) of the numbers of joint errors, by kind [rad, m; kg, kg m; 1/K].

    For a prismatic joint an angle is multiplied by the characteristic length.

    Parameters
    ----------
    errors : JointErrors
        Terms and springs, with their own factors on the usual sd (`share`, `bearings`).
    kinds : sequence of {"revolute", "prismatic"}
        Kinds of the n joints.
    waves : pair of float
        Sd of waves with one period per revolution, and with two [rad].
    sag : float
        Sd of the deflection at the largest torque [rad].
    """
    reach = np.where([kind == "prismatic" for kind in (*kinds, "none")], CHARACTERISTIC_LENGTH, 1.0)
    terms = [t.share * _of_term(t, waves, sag) * reach[t.joint] for t in errors.terms]
    springs = errors.springs
    if springs is None:
        return np.array(terms)
    bends = sag * np.where(springs.axis == Z, 1.0, BEARING / SAG * springs.bearings)
    bends = bends * np.where(springs.is_length[: len(bends)], CHARACTERISTIC_LENGTH, 1.0)
    moments = doubted(springs.weight, springs.unsaid)[springs.free]
    return np.concatenate([terms, bends, moments, [TILT, TILT] if springs.tilts else []])


def _of_term(term: JointTerm, waves: tuple[float, float], sag: float) -> float:
    """Usual sd of one joint term on a revolute joint [rad]; of lengths [1/K]."""
    if not term.is_wave:
        return {"approach": PLAY, "torque": SAG, "lengths": GROWTH}[term.wave]
    if term.name.startswith("gravity") or np.count_nonzero(term.weights) > 1:
        return sag
    if is_scale(term.name):
        return SCALE
    if term.name.startswith("gear"):
        return GEAR
    return waves[0] if term.order <= 1 else waves[1] if term.order <= 2 else MAP


def doubted(weight: Weight, unsaid: float = UNSAID) -> Array:
    """Prior sd (n, 4) of corrections to the stated or assumed moments of links [kg, kg m].

    That of the last link allows for an unstated payload of `unsaid` [kg] at the flange.
    """
    links = weight.chain.links
    reach = np.maximum(np.hypot(links[:, 1], links[:, 2]), BESIDE)[:, None]
    sd = UNSURE * weight.moments[:, :1] * np.hstack([np.ones_like(reach), np.tile(reach, 3) / 2])
    sd[-1] = np.hypot(sd[-1], unsaid * np.array([1, BESIDE, BESIDE, reach[-1, 0] + BESIDE]))
    return np.asarray(sd)


def weak_prior_sd(parameters: Parameters, model: RobotModel | None = None) -> Array:
    """Prior sd (f,) of the free numbers when nothing is known: 0.6 mm, 0.1 deg; 1 mm for frames.

    Frames are base and tools, and also reflectors, anchors and stations. Joint errors have the sd
    of `usual_sizes`.

    Parameters
    ----------
    parameters : Parameters
        Which numbers are free.
    model : RobotModel, optional
        The model with these numbers; needed if it has joint errors, which say their kind.

    Raises
    ------
    InputError
        A3: there are joint errors, and no model.
    """
    names = parameters.names
    frame = np.array([name.startswith(FRAMES) for name in names])
    length = np.where(frame, 1e-3, 0.6e-3)
    sd = np.where(parameters.is_length, length, np.deg2rad(0.1))
    if model is not None:
        own = slice(model.chain.n_numbers, model.first_fixture)
        sd[own] = usual_sizes(model.joint_errors, model.chain.kinds)
        return np.asarray(sd[parameters.free])
    links = chain_names(sum(name.startswith("theta") for name in names))
    bare = [n for n, f in zip(names, frame, strict=True) if not f and n not in links]
    if bare:
        raise refuse(
            "model", tuple(bare), code="A3", message=f"{bare[0]} is a joint error of some kind",
            allowed="the model whose numbers these are, which says of which kind",
            fix="hand the model over as well",
        )  # fmt: skip
    return np.asarray(sd[parameters.free])
