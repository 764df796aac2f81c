"""A document in its schema, or what pydantic finds wrong in it, in the words of the file."""

import json
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from testbed.faults import MOST, Fault, one_error
from testbed.names import choice_of, did_you_mean
from testbed.strict import Strict, models_in
from testbed.units import counted

WANTED = {
    "float_type": ("a number", "write it like 17.5"),
    "finite_number": ("a finite number", "write an ordinary number"),
    **dict.fromkeys(("int_type", "int_from_float"), ("a whole number", "write it like 29")),
    "bool_type": ("true or false", "write one of them, without quotes"),
    "string_type": ("text", "put it in quotes"),
    "string_or_list": ("text or a list of texts", "put names in quotes"),
    "tuple_type": ("a list", "put it in [brackets]"),
    **dict.fromkeys(
        ("model_type", "dict_type", "model_attributes_type"),
        ("a table", "write {header} and its keys below"),
    ),
}
"""What a key must hold, and the likely fix, by kind of mistake."""
BOUNDS = {
    "greater_than": "larger than {gt}{unit}",
    "greater_than_equal": "{ge}{unit} or larger",
    "less_than": "smaller than {lt}{unit}",
    "less_than_equal": "{le}{unit} or smaller",
}
LENGTHS = {"string_too_short": "at least {min_length}", "string_too_long": "at most {max_length}"}
UNITS = {
    "um_per_sqrt_h": "um/sqrt(h)", "um_per_m_k": "um/(m K)", "um_per_m": "um/m",
    "nm_per_mrad": "N m/mrad", "kg_m2": "kg m2", "deg_s": "deg/s", "mm_s": "mm/s",
    "mm_deg": "", "k": "K", "hpa": "hPa", "percent": "%",
    **{unit: unit for unit in ("um", "mm", "mdeg", "deg", "urad", "kg", "s", "h", "degC")},
}  # fmt: skip
"""Ends of keys that tell a unit, the longer ones first, and how it is written."""
SIZES = {"um": 1e-6, "mm": 1e-3, "m": 1.0, "mdeg": 1e-3, "deg": 1.0, "rad": 180 / math.pi}
"""Unit suffixes of keys; lengths in meters, angles in degrees."""
OF_LENGTHS = ("um", "mm", "m")
ALIASES = {"noise": "position", "sigma": "position"}
"""Words people write for a quantity, and the word used here."""
NAMES = {
    r"^[a-z0-9][a-z0-9_.-]{0,63}$": "are small letters, digits, - _ and .",
    r"^[a-z][a-z0-9_]*$": "are small letters, digits and _, a letter first",
    r"^[a-z][A-Za-z0-9_.]*$": "are letters, digits, _ and ., a small letter first",
}
"""What names are made of, by their pattern."""
UNKNOWN = ("what the list of keys says", "see `truebed scenes quick`")
FILE = "the file"
"""What is said instead of a table."""
LONGEST = 60
"""Characters of a value or a name in a message."""
Schema = TypeVar("Schema", bound=Strict)


def validated(document: Mapping[str, Any], schema: type[Schema], where: str) -> Schema:
    """A document in its schema, or one error with all its faults."""
    try:
        # JSON mode: lists become tuples, but true is no number and 1 is no text
        return schema.model_validate_json(json.dumps(document, default=str))
    except ValidationError as error:
        faults: dict[object, Fault] = {}
        for mistake in _of_one_branch(error.errors(include_url=False)):
            loc, many = mistake["loc"], len(faults) >= MOST
            fault = Fault(loc, "") if many else _fault(schema, dict(mistake))
            faults.setdefault(loc if many else fault.message, fault)
        raise one_error(list(faults.values()), where) from None


def in_words(
    at: str, path: tuple[str | int, ...], kind: str, context: Mapping[str, Any], value: object
) -> Fault:
    """A mistake of pydantic's at a place ``[table] key``, whose value is wrong in itself."""
    said, key = f"{at} is {shown(value)}", next((p for p in path[::-1] if isinstance(p, str)), "")
    if path[-1:] == ("[key]",):
        said, key = f"{at} has the key {shown(value)}", ""
    if kind == "literal_error" and key == "format":
        return Fault(path, said, "D42", "this version reads format 1", "write format = 1", value)
    if kind in ("literal_error", "literal_or_list"):
        words = [word.strip("'") for word in context["expected"].replace(" or ", ", ").split(", ")]
        allowed = f"allowed are {', '.join(json.dumps(word) for word in words)}"
        fix = did_you_mean(str(value), words) or "choose one of these"
        allowed += " or a list" * (kind == "literal_or_list")
        return Fault(path, said, "S37", allowed, fix, value)
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        bound = "at least" if kind == "too_short" else "at most"
        found = len(value) if isinstance(value, list | Mapping) else context["actual_length"]
        message = f"{at} has {counted(found, 'entry')}"
        allowed = f"it must have {bound} {wanted}"
        return Fault(path, message, "S37", allowed, "correct the list", value)
    if kind in BOUNDS:
        limits = {own: f"{one:.15g}" if isinstance(one, float) else one
                  for own, one in context.items()}  # fmt: skip
        allowed = f"it must be {BOUNDS[kind].format(**limits, unit=_unit_at(path))}"
        return Fault(path, said, "C41", allowed, "choose a value in range", value)
    if kind in LENGTHS:
        count = counted(next(iter(context.values())), "character")
        allowed = f"{LENGTHS[kind].partition(' {')[0]} {count}"
        fix = "shorten it" if kind == "string_too_long" else "write it out"
        return Fault(path, said, "C41", allowed, fix, value)
    if kind == "string_pattern_mismatch":
        named = str(value).isprintable()
        allowed = "is one line without control characters"
        allowed = NAMES.get(context["pattern"], allowed) if named else allowed
        return Fault(path, said, "S37", f"allowed {allowed}", "rename it", value)
    if kind == "value_error":
        return Fault(path, said, "S37", f"it {context['error']}", value=value)
    wanted, fix = WANTED.get(kind, UNKNOWN)
    header = at[: at.rindex("]") + 1] if "]" in at else f"[{key}]"
    if kind == "dict_type" and header != at and not isinstance(path[-1], int):
        header = f"{header[:-1]}.{key}]"
    return Fault(path, said, "S37", f"it must be {wanted}", fix.format(header=header), value)


def shown(value: object) -> str:
    """A value as the file has it, on one line, shortened."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # TOML's words; JSON has others
    return _cut(json.dumps(value, ensure_ascii=False, default=str))


def right_unit(key: str, value: object, known: Collection[str]) -> str:
    """The fix for a key whose word is known in another unit, its value converted if it can be.

    Examples
    --------
    >>> right_unit("position_mm", 0.01, ["position_um"])
    'write position_um = 10'
    """
    stem, _, unit = key.rpartition("_")
    for right in known if unit in SIZES else ():
        word, _, wanted = right.rpartition("_")
        if word == ALIASES.get(stem, stem) and wanted in SIZES and (wanted != unit or word != stem):
            same = (unit in OF_LENGTHS) == (wanted in OF_LENGTHS)
            if same and isinstance(value, int | float) and not isinstance(value, bool):
                return f"write {right} = {value * SIZES[unit] / SIZES[wanted]:g}"
            return f'the key is "{right}": give the value in {wanted}'
    return ""


def _unit_at(path: tuple[str | int, ...]) -> str:
    """Unit of a number, after a space: `` um`` at position_um; nothing where no key tells one."""
    for key in path[::-1]:
        for end, unit in UNITS.items():
            if str(key).endswith(f"_{end}"):
                # a place, then a rotation vector
                return f" {'mm' if path[-1] in (0, 1, 2) else 'deg'}" if unit == "" else f" {unit}"
    return ""


def _cut(text: str) -> str:
    """A text of a length that stands in a sentence."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def _of_one_branch(mistakes: Sequence[Any]) -> Sequence[dict[str, Any]]:
    """Mistakes in a key that takes a word or a list: those of what it holds, as the file has it."""
    kept = []
    for mistake in mistakes:
        loc, kind, value = mistake["loc"], mistake["type"], mistake["input"]
        if kind == "too_short" and len(value) >= mistake["ctx"]["min_length"]:
            continue  # counts only sound entries; the others have their own mistake
        if len(loc) == 1:  # no branch, and there may be 60,000
            kept.append(mistake)
            continue
        tags = [str(part).partition("[") for part in loc]
        word, rows = (any(tag[:2] == (name, "[") for tag in tags) for name in ("literal", "tuple"))
        text = kind == "string_type" and loc[-1] == "str"
        if ((word or text) and isinstance(value, list)) or (rows and kind == "tuple_type"):
            continue
        if word and any(other["type"] == "tuple_type" and other["loc"][:-1] == loc[:-1]
                        for other in mistakes[:MOST]):  # fmt: skip
            kind = "literal_or_list"
        branches = (("literal", "["), ("tuple", "["))
        loc = tuple(p for p, tag in zip(loc, tags, strict=True) if tag[:2] not in branches)
        if text:
            kind, loc = "string_or_list", loc[:-1]
        kept.append({**mistake, "loc": loc, "type": kind})
    return kept or list(mistakes)


def _fault(schema: type[Strict], mistake: Mapping[str, Any]) -> Fault:
    """One mistake: ``[joints 2] has no key "thta_deg"; did you mean "theta_deg"?``."""
    loc, kind, value = mistake["loc"], mistake["type"], mistake["input"]
    context = mistake.get("ctx", {})
    is_name = loc[-1:] == ("[key]",)
    table, key, known = _place(schema, loc[:-2] if is_name else loc)
    at = key if table == FILE and key else f"{table} {key}".strip()
    if kind == "extra_forbidden":
        fix = right_unit(str(loc[-1]), value, known) or choice_of(str(loc[-1]), known)
        return Fault(loc, f'{table} has no key "{key}"', fix=fix, value=value)
    if kind == "missing" and isinstance(loc[-1], int):
        table, key, _ = _place(schema, loc[:-1])
        message = f"{table} {key} has {counted(len(value), 'entry')}"
        return Fault(loc, message, fix="add what is missing", value=value)
    if kind == "union_tag_invalid":
        name = context["discriminator"].strip("'")
        context = {"expected": context["expected_tags"]}
        return in_words(f"{at} {name}", (*loc, name), "literal_error", context, value[name])
    if kind in ("missing", "union_tag_not_found"):
        name = context["discriminator"].strip("'") if context else key
        return Fault(loc, f'{table} needs the key "{name}"' if name else f"{table} is missing")
    if kind == "value_error" and isinstance(value, Mapping):  # of a table, not of one key
        place = "" if table == FILE else f"{table}: "
        return Fault(loc, f"{place}{context['error']}", value=value)
    return in_words(at, loc, kind, context, value)


def _place(schema: type[Strict], loc: tuple[int | str, ...]) -> tuple[str, str, list[str]]:
    """Table in brackets, key, and the keys that table may have."""
    names, tables = [], [schema]
    for depth, part in enumerate(loc):
        inner = [
            model
            for table in tables
            if isinstance(part, str) and part in table.model_fields
            for model in models_in(table.model_fields[part].annotation)
        ]
        if isinstance(part, int):
            names.append(f" {part + 1}")  # people count from one
        elif inner:
            names.append(f".{part}")
            tables = inner
        elif depth < len(loc) - 1 and any(_kind(table) == part for table in tables):
            tables = [table for table in tables if _kind(table) == part]
        else:
            rest = "".join(
                f"[{p}]" if isinstance(p, int) else f".{_cut(p)}" for p in loc[depth + 1 :]
            )
            known = [name for table in tables for name in table.model_fields]
            return _header(names), f"{_cut(part)}{rest}", known
    return _header(names), "", []


def _header(names: Sequence[str]) -> str:
    """A table in brackets: ``[joints 2]``, ``[uncertainty.systematic]``."""
    return f"[{''.join(names)[1:]}]" if names else FILE


def _kind(table: type[Strict]) -> str:
    """Value of the field `kind` that tells the members of a union apart."""
    field = table.model_fields.get("kind")
    return str(get_args(field.annotation)[0]) if field and get_args(field.annotation) else ""
