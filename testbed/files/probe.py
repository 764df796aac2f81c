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
    alternatives_of,
    coupling_of,
    distance_alternatives,
    shifted,
    small_rows,
    some_rows,
)
from testbed.files.frames_fit import FAR, Misfit, far_for, flange_poses, target_groups
from testbed.files.refusal import refusal
from testbed.files.rows.exact import exactness
from testbed.files.rows.names import exchanged_names
from testbed.files.rows.one_tool import named_target, not_on_one_tool
from testbed.files.rows.ratios import SUSPECT, ratios_that_fit
from testbed.files.rows.shifts import (
    FEWEST,
    Shifted,
    as_read,
    misfit_of,
    other_lines,
    other_rows,
    spread_out,
)
from testbed.files.session import Session
from testbed.robots.robot import Robot

TIMES = 5.0
"""An alternative is named if what it leaves is so many times smaller."""
ALIKE = 2.0
"""The same of as many rows beside their own joints. Of 900 random lines of ten good rows one is
named so and nine were without it; of 400 with shifted rows 193, as without it."""
UNITS = (0.6, 1.6)
"""Spread of the measured positions over the nominal ones, with the right unit."""
BEYOND = 5.0
"""Times outside of that from which on a few poses show a wrong unit: inches for mm are 25."""
LEAST_SPAN, TOOL = 0.02, 1.0
"""Distances vary by at least this part of what the flange moves, and by that and a tool [m]."""
BETTER = 0.98
"""The other source of joints fits better if it leaves less than this part."""


@dataclass(frozen=True, slots=True)
class Tried:
    """An alternative reading and what it leaves."""

    alternative: Alternative
    misfit: Misfit
    beside: float | None = None
    """Score that as many rows leave as they were read, where it is of fewer than all [m]."""


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
    no_target: InputError | None = None
    """Where two targets cannot both have been on the tool."""
    far: float = FAR
    """Error that the right reading of these positions never leaves [m]."""

    @property
    def best(self) -> Tried | None:
        """The alternative that fits best."""
        return self.tried[0] if self.tried else None

    @property
    def wrong(self) -> Tried | None:
        """The alternative that fits so much better that the file is read wrongly."""
        if self.stated is None:
            return None
        for one in self.tried:
            # what is better and still absurd is no reading of this file either
            if one.misfit.score > FAR or self.stated.score <= TIMES * one.misfit.score:
                return None
            if one.beside is None or one.beside > ALIKE * one.misfit.score:
                return one
        return None

    @property
    def sentence(self) -> str:
        """The fit of the stated reading and of the best other one in words."""
        if self.stated is None:
            return f"too few poses to try other interpretations of the file; at least {FEWEST}"
        sentence = f"with only base and tool fitted, the errors are {self.stated.shown}"
        if self.best is None:
            return sentence
        count, left = len(self.tried), self.best.misfit.shown
        return f"{sentence}; with the best of {count} other interpretations, {left}"

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
                f"with base and tool fitted, the readings miss the robot by {stated.shown}, but "
                f"only by {wrong.misfit.shown} {other.condition}",
                code=other.code, value=stated.position, fix=other.fix,
            )  # fmt: skip
        elif self.no_target is not None:
            raise self.no_target
        elif min([stated.score, *(tried.misfit.score for tried in self.tried)]) > self.far:
            raise refusal(
                self.where, "ROBOT",
                f"with base and tool fitted, the readings miss the robot by {stated.shown}, and by "
                f"{self.far * 1e3:.2g} mm or more however the file is interpreted", code="M32",
                value=stated.position,
                allowed=f"those of a {self.robot} would miss it by a few mm",
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
        seen = table.position[rows]
        plain = replace(plain, spread=_extent(seen) / extent, far=far_for(seen))
    if poses < FEWEST:
        return plain
    some = rows[spread_out(len(rows))]
    read = replace(as_read(session, some), numbers=session.stated.rows(some).numbers)
    stated = misfit_of(robot.model, read)
    numbers = alternatives_of(read, session.stated, robot.model.chain, robot.controller)
    turning = robot.model.chain.prismatic == 0
    small = rows[small_rows(table.q[rows], turning)]
    mixed = some_rows(read, turning, session.place[small[0]] if len(small) else "")
    lines = list(other_lines(robot.model, session, groups, rows))
    # there are a hundred of these: what only another valley would bring near is left unnamed
    tried = [
        Tried(other, misfit_of(robot.model, read, one_valley=True))
        for other, read in (*numbers, *mixed)
    ]
    fitting = ratios_that_fit(robot, read, stated)
    tried += [Tried(coupling_of(one), left) for one, left in fitting]
    if stated.score > SUSPECT:
        renamed = exchanged_names(robot.model, session, groups, rows)
        tried += [Tried(one.alternative, misfit_of(robot.model, one.read)) for one in renamed]
    some_lines = lines or other_rows(session, rows)
    tried += [_of_rows(robot.model, one, stated.score) for one in some_lines]
    tried.sort(key=lambda one: one.misfit.score)
    warnings = (*_warnings(robot, session, some, stated), *_others(robot, session, groups, rows))
    no_target = not_on_one_tool(session, groups)
    return replace(plain, stated=stated, tried=tuple(tried), warnings=warnings, no_target=no_target)


def _others(
    robot: Robot, session: Session, groups: Sequence[Index], judged: Index
) -> Iterator[str]:
    """The targets besides the one that is judged whose places a controller made."""
    table = session.measurements
    for rows in groups:
        if rows is judged or len(np.unique(table.q[rows], axis=0)) < FEWEST:
            continue
        some = rows[spread_out(len(rows))]
        left = misfit_of(robot.model, as_read(session, some))
        if exact := exactness(robot.model, session, some, left):
            yield f"{named_target(session, int(rows[0]))}{exact}"


def _of_rows(model: RobotModel, one: Shifted, stated: float) -> Tried:
    """What readings leave beside the joints of other rows, and as many beside their own.

    The latter only where it matters: where the former is much less than all rows leave, `stated`.
    """
    left = misfit_of(model, one.read)
    if left.score > FAR or stated <= TIMES * left.score:
        return Tried(one.alternative, left)
    return Tried(one.alternative, left, min(misfit_of(model, read).score for read in one.own))


def _doubtful(model: RobotModel, session: Session, groups: Sequence[Index]) -> Index:
    """Rows of the largest group, or of the first one that does not fit while that does."""
    for rows in groups:
        if len(np.unique(session.measurements.q[rows], axis=0)) < FEWEST:
            continue
        if misfit_of(model, as_read(session, rows[spread_out(len(rows))])).score > FAR:
            return rows
    return groups[0]


def _extent(points: Array) -> float:
    """Root mean square distance of points (m, 3) from their middle [m]."""
    return float(np.sqrt(np.square(points - points.mean(axis=0)).sum(axis=1).mean()))


def _warnings(robot: Robot, session: Session, rows: Index, stated: Misfit) -> tuple[str, ...]:
    """What looks odd though the reading is right."""
    warnings = [exact] if (exact := exactness(robot.model, session, rows, stated)) else []
    if session.read_back is not None:
        other = replace(as_read(session, rows), q=session.read_back[rows])
        left = misfit_of(robot.model, other)
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
    rows = spread_out(len(session.measurements))
    table = session.measurements.rows(rows)
    if len(np.unique(session.measurements.q, axis=0)) < FEWEST:
        return plain
    model = RobotModel(robot.model.chain, robot.model.joint_errors, session.fixtures)
    reach = float(np.ptp(flange_poses(robot.model, table.q)[:, :3, 3], axis=0).max())

    def misfit(some: Measurements) -> Misfit:
        # no point of the tool comes nearer to an anchor, or farther, than the robot moves it
        spans = [np.ptp(some.distance[some.anchor == k]) for k in np.unique(some.anchor)]
        if not LEAST_SPAN * reach < max(spans) < 2 * reach + TOOL:
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
            some = spread_out(high - low) + low
            yield shifted(shift), replace(table.rows(some), distance=table.distance[some + shift])
