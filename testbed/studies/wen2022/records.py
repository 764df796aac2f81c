"""Records of the re-examination of the paper: the sets, and one record per kind of robot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from calib.arrays import Array, Index
from calib.shown import Shown
from testbed.scenario.tables import BudgetSettings
from testbed.studies.many_robots import of_each_kind
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022.paper import is_length
from testbed.studies.wen2022.settings import SETS_KEY, ReexaminedSettings

if TYPE_CHECKING:
    from calib.identification.identify import Mode

PAPER_BUDGET, TOOL_POINT = "paper_budget", "tool_point"
"""Records on the one robot of the campaign."""
OURS_BEST, OURS_RANDOM = "ours best", "ours random"
"""Sources of the tool point from this campaign's budget: the paper's set, and the random side."""
ESTIMATORS: tuple["Mode", ...] = ("paper", "whitened")
"""Order of the estimators: the paper's unweighted rows, and rows whitened by their covariance.
Both move the paper's 24 numbers."""
TYPE_A = ("distance", "point")
STATEMENTS = (*TYPE_A, "unweighted", "covariance")
"""Statements at 95 %. Two are of type A, as the paper's uncertainty is: |P| within t u, with
Student's t of the repeats, and the point itself within t u of |P|. Two are not in the paper: the
ellipsoid by the full covariance of a fit, unweighted and whitened."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TrialSets(Shown):
    """One trial's kind of set in each of P pools, with its uncertainty from noise alone."""

    trial: str
    poses: int
    designed: bool
    """Whether it is chosen by a criterion, once per pool; else it is drawn anew for each robot."""
    by_paper: bool
    """Whether it is chosen as in the paper: DETMAX on an index of unweighted rows."""
    criterion: str
    indices: Index
    """(P, m) places in the pool; (P, 0) for random sets."""
    u: Annotated[Array, "P", 2, "f"]
    """(P, 2, f) predicted standard uncertainty of each number, per estimator; for random sets the
    mean over many of them [m or rad]."""
    tool_u: Annotated[Array, "P", 2]
    """(P, 2) predicted 3-D standard uncertainty of the tool point, RMS over the pool's held-out
    poses; for random sets the mean over many [m]."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoolSets(Shown):
    """P pools, with the sets that are compared."""

    names: Annotated[tuple[str, ...], "f"]
    """(f,) the paper's numbers."""
    pool_q: Annotated[Array, "P", "N", "n"]
    """(P, N, n) candidate joints [rad, m]."""
    test_q: Annotated[Array, "P", "t", "n"]
    """(P, t, n) held-out poses [rad, m]."""
    sets: tuple[TrialSets, ...]
    """One per trial, in the order of the scenario; then the random set of the paper's budget."""
    pose_number: Annotated[Index, "P", 2]
    """(P, 2) number of poses at which O1 and O2 of random sets settle; -1 if they do not."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Reexamined(Shown):
    """R robots of one kind, each measured by the paper's protocol on one of the pools."""

    truth: str
    """Preset of the robots."""
    trials: Annotated[tuple[str, ...], "s"]
    """(s,) names, as in the scenario."""
    best: Annotated[tuple[str, ...], "d"]
    """(d,) those chosen as in the paper, with which its protocol is played."""
    pool: Annotated[Index, "R"]
    """(R,) pool of each robot."""
    before: Annotated[Array, "R"]
    """(R,) mean held-out error of the nominal model [m]."""
    own_before: Annotated[Array, "s", "R"]
    """(s, R) mean distance to the readings at the calibration poses, nominal model [m]."""
    own_after: Annotated[Array, "s", "R"]
    """(s, R) the same for the model identified by the paper's estimator [m]."""
    error: Annotated[Array, "s", 2, "R"]
    """(s, 2, R) mean held-out error against the truth, per estimator [m]."""
    u_best: Annotated[Array, "d", "R", "f"]
    """(d, R, f) scatter of repeated calibrations on the designed set, eq. (8) without the u_c of
    the scenario [m or rad]."""
    u_r: Annotated[Array, "R", "f"]
    """(R, f) the same on one random set of 50 poses."""
    u_p: Annotated[Array, "R", "f"]
    """(R, f) scatter over random sets of 30, 50, ..., 150 poses."""
    u_w: Annotated[Array, "R", "f"]
    """(R, f) scatter over the four regions of the pool."""
    inside: Annotated[Array, "d", 4, "R"]
    """(d, 4, R) share of held-out points inside each of `STATEMENTS`."""
    numbers_inside: Annotated[Array, "d", "R"]
    """(d, R) share of the 24 numbers within t u_best of the truth."""
    distance_u: Annotated[Array, "d", "R"]
    """(d, R) mean over held-out poses of the stated u of |P| [m]."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PaperBudget(Shown):
    """The paper's uncertainties per parameter: contributors and their combination [m, rad].

    Each designed trial is compared with the same random side.
    """

    names: Annotated[tuple[str, ...], "f"]
    """(f,) parameter names."""
    trials: Annotated[tuple[str, ...], "d"]
    """(d,) designed trials, the one that stands for the paper's set first (`designed_trials`)."""
    best_repeatability: Annotated[Array, "d", "f"]
    """(d, f) u_r of each designed set: standard deviation (n - 1) of its v repeated estimates by
    the paper's estimator, `Estimate.repeated`."""
    repeatability: Annotated[Array, "f"]
    """(f,) u_r of one random set ([budget] poses), v repeats."""
    pose_number: Annotated[Array, "f"]
    """(f,) u_p over sets of several sizes ([budget] pose_numbers)."""
    location: Annotated[Array, "f"]
    """(f,) u_w over four regions."""
    environment: Annotated[Array, "f"]
    """(f,) u_c by the scenario; zero in the paper."""
    best: Annotated[Array, "d", "f"]
    """(d, f) u_best = RSS(u_r, u_c), eq. (8)."""
    random: Annotated[Array, "f"]
    """(f,) u_rand = RSS(u_r, u_c, u_p, u_w), eq. (9)."""

    @property
    def ratio(self) -> Array:
        """(d,) mean over the numbers of u_best / u_rand, as the last row of Table 3."""
        return np.asarray((self.best / self.random).mean(axis=1))

    @property
    def repeats_ratio(self) -> Array:
        """(d,) mean over the numbers of u_r of the designed set / u_r of the random one."""
        return np.asarray((self.best_repeatability / self.repeatability).mean(axis=1))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ToolPointStudy(Shown):
    """Monte Carlo of the tool point: zero pose first, then the held-out poses.

    The paper's form draws independent parameters and evaluates |P|; the correct form draws from the
    full covariance and evaluates all three directions.
    """

    source: Annotated[tuple[str, ...], "s"]
    """(s,) source of the uncertainties: "table 3 best", "table 3 random", "ours best" (the set that
    stands for the paper's), "ours random", then "ours, NAME" for the other designed trials."""
    distance_sd: Annotated[Array, "s", "1 + t"]
    """(s, 1 + t) sd of |P|, paper form [m]."""
    distance_range: Annotated[Array, "s", 2]
    """(s, 2) smallest and largest of |P| minus its mean at the zero pose [m]."""
    spread: Annotated[Array, "s", "1 + t", 3]
    """(s, 1 + t, 3) sd of x, y, z with the same independent draws [m]."""
    trials: Annotated[tuple[str, ...], "d"]
    """(d,) trials whose full covariance (default estimator) the correct form uses: the designed
    ones, that of "ours best" first; the first trial if none is designed."""
    covariance: Annotated[Array, "d", "1 + t", 3, 3]
    """(d, 1 + t, 3, 3) Monte Carlo covariance of the tool point, correct form [m^2]."""
    linear: Annotated[Array, "d", "1 + t", 3, 3]
    """(d, 1 + t, 3, 3) closed form J C J' [m^2]."""
    draws: int

    @property
    def spatial(self) -> Array:
        """(s, 1 + t) standard uncertainty in all three directions, independent draws [m]."""
        return np.asarray(np.sqrt((self.spread**2).sum(axis=-1)))


def environment(budget: BudgetSettings, names: Sequence[str]) -> Array:
    """u_c (f,) of the numbers called `names` [m or rad]."""
    length, angle = budget.environment_mm / 1e3, np.radians(budget.environment_deg)
    return np.array([length if is_length(name) else angle for name in names])


def paper_budget_of(campaign: Campaign) -> PaperBudget | None:
    """The paper's uncertainties per parameter; None if not played."""
    return campaign.records.find(PAPER_BUDGET, PaperBudget)


def tool_point_of(campaign: Campaign) -> ToolPointStudy | None:
    """Monte Carlo of the tool point; None if not played."""
    return campaign.records.find(TOOL_POINT, ToolPointStudy)


def pool_sets_of(campaign: Campaign) -> PoolSets | None:
    """Pools and sets of the re-examination of the paper; None if not played."""
    return campaign.records.find(SETS_KEY, PoolSets)


def reexamined_of(campaign: Campaign) -> tuple[Reexamined, ...]:
    """One record per kind of robot, in the order of the scenario; none if the study is off."""
    return of_each_kind(campaign.records, campaign.scenario.table(ReexaminedSettings), Reexamined)
