"""What a file of a user is: said where another kind was wanted, instead of naming its keys."""

import re
import shlex
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from calib.errors import InputError, refuse

Kind = Literal["robot", "session", "scenario", "tracker"]
CALLED: dict[str, str] = {
    "robot": "a robot",
    "session": "a session of measurements",
    "scenario": "a scenario",
    "tracker": "a drawn instrument",
    "table": "a table",
    "description": "the description of a robot",
}
USED: dict[str, str] = {
    "robot": "truebed check {} reads it, truebed identify {} DATA calibrates it",
    "session": "truebed identify ROBOT {} calibrates from it",
    "scenario": "truebed run {} plays it",
    "table": "truebed new session {} writes the session.toml that it needs",
    "description": "truebed check {} reads it, truebed identify {} DATA calibrates it",
}
"""What takes a file of a kind."""
BEGUN = "truebed new scene {} begins one for it"
TABLES = (".csv", ".tsv", ".txt", ".xlsx")
DESCRIPTIONS = (".urdf", ".xml", ".mjcf", ".xacro")
"""Endings of files that are tables, and of those that describe a robot as URDF or MJCF."""
NO_TABLES = {**dict.fromkeys(DESCRIPTIONS, CALLED["description"]), ".toml": "a TOML file"}
YAML = (".yaml", ".yml")
OF_YAML = re.compile(r"\s*(- *)*([^\W\d][\w/ ]*:(\s.*)?|[^\s,;]*|'[^']*'|\[.*)|---|#.*")
KEY, ITEM = re.compile(r"\s*[^\W\d][\w/ ]*:\s*"), re.compile(r"\s*- +[-+.\d]\S*\s*")
"""Lines of YAML, those that name what stands below them, and numbers of a list."""
PROGRAMS = {
    "rokae": (
        "an RL program (ROKAE)",
        re.compile(r".*\b(jointtarget|robtarget)\s+\w+\s*=\s*[jp]:", re.IGNORECASE),
    ),
    "rapid": ("a RAPID program", re.compile(r"\s*MODULE\s+\w+\s*(\(\w+\)\s*)?$")),
    "krl": (
        "a KRL program (KUKA)",
        re.compile(
            r"\s*(&(ACCESS|REL|PARAM)\b|(GLOBAL\s+)?DEF(DAT|FCT)?\s+\w+|S?PTP\s*\{"
            r"|(GLOBAL\s+|DECL\s+){0,2}(E6)?AXIS\s+\w|\{\s*A1\s+[-+\d])"
        ),
    ),
    "fanuc": (
        "a TP program (FANUC)",
        re.compile(
            r"\s*(/(PROG|ATTR|MN|POS)\b|P\[\d+[^\]]{0,99}\]\s*\{|\[\*\w{1,20}\*\]\s*\$POSREG\b)"
        ),
    ),
    "inform": ("an INFORM job (Yaskawa)", re.compile(r"\s*/(JOB|/NAME|/POS)\b")),
    "doosan": ("a DRL program (Doosan)", re.compile(r".*\bpos[jx]\s*\(")),
    "kawasaki": (
        "an AS program (Kawasaki)",
        re.compile(r"\s*(\.(PROGRAM|JOINTS|TRANS)\b|[JL]MOVE\s+#?\w|POINT\s+#)", re.IGNORECASE),
    ),
    "python": (
        "a Python program",
        re.compile(
            r"\s*(from\s+[\w.]+\s+import\s|import\s+\w[\w.]*(\s+as\s+\w+)?\s*(#|$)|#!.*python"
            r"|[\w.]+\.(set_servo_angle(_j)?|moveJ)\()"
        ),
    ),
    "urscript": (
        "a URScript program (Universal Robots)",
        re.compile(r"\s*(def\s+\w+\s*\(.*\)\s*:|move[jlpc]\s*\(\s*(p?\[|get_))"),
    ),
    "val3": (
        "a VAL3 program (Stäubli)",
        re.compile(
            r"\s*(program\s+\w+\s*\(|begin\s*$|move[jlc]\s*\(\s*[\w{])|.*<(Database|Program)\b"
        ),
    ),
    "pacscript": (
        "a PacScript program (Denso)",
        re.compile(r"\s*('!TITLE|Sub\s+Main\b|TakeArm\b|Move\s+[PL],\s*@)", re.IGNORECASE),
    ),
    "spel": (
        "a SPEL+ program (Epson)",
        re.compile(r"\s*(Function\s+\w+\s*$|Motor\s+On\b|Go\s+(P\w+|JA\s*\())", re.IGNORECASE),
    ),
    "gpl": (
        "a GPL program (Precise Automation)",
        re.compile(r"\s*('\s*GPL Generated|\w+(\(\d+\))?\.(Angles|XYZ)\s*\()", re.IGNORECASE),
    ),
    "spel points": (
        "a file of SPEL+ points (Epson)", re.compile(r"\s*(Point\d+\s*\{|sVersion\s*=)")
    ),
}  # fmt: skip
"""Names of robot programs, and patterns of a line among their first ones."""
FIRST = 20
AS_TABLE = (
    "write its joint targets as a CSV, one per line, below a header q1_deg, q2_deg ...; `truebed "
    "new session` reads those of RAPID, KRL, TP (.ls), URScript, DRL, AS, INFORM, VAL3 and RL"
)
AS_JSON = (
    'write it as JSON, which is read: python3 -c "import json, sys, yaml; d = [x for x in '
    'yaml.safe_load_all(sys.stdin) if x]; json.dump(d if d[1:] else d[0], sys.stdout)" < {} > {}'
)
"""How to turn YAML into what is read, by PyYAML."""
OF_SESSIONS = {
    "joints", "frames", "points", "ranges", "drift", "dialect", "match", "session", "cycles",
    "paths", "iso9283", "job", "conditions",
}  # fmt: skip
OF_SCENARIOS = {"trial", "truth", "tracker", "pool", "test", "plan", "studies", "seed", "cell"}
"""Keys that only one kind of TOML file has."""


def kind_of(document: Mapping[str, Any]) -> Kind | None:
    """What a TOML file is by the tables in it; None if they do not say, or say two things.

    Examples
    --------
    >>> kind_of({"joints": {"file": "a.csv"}, "uncertainty": {}})
    'session'
    >>> kind_of({"joints": [{"kind": "revolute"}], "format": 1})
    'robot'
    """
    if isinstance(document.get("joints"), list) and not set(document) & (OF_SESSIONS - {"joints"}):
        return "robot"
    if "beam_height_mm" in document:
        return "tracker"
    keys = set(document)
    session, scenario = bool(keys & OF_SESSIONS), bool(keys & OF_SCENARIOS)
    if session == scenario:
        return None
    return "session" if session else "scenario"


def kind_of_name(path: Path) -> Literal["table", "description"] | None:
    """What a file is by the ending of its name; None if that does not say."""
    ending = path.suffix.lower()
    return "table" if ending in TABLES else "description" if ending in DESCRIPTIONS else None


def require_kind(document: Mapping[str, Any], wanted: Kind, where: str) -> None:
    """Refuse a TOML file that is clearly of another kind.

    Raises
    ------
    InputError
        S37: says what it is, what was wanted, and which verb takes it.
    """
    kind = kind_of(document)
    if kind is not None and kind != wanted:
        raise wrong_kind(kind, wanted, where)


def require_table(path: Path, where: str) -> None:
    """Refuse a file whose name says that it is no table.

    Raises
    ------
    InputError
        S39: it ends as a TOML file does, or as URDF and MJCF do.
    """
    ending, is_file = path.suffix.lower(), path.is_file()
    if ending in YAML and is_file:
        raise _of_yaml(where)
    if (told := NO_TABLES.get(ending, "")) and is_file:
        message, fix = f"is {told}, and a table is wanted here", "give a CSV, or a workbook (xlsx)"
        raise refuse("file", code="S39", message=message, fix=fix, where=where)


def require_no_yaml(lines: Sequence[str], where: str) -> None:
    """Refuse YAML where a table is wanted, as programs print it into a file of any name.

    Raises
    ------
    InputError
        S39: it has names alone in a line, and numbers of lists below them.
    """
    first = [line for line in lines[: 5 * FIRST] if line.strip()]
    if not any(map(KEY.fullmatch, first)) or not any(map(ITEM.fullmatch, first)):
        return
    if all(map(OF_YAML.fullmatch, first)):
        raise _of_yaml(where)


def _of_yaml(where: str) -> InputError:
    """The error of YAML, and how to turn it into JSON."""
    new = Path(where).with_suffix(".json").name
    fix = AS_JSON.format(shlex.quote(where), shlex.quote(new))
    message = "is YAML, and a table or JSON is wanted here"
    return refuse("file", code="S39", message=message, fix=fix, where=where)


def program_of(lines: Sequence[str]) -> str:
    """Which of `PROGRAMS` some lines are; empty if they are none."""
    return _program_of(tuple(lines[:FIRST]))


@lru_cache(maxsize=8)
def _program_of(first: tuple[str, ...]) -> str:
    """The same by the first lines: those of one file are asked once for each of its readings."""
    found = (own for own, (_, line) in PROGRAMS.items() if any(map(line.match, first)))
    return next(found, "")


def require_no_program(lines: Sequence[str], where: str, read: Collection[str] = ()) -> None:
    """Refuse the program of a robot where a table is wanted, but for the languages that are `read`.

    Raises
    ------
    InputError
        S39: it is another one of `PROGRAMS`.
    """
    own = program_of(lines)
    if own and own not in read:
        message, fix = f"is {PROGRAMS[own][0]}, and a table is wanted here", AS_TABLE
        raise refuse("file", code="S39", message=message, fix=fix, where=where)


def wrong_kind(kind: str, wanted: str, where: str) -> InputError:
    """The error of a file of one kind where another one is wanted."""
    message = f"is {CALLED[kind]}, and {CALLED[wanted]} is wanted here"
    fix = (BEGUN if (kind, wanted) == ("robot", "scenario") else USED.get(kind, "")).format(
        *(shlex.quote(where),) * 2
    )
    return refuse("file", kind, code="S37", message=message, fix=fix, where=where)
