"""Faults F1 to F11: whatever happens to the process or the disk, finished work stays whole."""

import errno
import itertools
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from calib.errors import MachineError
from testbed import disk as atomic
from testbed.disk import atomic_write
from testbed.run.derive import derived_file
from testbed.run.play import play_run
from testbed.scenario.read import changed, dump_scenario
from testbed.store import layout
from testbed.studies import load_scenario
from tests.testbed.cli.fake_command import run_command
from tests.testbed.studies.trial.fake_campaign import Fake, content, scenario

ROOT = Path(__file__).parents[3]
needs_fork = pytest.mark.skipif(sys.platform == "win32", reason="kills forked children")


def forked(work):
    """Pid of a child process that runs `work` and ends with its exit code, or 1 if it raises."""
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            work()
            code = 0
        except SystemExit as end:
            code = end.code
        finally:
            os._exit(code)
    return pid


def ended(pid):
    """The exit code of a child, once it has ended."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def play(out, pause=0.0, **options):
    fake = Fake(pause)
    return play_run(scenario(), out, studies=(fake,), derive=fake.derive, **options)


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """Bytes of all files of a run that nothing interrupts."""
    out = tmp_path_factory.mktemp("whole")
    play(out)
    return content(out)


def times(folder):
    trials = folder / layout.TRIALS
    return {p.name: p.stat().st_mtime_ns for p in trials.glob("*.npz")} if trials.is_dir() else {}


@needs_fork
def test_f1_a_run_killed_at_any_instant_goes_on_to_the_same_bytes(tmp_path, expected):
    """In each stage once; every step of a write has its turn in F11."""
    records = sum(name.startswith("trials/") for name in expected)
    rng = np.random.default_rng(1)
    reached = set()
    for k in range(records + 2):
        out = tmp_path / f"{k}"
        pid = forked(lambda out=out: play(out, pause=0.012))
        # by what is finished, as a busy machine takes any time to it; then anywhere in a step
        over = 0
        while len(times(out)) < k % (records + 1) and not over:
            over, _ = os.waitpid(pid, os.WNOHANG)
            time.sleep(0.001)
        time.sleep(rng.uniform(0, 0.03))  # steps take 12 ms, the recording twice that
        if not over:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
        finished = times(out)
        reached.add(len(finished))
        play(out, resume=True)
        assert content(out) == expected
        assert finished.items() <= times(out).items()
        assert not [p for p in out.rglob("*") if p.name.endswith(layout.TEMPORARY)]
    assert len(reached) > 2  # the kills did fall into different stages


@needs_fork
def test_f3_a_full_disk_keeps_earlier_records_and_the_run_goes_on_later(tmp_path, expected):
    import resource

    out = tmp_path / "full"
    largest = len(expected["trials/setting.npz"])

    def limited():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest - 1, resource.RLIM_INFINITY))
        with pytest.raises(MachineError, match=r"setting\.npz cannot be written: File too large"):
            play(out)

    sizes = {name: len(data) for name, data in expected.items()}
    assert sizes["trials/setting.npz"] > largest - 1 > sizes["trials/trial-a.npz"]
    assert ended(forked(limited)) == 0
    assert list((out / layout.TRIALS).iterdir()) == []
    play(out, resume=True)
    assert content(out) == expected


@pytest.mark.parametrize("number", range(1, 15))
def test_f3_no_space_at_any_flush_leaves_old_or_new_files_only(
    tmp_path, monkeypatch, number, expected
):
    out, calls, real = tmp_path / "full", itertools.count(1), os.fsync

    def fsync(handle):
        if next(calls) == 2 * number:  # each write flushes the file, then its folder
            raise OSError(errno.ENOSPC, "No space left on device")
        real(handle)

    monkeypatch.setattr(atomic.os, "fsync", fsync)
    with pytest.raises(MachineError, match="No space left on device; free some space") as caught:
        play(out)
    assert caught.value.code == "F3"
    finished = times(out)
    monkeypatch.setattr(atomic.os, "fsync", real)
    play(out, resume=True)
    assert content(out) == expected
    assert finished.items() <= times(out).items()


def command(told, *words, pause=0.0, before=lambda: None):
    """Pid of a process that runs the command; what it says goes to the file `told`.

    The command starts in a copy of this process: a new one would load everything again.
    """

    def work():
        file = os.open(told, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(file, stream)
        sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
        before()
        run_command(words, Fake(pause))

    return forked(work)


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "tiny.toml"
    file.write_text(dump_scenario(scenario()), encoding="utf-8")
    return file


@needs_fork
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_f5_an_interrupted_run_prints_the_command_that_goes_on(
    tmp_path, scene, name, code, expected
):
    out, told = tmp_path / "a run", tmp_path / "told"
    child = command(told, "run", scene, "--out", out, pause=0.2)
    while not (out / layout.TRIALS / "trial-a.npz").exists():
        assert os.waitpid(child, os.WNOHANG) == (0, 0), told.read_text()
        time.sleep(0.01)
    os.kill(child, getattr(signal, name))
    assert ended(child) == code
    assert "Traceback" not in told.read_text()
    *_, note, line = told.read_text().splitlines()
    assert note == "stopped; what is finished is kept. To go on:"
    assert not list(out.rglob(f"*{layout.TEMPORARY}"))
    assert (out / layout.UNFINISHED).is_file()
    truebed, *words = shlex.split(line)
    assert truebed == "truebed"
    assert ended(command(told, *words)) == 0
    assert content(out) == expected


@needs_fork
def test_f3_the_command_says_exit_code_3_when_the_disk_is_full(tmp_path, scene):
    import resource

    def limited():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        # above the resolved scenario, below the first record, in bytes
        resource.setrlimit(resource.RLIMIT_FSIZE, (3072, resource.RLIM_INFINITY))

    told = tmp_path / "told"
    child = command(told, "run", scene, "--out", tmp_path / "x", before=limited)
    assert ended(child) == 3
    assert "setting.npz cannot be written: File too large; free some space" in told.read_text()


@needs_fork
def test_f6_a_run_killed_while_recording_has_no_recording_and_loses_nothing(tmp_path, expected):
    out = tmp_path / "killed"

    def slow_recording():
        class Slow(Fake):
            def derive(self, name, played):
                self.pause = 30 if name == layout.RECORDING else 0
                return super().derive(name, played)

        slow = Slow()
        play_run(scenario(), out, studies=(slow,), derive=slow.derive)

    pid = forked(slow_recording)
    while not (out / layout.REPORT).exists():
        assert os.waitpid(pid, os.WNOHANG) == (0, 0), "it ended by itself"
        time.sleep(0.01)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    assert not (out / layout.RECORDING).exists()
    finished = times(out)
    play(out, resume=True)
    assert content(out) == expected
    assert times(out) == finished
    assert not list(out.glob(f".*{layout.TEMPORARY}"))


def bare(words, out, *variables):
    """Run the command with an empty environment in a folder where nothing can be written."""
    # the kernel of the linear algebra decides last bits: where it is chosen, it stays chosen
    kernel = [f"{name}={os.environ[name]}" for name in os.environ if name.startswith("OPENBLAS")]
    place = "/proc" if Path("/proc/self").exists() else "/"
    return subprocess.run(
        [
            "env",
            "-i",
            *kernel,
            *variables,
            f"PYTHONPATH={ROOT}",
            sys.executable,
            "-m",
            *words,
            "--out",
            str(out),
        ],
        cwd=place,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_f7_no_home_no_display_no_writable_folder_and_a_clock_set_back(tmp_path, scene, expected):
    out = tmp_path / "bare"
    done = bare(["tests.testbed.cli.fake_command", "run", str(scene)], out)
    assert (done.returncode, content(out)) == (0, expected)
    (out / "trials" / "trial-b.npz").unlink()
    future = time.time() + 10**8
    for path in out.rglob("*"):
        os.utime(path, (future, future))
    play(out, resume=True)
    assert content(out) == expected


@pytest.mark.slow
def test_f7_a_real_run_needs_no_home_and_writes_nothing_outside_its_folder(tmp_path):
    before = {p for top in ("models", "scenes") for p in (ROOT / top).rglob("*")}
    changes = {
        "pool.size": 60,
        "test.poses": 10,
        "identification.estimators": ["whitened"],
        "uncertainty.repeats": 2,
        "uncertainty.replications": 2,
        "studies.random_sets": 0,
        "trial": [{"name": "one", "poses": 12, "method": "detmax"}],
    }
    scene = tmp_path / "few.toml"
    few = changed(load_scenario("quick"), changes)
    scene.write_text(dump_scenario(few), encoding="utf-8")
    done = bare(["testbed", "run", str(scene)], tmp_path / "run", "OMP_NUM_THREADS=2")
    assert (done.returncode, done.stderr.splitlines()[-1][:7]) == (0, "done in")
    assert {p for top in ("models", "scenes") for p in (ROOT / top).rglob("*")} == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["few.toml", "run"]

    def unrecorded(name, played):  # rows of a recording have random identifiers
        return b"" if name == layout.RECORDING else derived_file(name, played)

    play_run(few, tmp_path / "again", derive=unrecorded)
    one, other = content(tmp_path / "run"), content(tmp_path / "again")
    assert {name for name in one if one[name] != other[name]} == {layout.RECORDING}


@needs_fork
def test_f8_a_second_process_in_the_same_folder_is_told_the_first_one_s_pid(tmp_path, scene):
    out, told = tmp_path / "shared", tmp_path / "told"
    first = command(tmp_path / "first", "run", scene, "--out", out, pause=60)
    while not (out / layout.MANIFEST).exists():
        assert os.waitpid(first, os.WNOHANG) == (0, 0)
        time.sleep(0.01)
    for more in ([], ["--resume"], ["--overwrite"]):
        assert ended(command(told, "run", scene, "--out", out, *more)) == 3
        assert f"in use by process {first} since" in told.read_text()
    os.kill(first, signal.SIGKILL)
    assert ended(first) == -signal.SIGKILL
    # no stale lock
    assert ended(command(told, "run", scene, "--out", out, "--resume")) == 0


STEPS = [
    ("Path", "touch"),
    ("Path", "open"),
    ("os", "fsync"),
    ("Path", "replace"),
    ("os", "open"),
    ("Path", "unlink"),
]
"""Calls of an atomic write, in order."""


@needs_fork
@pytest.mark.parametrize(("module", "name"), STEPS)
@pytest.mark.parametrize("after", [False, True], ids=["before", "after"])
def test_f11_a_process_that_dies_at_any_step_of_a_write_leaves_old_or_new(
    tmp_path, module, name, after
):
    path = tmp_path / "result.json"
    atomic_write(path, b"old" * 10**5)

    def dying():
        owner = {"os": os, "Path": type(path)}[module]
        real = getattr(owner, name)

        def last(*args, **options):
            if after:
                real(*args, **options)
            os._exit(77)

        setattr(owner, name, last)
        atomic_write(path, b"new" * 10**5)

    assert ended(forked(dying)) == 77  # the step was reached
    seen = path.read_bytes()
    assert seen in (b"old" * 10**5, b"new" * 10**5)
    steps = [step for _, step in STEPS]
    replaced = steps.index(name) > steps.index("replace") or (name == "replace" and after)
    assert seen[:3] == (b"new" if replaced else b"old")
    atomic.remove_leftovers(tmp_path)
    assert list(tmp_path.iterdir()) == [path]
