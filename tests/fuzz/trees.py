"""Damage by the grammar of a file: JSON, XML and sealed records."""

import io
import json
import re
from collections.abc import Mapping
from random import Random
from typing import Any

import numpy as np
from lxml import etree

from testbed.store import npz
from tests.fuzz.grammars import NUMBER, NUMBERS, TEXTS, flipped, renumbered


def json_value(rng: Random) -> Any:
    """A value as JSON has them, and the numbers that it must not have."""
    numbers = (0, 1, -1, 2, 1e300, -1e-300, 10**30, float("nan"), float("inf"), 0.5)
    return rng.choice(
        (
            None,
            True,
            [],
            {},
            "",
            [[]],
            {"a": {}},
            *numbers,
            rng.choice(TEXTS),
            [rng.choice(numbers)],
        )
    )


def with_node_changed(document: Any, rng: Random) -> Any:
    """A JSON document with one node replaced, dropped, renamed or put one level deeper."""
    places: list[tuple[Any, Any]] = []
    waiting = [document]
    while waiting:
        node = waiting.pop()
        keys = node.keys() if isinstance(node, dict) else range(len(node))
        places += [(node, key) for key in keys]
        waiting += [node[key] for key in keys if isinstance(node[key], dict | list)]
    if not places:
        return json_value(rng)
    node, key = rng.choice(places)
    what = rng.randrange(6)
    if what <= 2:
        node[key] = json_value(rng)
    elif what == 3:
        del node[key]
    elif what == 4 and isinstance(node, dict):
        node[f"{key}x"] = node.pop(key)
    else:
        node[key] = rng.choice(([node[key]], {"a": node[key]}, [node[key]] * 2))
    return document


def json_changed(data: bytes, rng: Random) -> bytes:
    """A node of a JSON file changed; a key doubled; brackets without end."""
    what = rng.randrange(12)
    if what == 0:
        return b"[" * rng.choice((5, 2000, 200_000)) + data
    if what == 1:
        return data.replace(b"{", b'{"format": 1, "format": 1, ', 1)
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return flipped(data, rng)
    return json.dumps(with_node_changed(document, rng)).encode()


def xml_changed(data: bytes, rng: Random) -> bytes:
    """An attribute or element of an XML file changed; an entity put in."""
    what = rng.randrange(12)
    if what == 0:
        bomb = b'<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c SYSTEM "/etc/passwd">]>'
        return rng.choice((bomb + data, data.replace(b'="', b'="&b;', 1), data + b"&c;"))
    try:
        root = etree.fromstring(data)
    except (ValueError, etree.XMLSyntaxError):
        return flipped(data, rng)
    elements = list(root.iter("*"))
    element, other = rng.choice(elements), rng.choice(elements)
    filled = [one for one in elements if one.attrib]
    if what <= 6 and filled:
        element = rng.choice(filled)
        key = rng.choice(element.keys())
        _change_attribute(element, key, rng)
    elif element is not root and other is not element and element not in other.iterancestors():
        again = etree.fromstring(etree.tostring(element))
        if what == 7:
            element.getparent().remove(element)
        elif what == 8:
            for _ in range(rng.choice((1, 1, 40))):
                element.addnext(etree.fromstring(etree.tostring(again)))
        elif what == 9:
            other.append(element)
        elif what == 10:
            other.append(again)
        else:
            element.tag = rng.choice((*(one.tag for one in elements), "unknown", "include", "cone"))
    else:
        element.text = rng.choice(("1 2 3", "x" * 1000, " "))
    return bytes(etree.tostring(root))


def _change_attribute(element: Any, key: str, rng: Random) -> None:
    """One attribute changed in place."""
    value, what = element.get(key), rng.randrange(6)
    legal = [text for text in TEXTS if not re.search(r"[\x00-\x1f]", text)]
    if what == 0:
        del element.attrib[key]
    elif what == 1:
        element.set(key, rng.choice(legal))
    elif what == 2:
        element.set(rng.choice((f"{key}x", "name", "file", "type")), value)
    elif what == 3:
        element.set(
            key, rng.choice((f"{value} 1", value.rpartition(" ")[0], value.replace(" ", ",")))
        )
    else:
        new = renumbered(value.encode(), rng) if NUMBER.search(value.encode()) else b""
        element.set(key, new.decode("utf-8", "replace").replace("\0", "") or rng.choice(NUMBERS))


Arrays = dict[str, np.ndarray[Any, Any]]


def record_changed(data: bytes, rng: Random) -> bytes:
    """An array or the meta data of a sealed record changed, and sealed again."""
    try:
        meta, arrays = npz.from_bytes(data)
    except npz.DamagedError:
        return flipped(data, rng)
    if rng.random() < 0.4 or not arrays:
        with_node_changed(meta, rng)
    else:
        name = rng.choice(sorted(arrays))
        changed = _array_changed(arrays.pop(name), rng)
        arrays[rng.choice((name, name, name, name, f"{name}x", *sorted(arrays)))] = changed
    return sealed(meta, arrays)


def sealed(meta: Mapping[str, Any], arrays: Arrays) -> bytes:
    """The archive with a checksum that holds, even of what `npz.to_bytes` would refuse."""
    try:
        return npz.to_bytes(meta, arrays)
    except (TypeError, ValueError):
        buffer = io.BytesIO()
        text = json.dumps(meta).encode()
        np.savez(buffer, **{npz.META: np.frombuffer(text, np.uint8)}, **arrays)
        return buffer.getvalue()


def _array_changed(array: np.ndarray[Any, Any], rng: Random) -> np.ndarray[Any, Any]:
    """The array with another type, shape or number."""
    types = ("f4", "f8", "c16", "i8", "u1", "?", "U5", "S3", "O", "M8[s]", ">f8", "f2", "g")
    values = (0.0, -1.0, 1e300, -1e308, 1e-300, float("nan"), float("inf"), float("-inf"))

    def filled() -> np.ndarray[Any, Any]:
        out = array.astype(np.float64) if array.dtype.kind in "biuf" else np.zeros(array.shape)
        if out.size:
            out.flat[rng.randrange(out.size)] = rng.choice(values)
        return out

    with np.errstate(all="ignore"):
        return rng.choice(
            (
                filled,
                filled,
                lambda: array.ravel(),
                lambda: array[..., None],
                lambda: array.T,
                lambda: array.ravel()[:0],
                lambda: np.atleast_1d(array)[:1],
                lambda: np.concatenate([array.ravel()] * 2),
                lambda: np.zeros((0, *array.shape)),
                lambda: np.zeros(array.shape, rng.choice(types)),
                lambda: np.asfortranarray(array),
                lambda: np.array(rng.choice(values)),
            )
        )()
