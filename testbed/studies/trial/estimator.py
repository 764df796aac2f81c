"""Estimators of a scenario: model and its choice, free numbers, prior and loss."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.climbing import Climb, ClimbStep, Offer
from calib.identification.identify import Identification, Mode, identify
from calib.identification.joint_models import with_joint_terms
from calib.identification.ladders import ladders_of
from calib.identification.levels import Ladder, Level
from calib.identification.many.fit import fit_many
from calib.identification.many.result import ManyFits
from calib.identification.many.tables import ManyTables, known_to_many
from calib.identification.model_choice import choose, reason_of
from calib.identification.prior import Prior, own_prior, own_words
from calib.identification.result import Reason
from calib.identification.robust import Loss
from calib.identification.row_ladders import RowTerms, row_ladders
from calib.information.sizes import usual_sizes
from calib.measurement.observations import Measurements
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.robots.robot import Robot
from testbed.scenario.tables import PriorSettings

WEAK = PriorSettings()
MM, MDEG = 1e-3, np.radians(1e-3)
UNSAID = {
    "torque": "the rows of this laboratory say none",
    "lengths": "the rows of this laboratory say no temperature",
}
"""Ladders that are never used here, and the reasons."""


AS_ASKED = Reason("geometric", "", "as the scenario says")
"""Of a model that no reading decided."""


@dataclass(frozen=True, slots=True, eq=False)
class Estimator:
    """An estimator, the same for every visit of a trial."""

    mode: Mode
    nominal: RobotModel
    """Start of the fit; for the extended model with joint terms, all zero."""
    parameters: Parameters
    """Free numbers."""
    prior: Prior | None = None
    loss: Loss = "squared"
    reason: Reason = AS_ASKED
    """Which model it fits and why, in words."""
    log_evidence: float = field(default=float("nan"))
    """Log odds of the extended model; nan if the evidence was not computed."""
    offered: tuple[Offer, ...] = ()
    """Joint errors on offer, and the outcome of each."""
    steps: tuple[ClimbStep, ...] = ()
    """Steps of the choice."""

    @property
    def extended(self) -> bool:
        """Whether it fits joint errors in addition to geometry."""
        return self.reason.model == "extended"

    def fit(self, measured: Measurements, parameters: Parameters | None = None) -> Identification:
        """Identify from one table; `parameters` replaces the free numbers."""
        return identify(
            self.nominal,
            measured,
            self.parameters if parameters is None else parameters,
            mode=self.mode,
            prior=self.prior,
            loss=self.loss,
        )

    def fit_many(self, tables: ManyTables, first: Identification) -> ManyFits | None:
        """Identify the same numbers from several tables like that of a first identification.

        None if arrays cannot express the estimator, or if one of the fits does not converge.
        """
        told = first.prior is not None and set(first.prior.names) == set(first.names)
        enough = 6 * tables.seen.shape[2] > first.rank
        known = known_to_many(self.nominal) and self.loss == "squared"
        if not known or not (told if first.prior is not None else enough):
            return None
        # frames move by products, in which a held number would not keep its value
        start = first.model if _whole_frames(first) else None
        fits = fit_many(
            self.nominal, tables, first.parameters,
            mode=self.mode, prior=first.prior, start=start,
        )  # fmt: skip
        return fits if fits.converged.all() else None


def _whole_frames(found: Identification) -> bool:
    """Whether all or none of the numbers of base and of tool are free."""
    counts = (sum(name.startswith(frame) for name in found.names) for frame in ("base.", "tool."))
    return all(count in (0, 6) for count in counts)


def estimator_for(bench: Laboratory, mode: Mode, measured: Measurements) -> Estimator:
    """The estimator `mode` of a scenario; a choice by evidence uses `measured` only.

    If geometry is chosen, all numbers that the measurements determine are fitted without a prior,
    unless the scenario states one, as if there had been no choice. Joint errors that the robot has
    already get the weak prior in any case, since measurements do not determine many of them.
    """
    nominal, free = bench.setting.nominal, bench.free(mode)
    if mode == "paper":
        return Estimator(mode, nominal, free)
    own = own_words(nominal, free)
    settings = bench.scenario.identification
    given = own_prior(free, nominal)
    if settings.prior is not None:
        given = scenario_prior(settings.prior, free, nominal)
    reason, evidence = AS_ASKED, float("nan")
    climbed: Climb | None = None
    if settings.model == "extended":
        reason = reason._replace(model="extended")
    elif settings.model == "choose":
        weak = settings.prior or WEAK
        choice = choose(
            nominal,
            measured,
            free,
            prior=scenario_prior(weak, free, nominal),
            ladders=scenario_ladders(weak, nominal, bench.robot, measured, gear_orders(bench)),
            loss=settings.loss,
        )
        climbed, evidence = choice.climb, choice.log_evidence
        reason = reason_of(climbed, nominal)
        if choice.chosen == "extended":
            found = choice.identification
            nominal, free, given = choice.starts[1], found.parameters, found.prior
    if settings.model == "extended":
        nominal, free, _ = with_joint_terms(nominal, free)
        given = scenario_prior(settings.prior or WEAK, free, nominal)
    if own:
        reason = reason._replace(because=f"{reason.because}; {own}")
    asked = ((), ()) if climbed is None else (climbed.offered, climbed.steps)
    return Estimator(mode, nominal, free, given, settings.loss, reason, evidence, *asked)


def scenario_prior(settings: PriorSettings, parameters: Parameters, model: RobotModel) -> Prior:
    """The prior of a scenario for all free numbers of a model, centered on it."""
    errors, names = model.joint_errors, parameters.free_names
    waves, sag = _sizes(settings)
    usual = usual_sizes(errors, model.chain.kinds, waves=waves, sag=sag)
    bends = dict(zip(errors.names, usual.tolist(), strict=True))
    lengths = parameters.is_length[parameters.free_index].tolist()
    sd = [_spread(settings, *both, bends) for both in zip(names, lengths, strict=True)]
    return Prior(np.zeros(len(names)), np.array(sd), names)


def _sizes(settings: PriorSettings) -> tuple[tuple[float, float], float]:
    """Prior sd of one and two waves per turn, and of sag [rad]."""
    first, second = (float(MDEG * size) for size in settings.harmonics_mdeg)
    return (first, second), float(MDEG * settings.gravity_mdeg)


def scenario_ladders(
    settings: PriorSettings,
    nominal: RobotModel,
    robot: Robot,
    measured: Measurements,
    gear: tuple[tuple[float, ...], ...] = (),
) -> tuple[Ladder, ...]:
    """The ladders of an arm and of its rows' conditions, with the prior sizes of a scenario.

    `gear` as in `RowTerms`.
    """
    waves, sag = _sizes(settings)
    ladders = ladders_of(
        nominal, moments=robot.moments, limits=robot.limits,
        payload=measured.conditions.usual_payload, waves=waves, sag=sag,
    )  # fmt: skip
    ladders += row_ladders(nominal, measured, RowTerms(gear, unsaid=UNSAID))
    return tuple(
        replace(ladder, levels=tuple(_with_own_sizes(level, settings) for level in ladder.levels))
        for ladder in ladders
    )


def gear_orders(bench: Laboratory) -> tuple[tuple[float, ...], ...]:
    """Waves per turn of each drive, for one and two per turn of its motor, if it has gears.

    The ratio is known from the drive; the errors of the gear are part of the truth.
    """
    truth, joints = bench.scenario.truth, bench.robot.model.chain.n_joints
    if not np.any(truth.gear_mdeg):
        return ()
    ratios = np.broadcast_to(np.asarray(truth.gear_ratio, dtype=np.float64), (joints,))
    return tuple((float(ratio), float(2 * ratio)) for ratio in ratios)


def _with_own_sizes(level: Level, settings: PriorSettings) -> Level:
    """A level whose numbers have the prior sizes that the scenario states by name."""
    named = {name: np.radians(size) for name, size in settings.sd_deg.items()}
    both = zip(level.names, level.sd, strict=True)
    return replace(level, sd=np.array([named.get(name, sd) for name, sd in both]))


def _spread(
    settings: PriorSettings, name: str, is_length: bool, bends: Mapping[str, float]
) -> float:
    """Prior standard deviation of one number [m or rad]; joint errors have their usual `bends`."""
    own = settings.sd_mm.get(name) if is_length else settings.sd_deg.get(name)
    if own is not None:
        return own * MM if is_length else float(np.radians(own))
    if name in bends:
        return bends[name]
    frame = name.startswith(("base.", "tool."))
    if is_length:
        return (settings.frame_lengths_mm if frame else settings.lengths_mm) * MM
    return float(np.radians(settings.frame_angles_deg if frame else settings.angles_deg))
