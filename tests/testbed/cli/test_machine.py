"""Where the command runs: encodings, closed streams, signals, little memory, few open files."""

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import typer

from testbed.cli import output
from testbed.cli.exit_codes import exit_codes
from testbed.machine import lacking, ran_out
from testbed.scenario.read import dump_scenario
from tests.fresh import python
from tests.testbed.cli.fake_command import run_command
from tests.testbed.studies.trial.fake_campaign import Fake, scenario

ROOT = Path(__file__).parents[3]
FAKE = "tests.testbed.cli.fake_command"
posix = pytest.mark.skipif(sys.platform == "win32", reason="signals, limits and shells of POSIX")


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "prüfstand.toml"
    file.write_text(dump_scenario(scenario(title="Prüfstand — 3 µm")), encoding="utf-8")
    return file


@pytest.fixture
def truebed(monkeypatch, tmp_path):
    """Call the whole command with streams of an encoding; its exit code and what it printed."""
    from testbed import __main__ as entry
    from testbed.run import play as runner

    for name, value in entry.ENVIRONMENT.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    fake = Fake()
    monkeypatch.setattr(runner, "all_studies", lambda _: (fake,))
    monkeypatch.setattr(runner, "derived_file", fake.derive)

    def call(*words, encoding="utf-8"):
        streams = {name: io.BytesIO() for name in ("stdout", "stderr")}
        for name, raw in streams.items():
            monkeypatch.setattr(sys, name, io.TextIOWrapper(raw, encoding=encoding))
        monkeypatch.setattr(sys, "argv", ["truebed", *map(str, words)])
        with pytest.raises(SystemExit) as caught:
            entry.main()
        for name in streams:
            getattr(sys, name).flush()
        return caught.value.code, *(raw.getvalue().decode(encoding) for raw in streams.values())

    return call


def plan_stub(monkeypatch):
    """A plan that was made before."""
    from testbed.plan import folder
    from tests.planned import quick_plan

    monkeypatch.setattr(folder, "make_plan", lambda *_, **__: quick_plan())
    monkeypatch.setattr(folder, "plan_report_html", lambda *_, **__: "")
    monkeypatch.setattr(folder, "story_bytes", lambda _: b"")


def identify_stub(monkeypatch):
    """A calibration that was made before."""
    from testbed.files import read
    from testbed.identify import folder
    from testbed.identify.handback.delivered import Delivered
    from tests.calibrated import sound, sound_session

    found = (sound(), Delivered(("übergeben",), (), 0))
    monkeypatch.setattr(folder, "play_calibration", lambda *_, **__: found)
    monkeypatch.setattr(read, "read_session", lambda *_, **__: sound_session())


@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
def test_what_an_encoding_does_not_have_is_replaced(truebed, scene, encoding, monkeypatch):
    from testbed.cli import viewer

    plan_stub(monkeypatch)
    identify_stub(monkeypatch)
    monkeypatch.setattr(viewer, "open_viewer", lambda *_: None)
    for words in (
        ("run", scene, "--out", "ä"),
        ("compare", "ä", "ä"),
        ("report", "ä"),
        ("record", "ä"),
        ("view", "ä"),
        ("scenes",),
        ("scenes", scene),
        ("robots",),
        ("robots", "staubli_tx60"),
        ("plan", "plan_tx60", "--out", "ö"),
        ("identify", "staubli_tx60", "points.csv", "--out", "ü"),
        ("plan", "--help"),
    ):
        code, told, warned = truebed(*words, encoding=encoding)
        assert (code, "defect" in warned) == (0, False), words
        assert told or words[0] == "view"
    assert "?" in truebed("robots", encoding=encoding)[1]
    assert truebed("scenes", "zürich", encoding=encoding)[0] == 2


@pytest.mark.parametrize("encoding", ["cp1252", "ascii", "utf-8"])
def test_json_stays_json_in_every_encoding(truebed, scene, encoding):
    code, told, _ = truebed("run", scene, "--out", "ä", "--json", encoding=encoding)
    assert code == 0
    assert json.loads(told) == json.loads(Path("ä/result.json").read_bytes())
    told = truebed("compare", "ä", "ä", "--json", encoding=encoding)[1]
    assert list(json.loads(told)["runs"]) == ["ä"]
    told = truebed("compare", "机", "--json", encoding=encoding)[1]
    assert "机: does not exist" in json.loads(told)["error"]["message"]
    assert told.isascii() == (encoding != "utf-8")


def ended(work):
    """Exit code of a verb that does some work."""

    def verb():
        with exit_codes() as end:
            work(end)

    with pytest.raises(typer.Exit) as caught:
        verb()
    return caught.value.exit_code


def shell(line, **environment):
    return subprocess.run(
        ["bash", "-c", line], cwd=ROOT, env={**os.environ, **environment}, capture_output=True,
        check=False, timeout=120,
    )  # fmt: skip


@posix
def test_a_locale_without_utf_8_is_no_error():
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = shell(f"{sys.executable} -m testbed robots", **plain)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"St?ubli TX60" in done.stdout


@posix
@pytest.mark.parametrize(
    ("closed", "words", "code", "told"),
    [(">&-", "scenes", 0, b""), (">&-", "robots x", 2, b"the"), ("2>&-", "robots x", 2, b"")],
)
def test_a_closed_stream_changes_no_exit_code(closed, words, code, told):
    done = shell(f"{sys.executable} -m testbed {words} {closed}")
    assert (done.returncode, done.stdout, done.stderr[:3]) == (code, b"", told)


@posix
def test_no_file_takes_the_number_of_a_closed_stream(tmp_path, scene):
    out = tmp_path / "out"
    done = shell(f"{sys.executable} -m {FAKE} run '{scene}' --out {out} >&- 2>&- <&-")
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
    assert (out / "run.lock").read_bytes().startswith(b"process ")
    assert all(json.loads(line) for line in (out / "log.jsonl").read_bytes().splitlines())


def test_streams_that_are_none_are_opened_onto_nothing(monkeypatch):
    for name, _ in output.STREAMS:
        monkeypatch.setattr(sys, name, None)
    output.open_streams()
    output.say("nobody listens")
    output.warn("nobody listens")
    assert sys.stdin.read() == ""
    for name, _ in output.STREAMS:
        getattr(sys, name).close()


@posix
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_the_system_asks_to_end_and_asks_twice(capsys, name):
    number, unwound = getattr(signal, name), []
    before = signal.signal(number, signal.SIG_DFL)  # the tests themselves may run under nohup

    def work(_):
        try:
            os.kill(os.getpid(), number)
            time.sleep(5)
        finally:
            os.kill(os.getpid(), number)  # as a closing terminal does
            time.sleep(0.01)
            unwound.append(True)

    try:
        assert (ended(work), unwound) == (143, [True])
        assert capsys.readouterr().err == "stopped\n"
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, before)


@posix
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_what_was_inherited_as_ignored_stays_ignored(name):
    number = getattr(signal, name)
    before = signal.signal(number, signal.SIG_IGN)

    def work(_):
        os.kill(os.getpid(), number)
        time.sleep(0.01)

    try:
        assert ended(work) == 0
        assert signal.getsignal(number) == signal.SIG_IGN
    finally:
        signal.signal(number, before)


@posix
@pytest.mark.parametrize("ignored", [False, True], ids=["hang up", "nohup"])
def test_a_terminal_that_closes_ends_a_run_unless_it_was_told_to_go_on(tmp_path, scene, ignored):
    import pty

    out = tmp_path / "out"
    pid, main = pty.fork()
    if pid == 0:  # a copy of this process, which has loaded the command already
        code = 1
        try:
            os.environ.update(TERM="xterm", COLUMNS="100")
            signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)
            sys.stdin, sys.stdout, sys.stderr = (os.fdopen(k, "rww"[k]) for k in range(3))
            run_command(["run", scene, "--out", out], Fake(0.1))
        except SystemExit as end:
            code = end.code
        finally:
            os._exit(code)
    while not (out / "trials" / "trial-a.npz").exists():
        assert os.waitpid(pid, os.WNOHANG) == (0, 0), os.read(main, 10**4)
        time.sleep(0.01)
    os.close(main)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == (0 if ignored else 143)
    assert (out / "UNFINISHED.txt").exists() != ignored
    assert not (out / "crash.txt").exists()
    assert not list(out.rglob("*.tmp"))


MEMORY = "more memory is needed (4500 MB of address space) than the system allows"
FILES = "more files must be open (24 at once) than the system allows"
LIMITS = [
    ("ulimit -v 3000000", "run quick", MEMORY),
    ("ulimit -v 1000000", "plan plan_tx60", MEMORY),
    ("ulimit -n 14", "identify staubli_tx60 x.csv", FILES.replace("24", "16")),
    ("ulimit -n 25", "identify staubli_tx60 x.csv", FILES),
    ("ulimit -v 100000", "robots", MEMORY.replace("4500", "700")),
    ("ulimit -n 5", "robots", FILES.replace("24", "16")),
    ("ulimit -v 30000", "--version", MEMORY.replace("4500", "700")),
]


@posix
@pytest.mark.parametrize(("limit", "words", "told"), LIMITS)
def test_a_limit_is_told_before_anything_is_computed(tmp_path, limit, words, told):
    front = f"PYTHONPATH={ROOT} {sys.executable} -m testbed"
    done = shell(f"cd {tmp_path}; {limit}; {front} {words}")
    assert done.returncode == 3
    assert done.stderr.decode().startswith(f"{told}; ")
    assert done.stderr.decode().endswith(" [F10]\n")
    assert list(tmp_path.iterdir()) == []


SHORT = [MemoryError(), OSError(12, "no memory"), OSError(24, "too many"), OSError(23, "too many")]


@pytest.mark.parametrize("inside", [False, True], ids=["raised", "behind an error of ours"])
@pytest.mark.parametrize("short", SHORT, ids=str)
def test_what_has_run_out_is_never_called_a_defect_nor_a_bad_input(short, inside, capsys):
    from calib.errors import InputError

    def work(_):
        if not inside:
            raise short
        try:
            raise short
        except (OSError, MemoryError) as error:
            raise InputError("robot.toml cannot be read", code="S37") from error

    assert ended(work) == 3
    told = capsys.readouterr().err
    assert ("robot.toml cannot be read" in told) == inside
    assert inside or "[F10]" in told


def test_a_defect_report_follows_no_link(tmp_path, capsys):
    precious = tmp_path / "precious"
    precious.write_text("years of work")
    (tmp_path / "crash.txt").symlink_to(precious)

    def work(end):
        end.folder = tmp_path
        raise KeyError("ours")

    assert ended(work) == 70
    assert precious.read_text() == "years of work"
    assert "KeyError" in (tmp_path / "crash.txt").read_text()


@posix
@pytest.mark.parametrize("words", ["--version", "--help", "scenes"])
def test_a_full_disk_behind_stdout_is_told_by_every_door(words):
    done = shell(f"{sys.executable} -m testbed {words} > /dev/full")
    assert done.returncode == 3
    assert done.stderr.startswith(b"stdout: cannot be written: No space left on device")
    assert b"Traceback" not in done.stderr


def test_causes_that_lead_back_to_where_they_began_end():
    """An error that is raised again from what it led to."""
    first, second = ValueError("first"), OSError("second")
    first.__cause__, second.__context__ = second, first
    assert ran_out(first) is None
    second.__context__ = MemoryError()
    assert ran_out(first) is not None


@pytest.mark.parametrize("package", ["typer", "pydantic"])
def test_a_package_that_is_not_installed_is_named_in_one_sentence(package):
    gone = f"import sys; sys.modules['{package}'] = None; sys.argv[1:] = ['scenes']"
    ran = python("-c", f"{gone}; from testbed.__main__ import main; main()", check=False)
    assert ran.returncode == 3
    assert ran.stderr == (
        f"the package {package} is not installed; pip install truebed brings it; "
        "`import calib` does without. [F13]\n"
    )


def test_a_module_of_our_own_that_is_missing_is_our_defect():
    assert lacking(ModuleNotFoundError("no", name="testbed.attic")) is None
    assert lacking(ImportError("no")) is None
    broken = lacking(ImportError("libz.so.1: cannot open shared object file", name="lxml.etree"))
    assert str(broken).startswith("the package lxml cannot be loaded: libz.so.1: cannot open")
