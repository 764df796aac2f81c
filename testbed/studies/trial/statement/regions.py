"""Statements on the tool point of one calibration, and the coverage that correct ones have."""

from dataclasses import replace
from functools import partial

import numpy as np

from calib.arrays import Array
from calib.geometry.jacobian import reflector_rows
from calib.geometry.operating import OperatingConditions
from calib.identification.identify import Identification
from calib.uncertainty.covariance import correlated_draws
from calib.uncertainty.discrepancy import Discrepancy
from calib.uncertainty.judgement import Judgement
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.stated_point import common_radius
from calib.uncertainty.tool_point import ToolStatement, tool_statement

HONEST_DRAWS, HONEST = 1000, 0.999
"""Robots drawn according to the region; share of them above the limit that one has to reach."""


def tool_regions(
    whole: Identification,
    judgement: Judgement,
    systematic: Array,
    q: Array,
    target: Array,
    repeatability: Array,
    at: OperatingConditions,
) -> dict[str, ToolStatement]:
    """Regions of the tool point at postures q (N, n): the believed one first, then the others.

    Parameters
    ----------
    whole : Identification
        Result of the identification; its covariance includes the systematic part.
    judgement : Judgement
        Judgement, with or without a belief, a bootstrap and a discrepancy.
    systematic : (f, f) array
        Covariance of the estimate by the tracker's systematic errors [m, rad].
    q : (N, n) array
        Postures [rad, m].
    target : (3,) array
        The point on the tool [m].
    repeatability : (n,) array
        Standard deviation of each joint's repeatability [rad, m].
    at : OperatingConditions
        Conditions of the robot there.
    """
    found: dict[str, ToolStatement] = {}
    if judgement.belief is not None:
        regions = partial(judgement.belief.regions, q, target=target, at=at)
        found["region"] = regions()
        if repeatability.any():
            found["move"] = regions(repeatability=repeatability)
    made: dict[str, tuple[Identification, Discrepancy | None]] = {"parameters": (whole, None)}
    if judgement.bootstrap is not None:
        played = judgement.bootstrap.empirical + systematic
        made["bootstrap"] = (replace(whole, covariance=played), None)
    if judgement.discrepancy is not None:
        made["discrepancy"] = (whole, judgement.discrepancy)
    for name, (one, discrepancy) in made.items():
        found[name] = tool_statement(
            one.model, q, one.full_covariance, target=target, discrepancy=discrepancy, at=at
        )
    return found


def radii(regions: dict[str, ToolStatement], judgement: Judgement) -> dict[str, float]:
    """R95 of each region: the radius that contains the point at a pose like theirs [m]."""
    point = judgement.point
    known = {} if point is None else {"region": point.radius_mean, "move": point.radius_move}
    return {
        name: known[name] if name in known else common_radius(region)
        for name, region in regions.items()
    }


def honest_share(
    belief: Belief, q: Array, target: Array, at: OperatingConditions, rng: np.random.Generator
) -> float:
    """Share of postures q (N, n) inside a correct region that a part `HONEST` of robots reaches.

    Postures of one robot share its parameter error, so that one robot may be far below 95 %.

    References
    ----------
    Monte Carlo: errors J dx + d, dx ~ N(0, C + sigma_U^2 F D F'), d ~ N(0, sigma_U^2 D) anew at
    each posture, in the region of the same covariance.
    """
    T, J = belief.model.poses_and_jacobian(q, at)
    _, rows = reflector_rows(T, J, np.broadcast_to(target, (len(T), 3)))
    size, region = belief.misfit.upper, belief.regions(q, target=target, growth=1.0, at=at)
    whole = belief.covariance + size**2 * belief.misfit_covariance
    step = correlated_draws(whole, HONEST_DRAWS, rng)
    own = size * belief.misfit.shape.rows(rows)
    anew = rng.standard_normal((len(q), own.shape[2], len(step)))
    root = np.linalg.cholesky(region.covariance)
    error = np.linalg.solve(root, rows) @ step.T + np.linalg.solve(root, own) @ anew
    # (N, 3, draws)
    share = ((error**2).sum(axis=1) <= region.factor**2).mean(axis=0)
    return float(np.quantile(share, 1 - HONEST))
