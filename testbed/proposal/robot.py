"""A robot.toml from a table of link numbers, or an empty one that explains its keys."""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from testbed.files.columns import ANGLES, LENGTHS
from testbed.files.dialects.numbers import NUMBER, number_of
from testbed.files.refusal import refusal
from testbed.files.sources import text_of
from testbed.files.text import Sheet, read_sheet
from testbed.gates.kinds import require_no_program
from testbed.gates.text import MAX_MB, FileText
from testbed.proposal.naming.plain import without_unit
from testbed.units import counted

SPEED = "max_speed_deg_s"
KEYS = {
    "theta_deg": {"theta", "θ", "offset", "theta offset"},
    "d_mm": {"d", "link offset"},
    "a_mm": {"a", "r", "link length"},
    "alpha_deg": {"alpha", "α", "twist", "link twist"},
    "beta_deg": {"beta", "β"},
    "lower_deg": {"lower", "min", "q min", "lower limit", "lo"},
    "upper_deg": {"upper", "max", "q max", "upper limit", "hi"},
    SPEED: {"speed", "max speed", "velocity"},
}
"""Keys of a turning joint, and names that people use for them."""
ALLOWED = "theta_deg, d_mm, a_mm, alpha_deg, and lower_deg, upper_deg if there are some"
BEFORE = re.compile(r"[\s_{(]*i\s*[-\u2212\u2013]\s*1[)}]*")
"""What is said of alpha and a of the joint before, as Craig writes them: alpha_{i-1}."""
INDEX = re.compile(r"[\s_]*\{?[ijk]\}?$")
"""An index behind a letter: theta_i."""
ORDER = (
    "alpha and a of a line are those behind its joint; in Craig's order (modified Denavit-"
    "Hartenberg) they are those before it: call these columns alpha_i-1 and a_i-1"
)
NEEDED = ("d_mm", "a_mm", "alpha_deg")
ALIKE = (("d_mm", "a_mm"), ("theta_deg", "alpha_deg", "beta_deg"), ("lower_deg", "upper_deg"))
"""Groups of columns with the same unit; nobody writes d in mm and a in meters."""
NUMBERED = ("joint", "axis", "link", "i", "j", "no", "nr", "#", "")
"""Names of a column that only numbers the joints."""
TO = {
    own: {unit: size / sizes[own] for unit, size in sizes.items()}
    for own, sizes in (("mm", LENGTHS), ("deg", ANGLES))
}
"""Factors by which lengths become mm, and angles deg, by their units."""
SMALL = {"mm": (("mm", "m"), 8.0), "deg": (("deg", "rad"), 6.4)}
"""Usual units of lengths and angles, and the largest numbers that can be meters or radians."""
TURNS, SLIDES = {"lower_deg": -180.0, "upper_deg": 180.0}, {"lower_mm": -1e3, "upper_mm": 1e3}
"""Limits of joints without any."""
TRAVEL = {"lower_deg": "lower_mm", "upper_deg": "upper_mm", SPEED: "max_speed_mm_s"}
"""Keys of a turning joint, and the corresponding ones of a sliding joint."""
KIND = ("kind", "type", "joint type")
"""Names of a column that states which joints slide."""
KINDS = {
    **dict.fromkeys(("r", "revolute", "rotary", "rotational", "rotation", "turning"), False),
    **dict.fromkeys(("p", "prismatic", "linear", "translational", "translation", "sliding"), True),
}
"""Whether a joint slides, by the words in that column."""
COUNTED = re.compile(r"\D*(\d{1,2})")
"""Number of a joint, alone or behind a letter."""
Column = tuple[str, Sequence[float], str]
"""Name of a column, its numbers, and its unit, if stated."""
HEAD = """\
# {origin}
# Link numbers in the order Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), joint after joint.
# In Craig's order a line has alpha and a of the joint before: move these up by one line.
{assumed}format = 1
name = "{name}"  # small letters, digits and _
# title = "Maker, model, reach"
"""
JOINT = "\n[[joints]]  # {number}\nkind = {kind}\n"
TURNING, SLIDING = '"revolute"  # or "prismatic": lower_mm, upper_mm', '"prismatic"'
REST = """
# Only what needs them asks for more, in each [[joints]]:
#   max_speed_deg_s, repeatability_urad            (plans; the scatter of single moves)
#   mass_kg, center_mm, inertia_kg_m2              (a true robot that moves: [truth] motion)
# [sources]  geometry = "..."  limits = "..."      where each number comes from
"""


def robot_text(table: Path | None, joints: int, name: str) -> tuple[str, tuple[str, ...]]:
    """The text of a robot.toml, and what was assumed.

    Raises
    ------
    InputError
        M21: names and a line below them state different units; M25: a cell is not a number; M35:
        the table has no columns d, a and alpha.
    """
    if table is None:
        rows: list[dict[str, float]] = [dict.fromkeys(("theta_deg", *NEEDED), 0.0)] * joints
        slides = [False] * joints
        origin = (
            "Proposed by truebed new robot: no table was given, so all numbers are to be filled in"
        )
        assumed: tuple[str, ...] = ("every link number is 0: write those of the robot",)
    else:
        given = text_of(table, str(table), sheet=None, max_mb=MAX_MB)
        require_no_program(given.lines, str(table))
        _require_names(given)
        sheet = read_sheet(given)
        rows, slides, assumed = _rows(sheet)
        origin = f"Proposed by truebed new robot from {table.name} ({counted(len(rows), 'joint')})"
    limits = not all({*row} >= {*TURNS} or {*row} >= {*SLIDES} for row in rows)
    ends = "180 deg" + ", or 1000 mm where it slides," * any(slides)
    assumed += (f"limits of {ends} to either side: write those of the robot",) * limits
    said = "".join(f"# Assumed: {sentence}\n" for sentence in assumed)
    text = HEAD.format(origin=origin, name=name, assumed=said)
    for number, (row, slide) in enumerate(zip(rows, slides, strict=True), 1):
        whole = {"theta_deg": 0.0} | row | ((SLIDES if slide else TURNS) if limits else {})
        text += JOINT.format(number=number, kind=SLIDING if slide else TURNING)
        text += "".join(f"{key} = {value + 0.0!r}\n" for key, value in whole.items())
    return text + REST, assumed


def _require_names(given: FileText) -> None:
    """Refuse a table whose first line is numbers, whatever a comment above it says."""
    content = given.content("#")
    cells = [cell for cell in re.split(r"[\s,;]+", content[0][1]) if cell] if content else []
    if cells and all(map(NUMBER.fullmatch, cells)):
        raise refusal(
            f"{given.where}:{content[0][0]}", "columns", "does not name its columns",
            allowed=ALLOWED, fix="name them in the first line, without a # before it",
        )  # fmt: skip


def _rows(sheet: Sheet) -> tuple[list[dict[str, float]], list[bool], tuple[str, ...]]:
    """Numbers of each joint in mm and deg, whether it slides, and what was assumed."""
    found: dict[str, Column] = {}
    said, slides = _slides(sheet)
    used = {said}
    for name, below in zip(sheet.head, sheet.units or [""] * len(sheet.head), strict=True):
        text, unit = without_unit(BEFORE.sub("", name))
        text = INDEX.sub("", text) or text
        if unit and below and unit != below:
            message = f"is called {name}, and the line below the names says {below}"
            fix = "correct the one that is wrong"
            raise refusal(sheet.where, name, message, code="M21", fix=fix)
        unit = unit or below
        for key, words in KEYS.items():
            if (text in words or name == key) and key not in found:
                _require_unit(sheet, name, key, unit)
                column = sheet.head.index(name)
                cells = [row[column].replace(",", ".") for row in sheet.rows]
                found[key] = (name, [number_of(cell) for cell in cells], unit)
                used.add(name)
    missing = [key for key in NEEDED if key not in found]
    if missing or not sheet.rows:
        raise refusal(
            sheet.where, "columns", f"has no column for {', '.join(missing) or 'any joint'}",
            allowed=ALLOWED,
            fix=f"name the columns so; found: {', '.join(sheet.head)[:120]}",
        )  # fmt: skip
    _require_in_order(sheet)
    assumed = []
    columns: dict[str, Sequence[float]] = {}
    of_turns = {
        key: (name, [v for v, slide in zip(values, slides, strict=True) if not slide], unit)
        for key, (name, values, unit) in found.items() if key in TRAVEL
    }  # fmt: skip
    units = _units(found | of_turns)
    for key, (name, values, _) in found.items():
        for row, value in enumerate(values):
            if not np.isfinite(value):
                cell = sheet.rows[row][sheet.head.index(name)][:20]
                where = f"{sheet.where}:{sheet.lines[row]}"
                raise refusal(where, name, f'{name} is "{cell}"', code="M25", fix="write a number")
        unit, why = units[key]
        if why and any(of_turns.get(key, (name, values))[1]):
            assumed.append(f"{name} is in {unit}{'/s' * (key == SPEED)}, {why}")
        own, other = TO[_kind(key)][unit], TO["mm"][units["d_mm"][0]]
        if key in TRAVEL and any(slides):
            assumed.append(f"{name} of joints that slide is in {units['d_mm'][0]}, as d")
        columns[key] = [
            float(f"{value * (other if slide and key in TRAVEL else own):.12g}")
            for value, slide in zip(values, slides, strict=True)
        ]
    links = [found[key][0] for key in ("a_mm", "alpha_deg")]
    if all(map(BEFORE.search, links)):
        if any(columns[key][0] for key in ("a_mm", "alpha_deg")):
            assumed.append(f"the first {' and '.join(links)} move only the base: not used")
        columns |= {key: [*columns[key][1:], 0.0] for key in ("a_mm", "alpha_deg")}
    elif links != ["a_mm", "alpha_deg"]:
        assumed.append(ORDER)
    left = [name for name in sheet.head if name not in used and name.lower() not in NUMBERED]
    if left:
        assumed.append(f"not used: {', '.join(left)}")
    rows = [
        {TRAVEL.get(key, key) if slide else key: columns[key][k] for key in KEYS if key in columns}
        for k, slide in enumerate(slides)
    ]
    return rows, slides, tuple(assumed)


def _require_unit(sheet: Sheet, name: str, key: str, unit: str) -> None:
    """Refuse an angle in a unit of lengths and the like; limits may be those of slides."""
    if unit and key not in TRAVEL and unit not in TO[_kind(key)]:
        what = "a length" if _kind(key) == "mm" else "an angle"
        message = f"{name} is in {unit}, and must be {what}"
        fix = f"write one of {', '.join(TO[_kind(key)])}"
        raise refusal(sheet.where, name, message, code="M21", value=unit, fix=fix)


def _require_in_order(sheet: Sheet) -> None:
    """Refuse lines whose own numbers (3 or J3) say that they stand in another order, or twice."""
    for column, name in enumerate(sheet.head):
        counted_so = [COUNTED.fullmatch(row[column].strip()) for row in sheet.rows]
        if name.strip().lower() not in NUMBERED or not all(counted_so):
            continue
        numbers = [int(found[1]) for found in counted_so if found]
        for k, (number, after) in enumerate(pairwise(numbers), 1):
            if after != number + 1:
                cells = [sheet.rows[row][column].strip() for row in (k, k - 1)]
                raise refusal(
                    f"{sheet.where}:{sheet.lines[k]}", name,
                    f"{name} {cells[0]} stands below {cells[1]}", code="M25",
                    fix="order the lines from the base to the flange, each joint once",
                )  # fmt: skip


def _slides(sheet: Sheet) -> tuple[str, list[bool]]:
    """Which joints slide, and the column that states it; without one all turn."""
    for column, name in enumerate(sheet.head):
        words = [row[column].strip().lower() for row in sheet.rows]
        if name.strip().lower() in KIND and all(word in KINDS for word in words):
            return name, [KINDS[word] for word in words]
    return "", [False] * len(sheet.rows)


def _kind(key: str) -> str:
    """Unit at the end of a key."""
    return "mm" if key.endswith("_mm") else "deg"


def _units(found: Mapping[str, Column]) -> dict[str, tuple[str, str]]:
    """Unit of each column and, if it does not state one, the reason for it.

    Columns of a group have one unit: that which one of them states, or else that which fits the
    largest number in any of them.
    """
    units: dict[str, tuple[str, str]] = {}
    for key, (name, _, unit) in found.items():
        if unit in TO[_kind(key)] or name == key:
            units[key] = unit if unit in TO[_kind(key)] else _kind(key), ""
    stated = dict(units)
    for key in [key for key in found if key not in stated]:
        alike = next((group for group in ALIKE if key in group), (key,))
        by = [other for other in alike if other in stated]
        if len({stated[other][0] for other in by}) == 1:
            units[key] = stated[by[0]][0], f"as {found[by[0]][0]}"
            continue
        sizes = {other: _size(found[other][1]) for other in alike if other in found.keys() - stated}
        largest = max(sizes, key=sizes.__getitem__)
        (unit, small), most = SMALL[_kind(key)]
        unit = small if 0 < sizes[largest] <= most else unit
        own = sizes[key] == sizes[largest]
        units[key] = unit, f"by {'its size' if own else f'the size of {found[largest][0]}'}"
    return units


def _size(values: Sequence[float]) -> float:
    """Largest size of any number of a column."""
    return float(np.abs(values).max(initial=0.0))
