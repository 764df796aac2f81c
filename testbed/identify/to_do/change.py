"""What identifying changed: whether errors really rise, and whether any number is off."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.special import fdtrc

from calib.arrays import Array
from calib.measurement.residual import linearize
from testbed.files.session_toml import FRAMES_ALONE
from testbed.identify.applies.beyond import CHANCE
from testbed.identify.calibration import Calibration
from testbed.identify.errors import of_poses
from testbed.identify.frames import is_frame
from testbed.identify.headline import deg, mm

SHOWN = 0.01
"""Chance of residuals that fall so by links that are as described; below it some are shown to be
off."""
NOTHING_LEFT = "Nothing is left to calibrate: the readings do not show that any number is off."


def changes(calibration: Calibration) -> tuple[str, ...]:
    """How the mean error of positions and, of poses, that of orientations goes, in words.

    A rise that is no more than chance makes of poses like these is not called one, nor what noise
    alone does to numbers that are right.
    """
    position, rotation = _before_after(calibration)
    sound = nothing_left(calibration)
    found = [f"{_goes(*position, mm, sound=sound)} mm"]
    if len(rotation[0]):
        found.append(f"{_goes(*rotation, deg, sound=sound)} deg")
    return tuple(found)


def rises(calibration: Calibration) -> bool:
    """Whether positions are missed by more than before, and more than chance makes likely."""
    return _surely_more(*_before_after(calibration)[0])


@lru_cache(maxsize=1)  # verdict, reasons and next step ask the same
def nothing_left(calibration: Calibration) -> bool:
    """Whether neither the residuals nor held-out errors show that links or joints are off.

    References
    ----------
    F of the squares that the numbers beside the frames take off the whitened residuals, per number,
    over what is left per degree of freedom: so that noise of another size than stated is no change.
    """
    fit, table = calibration.fit.identification, calibration.measurements.rows(calibration.is_used)
    plain = fit.mode == "whitened" and fit.loss == "squared"
    if calibration.choice.asked == FRAMES_ALONE or not plain or calibration.moved is not None:
        return False
    before, after = _before_after(calibration)[0]
    if _surely_more(after, before):
        return False
    square, left = (
        float(np.square(linearize(model, table).r).sum())
        for model in (calibration.before, fit.model)
    )
    held = {name for visit in calibration.visits if visit.held_out for name in visit.numbers}
    frames = [name for name in fit.names if is_frame(name) and name not in held]
    freedom = fit.dof_effective if np.isfinite(fit.dof_effective) else float(fit.dof)
    numbers = int(table.equations.sum()) - len(frames) - freedom
    if min(numbers, freedom, left) <= 0:
        return False
    fall = max(square - left, 0.0) / numbers
    return bool(fdtrc(numbers, freedom, fall * freedom / left) >= SHOWN)


def _before_after(calibration: Calibration) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Errors of each pose judged before and after: of positions [m], of orientations [rad]."""
    table, rows = calibration.measurements, calibration.is_judged
    both = (calibration.before_misses, calibration.fit.misses)
    before, after = (of_poses(one.position, table, rows) for one in both)
    turns = rows & table.is_pose
    turned, turns_after = (of_poses(one.rotation, table, turns) for one in both)
    return (before, after), (turned, turns_after)


def _goes(before: Array, after: Array, shown: Callable[[float], str], *, sound: bool) -> str:
    """From where to where the mean goes."""
    one, other = (shown(float(each.mean())) for each in (before, after))
    if one == other:
        return f"stays at {other}"
    if sound:
        return f"goes from {one} to {other}"
    if after.mean() < before.mean():
        return f"falls from {one} to {other}"
    if _surely_more(before, after):
        return f"RISES from {one} to {other}"
    return f"goes, by no more than chance, from {one} to {other}"


def _surely_more(before: Array, after: Array) -> bool:
    """Whether errors grow from pose to pose by more than chance makes likely."""
    more, count = after - before, len(before)
    spread = float(more.std(ddof=1)) / np.sqrt(count) if count > 1 else np.inf
    return bool(more.mean() > CHANCE * spread)
