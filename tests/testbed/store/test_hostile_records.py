"""Records made to do harm, their checksums right: refused in a moment, nothing is allocated."""

import io
import os
import struct
import time
import tracemalloc
import zipfile

import numpy as np
import pytest

from calib.errors import InputError
from testbed.store import npz
from testbed.store.npz import DamagedError, record_bytes, record_from
from testbed.store.run_folder import RunFolder
from tests.testbed.studies.trial.fake_campaign import FakeSetting, FakeTrial, Inner

SPEC = "0" * 64
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
    "long double": (with_header((3,), "<f16"), FakeTrial),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_record_that_nobody_wrote_is_damaged_and_costs_nothing(name):
    data, kind = HOSTILE[name]
    start = time.process_time()
    tracemalloc.start()
    with pytest.raises(DamagedError):
        record_from(data, "a", kind, SPEC)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1e6
    assert time.process_time() - start < 1.0


def test_what_a_record_holds_comes_back_where_nobody_touched_it():
    assert record_from(sealed(TRIAL), "a", FakeTrial, SPEC).mean == 0.5
    assert record_from(io.BytesIO(sealed(PARTS)), "a", FakeSetting, SPEC).parts[0].maybe == 0.5


@pytest.mark.parametrize("size", [10**9, 5 * 10**9])
def test_a_sparse_record_of_gigabytes_is_refused_unread(tmp_path, size):
    folder = RunFolder(tmp_path)
    (tmp_path / "trials").mkdir()
    with (tmp_path / "trials" / "a.npz").open("wb") as file:
        file.truncate(size)  # takes no room
    start = time.process_time()
    assert folder.read_record("a", FakeTrial, SPEC) is None
    with pytest.raises(InputError, match=r"the record a is damaged; again\. \[D42\]"):
        folder.require_record("a", FakeTrial, SPEC, fix="again")
    assert time.process_time() - start < 1.0


def test_a_pipe_in_place_of_a_record_is_not_waited_for(tmp_path):
    (tmp_path / "trials").mkdir()
    os.mkfifo(tmp_path / "trials" / "a.npz")
    assert RunFolder(tmp_path).read_record("a", FakeTrial, SPEC) is None
