"""The fits of a calibration with their errors, by row and in figures; which is handed out."""

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.errors import refuse
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification, identify
from calib.identification.joint_models import extended_model, extended_parameters
from calib.identification.model_choice import ASKED, choose, identify_extended, left_out_errors
from calib.identification.outlier_search import noise_factor, with_noise
from calib.identification.prior import Prior, prior_rows, weak_prior
from calib.identification.robust import Loss
from calib.identification.tangent import covariance_factor
from calib.measurement.accuracy import error_statistics
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import linearize
from testbed.identify.records import Choice, Figures, FittedModel, ModelName, RowErrors
from testbed.identify.session import groups
from testbed.streams import stream
from testbed.units import MM

MODELS = ("geometric", "extended", "choose")
Pair = tuple[ModelName, Identification]
"""A model and what was identified of it."""
FOLDS = 4
"""Parts of the training poses that are left out in turn to confirm a choice."""
FEWEST_TO_CONFIRM = 5
"""Poses in each part."""
MANY = 400
"""Of more training poses this many are asked for the evidence, and one part confirms."""
WIDE = 10.0
"""How many times wider than usual frames may lie from their start while models compete."""


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
) -> tuple[tuple[Pair, ...], Choice]:
    """Identify as asked; with "choose" both models, and one of them chosen within the training.

    The geometric fit knows no prior: what the data cannot tell apart is left nominal. The extended
    one has the weak prior on its joint terms alone. `plain` is the geometric one, if it is there
    already; `mounted` the arm as it stands, see `extended_model`.
    """
    wide = extended_model(start, mounted)
    if model == "extended":
        extended_parameters(start, wide, parameters)  # refuses a robot without a term to add
    geometric = plain or identify(start, train, parameters, loss=loss)
    only = ""
    if model == "geometric":
        only = "geometric, as asked for"
    elif len(wide.names) == len(start.names):
        only = "geometric: no joint of this robot has terms to add"
    if only:
        return (("geometric", geometric),), _unasked("geometric", model, only)
    extended = identify_extended(start, train, parameters, loss=loss, mounted=mounted)
    both: tuple[Pair, ...] = (("geometric", geometric), ("extended", extended))
    if model == "extended":
        return both, _unasked("extended", model, "extended, as asked for")
    factor = noise_factor(extended.model, train)
    choice = choose_within(
        start, train, parameters, factor=factor, loss=loss, seed=seed, mounted=mounted
    )
    return both, choice


def _unasked(chosen: ModelName, asked: str, sentence: str) -> Choice:
    """A choice that no measurement was asked for."""
    return Choice(chosen, asked, float("nan"), frozen(()), sentence)


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

    Each pose is left out once; of many poses one part is enough. With too few poses to confirm,
    geometry it is: evidence alone is fooled by what neither model explains.

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
    evidence = choose(
        start,
        with_noise(some_poses(train, MANY, seed), factor),
        parameters,
        prior=_wide_prior(parameters),
        loss=loss,
        mounted=mounted,
    ).log_evidence
    asks = evidence > ASKED
    reason = (
        f"the measurements {'ask' if asks else 'do not ask'} for joint errors (log evidence "
        f"{evidence:+.0f})"
    )
    pose = groups(train)
    count, needed = int(pose.max()) + 1, FOLDS * FEWEST_TO_CONFIRM
    if count < needed:
        text = f"geometric: {reason}; fewer than {needed} training poses cannot confirm any"
        return Choice("geometric", "choose", evidence, frozen(()), text)
    fold = stream(seed, "confirm").permutation(count) % FOLDS
    rounds = 1 if count > MANY else FOLDS
    error = left_out_errors(
        start, train, parameters, fold[pose], rounds=rounds, loss=loss, mounted=mounted
    )
    name: ModelName = "extended" if asks and error[1] < error[0] else "geometric"
    text = (
        f"{name}: {reason}, {'and' if asks == (name == 'extended') else 'but'} at training poses "
        f"left out in turn the mean miss of the best 95 % goes from {error[0] * MM:.4f} mm to "
        f"{error[1] * MM:.4f} mm with them"
    )
    return Choice(name, "choose", evidence, error, text)


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
        raise refuse(
            "--model", model, ", ".join(MODELS), code="C41", message=f'--model is "{model}"'
        )
    return model


def _wide_prior(parameters: Parameters) -> Prior:
    """The weak prior, wide for frames: their start knows nothing of the links' true lengths."""
    prior = weak_prior(parameters)
    frames = np.array(["." in name for name in prior.names])
    return Prior(prior.mean, np.where(frames, WIDE * prior.sd, prior.sd), prior.names)


def row_errors(model: RobotModel, measurements: Measurements) -> RowErrors:
    """Errors of `model` in every row."""
    seen = predict(model, measurements)
    vector = seen.residual[:, :3].copy()
    vector[measurements.is_distance] = 0.0
    turn = model.fixtures.station_frames[measurements.station][:, :3, :3]
    return RowErrors(
        frozen((turn @ vector[:, :, None])[:, :, 0]), frozen(seen.misses), frozen(seen.turns)
    )


def figures_of(errors: RowErrors, measurements: Measurements, rows: Bool) -> Figures:
    """Statistics over some rows (m,), one or more."""
    pose = rows & measurements.is_pose
    return Figures(
        position=error_statistics(errors.position[rows]),
        rotation=error_statistics(errors.rotation[pose]) if pose.any() else None,
        median=float(np.median(errors.position[rows])),
    )


def fitted_model(
    name: ModelName,
    identification: Identification,
    start: RobotModel,
    measurements: Measurements,
    used: Bool,
    is_test: Bool,
) -> FittedModel:
    """One identification from `start` with its errors at the rows used and held out."""
    train = measurements.rows(used)
    errors = row_errors(identification.model, measurements)
    return FittedModel(
        model=name,
        identification=identification,
        scatter=scatter_covariance(start, identification, train),
        noise_factor=noise_factor(identification.model, train),
        misses=errors,
        train=figures_of(errors, measurements, used),
        test=figures_of(errors, measurements, is_test) if is_test.any() else None,
    )


def scatter_covariance(
    nominal: RobotModel, result: Identification, measurements: Measurements
) -> Array:
    """Covariance (f, f) of an estimate from how its residuals scatter from pose to pose.

    It needs no stated noise, but poses drawn at random from where the robot works: what the model
    leaves out then counts as scatter. With fewer poses than numbers it is too small.

    Parameters
    ----------
    nominal : RobotModel
        Where the fit began.
    result : Identification
        Of the default estimator.
    measurements : Measurements
        What it was identified from.

    References
    ----------
    White 1980, clustered by pose: inv(H) (sum_j A_j'r_j r_j'A_j) inv(H) m/(m - 1) n/(n - f).
    """
    stack = linearize(result.model, measurements)
    columns = result.parameters.free_index
    A, rows = stack.A[:, columns], np.zeros((0, len(columns)))
    if result.prior is not None:
        rows = prior_rows(result.prior, nominal, result.parameters).at(result.model)[1][:, columns]
    weight = result.weights[stack.row_of] if result.loss != "squared" else np.ones(len(A))
    root = covariance_factor(np.concatenate([np.sqrt(weight)[:, None] * A, rows]))
    _, pose = np.unique(measurements.pose_id, return_inverse=True)
    pull = np.zeros((int(pose.max()) + 1, len(columns)))
    np.add.at(pull, pose.ravel()[stack.row_of], (weight * stack.r)[:, None] * A)
    moved = pull @ root @ root.T
    m, n, f = len(pull), len(A), len(columns)
    return frozen(moved.T @ moved * (m / max(m - 1, 1)) * (n / max(n - f, 1)))
