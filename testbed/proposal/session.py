"""A session.toml from a user's files: interpretations are tried with the nominal robot."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from testbed.proposal.beside import with_origin
from testbed.proposal.both import is_ranged, merged
from testbed.proposal.cycles import cycles_in
from testbed.proposal.data import Document, Found, files_of
from testbed.proposal.drafts import EACH_A_STATION, Draft, drafts_of
from testbed.proposal.fits.places_alone import places_alone
from testbed.proposal.fits.touches_alone import touches_alone
from testbed.proposal.fits.tried import tried_with
from testbed.proposal.missing import (
    columns_of,
    joints_in,
    no_reading,
    not_tried,
    require_joints,
    with_rows,
)
from testbed.proposal.naming.own_joints import with_joints
from testbed.proposal.rows.names_of_two import names_of_two
from testbed.proposal.rows.nominal_files import without_nominal
from testbed.proposal.rows.reflectors import with_reflectors
from testbed.proposal.rows.sideways import on_its_side
from testbed.proposal.rows.visits import visits_in
from testbed.proposal.verdict import verdict_on
from testbed.robots.robot import Robot
from testbed.toml_text import toml_key, toml_value

JOINTS = 6
"""Assumed number of joints if no robot is named."""


@dataclass(frozen=True, slots=True)
class Proposed:
    """The session that fits, or the likely one, and the evidence for it."""

    document: Document
    assumed: tuple[str, ...]
    """Assumptions that no file states."""
    tried: str
    """How well this and other interpretations fit, in words."""
    fits: bool
    """Whether the robot fits the positions in the files."""
    unused: tuple[str, ...] = ()
    """Files, sheets or columns that are not read."""
    to_mend: tuple[str, ...] = ()
    """What `identify` would refuse, in its words."""
    odd: tuple[str, ...] = ()
    """What it would leave out, or warn of."""
    is_test: bool = False
    """Whether it is for `iso9283`, not for `identify`."""
    drops: bool = False
    """Whether that takes the rows that are left only with `verdict.DROP`."""


def propose_session(
    looks: tuple[Found, ...], robot: Robot | None, root: Path, aside: Sequence[str] = ()
) -> Proposed:
    """The session that some files are most likely to be.

    Parameters
    ----------
    looks : tuple of Found
        Tables that were found.
    robot : Robot or None
        Robot with which interpretations are tried; without it units follow from sizes.
    root : Path
        Folder of the session.
    aside : sequence of str
        What was left out before, in words.

    Raises
    ------
    InputError
        M27: a file has no rows; M35: no file has readings, or headers do not fit together; or the
        error of reading the files, if no interpretation can be proposed.
    """
    covers = (*aside, *(one.called for one in looks if not one.rows))
    looks, sent = without_nominal(with_rows(looks))
    covers += sent
    cycles = cycles_in(looks, root)
    if cycles is not None and cycles.document is not None:
        return Proposed(
            cycles.document, cycles.assumed, cycles.sentence, fits=False, unused=covers,
            to_mend=cycles.refused, odd=cycles.odd, is_test=True, drops=cycles.drops,
        )  # fmt: skip
    if (parted := names_of_two(looks)) is not None:
        raise parted
    proposed = _with_visits(_proposed(looks, robot, root), looks)
    said_so = {key: each for key, each in proposed.document.items() if key != "joints" or each}
    proposed = replace(proposed, document=with_origin(said_so, looks))
    read = {
        (name, each.get("sheet"))
        for table in proposed.document.values()
        for each in (table if isinstance(table, list) else [table])
        if isinstance(each, dict)
        for name in files_of(each)
    }
    unused = tuple(
        _left_aside(one, looks, proposed.document)
        for one in looks
        if (one.name, one.sheet) not in read
    )
    said = verdict_on(proposed.document, looks, robot, root, fits=proposed.fits)
    odd = said.odd if cycles is None else (*said.odd, cycles.sentence)
    return replace(
        proposed, unused=(*covers, *unused, *said.unread), to_mend=said.refused, odd=odd,
        drops=said.drops,
    )  # fmt: skip


def _left_aside(look: Found, looks: Sequence[Found], document: Document) -> str:
    """A file that is not used, and what to do if it has one more target, beside those of [points].

    It has as many rows then, and the same columns; with others it lacks some, or has too many.
    """
    used = files_of(document.get("points", {}))
    alike = [one for one in looks if one.name in used and one.head == look.head
             and one.kind == look.kind]  # fmt: skip
    if not alike or look.has("pose_id"):
        return look.called
    if document.get("match") == "order" and look.rows != alike[0].rows:
        return (
            f"{look.called}: {look.rows} rows where {alike[0].called} has {alike[0].rows}, so its "
            "k-th reading does not belong to the k-th joints; give each reading the number of its "
            "pose in both files, or a row to each that was missed"
        )
    read = [one for one in alike if one.rows == look.rows and len(used) == 1]
    if not read:
        return look.called
    stems = [Path(one.name).stem for one in (read[0], look)]
    names = stems if len({*stems}) == len(stems) else [read[0].name, look.name]
    files = ", ".join(
        f"{toml_key(name)} = {toml_value(one.name)}"
        for name, one in zip(names, (read[0], look), strict=True)
    )
    return (
        f"{look.called}, of as many rows and the same columns as {read[0].called}: if it is of "
        f"another reflector on the same tool, write reflector_files = {{ {files} }} under [points]"
    )


def _with_visits(proposed: Proposed, looks: tuple[Found, ...]) -> Proposed:
    """The same, with each file as a visit or as held out, if it has joints of its own."""
    found = visits_in(proposed.document, looks)
    if found is None:
        return proposed
    document, said = found
    notes = tuple(note for note in proposed.assumed if note != EACH_A_STATION)
    return replace(proposed, document=document, assumed=(*notes, said))


def _drafts(
    choices: Sequence[tuple[Found, ...]], own: tuple[int, ...], slides: frozenset[int]
) -> list[Draft]:
    """Drafts from the likeliest choice of each file's joints, then from the second, and so on."""
    found: dict[str, Draft] = {}
    for k in range(max(map(len, choices), default=0)):
        looks = tuple(one[min(k, len(one) - 1)] for one in choices)
        for draft in drafts_of(looks, own, slides):
            found.setdefault(repr(draft.document), draft)
    return list(found.values())


def _proposed(looks: tuple[Found, ...], robot: Robot | None, root: Path) -> Proposed:
    """The same session without the files that it does not use."""
    own = columns_of(robot) if robot is not None else tuple(range(1, _count(looks) + 1))
    slides: frozenset[int] = frozenset()
    choices: list[tuple[Found, ...]]
    if robot is None:  # interpretations that only a fit can decide are not offered
        choices = [(replace(one, also=None),) for one in looks]
    else:
        kinds, names = robot.model.chain.kinds, robot.joint_names
        slides = frozenset(k for k in own if kinds[k - 1] == "prismatic")
        called = [names[k - 1] for k in own] if len(names) == len(kinds) else []
        choices = [with_joints(look, own, called) for look in looks]
    n = len(own)
    if len({one.rows for one in looks}) > 1 and (turned := on_its_side(looks, n)) is not None:
        raise turned  # no rows of one belong to those of another
    drafts = _drafts(choices, own, slides)
    if robot is None:
        drafts = [one for one in drafts if not one.guesses_distance]
    looks = tuple(one[0] for one in choices)
    if not drafts:
        raise (robot and touches_alone(looks, robot)) or no_reading(looks, n)
    first = _untried(drafts)
    if robot is not None:
        drafts = list(with_reflectors(drafts, looks))
    if robot is None:
        tried = (
            "no robot was named: units and conventions are guessed from the numbers and from "
            "common use"
        )
        return Proposed(first.document, first.notes, tried, False)
    if first.jointless:
        require_joints(looks, robot)
        return Proposed(first.document, first.notes, not_tried(looks, robot), False)
    best, tried, fits = tried_with(drafts, looks, robot, root)
    if not fits and (alone := places_alone(drafts, looks, robot, root)) is not None:
        (best, tried), fits = alone, True
    there = max(len(joints_in(one)) for one in looks)
    if not fits and there > n:
        tried += f". There are {there} joints, and {robot.name} has {n}"
    return Proposed(best.document, best.notes, tried, fits)


def _untried(drafts: list[Draft]) -> Draft:
    """The likely draft, with readings of the other kind if there are any."""
    first = drafts[0]
    others = [one for one in drafts if is_ranged(one) != is_ranged(first)]
    pairs = [(one, first) if is_ranged(first) else (first, one) for one in others]
    both = (joined for pair in pairs if (joined := merged(*pair)) is not None)
    return next(both, first)


def _count(looks: tuple[Found, ...]) -> int:
    """Number of joints of the robot, by the columns."""
    for look in looks:
        known = {f"q{k + 1}" for k in range(9)} & set(look.stems)
        if known:
            return len(known)
    return JOINTS
