"""The origin of numbers in files, from a session.toml in the same folder."""

from collections.abc import Sequence
from typing import Any

from calib.errors import InputError
from testbed.gates.toml import read_toml_bytes, toml_document
from testbed.proposal.data import Document, Found

MOST = 50
"""Largest number of sessions in a folder that are read."""
SECTIONS = ("joints", "frames", "points", "ranges")


def with_origin(document: Document, looks: Sequence[Found]) -> Document:
    """A session with `simulated`, and the meaning of its covariances, from a session of its files.

    That session has to be about the same files. So simulated data never pass for real ones.
    """
    for look in looks:
        if not any(look.name in _files(document.get(name)) for name in SECTIONS):
            continue
        for other in _beside(look):
            if other.get("simulated") is not True:
                continue
            document = {"simulated": True, **document}
            stated, own = other.get("uncertainty"), document.get("uncertainty")
            if own == {} and isinstance(stated, dict) and "joint_repeatability" in stated:
                kept = {"joint_repeatability": stated["joint_repeatability"]}
                document = document | {"uncertainty": kept}
            return document
    return document


def _beside(look: Found) -> list[dict[str, Any]]:
    """The sessions in the folder of a file that name it."""
    found = []
    for path in sorted(look.path.parent.glob("*.toml"))[:MOST]:
        try:
            other = toml_document(read_toml_bytes(path, str(path)), str(path))
        except InputError:
            continue  # the command is not about this session
        if any(look.path.name in _files(other.get(name)) for name in SECTIONS):
            found.append(other)
    return found


def _files(table: object) -> tuple[object, ...]:
    """Names of the files of a table."""
    if not isinstance(table, dict):
        return ()
    files, own = table.get("files"), table.get("reflector_files")
    several = (
        *(files if isinstance(files, list) else ()),
        *(own.values() if isinstance(own, dict) else ()),
    )
    return (table.get("file"), *several)
