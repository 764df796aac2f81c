"""A folder written at once: all of its files or none, and never written over in silence."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from calib.errors import InputError
from testbed.disk import TEMPORARY, flush_file, flush_folder, write_error
from testbed.store.layout import MANIFEST

PLAN = "plan.json"
"""The file that makes a folder a plan's; it is written last."""
OWNERS = {
    PLAN: "a plan's folder",
    MANIFEST: "a run folder",
    "session.toml": "an exported session's folder",
}
"""What the file that marks a folder makes it; no other folder is renamed."""
TABLE, REPORT, RECORDING, SCENARIO = "plan.csv", "plan_report.html", "plan.rrd", "scenario.toml"


def check_free(path: Path, *, overwrite: bool, marker: str = PLAN) -> None:
    """Refuse a folder that cannot be used, before anything is computed.

    Raises
    ------
    InputError
        Something is there that is not ours to move, or nothing can be written there.
    """
    try:
        if path.exists() and not _is_empty(path):
            _check_movable(path, overwrite=overwrite, marker=marker)
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(suffix=TEMPORARY, dir=path.parent):
            pass
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise InputError(
            f"cannot be written: {getattr(error, 'strerror', None) or error}",
            code="C40",
            where=str(path),
            field="--out",
            fix="choose another --out",
        ) from error


@contextmanager
def plan_folder(path: Path, *, overwrite: bool = False, marker: str = PLAN) -> Iterator[Path]:
    """A folder beside `path` to be filled, which becomes `path` when the block ends well.

    With `overwrite` an old one there, known by its `marker`, is renamed, never removed. On any
    exception nothing is left.

    Raises
    ------
    InputError
        `path` cannot be used.
    MachineError
        The disk is full.
    """
    check_free(path, overwrite=overwrite, marker=marker)
    try:
        temporary = Path(tempfile.mkdtemp(TEMPORARY, f".{path.name}.", path.parent))
    except OSError as error:
        raise write_error(path, error) from error
    try:
        yield temporary
        for file in temporary.rglob("*"):
            if file.is_file():
                flush_file(file)
        temporary.chmod(0o755)
        check_free(path, overwrite=overwrite, marker=marker)
        _make_way(path)
        temporary.rename(path)
        flush_folder(path.parent)
    except OSError as error:
        raise write_error(path, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def write_text(folder: Path, name: str, text: str) -> None:
    """Write one file of a plan as UTF-8 with plain line ends."""
    (folder / name).write_bytes(text.encode())


def _is_empty(path: Path) -> bool:
    """Whether it is a folder with nothing in it."""
    return path.is_dir() and not any(path.iterdir())


def _check_movable(path: Path, *, overwrite: bool, marker: str) -> None:
    """Refuse anything but an old folder of its kind that may be renamed."""
    if not path.is_dir():
        told, fix = "is a file", "choose another --out"
    elif not overwrite:
        told, fix = "exists already", "choose another --out, or rename the old one by --overwrite"
    elif not (path / marker).is_file():
        told, fix = f"is not {OWNERS[marker]} and will not be renamed", "choose another --out"
    else:
        return
    raise InputError(told, code="C40", where=str(path), field="--out", fix=fix)


def _make_way(path: Path) -> None:
    """Remove an empty folder, rename an old plan to the first free ``<name>.old-<k>``."""
    if not path.exists():
        return
    if _is_empty(path):
        path.rmdir()
        return
    number = 1
    while (new := path.with_name(f"{path.name}.old-{number}")).exists():
        number += 1
    path.rename(new)
