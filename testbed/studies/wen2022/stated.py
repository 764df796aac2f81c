"""How often 95 % statements contain the truth: the paper's, of type A, and covariances of fits.

The paper states the scatter of repeated calibrations (type A), as an uncertainty of the distance of
the tool point to the base. The covariance of its unweighted fit, s^2 inv(J'WJ) with s^2 = RSS /
(12 m - f), is not in the paper: it is judged in addition, and never instead.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool
from calib.identification.identify import Identification
from calib.information.propagation import distance_uncertainty, tool_covariance
from calib.uncertainty.regions import inside, student_factor
from calib.uncertainty.type_a import root_sum_square
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.wen2022.records import environment


def held_by_type_a(
    found: Identification, u: Array, count: int, q: Array, true: Array, origin: Array
) -> tuple[Bool, Array, float]:
    """Whether each of the statements "distance" and "point" holds, u of |P|, and its factor t.

    Student's t has the degrees of freedom of the repeats, from which all u are computed. The
    effective ones of JCGM 100:2008, G.4.1, would be more, but need independent estimates of u.

    Parameters
    ----------
    found : Identification
        Result of the paper's estimator.
    u : (f,) array
        u_best: scatter of repeats with u_c, taken as independent, as in the paper [m or rad].
    count : int
        Number of repeats.
    q, true : (t, n), (t, 3) arrays
        Held-out poses, and the true, noise-free tool points there [rad, m; m].
    origin : (3,) array
        Point from which distances are taken [m].

    Returns
    -------
    (2, t) bool, (t,) standard uncertainty of the distance [m], and Student's factor. Propagation is
    linear, which claim 17 shows to be enough.
    """
    T, J = found.model.poses_and_jacobian(q)
    point, columns = T[:, :3, 3], J[:, :3, found.parameters.free]
    sigma = (columns * u**2) @ np.swapaxes(columns, 1, 2)
    u_distance, error = distance_uncertainty(sigma, point - origin), true - point
    factor = float(student_factor(count - 1))
    radial = np.linalg.norm(true - origin, axis=1) - np.linalg.norm(point - origin, axis=1)
    off = np.array([np.abs(radial), np.linalg.norm(error, axis=1)])
    return off <= factor * u_distance, u_distance, factor


def held_by_covariance(found: Identification, q: Array, true: Array) -> Bool:
    """Whether the 95 % region from the fit's own full covariance holds each true point (t,)."""
    sigma = tool_covariance(found.model, q, found.full_covariance)[:, :3, :3]
    return inside(true - found.model.poses(q)[:, :3, 3], sigma)


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Shares of held-out poses at which the statements of one set contain the truth."""

    trial: str
    distance_u: float
    """Mean stated u of |P|, type A [m]."""
    factor: float
    """Student's t of the repeats."""
    type_a: tuple[float, ...]
    """Shares with |P| within t u, and with the point within t u (`TYPE_A`)."""
    numbers: float
    """Share of the numbers within t u_best of the truth, type A."""
    unweighted: float
    """Share with the point in the region by the unweighted fit's covariance; not in the paper."""
    unweighted_numbers: float
    """Share of the numbers in its intervals."""
    replications: int
    """Replications behind the last two figures; 0 for this one calibration."""
    error: float
    """Mean held-out position error [m]."""


def judged_statements(campaign: Campaign, trial: Trial) -> Judged | None:
    """Judge the paper's statements on one set, and those of its unweighted fit.

    None if the paper's estimator was not played.
    """
    estimate = next((one for one in trial.estimates if one.mode == "paper"), None)
    if estimate is None:
        return None
    found, seen, runs = estimate.identification, estimate.comparison, estimate.replications
    setting = campaign.setting
    u = root_sum_square(estimate.type_a, environment(campaign.scenario.budget, found.names))
    origin, true = setting.nominal.chain.T_world_base[:3, 3], setting.test_true[:, :3, 3]
    count, q = len(estimate.repeated), setting.test_q
    held, u_distance, factor = held_by_type_a(found, u, count, q, true, origin)
    off = np.abs(found.step - seen.true_step)
    # poses of one calibration share its error; replications give the average share in a region
    points, numbers = (
        (seen.inside, seen.parameter_inside)
        if runs is None
        else (runs.tool_coverage, runs.parameter_coverage)
    )
    return Judged(
        trial=trial.name,
        distance_u=float(u_distance.mean()),
        factor=factor,
        type_a=tuple(map(float, held.mean(axis=1))),
        numbers=float((off <= factor * u).mean()),
        unweighted=float(np.mean(points)),
        unweighted_numbers=float(np.mean(numbers)),
        replications=0 if runs is None else runs.count,
        error=seen.accuracy_after.mean,
    )
