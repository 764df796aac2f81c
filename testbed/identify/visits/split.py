"""Which rows of several visits identify, which fit the frames of held-out ones, which judge."""

from dataclasses import replace

import numpy as np

from calib.arrays import Bool, frozen
from calib.measurement.observations import Measurements
from testbed.files.refusal import refusal
from testbed.files.session import Session
from testbed.files.visits.visit import RobotVisit
from testbed.identify.records import HeldOutSplit
from testbed.identify.splitting import groups, split_of
from testbed.streams import stream
from testbed.units import counted

FIND = 3
"""Distances that find the three numbers of a point."""


def split_of_session(
    session: Session, *, train: int | None, held_out: int | None, seed: int
) -> HeldOutSplit:
    """The split of a session, of one visit or of several; arguments as those of `split_of`.

    Poses that the frames of a held-out visit are fitted to neither identify nor judge; those at
    joints that another visit identifies from fit its frames, too.

    Raises
    ------
    InputError
        As `split_of`; M27: a held-out visit has no pose left to judge.
    """
    first = session.wanted.visits == "first"
    known = _at_known_joints(session)
    frames = _frame_rows(session, seed) | known
    stated = session.is_test & ~frames if session.split_stated else None
    split = split_of(
        session.measurements, stated, first_visits=first, train=train, held_out=held_out, seed=seed
    )
    require_anchors_seen(session, split)
    judges = [visit for visit in session.visits if visit.held_out]
    if not judges:
        return split
    used = split.is_train & ~frames
    table = session.measurements
    said = [
        f"{counted(_poses(table, used), 'pose')} to identify from, "
        f"{_poses(table, split.is_test)} held out"
    ]
    said += [
        f"{visit.frame_poses} more of {visit.name} to fit its frames, drawn at random (seed {seed})"
        for visit in judges
        if visit.frame_poses
    ]
    if known.any():
        said.append(f"{_poses(table, known)} no proof, because they are at training joints")
    return replace(split, is_train=frozen(used, np.bool_), sentence="; ".join(said))


def require_anchors_seen(session: Session, split: HeldOutSplit) -> None:
    """Refuse held-out distances from points whose place no row that identifies finds.

    Raises
    ------
    InputError
        M27: names the anchor, and how many distances find it.
    """
    table = session.measurements
    for k in session.free_anchors:
        own = table.is_distance & (table.anchor == k)
        count = _poses(table, own & split.is_train)
        if count >= FIND or not (own & split.is_test).any():
            continue
        name = session.anchor_names[k]
        raise refusal(
            session.stated_in, "split",
            f'the place of the anchor "{name}" is to be found, and of '
            f"{counted(_poses(table, own), 'pose')} with a distance from it {count} identify",
            code="M27", value=count, allowed=f"it takes {FIND}",
            fix="let more of them identify, state its place (anchors_mm under [ranges]), or leave "
            "its rows out",
        )  # fmt: skip


def frame_rows(session: Session, split: HeldOutSplit) -> Bool:
    """Rows (m,) that the frames of held-out visits are fitted to."""
    return of_visits(session, [visit for visit in session.visits if visit.held_out]) & ~(
        split.is_test | split.is_train
    )


def of_visits(session: Session, some: list[RobotVisit]) -> Bool:
    """Rows (m,) of some of the visits."""
    if session.visit is None:
        return np.zeros(len(session.measurements), dtype=np.bool_)
    return np.isin(session.visit, [session.visits.index(visit) for visit in some])


def _at_known_joints(session: Session) -> Bool:
    """Rows (m,) of held-out visits at joints of rows to identify from: they are no proof."""
    held = of_visits(session, [visit for visit in session.visits if visit.held_out])
    if not held.any():
        return held
    pose = groups(session.measurements)
    return held & np.isin(pose, pose[~held & ~session.is_test])


def _frame_rows(session: Session, seed: int) -> Bool:
    """Rows of the poses drawn from each held-out visit; rows at one joint vector stay together."""
    found = np.zeros(len(session.measurements), dtype=np.bool_)
    for visit in session.visits:
        if not visit.frame_poses:
            continue
        own = of_visits(session, [visit])
        pose = groups(session.measurements)
        several = np.unique(pose[own])
        if len(several) <= visit.frame_poses:
            raise refusal(
                session.stated_in, "session.frame_poses",
                f'session "{visit.name}" has {counted(len(several), "pose")}, and its frames take '
                f"{visit.frame_poses} of them", code="M27", value=visit.frame_poses,
                allowed=f"{len(several) - 1} at most, so that one is left to judge",
                fix="lower frame_poses, or measure more poses",
            )  # fmt: skip
        draws = stream(seed, "frames", visit.name)
        found |= own & np.isin(pose, draws.choice(several, visit.frame_poses, replace=False))
    return found


def _poses(table: Measurements, rows: Bool) -> int:
    """Poses among some rows."""
    return len(np.unique(table.pose_id[rows]))
