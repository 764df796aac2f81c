"""Single results as files of their own: arrays and JSON with a checksum, nothing pickled."""

from importlib import import_module
from pathlib import Path
from typing import Any

from calib.errors import refuse
from testbed.disk import atomic_write, read_bounded
from testbed.gates.paths import real
from testbed.store.npz import (
    MOST_BYTES,
    DamagedError,
    Failure,
    OtherVersionError,
    from_bytes,
    record_bytes,
    record_from,
)

HOMES = {
    "Bootstrap": "calib.uncertainty.bootstrap",
    "CalibratedRobot": "calib",
    "Certificate": "calib.design",
    "Chain": "calib",
    "Correction": "calib.compensation",
    "Identification": "calib",
    "Judgement": "calib",
    "Measurements": "calib",
    "PoseBudget": "calib.design",
    "PoseCorrection": "calib.compensation",
    "PoseCount": "calib.design",
    "Prior": "calib",
    "RandomFigures": "calib.design",
    "Ranking": "calib.design",
    "RobotModel": "calib",
    "Selection": "calib.design",
    "ToolStatement": "calib.uncertainty.tool_point",
}
"""Classes of results that can be saved to a file, and the module of each."""
SUFFIX = ".npz"
WANTED = "give a folder that truebed wrote, or an .npz file of truebed.save"
WHOLE = "truebed saved this"
"""Mark of these files, in the field where a record of a run has the hash of its scenario."""


def keep(result: object, path: Path) -> None:
    """Write a result of `calib` to one file.

    Raises
    ------
    InputError
        A3: no such result; D42: the file does not end in .npz, or cannot be written there.
    """
    kind = type(result).__name__
    if kind not in HOMES or type(result) is not _class(kind):
        allowed = f"one of {', '.join(HOMES)}; or a Campaign or a Robot, which become folders"
        raise refuse("result", kind, allowed, code="A3", message=f"{kind} cannot be saved here")
    if path.suffix != SUFFIX:
        message = "is not the name of an .npz file"
        fix = f"write {path.with_suffix(SUFFIX).name}" if path.name else "name a file"
        raise refuse("path", str(path), code="D42", message=message, fix=fix, where=str(path))
    real(path, field="path", code="D42")
    atomic_write(path, record_bytes(kind, result, WHOLE))


def kept(path: Path) -> Any:
    """The result in a file that `keep` wrote.

    Raises
    ------
    InputError
        D42: it is damaged, of another version, or holds something else.
    """
    try:
        data = read_bounded(path, MOST_BYTES)
        meta, _ = from_bytes(data)
        kind = str(meta.get("key"))
        if kind not in HOMES or meta.get("spec_sha256") != WHOLE:
            message = "holds no result that truebed.save wrote"
            raise refuse("", code="D42", message=message, fix=WANTED, where=str(path))
        found = record_from(data, kind, _class(kind), WHOLE)
    except OtherVersionError as error:
        message, fix = f"was saved by another version: {error}", "save it again"
        raise refuse("", code="D42", message=message, fix=fix, where=str(path)) from error
    except (OSError, DamagedError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        message = f"cannot be read: {reason}"
        raise refuse("", code="D42", message=message, fix=WANTED, where=str(path)) from error
    assert not isinstance(found, Failure), "only results are saved"
    return found


def _class(kind: str) -> type[Any]:
    """The class of a kind of result."""
    found = getattr(import_module(HOMES[kind]), kind)
    assert isinstance(found, type)
    return found
