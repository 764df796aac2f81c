"""Whole studies by the command, every engine and after every fault the same bytes: `-m study`."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from testbed.engines.kit import Kit, play_piece
from testbed.engines.piece import played
from testbed.robots.catalog import load_robot
from testbed.run.cut import all_pieces, cut_names
from testbed.run.work import Work
from testbed.scenario.read import changed
from testbed.store import layout
from testbed.studies import all_studies, load_scenario
from testbed.toml_text import toml_lines
from tests.golden.write import FEWER
from tests.testbed.engines.test_cluster import Dask
from tests.testbed.engines.toy import family, gone
from tests.testbed.studies.test_register import SMALL

pytestmark = [
    pytest.mark.study,
    pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX"),
    pytest.mark.filterwarnings("ignore"),
]
ROOT = Path(__file__).parents[3]
ROBOTS = 40
PAUSE = "TOY_PAUSE"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a scene of toys, and the toys as a distribution that is installed."""
    found = tmp_path_factory.mktemp("toys")
    info = found / "packages" / "toy-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[truebed.studies]\ntoy = tests.toy_study:STUDY\n")
    toys = {"toy": {"robots": ROBOTS, "shots": 6}}
    lines = toml_lines(SMALL | {"trial": SMALL["trial"]} | toys)
    (found / "toys.toml").write_text("\n".join(lines) + "\n")
    return found


def start(place, *words, verb="run", pause=0.0):
    return subprocess.Popen(
        [sys.executable, "-m", "testbed", verb, *map(str, words), "--quiet"],
        cwd=place, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        env=environment(place) | {PAUSE: str(pause)}, text=True,
    )  # fmt: skip


def environment(place):
    paths = os.pathsep.join((str(ROOT), str(place / "packages")))
    return {**os.environ, "PYTHONPATH": paths}


def ended(process, code=0, seconds=120):
    told = process.communicate(timeout=seconds)[1]
    assert process.returncode == code, told
    return told


def content(folder):
    """Bytes of all that must not depend on who played what."""
    never = (".rrd", ".jsonl", ".lock", "timing.json")
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.endswith(never)
    }


@pytest.fixture(scope="module")
def whole(place):
    ended(start(place, "toys.toml", "--out", "whole"))
    found = content(place / "whole")
    assert len([name for name in found if name.startswith(layout.PARTS)]) == ROBOTS / 2
    return found


@pytest.fixture(scope="module")
def dask(place):
    found = Dask(place, path=environment(place)["PYTHONPATH"])
    for _ in range(2):
        found.worker("--nanny")
    yield found.ready()
    found.stop()


def until(folder, pieces, process):
    while len(list((folder / layout.PARTS).glob("toy.*"))) < pieces:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.02)


def test_two_processes_give_the_bytes_of_one(place, whole):
    ended(start(place, "toys.toml", "--out", "two", "--workers", 2))
    assert content(place / "two") == whole


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGKILL", -9)])
def test_a_run_of_two_processes_that_is_stopped_leaves_none_and_goes_on(place, whole, name, code):
    """Ctrl-C reaches the whole group, the others the run alone."""
    out = place / f"stopped-{name}"
    words = ("toys.toml", "--out", out, "--workers", 2)
    process = start(place, *words, pause=0.2)
    until(out, 3, process)
    processes = family(process.pid)
    assert len(processes) >= 3
    number = getattr(signal, name)
    (os.killpg if name == "SIGINT" else os.kill)(process.pid, number)
    told = ended(process, code, 30)
    assert ("--workers 2 --resume" in told) == (name != "SIGKILL")
    assert gone(processes)
    assert not (out / layout.RESULT).exists()
    ended(start(place, *words, "--resume"))
    assert content(out) == whole


def test_a_worker_that_is_killed_again_and_again_changes_nothing(place, whole):
    out = place / "killed"
    process = start(place, "toys.toml", "--out", out, "--workers", 2, pause=0.1)
    for pieces in (2, 6, 10):
        until(out, pieces, process)
        mine = [pid for pid in family(process.pid)[1:] if "spawn_main" in command(pid)]
        if mine:
            os.kill(mine[0], signal.SIGKILL)
    ended(process)
    assert content(out) == whole


def command(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


@pytest.mark.parametrize("count", [1, 2, 3])
def test_slices_at_the_same_time_with_one_killed_then_resumed(place, whole, count):
    out = place / f"slices-{count}"
    crew = [
        start(place, "toys.toml", "--out", out, "--slice", f"{k}/{count}", pause=0.1)
        for k in range(1, count + 1)
    ]
    if count == 3:
        until(out, 4, crew[1])
        crew[1].kill()
    assert [one.wait(120) for one in crew] == ([0, -9, 0] if count == 3 else [0] * count)
    for one in crew:
        one.stderr.close()
    ended(start(place, "toys.toml", "--out", out, "--resume"))
    assert content(out) == whole


def test_slices_on_machines_without_a_common_disk_are_merged(place, whole):
    for k in (2, 1):
        ended(start(place, "toys.toml", "--out", f"machine-{k}", "--slice", f"{k}/2"))
    ended(start(place, "machine-1", "machine-2", "--out", "merged", verb="merge"))
    assert content(place / "merged") == whole


def test_a_cluster_gives_the_same_bytes(place, whole, dask):
    ended(start(place, "toys.toml", "--out", "dask", "--scheduler", f"file:{dask.file}"))
    assert content(place / "dask") == whole


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGKILL", -9)])
def test_a_run_on_a_cluster_that_is_stopped_leaves_nothing_and_goes_on(
    place, whole, dask, name, code
):
    """Ctrl-C, a polite end and a sudden one of the client; its workers serve the next run."""
    out = place / f"dask-{name}"
    words = ("toys.toml", "--out", out, "--scheduler", f"file:{dask.file}")
    process = start(place, *words)
    until(out, 3, process)
    processes = family(process.pid)
    process.send_signal(getattr(signal, name))
    told = ended(process, code, 30)
    assert ("--resume" in told) == (name != "SIGKILL")
    assert gone(processes)
    assert not (out / layout.RESULT).exists()
    ended(start(place, *words, "--resume"))
    assert content(out) == whole


def test_a_worker_of_a_cluster_that_is_killed_changes_nothing(place, whole, dask):
    out = place / "dask-worker"
    process = start(place, "toys.toml", "--out", out, "--scheduler", f"file:{dask.file}")
    until(out, 2, process)
    os.kill(family(dask.workers[0].pid)[-1], signal.SIGKILL)  # its nanny begins another one
    ended(process)
    assert content(out) == whole


def test_a_cluster_whose_scheduler_dies_ends_the_run_with_3_and_another_one_goes_on(place, whole):
    first = Dask(place / "packages", path=environment(place)["PYTHONPATH"])
    first.ready().worker()
    out = place / "lost"
    process = start(place, "toys.toml", "--out", out, "--scheduler", f"file:{first.file}")
    until(out, 1, process)
    first.scheduler.kill()
    told = ended(process, 3)
    assert "is gone; start it again, then go on with --resume. [F12]" in told
    first.stop()
    ended(start(place, "toys.toml", "--out", out, "--resume"))
    assert content(out) == whole


@pytest.mark.parametrize("scene", ["coverage", "compensate", "wen2022_reexamined", "wen2022"])
def test_pieces_of_every_shipped_study_are_the_same_from_a_kit(scene):
    """In the process itself: what travels is all that a piece needs."""
    fewer = {"uncertainty.replications": 0, "studies.random_sets": 3, "pool.size": 100}
    scenario = changed(load_scenario(scene), FEWER.get(scene, {}) | fewer)
    robot = load_robot(scenario.robot)
    work = Work(scenario, robot, all_studies(scenario), lambda *_: b"")
    assert cut_names(work.planned)
    for name in cut_names(work.planned):
        piece = all_pieces(work.planned, name, robot)[0]
        study, record = work.planned[piece.task.keys[0]]
        for key in record.needs:
            work._ensure(key)
        needed = work._kit(study, record).needed
        kit = Kit(scenario, robot, study, needed)
        assert play_piece(kit.data, piece) == played(study, scenario, piece, needed)
