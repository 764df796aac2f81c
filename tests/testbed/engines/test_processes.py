"""Processes of this machine under faults: the same bytes, nothing lost, nothing hung, no orphan."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest

from testbed.engines.processes import Processes
from tests.fresh import python
from tests.testbed.engines.toy import ToyKit, expected, gone, play, toys

ROOT = Path(__file__).parents[3]
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
LEADER = """
import signal
import sys
from pathlib import Path
from testbed.engines.processes import Processes
from tests.testbed.engines.toy import ToyKit, play, toys
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    engine = Processes(2, play)
    try:
        for piece, data in engine.play(ToyKit(Path(sys.argv[1])), toys(6)):
            print(piece.name, flush=True)
    finally:
        engine.close()
"""


def pids(folder):
    return [int(text) for path in folder.glob("*.pid") if (text := path.read_text())]


@pytest.fixture(autouse=True)
def _no_main(monkeypatch):
    """A child loads the module that was started: here, pytest."""
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", None, raising=False)
    monkeypatch.setattr(sys.modules["__main__"], "__file__", None, raising=False)


# the pool's own thread counts its children while it loses one: Python 3.11 trips over that at
# times, after all futures of the broken pool are answered
@pytest.mark.filterwarnings(
    "ignore:Exception in thread:pytest.PytestUnhandledThreadExceptionWarning"
)
def test_faults_of_processes_change_no_byte_and_lose_no_piece(tmp_path):
    """A process killed twice, one piece that raises twice, one that always kills its process."""
    for fault in ("1.die once", "4.die once", "3.raise once", "2.die always"):
        (tmp_path / fault).touch()
    kit, pieces = ToyKit(tmp_path), toys(8)
    with closing(Processes(2, play)) as engine:
        found = {piece.name: data for piece, data in engine.play(kit, pieces)}
        more = dict(engine.play(kit, toys(1)))  # as good as new
    assert found.pop("2") == "3 processes died while they played 2"
    assert found == {k: v for k, v in expected(kit, pieces).items() if k != "2"}
    assert [*more.values()] == [*expected(kit, toys(1)).values()]
    assert gone(pids(tmp_path))


@pytest.mark.parametrize("at", [1, 0])
def test_a_child_that_cannot_be_begun_is_an_error_only_where_no_other_plays(at, monkeypatch):
    """A pool that breaks while it is handed a piece closes the pipes that a new child would get."""
    pool, calls = ThreadPoolExecutor(1), iter(range(9))

    def submitted(self, data, piece, left):
        if next(calls) == at:
            raise OSError("handle is closed")
        return pool.submit(piece.name.encode)

    monkeypatch.setattr(Processes, "_submitted", submitted)
    kit, pieces = SimpleNamespace(data=b""), toys(4)
    with closing(Processes(2, play)) as engine, pool:
        if at == 0:
            with pytest.raises(OSError, match="closed"):
                list(engine.play(kit, pieces))
            return
        found = [(piece.name, data) for piece, data in engine.play(kit, pieces)]
    assert sorted(found) == [(piece.name, piece.name.encode()) for piece in pieces]


def test_an_error_that_is_no_result_and_stays_is_raised(tmp_path):
    (tmp_path / "0.raise always").touch()
    with closing(Processes(1, play)) as engine, pytest.raises(ImportError, match="not there"):
        list(engine.play(ToyKit(tmp_path), toys(1)))
    assert gone(pids(tmp_path))


@pytest.mark.parametrize("name", ["SIGINT", "SIGKILL"])
def test_processes_end_with_the_one_that_began_them(tmp_path, name):
    """Interrupted, or killed without a word, while two pieces are being played."""
    script = tmp_path / "leader.py"
    script.write_text(LEADER)
    for k in (1, 2):
        (tmp_path / f"{k}.wait always").touch()
    leader = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)], start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    end = time.monotonic() + 60
    while len(pids(tmp_path)) < 3 and time.monotonic() < end:
        time.sleep(0.02)
    if name == "SIGINT":
        os.killpg(leader.pid, signal.SIGINT)  # as a terminal does
    else:
        leader.kill()
    leader.wait(30)
    assert len(pids(tmp_path)) == 3
    assert gone(pids(tmp_path))


def blocked(kit, piece):
    """Whether this process is deaf to Ctrl-C."""
    return str(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())).encode()


def test_ctrl_c_reaches_no_process_not_even_the_first_one(tmp_path):
    """In a process of its own: the first pool of all starts what tracks shared resources."""
    script = tmp_path / "first.py"
    script.write_text(
        "from pathlib import Path\n"
        "from testbed.engines.processes import Processes\n"
        "from tests.testbed.engines.test_processes import blocked\n"
        "from tests.testbed.engines.toy import ToyKit, toys\n"
        "if __name__ == '__main__':\n"
        "    engine = Processes(2, blocked)\n"
        "    print({data for _, data in engine.play(ToyKit(Path()), toys(6))})\n"
        "    engine.close()\n"
        "    print(blocked(None, None))\n"
    )
    assert python(script).stdout.split() == ["{b'True'}", "b'False'"]
