"""Which sessions share a base, a tool or a payload: "same as NAME", followed to its end."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from testbed.files.refusal import refusal
from testbed.files.visits.tables import FREE, SAME, CampaignFile, VisitTable

PARTS = ("base", "tool", "payload")


@dataclass(frozen=True, slots=True)
class Sharing:
    """What each session has of which; sessions in the order in which they are identified."""

    order: tuple[int, ...]
    """Places in the file: those that identify first, held-out ones after them."""
    owner: dict[str, tuple[int, ...]]
    """base, tool, payload: place in the file of the session whose it is, for each session."""


def sharing_of(settings: CampaignFile, where: str) -> Sharing:
    """Who shares what.

    Raises
    ------
    InputError
        S37: a session without poses, two of one name, all of them held out, "same as" a session
        that is not there or in a circle, or frame_poses where they decide nothing or are missing.
    """
    visits = settings.session
    _require_names(visits, where)
    owner = {
        part: tuple(_owner(visits, k, part, where) for k in range(len(visits))) for part in PARTS
    }
    order = sorted(range(len(visits)), key=lambda k: (visits[k].held_out, k))
    if visits[order[0]].held_out:
        raise refusal(
            where, "session", "all sessions are held out: nothing is left to identify from",
            code="S37", fix="take held_out = true from one of them",
        )  # fmt: skip
    trained = {
        part: {owner[part][k] for k, one in enumerate(visits) if not one.held_out}
        for part in ("base", "tool")
    }
    for k, one in enumerate(visits):
        own = one.held_out and any(owner[part][k] not in trained[part] for part in trained)
        _require_frame_poses(one, own, where)
    return Sharing(tuple(order), owner)


def _require_names(visits: Sequence[VisitTable], where: str) -> None:
    """Refuse sessions without a name of their own, or without any readings."""
    names = [one.name for one in visits]
    for k, one in enumerate(visits):
        if one.name in names[:k]:
            raise refusal(
                where, "session.name", f'two sessions are called "{one.name}"', code="S37",
                value=one.name, fix="give each [[session]] a name of its own",
            )  # fmt: skip
        if "/" in one.name:
            raise refusal(
                where, "session.name", f'session "{one.name}" has a / in its name, which stands '
                "between session and pose", code="S37", value=one.name, fix="rename it",
            )  # fmt: skip
        if not one.names_a_file:
            raise refusal(
                where, "session.file", f'session "{one.name}" has no poses: it names no file',
                code="S37", fix='write file = "NAME.csv" in its [[session]]',
            )  # fmt: skip


def _owner(visits: Sequence[VisitTable], k: int, part: str, where: str) -> int:
    """Whose part session k has: its own, or at the end of "same as"."""
    names, seen = [one.name for one in visits], [k]
    own = None if part == "payload" else FREE
    while (said := getattr(visits[seen[-1]], part)) != own:
        one = visits[seen[-1]]
        other = said.removeprefix(SAME)
        if other == said or other not in names:
            close = get_close_matches(other, [name for name in names if name != one.name], 1)
            free = f'"{FREE}", and ' * (part != "payload")
            raise refusal(
                where, f"session.{part}", f'session "{one.name}": {part} is "{said}"', code="S37",
                value=said, allowed=f'allowed is {free}"{SAME}" with the name of another session',
                fix=f'did you mean "{SAME}{close[0]}"?' if close else "",
            )  # fmt: skip
        at = names.index(other)
        if at in seen:
            circle = " -> ".join(names[j] for j in (*seen[seen.index(at) :], at))
            free = f'write {part} = "{FREE}" in one of them'
            raise refusal(
                where, f"session.{part}", f'{part} "same as" goes in a circle: {circle}',
                code="S37", value=said,
                fix="state the payload of one of them" if part == "payload" else free,
            )  # fmt: skip
        seen.append(at)
    return seen[-1]


def _require_frame_poses(one: VisitTable, own_frames: bool, where: str) -> None:
    """Refuse frames that are fitted to nothing, and poses for frames that are not fitted."""
    if own_frames == (one.frame_poses is not None):
        return
    if own_frames:
        said = f'session "{one.name}" is held out and has frames of its own, fitted to nothing'
        fix = "write frame_poses = 10: so many of its poses fit them, the others judge"
    else:
        said = f'session "{one.name}" has frame_poses, and no frames to fit to them'
        fix = (
            "take frame_poses out: its base and tool are those of other sessions"
            if one.held_out
            else "add held_out = true, or take frame_poses out: all its poses identify"
        )
    raise refusal(where, "session.frame_poses", said, code="S37", value=one.frame_poses, fix=fix)
