"""Base, tool and fixtures before any link is touched, and which numbers a session frees."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
from calib.geometry.chain import COLUMNS
from calib.geometry.frames import inverse, transform_points
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.identify import identify
from calib.identification.larger_noise import noise_factor, under_noise
from calib.identification.prior import Prior, weak_prior
from calib.identification.start.on_a_line import untold_turns
from calib.identification.start.start import start_frames
from calib.information.sizes import FRAMES
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.tool_target import places_are_found
from testbed.files.read import require_free_set
from testbed.files.session import Session
from testbed.files.session_toml import FRAMES_ALONE
from testbed.identify.visits.frames import require_determined
from testbed.robots.catalog import Robot
from testbed.units import listed

WIDE = 100.0
"""How many times wider than usual frames may lie from their start while models compete."""
ASTRAY = 5.0
"""Of these widths: so far from where geometry alone has them are frames no better explanation."""
AS_GOOD = 3.0
"""Frames of the robot's own file stand if they miss at most so many times what fitted ones do."""


@dataclass(frozen=True, slots=True, eq=False)
class StartFrames:
    """Where the identification starts, and what "before" means."""

    start: RobotModel
    """Nominal links; the frames of the robot's own file where they fit, else from a closed form."""
    before: RobotModel
    """Nominal links; base, tool and fixtures fitted to the training rows, as far as they are
    free."""
    own: bool
    """Whether they start from the robot's file: then the measuring frame is the robot's world."""
    parameters: Parameters
    """Of `start`: what the session frees."""
    sentences: tuple[str, ...]
    untold: tuple[str, ...] = ()
    """What no reading tells of them, whatever the links are."""


def frames_of(robot: Robot, session: Session, train: Measurements) -> StartFrames:
    """Find the frames of a session from its training rows.

    Raises
    ------
    InputError
        Too few rows, an unknown set or name of free numbers, or frames that cannot be found.
    """
    own = replace(robot.model, fixtures=session.fixtures)
    wanted = session.wanted
    if "free" not in (wanted.base, wanted.tool) and not session.fixtures.n_numbers:
        parameters = free_numbers(own, robot, session)
        said = ("base and tool are those of the robot's file, and held there",)
        return StartFrames(own, own, True, parameters, said)
    if session.visits:
        free = free_numbers(own, robot, session).free_names
        require_determined(session, own, train, free)
    start = own
    where = "the robot's file" + ", fixtures from [start]" * bool(session.fixtures.n_numbers)
    fit = "fit" if session.fixtures.n_numbers else "fits"
    sentences: tuple[str, ...] = (f"base and tool start from {where}, which {fit}",)
    if wanted.base == "free" and not _fits(robot, session, own, train):
        free_tool = wanted.tool == "free"
        found = start_frames(own, train, free_tool=free_tool, free_anchors=session.free_anchors)
        start, sentences = found.model, found.notes
    elif session.visits:  # where further stations stand is not in the robot's file
        found = start_frames(own, train, free_tool=wanted.tool == "free")
        start = at_base(found.model, own.chain.T_world_base)
    elif session.free_anchors and not _fits(robot, session, own, train):
        free_tool = wanted.tool == "free"
        found = start_frames(own, train, free_tool=free_tool, free_anchors=session.free_anchors)
        start = at_base(found.model, own.chain.T_world_base, session.free_anchors)
        sentences = found.notes
    parameters, untold = _without_untold(free_numbers(start, robot, session), start, train)
    before = _not_astray(start, fitted_frames(start, train, parameters), train, parameters)
    return StartFrames(start, before, start is own, parameters, sentences, untold)


def _without_untold(
    parameters: Parameters, start: RobotModel, train: Measurements
) -> tuple[Parameters, tuple[str, ...]]:
    """The table without turns that no reading tells, and a sentence on them if there are any."""
    held = [name for name in untold_turns(start, train) if name in parameters.free_names]
    if not held:
        return parameters, ()
    sentence = (
        f"{listed(held)} {'is' if len(held) == 1 else 'are'} held: readings at one place or along "
        "one line do not tell how the arm is turned about it, and nothing is stated of that turn"
    )
    return parameters.freeing(set(parameters.free_names) - {*held}), (sentence,)


def fitted_frames(start: RobotModel, train: Measurements, parameters: Parameters) -> RobotModel:
    """The model with base, tool and fixtures fitted as far as they are free; links as they were."""
    frames = [name for name in parameters.free_names if "." in name and is_frame(name)]
    return identify(start, train, parameters.freeing(frames)).model if frames else start


def wide_prior(parameters: Parameters, start: RobotModel, links: Prior | None = None) -> Prior:
    """The weak prior, wide for frames: their start knows nothing of the links' true lengths."""
    prior = weak_prior(parameters, start)
    own = {} if links is None else dict(zip(links.names, links.sd.tolist(), strict=True))
    sd = [
        own.get(name, WIDE * usual if is_frame(name) else usual)
        for name, usual in zip(prior.names, prior.sd.tolist(), strict=True)
    ]
    return Prior(prior.mean, np.array(sd), prior.names)


def frames_prior(wide: Prior) -> Prior:
    """The part of a wide prior that is of frames."""
    sd = {n: s for n, s in zip(wide.names, wide.sd.tolist(), strict=True) if is_frame(n)}
    return Prior(np.zeros(len(sd)), list(sd.values()), list(sd))


def astray(start: RobotModel, one: RobotModel, other: RobotModel, wide: Prior) -> tuple[str, float]:
    """The number of base or tool in which two fits differ most, and by how much [m, rad].

    Its name is empty where that is less than `ASTRAY` widths of the wide prior.
    """
    step = np.abs(np.subtract(*(start.chain.step_to(end.chain) for end in (one, other)))).tolist()
    far = {name: size for name, size in zip(start.names, step, strict=False) if is_frame(name)}
    sd = {n: s for n, s in zip(wide.names, wide.sd.tolist(), strict=True) if n in far}
    off = max(sd, key=lambda name: far[name] / sd[name], default="")
    return (off, far[off]) if off and far[off] >= ASTRAY * sd[off] else ("", 0.0)


def _not_astray(
    start: RobotModel, before: RobotModel, train: Measurements, parameters: Parameters
) -> RobotModel:
    """Fitted frames; held near their start by the wide prior where the fit carried them far off.

    Where the flange always points the same way, the noise of the readings decides how far the
    target is from it: by some tens of meters, over which joints that scatter would move it.
    """
    wide = wide_prior(parameters, start)
    if not astray(start, start, before, wide)[0]:
        return before
    held, factor = frames_prior(wide), max(1.0, noise_factor(before, train))
    free = parameters.freeing(held.names)
    return under_noise(start, train, free, held, factor).model


def free_numbers(model: RobotModel, robot: Robot, session: Session) -> Parameters:
    """The table of `model` with the numbers free that the session frees."""
    table = parameters_of(model)
    free = session.wanted.free
    require_free_set(free, robot, session.stated_in)
    if isinstance(free, str):
        plain = {"identifiable": table.names, FRAMES_ALONE: ()}
        names = plain[free] if free in plain else tuple(robot.free_sets[free])
    else:
        names = tuple(free)
    try:
        table.freeing(names)  # a name that is not there is refused with its likeliest meaning
    except InputError as error:  # which stands in the session, not in its data
        raise error.located(session.stated_in) from error
    for frame, how in (("base.", session.wanted.base), ("tool.", session.wanted.tool)):
        own = tuple(name for name in table.names if name.startswith(frame))
        rest = tuple(name for name in names if name not in own)
        names = (*rest, *own) if how == "free" else rest
    held = {name for visit in session.visits if visit.held_out for name in visit.numbers}
    if places_are_found(session.measurements):
        # a prior on these would be of where the flange lies beside the targets
        held |= {f"{number}{model.chain.n_joints}" for number in COLUMNS}
    return table.freeing({*names, *model.fixtures.names} - set(session.fixed) - held)


def at_base(model: RobotModel, T_world_base: Array, free_anchors: Sequence[int] = ()) -> RobotModel:
    """A model with its base elsewhere; its stations and free anchors stand to it as before."""
    moved = T_world_base @ inverse(model.chain.T_world_base)
    anchors, free = model.fixtures.anchors.copy(), list(free_anchors)
    anchors[free] = transform_points(moved, anchors[free])
    fixtures = replace(
        model.fixtures, stations=moved @ model.fixtures.stations, anchors=frozen(anchors)
    )
    return replace(model, chain=replace(model.chain, T_world_base=T_world_base), fixtures=fixtures)


def is_frame(name: str) -> bool:
    """Whether a number belongs to base, tool or fixtures, not to a joint term."""
    return name.startswith(FRAMES)


def _fits(robot: Robot, session: Session, own: RobotModel, train: Measurements) -> bool:
    """Whether the frames of the robot's file explain the rows about as well as fitted ones.

    Fixtures need a [start], and are fitted from there: they never are where it has them.
    """
    model, free_tool = own, session.wanted.tool == "free"
    if session.fixtures.n_numbers:
        if not session.placed:
            return False
        model = fitted_frames(own, train, free_numbers(own, robot, session))
    best = start_frames(own, train, free_tool=free_tool, free_anchors=session.free_anchors)
    missed = float(np.sqrt(np.mean(predict(model, train).misses ** 2)))
    return missed <= AS_GOOD * best.position_rms
