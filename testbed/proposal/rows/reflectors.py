"""Files of one reflector each, as another interpretation of files that look alike."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from testbed.proposal.data import Document, Found
from testbed.proposal.drafts import EACH_A_STATION, Draft

EACH_A_REFLECTOR = (
    "reflectors: each file is one, called like the file: they stay as far from each other at all "
    "poses, as on one tool before one station"
)
"""What is taken as said of files that may be of one reflector each."""
FEWEST = 2


def with_reflectors(drafts: Sequence[Draft], looks: Sequence[Found]) -> Iterator[Draft]:
    """The same drafts, each behind the one by which its files are of one reflector each, if any.

    Such a session cannot be read unless the reflectors stay together, whatever the robot is: where
    it can be, it is the likely one.
    """
    taken: set[str] = set()
    for draft in drafts:
        other = _by_reflector(draft, looks)
        if other is not None and (key := repr(other.document)) not in taken:
            taken.add(key)
            yield other
        yield draft


def _by_reflector(draft: Draft, looks: Sequence[Found]) -> Draft | None:
    """A draft whose file of points, and all of its kind, are of one reflector each."""
    points: Document | None = draft.document.get("points")
    if points is None or draft.jointless or points.get("sheet") or "targets" in points:
        return None
    names = points.get("files") or [points.get("file")]
    first = next((one for one in looks if one.name == names[0]), None)
    if first is None or first.kind not in ("table", "points", "bare"):
        return None
    joints: Document = draft.document.get("joints", {})
    alike = [one for one in looks if _form(one) == _form(first)]
    own = joints.get("file") in (None, first.name)
    alike = [one for one in alike if own or one.name != joints.get("file")]
    if draft.document.get("match") == "order":  # a file that lacks a row belongs to no joints
        alike = [one for one in alike if one.rows == first.rows]
    stems = [Path(one.name).stem for one in alike]
    if len(alike) < FEWEST or len(set(stems)) < len(stems):
        return None
    files = {stem: one.name for stem, one in zip(stems, alike, strict=True)}
    keys = {key: value for key, value in points.items() if key not in ("file", "files")}
    document = draft.document | {"points": {"reflector_files": files, **keys}}
    if own:
        document["joints"] = {key: value for key, value in joints.items() if key != "file"}
        document.pop("match", None)
    notes = tuple(note for note in draft.notes if note != EACH_A_STATION)
    return replace(draft, document=document, notes=(*notes, EACH_A_REFLECTOR))


def _form(look: Found) -> object:
    """What tables of one kind have in common."""
    return (look.kind, look.head if look.kind == "table" else (look.width, look.names), look.sheet)
