"""Records made to do harm, their checksums right: refused in a moment, nothing is allocated."""

import io
import os
import struct
import tracemalloc
import zipfile
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
import pytest

from calib.arrays import Array, Bool, FloatOrNan
from calib.errors import InputError, MachineError
from testbed.store import npz
from testbed.store.npz import DamagedError, record_bytes, record_from
from testbed.store.run_folder import RunFolder
from tests.hangs import no_hang
from tests.memory import peak_below
from tests.testbed.studies.trial.fake_campaign import FakeSetting, FakeStudy, FakeTrial, Inner

SPEC = "0" * 64


@dataclass(frozen=True, slots=True, eq=False)
class Shaped:
    """Fields that state their sizes."""

    vector: Annotated[Array, "t", 3]
    names: Annotated[tuple[str, ...], "t"]
    maybe: Annotated[Bool, "t", "f"] | None
    inner: tuple[Inner, ...] = ()
    free: FloatOrNan = 0.0


SHAPED = Shaped(np.ones((4, 3)), tuple("abcd"), np.ones((4, 2), bool))
TRIAL = FakeTrial("a", np.arange(6.0).reshape(2, 3), 0.5)
PARTS = FakeSetting(np.ones(2), (Inner("x", np.ones((1, 1)), 0.5),))


def sealed(record, values=(), arrays=()):
    """A record with other values and arrays, its checksum made again."""
    meta, own = npz.from_bytes(record_bytes("a", record, SPEC))
    meta = {**meta, "values": {**meta["values"], **dict(values)}}
    return npz.to_bytes(meta, {**own, **dict(arrays)})


def with_header(shape, descr="<f8"):
    """A record whose array `values` claims another shape or kind; the zip's own sums are right."""
    data = record_bytes("a", TRIAL, SPEC)
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(buffer, "w") as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename == "values.npy":
                text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}}}".encode()
                text += b" " * (-(len(text) + 11) % 64) + b"\n"
                content = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + bytes(48)
            new.writestr(zipfile.ZipInfo(entry.filename), content)
    return buffer.getvalue()


def with_member(meta):
    """A record with other meta data, or none."""
    buffer, written = io.BytesIO(), io.BytesIO()
    data = io.BytesIO(record_bytes("a", TRIAL, SPEC))
    with zipfile.ZipFile(data) as old, zipfile.ZipFile(buffer, "w") as new:
        for name in old.namelist():
            if name != "meta.npy":
                new.writestr(zipfile.ZipInfo(name), old.read(name))
        if meta is not None:
            np.save(written, meta)
            new.writestr(zipfile.ZipInfo("meta.npy"), written.getvalue())
    return buffer.getvalue()


HOSTILE = {
    "a tuple of a thousand million": (sealed(PARTS, {"parts.#": 10**9}), FakeSetting),
    "a tuple of fewer than none": (sealed(PARTS, {"parts.#": -(10**9)}), FakeSetting),
    "a tuple of true": (sealed(PARTS, {"parts.#": True}), FakeSetting),
    "a nan in an array": (sealed(TRIAL, arrays={"values": np.array([[np.nan]])}), FakeTrial),
    "an infinite array": (sealed(TRIAL, arrays={"values": np.array([[np.inf]])}), FakeTrial),
    "a complex array": (sealed(TRIAL, arrays={"values": np.ones((2, 3), complex)}), FakeTrial),
    "an array of texts": (sealed(TRIAL, arrays={"values": np.array(["1.0"])}), FakeTrial),
    "an array of times": (sealed(TRIAL, arrays={"values": np.zeros(2, "M8[s]")}), FakeTrial),
    "an array of records": (sealed(TRIAL, arrays={"values": np.zeros(2, "f8,i8")}), FakeTrial),
    "no number": (sealed(TRIAL, {"mean": None}), FakeTrial),
    "a number beyond float64": (sealed(TRIAL, {"mean": 10**400}), FakeTrial),
    "a text for a number": (sealed(TRIAL, {"mean": "0.5"}), FakeTrial),
    "a gigantic array": (with_header((10**15,)), FakeTrial),
    "a gigantic array of nothing": (with_header((10**18,), "<U0"), FakeTrial),
    "sizes that cancel": (with_header((-2, -3)), FakeTrial),
    "objects": (with_header((6,), "|O"), FakeTrial),
    "a size that its field states": (sealed(SHAPED, arrays={"vector": np.ones((4, 2))}), Shaped),
    "a size of another field": (sealed(SHAPED, arrays={"vector": np.ones((5, 3))}), Shaped),
    "as many names as there are": (sealed(SHAPED, {"names.#": 3}), Shaped),
    "a size of a field that may be none": (
        sealed(SHAPED, arrays={"maybe": np.ones((3, 2), bool)}),
        Shaped,
    ),
    "an axis too few": (sealed(SHAPED, arrays={"vector": np.ones(4)}), Shaped),
    "an axis too many": (sealed(SHAPED, arrays={"maybe": np.ones((4, 2, 1), bool)}), Shaped),
    "nothing where something is": (sealed(SHAPED, arrays={"vector": np.ones((0, 3))}), Shaped),
    "no meta data": (with_member(None), FakeTrial),
    "meta data of ten megabytes": (with_member(np.zeros(10**7 + 1, np.uint8)), FakeTrial),
    "long double": (with_header((3,), "<f16"), FakeTrial),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_record_that_nobody_wrote_is_damaged_and_costs_nothing(name):
    data, kind = HOSTILE[name]
    with peak_below(1e6), no_hang(), pytest.raises(DamagedError):
        record_from(data, "a", kind, SPEC)


def test_what_a_record_holds_comes_back_where_nobody_touched_it():
    assert record_from(sealed(TRIAL), "a", FakeTrial, SPEC).mean == 0.5
    assert record_from(io.BytesIO(sealed(PARTS)), "a", FakeSetting, SPEC).parts[0].maybe == 0.5


def test_fields_of_sizes_that_agree_come_back():
    for record in (
        SHAPED,
        Shaped(np.ones((0, 3)), (), None),
        Shaped(np.ones((1, 3)), ("a",), None),
    ):
        found = record_from(record_bytes("a", record, SPEC), "a", Shaped, SPEC)
        np.testing.assert_array_equal(found.vector, record.vector)


def large(tmp_path, record, arrays):
    """A folder whose record has sparse arrays of these shapes, never made in memory."""
    meta, own = npz.from_bytes(record_bytes("a", record, SPEC))
    folder = tmp_path / "trials"
    folder.mkdir()
    with zipfile.ZipFile(folder / "a.npz", "w", allowZip64=True) as archive:
        text = np.frombuffer(npz.canonical(meta), np.uint8)
        for name, array in {npz.META: text, **own}.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                shape = arrays.get(name, array.shape)
                descr = np.lib.format.dtype_to_descr(array.dtype)
                head = {"descr": descr, "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(entry, head)
                if name in arrays:
                    for _ in range(int(np.prod(shape)) * array.itemsize // 2**20):
                        entry.write(bytes(2**20))
                else:
                    entry.write(array.tobytes())
    return RunFolder(tmp_path)


@pytest.mark.parametrize(
    ("kind", "record", "arrays"),
    [
        (Shaped, SHAPED, {"vector": (2**21, 3)}),  # 50 MB of what names do not have
        (FakeStudy, TRIAL, {"values": (2**23, 1)}),  # 67 MB of another class
    ],
)
def test_a_large_record_that_contradicts_itself_is_refused_unread(kind, record, arrays, tmp_path):
    folder = large(tmp_path, record, arrays)
    with peak_below(1e6):
        assert folder.read_record("a", kind, SPEC) is None


def test_a_large_record_is_read_if_there_is_room_and_else_the_machine_is_told(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(npz, "LARGE", 10**6)
    asked = []
    record = FakeTrial("a", np.arange(1e6)[None], 0.5)
    folder = RunFolder(tmp_path)
    (tmp_path / "trials").mkdir()
    folder.write_record("a", record_bytes("a", record, SPEC))
    monkeypatch.setattr(npz, "require_room", asked.append)
    tracemalloc.start()
    found = folder.read_record("a", FakeTrial, SPEC)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    np.testing.assert_array_equal(found.values, record.values)
    (room,) = asked
    assert peak < room.megabytes * 1e6  # what was asked for is enough

    def none_left(_):
        raise MachineError("more memory is needed", code="F10")

    monkeypatch.setattr(npz, "require_room", none_left)
    for read in (folder.read_record, partial(folder.require_record, fix="")):
        with pytest.raises(MachineError, match="more memory"):
            read("a", FakeTrial, SPEC)


@pytest.mark.parametrize("size", [10**9, 5 * 10**9])
def test_a_sparse_record_of_gigabytes_is_refused_unread(tmp_path, size):
    folder = RunFolder(tmp_path)
    (tmp_path / "trials").mkdir()
    with (tmp_path / "trials" / "a.npz").open("wb") as file:
        file.truncate(size)  # takes no room
    with peak_below(1e6):
        assert folder.read_record("a", FakeTrial, SPEC) is None
        with pytest.raises(InputError, match=r"the record a is damaged; again\. \[D42\]"):
            folder.require_record("a", FakeTrial, SPEC, fix="again")


def test_a_pipe_in_place_of_a_record_is_not_waited_for(tmp_path):
    (tmp_path / "trials").mkdir()
    os.mkfifo(tmp_path / "trials" / "a.npz")
    assert RunFolder(tmp_path).read_record("a", FakeTrial, SPEC) is None
