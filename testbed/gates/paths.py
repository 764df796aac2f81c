"""Paths that people and their files name: what no file system can hold is refused in our words."""

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from itertools import islice
from pathlib import Path

from calib.errors import refuse
from testbed.names import name_meant

MOST = 1000
"""Entries of a folder among which a name is looked for."""
SHOWN = 60
"""Characters, the last ones, of a path in a message about the path itself."""
LONGEST_NAME = 200
"""Bytes of a name that one made of it keeps: 255 make a file, and some come on top."""
REASONS = {errno.ELOOP: "is a ring of links", errno.ENAMETOOLONG: "is too long for a path"}


def real(path: str | Path, *, field: str, code: str = "R7", where: str = "") -> Path:
    """The absolute path with its links followed, whether or not something is there.

    What comes back may be asked for its kind, size and folder without an error.

    Parameters
    ----------
    path : str or Path
        As somebody wrote it.
    field : str
        What it stands for, for the message.
    code, where : str
        Of the error.

    Raises
    ------
    InputError
        No file can lie there: a NUL, a name of 300 characters, a ring of links, a closed folder, or
        bytes that are not UTF-8.
    """
    try:
        found = Path(path).resolve()
        with suppress(FileNotFoundError, NotADirectoryError):
            found.stat()
        str(found).encode()
    except (OSError, ValueError, RuntimeError) as error:
        number = errno.ELOOP if isinstance(error, RuntimeError) else getattr(error, "errno", None)
        reason = REASONS.get(number or 0) or getattr(error, "strerror", None)
        if isinstance(error, UnicodeEncodeError):
            reason = "has a path that is not UTF-8, which records and MuJoCo cannot hold"
        text = str(path)
        name = text if len(text) <= SHOWN else f"...{text[-SHOWN:]}"
        message = f"{field} {name} {reason or 'holds a character that no path has'}"
        raise refuse(field, text, code=code, message=message, where=where) from error
    return found


def is_there(path: Path, kind: Callable[[Path], bool] = Path.exists) -> bool:
    """Whether something of a kind (`Path.is_file`, `Path.is_dir`) lies there; not where none can.

    Examples
    --------
    >>> is_there(Path("x" * 300), Path.is_file)
    False
    """
    with suppress(OSError, ValueError):
        return kind(path)
    return False


def near(path: Path, otherwise: str = "check the path") -> str:
    """What to do where nothing lies: the name beside it that was meant, or something else."""
    folder = path.parent
    if not is_there(folder, Path.is_dir):
        return f"there is no folder {folder}"
    with suppress(OSError, ValueError):
        there = [Path(one.name) for one in islice(folder.iterdir(), MOST) if one.name[0] != "."]
        # endings would make strangers alike
        alike = {one.stem: one.name for one in there if one.suffix == path.suffix}
        other = sorted(one.name for one in there if one.stem == path.stem)
        hint = name_meant(path.stem, [stem for stem in alike if stem != path.stem])
        name = alike[hint.partition('"')[2].rpartition('"')[0]] if hint else "".join(other[:1])
        if name and name != path.name:
            return f'did you mean "{folder / name}"?'
    return otherwise


def short_stem(path: Path) -> str:
    """Name of a file without its ending, short enough for one with more behind it."""
    stem = path.stem
    while len(os.fsencode(stem)) > LONGEST_NAME:
        stem = stem[:-1]
    return stem
