"""A cluster of dask under faults: the same bytes, nothing lost, nothing hung."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from contextlib import closing, suppress
from pathlib import Path

import pytest

from calib.errors import InputError, MachineError
from testbed.engines import cluster
from testbed.engines.choice import engine_of
from testbed.engines.cluster import Cluster
from tests.testbed.engines.toy import ToyKit, expected, family, gone, play, toys

pytest.importorskip("distributed", reason="a cluster needs pip install 'truebed[cluster]'")
ROOT = Path(__file__).parents[3]
HERE = ("--host", "127.0.0.1", "--no-dashboard")

CLIENT = """
import sys
from pathlib import Path
from testbed.engines.cluster import Cluster
from tests.testbed.engines.toy import ToyKit, play, toys
engine = Cluster("file:" + sys.argv[1], play)
for piece, data in engine.play(ToyKit(Path(sys.argv[2])), toys(6)):
    print(piece.name, flush=True)
"""


ELSEWHERE = """
def play(kit, piece):
    return b"played"
"""


class Dask:
    """A scheduler of this machine and its workers, each a process."""

    def __init__(self, folder, path=ROOT):
        self.folder, self.file = folder, folder / "scheduler.json"
        self.path, self.workers = path, []
        self.scheduler = self.start("scheduler", "--port", "0", "--scheduler-file", self.file)

    def start(self, what, *words, more=()):
        path = os.pathsep.join(map(str, (self.path, *more)))
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{what}", *HERE, *map(str, words)],
            env={**os.environ, "PYTHONPATH": path}, cwd=self.folder,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def worker(self, *words, more=()):
        """With further folders of modules that the scheduler does not have."""
        own = ("--scheduler-file", self.file, "--nthreads", 1, "--death-timeout", 60)
        self.workers.append(self.start("worker", *own, *(words or ("--no-nanny",)), more=more))

    def ready(self):
        while not self.file.exists():
            assert self.scheduler.poll() is None
            time.sleep(0.02)
        return self

    def stop(self):
        ones = (*self.workers, self.scheduler)
        processes = [pid for one in ones for pid in family(one.pid)]
        for pid in processes:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        for one in ones:
            one.wait(20)
        assert gone(processes)


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    found = Dask(tmp_path_factory.mktemp("dask"))
    modules = found.folder / "modules"
    modules.mkdir()
    (modules / "not_at_the_scheduler.py").write_text(ELSEWHERE)
    for _ in range(2):
        found.worker(more=[modules])
    yield found.ready()
    found.stop()


def of(dask, call=play):
    return closing(Cluster(f"file:{dask.file}", call))


def has(module):
    """Whether this process could load a module."""
    return importlib.util.find_spec(module) is not None


def play_all(engine, kit, count):
    return {piece.name: data for piece, data in engine.play(kit, toys(count))}


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_without_the_program_is_named_though_its_workers_have_it(dask, monkeypatch):
    name, kit = "not_at_the_scheduler", ToyKit(dask.folder)
    monkeypatch.syspath_prepend(str(dask.folder / "modules"))
    with of(dask, importlib.import_module(name).play) as engine:
        engine._client.wait_for_workers(2, timeout=60)
        assert list(engine._client.run(has, name).values()) == [True, True]
        assert not engine._client.run_on_scheduler(has, name)
        with pytest.raises(InputError, match="in this version, with the scheduler and all workers"):
            play_all(engine, kit, 2)
    with of(dask) as engine:
        assert play_all(engine, kit, 2) == expected(kit, toys(2))


@pytest.mark.filterwarnings("ignore")
def test_two_clients_at_once_do_not_hinder_each_other(dask, tmp_path):
    """The same pieces by the same names, of one kit and of another."""
    kits = [ToyKit(tmp_path / name) for name in "aab"]
    for kit in kits:
        kit.folder.mkdir(exist_ok=True)
    clients = [Cluster(f"file:{dask.file}", play) for _ in kits]
    try:
        found = [one.play(kit, toys(6)) for one, kit in zip(clients, kits, strict=True)]
        rounds = list(zip(*found, strict=True))  # a piece of each in turn
        for k, kit in enumerate(kits):
            assert {each[k][0].name: each[k][1] for each in rounds} == expected(kit, toys(6))
    finally:
        for one in clients:
            one.close()


@pytest.mark.filterwarnings("ignore")
def test_faults_of_a_cluster_change_no_byte_and_a_lost_scheduler_is_said(
    dask, tmp_path, monkeypatch
):
    """No program there, errors, a client that goes, a worker that dies, at last the scheduler."""
    kit, more = ToyKit(tmp_path / "a"), ToyKit(tmp_path / "b")
    for one in (kit, more):
        one.folder.mkdir()
    (kit.folder / "1.raise once").touch()
    (kit.folder / "5.die once").touch()
    (more.folder / "0.raise always").touch()
    with of(dask) as engine:
        next(engine.play(kit, toys(3)))  # nobody waits for the other two
    (tmp_path / "only_here.py").write_text("def play(kit, piece):\n    return b'x'\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    call = importlib.import_module("only_here").play
    with of(dask, call) as engine, pytest.raises(InputError, match="cannot load truebed, or has"):
        play_all(engine, kit, 2)
    with of(dask) as engine:
        assert play_all(engine, kit, 8) == expected(kit, toys(8))
        with pytest.raises(
            InputError, match="cannot load truebed, or has a worker that cannot: a library"
        ):
            play_all(engine, more, 1)
        (kit.folder / "3.wait always").touch()
        found = engine.play(kit, toys(4))
        assert {next(found)[0].name for _ in range(3)} == {"0", "1", "2"}
        monkeypatch.setattr(engine._client, "_timeout", 2.0)  # ANSWER elsewhere
        dask.scheduler.kill()
        (kit.folder / "3.wait always").unlink()
        start = time.monotonic()
        with pytest.raises(MachineError, match="is gone; start it again, then go on with --resume"):
            next(found)
        assert time.monotonic() - start < 6 * cluster.ANSWER  # it does not wait for ever


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_does_not_answer_or_has_no_workers_is_told_in_a_sentence(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(cluster, "ANSWER", 0.3)
    with pytest.raises(InputError) as caught:
        engine_of(1, "tcp://127.0.0.1:1")
    assert str(caught.value) == (
        "--scheduler is tcp://127.0.0.1:1, which does not answer; start one by `dask scheduler`, "
        "and give the address that it prints. [C42]"
    )
    with pytest.raises(InputError, match=r"none\.json, which is not there; start one by"):
        engine_of(1, f"file:{tmp_path}/none.json")


@pytest.mark.study
@pytest.mark.filterwarnings("ignore")
def test_what_only_a_whole_cluster_can_suffer(tmp_path, monkeypatch):
    """A piece that kills every worker, no worker at all, a client killed, and no program there."""
    kit = ToyKit(tmp_path / "kit")
    kit.folder.mkdir()
    (kit.folder / "2.die always").touch()
    found = Dask(tmp_path)
    try:
        none = "which has no workers; start some by `dask worker --scheduler-file "
        monkeypatch.setattr(cluster, "ANSWER", 2.0)
        with pytest.raises(InputError, match=none):
            Cluster(f"file:{found.ready().file}", play)
        monkeypatch.setattr(cluster, "ANSWER", 60.0)  # a busy machine starts them slowly
        for _ in range(2):
            found.worker("--nanny")
        with of(found) as engine:
            played = play_all(engine, kit, 8)
        assert played.pop("2") == "several workers died while they played 2"
        assert played == {k: v for k, v in expected(kit, toys(8)).items() if k != "2"}
        script = tmp_path / "client.py"
        script.write_text(CLIENT)
        (kit.folder / "2.die always").unlink()
        (kit.folder / "3.wait always").touch()
        client = subprocess.Popen(
            [sys.executable, str(script), str(found.file), str(kit.folder)],
            env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE,
        )  # fmt: skip
        assert client.stdout is not None
        assert len(client.stdout.readline()) > 0
        client.kill()
        client.wait(20)
        client.stdout.close()
        (kit.folder / "3.wait always").unlink()
        with of(found) as engine:
            assert play_all(engine, kit, 8) == expected(kit, toys(8))
    finally:
        found.stop()
