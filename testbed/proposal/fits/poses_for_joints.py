"""Six numbers in place of joints that are the pose of the tool as a controller says it."""

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.frames import exp_so3, transform
from testbed.files.alternatives import Interpretation
from testbed.files.frames_fit import FAR, TIMES
from testbed.files.refusal import refusal
from testbed.files.rotations import rotations
from testbed.files.rows.shifts import FEWEST, misfit_of, spread_out
from testbed.proposal.data import Found
from testbed.proposal.sizes import REACH, signed
from testbed.robots.robot import Robot

POSE, PLACE = 6, 3


def poses_for_joints(looks: Sequence[Found], robot: Robot) -> InputError | None:
    """The error where a file without names has poses that explain the places of another one.

    Nothing else explained them. Poses that a controller computed tell of its model alone.
    """
    for one, other in permutations(looks, 2):
        poses, places = _numbers(one, POSE), _numbers(other, PLACE)
        if poses is None or places is None or not FEWEST <= len(poses) == len(places):
            continue
        rows = spread_out(np.arange(len(poses)))
        read = Interpretation(poses[rows], _in_meters(places[rows]), None)
        # places that hardly differ are near whatever is said of them
        spread = float(np.sqrt(read.position.var(axis=0).sum()))
        near = min(FAR, spread / TIMES)
        if any(misfit_of(robot.model, read, F=F).position < near for F in _poses(poses[rows])):
            message = "has where a controller says that the tool is, and no joints"
            fix = "log those with each reading: a controller's own poses calibrate nothing"
            return refusal(
                one.called, "joints", message, allowed="the joints of each pose", fix=fix
            )
    return None


def _numbers(look: Found, count: int) -> Array | None:
    """So many numbers (m, count) that rows end with, a number of the row before them or none."""
    if look.has("x", "y", "z"):
        names = [look.stems[axis].theirs for axis in "xyz"] if count == PLACE else []
    else:
        bare = look.also or look
        last = bare.names + bare.width
        fits = bare.kind == "bare" and bare.width - count in (0, 1)
        names = [str(k) for k in range(last - count + 1, last + 1)] if fits else []
    if not names:
        return None
    values = signed(look.also or look, names).T
    return values if np.isfinite(values).all() else None


def _in_meters(places: Array) -> Array:
    """Places (m, 3) [m]."""
    return places * (1e-3 if np.abs(places).max() > REACH else 1.0)


def _poses(numbers: Array) -> Iterator[Array]:
    """Poses (m, 4, 4) of a place and three numbers of a rotation [m]."""
    angles = np.radians(numbers[:, PLACE:])
    for R in (
        exp_so3(numbers[:, PLACE:]),  # of Universal Robots
        rotations("ZYX", angles),  # A B C of KUKA
        rotations("xyz", angles),  # W P R of FANUC
    ):
        yield transform(R, _in_meters(numbers[:, :PLACE]))
