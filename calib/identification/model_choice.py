"""Model choice: geometry alone, or joint errors as well, with the fits of both.

The choice is by evidence, confirmed by cross-validation over the training poses. Held-out poses are
never used for it, or they would no longer be a test.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.climb import climb
from calib.identification.climbing import Climb
from calib.identification.folds import FEWEST_TO_CONFIRM, FOLDS, parts_of, some_poses
from calib.identification.identify import identify
from calib.identification.joint_models import extended_parameters, with_joint_terms
from calib.identification.ladders import ladders_of
from calib.identification.larger_noise import HONEST, noise_factor, under_noise
from calib.identification.levels import Ladder, Level, joined, prior_of, with_errors
from calib.identification.prior import Prior, weak_prior
from calib.identification.result import Identification, Reason
from calib.identification.robust import Loss
from calib.identification.row_ladders import NOTHING_KNOWN, RowTerms, row_ladders
from calib.kinds import checked_kinds
from calib.measurement.observations import Measurements
from calib.shown import ResultTable, Shown


@dataclass(frozen=True, slots=True, eq=False)
class ModelChoice(Shown):
    """Two models of one robot, identified from one table, and which of them to use."""

    chosen: Literal["geometric", "extended"]
    identifications: tuple[Identification, Identification]
    """Geometric, and extended by the levels reached, or by the usual ones where none is."""
    starts: tuple[RobotModel, RobotModel]
    """Models from which their fits started."""
    climb: Climb
    """How the levels were chosen."""
    log_evidence: float
    """Log evidence against geometry alone of the levels reached; if none is, of the best level that
    a climb can begin with."""
    sentence: str
    """What was chosen and why."""

    def __repr__(self) -> str:
        return f"ModelChoice({self.sentence})"

    def tables(self) -> dict[str, ResultTable]:
        """``levels`` that were offered; ``numbers`` of the chosen model."""
        return {**self.climb.tables(), **self.identification.tables()}

    @property
    def identification(self) -> Identification:
        """The identification of the model chosen."""
        return self.identifications[self.chosen == "extended"]


@checked_kinds
def choose(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters | None = None,
    *,
    prior: Prior | None = None,
    own_prior: Prior | None = None,
    ladders: Sequence[Ladder] | None = None,
    loss: Loss = "squared",
    report: Callable[[int, float], None] | None = None,
    mounted: Chain | None = None,
    known: RowTerms = NOTHING_KNOWN,
    rng: np.random.Generator | None = None,
) -> ModelChoice:
    """Choose a model by evidence, and identify both it and the geometry from all measurements.

    The evidence rewards a better fit and penalizes freedom: an unneeded term costs about
    ln(prior sd / posterior sd). Errors that no model explains can mislead it, so cross-validation
    has to confirm it.

    Parameters
    ----------
    nominal : RobotModel
        Start of all fits.
    measurements : Measurements
        Training rows, from which the models are identified.
    parameters : Parameters, optional
        Which numbers of `nominal` are free; all by default.
    prior : Prior, optional
        Prior of all free numbers, the same in every model; `weak_prior(parameters)` by default.
    own_prior : Prior, optional
        Prior of the geometry in the extended fit itself, if not `prior`: without those numbers of
        which nothing but their start is known.
    ladders : sequence of Ladder, optional
        Levels on offer; by default `ladders_of(nominal, mounted)` and those of the conditions that
        the rows state.
    loss : {"squared", "huber", "cauchy"}
        As in `identify`; a robust one keeps gross errors from calling for more terms.
    report : callable, optional
        As in `identify`, of all fits one after the other.
    mounted : Chain, optional
        The arm in an upright world, if that of `nominal` is another one; see `extended_model`.
    known : RowTerms, optional
        Facts that terms of operating conditions need.
    rng : Generator, optional
        Draws the folds, and a sample of very many poses; seed 0 by default.

    Raises
    ------
    InputError
        A3: a free number has no prior.
    """
    parameters = parameters_of(nominal) if parameters is None else parameters
    prior = weak_prior(parameters, nominal) if prior is None else prior
    if ladders is None:
        payload = measurements.conditions.usual_payload
        own = ladders_of(nominal, mounted, payload=payload)
        ladders = (*own, *row_ladders(nominal, measurements, known))
    rng = np.random.default_rng(0) if rng is None else rng
    asked = some_poses(measurements, rng)
    geometric = identify(nominal, measurements, parameters, prior=prior, loss=loss, report=report)
    found = climb(
        nominal, geometric.model, asked, parameters, ladders,
        parts_of(asked, rng), prior=prior, loss=loss,
    )  # fmt: skip
    extended = extended_by(
        nominal, measurements, parameters, levels_shown(found, ladders),
        prior=prior if own_prior is None else own_prior,
        factor=found.noise_factor, loss=loss, report=report,
        start=found.near if found.taken else None,
    )  # fmt: skip
    return choice_of(nominal, geometric, extended, found)


def levels_shown(found: Climb, ladders: Sequence[Ladder]) -> tuple[Level, ...]:
    """The levels that a climb took, or the usual ones where it took none."""
    return found.taken or tuple(
        next((level for level in ladder.levels if level.usual), ladder.levels[-1])
        for ladder in ladders
    )


def choice_of(
    nominal: RobotModel,
    geometric: Identification,
    extended: tuple[RobotModel, Identification],
    found: Climb,
) -> ModelChoice:
    """The choice after a climb, with the fit of the geometry and the result of `extended_by`."""
    return ModelChoice(
        chosen="extended" if found.taken else "geometric",
        identifications=(geometric, extended[1]),
        starts=(nominal, extended[0]),
        climb=found,
        log_evidence=found.gain if found.taken else found.best[1] if found.best else float("nan"),
        sentence=reason_of(found, nominal).sentence,
    )


def extended_by(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    levels: Sequence[Level],
    *,
    prior: Prior,
    factor: float = 1.0,
    loss: Loss = "squared",
    report: Callable[[int, float], None] | None = None,
    start: RobotModel | None = None,
) -> tuple[RobotModel, Identification]:
    """The model with some levels of joint errors added, and its identification.

    If the noise is larger than stated, the prior is weighed against the actual noise; otherwise
    noise would overrule it.

    Parameters
    ----------
    nominal, measurements, parameters, prior, loss, report
        As in `choose`.
    levels : sequence of Level
        Levels to add.
    factor : float
        Actual noise in units of the stated one.
    start : RobotModel, optional
        As in `identify`, with the same levels.
    """
    added = joined(levels)
    wide = with_errors(nominal, added)
    table = extended_parameters(nominal, wide, parameters) if added.names else parameters
    belief = prior.joined(prior_of(levels)) if added.names else prior
    found = under_noise(
        wide, measurements, table, belief, factor, loss=loss, report=report, start=start
    )
    return wide, found


def reason_of(found: Climb, nominal: RobotModel) -> Reason:
    """What was chosen and why; `nominal` may have joint errors of its own."""
    known = bool(nominal.joint_errors.terms) or nominal.joint_errors.springs is not None
    if found.taken:
        names = " and ".join(level.name for level in found.taken)
        text = f"the measurements support it (log evidence {found.gain:+.1f})"
        if found.confirmed:
            text += f", and {_misses(found, found.before, found.after)} with it"
        return Reason("extended", f" by {names}", text)
    if refused := [step for step in found.steps if not step.taken]:
        step = refused[0]
        why = (
            f"but {_misses(found, step.before, step.after)} with it"
            if found.confirmed
            else f"but fewer than {FOLDS * FEWEST_TO_CONFIRM} poses cannot confirm any"
        )
        text = f"the measurements support {step.level} (log evidence {step.gain:+.1f}), {why}"
        return Reason("geometric", "", text)
    if found.best is None:
        held = "others than those that the robot has already" if known else "terms to add"
        return Reason("geometric", "", f"no joint of this robot has {held}")
    more = " beyond the robot's own" if known else ""
    text = (
        f"the measurements do not support joint errors{more} (log evidence "
        f"{found.best[1]:+.1f} at best, for {found.best[0]})"
    )
    return Reason("geometric", "", text)


def _misses(found: Climb, before: float, after: float) -> str:
    return (
        f"at {found.poses} training poses, left out in turn, the mean error changes from "
        f"{1e3 * before:.4f} mm to {1e3 * after:.4f} mm"
    )


def identify_extended(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    *,
    loss: Loss = "squared",
    mounted: Chain | None = None,
    links: Prior | None = None,
) -> Identification:
    """Identify the geometry without a prior, with the usual joint terms under the weak prior.

    `links` is a prior of the geometry for data that show too little of it. If the residuals are
    larger than the stated noise, the priors are weighed against the noise that they show.
    """
    wide, table, added = with_joint_terms(nominal, parameters, mounted)
    terms = weak_prior(added, wide)
    terms = terms if links is None else links.joined(terms)
    result = identify(wide, measurements, table, prior=terms, loss=loss)
    factor = noise_factor(result.model, measurements)
    if factor <= HONEST:
        return result
    return under_noise(wide, measurements, table, terms, factor, loss=loss)
