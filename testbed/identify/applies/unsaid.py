"""What a model follows and nobody says of a pose: how far that may take the tool from where it is.

A model that knows play, torques, payloads or the warmth of the arm speaks of poses that state them.
Of others it takes the mean of the measurements: what is not known of them is in their region.
"""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, evenly, frozen
from calib.geometry.frames import target_points
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.uncertainty.statement.stated_point import common_radius
from calib.uncertainty.tool_point import ToolStatement
from testbed.identify.calibration import Calibration
from testbed.lengths import with_unit
from testbed.units import listed

MOST_ROWS = 64
"""Rows of the measurements whose conditions a pose is tried under: spread evenly over all."""
LASTING = ("payload", "temperature")
"""What stays for a whole program, so that its part is no matter of chance from pose to pose."""
WORDS = {
    "approach": "the side from which each joint comes",
    "torque": "what the drives report",
    "payload": "the payload",
    "temperature": "the temperature of the arm",
}


def followed(model: RobotModel) -> tuple[str, ...]:
    """What a model follows of what rows say beside their joints."""
    waves = {term.wave for term in model.joint_errors.terms}
    there = {
        "approach": "approach" in waves,
        "torque": "torque" in waves,
        "payload": model.joint_errors.springs is not None,
        "temperature": "lengths" in waves,
    }
    return tuple(name for name, follows in there.items() if follows)


def seen_by(calibration: Calibration) -> OperatingConditions:
    """What the rows say that a statement rests on: identified from, and held out."""
    rows = calibration.is_used | calibration.split.is_test
    return calibration.measurements.conditions.rows(rows)


def unsaid_spread(
    model: RobotModel, q: Array, at: OperatingConditions, seen: OperatingConditions, point: Array
) -> Array:
    """Covariance (m, 3, 3) of the tool point from what nobody says of poses at joints q [m^2].

    Torques differ from pose to pose: their part is the mean square over the rows. A payload and the
    warmth of the arm stay for a whole program: theirs is that, or where it is more, a third of the
    largest square, as if anything up to the furthest row were as likely (JCGM 100:2008, 4.3.7).
    Of joints whose side is not known, both sides.

    Parameters
    ----------
    model : RobotModel
        What was identified.
    q : (m, n) array
        Joints of the poses [rad, m].
    at : OperatingConditions
        What is said of them.
    seen : OperatingConditions
        What the rows say.
    point : (3,) array
        In the tool frame [m].
    """

    def reached(there: OperatingConditions) -> Array:
        return target_points(model.poses(q, there), point)

    asked, own = followed(model), reached(at)
    silent = [name for name in asked if name in seen.stated and name not in at.stated]
    spread = np.zeros((len(q), 3, 3))
    for lasting in (False, True):
        names = [name for name in silent if name in (LASTING if lasting else ("torque",))]
        rows: dict[str, Array] = {name: getattr(seen, name) for name in names}
        if "payload" in rows and seen.center is not None:
            rows["center"] = seen.center
        if not rows:
            continue
        m = len(next(iter(rows.values())))
        some = evenly(np.arange(m), MOST_ROWS)
        squares = np.empty((len(some), len(q), 3, 3))
        for square, k in zip(squares, some, strict=True):
            like = {name: np.repeat(values[k : k + 1], len(q), 0) for name, values in rows.items()}
            away = reached(replace(at, **like)) - own
            square[:] = away[:, :, None] * away[:, None]
        part, size = squares.mean(axis=0), np.einsum("kmii->km", squares)
        worst = squares[size.argmax(axis=0), np.arange(len(q))] / 3
        more = lasting & (size.max(axis=0) / 3 > np.einsum("mii->m", part))
        spread += np.where(more[:, None, None], worst, part)
    if "approach" in asked:
        side = np.zeros(q.shape) if at.approach is None else at.approach
        for joint in np.flatnonzero((side == 0).any(axis=0)):
            other = side.copy()
            other[side[:, joint] == 0, joint] = 1.0
            away = reached(replace(at, approach=other)) - own
            spread += away[:, :, None] * away[:, None]
    return frozen(spread)


def widened_by(region: ToolStatement, spread: Array) -> ToolStatement:
    """A region with what nobody says of its poses in it."""
    return replace(region, covariance=frozen(region.covariance + spread))


def unsaid_words(calibration: Calibration) -> tuple[str, ...]:
    """What R95 takes as known of a pose, and how large it is where nobody knows it."""
    belief, point = calibration.proof.belief, calibration.proof.point
    model, seen = calibration.fit.identification.model, seen_by(calibration)
    names = [name for name in followed(model) if name in seen.stated]
    names = [name for name in names if np.ptp(getattr(seen, name), axis=0).any()]
    if belief is None or point is None or not names:
        return ()
    q, target = calibration.stated_q, calibration.target
    spread = unsaid_spread(model, q, AS_USUAL, seen, target.place(model))
    radius = common_radius(widened_by(belief.regions(q, target=target), spread))
    return (
        f"R95 is for poses of which you know {listed([WORDS[name] for name in names])}; if you do "
        "not, and only know that they are like those of the measurements, R95 is "
        f"{with_unit(radius)}",
    )
