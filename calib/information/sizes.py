"""How large the numbers of a model are believed to be before measuring: one width for each kind.

The one place that says it: levels of ladders, joint errors that a robot has already, and the sizes
of a scenario all take their widths from here.
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
from calib.geometry.parameters import CHARACTERISTIC_LENGTH, Parameters
from calib.geometry.springs import UNSAID

MDEG = float(np.radians(1e-3))
SAG = 50 * MDEG
"""What gravity, or a torque that a drive reports, turns a joint by at its largest [rad]."""
BEARING = SAG / 2
"""The same of what it bends a joint by across its axis [rad]."""
FIRST, SECOND = 20 * MDEG, 12 * MDEG
"""One wave a turn, and two, as eccentric gears and encoders leave them [rad]."""
MAP = 3 * MDEG
"""Each wave of a joint from the third on: together they are a stationary Gaussian process on the
circle [rad]."""
GEAR = 6 * MDEG
"""A wave at a stated order of a drive [rad]."""
PLAY = 10 * MDEG
"""Half the play of a joint [rad]."""
GROWTH = 15e-6
"""How far the expansion of an arm may be from that of what its links are made of [1/K]."""
TILT = np.radians(1.0)
"""How far off what is stated an arm may be mounted, in each of two directions [rad]."""
UNSURE = 0.5
"""Part of its own size by which a moment of a link may be wrong."""
BESIDE = 0.1
"""How far from the flange something hangs that nobody told of, and the shortest reach that a link's
moments are judged by [m]."""
FRAMES = ("base.", "tool", "reflector", "anchor", "station")
"""How the names of numbers begin that belong to base, tool or fixtures."""


def usual_sizes(
    errors: JointErrors,
    kinds: Sequence[JointKind],
    *,
    waves: tuple[float, float] = (FIRST, SECOND),
    sag: float = SAG,
) -> Array:
    """Prior sd (k + s,) of the numbers of joint errors, by kind [rad, m; kg, kg m; 1/K].

    Along a slide an angle counts as far as it reaches.

    Parameters
    ----------
    errors : JointErrors
        Whose terms and springs say how large they may be in units of what is usual.
    kinds : sequence of {"revolute", "prismatic"}
        Of the n joints.
    waves, sag : float, optional
        Of one and two waves a turn, and of sag at the largest torque [rad].
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
    """The same of one joint term on a turning joint; of a torque per N m."""
    if not term.is_wave:
        return {"approach": PLAY, "torque": SAG, "lengths": GROWTH}[term.wave]
    if term.name.startswith("gravity") or np.count_nonzero(term.weights) > 1:
        return sag
    if term.name.startswith("gear"):
        return GEAR
    return waves[0] if term.order <= 1 else waves[1] if term.order <= 2 else MAP


def doubted(weight: Weight, unsaid: float = UNSAID) -> Array:
    """Prior sd (n, 4) of what is added to the moments of links that are stated, or guessed.

    As much as `unsaid` may hang on the flange though nobody says so [kg].
    """
    links = weight.chain.links
    reach = np.maximum(np.hypot(links[:, 1], links[:, 2]), BESIDE)[:, None]
    sd = UNSURE * weight.moments[:, :1] * np.hstack([np.ones_like(reach), np.tile(reach, 3) / 2])
    sd[-1] = np.hypot(sd[-1], unsaid * np.array([1, BESIDE, BESIDE, reach[-1, 0] + BESIDE]))
    return np.asarray(sd)


def weak_prior_sd(parameters: Parameters, model: RobotModel | None = None) -> Array:
    """Prior sd (f,) of the free numbers when nothing is known: 0.6 mm, 0.1 deg; 1 mm for frames.

    Reflectors, anchors and stations count as frames do.

    Parameters
    ----------
    parameters : Parameters
        Which numbers are free.
    model : RobotModel, optional
        Whose numbers they are: its joint errors say of what kind each of them is. A chain with its
        fixtures needs none.
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
