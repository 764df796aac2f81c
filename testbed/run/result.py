"""Results of finished runs: read, checked for what every run states, and compared byte for byte."""

from collections.abc import Mapping, Sequence
from hashlib import file_digest, sha256
from pathlib import Path
from types import NoneType
from typing import Any

from calib.errors import refuse
from testbed.store import layout
from testbed.store.documents import check_format, damaged, read_json
from testbed.store.manifest import read_manifest, require_campaign
from testbed.store.npz import MOST_BYTES

EACH = "*"
"""Stands for every name of a table."""
SHAPE: Mapping[str, Any] = {
    "notice": str,
    "scenario": str,
    "seed": int,
    "verdict": {"sentence": str},
    "trials": {
        EACH: {
            "poses": int,
            "estimates": {
                EACH: {
                    "believable": bool,
                    "held_out_before": {"mean_mm": float},
                    "held_out_after": {"mean_mm": float, "p95_mm": float, "max_mm": float},
                    "stated_u_3d_rms_mm": float,
                    "held_out_inside_95": float,
                    "chi_square_per_dof": float | None,
                }
            },
        }
    },
    "failed": {EACH: str},
}
"""What the first table of a run shows, by name, and of which type; a float may be written whole."""
WORDS = {
    str: "text", int: "a whole number", bool: "true or false", float: "a number",
    float | None: "a number or null",
}  # fmt: skip


def read_result(path: str | Path) -> dict[str, Any]:
    """result.json of a run folder, with everything in it that `SHAPE` names.

    Raises
    ------
    InputError
        D42: it is no run folder, not finished, of a newer version, or damaged.
    """
    folder, file = Path(path), Path(path) / layout.RESULT
    again = _again(folder)
    require_campaign(folder, read_manifest(folder))
    try:
        document = read_json(file, fix=again)
    except FileNotFoundError as error:
        message = f"has no {layout.RESULT}: the run is not finished"
        fix = "give the `truebed run` command again with --resume"
        raise refuse("", code="D42", message=message, fix=fix, where=str(path)) from error
    check_format(document, file, again)
    if told := misfit(document, SHAPE):
        raise damaged(file, told, again)
    return document


def misfit(value: object, shape: Any, at: str = "") -> str:
    """The first thing of a document that is missing or of another type, or nothing.

    Examples
    --------
    >>> misfit({"a": {"x": {"n": "1"}}}, {"a": {EACH: {"n": int}}})
    'a.x.n is "1" instead of a whole number'
    """
    if isinstance(shape, Mapping):
        if not isinstance(value, Mapping):
            return f"{at} is not a table"
        names = value if EACH in shape else shape
        told = (
            misfit(value[name], shape.get(name, shape.get(EACH)), f"{at}.{name}".lstrip("."))
            if name in value
            else f"{f'{at}.{name}'.lstrip('.')} is missing"
            for name in names
        )
        return next(filter(None, told), "")
    kinds = {float: (int, float), float | None: (int, float, NoneType)}.get(shape, (shape,))
    if type(value) in kinds:
        return ""
    shown = f'"{value}"' if isinstance(value, str) else str(value)
    return f"{at} is {shown[:40]} instead of {WORDS[shape]}"


def equal_runs(paths: Sequence[Path]) -> list[list[Path]]:
    """Groups of runs whose result.json and arrays.npz are equal byte for byte."""
    alike: dict[tuple[int, ...], list[Path]] = {}
    for path in paths:
        sizes = tuple(_size(path / name) for name in (layout.RESULT, layout.ARRAYS))
        alike.setdefault(sizes, []).append(path)
    groups: dict[bytes, list[Path]] = {}
    for same in alike.values():
        for path in same if len(same) > 1 else ():  # others are not read at all
            total = sha256()
            for name in (layout.RESULT, layout.ARRAYS):
                total.update(_digest(path / name))
            groups.setdefault(total.digest(), []).append(path)
    return [group for group in groups.values() if len(group) > 1]


def _size(path: Path) -> int:
    """Bytes of a file; -1 where there is none."""
    size = path.stat().st_size if path.is_file() else -1
    if size > MOST_BYTES:
        raise damaged(path, f"it has {size / 1e6:.6g} MB", _again(path.parent))
    return size


def _digest(path: Path) -> bytes:
    """sha256 of a file; of nothing where there is none."""
    if not path.is_file():
        return sha256().digest()
    with path.open("rb") as file:
        return file_digest(file, "sha256").digest()


def _again(folder: Path) -> str:
    """How a derived file is had again."""
    return f"write it again by `truebed report {folder}`"
