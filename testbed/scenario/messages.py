"""Validation errors of a scenario in the words of the file: table, key, value, likely fix."""

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ValidationError

from testbed.scenario import plan as settings_plan
from testbed.scenario import scenario as settings
from testbed.scenario import tables as settings_cell
from testbed.scenario import tables as settings_identification
from testbed.scenario import truth as settings_truth
from testbed.scenario.scenario import Scenario, StudyTable
from testbed.strict import Fault, KeyPath, did_you_mean, place

UNIONS = {
    "tracker": ("paper", "at960"),
    "plan.goal": ("box", "list", "path"),
    "cell.obstacle": ("box", "mesh"),
}
"""Tables of several presets or kinds; pydantic puts the chosen one into the path of a fault."""
PLAIN = ("format", "name", "title", "seed", "robot")
"""Keys at the top of the file that are no tables."""
NESTED = (
    "trial[]",
    "cell.obstacle[]",
    "identification.prior",
    "identification.prior.sd_deg",
    "identification.prior.sd_mm",
    "plan.stations",
    "plan.stations.grid",
    "plan.goal",
)
"""Lists of tables, and tables inside tables."""
TEXTS = (("truth", "perturb"), ("identification", "free"))
"""Keys that hold one text or a list of texts."""
REPEATABILITY = ("truth", "joint_repeatability_mdeg")
UNITS = {"um": 1e-6, "mm": 1e-3, "m": 1.0, "mdeg": 1e-3, "deg": 1.0, "rad": 180 / math.pi}
"""Unit suffixes of keys; lengths in metres, angles in degrees."""
LENGTHS = ("um", "mm", "m")
ALIASES = {"noise": "position", "sigma": "position"}
"""Words people write for a quantity, and the word used here."""
WANTED = {
    "float_type": ("a number", "write it like 17.5"),
    "int_type": ("a whole number", "write it like 29"),
    "int_from_float": ("a whole number", "write it like 29"),
    "bool_type": ("true or false", "write one of them, without quotes"),
    "string_type": ("text", "put it in quotes"),
    "tuple_type": ("a list", "put it in [brackets]"),
    "model_type": ("a table", "write {header} and its keys below"),
    "dict_type": ("a table", "write {header} and its keys below"),
    "model_attributes_type": ("a table", "write {header} and its keys below"),
}
"""What a key must hold, and the likely fix, by kind of error."""
BOUNDS = {
    "greater_than": "larger than {gt:.15g}",
    "greater_than_equal": "{ge:.15g} or larger",
    "less_than": "smaller than {lt:.15g}",
    "less_than_equal": "{le:.15g} or smaller",
    "string_too_short": "at least {min_length} character long",
    "string_too_long": "at most {max_length} characters long",
}
EXAMPLES = {
    "format": "format = 1",
    "name": 'name = "..."',
    "robot": 'robot = "staubli_tx60"',
    "trial": "a [[trial]] with name, poses and method",
    "poses": "poses = 29",
    "method": 'method = "detmax"',
    "kind": 'kind = "box" or kind = "mesh"',
}
"""Lines that mend a missing key."""


@dataclass(frozen=True, slots=True)
class ScenarioFile:
    """A scenario document as its messages speak of it: its values, and the tables it may have."""

    document: Mapping[str, Any]
    kinds: Mapping[str, type[StudyTable]]
    """Tables of studies, by name."""

    @property
    def keys(self) -> tuple[str, ...]:
        """Every key of the top of the file, in the order of a written scenario."""
        own = list(Scenario.model_fields)
        place = own.index("studies") + 1
        return (*own[:place], *self.kinds, *own[place:])

    @property
    def tables(self) -> tuple[str, ...]:
        """The names of all tables."""
        return (*(key for key in self.keys if key not in PLAIN), *NESTED)

    def place(self, path: KeyPath) -> str:
        """Where a value stands, in the words of the file."""
        return place(path, self.document, self.tables)

    def in_order(self, faults: Sequence[Fault]) -> list[Fault]:
        """The faults in the order of the file's tables, unknown keys last."""
        rank = {key: k for k, key in enumerate(self.keys)}
        first = [fault for fault in faults if fault.code == "S38"]
        rest = [fault for fault in faults if fault.code != "S38"]
        return first + sorted(
            rest, key=lambda fault: rank.get(str(fault.path[0]), len(rank)) if fault.path else -1
        )


def sentences(
    error: ValidationError,
    file: ScenarioFile,
    *,
    skip: Collection[KeyPath],
    table: tuple[str, ...] = (),
) -> list[Fault]:
    """One fault per place, below `table` if one is given; none at a place in `skip`."""
    faults: dict[object, Fault] = {}
    for item in error.errors(include_url=False):
        path = _path((*table, *item["loc"]))
        context = item.get("ctx", {})
        if item["type"] == "too_short" and len(item["input"]) >= context["min_length"]:
            continue  # counts only sound entries; the others have their own fault
        if path in settings_truth.NUMBERS and _other_branch(item):
            continue
        if path not in skip and path not in faults:
            faults[path] = _sentence(path, item["type"], context, item["input"], file)
    return list(faults.values())


def _other_branch(item: Mapping[str, Any]) -> bool:
    """Whether a fault says only that a number is no list, or a list no number."""
    kind, value = item["type"], item["input"]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return (kind == "float_type" and isinstance(value, list)) or (kind == "tuple_type" and number)


def _path(location: KeyPath) -> KeyPath:
    """Where a fault lies in the file: without the branches pydantic adds for unions."""
    for depth, union in ((1, ("tracker",)), (2, ("plan", "goal")), (3, ("cell", "obstacle"))):
        if location[: len(union)] == union:
            return location[:depth] + location[depth + 1 :]
    for key in (*TEXTS, *settings_truth.NUMBERS):
        if location[:2] == key:
            return location[:2] + tuple(part for part in location[2:] if isinstance(part, int))
    return location


def _sentence(
    path: KeyPath, kind: str, context: Mapping[str, Any], value: object, file: ScenarioFile
) -> Fault:
    """One fault in our words."""
    at = file.place(path)
    said = f"{at} is {_shown(value)}"
    key = str(path[-1])
    if kind == "extra_forbidden":
        return _unknown_key(path, value, file)
    if kind == "missing":
        return _missing(path, value, file)
    if kind == "union_tag_not_found":
        return _missing((*path, "kind"), value, file)
    if kind == "union_tag_invalid":
        name = context["discriminator"].strip("'")
        tag = value.get(name) if isinstance(value, Mapping) else value
        message = f"{file.place((*path, name))} is {_shown(tag)}"
        tags = [word.strip("'") for word in context["expected_tags"].split(", ")]
        fix = did_you_mean(str(tag), tags) or "choose one of these"
        return Fault((*path, name), message, "S37", _allowed(tags), fix, tag)
    if kind == "literal_error":
        if key == "format":
            return Fault(
                path, said, "D42", "this version reads format 1", "write format = 1", value
            )
        choices = [
            word.strip("'") for word in context["expected"].replace(" or ", ", ").split(", ")
        ]
        fix = did_you_mean(str(value), choices) or "choose one of these"
        return Fault(path, said, "S37", _allowed(choices), fix, value)
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        bound = "at least" if kind == "too_short" else "at most"
        entries = "entry" if wanted == 1 else "entries"
        found = len(value) if isinstance(value, list) else context["actual_length"]
        message = f"{at} has {found} {'entry' if found == 1 else 'entries'}"
        allowed = f"{bound} {wanted} {entries} belong{'s' if wanted == 1 else ''} there"
        return Fault(path, message, "S37", allowed, "mend the list", value)
    if path[:2] == settings_identification.PRIOR and kind == "greater_than":
        allowed = "a prior is positive definite: every standard deviation is larger than 0"
        fix = "hold a number fixed that is known exactly: leave it out of free"
        return Fault(path, said, "M34", allowed, fix, value)
    if kind in BOUNDS:
        allowed = f"it must be {BOUNDS[kind].format(**context)}"
        return Fault(path, said, "C41", allowed, "choose a value in range", value)
    if kind == "string_pattern_mismatch":
        named = key == "name"
        allowed = "are small letters, digits, - _ and ." if named else "is one line of plain text"
        return Fault(path, said, "S37", f"allowed {allowed}", "rename it", value)
    wanted, fix = WANTED.get(kind, ("what the list of keys says", "see `truebed scenes quick`"))
    if path in TEXTS:
        wanted, fix = "text or a list of texts", "put names in quotes"
    if path in settings_truth.NUMBERS:
        wanted, fix = "a number or a list of numbers", "write one for all joints or one for each"
    if path == REPEATABILITY:
        wanted, fix = 'a number or "robot"', "choose one of these"
    if path == ("trial",):
        wanted, fix = "a list of tables", "write [[trial]] with two brackets"
    if path == ("cell", "obstacle"):
        wanted, fix = "a list of tables", "write [[cell.obstacle]] with two brackets"
    header = at[: at.rindex("]") + 1] if "]" in at else f"[{key}]"
    return Fault(path, said, "S37", f"it must be {wanted}", fix.format(header=header), value)


def _missing(path: KeyPath, value: object, file: ScenarioFile) -> Fault:
    """A key, or the end of a list, that is not there."""
    if isinstance(path[-1], int) and isinstance(value, list):
        at = file.place(path[:-1])
        count = f"{len(value)} {'entry' if len(value) == 1 else 'entries'}"
        return Fault(path[:-1], f"{at} has {count}", fix="add what is missing", value=value)
    key = str(path[-1])
    return Fault(path, f"{file.place(path)} is missing", fix=f"add {EXAMPLES.get(key, key)}")


def keys_by_table(file: ScenarioFile) -> dict[str, tuple[str, ...]]:
    """The keys each table of a scenario file knows; the empty name is the top of the file."""
    tables: dict[str, type[BaseModel]] = {
        "truth": settings.TruthSettings,
        "pool": settings.PoolSettings,
        "test": settings.HeldOutSettings,
        "identification": settings.IdentificationSettings,
        "identification.prior": settings_identification.PriorSettings,
        "uncertainty": settings.UncertaintySettings,
        "studies": settings.StudySettings,
        **file.kinds,
        "trial": settings.TrialSettings,
        "paper": settings.PaperTracker,
        "at960": settings.At960Tracker,
        "cell": settings_cell.CellSettings,
        "plan": settings_plan.PlanSettings,
        "plan.stations": settings_plan.StationSettings,
        "plan.stations.grid": settings_plan.GridSettings,
        "cell.obstacle.box": settings_cell.BoxObstacle,
        "cell.obstacle.mesh": settings_cell.MeshObstacle,
        "plan.goal.box": settings_plan.BoxGoal,
        "plan.goal.list": settings_plan.ListGoal,
        "plan.goal.path": settings_plan.PathGoal,
    }
    return {"": file.keys} | {name: tuple(model.model_fields) for name, model in tables.items()}


def _unknown_key(path: KeyPath, value: object, file: ScenarioFile) -> Fault:
    """A key nobody reads: a slip, a wrong unit, or a key of another table or preset."""
    key, tables = str(path[-1]), keys_by_table(file)
    owner = file.place(path[:-1]) if len(path) > 1 else "the file"
    message = f'{owner} has no key "{key}"'
    table, tag = _table_of(path, file.document)
    others = [name for name in UNIONS.get(table, ()) if name != tag]
    for other in others:
        if key in tables[_branch(table, other)]:
            word = "preset" if table == "tracker" else "kind"
            return Fault(path, message, fix=f'it belongs to {word} = "{other}"', value=value)
    known = tables[_branch(table, tag) if tag else table]
    branches = [_branch(name, tag) for name, tags in UNIONS.items() for tag in tags]
    homes = [name for name, keys in tables.items() if key in keys and name not in branches]
    fix = _right_unit(key, value, known) or did_you_mean(key, known)
    if not fix and homes:
        fix = f"move it to {f'[{homes[0]}]' if homes[0] else 'the top of the file'}"
    allowed = "" if fix else f"known are {', '.join(known)}"
    return Fault(path, message, "S37", allowed, fix or "remove it", value)


def _table_of(path: KeyPath, document: Mapping[str, Any]) -> tuple[str, str]:
    """Name of the table a key stands in, and its preset or kind if there are several."""
    if path[0] == "tracker":
        return "tracker", document["tracker"].get("preset", "paper")
    if path[:2] == ("plan", "goal"):
        return "plan.goal", document["plan"]["goal"].get("kind", "box")
    if path[:2] == ("cell", "obstacle"):
        return "cell.obstacle", document["cell"]["obstacle"][path[2]]["kind"]
    return ".".join(str(part) for part in path[:-1] if isinstance(part, str)), ""


def _branch(table: str, tag: str) -> str:
    """What `keys_by_table` calls one preset or kind of a table."""
    return tag if table == "tracker" else f"{table}.{tag}"


def _right_unit(key: str, value: object, known: Collection[str]) -> str:
    """The fix for a key whose word is known in another unit, its value converted if it can be."""
    stem, _, unit = key.rpartition("_")
    for right in known if unit in UNITS else ():
        word, _, wanted = right.rpartition("_")
        if word == ALIASES.get(stem, stem) and wanted in UNITS and wanted != unit:
            same = (unit in LENGTHS) == (wanted in LENGTHS)
            if same and isinstance(value, int | float) and not isinstance(value, bool):
                return f"write {right} = {value * UNITS[unit] / UNITS[wanted]:g}"
            return f'the key is "{right}": give the value in {wanted}'
    return ""


def _allowed(words: Collection[str]) -> str:
    """What may stand there."""
    return f"allowed are {', '.join(json.dumps(word) for word in words)}"


def _shown(value: object) -> str:
    """A value as the file has it, on one line, shortened."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."
