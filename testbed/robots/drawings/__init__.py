"""Drawings by name: what the key `drawing` of a model file may say."""

from collections.abc import Callable

from calib.geometry.frames import slide
from testbed.robots.drawings import tx60
from testbed.robots.drawings.probe import probe
from testbed.robots.meshes import Solid, moved


def staubli_tx60() -> dict[str, Solid]:
    """The arm with a probe on its flange, base frame, joint zero."""
    T = slide(0.0, tx60.SIDE, tx60.FLANGE)
    return tx60.arm() | {name: moved(solid, T) for name, solid in probe().items()}


ROBOT_DRAWINGS: dict[str, Callable[[], dict[str, Solid]]] = {"staubli_tx60": staubli_tx60}
"""Parts by name, in the base frame at joint zero."""
