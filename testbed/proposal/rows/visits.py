"""Files with equal headers and joints of their own: visits of one robot, or held-out poses."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from testbed.files.dialects.numbers import number_of, pointed
from testbed.proposal.data import Document, Found, files_of
from testbed.proposal.rows.clocks import REACH
from testbed.units import listed

HELD_OUT = frozenset(
    {"test", "tests", "testing", "validation", "validate", "val", "verification", "verify"}
    | {"check", "heldout", "holdout", "held", "evaluation", "evaluate", "eval", "judge", "judging"}
)
"""Words in the names of files whose poses are meant to judge a calibration."""
OTHER = 0.01
"""Part of a joint's travel from which its value is another: read back, it never comes back exactly.
"""


def visits_in(document: Document, looks: Sequence[Found]) -> tuple[Document, str] | None:
    """The session with each of its files as a visit, and that in words; None if they are not.

    A file called ``test.csv`` or so, or in a folder of such a name, judges beside others, with the
    base and tool of the first of these. If poses of one name have the same joints, the files are
    measurements by several stations.
    """
    alike = _alike(document, looks)
    if not alike or any(one.sheet or one.head != alike[0].head for one in alike):
        return None
    joints = _joint_columns(document, alike[0])
    if not joints or _same_poses(alike, joints):
        return None
    own: Document = {
        key: {name: value for name, value in each.items() if name not in ("file", "files")}
        if isinstance(each, dict)
        else each
        for key, each in document.items()
        if key not in ("match", REACH)
    }
    stems = [Path(one.name).stem for one in alike]
    whole = [one.name.replace("/", " ") for one in alike]  # a / stands before the name of a pose
    names = stems if len(set(stems)) == len(stems) else whole
    judging = [not HELD_OUT.isdisjoint(re.split(r"[\W\d_]+", name.lower())) for name in whole]
    if all(judging):
        judging = [False] * len(names)
    first = names[judging.index(False)]
    own["session"] = [
        {"name": each, "file": one.name}
        | (
            {"base": f"same as {first}", "tool": f"same as {first}", "held_out": True}
            if judges
            else {"base": "free", "tool": "free"}
        )
        for each, one, judges in zip(names, alike, judging, strict=True)
    ]
    return own, _said(alike, judging, first)


def counted_anew(alike: Sequence[Found]) -> bool:
    """Whether a name of one file stands for other joints in another of the same columns.

    The names are counts of rows then, and do not tell which poses of two files are one.
    """
    joints = _joints_of(alike[0])
    if not joints or not alike[0].has("pose_id"):
        return False
    names = [name for one in alike for name in one.column(one.stems["pose_id"].theirs)]
    q = np.column_stack(
        [[number_of(pointed(cell) if "," in cell else cell) for cell in _all(alike, joint)]
         for joint in joints]
    )  # fmt: skip
    file = np.repeat(np.arange(len(alike)), [one.rows for one in alike])
    first: dict[str, int] = {}
    again = [(first.setdefault(name, k), k) for k, name in enumerate(names)]
    pairs = np.array([(a, b) for a, b in again if file[a] != file[b]], dtype=int).reshape(-1, 2)
    return bool((np.abs(q[pairs[:, 1]] - q[pairs[:, 0]]) > OTHER * np.ptp(q, axis=0)).any())


def _all(alike: Sequence[Found], column: str) -> list[str]:
    """Cells of a column in all files."""
    return [cell for one in alike for cell in one.column(column)]


def _joints_of(look: Found) -> list[str]:
    """Names of its columns of joints."""
    return [one.theirs for one in look.meanings if _is_joint(one.stem)]


def _is_joint(stem: str) -> bool:
    """Whether a column is that of a joint."""
    return stem[:1] == "q" and stem[1:2].isdigit()


def _alike(document: Document, looks: Sequence[Found]) -> list[Found]:
    """The files that are read as one of them is; of one that was tried for all, those like it.

    These are of its form where none has a header, or count their poses anew.
    """
    tables = {key: each for key, each in document.items() if isinstance(each, dict)}
    name = tables.get("joints", {}).get("file")
    several = [each for each in tables.values() if "files" in each]
    seen = next((each for each in several if name is None or name in each["files"]), None)
    if seen is not None:
        return [one for one in looks if one.name in seen["files"]]
    read = {name for each in tables.values() for name in files_of(each)}
    one = next((one for one in looks if {one.name} == read), None)
    if one is None:
        return []
    found = [each for each in looks if _form(each) == _form(one)]
    told = one.kind == "bare" or (one.kind == "table" and counted_anew(found))
    return found if len(found) > 1 and told else []


def _form(one: Found) -> tuple[object, ...]:
    """The columns of a table, or how many names and numbers its rows have without a header."""
    bare = (one.names, one.width) if one.kind == "bare" else one.head
    return one.kind, *bare


def _joint_columns(document: Document, look: Found) -> list[str]:
    """Columns of the joints, by their names or, without a header, as the session has them."""
    if look.kind != "bare":
        return _joints_of(look)
    stated = document.get("joints", {}).get("columns", {})
    return [str(stated[key]) for key in stated if _is_joint(key)]


def _said(alike: Sequence[Found], judging: Sequence[bool], first: str) -> str:
    """What is assumed of the files."""
    judges = [one.name for one, is_one in zip(alike, judging, strict=True) if is_one]
    visits = (
        f"{len(alike) - len(judges)} files have the same columns and joints of their own: each is "
        'a visit of the robot with its own base and tool; write "same as NAME" where one stayed'
    )
    if not judges:
        return f"sessions: {visits}"
    its, judge = ("its name", "judges") if len(judges) == 1 else ("their names", "judge")
    held = (
        f"by {its} {listed(judges)} only {judge} the calibration, with the base and tool of "
        f'{first}; where tracker or target were moved, write base = "free" or tool = "free", and '
        "frame_poses = 10"
    )
    alone = len(alike) - len(judges) == 1
    return f"sessions: {held}" if alone else f"sessions: {held}. Of the others, {visits}"


def _same_poses(alike: Sequence[Found], joints: Sequence[str]) -> bool:
    """Whether poses of one name have the same joints in all files, and each file has such poses."""
    known: dict[str, tuple[object, ...]] = {}
    if not alike[0].has("pose_id"):
        rows = [[*zip(*map(one.column, joints), strict=True)] for one in alike]
        return alike[0].kind == "bare" and all(own == rows[0] for own in rows)
    for k, one in enumerate(alike):
        names = one.column(one.stems["pose_id"].theirs)
        own = dict(zip(names, zip(*map(one.column, joints), strict=True), strict=True))
        if k and not known.keys() & own.keys():
            return False
        if any(known.get(name, value) != value for name, value in own.items()):
            return False
        known |= own
    return True
