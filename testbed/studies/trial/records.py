"""What a campaign leaves behind: frozen records, each kept in its own file; nothing is computed.

Everything that knows the truth says so in its name or docstring; planning and identification never
see these fields. Of a statement only `attained` and `inside` do: all else comes from what the
tracker saw.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.design import Selection
from calib.errors import CalibError
from calib.identification.identify import Identification, Mode
from calib.information.observability import Observability
from calib.information.propagation import point_uncertainty
from calib.measurement.accuracy import Accuracy
from calib.measurement.observations import Measurements
from calib.uncertainty.statement.belief import Belief
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.studies.protocol import Records
from testbed.studies.trial.bending.records import Ways
from testbed.studies.trial.statement.records import Statement, Validation


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """An identified model against the truth, on held-out poses and parameter by parameter."""

    before: Annotated[Array, "t"]
    """(t,) held-out position error of the nominal model against noise-free truth [m]."""
    after: Annotated[Array, "t"]
    """(t,) the same for the identified model [m]."""
    rotation_before: Annotated[Array, "t"]
    """(t,) rotation error [rad]."""
    rotation_after: Annotated[Array, "t"]
    """(t,) rotation error [rad]."""
    error: Annotated[Array, "t", 3]
    """(t, 3) held-out position error vector, true minus identified, world axes [m]."""
    covariance: Annotated[Array, "t", 6, 6]
    """(t, 6, 6) covariance of the predicted tool pose by the parameters alone [m, rad]."""
    inside: Annotated[Bool, "t"]
    """(t,) true tool point inside the 95 % region of that covariance."""
    identification_before: Accuracy
    """Position error at the identification poses, nominal model against what was measured [m]."""
    identification_after: Accuracy
    """The same for the identified model [m]."""
    accuracy_before: Accuracy
    """Of `before` [m]."""
    accuracy_after: Accuracy
    """Of `after` [m]."""
    true_step: Annotated[Array, "f"]
    """(f,) true values minus nominal of the estimated parameters, in their gauge; nan of what
    nothing in the true robot defines [m, rad]."""
    parameter_inside: Annotated[Bool, "f"]
    """(f,) true value inside the stated 95 % interval; none of what is not `judged`."""
    nees: float
    """Normalized estimation error squared e' C^-1 e of the judged numbers; expected their count."""

    @property
    def stated_u(self) -> float:
        """3-D standard uncertainty by the parameters alone, RMS over the held-out poses [m]."""
        return float(np.sqrt(np.mean(point_uncertainty(self.covariance) ** 2)))


@dataclass(frozen=True, slots=True, eq=False)
class Replications:
    """The same poses measured and identified again and again: what the stated intervals hold."""

    count: int
    nees: Annotated[Array, "K"]
    """(K,) normalized estimation error squared of each replication."""
    parameter_coverage: Annotated[Array, "f"]
    """(f,) share of replications whose 95 % interval holds the true value."""
    tool_coverage: Annotated[Array, "t"]
    """(t,) share of replications whose 95 % region by the parameters alone holds the true tool
    point, per held-out pose."""
    region_coverage: Annotated[Array, "t"] | None
    """(t,) the same of regions about the replicated points, as large as the one that was believed
    of the first visit; None where none was."""
    sd_ratio: Annotated[Array, "f"]
    """(f,) mean stated over empirical sd: 1 for an honest statement."""
    mean_error: Annotated[Array, "K"]
    """(K,) mean held-out position error of each replication [m]."""
    nees_band: Annotated[Array, 2]
    """(2,) 99.9 % band of the mean NEES if the statement is true."""
    coverage_band: Annotated[Array, 2]
    """(2,) band that holds the coverage of all f parameters in 99.9 % of honest campaigns."""


def judged_numbers(identification: Identification, true_step: Array) -> Bool:
    """Which numbers (f,) are held against the truth: those of springs are known together only."""
    springs = identification.model.joint_errors.springs
    together = np.isin(identification.names, () if springs is None else springs.names)
    return np.asarray(np.isfinite(true_step) & ~together)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """One estimator applied to one trial."""

    mode: Mode
    """"whitened" (default estimator) or "paper" (24 parameters, 12 unweighted rows)."""
    identification: Identification
    repeated: Annotated[Array, "v", "f"]
    """(v, f) steps identified from each of v repeated measurements [m, rad]."""
    type_a: Annotated[Array, "f"]
    """(f,) experimental sd of `repeated` (n - 1), Wen et al. 2022 eq. (7) [m, rad]."""
    comparison: Comparison
    replications: Replications | None
    """None where the scenario asks for none, and where repeats of one robot cannot test what is
    stated: a prior, or what the tracker gets wrong all campaign long."""
    statement: Statement | None = None
    """What to believe and why; only for the default estimator."""

    @property
    def judged(self) -> Bool:
        """(f,) numbers with a U of their own and a true value."""
        return judged_numbers(self.identification, self.comparison.true_step)

    @property
    def belief(self) -> Belief | None:
        """What is believed of the tool point; None where nothing is."""
        return None if self.statement is None else self.statement.belief

    @property
    def inside(self) -> Bool:
        """(t,) true held-out tool point inside what is believed, else by the fit's covariance."""
        if self.statement is None or self.statement.belief is None:
            return self.comparison.inside
        return self.statement.inside

    @property
    def stated_u(self) -> float:
        """3-D standard uncertainty of the mean tool point that is believed, else of the fit [m]."""
        if self.statement is None or self.statement.point is None:
            return self.comparison.stated_u
        return self.statement.point.u_mean


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

    counts: Annotated[Index, "k"]
    """(k,) poses per set."""
    names: Annotated[tuple[str, ...], "i"]
    """(i,) O1 ... O5."""
    mean: Annotated[Array, "i", "k"]
    """(i, k) mean index over the random sets, paper rows; O3, O4, O5 as printed."""
    mean_per_pose: Annotated[Array, "i", "k"]
    """(i, k) correct per-pose form."""
    spread: Annotated[Array, "i", "k"]
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
    values: Annotated[Array, "k"]
    """(k,) figure of each random set."""

    @property
    def beaten(self) -> int:
        """Random sets that are worse."""
        sign = 1.0 if self.larger_is_better else -1.0
        return int((sign * self.values < sign * self.chosen_value).sum())

    @property
    def mean(self) -> float:
        """Mean figure of the random sets."""
        return float(self.values.mean())

    @property
    def best(self) -> float:
        """Figure of the best random set."""
        return float(self.values.max() if self.larger_is_better else self.values.min())


@dataclass(frozen=True, slots=True, eq=False)
class RandomSetsStudy:
    """Every designed trial's set beside random sets."""

    sets: tuple[RandomSets, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """A scenario played once: what all studies stand on, and the records of the others."""

    scenario: Scenario
    setting: Setting
    validation: Validation
    trials: tuple[Trial, ...]
    """Those that did not fail, in the order of the scenario; at least one."""
    records: Records

    @property
    def estimates(self) -> tuple[tuple[Trial, Estimate], ...]:
        """Every estimate beside its trial."""
        return tuple((trial, estimate) for trial in self.trials for estimate in trial.estimates)

    @property
    def pose_count(self) -> PoseCountStudy | None:
        """Indices against the number of poses; None if nobody asked."""
        return self.records.find("pose_count", PoseCountStudy)

    @property
    def motion(self) -> Ways | None:
        """How the true arm comes to its poses; None where it does not move."""
        return self.records.find("motion", Ways)

    @property
    def random_sets(self) -> tuple[RandomSets, ...]:
        """Every designed trial's set beside random ones; none if nobody asked."""
        study = self.records.find("random_sets", RandomSetsStudy)
        return study.sets if study else ()


def campaign_of(scenario: Scenario, records: Records) -> Campaign:
    """The campaign in finished records.

    Raises
    ------
    CalibError
        Every trial failed; says why.
    """
    found = (records.find(settings.name, Trial) for settings in scenario.trial)
    trials = tuple(trial for trial in found if trial is not None)
    if not trials:
        reasons = "; ".join(f"{key}: {reason}" for key, reason in records.failed.items())
        raise CalibError(f"every trial failed: {reasons}", code="T1", field="trial")
    setting, visit = records.get("setting", Setting), records.get("validation", Validation)
    return Campaign(scenario, setting, visit, trials, records)
