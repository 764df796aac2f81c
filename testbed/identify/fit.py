"""The fits of a calibration, geometric and extended, and which of them is handed out."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification, identify
from calib.identification.joint_models import ASKED, choose, extended_model, extended_parameters
from calib.identification.prior import Prior, weak_prior
from calib.identification.robust import Loss
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from testbed.identify.outliers import HONEST, noise_factor
from testbed.identify.records import Choice, ModelName
from testbed.identify.split import groups
from testbed.streams import stream
from testbed.units import MM

MODELS = ("geometric", "extended", "choose")
FOLDS = 4
"""Parts of the training poses that are left out in turn to confirm a choice."""
FEWEST_TO_CONFIRM = 5
"""Poses in each part."""
TRIMMED = 0.95
"""Part of the misses, the smaller ones, that counts for the confirmation."""
MANY = 400
"""Of more training poses this many are asked for the evidence, and one part confirms."""
WIDE = 10.0
"""How many times wider than usual frames may lie from their start while models compete."""


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """What was identified."""

    identifications: tuple[tuple[ModelName, Identification], ...]
    choice: Choice


def fit(
    start: RobotModel,
    train: Measurements,
    parameters: Parameters,
    *,
    model: str,
    loss: Loss,
    seed: int,
    plain: Identification | None = None,
    mounted: Chain | None = None,
) -> Fits:
    """Identify as asked; with "choose" both models, and one of them chosen within the training.

    The geometric fit knows no prior: what the data cannot tell apart is left nominal. The extended
    one has the weak prior on its joint terms alone. `plain` is the geometric one, if it is there
    already; `mounted` the arm as it stands, see `extended_model`.
    """
    nothing = frozen(())
    if model == "geometric":
        found = plain or identify(start, train, parameters, loss=loss)
        choice = Choice("geometric", model, float("nan"), nothing, "geometric, as asked for")
        return Fits((("geometric", found),), choice)
    wide = extended_model(start, mounted)
    if len(wide.names) == len(start.names):
        if model == "extended":
            extended_parameters(start, wide, parameters)  # says that there is no term to add
        found = plain or identify(start, train, parameters, loss=loss)
        said = "geometric: no joint of this robot has terms to add"
        return Fits(
            (("geometric", found),), Choice("geometric", model, float("nan"), nothing, said)
        )
    found = plain or identify(start, train, parameters, loss=loss)
    extended = fit_extended(start, train, parameters, loss, mounted)
    both: tuple[tuple[ModelName, Identification], ...] = (
        ("geometric", found),
        ("extended", extended),
    )
    if model == "extended":
        choice = Choice("extended", model, float("nan"), nothing, "extended, as asked for")
        return Fits(both, choice)
    factor = max(1.0, noise_factor(extended.model, train))
    chosen = choose_within(
        start, train, parameters, factor=factor, loss=loss, seed=seed, mounted=mounted
    )
    return Fits(both, chosen)


def fit_extended(
    start: RobotModel,
    train: Measurements,
    parameters: Parameters,
    loss: Loss,
    mounted: Chain | None = None,
) -> Identification:
    """Geometry as the data tell it, joint terms under the weak prior.

    Where the residuals stay larger than the stated noise, the prior is weighed against the noise
    that they have: else it would be overruled by what is no information.
    """
    wide = extended_model(start, mounted)
    table = extended_parameters(start, wide, parameters)
    terms = weak_prior(table.freeing(set(wide.names) - set(start.names)))
    found = identify(wide, train, table, prior=terms, loss=loss)
    factor = noise_factor(found.model, train)
    if factor <= HONEST:
        return found
    tighter = Prior(terms.mean, terms.sd / factor, terms.names)
    return identify(wide, train, table, prior=tighter, loss=loss)


def choose_within(
    start: RobotModel,
    train: Measurements,
    parameters: Parameters,
    *,
    factor: float,
    loss: Loss,
    seed: int,
    mounted: Chain | None = None,
) -> Choice:
    """Evidence asks, and training poses left out in turn confirm; held-out poses stay untouched.

    With too few poses to confirm, geometry it is: evidence alone is fooled by what neither model
    explains.

    Parameters
    ----------
    start : RobotModel
        Where fits begin.
    train : Measurements
        Rows to identify from.
    parameters : Parameters
        Of `start`.
    factor : float
        How much larger the noise is than stated.
    loss : str
        As in `identify`.
    seed : int
        Of the draw of poses left out.
    mounted : Chain, optional
        The arm as it stands; see `extended_model`.
    """
    honest = some_poses(train, MANY, seed)
    if factor > HONEST:
        honest = replace(honest, covariance=honest.covariance * factor**2)
    found = choose(
        start, honest, parameters, prior=_wide_prior(parameters), loss=loss, mounted=mounted
    )
    asks = found.log_evidence > ASKED
    said = (
        f"the measurements {'ask' if asks else 'do not ask'} for joint errors (log evidence "
        f"{found.log_evidence:+.0f})"
    )
    error = confirmation(start, train, parameters, loss=loss, seed=seed, mounted=mounted)
    if not len(error):
        said += f"; fewer than {FOLDS * FEWEST_TO_CONFIRM} training poses cannot confirm any"
        return Choice("geometric", "choose", found.log_evidence, error, f"geometric: {said}")
    name: ModelName = "extended" if asks and error[1] < error[0] else "geometric"
    text = (
        f"{name}: {said}, {'and' if asks == (name == 'extended') else 'but'} at training poses "
        f"left out in turn the mean miss of the best 95 % goes from {error[0] * MM:.4f} mm to "
        f"{error[1] * MM:.4f} mm with them"
    )
    return Choice(name, "choose", found.log_evidence, error, text)


def confirmation(
    start: RobotModel,
    train: Measurements,
    parameters: Parameters,
    *,
    loss: Loss,
    seed: int,
    mounted: Chain | None = None,
) -> Array:
    """Trimmed mean miss (2,) of both models, geometric first, at training poses left out [m].

    Each pose is left out once; of many poses one part is enough. Empty if there are too few.
    """
    pose = groups(train)
    count = int(pose.max()) + 1
    if count < FOLDS * FEWEST_TO_CONFIRM:
        return frozen(())
    fold = stream(seed, "confirm").permutation(count) % FOLDS
    missed: list[list[Array]] = [[], []]
    for k in range(1 if count > MANY else FOLDS):
        out = fold[pose] == k
        inner, apart = train.rows(~out), train.rows(out)
        geometric = identify(start, inner, parameters, loss=loss)
        extended = fit_extended(start, inner, parameters, loss, mounted)
        for place, one in enumerate((geometric, extended)):
            missed[place].append(predict(one.model, apart).misses)
    return frozen([_trimmed(np.concatenate(parts)) for parts in missed])


def _trimmed(missed: Array) -> float:
    """Mean without the largest twentieth: a number that rests on one pose may miss that by all."""
    kept = np.sort(missed)[: int(np.ceil(TRIMMED * len(missed)))]
    return float(kept.mean())


def some_poses(train: Measurements, most: int, seed: int) -> Measurements:
    """The rows of at most so many poses, drawn at random."""
    pose = np.unique(train.q, axis=0, return_inverse=True)[1].ravel()
    count = int(pose.max()) + 1
    if count <= most:
        return train
    return train.rows(np.isin(pose, stream(seed, "evidence").permutation(count)[:most]))


def checked_model(model: str) -> str:
    """The name of a model, if it is one."""
    if model not in MODELS:
        raise InputError(
            f'--model is "{model}"', code="C41", field="--model", value=model,
            allowed=", ".join(MODELS),
        )  # fmt: skip
    return model


def _wide_prior(parameters: Parameters) -> Prior:
    """The weak prior, wide for frames: their start knows nothing of the links' true lengths."""
    prior = weak_prior(parameters)
    frames = np.array(["." in name for name in prior.names])
    return Prior(prior.mean, np.where(frames, WIDE * prior.sd, prior.sd), prior.names)
