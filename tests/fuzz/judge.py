"""What may come of an input: refused in words, or accepted with nothing in it that is no number."""

import dataclasses
import json
import os
import resource
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from random import Random

import numpy as np
import pytest
from pydantic import BaseModel

from calib.errors import InputError, one_line
from testbed.store.npz import DamagedError
from tests.fuzz.targets import TARGETS, Target, damaged
from tests.fuzz.whole import Files
from tests.hangs import no_hang

MEMORY = 500_000_000
"""Most address space that reading an input may take [bytes]."""
LINES, LONGEST = 21, 1500
"""Most lines of a refusal, 20 faults of one file and how many more there are; and characters of
one of them."""
MINIMIZE_S = 10.0
ROOT = Path(__file__).parents[2]


class SurpriseError(Exception):
    """An input was neither refused in words nor accepted whole."""


@dataclasses.dataclass(frozen=True, slots=True)
class Failure:
    """One input that surprised, and how."""

    kind: str
    seed: int
    number: int
    what: str
    """What happened, the same for inputs of the same fault."""
    details: str
    file: str
    data: bytes
    """The input made small."""

    def __str__(self) -> str:
        shown = repr(self.data[:1500]) + ("..." if len(self.data) > 1500 else "")
        head = f"{self.kind} seed {self.seed} input {self.number}: {self.what}"
        return f"{head}\n{self.details}\n{self.file} made small: {shown}\n"


def failures(kind: str, seed: int, count: int, folder: Path) -> list[Failure]:
    """The faults that `count` inputs of a kind show, one input of each; seed and number make it."""
    target, found = TARGETS[kind], dict[str, Failure]()
    for number in range(count):
        file, data, files = made(kind, seed, number)
        surprise = surprise_of(target, folder, files, file, data)
        if surprise is not None and str(surprise) not in found:
            what = str(surprise)
            details = "".join(traceback.format_exception(surprise.__cause__ or surprise)[-4:])
            small = minimized(
                data, lambda d, t=target, f=files, n=file, w=what: same(t, folder, f, n, d, w)
            )
            found[what] = Failure(kind, seed, number, what, details, file, small)
    return list(found.values())


def made(kind: str, seed: int, number: int) -> tuple[str, bytes, Files]:
    """The damaged file of one input, its content, and the whole files it lies among."""
    target, rng = TARGETS[kind], Random(f"{kind} {seed} {number}")
    choices = [
        (files, name) for files in target.folders for name in files if name in target.damaged
    ]
    files, file = rng.choice(choices)
    return file, damaged(file, files[file], rng), files


def same(target: Target, folder: Path, files: Files, file: str, data: bytes, what: str) -> bool:
    """Whether an input surprises in this way."""
    return str(surprise_of(target, folder, files, file, data)) == what


def surprise_of(
    target: Target, folder: Path, files: Files, file: str, data: bytes
) -> SurpriseError | None:
    """What is wrong with how a folder of files, one of them damaged, is read; None if nothing."""
    for path in [*folder.rglob("*")]:
        if path.is_file():
            path.unlink()
    for name, content in (files | {file: data}).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    before = listing(folder)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        with overheard() as heard, limited_memory(MEMORY), no_hang():
            value = target.read(folder)
        problem = next(unusable(value, target.may_be_empty, target.largest), "")
    except (InputError, DamagedError) as error:
        value = None
        problem = spoken(error, files)
    except pytest.fail.Exception:
        return SurpriseError("hangs")
    except Exception as error:
        surprise = SurpriseError(f"{type(error).__name__} at {last_place(error)}")
        surprise.__cause__ = error
        return surprise
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak) * 1024
    if grown > MEMORY:
        problem = "takes too much memory"
    elif heard:
        problem = f"a library says: {heard[0][:60]}"
    elif value is None and listing(folder) != before:
        problem = "refused, and yet something was written"
    return SurpriseError(problem) if problem else None


def listing(folder: Path) -> list[str]:
    """Every file below a folder."""
    return sorted(str(path) for path in folder.rglob("*"))


def last_place(error: BaseException) -> str:
    """The last line of ours that an exception came through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [one for one in frames if one.filename.startswith((f"{ROOT}/calib", f"{ROOT}/testbed"))]
    last = (ours or list(frames))[-1]
    return f"{Path(last.filename).relative_to(ROOT) if ours else last.filename}:{last.lineno}"


def spoken(error: InputError | DamagedError, files: Files) -> str:
    """What is wrong with the words of a refusal: it names the user's file and is not endless.

    Nobody is shown those of a damaged record: its run says that it is damaged.
    """
    if isinstance(error, DamagedError):
        return ""
    text = str(error)
    lines = text.split("\n")
    if len(lines) > LINES or max(map(len, lines)) > LONGEST:
        return "refused at endless length"
    if any(one_line(line) != line for line in lines):
        return "refused with words that steer a terminal"
    if "should have" in text or "should be a valid" in text or "Input should" in text:
        return "refused in words of pydantic's"
    if error.where or any(name in text for name in files):
        return ""
    return f"refused without naming a file [{error.code}]"


def unusable(
    value: object, may_be_empty: frozenset[str], largest: float, path: str = ""
) -> Iterator[str]:
    """Numbers in a value that are not finite or above the largest, by their path."""
    name = path.rpartition(".")[2].partition("[")[0]
    if name in may_be_empty:
        return
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from unusable(
                getattr(value, field.name), may_be_empty, largest, f"{path}.{field.name}"
            )
    elif isinstance(value, BaseModel):
        yield from unusable(vars(value), may_be_empty, largest, path)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from unusable(item, may_be_empty, largest, f"{path}.{key}")
    elif isinstance(value, tuple | list | set | frozenset):
        for item in value:
            yield from unusable(item, may_be_empty, largest, f"{path}[]")
    elif isinstance(value, np.ndarray | np.generic | float | complex):
        array = np.asarray(value)
        if array.dtype.kind not in "biufUM" and array.dtype.kind != "S":
            yield f"accepted with {path} of type {array.dtype}"
        elif array.dtype.kind == "f":
            if not np.isfinite(array).all():
                yield f"accepted with {path} not finite"
            elif (np.abs(array) > largest).any():
                yield f"accepted with {path} too large"


@contextmanager
def overheard() -> Iterator[list[str]]:
    """Lines that anyone writes to stdout or stderr meanwhile, past Python or through it."""
    lines: list[str] = []
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as file:
        sys.stdout.flush()
        sys.stderr.flush()
        kept = {number: os.dup(number) for number in (1, 2)}
        for number in kept:
            os.dup2(file.fileno(), number)
        try:
            with redirect_stdout(file), redirect_stderr(file):
                yield lines
        finally:
            for number, copy in kept.items():
                os.dup2(copy, number)
                os.close(copy)
            file.flush()
            if os.fstat(file.fileno()).st_size:
                file.seek(0)
                lines += [line for line in file.read().splitlines() if line]


@contextmanager
def limited_memory(size: int) -> Iterator[None]:
    """No more address space than there is now and `size` bytes."""
    if sys.platform != "linux":
        yield
        return
    now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (now + size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def minimized(data: bytes, surprises: Callable[[bytes], bool]) -> bytes:
    """The input with as much taken out as leaves its surprise, in lines first, then in bytes."""
    end = time.monotonic() + MINIMIZE_S
    for mark in (b"\n", b",", b""):
        parts = data.split(mark) if mark else [bytes([one]) for one in data]
        size = max(len(parts) // 2, 1)
        while time.monotonic() < end and len(parts) > 1:
            at = 0
            while at < len(parts) and time.monotonic() < end:
                left = parts[:at] + parts[at + size :]
                if surprises(mark.join(left)):
                    parts = left
                else:
                    at += size
            if size == 1:
                break
            size //= 2
        data = mark.join(parts)
    return data


def report(found: list[Failure]) -> str:
    """All failures in words."""
    return "\n".join(["", *map(str, found)])


if __name__ == "__main__":
    kind, seed, number = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    name, content, around = made(kind, seed, number)
    with tempfile.TemporaryDirectory() as place:
        print(json.dumps({"file": name, "size": len(content)}))  # noqa: T201 - a script
        print(surprise_of(TARGETS[kind], Path(place), around, name, content))  # noqa: T201 - likewise
