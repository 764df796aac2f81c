"""Strict TOML: a file into a pydantic schema, every mistake told at once with a likely fix."""

import difflib
import json
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from calib.errors import InputError


class Strict(BaseModel):
    """Base of file schemas: no unknown keys, no conversions, no nan."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


Schema = TypeVar("Schema", bound=Strict)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``did you mean "x"?``, or what there is to choose from."""
    names = sorted(known)
    close = difflib.get_close_matches(word, names, n=1)
    return f'did you mean "{close[0]}"?' if close else f"there is {', '.join(names) or 'nothing'}"


def read_toml(path: Path, schema: type[Schema]) -> Schema:
    """Read and validate a TOML file.

    Raises
    ------
    InputError
        Lists every mistake by table and key; the file is named in `where`.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(
            f"cannot be read ({error.strerror})", code="S37", where=str(path), field="file"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"byte {error.start} is not UTF-8",
            code="S38",
            where=str(path),
            field="file",
            fix="save the file as UTF-8",
        ) from error
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: a number of thousands of digits
        told = isinstance(error, tomllib.TOMLDecodeError) and str(error)
        raise InputError(
            f"not valid TOML: {told or 'nested too deeply, or an endless number'}",
            code="S38",
            where=str(path),
            field="file",
        ) from error
    try:
        # JSON mode: lists become tuples, but true is no number and 1 is no text
        return schema.model_validate_json(json.dumps(tables, default=str))
    except ValidationError as error:
        mistakes = [_sentence(schema, dict(mistake)) for mistake in error.errors()]
        raise InputError(
            "; ".join(dict.fromkeys(mistakes)),
            code="S37",
            where=str(path),
            field=".".join(str(part) for part in error.errors()[0]["loc"]),
            value=error.errors()[0].get("input"),
        ) from error


def _sentence(schema: type[Strict], mistake: dict[str, Any]) -> str:
    """One mistake in words: ``[joints 2] has no key "thta_deg"; did you mean "theta_deg"?``."""
    table, key, known = _place(schema, mistake["loc"])
    if mistake["type"] == "extra_forbidden":
        return f'{table} has no key "{key}"; {did_you_mean(key, known)}'
    if mistake["type"] == "missing":
        return f'{table} needs the key "{key}"'
    reason = mistake["msg"].removeprefix("Value error, ").removeprefix("Input ")
    if not key:
        return f"{table}: {reason}"
    shown = str(mistake["input"])
    return f"{table} {key} = {shown[:60]}{'...' * (len(shown) > 60)}: {reason}"


def _place(schema: type[Strict], loc: tuple[int | str, ...]) -> tuple[str, str, list[str]]:
    """Table in brackets, key, and the keys that table may have."""
    names, tables = [], [schema]
    for depth, part in enumerate(loc):
        inner = [
            model
            for table in tables
            if isinstance(part, str) and part in table.model_fields
            for model in _models(table.model_fields[part].annotation)
        ]
        if isinstance(part, int):
            names.append(str(part + 1))  # people count from one
        elif inner:
            names.append(part)
            tables = inner
        elif depth < len(loc) - 1 and any(_kind(table) == part for table in tables):
            tables = [table for table in tables if _kind(table) == part]
        else:
            rest = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in loc[depth + 1 :])
            known = [name for table in tables for name in table.model_fields]
            return f"[{' '.join(names)}]" if names else "the file", f"{part}{rest}", known
    return f"[{' '.join(names)}]" if names else "the file", "", []


def _models(annotation: Any) -> list[type[Strict]]:
    """Schemas inside an annotation such as ``tuple[A | B, ...]``."""
    if isinstance(annotation, type) and issubclass(annotation, Strict):
        return [annotation]
    return [model for inner in get_args(annotation) for model in _models(inner)]


def _kind(table: type[Strict]) -> str:
    """Value of the field `kind` that tells the members of a union apart."""
    field = table.model_fields.get("kind")
    return str(get_args(field.annotation)[0]) if field and get_args(field.annotation) else ""
