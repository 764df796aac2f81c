"""What the files that truebed writes hold, as `outputs.toml` says, and what of a file it lacks."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.schemas.described import unit

if TYPE_CHECKING:
    from sphinx.application import Sphinx

WORDS: dict[str, dict[str, str]] = tomllib.loads(
    Path(__file__).with_name("outputs.toml").read_text(encoding="utf-8")
)
"""By file: pattern of a path, and its sentence."""
PLACE = re.compile(r"^<!-- output: (.*) -->$", re.MULTILINE)


@cache
def compiled(pattern: str) -> re.Pattern[str]:
    """A pattern with ``*`` for one name, or a part of it, and ``a|b`` for either."""
    parts = (
        "|".join(re.escape(one).replace(r"\*", "[^/]+") for one in part.split("|"))
        for part in pattern.split("/")
    )
    return re.compile("/".join(f"(?:{part})" for part in parts))


def paths(document: Mapping[str, Any], above: str = "") -> Iterator[str]:
    """Paths of all figures of a document; ``[]`` for the entries of a list of tables."""
    for key, value in document.items():
        if isinstance(value, Mapping) and value:
            yield from paths(value, f"{above}{key}/")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            yield from paths(value[0], f"{above}{key}[]/")
        else:
            yield f"{above}{key}"


def meanings(file: str, path: str) -> list[str]:
    """Patterns that describe a figure, the one with the most fixed letters first."""
    found = [pattern for pattern in WORDS[file] if compiled(pattern).fullmatch(path)]
    return sorted(found, key=lambda pattern: -len(pattern.replace("*", "")))


def undescribed(file: str, names: Iterator[str] | list[str]) -> list[str]:
    """Figures or columns that nothing describes."""
    return [name for name in names if not meanings(file, name)]


def section(file: str) -> str:
    """All figures of a file as a list."""
    lines = []
    for pattern, sentence in WORDS[file].items():
        *above, last = pattern.split("/")
        path = f"{'/'.join(above)}/" if above else ""
        several = "|" in last
        names = ", ".join(
            f"`{'' if several else path}{name}`{_unit(name)}" for name in last.split("|")
        )
        tail = f"`{path}`" if several and path else ""
        lines += [f"{tail} {names}".strip(), f": {sentence}", ""]
    return "\n".join(lines)


def _unit(name: str) -> str:
    """The unit of a name, in parentheses."""
    written = unit(name) or {"m": "m", "rad": "rad"}.get(name.rpartition("_")[2], "")
    return f" ({written})" if written else ""


def _filled(_app: "Sphinx", _page: str, source: list[str]) -> None:
    """Put the list where a page asks for it."""
    source[0] = PLACE.sub(lambda found: section(found[1]), source[0])


def setup(app: "Sphinx") -> dict[str, bool]:
    """Listen to the reading of pages."""
    app.connect("source-read", _filled)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
