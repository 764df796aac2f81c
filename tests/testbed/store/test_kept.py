"""Records whose arrays stay in their file: the same numbers, little memory, nothing damaged."""

import tracemalloc
from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np
import pytest

from calib.arrays import Array, Bool
from calib.errors import InputError
from testbed.store import kept, npz
from testbed.store.kept import each_row
from testbed.store.npz import Failure, record_content
from testbed.store.run_folder import RunFolder

RNG = np.random.default_rng(8)
SPEC = "0" * 64


@dataclass(frozen=True, slots=True, eq=False)
class Inner:
    """Something below."""

    pose: Annotated[Array, 3]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Robots."""

    word: str
    share: Annotated[Array, 2, "R"]
    flag: Annotated[Bool, "R"]
    error: Annotated[Array, "f", "R", 2]
    names: Annotated[tuple[str, ...], "f"]
    inner: Inner
    none: Annotated[Array, 0, "R"]


def found(count=50):
    return Found(
        "x", RNG.random((2, count)), RNG.random(count) < 0.5, RNG.standard_normal((3, count, 2)),
        ("a", "b", "c"), Inner(np.arange(3.0)), np.zeros((0, count)),
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    return RunFolder(tmp_path)


def write(folder, record, *, meta=(), arrays=()):
    content = record_content("a", record, SPEC, single=True)
    folder.path.joinpath("trials").mkdir(exist_ok=True)
    changed = npz.Content({**content.meta, **dict(meta)}, {**content.arrays, **dict(arrays)})
    folder.write_record("a", changed)
    return folder.path / "trials" / "a.npz"


def test_a_kept_record_is_the_record_that_is_read_at_once(folder):
    path = write(folder, found())
    content = record_content("a", folder.read_record("a", Found, SPEC), SPEC, single=True)
    assert path.read_bytes() == npz.to_bytes(*content)  # written into the file or as bytes
    whole = folder.read_record("a", Found, SPEC)
    one = folder.read_record("a", Found, SPEC, kept=True)
    assert isinstance(one, Found)
    assert (one.word, one.names) == (whole.word, whole.names)
    assert one.inner.pose.tolist() == whole.inner.pose.tolist()
    for name in ("share", "flag", "error", "none"):
        mine, theirs = getattr(one, name), getattr(whole, name)
        assert (mine.dtype, mine.shape) == (theirs.dtype, theirs.shape)
        assert mine.tobytes() == theirs.tobytes()
        assert not mine.flags.writeable
        assert mine is not getattr(one, name)  # read again
        rows = [row.tobytes() for row in each_row(one, name)]
        assert rows == [row.tobytes() for row in each_row(whole, name)]
        assert len(rows) == len(theirs)
    write(folder, Failure("no luck"))
    assert folder.read_record("a", Found, SPEC, kept=True).reason == "no luck"


def test_memory_is_what_is_looked_at(folder, monkeypatch):
    """Ten megabytes in the file; a row of one array is a hundredth of it."""
    monkeypatch.setattr(kept, "AT_ONCE", 2**16)
    count = 10**5
    record = found(2)
    record = Found(
        "x", np.ones((2, count)), np.ones(count, bool), np.ones((12, count, 2)),
        tuple("abcdefghijkl"), record.inner, np.zeros((0, count)),
    )  # fmt: skip
    write(folder, record)
    tracemalloc.start()
    one = folder.read_record("a", Found, SPEC, kept=True)
    assert tracemalloc.get_traced_memory()[0] < 2e5
    tracemalloc.reset_peak()
    total = sum(row.sum() for row in each_row(one, "error"))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert total == 24 * count
    assert peak < 5 * 8 * 2 * count  # a row in float32 and float64, and the one before it


@pytest.mark.parametrize("step", [7, 97])
def test_no_flipped_byte_and_no_cut_passes(folder, step):
    path = write(folder, found(9))
    good = path.read_bytes()
    whole = folder.read_record("a", Found, SPEC)
    for place in range(step, len(good), 5 * step):
        for data in (good[:place], good[:place] + bytes([good[place] ^ 0x10]) + good[place + 1 :]):
            path.write_bytes(data)
            one = folder.read_record("a", Found, SPEC, kept=True)
            for field in fields(Found) if one is not None else ():
                if isinstance(getattr(whole, field.name), np.ndarray):
                    assert getattr(one, field.name).tolist() == getattr(whole, field.name).tolist()


@pytest.mark.parametrize(
    "changed",
    [
        {"arrays": {"share": np.full((2, 50), np.nan, np.float32)}},
        {"arrays": {"share": np.ones((2, 49), np.float32)}},
        {"arrays": {"share": np.ones((2, 50), np.int64)}},
        {"arrays": {"more": np.ones(2)}},
        {"meta": {"values": {"word": "x"}}},
        {"meta": {"key": "b"}},
        {"meta": {"spec_sha256": "1" * 64}},
    ],
)
def test_what_no_version_writes_is_not_taken_though_its_checksum_holds(folder, changed):
    write(folder, found(), **changed)
    assert folder.read_record("a", Found, SPEC, kept=True) is None
    with pytest.raises(InputError, match=r"the record a .*; again\. \[D42\]|another version"):
        folder.require_record("a", Found, SPEC, fix="again", kept=True)


def test_a_file_that_changes_while_it_is_used_is_told(folder):
    path = write(folder, found())
    one = folder.read_record("a", Found, SPEC, kept=True)
    write(folder, found(51))
    with pytest.raises(InputError, match="it was changed while it was used; give the command"):
        _ = one.share
    path.unlink()
    with pytest.raises(InputError, match="No such file"):
        next(each_row(one, "error"))


def test_arrays_under_the_checksum_of_others_are_not_taken(folder):
    """The sums of the zip are right: only the record's own tells."""
    path = write(folder, found())
    meta, arrays = npz.from_bytes(path.read_bytes())
    other = {**arrays, "share": arrays["share"][::-1]}
    np.savez(path, meta=np.frombuffer(npz.canonical(meta), np.uint8), **other)
    assert folder.read_record("a", Found, SPEC, kept=True) is None
    np.savez(path, meta=np.frombuffer(npz.canonical(meta), np.uint8), **arrays)
    assert isinstance(folder.read_record("a", Found, SPEC, kept=True), Found)
