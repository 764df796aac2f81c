"""Drawings by name: values of the key `drawing` of a model file."""

from collections.abc import Callable

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import rot_x, slide
from testbed.robots.meshes.drawings import iiwa, tx60, ur10
from testbed.robots.meshes.drawings.instruments import probe
from testbed.robots.meshes.solids import Solid, moved


def staubli_tx60() -> dict[str, Solid]:
    """The arm with a probe on its flange, base frame, joint zero."""
    return tx60.arm() | probe_at(slide(0.0, tx60.SIDE, tx60.FLANGE))


def universal_ur10() -> dict[str, Solid]:
    """The arm with a probe on its flange, base frame, joint zero."""
    return ur10.arm() | probe_at(slide(ur10.WRIST, ur10.FLANGE, ur10.LOW) @ rot_x(np.pi / 2))


def kuka_iiwa7() -> dict[str, Solid]:
    """The arm with a probe on its flange, base frame, joint zero."""
    return iiwa.arm() | probe_at(slide(0.0, 0.0, iiwa.FLANGE))


def probe_at(T_base_flange: Array) -> dict[str, Solid]:
    """The parts of the probe on a flange (4, 4) [m]."""
    return {name: moved(solid, T_base_flange) for name, solid in probe().items()}


ROBOT_DRAWINGS: dict[str, Callable[[], dict[str, Solid]]] = {
    "staubli_tx60": staubli_tx60,
    "universal_ur10": universal_ur10,
    "kuka_iiwa7": kuka_iiwa7,
}
"""Parts by name, in the base frame at joint zero."""
