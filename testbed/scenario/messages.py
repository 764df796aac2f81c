"""Validation errors of a scenario in the words of the file: table, key, value, likely fix."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from testbed.faults import MOST, Fault, KeyPath
from testbed.gates.mistakes import WANTED, in_words, right_unit, shown
from testbed.names import did_you_mean
from testbed.scenario.scenario import Scenario, ScenarioFile
from testbed.scenario.tables import PRIOR
from testbed.strict import Strict, models_in
from testbed.units import counted

UNIONS = ((1, ("tracker",)), (2, ("plan", "goal")), (3, ("cell", "obstacle")))
"""Tables of several presets or kinds; pydantic puts the chosen one into the path of a fault, at
this depth."""
TEXTS = (("truth", "perturb"), ("identification", "free"))
"""Keys that hold one text or a list of texts."""
NUMBERS = tuple(
    ("truth", key)
    for key in (
        *("harmonic_mdeg", "high_harmonic_mdeg", "transmission_mdeg", "encoder_mdeg"),
        *("gear_mdeg", "gear_ratio", "backlash_mdeg", "friction_nm"),
    )
)
"""Keys that hold one number or one per joint."""
WANTED_AT: dict[KeyPath, tuple[str, str]] = {
    **dict.fromkeys(TEXTS, ("text or a list of texts", "put names in quotes")),
    **dict.fromkeys(
        NUMBERS, ("a number or a list of numbers", "write one for all joints or one for each")
    ),
    ("truth", "joint_repeatability_mdeg"): ('a number or "robot"', "choose one of these"),
    ("trial",): ("a list of tables", "write [[trial]] with two brackets"),
    ("cell", "obstacle"): ("a list of tables", "write [[cell.obstacle]] with two brackets"),
}
"""What keys of several types must hold, and the likely fix."""
EXAMPLES = {
    "format": "format = 1",
    "name": 'name = "..."',
    "robot": 'robot = "staubli_tx60"',
    "trial": "a [[trial]] with name, poses and method",
    "poses": "poses = 29",
    "method": 'method = "detmax"',
    "kind": 'kind = "box" or kind = "mesh"',
    "position_um": "position_um = 100",
    "rule": 'rule = "guarded" (a pass keeps R95 away from the limit) or rule = "simple" (no guard '
    "band: at the limit a pass has a risk of 50 % or more)",
}
"""Lines that mend a missing key."""


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
        if len(faults) >= MOST:  # only counted
            faults.setdefault(item["loc"], Fault((*table, *item["loc"]), ""))
            continue
        path = _path((*table, *item["loc"]))
        context = item.get("ctx", {})
        if item["type"] == "too_short" and len(item["input"]) >= context["min_length"]:
            continue  # counts only sound entries; the others have their own fault
        if path in NUMBERS and _other_branch(item):
            continue
        if path not in skip:
            fault = _sentence(path, item["type"], context, item["input"], file)
            faults.setdefault(fault.path, fault)
    return list(faults.values())


def _other_branch(item: Mapping[str, Any]) -> bool:
    """Whether a fault says only that a number is no list, or a list no number."""
    kind, value = item["type"], item["input"]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return (kind == "float_type" and isinstance(value, list)) or (kind == "tuple_type" and number)


def _path(location: KeyPath) -> KeyPath:
    """Where a fault lies in the file: without the branches pydantic adds for unions."""
    for depth, union in UNIONS:
        if location[: len(union)] == union:
            return location[:depth] + location[depth + 1 :]
    if location[:2] in (*TEXTS, *NUMBERS):
        return location[:2] + tuple(part for part in location[2:] if isinstance(part, int))
    return location


def _sentence(
    path: KeyPath, kind: str, context: Mapping[str, Any], value: object, file: ScenarioFile
) -> Fault:
    """One fault in our words."""
    at = file.place(path)
    said = f"{at} is {shown(value)}"
    if kind == "extra_forbidden":
        return _unknown_key(path, value, file)
    if kind == "missing":
        return _missing(path, value, file)
    if kind == "value_error" and path == ("tolerance",):
        return _missing((*path, "rule"), value, file)
    if kind == "union_tag_not_found":
        return _missing((*path, "kind"), value, file)
    if kind == "union_tag_invalid":
        name = context["discriminator"].strip("'")
        tag = value.get(name) if isinstance(value, Mapping) else value
        words = {"expected": context["expected_tags"]}
        return in_words(file.place((*path, name)), (*path, name), "literal_error", words, tag)
    if path[:2] == PRIOR and kind == "greater_than_equal":
        least = f"{context['ge']:g}"
        allowed = f"a prior is positive definite: every standard deviation is {least} or larger"
        fix = "hold a number fixed that is known exactly: leave it out of free"
        return Fault(path, said, "M34", allowed, fix, value)
    if path in WANTED_AT and kind in WANTED:
        wanted, fix = WANTED_AT[path]
        return Fault(path, said, "S37", f"it must be {wanted}", fix, value)
    return in_words(at, path, kind, context, value)


def _missing(path: KeyPath, value: object, file: ScenarioFile) -> Fault:
    """A key, or the end of a list, that is not there."""
    if isinstance(path[-1], int) and isinstance(value, list):
        message = f"{file.place(path[:-1])} has {counted(len(value), 'entry')}"
        return Fault(path[:-1], message, fix="add what is missing", value=value)
    key = str(path[-1])
    return Fault(path, f"{file.place(path)} is missing", fix=f"add {EXAMPLES.get(key, key)}")


def keys_by_table(file: ScenarioFile) -> dict[str, dict[str, tuple[str, ...]]]:
    """The keys of each table of a scenario file, by preset or kind, or by "" where it has one.

    The empty name is the top of the file.
    """
    tables: dict[str, dict[str, tuple[str, ...]]] = {"": {"": file.keys}}

    def add(name: str, models: Sequence[type[Strict]]) -> None:
        for model in models:
            tag = str(next(iter(model.model_fields.values())).default) if models[1:] else ""
            tables.setdefault(name, {})[tag] = tuple(model.model_fields)
            for key, field in model.model_fields.items():
                add(f"{name}.{key}", models_in(field.annotation))

    # a key that [[trial]] and [plan] both have belongs to a trial
    for key in sorted(file.keys, key="plan".__eq__):
        field = Scenario.model_fields.get(key)
        add(key, models_in(field.annotation) if field else [file.kinds[key]])
    return tables


def _unknown_key(path: KeyPath, value: object, file: ScenarioFile) -> Fault:
    """A key nobody reads: a slip, a wrong unit, or a key of another table or preset."""
    key, tables = str(path[-1]), keys_by_table(file)
    message = f'{file.place(path[:-1]) if path[1:] else "the file"} has no key "{key}"'
    owner: Any = file.document
    for part in path[:-1]:
        owner = owner[part]
    table = ".".join(part for part in path[:-1] if isinstance(part, str))
    word, branches = "preset" if table == "tracker" else "kind", tables[table]
    tag = owner.get(word, next(iter(branches))) if len(branches) > 1 else ""
    for other, keys in branches.items():
        if other != tag and key in keys:
            return Fault(path, message, fix=f'it belongs to {word} = "{other}"', value=value)
    known = branches[tag]
    homes = [name for name, kinds in tables.items() if key in kinds.get("", ())]
    fix = right_unit(key, value, known) or did_you_mean(key, known)
    if not fix and homes:
        fix = f"move it to {f'[{homes[0]}]' if homes[0] else 'the top of the file'}"
    allowed = "" if fix else f"known keys: {', '.join(known)}"
    return Fault(path, message, "S37", allowed, fix or "remove it", value)
