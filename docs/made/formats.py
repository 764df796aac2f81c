"""Pages of file formats, made from the schemas: ``<!-- keys: scenario -->`` becomes all its tables.

Every table is a section, every key an entry with its unit, what is allowed, its default and its
sentence.
"""

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, get_args

from made.fields import Key, keys, tables
from testbed.scenario.laboratory import TruthSettings
from testbed.scenario.presets import TRUTH_COMMON, TRUTH_PRESETS
from testbed.schemas.described import summary
from testbed.schemas.files import roots
from testbed.strict import Strict
from testbed.toml_text import toml_value

if TYPE_CHECKING:
    from sphinx.application import Sphinx

PLACE = re.compile(r"^<!-- (keys|presets): ?(\w*) -->$", re.MULTILINE)


FILES = {"scenario": "scene", "session": "session", "robot": "robot", "tracker": "tracker"}
"""Names of pages, and of the files that they describe."""


def places(file: str) -> dict[type[Strict], str]:
    """Every table of a file, once, where it stands first."""
    found: dict[type[Strict], str] = {}
    for name, root in roots(FILES[file]):
        for place, model in tables(root, name):
            found.setdefault(model, place)
    return found


def described(key: Key) -> str:
    """The sentence of a key; of a table that of its schema."""
    if key.meaning or not key.tables:
        return key.meaning
    return "; or ".join(dict.fromkeys(summary(model)[0] for model in key.tables))


def page(file: str) -> str:
    """All tables of a file."""
    there = places(file)
    return "\n".join(line for model in there for line in _table(file, model, there))


def _table(file: str, model: type[Strict], there: dict[type[Strict], str]) -> Iterator[str]:
    """One table: its heading, what it is, its keys."""
    place = there[model]
    several = [one for one, other in there.items() if other == place]
    title, rest = summary(model)
    yield f"({_anchor(file, model, there)})="
    variant = f", {_variant(model)}" if len(several) > 1 else ""
    yield f"## {f'`{_bracketed(place)}`' if place else 'The top of the file'}{variant}\n"
    yield f"{title}\n\n{rest}\n"
    for key in keys(model):
        unit = f" ({key.unit})" if key.unit else ""
        yield f"`{key.name}`{unit}"
        meaning = described(key)
        if key.tables:
            links = ", ".join(
                f"[`{_bracketed(there[one])}`](#{_anchor(file, one, there)})" for one in key.tables
            )
            yield f": {meaning} See {links}.\n"
            continue
        default = "by preset" if model is TruthSettings and key.name in PRESET else key.default
        yield f": {meaning}\\\n  <small>{key.allowed}; default: {default}</small>\n".replace(
            "default: needed", "must be given"
        )


PRESET = {key for preset in TRUTH_PRESETS.values() for key in preset} | {
    *TRUTH_COMMON, "preset", "perturb", "joint_repeatability_mdeg",
}  # fmt: skip
"""Keys of [truth] that a preset or the robot fills in."""


def _variant(model: type[Strict]) -> str:
    """The preset or kind of a table that has several."""
    for name in ("preset", "kind"):
        field = model.model_fields.get(name)
        if field is not None:
            return f"{name} {get_args(field.annotation)[0]}"
    return model.__name__


def _bracketed(place: str) -> str:
    """The name of a table as a file has it."""
    return f"[[{place.removesuffix('[]')}]]" if place.endswith("[]") else f"[{place}]"


def _anchor(file: str, model: type[Strict], there: dict[type[Strict], str]) -> str:
    """Where a table stands on its page; reports may link there."""
    place = re.sub(r"[^a-z0-9]+", "-", there[model].lower()).strip("-") or "file"
    several = [one for one, other in there.items() if other == there[model]]
    tail = f"-{_variant(model).split()[-1]}" if len(several) > 1 else ""
    return f"{file}-{place}{tail}"


def presets() -> str:
    """What each preset of [truth] fills in."""
    lines = []
    for name, given in TRUTH_PRESETS.items():
        values = TRUTH_PRESETS["wen2022"] | TRUTH_COMMON | given
        shown = ", ".join(f"`{key} = {toml_value(value)}`" for key, value in values.items())
        lines += [f"`{name}`", f": {shown}", ""]
    return "\n".join(lines)


def _filled(_app: "Sphinx", _page: str, source: list[str]) -> None:
    """Put what is made where a page asks for it."""
    source[0] = PLACE.sub(
        lambda found: page(found[2]) if found[1] == "keys" else presets(), source[0]
    )


def setup(app: "Sphinx") -> dict[str, bool]:
    """Listen to the reading of pages."""
    app.connect("source-read", _filled)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
