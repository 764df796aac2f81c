"""The gate every XML robot description passes first: size, syntax, depth, no document types."""

from pathlib import Path
from typing import Any

from calib.errors import InputError

LARGEST = 16 * 2**20
"""Bytes; a description of a robot has kilobytes, its meshes lie in files of their own."""
DEEPEST = 256


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
    try:
        size = path.stat().st_size
        data = path.read_bytes() if size <= LARGEST else b""
    except OSError as error:
        raise InputError(
            f"cannot be read ({error.strerror})", code="R2", where=str(path), field="file"
        ) from error
    if size > LARGEST:
        raise InputError(
            f"has {size} bytes",
            code="R2",
            where=str(path),
            field="file",
            value=size,
            allowed=f"at most {LARGEST}",
        )
    return parse_xml(data, *roots, where=str(path))


def parse_xml(data: bytes, *roots: str, where: str) -> Any:
    """`read_xml` of bytes in memory; `where` names them in errors."""
    from lxml import etree

    root = "> or <".join(roots)
    if not data.strip():
        raise InputError(
            "is empty", code="R2", where=where, field="file", allowed=f"XML with root <{root}>"
        )
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, huge_tree=False, recover=False, load_dtd=False
    )
    try:
        element = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise _refusal(data, error, where, root) from error
    document = element.getroottree().docinfo
    if document.doctype or document.internalDTD is not None:
        raise _doctype(where)
    if element.tag not in roots:
        raise InputError(
            f"the root element is <{element.tag}>",
            code="R2",
            where=where,
            field="root",
            value=element.tag,
            allowed=f"<{root}>",
        )
    _check_depth(element, where)
    return element


def _refusal(data: bytes, error: Exception, where: str, root: str) -> InputError:
    """Why the parser gave up, in our words."""
    text = str(getattr(error, "msg", error))
    line = getattr(error, "lineno", None) or 1
    if b"<!DOCTYPE" in data or "<!DOCTYPE".encode("utf-16-le") in data:
        return _doctype(where)
    if "depth" in text.lower():
        return _too_deep(where, line)
    if not data.lstrip(b"\xef\xbb\xbf\xff\xfe\xfe\xff\x00 \t\r\n").startswith(b"<"):
        return InputError(
            f"is not XML (it begins with {data[:16]!r})",
            code="R2",
            where=where,
            field="file",
            allowed=f"XML with root <{root}>",
        )
    return InputError(
        f"not well-formed XML: {text}",
        code="R1",
        where=f"{where}:{line}",
        field="file",
        fix="the file may be cut off there",
    )


def _doctype(where: str) -> InputError:
    """Document types can carry entity bombs and read other files: never needed here."""
    return InputError(
        "has a DOCTYPE, which is not allowed",
        code="R3",
        where=where,
        field="DOCTYPE",
        fix="remove the DOCTYPE and write entities out",
    )


def _too_deep(where: str, line: int) -> InputError:
    """Elements nested without end."""
    return InputError(
        "elements are nested too deeply",
        code="R17",
        where=f"{where}:{line}",
        field="depth",
        allowed=f"at most {DEEPEST} levels",
    )


def _check_depth(element: Any, where: str) -> None:
    """Depth of the tree, without recursion."""
    level = [element]
    for _ in range(DEEPEST):
        level = [child for parent in level for child in parent]
        if not level:
            return
    raise _too_deep(where, level[0].sourceline)
