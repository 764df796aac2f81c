"""Whether distances are read as they were meant: by the general start, which is slow."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from hashlib import sha256
from itertools import chain

import numpy as np

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.identification.start.start import start_frames
from calib.measurement.observations import Measurements
from testbed.files.alternatives import Alternative, distance_alternatives, shifted
from testbed.files.frames_fit import FAR, TIMES, Misfit, flange_poses
from testbed.files.readings import BAR, NO_DIRECTION
from testbed.files.refusal import refusal
from testbed.files.rows.shifts import FEWEST, spread_out
from testbed.files.session import Session
from testbed.files.tried.interpretations import Probe, Tried
from testbed.files.tried.links_fit import LinksFit, links_fit
from testbed.robots.robot import Robot
from testbed.units import counted, millimetres

LEAST_SPAN, TOOL = 0.02, 1.0
"""Distances vary by at least this part of what the flange moves, and by that and a tool [m]."""
SHORT = 4.0
"""A distance of fewer times what nominal links leave may point any way. Of bars between a ball and
two sockets those of 0.5 mm, three times what they left, ended in a wrong valley, and those of 2 mm,
eleven times, did not."""

KEPT = 4
"""Answers that are kept: `new session` asks the same of a draft, of all that failed, in the end."""


def with_links(found: Probe, links: LinksFit | None) -> Probe:
    """The same with links that explain what was read, and a warning if it is odd."""
    if links is None or not links.explains or found.stated is None:
        return found
    left = found.stated
    text = f"base and tool alone leave {left.shown}, far more than usual, and {links.sentence}"
    said = (text,) if left.score > found.far else ()
    return replace(found, linked=links, warnings=(*found.warnings, *said))


def link_sd(robot: Robot, session: Session) -> Array | None:
    """How far links may be off (n, 5), by the session or else by the robot's file."""
    return session.link_sd if session.link_sd is not None else robot.tolerances


def probe_distances(plain: Probe, robot: Robot, session: Session) -> Probe:
    """Distances alone with what was found of them, if they are asked of again, from memory.

    Other readings are tried only if the stated one fails, and no longer than until one fits.

    Parameters
    ----------
    plain : Probe
        Of which session and robot.
    robot, session
        As `probe` takes them.
    """
    table, read = session.measurements, sha256()
    arrays = [getattr(part, one.name) for part in (table, table.conditions, session.fixtures)
              for one in fields(part)]  # fmt: skip
    for each in (*arrays, link_sd(robot, session)):
        if isinstance(each, np.ndarray):
            read.update(repr((each.dtype, each.shape)).encode() + each.tobytes())
    key = (read.digest(), session.where, id(robot), session.free_anchors)
    return _probed(_Asked(key, plain, robot, session))


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is asked of some distances: equal if the answer is."""

    key: tuple[object, ...]
    plain: Probe = field(compare=False)
    robot: Robot = field(compare=False)
    session: Session = field(compare=False)


@lru_cache(maxsize=KEPT)
def _probed(asked: _Asked) -> Probe:
    """The same, worked out."""
    plain, robot, session = asked.plain, asked.robot, asked.session
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
        sd = link_sd(robot, session)
        free = session.free_anchors
        links = links_fit(model, table, stated.score, stated=sd, free_anchors=free)
        found = with_links(found, links)
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
