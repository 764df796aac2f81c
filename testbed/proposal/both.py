"""Points and distances of one robot as one session, if its files can be read together."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, evenly
from calib.errors import InputError
from calib.geometry.frames import target_points
from testbed.files.frames_fit import FAR, Frames, fit_frames, flange_poses, target_groups
from testbed.files.rows.shifts import FEWEST
from testbed.files.session import Session
from testbed.proposal.data import Document, files_of
from testbed.proposal.drafts import Draft
from testbed.proposal.rows.clocks import REACH
from testbed.robots.robot import Robot

OPTICAL = ("frames", "points")
FITTED, STEPS = 300, 10
"""Most rows that frames are fitted to; steps from the closed form of an anchor's position."""
SAME = 1e-6
"""Relative difference below which a distance is the length of the point in its row."""


@dataclass(frozen=True, slots=True)
class Joined:
    """A session with points and distances, or the reason why there is none."""

    draft: Draft | None
    sentence: str
    """How well the distances fit the points, or why they cannot be used."""


def is_ranged(draft: Draft) -> bool:
    """Whether a draft reads distances."""
    return "ranges" in draft.document


def joined_with(
    optical: Draft, ranged: Iterable[Draft], robot: Robot, read: Callable[[Draft], Session]
) -> Joined:
    """One session with the positions of a draft and the distances of one of several others.

    Parameters
    ----------
    optical : Draft
        Draft of the positions, which fits by itself.
    ranged : iterable of Draft
        Drafts of the same distances, one for each possible interpretation.
    robot : Robot
        Nominal robot.
    read : callable
        Reads a draft as a session, or raises an InputError.
    """
    drafts = [draft for one in ranged if (draft := merged(optical, one)) is not None]
    against, best, least = ["the files do not give the joints of both in one way"], None, np.inf
    # joints in the rows of the readings are preferred to those of another file
    for draft in sorted(drafts, key=lambda one: "match" in one.document):
        try:
            session = read(draft)
        except InputError as error:
            against.append(str(error))
            continue
        few = [name for name, count in _counts(session).items() if count < FEWEST]
        if few:
            against.append(f"fewer than {FEWEST} of them would have to find the place of {few[0]}")
            continue
        if _same_reading(session):
            return Joined(None, "they are the lengths of the positions beside them")
        if (left := _left(robot, session)) < least:
            best, least = draft, left
    if best is None:
        return Joined(None, against[-1])
    if least > FAR:
        return Joined(None, f"no reading of them leaves less than {1e3 * FAR:g} mm beside these")
    return Joined(best, f"the distances beside them leave {1e3 * least:.2g} mm")


def merged(optical: Draft, ranged: Draft) -> Draft | None:
    """A session with the tables of both; None if their joints are given in different ways."""
    one, two = optical.document, ranged.document
    name = next(section for section in OPTICAL if section in one)
    joints = one["joints"]
    if joints != two["joints"]:
        own = [_own(each, each[key]) for each, key in ((one, name), (two, "ranges"))]
        if own[0] is None or own[0] != own[1]:
            return None
        joints = own[0]
    ways = {each["match"] for each in (one, two) if "match" in each}
    if len(ways) > 1 or one.get("dialect") != two.get("dialect"):
        return None
    document: Document = {"match": ways.pop()} if ways else {}
    reaches = [each[REACH] for each in (one, two) if REACH in each]
    document |= {REACH: max(reaches)} if reaches else {}
    document |= {"joints": joints} if joints else {}
    document |= {name: one[name], "ranges": two["ranges"]}
    document |= {"dialect": one["dialect"]} if "dialect" in one else {}
    document |= {"uncertainty": one["uncertainty"] | two["uncertainty"]}
    notes = tuple(dict.fromkeys((*optical.notes, *ranged.notes)))
    return Draft(document, notes, optical.jointless)


def _own(document: Document, section: Document) -> Document | None:
    """[joints] without its file, if that is the file of the readings."""
    joints = document["joints"]
    if any(joints.get(key) != section.get(key) for key in ("file", "sheet")):
        return None
    return {key: value for key, value in joints.items() if key not in ("file", "sheet")}


def _counts(session: Session) -> dict[str, int]:
    """Number of distances from each fixed point whose position is unknown."""
    anchors = session.measurements.anchor.tolist()
    return {session.anchor_names[k]: anchors.count(k) for k in session.free_anchors}


def _same_reading(session: Session) -> bool:
    """Whether each distance is the length of the point in its own line."""
    table = session.measurements
    points = {session.place[k]: k for k in np.flatnonzero(~table.is_distance)}
    rows = [int(k) for k in np.flatnonzero(table.is_distance) if session.place[k] in points]
    if not rows:
        return False
    length = np.linalg.norm(table.position[[points[session.place[k]] for k in rows]], axis=1)
    return bool((np.abs(table.distance[rows] - length) <= SAME * length).all())


def _left(robot: Robot, session: Session) -> float:
    """Root mean square residual of distances, with the tool where the positions put it [m]."""
    table, groups = session.measurements, target_groups(session.measurements)
    far = np.flatnonzero(table.is_distance)
    if not groups or not len(far):
        return np.inf
    rows = evenly(groups[0], FITTED)
    F = flange_poses(robot.model, table.q[rows])
    frames = fit_frames(
        F, table.position[rows], table.rotation[rows] if table.is_pose[rows[0]] else None
    )
    squares, count = 0.0, 0
    for anchor in np.unique(table.anchor[far]):
        for target in np.unique(table.reflector[far]):
            these = far[(table.anchor[far] == anchor) & (table.reflector[far] == target)]
            if len(these):
                left = _of_anchor(robot, session, frames, evenly(these, FITTED))
                squares, count = squares + float(left @ left), count + len(left)
    return float(np.sqrt(squares / count))


def _of_anchor(robot: Robot, session: Session, frames: Frames, rows: Index) -> Array:
    """Residuals of distances (m,) after fitting the fixed point, and the reflector if free [m].

    The fixed point starts from the closed form for spheres about the tool, and is refined by steps;
    the reflector is that of the positions, or near it if it may be another one.
    """
    table = session.measurements
    F, d = flange_poses(robot.model, table.q[rows]), table.distance[rows]
    tip = target_points(F, frames.arm)
    A = np.column_stack([2 * tip, np.ones(len(tip))])
    place = np.linalg.lstsq(A, (tip**2).sum(1) - d**2, rcond=None)[0][:3]
    x = np.concatenate([place, frames.arm])
    free = 6 if len(rows) > 9 else 3
    for _ in range(STEPS):
        away = target_points(F, x[3:]) - x[:3]
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        unit = away / length[:, None]
        J = np.hstack([-unit, np.einsum("mi,mij->mj", unit, F[:, :3, :3])])[:, :free]
        x[:free] += np.linalg.lstsq(J, d - length, rcond=None)[0]
    away = target_points(F, x[3:]) - x[:3]
    return np.asarray(d - np.linalg.norm(away, axis=1))


def names_of(drafts: Sequence[Draft]) -> str:
    """The files of the readings of some drafts."""
    tables = [each.document[key] for each in drafts for key in (*OPTICAL, "ranges")
              if key in each.document]  # fmt: skip
    return ", ".join(dict.fromkeys(name for each in tables for name in files_of(each)))
