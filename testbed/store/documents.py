"""JSON documents of a folder, read: whole, of a version that is known, or refused in a sentence."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib.errors import InputError, refuse
from testbed.disk import read_bounded
from testbed.store.layout import FORMAT
from testbed.store.npz import MOST_JSON, strict_json


def read_json(path: Path, *, fix: str) -> dict[str, Any]:
    """A JSON object from a file, whose size is seen first; `fix` says how a whole one is had.

    Raises
    ------
    FileNotFoundError, NotADirectoryError
        It is not there.
    InputError
        D42: it cannot be read, is too large, or no such object.
    """
    try:
        return strict_json(read_bounded(path, MOST_JSON))
    except (FileNotFoundError, NotADirectoryError):
        raise
    except (OSError, ValueError) as error:
        raise damaged(path, getattr(error, "strerror", None) or str(error), fix) from error


def check_format(document: Mapping[str, Any], path: Path, fix: str) -> None:
    """Refuse a document of a newer version, or of none."""
    version = document.get("format")
    if type(version) is int and version > FORMAT:
        message, allowed = f"has format {version}", f"this version reads format {FORMAT}"
        newer = "install a newer truebed"
        raise refuse(
            "format", version, allowed, code="D42", message=message, fix=newer, where=str(path)
        )
    if type(version) is not int or version != FORMAT:
        raise damaged(path, f"format is {version!r}", fix)


def damaged(path: Path, reason: str, fix: str) -> InputError:
    """The error for a file of ours that does not hold what we write."""
    return refuse("", code="D42", message=f"is damaged: {reason}", fix=fix, where=str(path))
