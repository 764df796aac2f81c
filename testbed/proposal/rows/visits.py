"""Files with equal headers and joints of their own: visits of one robot, or held-out poses."""

import re
from collections.abc import Sequence
from pathlib import Path

from testbed.proposal.data import Document, Found
from testbed.proposal.rows.clocks import REACH
from testbed.units import listed

HELD_OUT = frozenset(
    {"test", "tests", "testing", "validation", "validate", "val", "verification", "verify"}
    | {"check", "heldout", "holdout", "held", "evaluation", "evaluate", "eval", "judge", "judging"}
)
"""Words in the names of files whose poses are meant to judge a calibration."""


def visits_in(document: Document, looks: Sequence[Found]) -> tuple[Document, str] | None:
    """The session with each of its files as a visit, and that in words; None if they are not.

    A file called ``test.csv`` or so beside others judges, with the base and tool of the first
    other one. If poses of one name have the same joints, the files are measurements by several
    stations.
    """
    tables = {key: each for key, each in document.items() if isinstance(each, dict)}
    name = tables.get("joints", {}).get("file")
    several = [each for each in tables.values() if "files" in each]
    seen = next((each for each in several if name is None or name in each["files"]), None)
    alike = [one for one in looks if seen is not None and one.name in seen["files"]]
    if seen is None or any(one.sheet or one.head != alike[0].head for one in alike):
        return None
    joints = [
        one.theirs
        for one in alike[0].meanings
        if one.stem.startswith("q") and one.stem[1:2].isdigit()
    ]
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
    names = stems if len(set(stems)) == len(stems) else [one.name for one in alike]
    judging = [not HELD_OUT.isdisjoint(re.split(r"[\W\d_]+", stem.lower())) for stem in stems]
    if all(judging):
        judging = [False] * len(stems)
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
        return False
    for k, one in enumerate(alike):
        names = one.column(one.stems["pose_id"].theirs)
        own = dict(zip(names, zip(*map(one.column, joints), strict=True), strict=True))
        if k and not known.keys() & own.keys():
            return False
        if any(known.get(name, value) != value for name, value in own.items()):
            return False
        known |= own
    return True
