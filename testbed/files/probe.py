"""Is the file read as it was meant? Base and tool are fitted for the stated reading and for others.

Only the nominal robot is needed: with the right reading its base and tool explain all but a
millimeter or so, with a wrong one they leave centimeters. Nothing is ever switched in silence.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.identification.start.start import start_frames
from calib.measurement.observations import Measurements
from testbed.files.alternatives import Alternative, alternatives_of, distance_alternatives
from testbed.files.frames_fit import Fit, fit, flange_poses, groups
from testbed.files.readings import Reading
from testbed.files.session import Session
from testbed.robots.robot import Robot

ROWS = 60
"""Rows on which readings are compared."""
FEWEST = 6
"""Poses below which nothing is tried."""
TIMES = 5.0
"""An alternative is named if what it leaves is so many times smaller."""
FAR = 0.020
"""Score that the right reading of a file of the right robot never leaves [m]."""
UNITS = (0.6, 1.6)
"""Spread of the measured positions over the nominal ones, with the right unit."""
LEAST_SPAN, TOOL = 0.02, 1.0
"""Distances vary by at least this part of what the flange moves, and by that and a tool [m]."""
MODEL = 1e-6
"""A misfit below this is no measurement but a controller's own model [m]."""
BETTER = 0.98
"""The other source of joints fits better if it leaves less than this part."""


@dataclass(frozen=True, slots=True)
class Tried:
    """An alternative reading and what it leaves."""

    alternative: Alternative
    fit: Fit


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """What the stated reading leaves, and what others would."""

    where: str
    stated: Fit | None
    """None if there are too few poses to tell."""
    tried: tuple[Tried, ...]
    """Best first."""
    spread: float
    """Spread of measured over nominal positions; nan for distances."""
    warnings: tuple[str, ...]
    robot: str

    @property
    def best(self) -> Tried | None:
        """The alternative that fits best."""
        return self.tried[0] if self.tried else None

    @property
    def wrong(self) -> Tried | None:
        """The alternative that fits so much better that the file is read wrongly."""
        best = self.best
        if best is None or self.stated is None or self.stated.score <= TIMES * best.fit.score:
            return None
        # what is better and still absurd is no reading of this file either
        return best if best.fit.score <= FAR else None

    @property
    def sentence(self) -> str:
        """What the report says."""
        if self.stated is None:
            return f"too few poses to try other readings of the file; at least {FEWEST}"
        best = self.best
        told = f"base and tool alone leave {_shown(self.stated)}"
        if best is None:
            return told
        return f"{told}; the best of {len(self.tried)} other readings leaves {_shown(best.fit)}"

    def raise_if_wrong(self) -> None:
        """Refuse a file that is read wrongly, or that is not of this robot.

        Raises
        ------
        InputError
            The code of the row it belongs to; the message names the reading that fits.
        """
        if self.stated is None:
            if np.isfinite(self.spread) and not UNITS[0] / 5 < self.spread < UNITS[1] * 5:
                raise InputError(
                    f"the measured points spread {self.spread:.3g} times as far as the robot moves",
                    code="M21",
                    where=self.where,
                    field="length",
                    value=self.spread,
                    allowed=f"{UNITS[0]} to {UNITS[1]} times is usual",
                    fix="check the unit of the positions",
                )
            return
        wrong = self.wrong
        if wrong is not None:
            raise InputError(
                f"base+tool fit leaves {_shown(self.stated)}; {_shown(wrong.fit)} "
                f"{wrong.alternative.told}",
                code=wrong.alternative.code,
                where=self.where,
                field=wrong.alternative.field,
                value=self.stated.position,
                fix=wrong.alternative.fix,
            )
        if min([self.stated.score, *(tried.fit.score for tried in self.tried)]) > FAR:
            raise InputError(
                f"base+tool fit leaves {_shown(self.stated)}, and no other reading of the file "
                f"less than {FAR * 1e3:g} mm",
                code="M32",
                where=self.where,
                field="ROBOT",
                value=self.stated.position,
                allowed=f"a nominal {self.robot} leaves a few mm",
                fix="is this the robot that was measured?",
            )


def probe(robot: Robot, session: Session) -> Probe:
    """Try other readings of a session's files.

    Parameters
    ----------
    robot : Robot
        Nominal.
    session : Session
        As it was read.
    """
    table = session.measurements
    where = session.place[0].rpartition(":")[0]
    optical = groups(table)
    if not optical:
        return _probe_distances(robot, session, where)
    rows = optical[0]
    poses = len(np.unique(table.q[rows], axis=0))
    F = flange_poses(robot.model, table.q[rows])
    spread = _extent(table.position[rows]) / max(_extent(F[:, :3, 3]), 1e-9)
    if poses < FEWEST:
        return Probe(where, None, (), spread, (), robot.name)
    some = rows[_spread_out(len(rows))]
    reading = _reading(session, some)
    stated = _fit(robot.model, reading)
    tried = [
        Tried(alternative, _fit(robot.model, other))
        for alternative, other in _readings(robot, session, reading, rows)
    ]
    tried.sort(key=lambda one: one.fit.score)
    return Probe(
        where,
        stated,
        tuple(tried),
        spread,
        _warnings(robot, session, some, stated),
        robot.name,
    )


def _readings(
    robot: Robot, session: Session, reading: Reading, rows: Index
) -> Iterator[tuple[Alternative, Reading]]:
    """Other readings: of the numbers, then of the order of the rows."""
    yield from alternatives_of(reading, session.stated, robot.model.chain)
    table = session.measurements
    for shift in (1, 2, 3, 4, 5, -1, -2, -3, -4, -5):
        if len(rows) < FEWEST + abs(shift):
            continue
        low, high = max(0, -shift), len(rows) - max(0, shift)
        own = _spread_out(high - low) + low
        moved = _reading(session, rows[own + shift])
        told = f"if row k{shift:+d} belongs to pose k"
        extra = "first" if shift > 0 else "last"
        fix = f"drop the extra {extra} row{'s' if abs(shift) > 1 else ''}"
        yield (
            Alternative("rows", told, fix, "M31", "match"),
            Reading(table.q[rows[own]], moved.position, moved.rotation, None),
        )


def _reading(session: Session, rows: Index) -> Reading:
    """Some rows of a session as they were read."""
    table, stated = session.measurements, session.stated
    turned = table.rotation[rows] if table.is_pose[rows[0]] else None
    numbers = None if stated.numbers is None else stated.numbers[rows]
    return Reading(table.q[rows], table.position[rows], turned, numbers)


def _fit(model: RobotModel, reading: Reading) -> Fit:
    """What base and tool leave of a reading."""
    return fit(flange_poses(model, reading.q), reading.position, reading.rotation)


def _spread_out(count: int) -> Index:
    """Places of at most `ROWS` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, ROWS)).round().astype(np.int64))


def _extent(points: Array) -> float:
    """Root mean square distance of points (m, 3) from their middle [m]."""
    return float(np.sqrt(np.square(points - points.mean(axis=0)).sum(axis=1).mean()))


def _warnings(robot: Robot, session: Session, rows: Index, stated: Fit) -> tuple[str, ...]:
    """What looks odd though the reading is right."""
    out, table = [], session.measurements
    if stated.position < MODEL:
        out.append(
            f"base and tool explain the positions to {stated.position * 1e9:.2g} nm: these are a "
            "controller's own poses, not measurements"
        )
    if session.read_back is not None:
        turned = table.rotation[rows] if table.is_pose[rows[0]] else None
        other = Reading(session.read_back[rows], table.position[rows], turned, None)
        left = _fit(robot.model, other)
        if left.position < BETTER * stated.position:
            name = "commanded" if session.joint_source == "read-back" else "read-back"
            out.append(
                f"the {name} joints fit better: base+tool leave {_shown(left)} instead of "
                f"{_shown(stated)}"
            )
    return tuple(out)


def _probe_distances(robot: Robot, session: Session, where: str) -> Probe:
    """The same for distances alone, by the general start, which is slow where nothing fits.

    Other readings are tried only if the stated one fails, and no longer than until one fits.
    """
    rows = _spread_out(len(session.measurements))
    table = session.measurements.rows(rows)
    if len(np.unique(session.measurements.q, axis=0)) < FEWEST:
        return Probe(where, None, (), float("nan"), (), robot.name)
    model = RobotModel(robot.model.chain, robot.model.joint_errors, session.fixtures)
    reach = float(np.ptp(flange_poses(robot.model, table.q)[:, :3, 3], axis=0).max())

    def left(some: Measurements) -> Fit:
        # no point of the tool comes nearer or farther than the robot moves it
        if not LEAST_SPAN * reach < np.ptp(some.distance) < 2 * reach + TOOL:
            return Fit(float("inf"), 0.0)
        try:
            start = start_frames(model, some, free_anchors=session.free_anchors)
        except InputError:
            return Fit(float("inf"), 0.0)
        return Fit(start.position_rms, 0.0)

    stated = left(table)
    tried: list[Tried] = []
    for alternative, other in distance_alternatives(table) if stated.position > FAR / TIMES else ():
        tried.append(Tried(alternative, left(other)))
        if stated.score > TIMES * tried[-1].fit.score:
            break
    tried.sort(key=lambda one: one.fit.score)
    return Probe(where, stated, tuple(tried), float("nan"), (), robot.name)


def _shown(fit: Fit | None) -> str:
    """Misfit for people."""
    if fit is None or not np.isfinite(fit.position):
        return "no answer at all"
    angle = f" and {_two(np.degrees(fit.rotation))} deg" if fit.rotation else ""
    size = fit.position
    return (f"{_two(size * 1e3)} mm" if size < 10 else f"{_two(size)} m") + angle


def _two(value: float) -> str:
    """At least two digits, and never a power of ten."""
    return f"{value:.2g}" if value < 10 else f"{value:.0f}"
