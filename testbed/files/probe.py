"""Is the file read as it was meant? Base and tool are fitted for it and for other readings.

Only the nominal robot is needed: with the right reading its base and tool explain all but a
millimeter or so, with a wrong one they leave centimeters. Nothing is ever switched in silence.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
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
    alternatives_of,
    coupling_of,
    distance_alternatives,
    shifted,
    small_rows,
    some_rows,
)
from testbed.files.frames_fit import FAR, TIMES, Misfit, far_for, flange_poses, target_groups
from testbed.files.readings import BAR, NO_DIRECTION
from testbed.files.reflectors.one_tool import named_target, not_on_one_tool
from testbed.files.refusal import refusal
from testbed.files.rows.exact import exactness
from testbed.files.rows.names import exchanged_names
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
from testbed.files.tried.interpretations import Probe, Tried
from testbed.files.tried.links_fit import LinksFit, links_fit, table_of
from testbed.files.tried.parts import parts_of
from testbed.files.tried.quarter_turns import quarter_turns
from testbed.robots.robot import Robot
from testbed.units import counted, millimetres

LEAST_SPAN, TOOL = 0.02, 1.0
"""Distances vary by at least this part of what the flange moves, and by that and a tool [m]."""
SHORT = 4.0
"""A distance of fewer times what nominal links leave may point any way. Of bars between a ball and
two sockets those of 0.5 mm, three times what they left, ended in a wrong valley, and those of 2 mm,
eleven times, did not."""
MOST_LINKS = 3
"""Alternatives that links are fitted to as well, where those do not explain the stated reading."""
CLEARLY = 2.0
"""So many times less do links leave of another reading if it is that one."""
BETTER = 0.98
"""The other source of joints fits better if it leaves less than this part."""


def probe(robot: Robot, session: Session, *, links: bool = True) -> Probe:
    """Try other readings of a session's files.

    Parameters
    ----------
    robot : Robot
        Nominal.
    session : Session
        As it was read.
    links : bool
        Whether links are fitted as well where frames leave doubt, which takes seconds.
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
    some = spread_out(rows)
    read = replace(as_read(session, some), numbers=session.stated.rows(some).numbers)
    F = flange_poses(robot.model, read.q)
    stated = misfit_of(robot.model, read, F=F)
    numbers = alternatives_of(read, session.stated, robot.model.chain, robot.controller)
    turning = robot.model.chain.prismatic == 0
    small = rows[small_rows(table.q[rows], turning)]
    mixed = some_rows(read, turning, session.place[small[0]] if len(small) else "")
    lines = list(other_lines(robot.model, session, groups, rows))
    # there are a hundred of these: what only another valley would bring near is left unnamed
    tried = list[tuple[Tried, Interpretation]]()
    for other, one in (*numbers, *mixed):
        own = F if one.q is read.q else None  # most leave the joints as they are
        left = misfit_of(robot.model, one, one_valley=True, F=own)
        tried.append((Tried(other, left), one))
    for count, left in ratios_that_fit(robot, read, stated):
        tried.append((Tried(coupling_of(count), left), replace(read, q=count.q)))
    if stated.score > SUSPECT:
        for named in exchanged_names(robot.model, session, groups, rows):
            tried.append((Tried(named.alternative, misfit_of(robot.model, named.read)), named.read))
    some_lines = lines or other_rows(session, rows)
    tried += [(_of_rows(robot.model, one, stated.score), one.read) for one in some_lines]
    # dear, and only where nothing else explains the rows
    least = min(stated.score, *(one.misfit.score for one, _ in tried))
    if least > FAR and (turned := quarter_turns(robot.model, read)) is not None:
        tried.append((Tried(turned[0], misfit_of(robot.model, turned[1])), turned[1]))
    tried.sort(key=lambda one: one[0].misfit.score)
    exact = exactness(robot.model, session, some, stated)
    odd = (exact, *_warnings(robot, session, some, stated), *_others(robot, session, groups, rows))
    found = replace(
        plain,
        stated=stated,
        tried=tuple(one for one, _ in tried),
        exact=bool(exact),
        warnings=tuple(filter(None, odd)),
        no_target=not_on_one_tool(session, groups),
    )
    if links:
        found = _with_links(found, robot, session, read, [one for _, one in tried])
    if found.linked is not None or found.wrong is not None or stated.score <= found.far:
        return found
    full = as_read(session, rows)  # an arm is measured in the order of the rows
    moved = parts_of(flange_poses(robot.model, full.q), full.position, full.rotation)
    return found if moved is None else replace(found, moved_at=session.place[rows[moved]])


def _with_links(
    found: Probe,
    robot: Robot,
    session: Session,
    read: Interpretation,
    others: Sequence[Interpretation],
) -> Probe:
    """The same with links fitted as well, where frames alone leave doubt of what was read.

    Readings that only the links explain are those of an arm far from nominal. Where they explain
    another reading instead, it is that one.
    """
    stated = found.stated
    if stated is None or stated.score <= FAR / TIMES or found.wrong is not None:
        return found

    def linked(one: Interpretation, left: Misfit) -> LinksFit | None:
        if not np.isfinite(left.score):
            return None
        return links_fit(robot.model, table_of(one), left.score, stated=_link_sd(robot, session))

    own = linked(read, stated)
    if own is not None and own.explains:
        return _far_off(found, own)
    tried = list(found.tried)
    for k, one in enumerate(tried[:MOST_LINKS]):
        if one.misfit.score >= stated.score:
            continue
        links = linked(others[k], one.misfit)
        # an arm that bends: what no links explain stays nearly the same, however it is read
        alike = own is not None and links is not None and links.left * CLEARLY > own.left
        tried[k] = replace(one, linked=links if links and links.explains and not alike else None)
    return replace(found, tried=tuple(tried))


def _far_off(found: Probe, links: LinksFit | None) -> Probe:
    """The same with links that explain what was read, and a warning if it is odd."""
    if links is None or not links.explains or found.stated is None:
        return found
    left = found.stated
    text = f"base and tool alone leave {left.shown}, far more than usual, and {links.sentence}"
    said = (text,) if left.score > found.far else ()
    return replace(found, linked=links, warnings=(*found.warnings, *said))


def _link_sd(robot: Robot, session: Session) -> Array | None:
    """How far links may be off (n, 5), by the session or else by the robot's file."""
    return session.link_sd if session.link_sd is not None else robot.tolerances


def _others(
    robot: Robot, session: Session, groups: Sequence[Index], judged: Index
) -> Iterator[str]:
    """The targets besides the one that is judged whose places a controller made."""
    table = session.measurements
    for rows in groups:
        if rows is judged or len(np.unique(table.q[rows], axis=0)) < FEWEST:
            continue
        some = spread_out(rows)
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
        if misfit_of(model, as_read(session, spread_out(rows))).score > FAR:
            return rows
    return groups[0]


def _extent(points: Array) -> float:
    """Root mean square distance of points (m, 3) from their middle [m]."""
    return float(np.sqrt(np.square(points - points.mean(axis=0)).sum(axis=1).mean()))


def _warnings(robot: Robot, session: Session, rows: Index, stated: Misfit) -> tuple[str, ...]:
    """What looks odd though the reading is right."""
    if session.read_back is None:
        return ()
    other = replace(as_read(session, rows), q=session.read_back[rows])
    left = misfit_of(robot.model, other)
    if left.position >= BETTER * stated.position:
        return ()
    name = "commanded" if session.joint_source == "read-back" else "read-back"
    said = f"the {name} joints fit better: base+tool leave {left.shown} instead of {stated.shown}"
    return (said,)


def _probe_distances(plain: Probe, robot: Robot, session: Session) -> Probe:
    """The same for distances alone, by the general start, which is slow where nothing fits.

    Other readings are tried only if the stated one fails, and no longer than until one fits.
    """
    rows = spread_out(np.arange(len(session.measurements)))
    table = session.measurements.rows(rows)
    if len(np.unique(session.measurements.q, axis=0)) < FEWEST:
        return plain
    model = RobotModel(robot.model.chain, robot.model.joint_errors, session.fixtures)
    reach = float(np.ptp(flange_poses(robot.model, table.q)[:, :3, 3], axis=0).max())

    def misfit(some: Measurements, least: float = LEAST_SPAN * reach) -> Misfit:
        # no point of the tool comes nearer to an anchor, or farther, than the robot moves it
        spans = [np.ptp(some.distance[some.anchor == k]) for k in np.unique(some.anchor)]
        if not least < max(spans) < 2 * reach + TOOL:
            return Misfit(float("inf"), 0.0)
        try:
            start = start_frames(model, some, free_anchors=session.free_anchors)
        except InputError:
            return Misfit(float("inf"), 0.0)
        return Misfit(start.position_rms, 0.0)

    stated = misfit(table, -1.0)  # a bar of one length has no span
    tried: list[Tried] = []
    others = chain(distance_alternatives(table), _other_distances(session.measurements))
    for alternative, other in others if stated.position > FAR / TIMES else ():
        tried.append(Tried(alternative, misfit(other)))
        if stated.score > TIMES * tried[-1].misfit.score:
            break
    tried.sort(key=lambda one: one.misfit.score)
    found = replace(plain, stated=stated, tried=tuple(tried), no_target=_too_short(session, stated))
    if FAR < stated.score < float("inf") and found.wrong is None:
        sd = _link_sd(robot, session)
        free = session.free_anchors
        found = _far_off(found, links_fit(model, table, stated.score, stated=sd, free_anchors=free))
    return found


def _too_short(session: Session, stated: Misfit) -> InputError | None:
    """The error of distances so short that none tells its direction; None if there are none."""
    table = session.measurements
    short = table.is_distance & (table.distance < SHORT * stated.position)
    if not stated.score <= FAR or short.sum() <= table.is_distance.sum() / 2:
        return None
    most = millimetres(float(table.distance[short].max()), 2)
    return refusal(
        session.where, "distance",
        f"{counted(int(short.sum()), 'distance')} of at most {most} mm {NO_DIRECTION}", code="M32",
        allowed=f"distances well above the {stated.shown} that base and tool leave",
        fix=BAR,
    )  # fmt: skip


def _other_distances(table: Measurements) -> Iterator[tuple[Alternative, Measurements]]:
    """Distances of one row with the joints of another."""
    for shift in (1, -1, 2, -2):  # fewer: each takes a slow start
        low, high = max(0, -shift), len(table) - max(0, shift)
        if high - low >= FEWEST:
            some = spread_out(np.arange(low, high))
            yield shifted(shift), replace(table.rows(some), distance=table.distance[some + shift])
