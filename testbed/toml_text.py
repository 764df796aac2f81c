"""Tables as TOML."""

import json
from collections.abc import Mapping
from typing import Any


def toml_lines(table: Mapping[str, Any], name: str = "") -> list[str]:
    """A table as TOML: its own keys, then the tables in it, then its lists of tables."""
    inner = {k: v for k, v in table.items() if isinstance(v, dict)}
    rows = {k: v for k, v in table.items() if isinstance(v, list) and v and isinstance(v[0], dict)}
    plain = {k: v for k, v in table.items() if k not in inner and k not in rows and v is not None}
    lines = [f"{toml_key(k)} = {toml_value(v)}" for k, v in plain.items()]
    dot = f"{name}." if name else ""
    for key, value in inner.items():
        lines += ["", f"[{dot}{key}]", *toml_lines(value, f"{dot}{key}")]
    for key, values in rows.items():
        for value in values:
            lines += ["", f"[[{dot}{key}]]", *toml_lines(value, f"{dot}{key}")]
    return lines


def toml_key(name: str) -> str:
    """A key as TOML: in quotes where it is not one bare word."""
    bare = name.replace("_", "").replace("-", "").isalnum() and name.isascii()
    return name if bare else toml_value(name)


def toml_value(value: object) -> str:
    """One value as TOML; the strings and numbers of JSON are also TOML's."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
