"""Where the root of a user's own URDF or MJCF stands: the frame that corrected programs hold in."""

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import inverse, log_so3
from testbed.identify.calibration import Calibration
from testbed.identify.handback.states import handed_robot
from testbed.units import DEG, MM


def root_found(calibration: Calibration) -> Array:
    """Pose (4, 4) of that root in the frame of the measurements [m].

    It stands to the first joint axis of the identified robot as it does in the file.
    """
    found = handed_robot(calibration).model.chain.T_world_base
    return np.asarray(found @ inverse(calibration.nominal.chain.T_world_base))


def root_words(calibration: Calibration, root: str) -> str:
    """Where it was found: a place in mm, and a rotation vector in degrees."""
    T = root_found(calibration)
    place, turn = (
        ", ".join(f"{number:.{digits}f}" for number in numbers)
        for numbers, digits in ((T[:3, 3] * MM, 4), (log_so3(T[:3, :3]) * DEG, 6))
    )
    return (
        f"{root} was found at ({place}) mm, turned by the rotation vector ({turn}) deg, in the "
        "frame of the measurements"
    )
