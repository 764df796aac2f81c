"""Comments of a TOML file: to which key or table each belongs, so that another file can have them.

The text must be TOML; a comment above a line, or at its end, belongs to what that line states.
"""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from testbed.faults import KeyPath
from testbed.gates.toml import TOKEN

NAME = re.compile(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|[^\s."\'=\[\]]+')


@dataclass(frozen=True, slots=True)
class Commented:
    """A key with its value, or the header of a table; at the end of a file neither."""

    path: KeyPath | None
    """Keys and positions in lists of tables that lead to it."""
    text: str
    """As written, without comments around it."""
    above: tuple[str, ...]
    """Comments on lines above it, or inside a list of several lines."""
    behind: str
    """Comment at the end of its line."""


def statements(text: str) -> Iterator[Commented]:
    """All keys and headers of a TOML text in their order, then what is said at its end."""
    table: KeyPath = ()
    rows = Counter[KeyPath]()
    above: list[str] = []
    inside: list[str] = []
    start = level = 0
    for token in TOKEN.finditer(text + "\n"):
        mark = token[0]
        if mark.startswith("#"):
            inside.append(mark)
        level += (mark in ("[", "{")) - (mark in ("]", "}"))
        if mark != "\n" or level:
            continue
        whole, start = text[start : token.start()].strip(), token.end()
        if not whole or whole.startswith("#"):
            above, inside = above + inside, []
            continue
        behind = inside.pop() if inside and whole.endswith(inside[-1]) else ""
        stated = whole.removesuffix(behind).rstrip()
        if stated.startswith("["):
            table = _names(stated)
            if stated.startswith("[["):
                rows[table] += 1
                table = (*table, rows[table] - 1)
            path = table
        else:
            path = (*table, *_names(stated.partition("=")[0]))
        yield Commented(path, stated, (*above, *inside), behind)
        above, inside = [], []
    yield Commented(None, "", tuple(above), "")


def with_comments(text: str, source: str) -> str:
    """A TOML text with the comments of another one that has, among others, the same keys."""
    said = {one.path: one for one in statements(source)}
    lines: list[str] = []
    for one in statements(text):
        theirs = said.get(one.path, Commented(None, "", (), ""))
        if one.text.startswith("[") and lines:
            lines.append("")
        lines += [*theirs.above, *one.above]
        behind = " ".join(comment for comment in (theirs.behind, one.behind) if comment)
        lines.append(f"{one.text}  {behind}".rstrip())
    return "\n".join(lines).rstrip() + "\n"


def _names(stated: str) -> KeyPath:
    """Names of a dotted key or of a header."""
    return tuple(name.strip("\"'") for name in NAME.findall(stated))
