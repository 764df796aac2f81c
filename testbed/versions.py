"""Versions of the program and of the packages that compute."""

import platform
import tomllib
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

NUMBERS = ("numpy", "scipy", "mujoco")
"""A run goes on only with the same version of these (and of truebed)."""
OTHERS = ("yourdfpy", "trimesh", "rerun-sdk", "pydantic", "matplotlib")
NOT_INSTALLED = "not installed"


def own_version() -> str:
    """Version of truebed, installed or run from a checkout."""
    project = Path(__file__).resolve().parent.parent / "pyproject.toml"
    if project.is_file():  # a checkout: an older copy may be installed beside it
        return str(tomllib.loads(project.read_text(encoding="utf-8"))["project"]["version"])
    return _version("truebed")


@cache
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return NOT_INSTALLED


def number_versions() -> dict[str, str]:
    """What must not change when a run goes on."""
    return {"truebed": own_version(), **{name: _version(name) for name in NUMBERS}}


def compiler_version() -> str:
    """Version of what compiles the loops of many robots: it decides last bits."""
    return _version("numba")


@cache
def sources_hash() -> str:
    """Hex sha256 of the code of both packages: what computes, whatever its version says."""
    here, total = Path(__file__).resolve().parent, sha256()
    for root in (here.parent / "calib", here):
        for path in sorted(root.rglob("*.py")):
            if root / "front" not in path.parents:  # lies elsewhere once it is installed
                total.update(path.relative_to(root).as_posix().encode() + b"\0")
                total.update(path.read_bytes() + b"\0")
    return total.hexdigest()


@cache
def processor() -> str:
    """Kind of processor, and what compiles loops for it: bits are promised for one kind only."""
    numba = compiler_version()
    compiler = "" if numba == NOT_INSTALLED else f", numba {numba}"
    return _processor() + compiler


def _processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def all_versions() -> dict[str, str]:
    """Everything a report or a bug report should state."""
    return {
        **number_versions(),
        **{name: _version(name) for name in OTHERS},
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }
