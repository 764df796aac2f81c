"""The command: verbs, exit codes, quiet ends; nothing printed that a person cannot use."""

import fcntl
import json
import os
import re
import shlex
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.run import play as runner
from testbed.run import slices
from testbed.run.slices import SliceOutcome
from tests.fresh import python
from tests.testbed.studies.trial.fake_campaign import SCENARIO, Fake, content

ROOT = Path(__file__).parents[3]


def install(monkeypatch, fake, place=runner):
    """Let the command play a fake campaign."""
    monkeypatch.setattr(place, "all_studies", lambda _: (fake,))
    monkeypatch.setattr(place, "derived_file", fake.derive)


@pytest.fixture
def truebed(monkeypatch, tmp_path):
    """Call the command in an empty folder with the fake campaign."""
    monkeypatch.chdir(tmp_path)

    def call(*words, fake=Fake):
        install(monkeypatch, fake())
        return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)

    return call


@pytest.fixture
def scene(tmp_path):
    """A scenario file for the fake campaign."""
    from testbed.scenario.read import dump_scenario
    from testbed.studies import scenario_of

    file = tmp_path / "tiny.toml"
    file.write_text(dump_scenario(scenario_of(SCENARIO)), encoding="utf-8")
    return file


def test_run_writes_a_run_folder_and_says_what_to_type_next(truebed, scene):
    result = truebed("run", scene)
    assert result.exit_code == 0
    assert content(Path("runs/tiny-seed5"))
    assert result.stdout.startswith("SIMULATED - not a calibration certificate")
    assert "trial-a" in result.stdout
    assert result.stdout.rstrip().endswith("Next       truebed view runs/tiny-seed5")
    lines = result.stderr.splitlines()
    assert lines[0].startswith("[1/10] setting: ")
    assert lines[-1].startswith("done in ")
    assert len(lines) == 11


def test_what_to_type_next_can_be_typed_where_names_have_spaces(truebed, scene, tmp_path):
    spaced = tmp_path / "my scene's.toml"
    spaced.write_bytes(scene.read_bytes())
    result = truebed("run", spaced, "--out", "my runs/first one")
    assert result.exit_code == 0
    *_, last = result.stdout.rstrip().splitlines()
    assert shlex.split(last.removeprefix("Next")) == ["truebed", "view", "my runs/first one"]
    result = truebed("new", "scene", "staubli_tx60", "--out", "my scene.toml")
    *_, last = result.stdout.rstrip().splitlines()
    assert shlex.split(last.removeprefix("Next")) == ["truebed", "run", "my scene.toml"]


def test_quiet_says_nothing(truebed, scene):
    result = truebed("run", scene, "--quiet")
    assert (result.exit_code, result.output) == (0, "")


def test_json_prints_the_result_and_nothing_else(truebed, scene):
    result = truebed("run", scene, "--json")
    document = json.loads(result.stdout)
    assert document == json.loads(Path("runs/tiny-seed5/result.json").read_bytes())
    assert result.stderr == ""


def test_json_also_tells_errors(truebed, scene):
    result = truebed("run", "wen2202", "--json")
    error = json.loads(result.stdout)["error"]
    assert result.exit_code == 2
    assert error["code"] == "S37"
    assert 'did you mean "wen2022"?' in error["message"]


def test_an_existing_run_is_never_overwritten_in_silence(truebed, scene):
    assert truebed("run", scene).exit_code == 0
    again = truebed("run", scene)
    assert again.exit_code == 2
    assert again.stderr.splitlines()[-1].startswith("runs/tiny-seed5: exists already; choose")
    assert truebed("run", scene, "--resume").exit_code == 0
    assert truebed("run", scene, "--overwrite").exit_code == 0
    assert Path("runs/tiny-seed5.old-1/result.json").is_file()


def test_another_seed_gets_another_folder_and_other_numbers(truebed, scene):
    truebed("run", scene)
    truebed("run", scene, "--seed", 6)
    five, six = content(Path("runs/tiny-seed5")), content(Path("runs/tiny-seed6"))
    assert five["trials/trial-a.npz"] != six["trials/trial-a.npz"]


def test_a_run_of_a_run_s_own_scenario_gives_the_same_bytes(truebed, scene):
    truebed("run", scene, "--out", "a")
    truebed("run", "a/scenario.toml", "--out", "b")
    assert content(Path("a")) == content(Path("b"))
    result = truebed("compare", "a", "b")
    assert "Equal byte for byte: a, b" in result.stdout
    truebed("run", scene, "--out", "c", "--seed", 9)
    result = truebed("compare", "a", "c")
    assert "No two of these runs are equal." in result.stdout
    assert any(
        line.split()[:4] == ["c", "tiny", "9", "trial-a"] for line in result.stdout.splitlines()
    )
    document = json.loads(truebed("compare", "a", "b", "c", "--json").stdout)
    assert document["equal_bytes"] == [["a", "b"]]


def test_a_failed_trial_gives_exit_code_1_and_is_named(truebed, scene):
    result = truebed("run", scene, fake=lambda: Fake(failing=("trial-b",)))
    assert result.exit_code == 1
    assert "FAILED trial-b: trial-b did not work. [T0]" in result.stdout


@pytest.mark.parametrize("verb", ["report", "record"])
def test_report_and_record_write_their_files_again(truebed, scene, verb, monkeypatch):
    truebed("run", scene, "--out", "a")
    install(monkeypatch, Fake())
    expected = content(Path("a"))
    for name in ("report.html", "result.json", "arrays.npz", "campaign.rrd"):
        if (name == "campaign.rrd") == (verb == "record"):
            Path("a", name).unlink()
    assert truebed(verb, "a").exit_code == 0
    assert content(Path("a")) == expected


def test_without_a_browser_one_sentence_says_so_and_nothing_is_written(truebed, scene, monkeypatch):
    truebed("run", scene, "--out", "a")
    before = {path: path.stat().st_mtime_ns for path in Path("a").rglob("*")}
    from testbed.cli import handout

    monkeypatch.setattr(handout.shutil, "which", lambda _: None)
    result = truebed("report", "a", "--pdf")
    assert result.exit_code == 2
    assert "--pdf needs a browser to print with, and PATH has none of chromium" in result.stderr
    assert "open report.html in any browser and print it" in result.stderr
    assert {path: path.stat().st_mtime_ns for path in Path("a").rglob("*")} == before


@pytest.mark.parametrize("verb", ["report", "record", "view", "compare"])
def test_a_folder_that_is_no_run_is_refused(truebed, verb):
    result = truebed(verb, ".")
    assert result.exit_code == 2
    assert "is not a run folder" in result.stderr


def test_a_defect_of_ours_keeps_its_traceback_in_the_run_folder(truebed, scene):
    class Broken(Fake):
        def compute(self, *_):
            return {}["missing"]

    result = truebed("run", scene, fake=Broken)
    assert result.exit_code == 70
    assert "this is a defect of truebed: KeyError: 'missing'" in result.stderr
    assert "Traceback" not in result.stderr
    assert "KeyError" in Path("runs/tiny-seed5/crash.txt").read_text()
    result = truebed("run", scene, "--debug", "--overwrite", fake=Broken)
    assert "Traceback" in result.stderr


def test_a_slice_with_a_failed_piece_gives_exit_code_3(truebed, scene, monkeypatch):
    failed = {"many.000001 many.b": "no luck. [T1]"}
    for found, code in (({}, 0), (failed, 3)):
        monkeypatch.setattr(slices, "play_slice", lambda *_, f=found, **__: SliceOutcome(2, f))
        result = truebed("run", scene, "--slice", "1/2")
        assert result.exit_code == code
        assert ("FAILED many.000001 many.b: no luck. [T1]" in result.stdout) == bool(found)
        assert "of their own: truebed merge FOLDER FOLDER... --out DIR" in result.stdout


WRONG = [
    "--see 3", "run", "run quick --seed 1.5", "run quick --workers 0", "run a b",
    "run quick --slice 0/4", "run quick --slice 1/2", "merge one", "merge one --out two",
    "plan", "plan quick --seed 1.5", "plan quick --poses 3", "identify staubli_tx60",
    "identify staubli_tx60 points.csv", "identify staubli_tx60 points.csv --train x",
]  # fmt: skip


@pytest.mark.parametrize("words", WRONG)
def test_wrong_words_are_a_usage_error(truebed, words):
    result = truebed(*words.split())
    assert result.exit_code == 2
    assert "Traceback" not in result.output


def test_a_negative_seed_is_refused_with_its_range(truebed):
    result = truebed("run", "quick", "--seed", "-1")
    assert result.exit_code == 2
    assert result.stderr == "--seed: seed is -1; it must be 0 or larger; " \
                            "choose a value in range. [C41]\n"  # fmt: skip


def test_scenes_and_robots_list_what_ships_and_show_one(truebed):
    assert "wen2022" in truebed("scenes").stdout
    shown = truebed("scenes", "quick").stdout
    assert "gravity_mdeg = [0.0, 0.0, 0.0]" in shown
    assert "staubli_tx60" in truebed("robots").stdout
    one = truebed("robots", "staubli_tx60").stdout
    assert "alpha deg" in one
    assert "free set wen2022: theta1, d1" in one
    assert truebed("robots", "kuka").exit_code == 2


def test_doctor_finds_three_kinematics_that_agree(truebed):
    result = truebed("doctor")
    assert result.exit_code == 0
    assert "MDH = MuJoCo" in result.stdout
    assert "MDH = URDF" in result.stdout
    assert "All is well." in result.stdout


def test_doctor_notices_a_wrong_model(truebed, monkeypatch):
    from testbed.cli import doctor

    real = doctor.forward
    monkeypatch.setattr(doctor, "LIMIT", 0.0)
    result = truebed("doctor")
    assert real is doctor.forward
    assert result.exit_code == 1
    assert "BAD" in result.stdout


def test_every_verb_has_help_and_no_verb_is_a_stub(truebed):
    listed = truebed("--help").stdout
    for verb in (
        "run",
        "plan",
        "identify",
        "scenes",
        "robots",
        "compare",
        "report",
        "record",
        "view",
        "doctor",
    ):
        assert verb in listed
        assert truebed(verb, "--help").exit_code == 0
    # what a verb does is a whole sentence, also at 80 columns
    for text in (listed, truebed("new", "--help").stdout):
        said = text.partition("Commands:")[2].split("Start with")[0].strip().splitlines()
        assert all(line.rstrip(" |│").endswith(".") and ".." not in line for line in said), said


def test_version_is_the_project_s():
    import tomllib

    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert python("-m", "testbed", "--version").stdout == f"truebed {version}\n"


def test_a_closed_pipe_ends_quietly():
    command = f"{sys.executable} -m testbed scenes wen2022 | head -n 1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", command], cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")


def on_terminal(tmp_path, scene, columns):
    """What a terminal of some columns shows of the run of a fake campaign on its stderr."""
    import pty

    main, side = pty.openpty()
    fcntl.ioctl(side, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    environment = {**os.environ, "FAKE_PAUSE": "0.05", "TERM": "xterm"}
    environment.pop("COLUMNS", None)  # of the terminal that tests run on
    words = [sys.executable, "-m", "tests.testbed.cli.fake_command", "run", str(scene), "--out"]
    with subprocess.Popen(
        [*words, str(tmp_path / "run")], cwd=ROOT, env=environment, stderr=side,
        stdout=subprocess.DEVNULL,
    ) as child:  # fmt: skip
        os.close(side)
        seen = b""
        try:
            while part := os.read(main, 4096):
                seen += part
        except OSError:  # the other end is closed
            pass
        child.wait(timeout=60)
    os.close(main)
    assert child.returncode == 0
    return seen.decode()


def drawn(seen):
    """Lines of a terminal as they were before each was drawn anew, without what steers it."""
    return [re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", line) for line in re.split(r"[\r\n]+", seen)]


def test_a_terminal_gets_a_bar_with_the_time_left(tmp_path, scene):
    lines = drawn(on_terminal(tmp_path, scene, 100))
    assert any("━" in line and "/10" in line and "left" in line for line in lines)
    assert max(map(len, lines)) <= 100


def test_view_opens_the_recording_or_makes_a_picture_or_a_page(truebed, scene, monkeypatch):
    from testbed.cli import video, viewer
    from testbed.cli.output import warn

    truebed("run", scene, "--out", "a")
    called = []
    monkeypatch.setattr(viewer, "open_viewer", lambda *a: called.append(("open", a[0])))
    monkeypatch.setattr(viewer, "picture", lambda *a, **o: called.append(("picture", *a, o)))
    monkeypatch.setattr(viewer, "html_page", lambda *a: called.append(("html", *a)))
    monkeypatch.setattr(video, "film", lambda *a: called.append(("video", *a)))
    file = Path("a/campaign.rrd")
    assert truebed("view", "a").exit_code == 0
    truebed("view", "a", "--picture", "x.png", "--step", 7)
    truebed("view", file, "--html", "x.html")
    truebed("view", file, "--video", "x.gif")
    assert called == [
        ("open", file),
        ("picture", file, Path("x.png"), {"step": 7, "tell": warn}),
        ("html", file, Path("x.html")),
        ("video", file, Path("x.gif")),
    ]
