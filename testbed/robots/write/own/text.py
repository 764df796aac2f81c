"""Attributes in the text of an XML file, written anew where they stand; all other bytes stay."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np

from calib.arrays import Array
from testbed.robots.describe.xml_gate import parse_xml
from testbed.robots.write.own.places import NotCorrectableError

UNREADABLE = "its text is in an encoding that is not understood here: save it as UTF-8"
DIGITS = 13
"""Decimals of new numbers: below `places.SAME`, above rounding [m, rad]."""
MARKUP = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|</[^>]*>"
    r"|<(?P<tag>[^\s<>/]+)(?:[^\"'<>]|\"[^\"]*\"|'[^']*')*>",
    re.DOTALL,
)
"""What stands between < and > in a well-formed document without a type; a start tag has a name."""
ATTRIBUTE = re.compile(r"(?P<lead>\s+(?P<name>[^\s=]+)\s*=\s*)(?P<text>\"[^\"]*\"|'[^']*')")
WIDE = ("utf-16-le", "utf-16-be")
"""Encodings whose marks are not those of ASCII; in all others bytes can be taken one by one."""


class _Edit(NamedTuple):
    """New text for a part of the old one."""

    start: int
    end: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class XmlText:
    """The text of a document beside its tree, and what is to be changed in it."""

    root: Any
    """The tree (lxml), without comments."""
    text: str
    encoding: str
    tags: dict[Any, re.Match[str]]
    """Start tags by their elements."""
    edits: list[_Edit] = field(default_factory=list)

    @classmethod
    def of(cls, data: bytes, tag: str, *, where: str) -> Self:
        """A checked document whose root has a tag.

        Raises
        ------
        NotCorrectableError
            Its text cannot be taken apart.
        """
        text, encoding = _decoded(data)
        tags = [found for found in MARKUP.finditer(text) if found["tag"]]
        elements = list(parse_xml(data, tag, where=where).iter())
        if [tag["tag"].rpartition(":")[2] for tag in tags] != [_local(one.tag) for one in elements]:
            raise NotCorrectableError(UNREADABLE)
        return cls(elements[0], text, encoding, dict(zip(elements, tags, strict=True)))

    def write(
        self, element: Any, new: Mapping[str, str], *, without: frozenset[str] = frozenset()
    ) -> None:
        """Give an element new attributes, in place of those of the same names or after all.

        Those `without` go, with the blanks before them.
        """
        tag, new = self.tags[element], dict(new)
        end = tag.end("tag")
        while found := ATTRIBUTE.match(self.text, end):
            end = found.end()
            if (value := new.pop(found["name"], None)) is not None:
                self.edits.append(_Edit(found.start("text") + 1, end - 1, value))
            elif found["name"] in without:
                self.edits.append(_Edit(found.start(), end, ""))
        if new:  # attributes that the element lacks
            self.edits.append(_Edit(end, end, _written(new)))

    def insert(self, parent: Any, tag: str, new: Mapping[str, str]) -> None:
        """Put an element first into another one, indented as what follows it."""
        start = self.tags[parent].end()
        rest = self.text[start : self.text.index("<", start)]
        indent = rest if not rest.strip() else ""
        self.edits.append(_Edit(start, start, f"{indent}<{tag}{_written(new)}/>"))

    def changed(self) -> bytes:
        """The document with what was written."""
        out, end = [], 0
        for edit in sorted(self.edits):
            out += [self.text[end : edit.start], edit.text]
            end = edit.end
        return "".join([*out, self.text[end:]]).encode(self.encoding)


def numbers(values: Array) -> str:
    """Numbers with `DIGITS` decimals, without zeros at their ends."""
    return " ".join(f"{value:.15g}" for value in np.round(values, DIGITS) + 0.0)


def require_rest(name: str, before: Iterable[Any], after: Iterable[Any]) -> None:
    """Raise a RuntimeError if two documents differ in what was not to be changed."""
    if list(before) != list(after):
        raise RuntimeError(f"{name} differs from the file in more than the frames of its arm")


def content(element: Any, without: frozenset[str] = frozenset()) -> tuple[Any, ...]:
    """Tag, attributes but some, and text of an element."""
    kept = {name: value for name, value in element.attrib.items() if name not in without}
    return element.tag, kept, (element.text or "").strip()


def _decoded(data: bytes) -> tuple[str, str]:
    """Text of which every character that XML needs is itself, and how it becomes bytes again."""
    for wide in WIDE:
        if data.startswith(("\ufeff".encode(wide), "<".encode(wide))):
            return data.decode(wide), wide
    return data.decode("latin-1"), "latin-1"


def _local(tag: str) -> str:
    """A tag without its namespace."""
    return tag.rpartition("}")[2]


def _written(new: Mapping[str, str]) -> str:
    """Attributes as text."""
    return "".join(f' {name}="{value}"' for name, value in new.items())
