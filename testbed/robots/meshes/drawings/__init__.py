"""Drawings by name: values of the key `drawing` of a model file."""

import numpy as np

from calib.geometry.frames import rot_x, slide
from testbed.robots.meshes.drawings import iiwa, tx60, ur10
from testbed.robots.meshes.drawings.instruments import probe
from testbed.robots.meshes.solids import Solid, moved

ARMS = {
    "staubli_tx60": (tx60.arm, slide(0.0, tx60.SIDE, tx60.FLANGE)),
    "universal_ur10": (ur10.arm, slide(ur10.WRIST, ur10.FLANGE, ur10.LOW) @ rot_x(np.pi / 2)),
    "kuka_iiwa7": (iiwa.arm, slide(0.0, 0.0, iiwa.FLANGE)),
}
"""Who draws each arm, and where its flange is, base frame, joint zero [m]."""


def drawing(name: str) -> dict[str, Solid]:
    """Parts of an arm and of the probe on its flange, by name, base frame, joint zero."""
    arm, T_base_flange = ARMS[name]
    return arm() | {part: moved(solid, T_base_flange) for part, solid in probe().items()}
