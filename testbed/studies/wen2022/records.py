"""What the re-examination of the paper leaves behind: the sets, one record per kind of robot."""

from dataclasses import dataclass

from calib.arrays import Array, Index

ESTIMATORS = ("paper", "whitened")
"""Order of the estimators: the paper's unweighted rows, and rows whitened by their covariance.
Both move the paper's 24 numbers."""
STATEMENTS = ("distance", "point", "region", "covariance")
"""What is said at 95 %: |P| within 1.96 u of |P|; the point itself within that; the ellipsoid of
independent numbers with u_best; and, beside the paper, the ellipsoid of the whitened fit's own full
covariance."""


@dataclass(frozen=True, slots=True, eq=False)
class TrialSets:
    """One trial's kind of set in each of P pools, and what measurement noise alone makes of it."""

    trial: str
    poses: int
    designed: bool
    """Chosen by a criterion, one set per pool; or else drawn at random, anew for each robot."""
    by_paper: bool
    """Chosen as in the paper: DETMAX on an index of unweighted rows."""
    criterion: str
    indices: Index
    """(P, m) places in the pool; (P, 0) for random sets."""
    u: Array
    """(P, 2, f) predicted standard uncertainty of each number, per estimator; for random sets the
    mean over many of them [m or rad]."""
    tool_u: Array
    """(P, 2) predicted 3-D standard uncertainty of the tool point, RMS over the pool's held-out
    poses; for random sets the mean over many [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class PoolSets:
    """P pools, with the sets that are compared."""

    names: tuple[str, ...]
    """(f,) the paper's numbers."""
    pool_q: Array
    """(P, N, n) candidate joints [rad, m]."""
    test_q: Array
    """(P, t, n) held-out poses [rad, m]."""
    sets: tuple[TrialSets, ...]
    """One per trial, in the order of the scenario; then the random set of the paper's budget."""
    pose_number: Index
    """(P, 2) poses at which O1 and O2 of random sets settle; -1 where they do not."""


@dataclass(frozen=True, slots=True, eq=False)
class Reexamined:
    """R robots of one kind, each measured by the paper's protocol on one of the pools."""

    truth: str
    """Preset of the robots."""
    trials: tuple[str, ...]
    """(s,) names, as in the scenario."""
    best: tuple[str, ...]
    """(d,) those of them that were chosen as in the paper: its protocol is played with these."""
    pool: Index
    """(R,) pool of each robot."""
    before: Array
    """(R,) mean held-out error of the nominal model [m]."""
    own_before: Array
    """(s, R) mean distance to what was measured at the calibration poses, nominal model [m]."""
    own_after: Array
    """(s, R) the same for the model identified by the paper's estimator [m]."""
    error: Array
    """(s, 2, R) mean held-out error against the truth, per estimator [m]."""
    u_best: Array
    """(d, R, f) scatter of repeated calibrations on the designed set, eq. (8) [m or rad]."""
    u_r: Array
    """(R, f) the same on one random set of 50 poses."""
    u_p: Array
    """(R, f) scatter over random sets of 30, 50, ..., 150 poses."""
    u_w: Array
    """(R, f) scatter over the four regions of the pool."""
    inside: Array
    """(d, 4, R) share of held-out points inside each of `STATEMENTS`."""
    numbers_inside: Array
    """(d, R) share of the 24 numbers within 1.96 u_best of the truth."""
    distance_u: Array
    """(d, R) mean over held-out poses of the stated u of |P| [m]."""
