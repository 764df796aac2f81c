"""Kills and full disks under the three verbs that write, played whole: `-m study`.

What their folders do is tried in every run of the tests on folders of a few milliseconds
(`test_faults.py` of the run, `test_whole_folder.py` of the store).
"""

import os
import resource
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.errors import MachineError
from testbed.identify.calibrate import Options
from testbed.identify.folder import play_calibration
from testbed.plan.folder import play_plan
from testbed.run.play import play_run
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from tests import planned
from tests.calibrated import robot, sound_session
from tests.recorded import SMALL

pytestmark = [
    pytest.mark.study,
    pytest.mark.skipif(sys.platform == "win32", reason="forks and limits of POSIX"),
]
KILLS = int(os.environ.get("KILLS", "200"))
"""At random instants of each verb; fewer where the environment says so."""
TRIALS: list[dict[str, Any]] = [{"name": "a", "poses": 12, "method": "random"}]
PROGRAM = "name,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\na,10,20,30,40,50,60\n"


def run(out):
    scene = changed(
        load_scenario("quick"), SMALL | {"uncertainty.replications": 0, "trial": TRIALS}
    )
    play_run(scene, out, resume=True)


def plan(out):
    play_plan(planned.scenario(planned.QUICK), out)


def identify(out):
    program = out.parent.parent / "jobs.csv"
    program.write_text(PROGRAM)
    play_calibration(robot(), sound_session(), out, Options(seed=1), program=program)


VERBS = {"run": run, "plan": plan, "identify": identify}


@dataclass(frozen=True, slots=True)
class Ended:
    """How a child ended: exit code, or minus the signal, and its wall time [s]."""

    code: int
    seconds: float


def child(work, *, kill_after=None, largest=None):
    """Do something in a forked child, killed after some seconds or with a limit on files [B]."""
    start = time.perf_counter()
    pid = os.fork()
    if pid == 0:
        code = 70
        try:
            if largest is not None:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (largest, resource.RLIM_INFINITY))
            work()
            code = 0
        except MachineError as error:
            code = 3 if error.code == "F3" and "File too large" in str(error) else 4
        finally:
            os._exit(code)
    if kill_after is not None:
        time.sleep(kill_after)
        os.kill(pid, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return Ended(code, time.perf_counter() - start)


NEVER_THE_SAME = (".rrd", ".jsonl", ".lock", "timing.json")


def content(out):
    """Bytes of all files; of those that are never the same, that they are there."""
    return {
        path.relative_to(out).as_posix(): None
        if path.name.endswith(NEVER_THE_SAME)
        else path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file()
    }


def leftovers(room):
    return [path for path in room.rglob("*") if path.name.endswith(".tmp")]


@pytest.fixture(scope="module", params=VERBS)
def played(request, tmp_path_factory):
    """A verb, its room, what it writes when nobody disturbs it, and how long that takes [s]."""
    room = tmp_path_factory.mktemp(request.param)
    (room / "whole").mkdir()
    work = VERBS[request.param]
    ended = child(lambda: work(room / "whole" / "out"))
    assert ended.code == 0
    return work, room, content(room / "whole" / "out"), ended.seconds


def test_killed_at_any_instant_the_next_start_ends_with_the_same_bytes(played):
    work, room, expected, seconds = played
    rng = np.random.default_rng(3)
    stages = set()
    for k in range(KILLS):
        here = room / f"kill{k}"
        here.mkdir()
        out: Path = here / "out"
        ended = child(lambda out=out: work(out), kill_after=rng.uniform(0, 1.1 * seconds))
        stages.add((out.exists(), len(content(here))))
        times = {path.name: path.stat().st_mtime_ns for path in out.glob("trials/*.npz")}
        if work is run or not out.exists():
            assert child(lambda out=out: work(out)).code == 0
        assert content(out) == expected, ended
        assert leftovers(here) == []
        assert [path.name for path in here.iterdir()] == ["out"]
        again = {path.name: path.stat().st_mtime_ns for path in out.glob("trials/*.npz")}
        assert times.items() <= again.items()
    assert len(stages) > 1


def test_a_disk_full_at_every_file_is_exit_3_and_the_next_start_ends_with_the_same_bytes(played):
    work, room, expected, _ = played
    whole = room / "whole" / "out"
    sizes = sorted({(whole / name).stat().st_size for name in expected})
    codes = []
    for k, size in enumerate(sizes):
        here = room / f"full{k}"
        here.mkdir()
        ended = child(lambda out=here / "out": work(out), largest=size - 1)
        codes.append(ended.code)
        assert leftovers(here) == []
        if ended.code == 3 and work is not run:
            assert list(here.iterdir()) == []
        if ended.code == 3:
            assert child(lambda out=here / "out": work(out)).code == 0
        assert content(here / "out") == expected
    # a full log stops nothing, nor does the lock's own line
    assert set(codes) <= {0, 3}
    assert codes.count(3) >= 0.7 * len(sizes)
