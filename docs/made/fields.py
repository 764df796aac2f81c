"""The keys of a file as its schema declares them: unit, what is allowed, default, what it means."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from pydantic.fields import FieldInfo

from testbed.schemas.described import meaning, unit
from testbed.strict import Strict, models_in
from testbed.toml_text import toml_value


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a table."""

    name: str
    unit: str
    allowed: str
    default: str
    meaning: str
    tables: tuple[type[Strict], ...]
    """Schemas of what stands below it; none for a plain value."""


@cache
def keys(model: type[Strict]) -> tuple[Key, ...]:
    """The keys of a table in the order of the file."""
    found, schema = [], _schema(model)
    for name, field in model.model_fields.items():
        tables = tuple(dict.fromkeys(models_in(field.rebuild_annotation())))
        allowed = "" if tables else allowed_of(schema[name])
        default = "" if tables else _default(field)
        found.append(Key(name, unit(name), allowed, default, meaning(model, name), tables))
    return tuple(found)


@cache
def _schema(model: type[Strict]) -> Mapping[str, Any]:
    """The properties of a table's JSON schema."""
    properties: Mapping[str, Any] = model.model_json_schema()["properties"]
    return properties


def _default(field: FieldInfo) -> str:
    """A default as a file writes it."""
    if field.is_required():
        return "needed"
    value = field.get_default(call_default_factory=True)
    if value in (None, {}, "", ()):
        return "none"
    return f"`{toml_value(value)}`"


def allowed_of(schema: Mapping[str, Any]) -> str:
    """What a value may be, in words."""
    if "anyOf" in schema:
        kinds = [allowed_of(kind) for kind in schema["anyOf"] if kind.get("type") != "null"]
        return " or ".join(dict.fromkeys(kinds))
    if "const" in schema:
        return f"`{toml_value(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{toml_value(value)}`" for value in schema["enum"])
    match schema.get("type"):
        case "boolean":
            return "`true`, `false`"
        case "string":
            return "text" + _at_most(schema, "maxLength", "characters")
        case "integer" | "number":
            return ("whole number" if schema["type"] == "integer" else "number") + _range(schema)
        case "array":
            return _list(schema)
        case "object":
            value = schema.get("additionalProperties") or {}
            (each,) = schema.get("patternProperties", {"": value}).values()
            return f"names, each with {allowed_of(each)}"
    raise TypeError(f"no words for {schema}")


def _list(schema: Mapping[str, Any]) -> str:
    """A list, of fixed length or not."""
    entries = schema.get("prefixItems")
    if entries is None:
        least, most = schema.get("minItems", 0), schema.get("maxItems")
        if least == most:
            return f"{least} entries: {allowed_of(schema['items'])}"
        span = f"{least} to {most}" if most is not None else f"{least} or more" if least else ""
        return f"list{f' of {span} entries' if span else ''}: {allowed_of(schema['items'])}"
    each = [allowed_of(entry) for entry in entries]
    if len(set(each)) == 1:
        return f"{len(each)} entries: {each[0]}"
    return "; ".join(f"entry {k}: {words}" for k, words in enumerate(each, 1))


def _range(schema: Mapping[str, Any]) -> str:
    """The range of a number."""
    low, high = schema.get("minimum"), schema.get("maximum")
    above, below = schema.get("exclusiveMinimum"), schema.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f", {_short(low)} to {_short(high)}"
    parts = []
    if low is not None:
        parts.append(f"{_short(low)} or more")
    if above is not None:
        parts.append(f"above {_short(above)}")
    if high is not None:
        parts.append(f"at most {_short(high)}")
    if below is not None:
        parts.append(f"below {_short(below)}")
    return f", {' and '.join(parts)}" if parts else ""


def _short(number: float) -> str:
    """A limit as people write it."""
    return f"{number:.6g}"


def _at_most(schema: Mapping[str, Any], key: str, what: str) -> str:
    """The length of a text."""
    return f", at most {schema[key]} {what}" if key in schema else ""


def tables(model: type[Strict], name: str = "") -> Iterator[tuple[str, type[Strict]]]:
    """Every table below a schema with its name in the file, each schema once for a place."""
    yield name, model
    schema = _schema(model)
    for key in keys(model):
        kind = schema[key.name]
        several = any(one.get("type") == "array" for one in (kind, *kind.get("anyOf", ())))
        below = f"{name}.{key.name}" if name else key.name
        for inner in key.tables:
            yield from tables(inner, f"{below}[]" if several else below)
