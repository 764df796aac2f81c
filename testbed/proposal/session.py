"""A session.toml from the files of a user: readings tried with the nominal robot, and told."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.errors import InputError
from testbed.files.frames_fit import FAR, fit_frames, flange_poses, target_groups
from testbed.files.probe import FEWEST, TIMES, probe
from testbed.files.read import session_of
from testbed.files.refusal import refusal
from testbed.files.session import Session, Sources
from testbed.files.session_toml import SESSION_FILE, SessionFile
from testbed.gates.mistakes import validated
from testbed.gates.text import MAX_MB, FileText
from testbed.proposal.data import Found
from testbed.proposal.drafts import MATCHED, PARTS, drafts_of
from testbed.proposal.names import is_wished
from testbed.proposal.parts import Document
from testbed.robots.robot import Robot
from testbed.units import counted

JOINTS = 6
"""Of a robot that nobody names."""
TRIED, FITTED = 300, 60
"""Lines of one file that readings are tried with, and rows of them that frames are fitted to."""


@dataclass(frozen=True, slots=True)
class Proposed:
    """The session that fits, or that is likely, and how that is known."""

    document: Document
    assumed: tuple[str, ...]
    """What no file says."""
    tried: str
    """How well this and other readings fit, in words."""
    fits: bool
    """Whether the robot has been where the file says."""


def propose_session(looks: tuple[Found, ...], robot: Robot | None, root: Path) -> Proposed:
    """The session that some files are most likely to be.

    Parameters
    ----------
    looks : tuple of Found
        Tables that were found.
    robot : Robot or None
        With which readings are tried; without it units are taken by their size.
    root : Path
        Folder of the session.

    Raises
    ------
    InputError
        M35: no file has readings, or heads that do not go together.
    """
    proposed = _of_visits(_proposed(looks, robot, root), looks)
    read = {
        (name, each.get("sheet"))
        for table in proposed.document.values()
        for each in (table if isinstance(table, list) else [table])
        if isinstance(each, dict)
        for name in (each.get("file"), *each.get("files", ()))
    }
    left = [one for one in looks if (one.name, one.sheet) not in read]
    notes = tuple(f"files: {one.called} is not used" for one in left)
    return replace(proposed, assumed=(*proposed.assumed, *notes))


def _of_visits(proposed: Proposed, looks: tuple[Found, ...]) -> Proposed:
    """The same where files of one head have joints of their own: each is a visit of the robot.

    Where all have the same joints they are what several stations saw of the same poses.
    """
    tables = {key: each for key, each in proposed.document.items() if isinstance(each, dict)}
    name = tables.get("joints", {}).get("file")
    seen = next((each for each in tables.values() if name in each.get("files", ())), None)
    alike = [one for one in looks if seen is not None and one.name in seen["files"]]
    if seen is None or any(one.sheet or one.head != alike[0].head for one in alike):
        return proposed
    joints = [
        one.theirs
        for one in alike[0].meanings
        if one.stem.startswith("q") and one.stem[1:2].isdigit()
    ]
    if not joints or len({tuple(map(tuple, map(one.column, joints))) for one in alike}) == 1:
        return proposed
    document = {
        key: {own: value for own, value in each.items() if own not in ("file", "files")}
        if isinstance(each, dict)
        else each
        for key, each in proposed.document.items()
        if key != "match"
    }
    stems = [Path(one.name).stem for one in alike]
    names = stems if len(set(stems)) == len(stems) else [one.name for one in alike]
    document["session"] = [
        {"name": stem, "file": one.name, "base": "free", "tool": "free"}
        for stem, one in zip(names, alike, strict=True)
    ]
    notes = tuple(note for note in proposed.assumed if not note.startswith("stations: "))
    note = (
        f"sessions: {len(alike)} files have the same columns and other joints: each is a visit of "
        'the robot with its own base and tool; write "same as NAME" where one stayed'
    )
    return replace(proposed, document=document, assumed=(*notes, note))


def _proposed(looks: tuple[Found, ...], robot: Robot | None, root: Path) -> Proposed:
    """The same without the files that it leaves aside."""
    n = robot.model.chain.n_joints if robot is not None else _count(looks)
    drafts = list(drafts_of(looks, n))
    if not drafts:
        wished = [name for one in looks for name in one.head if is_wished(name)]
        fix = "name the columns, or name them under columns in session.toml by hand"
        if wished:
            fix = f"{', '.join(wished[:6])} are targets or differences: give what was measured"
        raise refusal(
            looks[0].name if looks else "DATA", "DATA", "has no readings that can be told",
            allowed="columns X Y Z, also with rotations; or points or frames of Spatial Analyzer",
            fix=fix,
        )  # fmt: skip
    if robot is None:
        tried = "no robot was named: units and conventions are by size and by custom"
        return Proposed(drafts[0].document, drafts[0].notes, tried, False)
    if drafts[0].jointless:
        tried = "there are no joints: nothing could be tried"
        return Proposed(drafts[0].document, drafts[0].notes, tried, False)
    texts = {(root / one.name, one.sheet): _beginning(one, looks) for one in looks}

    def read(document: Document) -> Session | None:
        try:
            settings = validated(document, SessionFile, SESSION_FILE)
            sources = Sources(root, None, MAX_MB, dict(texts))
            return session_of(settings, sources, robot, drop=True, where=SESSION_FILE)
        except InputError:
            return None

    sessions = [read(draft.document) for draft in drafts]
    # where a shot was missed, a part of the rows still shows the reading
    for parts in PARTS:
        scores = [_misfit(robot, session, parts) for session in sessions]
        order = np.argsort(scores, kind="stable")
        best, least = drafts[int(order[0])], scores[int(order[0])]
        if least <= FAR:
            break
    else:
        tried = (
            f"none of {len(drafts)} readings of these files fits a nominal {robot.name}: is it the "
            "robot that was measured? Units and conventions are by size and by custom"
        )
        return Proposed(drafts[0].document, drafts[0].notes, tried, False)
    others = [scores[int(k)] for k in order[1:] if np.isfinite(scores[int(k)])]
    tried = f"base and tool of a nominal {robot.name} alone leave {_shown(least)}"
    if others:
        tried += (
            f"; the best of {counted(len(drafts) - 1, 'other reading')} leaves {_shown(others[0])}"
        )
        if others[0] < TIMES * least:
            tried += ": too little to tell them apart"
    return Proposed(best.document, best.notes, tried, True)


def _misfit(robot: Robot, session: Session | None, parts: int) -> float:
    """What base and tool leave in the best of some parts of the rows of one target [m]."""
    if session is None:
        return np.inf
    table, groups = session.measurements, target_groups(session.measurements)
    if not groups and parts == 1:
        stated = probe(robot, session).stated
        return stated.score if stated is not None else np.inf
    if not groups or len(groups[0]) < FEWEST * parts:
        return np.inf
    left = []
    for stretch in np.array_split(groups[0], parts):
        spread = np.linspace(0, len(stretch) - 1, min(len(stretch), FITTED))
        rows = stretch[spread.round().astype(np.int64)]
        F = flange_poses(robot.model, table.q[rows])
        turned = table.rotation[rows] if table.is_pose[rows[0]] else None
        frames = fit_frames(F, table.position[rows], turned)
        left.append(frames.misfit(F, table.position[rows], turned).score)
    return min(left)


def _shown(score: float) -> str:
    """A misfit for people."""
    number, unit = (score * 1e3, "mm") if score < 1 else (score, "m")
    return f"{float(f'{number:.2g}'):g} {unit}"  # 600, where .2g alone has 6e+02


def _beginning(look: Found, looks: tuple[Found, ...]) -> FileText:
    """The text that readings are tried with: of one file, and of long ones, a part is enough."""
    whole = len(looks) > 1 and max(one.rows for one in looks) <= MATCHED
    lines = look.text.lines if whole else look.text.lines[:TRIED]
    return replace(look.text, lines=lines)


def _count(looks: tuple[Found, ...]) -> int:
    """Joints of the robot, as the columns have them."""
    for look in looks:
        known = {f"q{k + 1}" for k in range(9)} & set(look.stems)
        if known:
            return len(known)
    return JOINTS
