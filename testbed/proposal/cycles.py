"""Rows that visit a few poses many times in turn, as a test after ISO 9283 does."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.errors import InputError
from testbed.files.dialects.marks import either_mark
from testbed.files.session_toml import SESSION_FILE
from testbed.files.sources import Given, Sources
from testbed.files.visits.tables import CampaignFile
from testbed.gates.mistakes import validated
from testbed.gates.text import MAX_MB
from testbed.iso9283.read import test_of
from testbed.proposal.data import Document, Found
from testbed.proposal.names import Meaning
from testbed.units import counted

MOST_POSES, FEWEST_CYCLES = 10, 10
"""Most poses of a test, and fewest visits of each; ten poses are too few for a calibration."""
IN_TURN = 0.9
"""Fraction of the rows whose pose must come again one cycle later."""
CYCLE = {"cycle", "cycle no", "cycle nr", "run", "loop", "zyklus"}
"""Names of a column that counts the cycles."""
REACH = 20.0
"""Size of positions above which they cannot be in meters [m]."""
TARGET, SEEN = ("command_x", "command_y", "command_z"), ("x", "y", "z")
COMMANDS = "commands.csv"
"""Name of a file that is still to be written."""
TURNS = ("rx", "ry", "rz")


@dataclass(frozen=True, slots=True)
class Cycles:
    """A session for `truebed iso9283`, or why there is none although rows come in cycles."""

    document: Document | None
    sentence: str
    """The cycles found, in words."""
    assumed: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    """What iso9283 would refuse, in its words."""
    odd: tuple[str, ...] = ()
    drops: bool = False
    """Whether it takes the others if those are left out."""


def cycles_in(looks: Sequence[Found], root: Path) -> Cycles | None:
    """The likely test in the only table of some files; None if its rows show no cycles.

    A second table may have the commanded positions, one for each pose.
    """
    found = [(one, rows) for one in looks if (rows := _in_turn(one))]
    if len(found) != 1 or len(looks) > 2:
        return None
    look, rows = found[0]
    beside = next((one for one in looks if one is not look), None)
    poses = list(dict.fromkeys(rows))
    counts = sorted(map(rows.count, poses))
    often = f"{counts[0]} times" + " or more" * (counts[0] < counts[-1])
    sentence = f"{counted(len(poses), 'pose')} in turn, each {often}"
    if beside is not None:
        if look.has(*TARGET) or not _are_commands(beside, {pose for (pose,) in poses}):
            return None
        return _proposed(look, rows, sentence, root, beside)
    if look.has(*TARGET):
        return _proposed(look, rows, sentence, root)
    if look.has("q1") or look.has("q1_read"):
        sentence += (
            f': for truebed iso9283 write [cycles] with file = "{look.name}" and commanded = a '
            "table of pose_id, x_mm, y_mm, z_mm"
        )
        return Cycles(None, sentence)
    section, assumed = _section(look, rows)
    said = f"{sentence}: read as a test after ISO 9283, whose commanded positions no file has"
    needed = (
        f"{COMMANDS}: write the commanded position of each pose there, as pose_id, x_mm, y_mm, z_mm"
    )
    document = {"cycles": section | {"commanded": COMMANDS}}
    return Cycles(document, said, assumed, (needed,))


def _in_turn(look: Found) -> list[tuple[str, ...]]:
    """The pose of each row, or its command, where a few poses come again and again; else none."""
    if look.kind != "table" or not look.has(*SEEN):
        return []
    commanded = look.has(*TARGET)
    names = [look.stems[stem].theirs for stem in TARGET] if commanded else [_pose(look)]
    if not names[0]:
        return []
    rows = list(zip(*map(look.column, names), strict=True))
    poses = list(dict.fromkeys(rows))
    counts = sorted(map(rows.count, poses)) if len(poses) <= MOST_POSES else [0]
    later = [a == b for a, b in zip(rows, rows[len(poses) :], strict=False)]
    return rows if counts[0] >= FEWEST_CYCLES and np.mean(later) >= IN_TURN else []


def _are_commands(look: Found, poses: set[str]) -> bool:
    """Whether a table has one position for each of some poses."""
    if look.kind != "table" or look.sheet is not None or not look.has("pose_id", *SEEN):
        return False
    return sorted(look.column(look.stems["pose_id"].theirs)) == sorted(poses)


def _section(look: Found, rows: list[tuple[str, ...]]) -> tuple[Document, tuple[str, ...]]:
    """[cycles] of a table, and what is assumed of it."""
    columns, assumed = dict[str, str](), list[str]()
    there = ((SEEN, "positions"), (TARGET, "commands"))
    for stems, what in there if look.has(*TARGET) else there[:1]:
        means = [look.stems[stem] for stem in stems]
        unit = _by_size(look, means)
        open_ = [one for one in means if not one.known]
        if any(not one.unit for one in open_):
            assumed.append(f"{what}: no column states its unit; assumed: {unit}")
        columns |= {f"{one.stem}_{one.unit or unit}": one.theirs for one in open_}
    pose = _pose(look, rows if look.has(*TARGET) else None)
    cycle = next((name for name in look.head if name.strip().lower() in CYCLE), "")
    for own, theirs in (("pose_id", pose), ("cycle", cycle)):
        if theirs and theirs != own:
            columns[own] = theirs
    section: Document = {"file": look.name} | ({"sheet": look.sheet} if look.sheet else {})
    if look.has(*TURNS) and look.stems["rx"].known and "euler" not in look.head:
        section["euler"] = "XYZ"
        assumed.append("rotations: no file states how the three angles turn; assumed: XYZ")
    return section | ({"columns": columns} if columns else {}), tuple(assumed)


def _proposed(
    look: Found,
    rows: list[tuple[str, ...]],
    sentence: str,
    root: Path,
    commands: Found | None = None,
) -> Cycles:
    """[cycles] of a table whose rows have the commanded positions, or of which another has them."""
    section, assumed = _section(look, rows)
    if commands is not None:
        section = section | {"commanded": commands.name}
    document: Document = {"cycles": section}
    settings = validated(document, CampaignFile, SESSION_FILE)
    both = [look] if commands is None else [look, commands]
    texts = {(root / one.name, one.sheet): one.text for one in both}
    sources = Sources(root, None, MAX_MB, texts)
    said = f"{sentence}: read as a test after ISO 9283"
    given = Given(root / SESSION_FILE, None, settings, sources, ())
    try:
        test = test_of(given, drop=False)
    except InputError as error:
        drops = _reads(given)
        return Cycles(document, said, assumed, (str(error),), drops=drops)
    if not test.uncertainty:
        floor = "position_um under [uncertainty] gives the repeatability a floor"
        assumed = (*assumed, f"uncertainty: none is stated; {floor}")
    return Cycles(document, said, assumed, (), test.warnings)


def _reads(given: Given) -> bool:
    """Whether the rows of a test are read without those that are refused."""
    try:
        test_of(given, drop=True)
    except InputError:
        return False
    return True


def _pose(look: Found, rows: list[tuple[str, ...]] | None = None) -> str:
    """The column that names the pose of each row, one name for each command of `rows`."""
    named = [look.stems["pose_id"].theirs] if look.has("pose_id") else []
    if rows is None:
        return next(iter(named), "")
    moved = {look.stems[stem].theirs for stem in (*SEEN, *TARGET)}
    count = len(set(rows))
    for name in (*named, *(name for name in look.head if name not in moved)):
        cells = look.column(name)
        if len(set(cells)) == count == len(set(zip(cells, rows, strict=True))):
            return name
    return ""


def _by_size(look: Found, means: Sequence[Meaning]) -> str:
    """The likely unit of some columns, by the size of their numbers."""
    cells = [cell for one in means for cell in look.column(one.theirs)]
    sizes = np.nan_to_num(np.abs([either_mark(cell) for cell in cells]))
    return "mm" if sizes.max(initial=0.0) > REACH else "m"
