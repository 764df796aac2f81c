"""Is the file read as it was meant? Base and tool are fitted for it and for other readings.

Only the nominal robot is needed: with the right reading its base and tool explain all but a
millimeter or so, with a wrong one they leave centimeters. Nothing is ever switched in silence.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from testbed.files.alternatives import (
    MIRROR,
    Interpretation,
    alternatives_of,
    coupling_of,
    small_rows,
    some_rows,
)
from testbed.files.frames_fit import FAR, TIMES, Misfit, far_for, flange_poses, target_groups
from testbed.files.reflectors.one_tool import named_target, not_on_one_tool
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
from testbed.files.tried.joint_signs import other_signs
from testbed.files.tried.link_order import in_craigs_order
from testbed.files.tried.links_fit import LinksFit, links_fit, table_of
from testbed.files.tried.mixed_lengths import mixed_lengths, nearer_rows
from testbed.files.tried.own_file import with_robot_toml
from testbed.files.tried.parts import parts_of
from testbed.files.tried.quarter_turns import quarter_turns
from testbed.files.tried.ranged import link_sd, probe_distances, with_links
from testbed.robots.robot import Robot

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
        return probe_distances(plain, robot, session)
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
    near = rows[nearer_rows(table.position[rows])]
    nearer = mixed_lengths(read, session.place[near[0]] if len(near) else "")
    lines = list(other_lines(robot.model, session, groups, rows))
    # there are a hundred of these: what only another valley would bring near is left unnamed
    tried = list[tuple[Tried, Interpretation]]()
    for other, one in (*numbers, *mixed, *nearer):
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
    if least > FAR and (ordered := in_craigs_order(robot.model, read)) is not None:
        tried.append((Tried(*ordered[:2]), ordered[2]))
    tried.sort(key=lambda one: one[0].misfit.score)
    tried = _with_signs(tried, robot, read, stated)
    exact = exactness(robot.model, session, some, stated)
    odd = (exact, *_warnings(robot, session, some, stated), *_others(robot, session, groups, rows))
    found = replace(
        plain,
        stated=stated,
        tried=tuple(with_robot_toml(one, robot) for one, _ in tried),
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


def _with_signs(
    tried: list[tuple[Tried, Interpretation]], robot: Robot, read: Interpretation, stated: Misfit
) -> list[tuple[Tried, Interpretation]]:
    """The same, best first, and signs of several joints if these explain readings best.

    In place of a left-handed frame alone, which explains points as well as they do: an arm is
    counted the other way more often than an export has such a frame.
    """
    best, least = tried[0][0], min(stated.score, tried[0][0].misfit.score)
    mirrored = best.alternative.name == MIRROR and stated.score > TIMES * least
    if least <= FAR and not mirrored:
        return tried
    mirror = best.alternative if mirrored else None
    found = other_signs(robot.model, robot.controller, read, mirror)
    if found is None:
        return tried
    left = misfit_of(robot.model, found[1])
    if left.score > CLEARLY * least:
        return tried
    return [(Tried(found[0], left), found[1]), *tried[mirrored:]]


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
        return links_fit(robot.model, table_of(one), left.score, stated=link_sd(robot, session))

    own = linked(read, stated)
    if own is not None and own.explains:
        return with_links(found, own)
    tried = list(found.tried)
    for k, one in enumerate(tried[:MOST_LINKS]):
        if one.misfit.score >= stated.score:
            continue
        links = linked(others[k], one.misfit)
        # an arm that bends: what no links explain stays nearly the same, however it is read
        alike = own is not None and links is not None and links.left * CLEARLY > own.left
        tried[k] = replace(one, linked=links if links and links.explains and not alike else None)
    return replace(found, tried=tuple(tried))


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
