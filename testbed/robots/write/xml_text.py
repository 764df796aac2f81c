"""Origins of joints in the text of a URDF, replaced where they stand; all other bytes stay."""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from calib.arrays import Array
from testbed.robots.describe.xml_gate import parse_xml
from testbed.robots.placements import rpy

SAME = 1e-12
"""Change of an entry of a frame up to which its numbers stay as they are written [m, 1]."""
DIGITS = 13
"""Decimals of new numbers: below `SAME`, above rounding [m, rad]."""
MARKUP = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|</[^>]*>"
    r"|<(?P<tag>[^\s<>/]+)(?:[^\"'<>]|\"[^\"]*\"|'[^']*')*>",
    re.DOTALL,
)
"""What stands between < and > in a well-formed document without a type; a start tag has a name."""
ATTRIBUTE = re.compile(r"(?P<lead>\s+(?P<name>[^\s=]+)\s*=\s*)(?P<text>\"[^\"]*\"|'[^']*')")
WIDE = ("utf-16-le", "utf-16-be")
"""Encodings whose marks are not those of ASCII; in all others bytes can be taken one by one."""


class JointOrigin(NamedTuple):
    """Frames (4, 4) of a joint in its parent link [m]."""

    old: Array
    new: Array


class _Edit(NamedTuple):
    """New text for a part of the old one."""

    start: int
    end: int
    text: str


def is_same(T: Array, other: Array) -> bool:
    """Whether two frames (4, 4) are the same to rounding."""
    return bool(np.abs(T - other).max() <= SAME)


def with_origins(data: bytes, origins: Mapping[str, JointOrigin], *, where: str) -> bytes | None:
    """A URDF with the origins of some joints replaced; None if its text cannot be taken apart.

    Parameters
    ----------
    data : bytes
        A checked URDF in any encoding.
    origins : mapping
        By the names of joints. Where only the place of an origin changes, its angles stay as they
        are written, and the other way round.
    where : str
        Name of the file in errors.
    """
    text, encoding = _decoded(data)
    tags = [found for found in MARKUP.finditer(text) if found["tag"]]
    elements = list(parse_xml(data, "robot", where=where).iter())
    if [tag["tag"].rpartition(":")[2] for tag in tags] != [_local(one.tag) for one in elements]:
        return None
    place = dict(zip(elements, tags, strict=True))
    edits: list[_Edit] = []
    for joint in elements[0].findall("joint"):
        origin = origins.get(joint.get("name"))
        if origin is None:
            continue
        own = joint.find("origin")
        new = _attributes(origin, "0 0 0" if own is None else own.get("rpy", "0 0 0"))
        if own is None:
            edits.append(_new_element(text, place[joint].end(), new))
        else:
            edits += _new_numbers(place[own], new)
    out, end = [], 0
    for edit in sorted(edits):
        out += [text[end : edit.start], edit.text]
        end = edit.end
    return "".join([*out, text[end:]]).encode(encoding)


def _decoded(data: bytes) -> tuple[str, str]:
    """Text of which every character that XML needs is itself, and how it becomes bytes again."""
    for wide in WIDE:
        if data.startswith(("\ufeff".encode(wide), "<".encode(wide))):
            return data.decode(wide), wide
    return data.decode("latin-1"), "latin-1"


def _local(tag: str) -> str:
    """A tag without its namespace."""
    return tag.rpartition("}")[2]


def _new_numbers(tag: re.Match[str], new: dict[str, str]) -> Iterator[_Edit]:
    """Changes of the attributes of an element, by their names; `new` loses those it has."""
    end = tag.end("tag")
    while found := ATTRIBUTE.match(tag.string, end):
        end = found.end()
        if (value := new.pop(found["name"], None)) is not None:
            yield _Edit(found.start("text") + 1, end - 1, value)
    if new:  # attributes that the element lacks
        yield _Edit(end, end, _written(new))


def _new_element(text: str, start: int, new: dict[str, str]) -> _Edit:
    """An origin as the first thing in a joint without one, indented as what follows it."""
    rest = text[start : text.index("<", start)]
    indent = rest if not rest.strip() else ""
    return _Edit(start, start, f"{indent}<origin{_written(new)}/>")


def _written(new: dict[str, str]) -> str:
    """Attributes as text."""
    return "".join(f' {name}="{value}"' for name, value in new.items())


def _attributes(origin: JointOrigin, angles: str) -> dict[str, str]:
    """Text of what changes of an origin whose roll, pitch and yaw were written as `angles`."""
    (old, new), found = origin, dict[str, str]()
    if np.abs(new[:3, 3] - old[:3, 3]).max() > SAME:
        found["xyz"] = _numbers(new[:3, 3])
    if np.abs(new[:3, :3] - old[:3, :3]).max() > SAME:
        roll, pitch, yaw = map(float, angles.split())
        found["rpy"] = _numbers(np.array(near_rpy(new, (roll, pitch, yaw))))
    return found


def _numbers(values: Array) -> str:
    """Numbers with `DIGITS` decimals, without zeros at their ends."""
    return " ".join(f"{value:.15g}" for value in np.round(values, DIGITS) + 0.0)


def near_rpy(T: Array, other: tuple[float, float, float]) -> tuple[float, float, float]:
    """Of all roll, pitch and yaw of a frame (4, 4) those nearest to others [rad].

    Near a half turn they so keep their signs.
    """
    roll, pitch, yaw = rpy(T)
    known = np.array(other)
    found = []
    for angles in ((roll, pitch, yaw), (roll + np.pi, np.pi - pitch, yaw + np.pi)):
        near = angles + 2 * np.pi * np.round((known - angles) / (2 * np.pi))
        found.append((float(np.abs(near - known).max()), near.tolist()))
    r, p, y = min(found)[1]
    return r, p, y
