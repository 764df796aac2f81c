"""JSON Schema of a file, for editors: what they complete, explain and underline while one types.

Draft 7, which every editor of TOML reads: `definitions`, lists of fixed length under `items`.
"""

import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic.json_schema import models_json_schema

from calib.errors import refuse
from testbed.disk import atomic_write
from testbed.names import did_you_mean
from testbed.scenario.laboratory import PaperTracker, TruthSettings
from testbed.scenario.planning import BoxGoal, PlanSettings
from testbed.scenario.presets import REPEATABILITY
from testbed.schemas.described import meaning, summary, unit
from testbed.schemas.files import FILES, roots
from testbed.schemas.names import TITLE, directive, schema_name
from testbed.strict import Strict, models_in

Json = dict[str, Any]
Tables = tuple[tuple[str, type[Strict]], ...]
DRAFT = "http://json-schema.org/draft-07/schema#"
FILLED = (TruthSettings, PlanSettings)
"""Tables whose keys presets and the robot fill in: none of them must be given."""
PRESUMED = (PaperTracker, BoxGoal)
"""What a table is whose preset or kind is not given."""


def schema(file: str) -> Json:
    """JSON Schema of one of `FILES`: as strict as its reader, but for what takes computing."""
    return _schema(file, tuple(roots(file)))


def _schema(file: str, tables: Tables) -> Json:
    """The same of a file of these tables."""
    models = list(dict.fromkeys(one for _, root in tables for one in _all_in(root)))
    # mode "validation": what is read, not what is written
    named, whole = models_json_schema(
        [(model, "validation") for model in models], ref_template="#/definitions/{model}"
    )
    definitions: Json = whole["$defs"]
    names = {model: named[model, "validation"]["$ref"].rpartition("/")[2] for model in models}
    tagged = set(_tags(definitions))
    for model, name in names.items():
        definitions[name] = _table(definitions[name], model, tagged)
    top = definitions.pop(names[tables[0][1]])
    for table, model in tables[1:]:
        top["properties"][table] = {"$ref": f"#/definitions/{names[model]}"}
    if file == "scene":
        top["required"] = ["format", "name", "robot"]
        top["anyOf"] = [{"required": ["trial"]}, {"required": ["plan"]}]
    title = f"{TITLE}: {file}.toml"
    return {"$schema": DRAFT, **top, "title": title, "definitions": definitions}


def schema_text(file: str) -> str:
    """JSON Schema of a file, as text.

    Raises
    ------
    InputError
        C41: no such file is read.
    """
    if file not in FILES:
        raise refuse(
            "FILE", file, f"there are {', '.join(FILES)}", code="C41",
            message=f'there is no schema of "{file}"', fix=did_you_mean(file, FILES),
        )  # fmt: skip
    return _text(file, tuple(roots(file)))


@cache
def _text(file: str, tables: Tables) -> str:
    """The same of a file of these tables, made once: a person in a notebook writes several."""
    return json.dumps(_schema(file, tables), ensure_ascii=False, indent=1) + "\n"


def schema_beside(path: Path, file: str) -> str:
    """Write the schema of a file into its folder, and the line that tells an editor of it.

    A file of that name that is none of ours stays as it is, and the line is empty.
    """
    place = path.parent / schema_name(file)
    if place.exists() or place.is_symlink():
        try:
            ours = str(json.loads(place.read_bytes())["title"]).startswith(TITLE)
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            ours = False
        if not ours:
            return ""
    atomic_write(place, schema_text(file).encode())
    return directive(file)


def _all_in(model: type[Strict]) -> Iterator[type[Strict]]:
    """A table and all that stand below it."""
    yield model
    for field in model.model_fields.values():
        for inner in models_in(field.rebuild_annotation()):
            yield from _all_in(inner)


def _tags(value: object) -> Iterator[tuple[str, str]]:
    """Tables that a key tells apart, by name, each with that key."""
    if isinstance(value, Mapping):
        if "discriminator" in value:
            tag = value["discriminator"]
            yield from ((ref.rpartition("/")[2], tag["propertyName"])
                        for ref in tag["mapping"].values())  # fmt: skip
        for inner in value.values():
            yield from _tags(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _tags(inner)


def _table(schema: Json, model: type[Strict], tagged: set[tuple[str, str]]) -> Json:
    """One table, as an editor shows it."""
    out = {key: _plain(value) for key, value in schema.items() if key != "properties"}
    first, rest = summary(model)
    out["description"] = f"{first}\n\n{rest}".strip()
    out["properties"] = {
        name: _explained(_plain(value), model, name) for name, value in schema["properties"].items()
    }
    required = set() if model in FILLED else set(schema.get("required", ()))
    if model not in PRESUMED:
        required |= {tag for name, tag in tagged if name == schema["title"]}
    out.pop("required", None)
    out |= {"required": sorted(required)} if required else {}
    if model is TruthSettings:
        repeatability = out["properties"][REPEATABILITY[-1]]
        said = repeatability.pop("description")
        either = {"anyOf": [repeatability, {"const": "robot"}], "description": said}
        out["properties"][REPEATABILITY[-1]] = either
    return {**out, "title": model.__name__}


def _explained(value: Json, model: type[Strict], name: str) -> Json:
    """A key with its sentence and its unit."""
    said, of = meaning(model, name), unit(name)
    told = f"{said} [{of}]" if said and of else said or (f"[{of}]" if of else "")
    if not told:
        return value
    if "$ref" in value:  # beside which draft 7 reads nothing
        value = {"allOf": [value]}
    return {**value, "description": told}


def _plain(value: Any) -> Any:
    """Words of draft 7, without nulls, which TOML does not have, and titles that repeat names."""
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    if not isinstance(value, Mapping):
        return value
    out = {
        portable(key): _plain(inner)
        for key, inner in value.items()
        if key not in ("title", "discriminator", "default", "pattern", "anyOf", "prefixItems")
    }
    default = value.get("default")
    if isinstance(default, bool | int | float | str | list) and "{" not in str(default):
        out["default"] = default
    if "pattern" in value:
        out["pattern"] = portable(value["pattern"])
    if "prefixItems" in value:
        out["items"] = _plain(value["prefixItems"])
    if kinds := [_plain(one) for one in value.get("anyOf", ()) if one.get("type") != "null"]:
        out |= {"anyOf": kinds} if len(kinds) > 1 else kinds[0]
    return out


def portable(pattern: str) -> str:
    r"""A pattern as every dialect of regular expressions reads it.

    Examples
    --------
    >>> portable(r"^[^\u{2028}]*$")
    '^[^\\u2028]*$'
    """
    return re.sub(r"\\u\{([0-9a-f]{4})\}", r"\\u\1", pattern)
