"""Is the file read as it was meant? Base and tool are fitted for it and for other readings.

Only the nominal robot is needed: with the right reading its base and tool explain all but a
millimeter or so, with a wrong one they leave centimeters. Nothing is ever switched in silence.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from calib.arrays import Array, Index
from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.identification.start.start import start_frames
from calib.measurement.observations import Measurements
from testbed.files.alternatives import (
    Alternative,
    Interpretation,
    OtherReadings,
    alternatives_of,
    distance_alternatives,
    shifted,
    small_rows,
    some_rows,
)
from testbed.files.frames_fit import FAR, Misfit, fit_frames, flange_poses, target_groups
from testbed.files.refusal import refusal
from testbed.files.session import Session
from testbed.robots.robot import Robot

ROWS = 60
"""Rows on which readings are compared."""
FEWEST = 6
"""Poses below which nothing is tried."""
TIMES = 5.0
"""An alternative is named if what it leaves is so many times smaller."""
UNITS = (0.6, 1.6)
"""Spread of the measured positions over the nominal ones, with the right unit."""
BEYOND = 5.0
"""Times outside of that from which on a few poses show a wrong unit: inches for mm are 25."""
LEAST_SPAN, TOOL = 0.02, 1.0
"""Distances vary by at least this part of what the flange moves, and by that and a tool [m]."""
MODEL = 1e-6
"""A misfit below this is no measurement but the model of a controller [m]."""
BETTER = 0.98
"""The other source of joints fits better if it leaves less than this part."""


@dataclass(frozen=True, slots=True)
class Tried:
    """An alternative reading and what it leaves."""

    alternative: Alternative
    misfit: Misfit


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """What the stated reading leaves, and what others would."""

    where: str
    robot: str
    stated: Misfit | None = None
    """None if there are too few poses to judge."""
    tried: tuple[Tried, ...] = ()
    """Best first."""
    spread: float = float("nan")
    """Spread of measured over nominal positions; nan for distances."""
    warnings: tuple[str, ...] = ()

    @property
    def best(self) -> Tried | None:
        """The alternative that fits best."""
        return self.tried[0] if self.tried else None

    @property
    def wrong(self) -> Tried | None:
        """The alternative that fits so much better that the file is read wrongly."""
        best = self.best
        if best is None or self.stated is None or self.stated.score <= TIMES * best.misfit.score:
            return None
        # what is better and still absurd is no reading of this file either
        return best if best.misfit.score <= FAR else None

    @property
    def sentence(self) -> str:
        """The fit of the stated reading and of the best other one in words."""
        if self.stated is None:
            return f"too few poses to try other readings of the file; at least {FEWEST}"
        sentence = f"base and tool alone leave {self.stated.shown}"
        if self.best is None:
            return sentence
        count, left = len(self.tried), self.best.misfit.shown
        return f"{sentence}; the best of {count} other readings leaves {left}"

    def raise_if_wrong(self) -> None:
        """Refuse a file that is read wrongly, or that is not of this robot.

        Raises
        ------
        InputError
            The code of the row it belongs to; the message names the reading that fits.
        """
        stated, wrong = self.stated, self.wrong
        if stated is None:
            if np.isfinite(self.spread) and not UNITS[0] / BEYOND < self.spread < UNITS[1] * BEYOND:
                raise refusal(
                    self.where, "length",
                    f"the measured points spread {self.spread:.3g} times as far as the robot moves",
                    code="M21", value=self.spread,
                    allowed=f"{UNITS[0]} to {UNITS[1]} times is usual",
                    fix="check the unit of the positions",
                )  # fmt: skip
        elif wrong is not None:
            other = wrong.alternative
            raise refusal(
                self.where, other.field,
                f"base+tool fit leaves {stated.shown}; {wrong.misfit.shown} {other.condition}",
                code=other.code, value=stated.position, fix=other.fix,
            )  # fmt: skip
        elif min([stated.score, *(tried.misfit.score for tried in self.tried)]) > FAR:
            raise refusal(
                self.where, "ROBOT",
                f"base+tool fit leaves {stated.shown}, and no other reading of the file less "
                f"than {FAR * 1e3:g} mm", code="M32",
                value=stated.position,
                allowed=f"a nominal {self.robot} leaves a few mm",
                fix="is this the robot that was measured?",
            )  # fmt: skip


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
    plain = Probe(session.where, robot.name)
    groups = target_groups(table)
    if not groups:
        return _probe_distances(plain, robot, session)
    rows = _doubtful(robot.model, session, groups)
    F, poses = flange_poses(robot.model, table.q[rows]), len(np.unique(table.q[rows], axis=0))
    if poses > 1:  # one has no spread
        extent = max(_extent(F[:, :3, 3]), 1e-9)
        plain = replace(plain, spread=_extent(table.position[rows]) / extent)
    if poses < FEWEST:
        return plain
    some = rows[_spread_out(len(rows))]
    read = replace(_as_read(session, some), numbers=session.stated.rows(some).numbers)
    stated = _misfit(robot.model, read)
    numbers = alternatives_of(read, session.stated, robot.model.chain)
    turning = robot.model.chain.prismatic == 0
    small = rows[small_rows(table.q[rows], turning)]
    mixed = some_rows(read, turning, session.place[small[0]] if len(small) else "")
    lines = list(_other_lines(robot.model, session, groups, rows))
    others = [*numbers, *mixed, *(lines or _other_rows(session, rows))]
    tried = [Tried(other, _misfit(robot.model, one)) for other, one in others]
    tried.sort(key=lambda one: one.misfit.score)
    warnings = _warnings(robot, session, some, stated)
    return replace(plain, stated=stated, tried=tuple(tried), warnings=warnings)


def _other_rows(session: Session, rows: Index) -> OtherReadings:
    """Readings of one row with the joints of another."""
    for shift in (1, 2, 3, 4, 5, -1, -2, -3, -4, -5):
        if len(rows) < FEWEST + abs(shift):
            continue
        low, high = max(0, -shift), len(rows) - max(0, shift)
        some = _spread_out(high - low) + low
        moved = _as_read(session, rows[some + shift])
        which = "" if len(rows) == len(session.measurements) else " of one target"
        yield shifted(shift, which), replace(moved, q=session.measurements.q[rows[some]])


def _other_lines(
    model: RobotModel, session: Session, groups: Sequence[Index], rows: Index
) -> OtherReadings:
    """Readings of one line with the joints of another, where that fits each of several targets.

    The target belongs to the joints: all cells that were measured have moved.
    """
    table = session.measurements
    optical = np.flatnonzero(~table.is_distance)
    if len(groups) == 1 or len(np.unique(table.is_pose[optical])) > 1:
        return
    for shift in (1, 2, 3, -1, -2, -3):
        each = []
        for group in (rows, *groups):
            at = np.searchsorted(optical, group)
            at = at[(at + shift >= 0) & (at + shift < len(optical))]
            some = at[_spread_out(len(at))] if len(at) else at
            moved = optical[some + shift]
            each.append((moved, replace(_as_read(session, moved), q=table.q[optical[some]])))
        enough = [read for moved, read in each if len(moved) >= FEWEST]
        if enough and all(_misfit(model, read).score <= FAR for read in enough):
            yield shifted(shift), enough[0]


def _doubtful(model: RobotModel, session: Session, groups: Sequence[Index]) -> Index:
    """Rows of the largest group, or of the first one that does not fit while that does."""
    for rows in groups:
        if len(np.unique(session.measurements.q[rows], axis=0)) < FEWEST:
            continue
        if _misfit(model, _as_read(session, rows[_spread_out(len(rows))])).score > FAR:
            return rows
    return groups[0]


def _as_read(session: Session, rows: Index) -> Interpretation:
    """Some rows of a session as they were read."""
    table = session.measurements
    rotation = table.rotation[rows] if table.is_pose[rows[0]] else None
    return Interpretation(table.q[rows], table.position[rows], rotation)


def _misfit(model: RobotModel, read: Interpretation) -> Misfit:
    """What base and tool leave of a reading."""
    F = flange_poses(model, read.q)
    return fit_frames(F, read.position, read.rotation).misfit(F, read.position, read.rotation)


def _spread_out(count: int) -> Index:
    """Places of at most `ROWS` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, ROWS)).round().astype(np.int64))


def _extent(points: Array) -> float:
    """Root mean square distance of points (m, 3) from their middle [m]."""
    return float(np.sqrt(np.square(points - points.mean(axis=0)).sum(axis=1).mean()))


def _warnings(robot: Robot, session: Session, rows: Index, stated: Misfit) -> tuple[str, ...]:
    """What looks odd though the reading is right."""
    warnings = []
    if stated.position < MODEL:
        warnings.append(
            f"base and tool explain the positions to {stated.position * 1e9:.2g} nm: these are a "
            "controller's own poses, not measurements"
        )
    if session.read_back is not None:
        other = replace(_as_read(session, rows), q=session.read_back[rows])
        left = _misfit(robot.model, other)
        if left.position < BETTER * stated.position:
            name = "commanded" if session.joint_source == "read-back" else "read-back"
            warnings.append(
                f"the {name} joints fit better: base+tool leave {left.shown} instead of "
                f"{stated.shown}"
            )
    return tuple(warnings)


def _probe_distances(plain: Probe, robot: Robot, session: Session) -> Probe:
    """The same for distances alone, by the general start, which is slow where nothing fits.

    Other readings are tried only if the stated one fails, and no longer than until one fits.
    """
    rows = _spread_out(len(session.measurements))
    table = session.measurements.rows(rows)
    if len(np.unique(session.measurements.q, axis=0)) < FEWEST:
        return plain
    model = RobotModel(robot.model.chain, robot.model.joint_errors, session.fixtures)
    reach = float(np.ptp(flange_poses(robot.model, table.q)[:, :3, 3], axis=0).max())

    def misfit(some: Measurements) -> Misfit:
        # no point of the tool comes nearer or farther than the robot moves it
        if not LEAST_SPAN * reach < np.ptp(some.distance) < 2 * reach + TOOL:
            return Misfit(float("inf"), 0.0)
        try:
            start = start_frames(model, some, free_anchors=session.free_anchors)
        except InputError:
            return Misfit(float("inf"), 0.0)
        return Misfit(start.position_rms, 0.0)

    stated = misfit(table)
    tried: list[Tried] = []
    others = chain(distance_alternatives(table), _other_distances(session.measurements))
    for alternative, other in others if stated.position > FAR / TIMES else ():
        tried.append(Tried(alternative, misfit(other)))
        if stated.score > TIMES * tried[-1].misfit.score:
            break
    tried.sort(key=lambda one: one.misfit.score)
    return replace(plain, stated=stated, tried=tuple(tried))


def _other_distances(table: Measurements) -> Iterator[tuple[Alternative, Measurements]]:
    """Distances of one row with the joints of another."""
    for shift in (1, -1, 2, -2):  # fewer: each takes a slow start
        low, high = max(0, -shift), len(table) - max(0, shift)
        if high - low >= FEWEST:
            some = _spread_out(high - low) + low
            yield shifted(shift), replace(table.rows(some), distance=table.distance[some + shift])
