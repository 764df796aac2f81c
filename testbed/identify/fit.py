"""The fits of a calibration with their errors, and which is handed out."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.errors import refuse
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification, identify
from calib.identification.joint_models import extended_model, extended_parameters
from calib.identification.ladders import ladders_of
from calib.identification.larger_noise import HONEST, noise_factor, under_noise
from calib.identification.levels import Ladder
from calib.identification.model_choice import choose, extended_by, identify_extended
from calib.identification.prior import Prior, own_prior, prior_rows, weak_prior
from calib.identification.robust import Loss
from calib.identification.row_ladders import NOTHING_KNOWN, RowTerms, row_ladders
from calib.identification.tangent import covariance_factor
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize
from calib.uncertainty.statement.stops import judged_by_stops
from testbed.files.session_toml import FRAMES_ALONE
from testbed.identify.errors import figures_of, row_errors
from testbed.identify.frames import astray, frames_prior, is_frame, wide_prior
from testbed.identify.records import Choice, FittedModel, ModelName
from testbed.robots.robot import Robot
from testbed.streams import stream
from testbed.units import DEG, MM, either, significant, unit_of

MODELS = ("geometric", "extended", "choose")
Fitted = tuple[ModelName, RobotModel, Identification]
"""A model, where its fit began, and what was identified of it."""


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
    known: RowTerms = NOTHING_KNOWN,
    links: Prior | None = None,
    held: bool = False,
    ladders: Sequence[Ladder] | None = None,
) -> tuple[tuple[Fitted, ...], Choice]:
    """Identify as asked; with "choose" two models, and one of them chosen within the training.

    The geometric fit knows no prior of links: what the data cannot tell apart is left nominal;
    unless the links must be `held`. Joint errors have the weak prior wherever they are: those that
    the robot has already, and those of a model that is extended; a chosen one has it on its links,
    too: `links`, or the usual one. `plain` is the geometric one, if it is there already; `mounted`
    the arm as it stands, see `extended_model`; `known` what the session says of its rows, `ladders`
    what else "choose" offers.
    """
    own = own_prior(parameters, start)
    if links is not None:
        links = links if own is None else links.joined(own)
    elif names := [name for name in parameters.free_names if not is_frame(name)]:
        links = weak_prior(parameters.freeing(names), start)
    if model == "extended":  # refuses a robot without a term to add
        extended_parameters(start, extended_model(start, mounted), parameters)
    geometric = plain or plain_fit(start, train, parameters, loss)
    if held and links is not None:
        factor = factor if (factor := noise_factor(geometric.model, train)) > HONEST else 1.0
        geometric = under_noise(start, train, parameters, links, factor, loss=loss)
    wide = wide_prior(parameters, start, links)
    geometric, near = _near_start(geometric, start, train, parameters, wide, loss)
    first: Fitted = ("geometric", start, geometric)
    if model == "geometric":
        return (first,), _unasked("geometric", model, f"geometric, as requested{near}")
    if model == FRAMES_ALONE:
        sentence = (
            'base, tool and fixtures alone, as free = "frames" asks: links and joint terms are '
            f"those of the robot's file{near}"
        )
        return (first,), _unasked("geometric", model, sentence)
    if model == "extended":
        usual = links if held else own

        def requested(prior: Prior | None) -> Identification:
            return identify_extended(
                start, train, parameters, loss=loss, mounted=mounted, links=prior
            )

        extended, held_words = _held_frames(
            requested(usual), start, geometric, wide,
            lambda frames: requested(frames if usual is None else usual.joined(frames)),
        )  # fmt: skip
        choice = _unasked("extended", model, f"extended, as requested{held_words or near}")
        return (first, ("extended", extended_model(start, mounted), extended)), choice
    found = choose(
        start, train, parameters, prior=wide, own_prior=links, loss=loss, mounted=mounted,
        ladders=None if ladders is None else (*ladders, *row_ladders(start, train, known)),
        known=known, rng=stream(seed, "confirm"),
    )  # fmt: skip
    climbed, extended, held_words = found.climb, found.identifications[1], ""
    if climbed.taken:
        extended, held_words = _held_frames(
            extended, start, geometric, wide,
            lambda frames: extended_by(
                start, train, parameters, climbed.taken, loss=loss, start=climbed.near,
                prior=frames if links is None else links.joined(frames),
                factor=climbed.noise_factor,
            )[1],
        )  # fmt: skip
    choice = Choice(
        found.chosen, model, found.log_evidence,
        frozen([climbed.before, climbed.after] if climbed.confirmed else []),
        found.sentence + (held_words or near), climbed.steps, climbed.offered,
    )  # fmt: skip
    if climbed.best is None:
        return (first,), choice
    return (first, ("extended", found.starts[1], extended)), choice


def _held_frames(
    extended: Identification,
    start: RobotModel,
    geometric: Identification,
    wide: Prior,
    again: Callable[[Prior], Identification],
) -> tuple[Identification, str]:
    """An extended fit; if its frames went astray, `again`, under a prior that holds them; words.

    Where poses do not tell how far the target is from the flange, joint errors that are believed to
    be small do as much as they like at a target that is far enough away.
    """
    off, far = astray(start, geometric.model, extended.model, wide)
    if not off:
        return extended, ""
    said = _untold(off, far, "joint errors", "where geometry alone has it")
    return again(frames_prior(wide)), said


def _near_start(
    fit: Identification,
    start: RobotModel,
    train: Measurements,
    parameters: Parameters,
    wide: Prior,
    loss: Loss,
) -> tuple[Identification, str]:
    """A geometric fit; if its frames went astray, again, under a prior that holds them; words.

    Along what poses do not tell, noise decides where it ends, and whether it does.
    """
    off, far = astray(start, start, fit.model, wide)
    if not off:
        return fit, ""
    factor, prior = noise_factor(fit.model, train), frames_prior(wide)
    if fit.prior is not None:
        factor, prior = fit.tightened**0.5, fit.prior.weighed(1 / fit.tightened).joined(prior)
    factor = factor if factor > HONEST else 1.0
    found = under_noise(start, train, parameters, prior, factor, loss=loss)
    return found, _untold(off, far, "the fit", "its start")


def _untold(name: str, far: float, by: str, where: str) -> str:
    """That poses do not tell a number of base or tool, which was carried so far off [m, rad]."""
    turns = name.rpartition(".")[2].startswith("r")
    size = f"{significant(far * (DEG if turns else MM))} {unit_of(not turns)}"
    return (
        f"; these poses do not tell {name}, which {by} carried {size} away from {where}: base and "
        "tool are held near their start; turn the tool about more axes"
    )


def _unasked(chosen: ModelName, asked: str, sentence: str) -> Choice:
    """A choice that no measurement was asked for."""
    return Choice(chosen, asked, float("nan"), frozen(()), sentence, (), ())


def checked_model(model: str) -> str:
    """The name of a model, if it is one."""
    if model not in MODELS:
        allowed = f"it takes {either(MODELS)}"
        raise refuse("--model", model, allowed, code="C41", message=f'--model is "{model}"')
    return model


def frames_model(asked: str | None) -> str:
    """The model of a fit of frames alone: that of the robot, whatever terms it has.

    Raises
    ------
    InputError
        C41: another one is asked for.
    """
    if asked not in (None, "geometric"):
        raise refuse(
            "--model", asked, code="C41",
            message=f'--model is "{asked}", and [identification] free = "frames" fits base, tool '
            "and fixtures alone",
            allowed="the model that the robot's file has", fix="leave --model out",
        )  # fmt: skip
    return FRAMES_ALONE


def plain_fit(
    start: RobotModel, train: Measurements, parameters: Parameters, loss: Loss = "squared"
) -> Identification:
    """The fit of geometry; joint errors that the robot has already stay near what they were.

    As in `identify_extended` their prior is weighed against the noise that the residuals have.
    """
    own = own_prior(parameters, start)
    found = identify(start, train, parameters, prior=own, loss=loss)
    if own is None or (factor := noise_factor(found.model, train)) <= HONEST:
        return found
    return under_noise(start, train, parameters, own, factor, loss=loss)


@lru_cache(maxsize=2)
def bends_of(
    start: RobotModel, robot: Robot, payload: tuple[float, ...] | None
) -> tuple[Ladder, ...]:
    """Ladders of what bends an arm, for which several looks at one session ask.

    `payload` are the mean moments of what rows state to hang on it [kg, kg m].
    """
    carried = None if payload is None else np.array(payload)
    stands, limits = robot.model.chain, robot.limits
    return ladders_of(start, stands, moments=robot.moments, limits=limits, payload=carried)


def fitted_model(
    name: ModelName,
    identification: Identification,
    start: RobotModel,
    measurements: Measurements,
    used: Bool,
    is_test: Bool,
    root: Array,
) -> FittedModel:
    """One identification from `start` with its errors at the rows used and held out.

    `root` (m, 6, n) is that of the noise which all rows of one stop share, see `scatter_root`.
    """
    train = measurements.rows(used)
    identification = judged_by_stops(identification, train, root[used])
    errors = row_errors(identification.model, measurements)
    factor = noise_factor(identification.model, train)
    return FittedModel(
        model=name,
        identification=identification,
        scatter=scatter_covariance(start, identification, train, factor),
        noise_factor=factor,
        misses=errors,
        train=figures_of(errors, measurements, used),
        test=figures_of(errors, measurements, is_test) if is_test.any() else None,
    )


def scatter_covariance(
    nominal: RobotModel, result: Identification, measurements: Measurements, factor: float
) -> Array:
    """Covariance (f, f) of an estimate from how its residuals scatter from pose to pose.

    It needs no stated noise, but poses drawn at random from where the robot works: what the model
    leaves out then counts as scatter. With fewer poses than numbers it is too small. What a prior
    holds is as uncertain as the prior is.

    Parameters
    ----------
    nominal : RobotModel
        Where the fit began.
    result : Identification
        Of the default estimator.
    measurements : Measurements
        What it was identified from.
    factor : float
        How many times the stated noise there is: by so much the prior was tightened, at least.

    References
    ----------
    White 1980, clustered by pose: inv(H) (sum_j A_j'r_j r_j'A_j m/(m - 1) n/dof + Lambda0') inv(H),
    Lambda0' = factor^2 Lambda0 what the prior pulls with.
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
    m, n = len(pull), len(A)
    held = max(1.0, factor) * rows @ root @ root.T
    return frozen(moved.T @ moved * (m / max(m - 1, 1)) * (n / max(result.dof, 1)) + held.T @ held)
