"""Geometry alone, or joint errors as well: which of them the measurements ask for, and both fits.

The one choice of a model, wherever one is chosen: by evidence, confirmed on training poses left out
in turn. Held-out poses have no say in it: they would no longer be a test.
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
from calib.identification.result import Identification
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
    """Where their fits began."""
    climb: Climb
    log_evidence: float
    """Natural logarithm of the odds that the measurements give the levels reached; where none is,
    the best of those with which a climb can begin."""
    sentence: str
    """What was chosen and why."""

    def __repr__(self) -> str:
        return f"ModelChoice({self.sentence})"

    def tables(self) -> dict[str, ResultTable]:
        """``levels`` that were offered; ``numbers`` of the chosen model."""
        return {**self.climb.tables(), **self.identification.tables()}

    @property
    def identification(self) -> Identification:
        """The one chosen."""
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
    geometric: Identification | None = None,
) -> ModelChoice:
    """Choose a model by evidence, and identify it from all measurements beside the geometry.

    The evidence rewards a better fit and charges for freedom: terms that the measurements do not
    ask for cost it about ln(prior sd / posterior sd) each. It is fooled by what no model explains:
    poses left out in turn confirm it, or not.

    Parameters
    ----------
    nominal : RobotModel
        Start of all fits.
    measurements : Measurements
        What is identified from.
    parameters : Parameters, optional
        Which numbers of `nominal` are free; all by default.
    prior : Prior, optional
        Of all free numbers, the same in every model; `weak_prior(parameters)` by default.
    own_prior : Prior, optional
        Of the geometry in the extended fit itself, if not `prior`: without numbers of which nothing
        but their start is known.
    ladders : sequence of Ladder, optional
        What is offered; `ladders_of(nominal, mounted)` and what the rows say by default.
    loss : {"squared", "huber", "cauchy"}
        As in `identify`; a robust one keeps gross errors from calling for more terms.
    report : callable, optional
        As in `identify`, of all fits one after the other.
    mounted : Chain, optional
        The arm as it stands, where the world of `nominal` need not be level; see `extended_model`.
    known : RowTerms, optional
        What is known of the rows for terms that follow them.
    rng : Generator, optional
        Draws the poses left out together, and which of very many are asked; seed 0 by default.
    geometric : Identification, optional
        The fit of the geometry under `prior`, if already at hand.

    Raises
    ------
    InputError
        If a free number has no prior.
    """
    parameters = parameters_of(nominal) if parameters is None else parameters
    prior = weak_prior(parameters, nominal) if prior is None else prior
    if ladders is None:
        payload = measurements.conditions.usual_payload
        own = ladders_of(nominal, mounted, payload=payload)
        ladders = (*own, *row_ladders(nominal, measurements, known))
    rng = np.random.default_rng(0) if rng is None else rng
    asked = some_poses(measurements, rng)
    if geometric is None:
        geometric = identify(
            nominal, measurements, parameters, prior=prior, loss=loss, report=report
        )
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
    """The choice after a climb, with the fit of the geometry and what `extended_by` made."""
    return ModelChoice(
        chosen="extended" if found.taken else "geometric",
        identifications=(geometric, extended[1]),
        starts=(nominal, extended[0]),
        climb=found,
        log_evidence=found.gain if found.taken else found.best[1] if found.best else float("nan"),
        sentence=sentence_of(found, nominal),
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
    """The model with some levels of joint errors, before its fit and after.

    Where the noise is larger than stated the prior is weighed against the noise that there is: else
    it would be overruled by what is no information.

    Parameters
    ----------
    nominal, measurements, parameters, prior, loss, report
        As in `choose`.
    levels : sequence of Level
        What is added.
    factor : float
        How many times the stated noise there is.
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


def sentence_of(found: Climb, nominal: RobotModel) -> str:
    """What was chosen and why; `nominal` may have joint errors of its own."""
    known = bool(nominal.joint_errors.terms) or nominal.joint_errors.springs is not None
    if found.taken:
        names = " and ".join(level.name for level in found.taken)
        text = f"extended by {names}: the measurements ask for it (log evidence {found.gain:+.1f})"
        if found.confirmed:
            text += f", and {_misses(found, found.before, found.after)} with it"
        return text
    if refused := [step for step in found.steps if not step.taken]:
        step = refused[0]
        why = (
            f"but {_misses(found, step.before, step.after)} with it"
            if found.confirmed
            else f"but fewer than {FOLDS * FEWEST_TO_CONFIRM} poses cannot confirm any"
        )
        return (
            f"geometric: the measurements ask for {step.level} (log evidence {step.gain:+.1f}), "
            f"{why}"
        )
    if found.best is None:
        held = "others than those that the robot has already" if known else "terms to add"
        return f"geometric: no joint of this robot has {held}"
    more = " beyond the robot's own" if known else ""
    return (
        f"geometric: the measurements do not ask for joint errors{more} (log evidence "
        f"{found.best[1]:+.1f} at best, for {found.best[0]})"
    )


def _misses(found: Climb, before: float, after: float) -> str:
    return (
        f"at {found.poses} training poses, left out in turn, the mean miss goes from "
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
    """Identify geometry as the data show it, and usual joint terms under the weak prior.

    Where the data show too little of it, the geometry has a prior of its own, `links`. Where the
    residuals stay larger than the stated noise, the prior is weighed against the noise that they
    have: else it would be overruled by what is no information.
    """
    wide, table, added = with_joint_terms(nominal, parameters, mounted)
    terms = weak_prior(added, wide)
    terms = terms if links is None else links.joined(terms)
    result = identify(wide, measurements, table, prior=terms, loss=loss)
    factor = noise_factor(result.model, measurements)
    if factor <= HONEST:
        return result
    return under_noise(wide, measurements, table, terms, factor, loss=loss)
