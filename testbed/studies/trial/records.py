"""What a campaign leaves behind: frozen records, each kept in its own file; nothing is computed.

Everything that knows the truth says so in its name or docstring; planning and identification never
see these fields. Of a statement only `attained` and `inside` do: all else comes from what the
tracker saw.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import Array, Bool
from calib.design import Selection
from calib.errors import CalibError
from calib.identification.identify import Identification, Mode
from calib.information.observability import Observability
from calib.information.propagation import point_uncertainty
from calib.measurement.accuracy import Accuracy
from calib.measurement.observations import Measurements
from calib.shown import ResultTable, Shown, concatenated, length_words
from calib.uncertainty.statement.belief import Belief
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.studies.protocol import Records
from testbed.studies.trial.bending.records import Ways
from testbed.studies.trial.set_records import PoseCountStudy, RandomSets, RandomSetsStudy
from testbed.studies.trial.statement.records import Statement, Validation


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Comparison(Shown):
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


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Replications(Shown):
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


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Estimate(Shown):
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

    def __repr__(self) -> str:
        before, after = 1e3 * self.comparison.before.mean(), 1e3 * self.comparison.after.mean()
        stated = f", R95 {length_words(self.radius, um='.3g')}" if np.isfinite(self.radius) else ""
        return f"Estimate({self.mode}: {before:.3g} -> {after:.3g} mm{stated})"

    def tables(self) -> dict[str, ResultTable]:
        """``errors`` at the held-out poses, against the truth; ``numbers`` with what is true."""
        found = self.comparison
        errors = {"before_mm": 1e3 * found.before, "after_mm": 1e3 * found.after}
        units, scale = self.identification.shown_in
        alone = np.isfinite(self.identification.tables()["numbers"]["U"])
        U = 2 * scale * self.identification.standard_uncertainty
        numbers = {
            "name": self.identification.names,
            "step": scale * self.identification.step,
            "true_step": scale * found.true_step,
            "U": np.where(alone, U, np.nan),
            "unit": units,
            "judged": self.judged,
            "inside": found.parameter_inside,
        }
        return {
            "errors": ResultTable(
                {"pose": np.arange(len(self.inside)), **errors, "inside": self.inside}
            ),
            "numbers": ResultTable(numbers, precision="U"),
        }

    @property
    def radius(self) -> float:
        """R95 of the mean tool point that is believed; nan where nothing is [m]."""
        stated = None if self.statement is None else self.statement.point
        return float("nan") if stated is None else stated.radius_mean

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


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Trial(Shown):
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

    def __repr__(self) -> str:
        poses, found = len(self.selection.indices), ", ".join(map(repr, self.estimates))
        return f"Trial({self.name!r}, {poses} poses; {found})"

    def tables(self) -> dict[str, ResultTable]:
        """``estimates``: what each leaves, states and holds; their `Estimate.tables`."""
        found = {"estimates": concatenated(map(self._line, self.estimates))}
        for name in ("errors", "numbers"):
            found[name] = concatenated(
                ResultTable({"trial": self.name, "estimator": one.mode, **table}, table.precision)
                for one in self.estimates
                for table in [one.tables()[name]]
            )
        return found

    def _line(self, one: Estimate) -> ResultTable:
        """One estimate in one row."""
        return ResultTable(
            {
                "trial": [self.name],
                "estimator": one.mode,
                "poses": len(self.selection),
                "before_mm": 1e3 * one.comparison.before.mean(),
                "after_mm": 1e3 * one.comparison.after.mean(),
                "largest_mm": 1e3 * one.comparison.after.max(),
                "R95_um": 1e6 * one.radius,
                "inside": one.inside.mean(),
            }
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Campaign(Shown):
    """A scenario played once: what all studies stand on, and the records of the others."""

    scenario: Scenario
    setting: Setting
    validation: Validation
    trials: tuple[Trial, ...]
    """Those that did not fail, in the order of the scenario; at least one."""
    records: Records

    def __repr__(self) -> str:
        name, seed = self.scenario.name, self.scenario.seed
        first = self.trials[0]
        return (
            f"Campaign({name!r}, seed {seed}, {len(self.trials)} trials; "
            f"{first.name}: {first.estimates[0]!r})"
        )

    def tables(self) -> dict[str, ResultTable]:
        """Those of the trials, ``errors`` against the truth among them; then those of studies."""
        found: dict[str, list[ResultTable]] = {}
        names = {trial.name for trial in self.trials}
        others = [record for key, record in self.records.values.items() if key not in names]
        for record in (*self.trials, *others):
            tables = record.tables() if isinstance(record, Shown) else {}
            for name, table in tables.items():
                found.setdefault(name, []).append(table)
        return {name: concatenated(parts) for name, parts in found.items()}

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
