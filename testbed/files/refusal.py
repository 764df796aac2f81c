"""How a measurement file is refused: where, which column or key, and a sentence."""

import shlex
from collections.abc import Sequence
from pathlib import Path

from calib.errors import InputError, refuse
from testbed.gates.paths import is_there
from testbed.store.foreign import WROTE, foreign
from testbed.store.layout import MANIFEST, OWNERS, PLAN
from testbed.store.manifest import CAMPAIGN, kind_of, read_manifest


def refusal(
    where: str,
    field: str,
    message: str,
    *,
    code: str = "M35",
    value: object = None,
    allowed: str = "",
    fix: str = "",
) -> InputError:
    """The error of a file, or of one of its lines; M35 is the code of a table that is not one.

    Parameters
    ----------
    where : str
        File, or file and line.
    field : str
        Column, or key of session.toml.
    message, value, allowed, fix
        As in `calib.errors.CalibError`.
    """
    return refuse(field, value, allowed, code=code, message=message, fix=fix, where=where)


def require_names(column: str, names: Sequence[str], place: Sequence[str]) -> None:
    """Refuse a row (m,) without a name in a column of names.

    Raises
    ------
    InputError
        M25: the first such row.
    """
    if "" in names:
        fix = "fill the cell" if any(names) else "name each row, or take the column out"
        where = place[list(names).index("")]
        raise refusal(where, column, f"{column} is empty", code="M25", fix=fix)


def how_to_read(file: Path, config: str | Path | None) -> Path | None:
    """The session.toml on how to read a file: `config`, or the file itself; None if neither is one.

    Raises
    ------
    InputError
        C41: both are.
    """
    if file.suffix.lower() != ".toml":
        return None if config is None else Path(config)
    if config is not None and Path(config) != file:
        message = "says itself how its files are read, and --config is given"
        raise refusal(str(file), "--config", message, code="C41", fix="leave one of them out")
    return file


def no_rows(where: str) -> InputError:
    """The error of a table that has names of columns and nothing below them."""
    return refusal(
        where, "measurements", "names its columns and has no rows below them", code="M27",
        fix="give the file with what was measured",
    )  # fmt: skip


def no_session(path: Path) -> InputError:
    """The error of a folder that says nothing of measurements."""
    allowed = "a table, or a folder with session.toml"
    if is_there(path / PLAN):
        told = f"is {OWNERS[PLAN]}: what is to be measured, not what was"
        fix = "give the table of what was measured at its poses"
    elif not is_there(path / MANIFEST):
        told, fix = foreign(path)
        told = f"has no session.toml: {told}"
        fix = "check the path" if fix == WROTE else fix
    elif kind_of(read_manifest(path)) == CAMPAIGN:
        told, quoted = (
            f"is {OWNERS[MANIFEST]}, which holds no measurement files",
            shlex.quote(str(path)),
        )
        fix = f"truebed run {quoted} --out {quoted} --resume --export FOLDER writes them"
    else:
        told, fix = "is the folder of a calibration already", "give the files it was made from"
    return refusal(str(path), "DATA", told, code="S38", allowed=allowed, fix=fix)
