"""What reaches the terminal: words of files are shown, and never steer it."""

import io
import json
import re
import sys
from dataclasses import replace
from functools import partial

import pytest

from calib.errors import STEERING, InputError
from testbed.__main__ import main
from testbed.cli import terminal
from testbed.cli.course import TimeLeft
from testbed.cli.exit_codes import exit_codes
from testbed.cli.output import say, say_json, warn
from testbed.cli.terminal import headline_rows, progress
from testbed.robots.catalog import load_robot
from testbed.robots.write.toml import robot_toml
from testbed.screen_reader import plain_if
from tests.command import call

WILD = "a\x1b[2J\x9b31m\x07\x7f\u202e\u2066\u2028b"
SHOWN = r"a\x1b[2J\x9b31m\x07\x7f\u202e\u2066\u2028b"
TITLED = "a\x9b31m\u202eb"
"""A title that steers a terminal."""


class Terminal(io.StringIO):
    """A stream that says it is one."""

    def isatty(self):
        return True


def truebed(*words):
    """What the command printed, its exit code first."""
    done = call(*words)
    for text in (done.stdout, done.stderr):
        assert not STEERING.search(text), text
    return done.exit_code, done.stdout, done.stderr


def test_both_streams_show_what_would_steer_a_terminal(capsys):
    say(f"one{WILD}\n\ttwo")
    warn(f"one{WILD}\n\ttwo")
    assert capsys.readouterr() == (f"one{SHOWN}\n\ttwo\n", f"one{SHOWN}\n\ttwo\n")


def test_json_stays_the_same_document(capsys):
    everything = "".join(map(chr, range(0x2100))) + "\udc9b😀"
    document = {everything: [everything, WILD]}
    for indent in (None, 1):
        say_json(json.dumps(document, ensure_ascii=False, indent=indent))
        told = capsys.readouterr().out
        assert json.loads(told) == document
        assert not STEERING.search(told)


def test_a_progress_bar_shows_names_as_they_are(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("COLUMNS", "200")
    with progress(quiet=False) as report:
        report(f"[red]{WILD}[/x]", 0, 2)
    told = sys.stderr.getvalue()
    assert f"[red]{SHOWN}[/x]" in told
    assert not set("\x9b\x07\x7f\u202e\u2066\u2028") & set(told)


def test_lines_of_progress_do_too(capsys):
    with progress(quiet=False) as report:
        report(WILD, 0, 2)
        report("", 2, 2)
    assert capsys.readouterr().err.startswith(f"[1/2] {SHOWN}: ")


def test_a_traceback_does_too(capsys):
    def fail():
        with exit_codes(debug=True):
            raise InputError(WILD, code="S37", where=WILD)

    with pytest.raises(Exception, match="2"):
        fail()
    told = capsys.readouterr().err
    assert told.startswith("Traceback")
    assert told.endswith(f"\n{SHOWN}: {SHOWN}. [S37]\n")
    assert not STEERING.search(told)


SCENARIO = 'format = 1\nname = "s"\nrobot = "staubli_tx60"\n'
FILES = {
    "key.toml": f'{SCENARIO}"\\u001b[2J\\nkey" = 1\n',
    "value.toml": f'{SCENARIO}title = "\\u001b[2J\\ntitle"\n',
    "robot.toml": SCENARIO.replace("staubli_tx60", "\\u001b[2J\\nrobot"),
    "comment.toml": f"{SCENARIO}x = \x1b[2J\n",
    "head.csv": "pose_id,q1_deg\x1b[2J\x9b\nP1,1\n",
    "cell.csv": "pose_id,q1_deg,x_mm,y_mm,z_mm\nP\x1b[2J\u202e1,1\x9b,1,1,1\n",
    "arm.urdf": '<robot name="a\x85\u202eb"><link name="l\x9b\u2028"/></robot>\n',
    "cut.urdf": '<robot name="a\u202e"><link\x9b\n',
}


@pytest.mark.parametrize("name", FILES)
def test_faults_of_a_file_are_told_in_lines_that_only_show_them(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / f"\x1b[2J\u202e{name}"
    file.write_text(FILES[name], encoding="utf-8")
    words = (
        ("run", file)
        if name.endswith("toml")
        else ("identify", "staubli_tx60", file, "--out", tmp_path / "out")
    )
    words = ("robots", file) if name.endswith("urdf") else words
    code, told, warned = truebed(*words)
    assert (code, told) == (2, "")
    assert all(line.endswith("]") for line in warned.splitlines())
    assert r"\x1b[2J\u202e" + name in warned
    assert list(tmp_path.iterdir()) == [file]


def test_a_title_that_steers_is_refused_and_where_a_robot_lies_is_only_shown(tmp_path):
    folder = tmp_path / "a\x1b[2Jm"
    folder.mkdir()
    robot = replace(load_robot("staubli_tx60"), visuals=())
    text = robot_toml(robot).replace(f'"{robot.title}"', f'"{TITLED}"')
    assert TITLED in text
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    code, told, warned = truebed("robots", folder / "robot.toml")
    assert (code, told) == (2, "")
    assert r"a\x1b[2Jm/robot.toml" in warned
    assert "title" in warned
    assert not STEERING.search(warned)
    code, _, warned = truebed("compare", folder, folder)
    assert code == 2
    assert r"a\x1b[2Jm: is the folder of a robot" in warned


@pytest.mark.parametrize("words", [[f"--{WILD}"], [WILD], ["run", "quick", f"--{WILD}"]])
def test_words_of_the_command_line_are_only_shown(words, monkeypatch, capsys):
    monkeypatch.setattr("testbed.__main__.ENVIRONMENT", {})
    monkeypatch.setattr(sys, "argv", ["truebed", *words])
    with pytest.raises(SystemExit) as end:
        main()
    out, err = capsys.readouterr()
    assert (end.value.code, out) == (2, "")
    assert SHOWN in err
    assert err.startswith("Usage: truebed")
    assert not STEERING.search(err)


@pytest.mark.parametrize(("words", "code"), [(["--version"], 0), (["robots", "none"], 2)])
def test_the_command_ends_with_the_code_of_its_verb(words, code, monkeypatch, capsys):
    monkeypatch.setattr("testbed.__main__.ENVIRONMENT", {})
    monkeypatch.setattr(sys, "argv", ["truebed", *words])
    with pytest.raises(SystemExit) as end:
        main()
    assert (end.value.code or 0) == code
    assert "".join(capsys.readouterr())


def test_a_step_of_many_pieces_says_now_and_then_how_long_it_will_take(capsys, monkeypatch):
    """Pieces of 7 s each: a line a minute, with the time that the rest will take."""
    now = [0.0]
    monkeypatch.setattr(terminal, "TimeLeft", partial(TimeLeft, clock=lambda: now[0]))
    with progress(quiet=False) as report:
        for done, name in enumerate(["setting", *["coverage"] * 61, "result.json", ""]):
            report(name, done, 64)
            now[0] += 7.0
    told = capsys.readouterr().err.splitlines()
    assert told[0] == "[1/64] setting: 7.0 s"
    assert told[1] == "[10/64] coverage: about 6.3 min left in all"
    assert told[-4:-2] == [
        "[55/64] coverage: about 63 s left in all",
        "[2-62/64] coverage: 427.0 s",
    ]
    assert len(told) == 1 + 6 + 3


def test_lines_of_progress_leave_no_step_out_and_claim_none_that_was_kept(capsys):
    """Two pieces, then one; the two steps between them were there from an earlier run."""
    with progress(quiet=False) as report:
        for name, done in (("a", 0), ("cut", 1), ("cut", 2), ("b", 3), ("c", 6), ("", 7)):
            report(name, done, 7)
    places = [line.split()[0] for line in capsys.readouterr().err.splitlines()[:-1]]
    assert places == ["[1/7]", "[2-3/7]", "[4/7]", "[7/7]"]


def told(columns, monkeypatch, term="xterm"):
    """What the bar of a work draws on a terminal, line by line."""
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", term)
    with progress("run quick", quiet=False) as report:
        for done, name in enumerate(("setting", "stations and candidate poses", "report.html")):
            report(name, done, 12)
    text = sys.stderr.getvalue()
    return text, [re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", one) for one in re.split(r"[\r\n]+", text)]


@pytest.mark.parametrize("columns", [40, 50, 100])
def test_a_bar_says_place_and_time_left_on_every_terminal(columns, monkeypatch):
    _, lines = told(columns, monkeypatch)
    last = [line for line in lines if "/12" in line][-1]
    assert "report.html" in last
    assert re.search(r"3/12 about \d\.\d s left", last)
    assert ("━" in last) == (columns == 100)
    assert max(map(len, lines)) <= columns


@pytest.mark.parametrize("reason", ["plain", "dumb"])
def test_a_screen_reader_gets_a_line_for_each_step_and_nothing_drawn(reason, monkeypatch):
    if reason == "plain":
        with plain_if(True):
            text, lines = told(100, monkeypatch)
    else:
        text, lines = told(100, monkeypatch, term="dumb")
    assert "\x1b" not in text
    assert lines[0].startswith("[1/12] setting: ")
    assert len(lines) == 3


@pytest.mark.parametrize(("share", "word"), [(0.996, "99.6 %"), (1.0, "100 %"), (0.94, "94 %")])
def test_a_point_outside_is_not_rounded_away_in_the_headline_table(share, word):
    mm = dict.fromkeys(("mean_mm", "p95_mm", "max_mm"), 0.1)
    found = {"held_out_before": mm, "held_out_after": mm, "stated_u_3d_rms_mm": 0.1}
    found |= {"held_out_inside_95": share, "chi_square_per_dof": 1.0, "believable": True}
    trials = {"a": {"poses": 29, "estimates": {"whitened": found}}}
    assert word in headline_rows({"trials": trials})[0]
