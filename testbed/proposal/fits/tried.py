"""The draft of a session that fits best, after fitting base and tool of the nominal robot."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from calib.errors import InputError
from testbed.files.frames_fit import FAR, TIMES, Misfit
from testbed.files.probe import probe
from testbed.files.read import session_of
from testbed.files.refusal import refusal
from testbed.files.rows.shifts import FEWEST
from testbed.files.session import Session
from testbed.files.session_toml import SESSION_FILE, SessionFile
from testbed.files.sources import Sources
from testbed.files.tried.beyond_limits import explained as by_other_zeros
from testbed.files.tried.interpretations import ABSURD, WAY
from testbed.gates.mistakes import validated
from testbed.gates.text import MAX_MB
from testbed.proposal.both import Joined, is_ranged, joined_with, names_of
from testbed.proposal.data import Found, files_of
from testbed.proposal.drafts import Draft
from testbed.proposal.fits.between_targets import with_scatter
from testbed.proposal.fits.draft_fit import AXES, DraftFit, fit_of
from testbed.proposal.fits.far_off import far_off
from testbed.proposal.fits.poses_for_joints import poses_for_joints
from testbed.proposal.fits.rounds import rounds, without_words
from testbed.proposal.fits.seen_from_flange import seen_from_flange
from testbed.proposal.fits.sent import is_of_a_controller, places_of, without_sent
from testbed.proposal.fits.touches_alone import is_one_place, touches_alone
from testbed.proposal.rows.beginning import SEEN, beginnings
from testbed.proposal.rows.sideways import on_its_side
from testbed.proposal.rows.sorted_names import sorted_by_letters
from testbed.robots.robot import Robot
from testbed.units import counted

MOST_TURNED = 16
"""Drafts with joints beyond their limits that are tried with other zeros."""
GUESSED = ("M20", "M22", "M23", "V9")
"""Error codes of numbers with another meaning than assumed."""
BY_SIZE = "units and conventions are guessed from the numbers and from common use"


def tried_with(
    drafts: Sequence[Draft], looks: tuple[Found, ...], robot: Robot, root: Path
) -> tuple[Draft, str, bool]:
    """The draft that fits a robot best, how well it and others fit in words, and whether it fits.

    Parameters
    ----------
    drafts : sequence of Draft
        Drafts, the likely ones first.
    looks : tuple of Found
        The files.
    robot : Robot
        Nominal robot.
    root : Path
        Folder of the session.

    Raises
    ------
    InputError
        No draft can be read, or none fits and the fault of the file is known; the error is that of
        `identify`.
    """
    texts = beginnings([draft.document for draft in drafts], looks, root)

    def read(draft: Draft, *, drop: bool = True, arm: Robot = robot) -> Session:
        settings = validated(draft.document, SessionFile, SESSION_FILE)
        sources = Sources(root, None, MAX_MB, dict(texts))
        return session_of(settings, sources, arm, drop=drop, where=SESSION_FILE)

    def readable(draft: Draft) -> Session | None:
        try:
            return read(draft)
        except InputError:
            return None

    read_so = [readable(draft) for draft in drafts]
    whole: list[DraftFit] = []
    for sessions, parts, fits in rounds(robot, read_so):
        whole = whole or fits
        best = _best(drafts, sessions, fits)
        if fits[best].is_near:
            # a column that no name calls a distance: what else explains the files counts first
            guessed = drafts[best].guesses_distance
            if guessed and (told := poses_for_joints(looks, robot)) is not None:
                raise told
            best, made, aside = _by_an_instrument(drafts, sessions, fits, best, robot)
            same = [
                k for k, one in enumerate(drafts)
                if _seen(one) == _seen(drafts[best]) and k not in made
                and (k == best or not _same_rows(sessions[k], sessions[best]))
            ]  # fmt: skip
            others = [fits[k].left for k in same if k != best and fits[k].is_one]
            left = fits[best].left
            draft, more = _of_both(drafts, sessions, fits, best, robot, read)
            if draft is drafts[best]:
                draft, sent = without_sent(robot, draft, sessions[best])
                if sent:  # what is said is said of the readings that are used
                    left, others = fit_of(robot, read(draft), parts).left, []
                more += sent
            tried = _fitting(robot, left, others, len(same) - 1, parts)
            tried += without_words(read_so[best], sessions[best])
            return with_scatter(draft, sessions[best]), tried + aside + more, True
    if (touched := touches_alone(looks, robot)) is not None:
        raise touched
    if all(one.guesses_distance for one in drafts):
        raise unnamed(next(one for one in looks if one.kind == "bare"))
    likely = next((k for k, one in enumerate(read_so) if one is not None), None)
    if likely is None:
        try:
            read(drafts[0], drop=False)  # which says why
        except InputError as error:
            for draft in drafts[:MOST_TURNED]:
                better = by_other_zeros(error, robot, partial(_read_for, read, draft))
                if better is not error:
                    raise better from error
            turned = on_its_side(looks, robot.model.chain.n_joints)
            if (other := turned or poses_for_joints(looks, robot)) is not None:
                raise other from error
            nameless = next((one for one in looks if one.kind == "bare"), None)
            if nameless is None or error.code not in GUESSED:
                raise
            raise unnamed(nameless) from error
        raise AssertionError("a draft can be read that could not be")
    if (explained := far_off(read_so, [one.score for one in whole], robot)) is not None:
        return drafts[explained[0]], explained[1], True
    if (told := poses_for_joints(looks, robot)) is not None:
        raise told
    session = read_so[likely]
    assert session is not None
    found = probe(robot, session)
    if found.stated is None or found.wrong is not None:
        found.raise_if_wrong()
    elif (turned := on_its_side(looks, robot.model.chain.n_joints)) is not None:
        raise turned
    if found.stated is None:
        poses = len(np.unique(session.measurements.q, axis=0))
        few = f"{counted(poses, 'different pose')} in {session.where}, too few"
        if poses >= FEWEST:
            few = f"each point of the tool in {session.where} is at too few poses"
        tried = f"{few} to try interpretations of the file (at least {FEWEST}): {BY_SIZE}"
        return drafts[likely], tried, False
    if is_one_place(session):
        tried = (
            f"all readings in {session.where} are of one place, which fits any unit and leaves the "
            "lengths of the arm unknown: touch several, whose distances are known, or state how "
            f"near to nominal the links are ([prior]). {BY_SIZE.capitalize()}"
        )
        return drafts[likely], tried, False
    if (flange := seen_from_flange(session, robot)) is not None:
        raise flange
    tried = (
        f"none of {len(drafts)} interpretations of these files fits a nominal {robot.name}: is it "
        f"the robot that was measured? {BY_SIZE.capitalize()}"
    )
    if order := sorted_by_letters(looks):
        tried += f". {order}"
    return drafts[likely], tried, False


def _read_for(read: Callable[..., Session], draft: Draft, robot: Robot) -> Session:
    """A draft read for another robot."""
    return read(draft, arm=robot)


def unnamed(look: Found) -> InputError:
    """The error for rows without a header whose numbers are in none of the tried orders."""
    return refusal(
        str(look.path), "file",
        f"no line names its {look.width} columns, and they are no joints and places in any order "
        "that is tried", allowed="joints and places, or one; a rotation after a place; transforms",
        fix="name the columns in a first line: J1 ... J6, X Y Z; others by any other name",
    )  # fmt: skip


def _by_an_instrument(
    drafts: Sequence[Draft],
    sessions: Sequence[Session | None],
    fits: Sequence[DraftFit],
    best: int,
    robot: Robot,
) -> tuple[int, set[int], str]:
    """The best draft, or that of other columns if its own are a controller's poses.

    Also returns the drafts of those poses, and a sentence on them.
    """
    own = places_of(drafts[best])
    others = [
        k for k, one in enumerate(drafts)
        if fits[k].is_near and not is_ranged(one) and places_of(one) != own
    ]  # fmt: skip
    if not others or not is_of_a_controller(robot, sessions[best]):
        return best, set(), ""
    seen = [k for k in others if not is_of_a_controller(robot, sessions[k])]
    if not seen:
        return best, set(), ""
    aside = f". {', '.join(own)} are not used: they are a controller's own poses"
    made = {k for k, one in enumerate(drafts) if places_of(one) == own}
    return min(seen, key=lambda k: fits[k].noise), made, aside


def _of_both(
    drafts: Sequence[Draft],
    sessions: Sequence[Session | None],
    fits: Sequence[DraftFit],
    best: int,
    robot: Robot,
    read: Callable[[Draft], Session],
) -> tuple[Draft, str]:
    """The best draft with readings of the other kind, and how they fit or why they are not used."""
    ranged = [draft for draft in drafts if is_ranged(draft)]
    optical = [k for k, draft in enumerate(drafts) if not is_ranged(draft)]
    if not ranged or not optical:
        return drafts[best], ""
    good = [k for k in optical if fits[k].is_near]
    if not good:
        files = names_of([drafts[k] for k in optical])
        return drafts[best], f". No interpretation of the positions in {files} fits: not used"
    # within one kind the likely interpretations come first
    first = best if best in good else min(good, key=lambda k: fits[k].noise)
    found = Joined(None, "")
    for k in (first, *(k for k in good if k != first)):
        found = joined_with(drafts[k], ranged, robot, read)
        if found.draft is not None:
            return found.draft, f"; {found.sentence}"
    # a position counts like three distances
    rows = [0 if one is None else len(one.measurements) for one in sessions]
    kept = first if AXES * rows[first] >= rows[best] else best
    if kept == first and all(draft.guesses_distance for draft in ranged):
        return drafts[kept], ""  # no name says that there are any
    few = [drafts[k] for k in optical]
    aside, what = (ranged, "distances") if kept == first else (few, "positions")
    return drafts[kept], (
        f". The {what} in {names_of(aside)} are not used: in one session with the others, "
        f"{found.sentence}"
    )


def _fitting(robot: Robot, left: Misfit, others: Sequence[Misfit], count: int, parts: int) -> str:
    """Sentence on the misfit of a draft and of others, in parts of the rows."""
    tried = f"with only base and tool fitted to a nominal {robot.name}, errors are {left.shown}"
    if parts > 1:
        tried += (
            f" in one of {parts} equal parts of the file, but larger over all rows: something "
            "differs between these parts"
        )
    if others:
        least = min(others, key=lambda one: one.score)
        if least.score > ABSURD:
            tried += f"; none of {counted(count, WAY)} comes near the robot"
        else:
            tried += f"; with the best of {counted(count, WAY)}, {least.shown}"
        if least.score < TIMES * left.score:
            tried += ": too close to tell them apart"
    return tried


def _best(
    drafts: Sequence[Draft], sessions: Sequence[Session | None], fits: Sequence[DraftFit]
) -> int:
    """The draft of least estimated noise; among other files that fit, the one with most rows.

    A few rows always fit well, and would otherwise win over a file with many.
    """
    # a column of whole numbers splits the rows: they fit a little better whatever it means
    noise = [one.noise * (TIMES if draft.counts_targets else 1.0)
             for draft, one in zip(drafts, fits, strict=True)]  # fmt: skip
    first = int(np.argmin(noise))
    of_each: dict[str, int] = {}
    for k in np.argsort(noise, kind="stable"):
        of_each.setdefault(_seen(drafts[int(k)]), int(k))
    near = max(TIMES * noise[first], FAR / TIMES)
    # a draft of a finite misfit was read
    rows = {k: len(one.measurements) for k in of_each.values()
            if noise[k] <= near and (one := sessions[k]) is not None}  # fmt: skip
    return max(rows, key=lambda k: (rows[k], -noise[k]), default=first)


def _seen(draft: Draft) -> str:
    """The files and sheets of the readings of a draft."""
    tables = (draft.document.get(name, {}) for name in SEEN)
    return repr([(files_of(each), each.get("sheet")) for each in tables])


def _same_rows(one: Session | None, other: Session | None) -> bool:
    """Whether two interpretations of files give the same joints and positions."""
    if one is None or other is None:
        return False
    return all(
        np.array_equal(getattr(one.measurements, name), getattr(other.measurements, name))
        for name in ("q", "position", "rotation", "distance")
    )
