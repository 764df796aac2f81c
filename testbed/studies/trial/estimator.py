"""What an estimator of a scenario fits: model, free numbers, prior and loss; and which model."""

from dataclasses import dataclass, field, replace

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.geometry.parameters import CHARACTERISTIC_LENGTH, Parameters
from calib.identification.climb import Climb, ClimbStep, Offer
from calib.identification.identify import Identification, Mode, identify
from calib.identification.joint_models import with_joint_terms
from calib.identification.ladders import ladders_of
from calib.identification.levels import Ladder, Level
from calib.identification.model_choice import choose
from calib.identification.prior import Prior
from calib.identification.robust import Loss
from calib.information.rank import BEARING, MOMENT, SAG
from calib.measurement.observations import Measurements
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.robots.robot import Robot
from testbed.scenario.tables import PriorSettings

WEAK = PriorSettings()
MM, MDEG = 1e-3, np.radians(1e-3)


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
    why: str = ""
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
        return self.why.startswith("extended")

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


def estimator_for(bench: Laboratory, mode: Mode, measured: Measurements) -> Estimator:
    """The estimator `mode` of a scenario; where the evidence decides, it looks at `measured` only.

    Chosen geometry is fitted without a prior unless the scenario gives one: everything that the
    measurements can tell apart, as if the question had not been asked.
    """
    nominal, free = bench.setting.nominal, bench.free(mode)
    if mode == "paper":
        return Estimator(mode, nominal, free)
    settings = bench.scenario.identification
    given = None if settings.prior is None else scenario_prior(settings.prior, free)
    why, evidence = "geometric: as the scenario says", float("nan")
    climbed: Climb | None = None
    extended = settings.model == "extended"
    if extended:
        why = "extended: as the scenario says"
    elif settings.model == "choose":
        own = settings.prior or WEAK
        choice = choose(
            nominal,
            measured,
            free,
            prior=scenario_prior(own, free),
            ladders=scenario_ladders(own, nominal, bench.robot, measured.conditions.usual_payload),
            loss=settings.loss,
        )
        why, evidence, climbed = choice.sentence, choice.log_evidence, choice.climb
        if choice.chosen == "extended":
            found = choice.identification
            nominal, free, given = choice.starts[1], found.parameters, found.prior
    if extended:
        nominal, free, _ = with_joint_terms(nominal, free)
        given = scenario_prior(settings.prior or WEAK, free)
    asked = ((), ()) if climbed is None else (climbed.offered, climbed.steps)
    return Estimator(mode, nominal, free, given, settings.loss, why, evidence, *asked)


def scenario_prior(settings: PriorSettings, parameters: Parameters) -> Prior:
    """The prior of a scenario for all free numbers, centered on nominal."""
    names = parameters.free_names
    is_length = parameters.is_length[parameters.free_index]
    sd = np.array(
        [_spread(settings, name, bool(kind)) for name, kind in zip(names, is_length, strict=True)]
    )
    return Prior(np.zeros(len(names)), sd, names)


def scenario_ladders(
    settings: PriorSettings, nominal: RobotModel, robot: Robot, payload: Array | None = None
) -> tuple[Ladder, ...]:
    """The ladders of an arm with the sizes that a scenario believes in; `payload` as there."""
    first, second = (MDEG * size for size in settings.harmonics_mdeg)
    ladders = ladders_of(
        nominal, moments=robot.moments, limits=robot.limits, payload=payload,
        waves=(first, second), sag=MDEG * settings.gravity_mdeg,
    )  # fmt: skip
    return tuple(
        replace(ladder, levels=tuple(_with_own_sizes(level, settings) for level in ladder.levels))
        for ladder in ladders
    )


def _with_own_sizes(level: Level, settings: PriorSettings) -> Level:
    """A level whose numbers have the sizes that the scenario gives them by name."""
    named = {name: np.radians(size) for name, size in settings.sd_deg.items()}
    both = zip(level.names, level.sd, strict=True)
    return replace(level, sd=np.array([named.get(name, sd) for name, sd in both]))


def _spread(settings: PriorSettings, name: str, is_length: bool) -> float:
    """Prior standard deviation of one number [m or rad]."""
    own = settings.sd_mm.get(name) if is_length else settings.sd_deg.get(name)
    if own is not None:
        return own * MM if is_length else float(np.radians(own))
    frame = name.startswith(("base.", "tool."))
    if name.startswith(("spring", "moment")):
        return _of_springs(settings, name, is_length)
    if is_length:
        return (settings.frame_lengths_mm if frame else settings.lengths_mm) * MM
    if frame:
        return float(np.radians(settings.frame_angles_deg))
    if name.startswith("gravity"):
        return float(settings.gravity_mdeg * MDEG)
    if name.startswith("harmonic"):
        first, higher = settings.harmonics_mdeg
        return float((first if name.endswith(("sin1", "cos1")) else higher) * MDEG)
    return float(np.radians(settings.angles_deg))


def _of_springs(settings: PriorSettings, name: str, is_length: bool) -> float:
    """The same of springs and of the moments that load them [rad, m; kg, kg m]."""
    if name.startswith("moment"):
        return MOMENT[not name.endswith(".m")]
    across = 1.0 if name.endswith(".z") else BEARING / SAG
    length = CHARACTERISTIC_LENGTH if is_length else 1.0
    return float(settings.gravity_mdeg * MDEG * across * length)
