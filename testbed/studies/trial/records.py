"""What a campaign leaves behind: frozen records, each kept in its own file; nothing is computed.

Everything that knows the truth says so in its name or docstring; planning and identification never
see these fields.
"""

from dataclasses import dataclass

from calib.arrays import Array, Bool, Index
from calib.design import Selection
from calib.identification.identify import Identification, Mode
from calib.information.observability import Observability
from calib.measurement.accuracy import Accuracy
from calib.measurement.observations import Measurements
from testbed.laboratory.truth.laboratory import Setting
from testbed.scenario.read import Scenario
from testbed.studies.compensation.records import CompensationStudy
from testbed.studies.coverage.records import CoverageStudy
from testbed.studies.trial.statement.records import Statement, Validation
from testbed.studies.wen2022.records import PoolSets, Reexamined


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """An identified model against the truth, on held-out poses and parameter by parameter."""

    before: Array
    """(t,) held-out position error of the nominal model against noise-free truth [m]."""
    after: Array
    """(t,) the same for the identified model [m]."""
    rotation_before: Array
    """(t,) rotation error [rad]."""
    rotation_after: Array
    """(t,) rotation error [rad]."""
    error: Array
    """(t, 3) held-out position error vector, true minus identified, world axes [m]."""
    covariance: Array
    """(t, 6, 6) stated covariance of the predicted tool pose [m, rad]."""
    inside: Bool
    """(t,) true tool point inside the stated 95 % region."""
    identification_before: Accuracy
    """Position error at the identification poses, nominal model against what was measured [m]."""
    identification_after: Accuracy
    """The same for the identified model [m]."""
    accuracy_before: Accuracy
    """Of `before` [m]."""
    accuracy_after: Accuracy
    """Of `after` [m]."""
    true_step: Array
    """(f,) true values minus nominal of the estimated parameters, in their gauge [m, rad]."""
    parameter_inside: Bool
    """(f,) true value inside the stated 95 % interval."""
    nees: float
    """Normalized estimation error squared e' C^-1 e; expected f."""


@dataclass(frozen=True, slots=True, eq=False)
class Replications:
    """The same poses measured and identified again and again: what the stated intervals hold."""

    count: int
    nees: Array
    """(K,) normalized estimation error squared of each replication."""
    parameter_coverage: Array
    """(f,) share of replications whose 95 % interval holds the true value."""
    tool_coverage: Array
    """(t,) share of replications whose 95 % region holds the true tool point, per held-out pose."""
    sd_ratio: Array
    """(f,) mean stated over empirical sd: 1 for an honest statement."""
    mean_error: Array
    """(K,) mean held-out position error of each replication [m]."""
    nees_band: Array
    """(2,) 99.9 % band of the mean NEES if the statement is true."""
    coverage_band: Array
    """(2,) band that holds the coverage of all f parameters in 99.9 % of honest campaigns."""


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """One estimator applied to one trial."""

    mode: Mode
    """"whitened" (default estimator) or "paper" (24 parameters, 12 unweighted rows)."""
    identification: Identification
    repeated: Array
    """(v, f) steps identified from each of v repeated measurements [m, rad]."""
    type_a: Array
    """(f,) experimental sd of `repeated` (n - 1), Wen et al. 2022 eq. (7) [m, rad]."""
    comparison: Comparison
    replications: Replications | None
    """None where the scenario asks for none, and where repeats of one robot cannot test what is
    stated: a prior, or what the tracker gets wrong all campaign long."""
    statement: Statement | None = None
    """What to believe and why; only for the default estimator."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One pose set, measured and identified."""

    name: str
    method: str
    """random, best_of_random, greedy, detmax, fedorov or exchange."""
    rows: str
    """Rows and units in which the criterion was computed: "whitened" or "paper"."""
    selection: Selection
    observability: Observability
    """In the paper's rows (12, mm, rad), of the robot's set ``wen2022``, else the kept numbers."""
    whitened_observability: Observability
    """Whitened rows and scaled columns (L = 0.3 m), of the numbers the default estimator keeps."""
    measurements: Measurements
    """The first visit of each pose: what is identified."""
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PoseCountStudy:
    """Mean index of random sets against the number of poses, and where the rule stops."""

    counts: Index
    """(k,) poses per set."""
    names: tuple[str, ...]
    """(i,) O1 ... O5."""
    mean: Array
    """(i, k) mean index over the random sets, paper rows; O3, O4, O5 as printed."""
    mean_per_pose: Array
    """(i, k) correct per-pose form."""
    spread: Array
    """(i, k) standard deviation over the sets (printed form)."""
    chosen: tuple[int | None, ...]
    """Poses the rule chooses for O1 and for O2, in that order; None if it never settles."""


@dataclass(frozen=True, slots=True, eq=False)
class RandomSets:
    """The figure of one trial's set beside those of random sets of the same size."""

    trial: str
    criterion: str
    unit: str
    """Of the figure: "1" for an index, "m" for an uncertainty."""
    larger_is_better: bool
    n_poses: int
    chosen_value: float
    values: Array
    """(k,) figure of each random set."""

    @property
    def beaten(self) -> int:
        """Random sets that are worse."""
        sign = 1.0 if self.larger_is_better else -1.0
        return int((sign * self.values < sign * self.chosen_value).sum())

    @property
    def best(self) -> float:
        """Figure of the best random set."""
        return float(self.values.max() if self.larger_is_better else self.values.min())


@dataclass(frozen=True, slots=True, eq=False)
class RandomSetsStudy:
    """Every designed trial's set beside random sets."""

    sets: tuple[RandomSets, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PaperBudget:
    """The paper's uncertainties per parameter: contributors and their combination [m, rad]."""

    names: tuple[str, ...]
    """(f,) parameter names."""
    best_repeatability: Array
    """(f,) u_r of the optimal set."""
    repeatability: Array
    """(f,) u_r of 50 random poses, v repeats."""
    pose_number: Array
    """(f,) u_p over sets of 30, 50, ..., 150 poses."""
    location: Array
    """(f,) u_w over four regions."""
    best: Array
    """(f,) u_best = RSS(u_r, u_c), eq. (8)."""
    random: Array
    """(f,) u_rand = RSS(u_r, u_c, u_p, u_w), eq. (9)."""


@dataclass(frozen=True, slots=True, eq=False)
class ToolPointStudy:
    """Monte Carlo of the tool point: zero pose first, then the held-out poses.

    The paper's form draws independent parameters and looks at |P|; the correct form draws from the
    full covariance and looks at all three directions.
    """

    source: tuple[str, ...]
    """(s,) whose uncertainties: "table 3 best", "table 3 random", "ours best", "ours random"."""
    distance_sd: Array
    """(s, 1 + t) sd of |P|, paper form [m]."""
    distance_range: Array
    """(s, 2) smallest and largest of |P| minus its mean at the zero pose [m]."""
    spread: Array
    """(s, 1 + t, 3) sd of x, y, z with the same independent draws [m]."""
    trial: str
    """Trial whose full covariance the correct form uses."""
    covariance: Array
    """(1 + t, 3, 3) Monte Carlo covariance of the tool point, correct form [m^2]."""
    linear: Array
    """(1 + t, 3, 3) closed form J C J' [m^2]."""
    draws: int


@dataclass(frozen=True, slots=True, eq=False)
class PopulationStudy:
    """Every trial's pose set on many virtual robots, each measured once: the robot is the unit."""

    trials: tuple[str, ...]
    """(s,) names."""
    mean_error: Array
    """(s, e, R) mean held-out position error against the truth, per trial, estimator, robot [m]."""
    rms_error: Array
    """(s, e, R) root mean square of the same [m]."""
    stated_u: Array
    """(s, e, R) root mean square over held-out poses of the stated 3-D u [m]."""
    inside: Array
    """(s, e, R) share of held-out points inside their stated 95 % region."""
    before: Array
    """(R,) mean held-out error of the nominal model [m]."""
    goal_u: Array
    """(s, R) RMS tool-point u over the goal that the set promised, from the nominal model [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """A scenario played once."""

    scenario: Scenario
    setting: Setting
    validation: Validation
    trials: tuple[Trial, ...]
    pose_count: PoseCountStudy | None
    random_sets: tuple[RandomSets, ...]
    paper_budget: PaperBudget | None
    tool_point: ToolPointStudy | None
    population: PopulationStudy | None
    coverage: tuple[CoverageStudy, ...] = ()
    """One per kind of robot, in the order of the scenario."""
    pool_sets: PoolSets | None = None
    """Pools and sets of the re-examination of the paper."""
    reexamined: tuple[Reexamined, ...] = ()
    """One per kind of robot, in the order of the scenario."""
    compensation: tuple[CompensationStudy, ...] = ()
    """One per kind of robot, in the order of the scenario."""
