"""Run folders: self-checking, locked, never half-written, never overwritten in silence."""

import io
import json
import os
import zipfile

import numpy as np
import pytest

from calib.errors import InputError, MachineError
from testbed.disk import acquire
from testbed.store import layout, npz
from testbed.store.manifest import manifest_bytes, read_manifest
from testbed.store.npz import Failure, record_bytes, record_from
from testbed.store.run_folder import RunFolder
from testbed.store.whole_folder import check_free
from tests.testbed.studies.trial.fake_campaign import FakeTrial

SPEC = "0" * 64
TRIAL = FakeTrial("ä", np.arange(6.0).reshape(2, 3) / 7, -0.0)


def begun(path, **about):
    folder = RunFolder.create(path)
    folder.begin("x = 1\n", {"scenario_sha256": SPEC, **about})
    return folder


def test_every_flipped_byte_of_a_record_is_detected_or_harmless():
    data = record_bytes("a", TRIAL, SPEC)
    silent = harmless = 0
    for i in range(len(data)):
        damaged = bytearray(data)
        damaged[i] ^= 0x55
        try:
            record = record_from(bytes(damaged), "a", FakeTrial, SPEC)
        except npz.DamagedError:
            continue
        # zip dates and attributes carry nothing: the content must then be untouched
        same = record.values.tobytes() == TRIAL.values.tobytes() and record.name == TRIAL.name
        harmless += same
        silent += not same
    assert silent == 0
    assert harmless < len(data) / 2


def test_every_cut_of_a_record_is_detected():
    data = record_bytes("a", TRIAL, SPEC)
    for length in range(len(data)):
        with pytest.raises(npz.DamagedError):
            record_from(data[:length], "a", FakeTrial, SPEC)


def test_a_changed_number_with_a_mended_zip_checksum_is_detected():
    meta, arrays = npz.from_bytes(record_bytes("a", TRIAL, SPEC))
    arrays = {**arrays, "values": arrays["values"] + 1e-16}
    text = np.frombuffer(json.dumps(meta).encode(), np.uint8)
    buffer = io.BytesIO()
    np.savez(buffer, meta=text, **arrays)
    with pytest.raises(npz.DamagedError, match="checksum does not hold"):
        npz.from_bytes(buffer.getvalue())


@pytest.mark.parametrize(
    ("key", "spec"), [("b", SPEC), ("a", "1" * 64)], ids=["another record's", "another scenario's"]
)
def test_a_record_of_something_else_is_never_taken(key, spec):
    with pytest.raises(npz.DamagedError, match="instead of"):
        record_from(record_bytes("a", TRIAL, SPEC), key, FakeTrial, spec)


def test_a_failure_is_a_record_with_its_reason():
    back = record_from(record_bytes("a", Failure("no luck"), SPEC), "a", FakeTrial, SPEC)
    assert back == Failure("no luck")


def test_nothing_is_ever_unpickled():
    class Trap:
        def __reduce__(self):
            return os._exit, (99,)

    buffer = io.BytesIO()
    np.savez(buffer, meta=np.array([Trap()], dtype=object))
    with pytest.raises(npz.DamagedError, match="allow_pickle=False"):
        npz.from_bytes(buffer.getvalue())


def test_a_compressed_bomb_is_refused_before_it_is_unpacked():
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("meta.npy", bytes(10**7))
    with pytest.raises(npz.DamagedError, match="compressed"):
        npz.from_bytes(buffer.getvalue())


@pytest.mark.parametrize(
    "text",
    ['{"a": NaN}', '{"a": Infinity}', '{"a": 1, "a": 2}', "[1]", "", "{", "[" * 10**5, b"\xff"],
)
def test_json_that_is_not_strict_is_refused(text):
    with pytest.raises(ValueError):  # noqa: PT011  # each has its own wording
        npz.strict_json(text)


def test_the_archive_is_readable_by_plain_numpy_and_has_fixed_dates(tmp_path):
    data = record_bytes("a", TRIAL, SPEC)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    with np.load(io.BytesIO(data)) as arrays:
        assert (arrays["values"] == TRIAL.values).all()
        assert json.loads(arrays["meta"].tobytes())["key"] == "a"


def test_a_second_process_is_told_who_is_writing(tmp_path):
    with begun(tmp_path / "run"), pytest.raises(MachineError) as caught:
        RunFolder.resume(tmp_path / "run", SPEC)
    assert f"in use by process {os.getpid()} since" in str(caught.value)
    assert caught.value.code == "F8"
    RunFolder.resume(tmp_path / "run", SPEC).__exit__(None, None, None)  # free again


def test_a_new_run_never_touches_an_old_one(tmp_path):
    begun(tmp_path / "run").__exit__(None, None, None)
    with pytest.raises(InputError, match=r"exists already; choose another --out") as caught:
        RunFolder.create(tmp_path / "run")
    assert caught.value.code == "C40"


def test_overwrite_renames_the_old_run_and_keeps_every_older_one(tmp_path):
    for expected in ([], ["run.old-1"], ["run.old-1", "run.old-2"]):
        with RunFolder.create(tmp_path / "run", overwrite=True) as folder:
            folder.begin("x = 1\n", {"scenario_sha256": SPEC})
        assert sorted(p.name for p in tmp_path.iterdir()) == ["run", *expected]


def test_overwrite_refuses_a_folder_that_is_no_run(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="not a run folder and will not be renamed"):
        RunFolder.create(tmp_path, overwrite=True)


def test_overwrite_refuses_a_run_that_is_being_written(tmp_path):
    with begun(tmp_path / "run"):
        with pytest.raises(MachineError, match="in use by process"):
            RunFolder.create(tmp_path / "run", overwrite=True)
        with pytest.raises(MachineError, match="in use by process"):
            check_free(tmp_path / "run", layout.MANIFEST, overwrite=True)


@pytest.mark.parametrize("name", ["file", "file/run", "x" * 300, "nul\0"])
def test_an_output_that_cannot_be_made_is_refused_before_anything_is_computed(tmp_path, name):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError) as caught:
        RunFolder.create(tmp_path / name)
    assert caught.value.code == "C40"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]


def test_unicode_names_are_fine(tmp_path):
    with begun(tmp_path / "Prüfstand 机器人") as folder:
        folder.write_record("a", record_bytes("a", TRIAL, SPEC))
        assert folder.read_record("a", FakeTrial, SPEC).name == "ä"


def test_a_folder_that_died_before_it_began_is_used_again(tmp_path):
    (tmp_path / "run" / "trials").mkdir(parents=True)
    (tmp_path / "run" / ".scenario.toml.0a1b2c3d.tmp").write_text("half")
    acquire(tmp_path / "run").close()
    with RunFolder.resume(tmp_path / "run", SPEC) as folder:
        folder.begin("x = 1\n", {"scenario_sha256": SPEC})
    assert not list((tmp_path / "run").glob("*.tmp"))


def test_resume_refuses_another_scenario_version_or_format(tmp_path):
    path = tmp_path / "run"
    begun(path).__exit__(None, None, None)
    with pytest.raises(InputError, match="another scenario, seed or robot"):
        RunFolder.resume(path, "1" * 64)
    manifest = json.loads((path / layout.MANIFEST).read_bytes())
    manifest["versions"]["numpy"] = "1.0"
    (path / layout.MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=r"other versions: numpy 1\.0 there, .* here"):
        RunFolder.resume(path, SPEC)
    manifest["format"] = 2
    (path / layout.MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=r"has format 2; this version reads format 1; install a"):
        RunFolder.resume(path, SPEC)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"format": 1}', '{"format": 0}', '{"format": 1, "format": 1}']
)
def test_a_damaged_manifest_is_named(tmp_path, text):
    (tmp_path / layout.MANIFEST).write_text(text)
    with pytest.raises(InputError, match=r"manifest\.json: is damaged: .*give the command that "):
        read_manifest(tmp_path)
    (tmp_path / layout.SCENARIO).touch()  # that of a calibration has none to run
    with pytest.raises(InputError, match=r"; run .*scenario\.toml again with another --out\. "):
        read_manifest(tmp_path)


def test_a_manifest_names_the_versions_that_decide_the_numbers():
    versions = json.loads(manifest_bytes({}))["versions"]
    assert set(versions) == {"truebed", "numpy", "scipy", "mujoco"}
    assert versions["numpy"] == np.__version__


def test_writing_the_same_bytes_again_leaves_the_time_stamp(tmp_path):
    with begun(tmp_path / "run") as folder:
        folder.write("result.json", b"{}")
        path = folder.path / "result.json"
        os.utime(path, ns=(1, 1))
        folder.write("result.json", b"{}")
        assert path.stat().st_mtime_ns == 1
        folder.write("result.json", b"{1}")
        assert path.stat().st_mtime_ns != 1


def test_discard_removes_what_was_begun_but_never_a_record(tmp_path):
    with begun(tmp_path / "a") as folder:
        folder.discard()
    assert not (tmp_path / "a").exists()
    with begun(tmp_path / "b") as folder:
        folder.write_record("x", record_bytes("x", TRIAL, SPEC))
        folder.discard()
    assert (tmp_path / "b" / "trials" / "x.npz").is_file()
