"""The gate of every XML robot description: size, syntax, depth, document types, numbers, ranges."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from calib.errors import InputError, refuse
from testbed.bounds import Bound
from testbed.gates.paths import real

LARGEST = 8 * 2**20
"""Bytes; a description of a robot has kilobytes, its meshes lie in other files."""
DEEPEST, MOST_ELEMENTS, MOST_ATTRIBUTES = 256, 50_000, 100
LONGEST = 1000
"""Characters of an attribute that is not a row of numbers: names and files are shown to people."""
NUMERIC = frozenset("0123456789+-.eE \t\n")
CONTROL = re.compile(r"[\x00-\x1f\x7f]")
CHUNK = 2**16
SHOWN = 60
"""Characters of an attribute in a message."""
SOURCE = "{truebed}file"
"""Attribute with the file that an included element comes from, while it is checked."""
COUNTS = {
    1: "write one number",
    2: "write two numbers, separated by spaces",
    3: "write three numbers, separated by spaces",
    4: "write four numbers, separated by spaces",
    6: "write six numbers, separated by spaces",
}


@dataclass(frozen=True, slots=True)
class FileOptions:
    """How a description is read, as `testbed.robots.catalog.load_robot` takes it."""

    tip: str | None = None
    mesh_root: Path | None = None
    allow_missing_meshes: bool = False

    def folder(self, path: Path) -> Path:
        """What holds all meshes of a file."""
        return real(self.mesh_root or path.parent, field="mesh_root")


def read_xml(path: Path, *roots: str) -> Any:
    """Root element (lxml) of an XML file that may be trusted to be plain data.

    Nothing outside the file is read and nothing is expanded.

    Parameters
    ----------
    path : Path
        File to read, in any encoding XML knows.
    roots : str
        Tags of which the root element must have one, e.g. ``robot``.

    Raises
    ------
    InputError
        R1 truncated or malformed, R2 no such XML, R3 to R5 document type or entity, R17 too deep.
    """
    return parse_xml(xml_bytes(path), *roots, where=str(path))


def xml_bytes(path: Path) -> bytes:
    """What `read_xml` reads of a file; R2 if there is nothing of that size."""
    where = str(path)
    try:
        size = path.stat().st_size
        data = path.read_bytes() if size <= LARGEST else b""
    except OSError as error:
        message = f"cannot be read ({error.strerror})"
        raise refuse("file", code="R2", message=message, where=where) from error
    if size > LARGEST:
        message = f"has {size} bytes"
        raise refuse("file", size, f"at most {LARGEST}", code="R2", message=message, where=where)
    return data


def parse_xml(data: bytes, *roots: str, where: str) -> Any:
    """`read_xml` of bytes in memory; `where` names them in errors.

    The tree is judged while it grows. Comments and processing instructions are left out.
    """
    from lxml import etree

    wanted = " or ".join(f"<{root.rpartition('}')[2]}>" for root in roots)
    if not data.strip():
        raise refuse(
            "file",
            allowed=f"it must be XML with root {wanted}",
            code="R2",
            message="is empty",
            where=where,
        )
    parser = etree.XMLPullParser(
        ("start", "end"), resolve_entities=False, no_network=True, huge_tree=False, recover=False,
        load_dtd=False, remove_comments=True, remove_pis=True,
    )  # fmt: skip
    count = depth = 0
    try:
        for start in range(0, len(data), CHUNK):
            parser.feed(data[start : start + CHUNK])
            for event, element in parser.read_events():
                depth += 1 if event == "start" else -1
                if event == "start":
                    count += 1
                    _check_element(element, count, depth, where)
        root = parser.close()
    except (etree.XMLSyntaxError, ValueError, LookupError) as error:
        raise _refusal(data, error, where, wanted) from error
    if root.tag not in roots:
        message = f"the root element is <{root.tag}>"
        raise refuse(
            "root", root.tag, f"it must be {wanted}", code="R2", message=message, where=where
        )
    return root


def _check_element(element: Any, count: int, depth: int, where: str) -> None:
    """Refuse a tree that grows too wide or too deep, or begins with a document type."""
    if count == 1:
        document = element.getroottree().docinfo
        if document.doctype or document.internalDTD is not None:
            raise _doctype(where)
    if depth > DEEPEST:
        raise _too_deep(where, element.sourceline)
    where = f"{where}:{element.sourceline}"
    if count > MOST_ELEMENTS:
        message, allowed = f"has more than {MOST_ELEMENTS} elements", "a robot has far fewer"
        raise refuse("elements", allowed=allowed, code="R2", message=message, where=where)
    if len(element.attrib) > MOST_ATTRIBUTES:  # lxml lists them in the square of their number
        message = f"<{element.tag}> has {len(element.attrib)} attributes"
        allowed = f"at most {MOST_ATTRIBUTES}"
        raise refuse("attributes", allowed=allowed, code="R2", message=message, where=where)
    for name, text in element.attrib.items():
        if (len(text) <= LONGEST and text.isprintable()) or set(text) <= NUMERIC:
            continue
        message, allowed = f"{name} of <{element.tag}> has {len(text)} characters", ""
        if len(text) > LONGEST:
            allowed = f"at most {LONGEST}"
        elif CONTROL.search(text):
            message = f"{name} of <{element.tag}> holds a control character"
        else:
            continue
        raise refuse(name, allowed=allowed, code="R2", message=message, where=where)


def _refusal(data: bytes, error: Exception, where: str, wanted: str) -> InputError:
    """Why the parser gave up, in our words."""
    text = str(getattr(error, "msg", error))
    line = getattr(error, "lineno", None) or 1
    if b"<!DOCTYPE" in data or "<!DOCTYPE".encode("utf-16-le") in data:
        return _doctype(where)
    if "depth" in text.lower():
        return _too_deep(where, line)
    if not data.lstrip(b"\xef\xbb\xbf\xff\xfe\xfe\xff\x00 \t\r\n").startswith(b"<"):
        message, allowed = (
            f"is not XML (it begins with {data[:16]!r})",
            f"it must be XML with root {wanted}",
        )
        return refuse("file", allowed=allowed, code="R2", message=message, where=where)
    message, fix = f"not well-formed XML: {text}", "the file may be cut off there"
    return refuse("file", code="R1", message=message, fix=fix, where=f"{where}:{line}")


def _doctype(where: str) -> InputError:
    """Document types can carry entity bombs and read other files: never needed here."""
    message = "has a DOCTYPE, which is not allowed"
    fix = "remove the DOCTYPE and write entities out"
    return refuse("DOCTYPE", code="R3", message=message, fix=fix, where=where)


def _too_deep(where: str, line: int) -> InputError:
    """Elements nested without end."""
    message, allowed = "elements are nested too deeply", f"at most {DEEPEST} levels"
    return refuse("depth", allowed=allowed, code="R17", message=message, where=f"{where}:{line}")


def place_of(element: Any, path: Path) -> str:
    """File and line of an element."""
    return f"{element.get(SOURCE) or path}:{element.sourceline}"


def error_at(
    element: Any,
    path: Path,
    code: str,
    message: str,
    field: str,
    value: object = None,
    allowed: str = "",
    fix: str = "",
) -> InputError:
    """An error with the file and the line of the element it is about."""
    where = place_of(element, path)
    return refuse(field, value, allowed, code=code, message=message, fix=fix, where=where)


def called(element: Any) -> str:
    """Tag and name of an element; the nearest named one around it if it has none itself."""
    if element.get("name") is not None:
        return f"{element.tag} {element.get('name')}"
    around = next((one for one in element.iterancestors() if one.get("name") is not None), None)
    inside = "" if around is None else f" in {around.tag} {around.get('name')}"
    return f"<{element.tag}>{inside}"


class Row(NamedTuple):
    """The numbers of one attribute."""

    many: int
    bound: Bound | None = None
    """Of each number; none where nothing is computed with them."""
    unit: str = ""
    """As the file has it; empty where it depends."""


def check_numbers(element: Any, path: Path, rows: Mapping[str, Row]) -> None:
    """R11 and R12: the right count of sensible numbers in each of these attributes."""
    for attribute, (many, bound, unit) in rows.items():
        text = element.get(attribute)
        if text is None:
            continue
        try:
            values = [float(word) for word in text.split(None, many + 1)[: many + 1]]
        except ValueError:
            values = []
        cut = f"{text[:SHOWN]}{'...' * (len(text) > SHOWN)}"
        shown = f'{called(element)} has {attribute}="{cut}"'
        if len(values) != many:
            raise error_at(element, path, "R12", shown, attribute, text, COUNTS[many])
        if not all(math.isfinite(value) for value in values):
            allowed = "every value must be finite"
            raise error_at(element, path, "R11", shown, attribute, text, allowed)
        if bound and not all(bound.least <= abs(v) <= bound.most for v in values if v):
            allowed = bound.allowed(unit)
            raise error_at(element, path, "R11", shown, attribute, text, allowed)


def need(element: Any, path: Path, attribute: str) -> None:
    """R15 and R12: what an element cannot do without."""
    if not element.get(attribute):
        code = "R15" if attribute == "name" else "R12"
        raise error_at(element, path, code, f"{called(element)} has no {attribute}", attribute)


def check_range(element: Any, path: Path, field: str, joint: str, span: tuple[float, float]) -> str:
    """R14: a range is not the wrong way round; a sentence if it is empty."""
    lower, upper = span
    if lower > upper:
        message = f"{joint} has lower {lower:g} above upper {upper:g}"
        raise error_at(element, path, "R14", message, field, span, "lower must be below upper")
    if lower == upper:
        return f"{joint} cannot move: lower and upper are both {lower:g}"
    return ""


def angle_notes(largest: list[float]) -> list[str]:
    """R19: sentences about the largest angles (n,) of turning joints that are in doubt [rad]."""
    if largest and max(largest) > 4 * math.pi:
        return [f"a joint limit is {max(largest):.6g} rad: were degrees taken for radians?"]
    if largest and max(largest) < 0.12:
        return [f"all joint limits are below {max(largest):.3g} rad: were radians converted twice?"]
    return []
