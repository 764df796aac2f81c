"""Whether base and tool stand where the robot's file holds them, where the session says so."""

import numpy as np

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.frames import inverse, log_so3
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.information.sizes import FRAMES
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from testbed.files.session import Session
from testbed.files.session_toml import FRAMES_ALONE
from testbed.identify.frames import fitted_frames
from testbed.units import DEG, millimetres, significant

PLAINLY = 3.0
"""So many times less do nominal links miss with frames fitted, if it is the frames that are wrong.
Links as wrong as the frames are leave a factor of 1.4."""
OFF, TURNED = 1e-3, 1e-3
"""A frame that is nearer to where it is stated is not named [m, rad]."""


def stated_frame_words(
    session: Session, before: RobotModel, train: Measurements
) -> tuple[str, ...]:
    """That a held frame seems to be elsewhere, since links are then moved to make up for it.

    Parameters
    ----------
    session : Session
        Which frames are held.
    before : RobotModel
        Nominal links; frames fitted as far as they are free.
    train : Measurements
        Rows that identify.
    """
    held = [
        name
        for name, how in (("base", session.wanted.base), ("tool", session.wanted.tool))
        if how == "fixed"
    ]
    if not held or session.visits or train.is_distance.any():
        return ()
    table = parameters_of(before)
    own = {name for name in table.names if name.startswith(FRAMES)}
    try:
        fitted = fitted_frames(before, train, table.freeing(own - set(session.fixed)))
    except InputError:  # too few rows to tell
        return ()
    stated_left, left = _missed(before, train), _missed(fitted, train)
    if stated_left <= PLAINLY * left:
        return ()
    poses = bool(train.is_pose.all())  # points do not show how a tool is turned
    found = {"base": fitted.chain.T_world_base, "tool": fitted.chain.T_flange_tool}
    places = {"base": before.chain.T_world_base, "tool": before.chain.T_flange_tool}
    said = [
        f"{name} about {how}"
        for name in held
        if (how := _moved(inverse(places[name]) @ found[name], name == "base" or poses))
    ]
    if not said:
        return ()
    many = len(held) > 1
    free = " and ".join(f'{name} = "free"' for name in held)
    if session.wanted.free == FRAMES_ALONE:
        goes = "nothing makes up for it, because links are not identified"
    else:
        goes = "links make up for it, and corrected programs are moved by as much"
    return (
        f"with nominal links and {' and '.join(held)} as the robot's file has "
        f"{'them' if many else 'it'}, the readings miss the robot by "
        f"{millimetres(stated_left, 2)} mm, but only by {millimetres(left, 2)} mm with "
        f"the {' and the '.join(said)} elsewhere: if that is so, correct robot.toml, or write "
        f"{free} under [identification]; as it is, {goes}",
    )


def _missed(model: RobotModel, train: Measurements) -> float:
    """Root mean square error of positions [m]."""
    return float(np.sqrt(np.mean(predict(model, train).misses ** 2)))


def _moved(T: Array, turns: bool) -> str:
    """How far a frame is from where it is stated; empty if it is there."""
    far, turned = float(np.linalg.norm(T[:3, 3])), float(np.linalg.norm(log_so3(T[:3, :3])))
    parts = [f"{millimetres(far, 2)} mm"] if far > OFF else []
    if turns and turned > TURNED:
        parts.append(f"{significant(turned * DEG, 2)} deg")
    return " and ".join(parts)
