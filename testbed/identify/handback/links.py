"""The weak prior on links: which fits need it, and why.

What the measurements do not determine would run away, or stay nominal as if that were known: a
prior of the width of a tolerance holds it, and says how wide it is.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification, Status
from calib.identification.link_widths import USUAL, LinkWidths
from calib.identification.prior import Prior
from calib.information.rank import PRACTICAL_RATIO
from calib.information.reduction import reduce
from calib.measurement import tables
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize
from calib.uncertainty.statement.gain import prior_precision
from testbed.files.session import Session
from testbed.identify.outliers import Looking
from testbed.robots.robot import Robot
from testbed.robots.tolerances import usual_tolerances
from testbed.units import in_units, listed, significant, unit_of

FULL_POSE = (1e-5, 1e-4)
"""Standard deviations of readings that tell apart all that a pose can tell [m, rad]."""


@dataclass(frozen=True, slots=True)
class LinkBelief:
    """What is believed of the links before measuring."""

    sd: Array
    """(n, 5) standard deviations about nominal [rad, m, m, rad, rad]."""
    prior: Prior | None
    """The same of those that are free; None where none is."""
    why: str
    """Why a geometric fit needs it; empty where the measurements hold all links by themselves."""
    widths: LinkWidths = USUAL
    """How much wider than usual the widths are, where nobody states any."""


def link_belief(
    robot: Robot,
    session: Session,
    looking: Looking,
    train: Measurements,
    plain: Identification,
    scatter: Array,
    factor: float,
) -> LinkBelief:
    """What is believed of a robot's links, and whether its fit needs it.

    Parameters
    ----------
    robot, session : Robot, Session
        The session's prior, else the robot's tolerances, else the usual ones; these are widened
        where the measurements leave little doubt that the links lie further from nominal.
    looking : Looking
        Where the fits begin, what is free, and the joint errors on offer.
    train : Measurements
        What is identified from.
    plain : Identification
        Of `train` without any prior.
    scatter : (f, f) array
        Its covariance from how its residuals scatter from pose to pose.
    factor : float
        How many times the stated noise they have.
    """
    start, parameters = looking.frames.start, looking.frames.parameters
    n, widths = start.chain.n_joints, USUAL
    sd = usual_tolerances(n) if robot.tolerances is None else robot.tolerances
    sd = sd if session.link_sd is None else session.link_sd
    prior = link_prior(parameters, sd)
    if prior is None:
        return LinkBelief(sd, None, "")
    if robot.tolerances is None and session.link_sd is None:
        widths = looking.widths(train, prior.names)
        sd = sd * np.array([widths.angle, *[widths.length] * 2, *[widths.angle] * 2])
        prior = link_prior(parameters, sd) or prior
    if session.link_sd is not None:
        return LinkBelief(sd, prior, "the session states it")
    if plain.status is not Status.CONVERGED and (away := farthest(plain, sd)):
        why = f"without it the fit does not converge, and {away}"
        return LinkBelief(sd, prior, why, widths)
    lacking = _lost(plain, start, train, parameters, prior) or _poor(
        plain, prior, (max(1.0, factor) ** 2 * plain.covariance, scatter)
    )
    if session.in_use is not None and not lacking:
        lacking = "another tool will be used, whose position depends on the links"
    return LinkBelief(sd, prior, lacking, widths)


def link_prior(parameters: Parameters, sd: Array) -> Prior | None:
    """The prior of widths sd (n, 5) on the links' numbers that are free; None where none is."""
    sizes = dict(zip(parameters.names[6 : 6 + sd.size], sd.ravel().tolist(), strict=True))
    free = tuple(name for name in parameters.free_names if name in sizes)
    widths = np.array([sizes[name] for name in free])
    return Prior(np.zeros(len(free)), widths, free) if free else None


def farthest(fit: Identification, sd: Array) -> str:
    """Which link's number went furthest from nominal, for its width (n, 5); empty without one."""
    widths = dict(zip(fit.parameters.names[6 : 6 + sd.size], sd.ravel().tolist(), strict=True))
    kept = [k for k, name in enumerate(fit.names) if name in widths]
    if not kept:
        return ""
    worst = max(kept, key=lambda k: abs(fit.step[k]) / widths[fit.names[k]])
    length = fit.parameters.is_length[fit.parameters.free_index]
    value = float(in_units(fit.step, length)[worst])
    return (
        f"{fit.names[worst]} runs away to {significant(abs(value), 2)} "
        f"{unit_of(bool(length[worst]))} from nominal"
    )


def _lost(
    plain: Identification,
    start: RobotModel,
    train: Measurements,
    parameters: Parameters,
    prior: Prior,
) -> str:
    """Links' numbers that full poses at the same joints would tell and these rows do not."""
    if train.is_pose.all():
        return ""
    q = np.unique(train.q, axis=0)
    poses = tables.poses(q, start.poses(q), sd=FULL_POSE)
    free = parameters.freeing(
        name for name in parameters.free_names
        if parameters.names.index(name) < start.first_fixture
    )  # fmt: skip
    A = linearize(start, poses).A[:, free.free_index] * free.free_scale
    told = reduce(A, free, model=start).kept
    seen = set(plain.reduction.kept)
    lost = [name for name in told if name in prior.names and name not in seen]
    if not lost:
        return ""
    return f"these readings do not determine {listed(lost)}, which full poses at these joints would"


def _poor(plain: Identification, prior: Prior, spreads: tuple[Array, Array]) -> str:
    """The direction of links that is known worse than half its width, if there is one.

    By two covariances of the estimate: from the size of the residuals, and from their scatter.
    """
    widths = dict(zip(prior.names, prior.sd, strict=True))
    kept = [k for k, name in enumerate(plain.names) if name in widths]
    if not kept:
        return ""
    scale = np.array([widths[plain.names[k]] for k in kept])
    found = [np.linalg.eigh(C[np.ix_(kept, kept)] / np.outer(scale, scale)) for C in spreads]
    k = int(np.argmax([size[-1] for size, _ in found]))
    size, turn = found[k]
    if size[-1] <= PRACTICAL_RATIO**2:
        return ""
    worst = kept[int(np.argmax(np.abs(turn[:, -1])))]
    length = plain.parameters.is_length[plain.parameters.free_index]
    u = float(in_units(np.sqrt(np.diag(spreads[k])), length)[worst])
    return (
        f"without it, {plain.names[worst]} is known no better than U = {significant(2 * u, 2)} "
        f"{unit_of(bool(length[worst]))}"
    )


def prior_share(result: Identification, train: Measurements, n: int) -> Array:
    """Part (12 + 5 n + k,) of the variance of base, links, tool and k joint terms from any prior.

    One where it was not estimated: then nothing but its nominal value is known.

    References
    ----------
    C = inv(H), H = A'A + Lambda0: C A'A C comes from the readings, C Lambda0 C from the prior.
    """
    names = result.parameters.names[: 12 + 5 * n + len(result.model.joint_errors.names)]
    if result.prior is None:
        return frozen([float(name not in result.names) for name in names])
    believed = prior_precision(result)
    stack = linearize(result.model, train)
    weight = np.sqrt(result.weights[stack.row_of])[:, None]
    A = stack.A[:, result.parameters.free_index] * result.parameters.free_scale * weight
    C = np.linalg.solve(A.T @ A + believed, np.eye(len(believed)))
    own = dict(zip(result.names, np.diag(C @ believed @ C) / np.diag(C), strict=True))
    return frozen([own.get(name, 1.0) for name in names])
