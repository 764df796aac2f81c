"""Folders that appear whole or not at all: kills, links, permissions, what others left there."""

import errno
import os
import signal
import stat
import sys
import time
from pathlib import Path

import pytest

from calib.errors import InputError, MachineError
from testbed import disk
from testbed.disk import atomic_write, beside, remove_leftovers
from testbed.store import layout
from testbed.store.run_folder import RunFolder
from testbed.store.whole_folder import check_free, whole_folder

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="links, umask and forks")
MARKER = layout.PLAN
NAMES = ("plan.csv", "robot/robot.toml", "robot/meshes/link.obj", "plan.rrd", MARKER)
KILLS = 10


def fill(out, pause=0.0):
    """A folder of a few files, like that of a plan; returns its bytes."""
    content = {name: name.encode() * 10**4 for name in NAMES}
    with whole_folder(out, MARKER) as folder:
        for name, data in content.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
            time.sleep(pause)
    return content


def read(out):
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in out.rglob("*")
        if path.is_file()
    }


def forked(work):
    """Pid of a child process that runs `work`."""
    pid = os.fork()
    if pid == 0:
        try:
            work()
        finally:
            os._exit(0)
    return pid


def killed(work, seconds):
    pid = forked(work)
    time.sleep(seconds)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


def test_killed_at_any_instant_it_is_whole_or_absent_and_the_next_one_leaves_nothing(tmp_path):
    expected, seen, start = fill(tmp_path / "whole"), set(), time.monotonic()
    os.waitpid(forked(lambda: fill(tmp_path / "slow", 0.004)), 0)
    whole = time.monotonic() - start  # of a machine that does other work too, longer
    for k in range(KILLS):
        room = tmp_path / f"{k}"
        room.mkdir()
        killed(lambda out=room / "out": fill(out, 0.004), 2 * whole * k / KILLS)
        there = (room / "out").exists()
        seen.add((there, len(list(room.iterdir()))))
        if not there:
            fill(room / "out")
        assert read(room / "out") == expected
        assert [path.name for path in room.iterdir()] == ["out"]
    assert len(seen) > 1  # the kills did fall into different stages


def test_what_is_still_being_written_is_left_alone(tmp_path):
    pid = forked(lambda: fill(tmp_path / "out", 10))
    while not [path for path in tmp_path.rglob("*") if path.is_file()]:
        time.sleep(0.01)
    (left,) = tmp_path.iterdir()
    check_free(tmp_path / "out", MARKER, overwrite=False)
    assert list(tmp_path.iterdir()) == [left]
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    check_free(tmp_path / "out", MARKER, overwrite=False)
    assert list(tmp_path.iterdir()) == []


def test_only_folders_of_its_own_kind_are_removed(tmp_path):
    elsewhere = tmp_path / "precious"
    elsewhere.mkdir()
    kept = {".other.0a1b2c3d.tmp", ".out.notes.tmp", ".out.1.0a1b2c3d.tmp", "out.0a1b2c3d.tmp"}
    for name in (*kept, ".out.0a1b2c3d.tmp"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "thesis.tex").write_text("years of work")
    (tmp_path / ".out.4e5f6a7b.tmp").write_text("a file")
    (tmp_path / ".out.8c9d0e1f.tmp").symlink_to(elsewhere)
    fill(tmp_path / "out")
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {*kept, "precious", "out", ".out.4e5f6a7b.tmp", ".out.8c9d0e1f.tmp"}
    assert all((tmp_path / name / "thesis.tex").read_text() for name in kept)


def test_in_a_run_folder_only_files_that_were_being_written_are_removed(tmp_path):
    names = {".notes.tmp", ".result.json.tmp", "result.json.0a1b2c3d.tmp"}
    for name in (*names, beside(Path("result.json")).name, ".result.json.ab_cd123.tmp"):
        (tmp_path / name).write_text("half")
    remove_leftovers(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == names


def plan_into(out):
    fill(out)


def run_into(out):
    with RunFolder.create(out) as folder:
        folder.write(MARKER, b"x")


@pytest.mark.parametrize("write", [plan_into, run_into])
@pytest.mark.parametrize("there", [True, False], ids=["empty folder", "nothing yet"])
def test_out_may_be_a_link_to_an_empty_folder(tmp_path, write, there):
    big, out = tmp_path / "disk" / "big", tmp_path / "here" / "out"
    big.parent.mkdir()
    out.parent.mkdir()
    if there:
        big.mkdir(mode=0o750)
    out.symlink_to(big)
    write(out)
    assert out.is_symlink()
    assert (big / MARKER).is_file()
    assert sorted(path.name for path in tmp_path.glob("*/*")) == ["big", "out"]
    assert not there or stat.S_IMODE(big.stat().st_mode) == 0o750


@pytest.mark.parametrize("write", [plan_into, run_into])
def test_out_may_be_the_folder_one_stands_in(tmp_path, monkeypatch, write):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    write(Path())
    assert (here / MARKER).is_file()


@pytest.mark.parametrize("write", [plan_into, run_into])
def test_a_link_to_itself_is_refused(tmp_path, write):
    (tmp_path / "out").symlink_to("out")
    with pytest.raises(InputError, match="Too many levels of symbolic links; choose another"):
        write(tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_name_with_no_room_for_the_temporary_one_is_refused_before_anything_is_computed(tmp_path):
    with pytest.raises(InputError, match="File name too long; choose another --out"):
        check_free(tmp_path / ("x" * 250), MARKER, overwrite=False)


@pytest.mark.parametrize("where", ["file", "nowhere", "itself"])
def test_a_lock_or_log_that_is_a_link_is_never_followed(tmp_path, where):
    precious = tmp_path / "precious"
    if where == "file":
        precious.write_text("years of work")
    out = tmp_path / "out"
    out.mkdir()
    (out / layout.LOCK).symlink_to(layout.LOCK if where == "itself" else precious)
    with pytest.raises(InputError, match=r"run\.lock there is a symbolic link; choose another"):
        RunFolder.create(out)
    (out / layout.LOCK).unlink()
    (out / layout.LOG).symlink_to(layout.LOG if where == "itself" else precious)
    with RunFolder.create(out) as folder:
        folder.log(b"one line\n")
    assert precious.exists() == (where == "file")
    assert where != "file" or precious.read_text() == "years of work"


def test_a_pipe_in_the_place_of_the_log_does_not_stop_a_run(tmp_path):
    with RunFolder.create(tmp_path / "out") as folder:
        os.mkfifo(folder.path / layout.LOG)
        folder.log(b"one line\n")
    (tmp_path / "out" / layout.LOCK).unlink()
    os.mkfifo(tmp_path / "out" / layout.LOCK)
    with pytest.raises(InputError, match="cannot be written"):
        RunFolder.create(tmp_path / "out")


@pytest.mark.parametrize("mask", [0o077, 0o022, 0o000, 0o007])
def test_the_umask_decides_who_may_read(tmp_path, mask):
    before = os.umask(mask)
    try:
        fill(tmp_path / "plans" / "out")
        with RunFolder.create(tmp_path / "runs" / "out") as folder:
            folder.begin("x = 1\n", {"scenario_sha256": "0" * 64})
            folder.log(b"one line\n")
            folder.write_record("a", b"x")
            folder.write_piece("a", b"x")
        atomic_write(tmp_path / "one", b"x")
    finally:
        os.umask(before)
    for path in tmp_path.rglob("*"):
        usual = 0o777 if path.is_dir() else 0o666
        assert stat.S_IMODE(path.stat().st_mode) == usual & ~mask, path


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENOMEM])
@pytest.mark.parametrize("write", [plan_into, run_into])
def test_a_machine_that_has_run_out_is_no_fault_of_the_input(tmp_path, monkeypatch, number, write):
    def fails(*_, **__):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(type(tmp_path), "mkdir", fails)
    with pytest.raises(MachineError) as caught:
        write(tmp_path / "out")
    assert caught.value.code == ("F3" if number in disk.FULL else "F10")
    assert list(tmp_path.iterdir()) == []


def test_without_locks_folders_are_written_and_nothing_is_removed(tmp_path, monkeypatch):
    """As on a network drive that has no locks, and on Windows."""
    monkeypatch.setattr(disk, "_lock_folder", lambda _: None)
    (tmp_path / ".out.0a1b2c3d.tmp").mkdir()
    fill(tmp_path / "out")
    assert {path.name for path in tmp_path.iterdir()} == {"out", ".out.0a1b2c3d.tmp"}


def test_what_is_refused_or_fails_leaves_no_folder_above_either(tmp_path):
    (tmp_path / "runs").mkdir()
    for above in (tmp_path / "runs", tmp_path / "new" / "deep"):
        check_free(above / "out", MARKER, overwrite=False)
        with pytest.raises(InputError), whole_folder(above / "out", MARKER):
            raise InputError("it is refused", code="M35")
        with pytest.raises(InputError, match="cannot be written"):
            check_free(above / ("o" * 300), MARKER, overwrite=False)
    assert list(tmp_path.rglob("*")) == [tmp_path / "runs"]
    content = fill(tmp_path / "new" / "deep" / "out")
    assert read(tmp_path / "new" / "deep" / "out") == content
