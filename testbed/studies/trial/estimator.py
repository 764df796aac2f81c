"""What an estimator of a scenario fits: model, free numbers, prior and loss; and which model."""

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
from calib.identification.many.fit import ManyFits, fit_many
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
"""Ladders that are never climbed here, and why."""


AS_ASKED = Reason("geometric", "", "as the scenario says")
"""Of a model that no reading decided."""


@dataclass(frozen=True, slots=True, eq=False)
class Estimator:
    """One way to identify, the same for every visit of a trial."""

    mode: Mode
    nominal: RobotModel
    """Start of the fit; with joint terms, all zero, where the extended model is fitted."""
    parameters: Parameters
    """What is free."""
    prior: Prior | None = None
    loss: Loss = "squared"
    reason: Reason = AS_ASKED
    """Which model it fits and why, in words."""
    log_evidence: float = field(default=float("nan"))
    """Log odds of the extended model; nan where the evidence was not asked."""
    offered: tuple[Offer, ...] = ()
    """Joint errors that were offered, and what became of them."""
    steps: tuple[ClimbStep, ...] = ()
    """How the choice went."""

    @property
    def extended(self) -> bool:
        """Whether it fits joint errors beside the geometry."""
        return self.reason.model == "extended"

    def fit(self, measured: Measurements, parameters: Parameters | None = None) -> Identification:
        """Identify from one table; `parameters` replaces what is free."""
        return identify(
            self.nominal,
            measured,
            self.parameters if parameters is None else parameters,
            mode=self.mode,
            prior=self.prior,
            loss=self.loss,
        )

    def fit_many(self, tables: ManyTables, first: Identification) -> ManyFits | None:
        """Identify from tables like that of a first identification, and of the same numbers.

        None where arrays do not know the estimator, or one of the fits is no estimate.
        """
        told = first.prior is not None and set(first.prior.names) == set(first.names)
        enough = 6 * tables.seen.shape[2] > first.rank
        known = known_to_many(self.nominal) and self.loss == "squared"
        if not known or not (told if first.prior is not None else enough):
            return None
        # a frame moves by products, in which a number that is held would not stay as it is
        start = first.model if _whole_frames(first) else None
        fits = fit_many(
            self.nominal, tables, first.parameters,
            mode=self.mode, prior=first.prior, start=start,
        )  # fmt: skip
        return fits if fits.converged.all() else None


def _whole_frames(found: Identification) -> bool:
    """Whether of each frame, base and tool, all numbers are free or none is."""
    counts = (sum(name.startswith(frame) for name in found.names) for frame in ("base.", "tool."))
    return all(count in (0, 6) for count in counts)


def estimator_for(bench: Laboratory, mode: Mode, measured: Measurements) -> Estimator:
    """The estimator `mode` of a scenario; where the evidence decides, it looks at `measured` only.

    Chosen geometry is fitted without a prior unless the scenario gives one: everything that the
    measurements can tell apart, as if the question had not been asked. Joint errors that the robot
    has already have the weak prior in any case: many of them no measurement tells.
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
    """Of one and two waves a turn, and of sag [rad]."""
    first, second = (float(MDEG * size) for size in settings.harmonics_mdeg)
    return (first, second), float(MDEG * settings.gravity_mdeg)


def scenario_ladders(
    settings: PriorSettings,
    nominal: RobotModel,
    robot: Robot,
    measured: Measurements,
    gear: tuple[tuple[float, ...], ...] = (),
) -> tuple[Ladder, ...]:
    """The ladders of an arm and of what its rows say, with the sizes that a scenario believes in.

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
    """Waves a turn of each drive, one and two a turn of its motor, where the scenario has gears.

    A ratio stands on the drive; what the gear does there is the secret.
    """
    truth, joints = bench.scenario.truth, bench.robot.model.chain.n_joints
    if not np.any(truth.gear_mdeg):
        return ()
    ratios = np.broadcast_to(np.asarray(truth.gear_ratio, dtype=np.float64), (joints,))
    return tuple((float(ratio), float(2 * ratio)) for ratio in ratios)


def _with_own_sizes(level: Level, settings: PriorSettings) -> Level:
    """A level whose numbers have the sizes that the scenario gives them by name."""
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
