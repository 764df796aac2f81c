"""What no TOML file may be, whoever reads it: too large, too deep, no text; one sentence each."""

import tomllib
from difflib import get_close_matches
from pathlib import Path

import pytest
from typer.testing import CliRunner

from calib.errors import InputError
from testbed import names
from testbed.cli import app
from testbed.gates.toml import MOST_BYTES, deepest, toml_document
from tests.hangs import no_hang
from tests.memory import peak_below

ROOT = Path(__file__).parents[3]
DEEP = {
    "dotted key, 900 deep": (b"seed = 1\n" + b"a." * 899 + b"a = 1", 2, 900),
    "dotted key, 5,000 deep": (b"a." * 4_999 + b"a = 1", 1, 5_000),
    "dotted key, 20,000 deep": (b"\n\n" + b"a." * 19_999 + b"a = 1", 3, 20_000),
    "dotted key, 100,000 deep": (b"a." * 99_999 + b"a = 1", 1, 100_000),
    "header": (b"[" + b"a." * 99_999 + b"a]\n", 1, 100_000),
    "header of a list": (b"[[" + b"'a' . " * 999 + b"a]]\nb = 1\n", 2, 1_001),
    "open lists": (b"a = " + b"[" * 2_000, 1, 2_001),
    "lists over many lines": (b"a = " + b"[\n" * 900 + b"]\n" * 900, 900, 901),
    "tables in braces": (b"a = " + b"{a = " * 900 + b"1" + b"}" * 900, 1, 901),
    "dotted keys in braces in lists": (b"a = [" + b"{a.a = [" * 300 + b"]}" * 300 + b"]", 1, 902),
    "after texts that look deep": (
        b'a = """[[[ \\""" """\nb = \'\'\'{{{\'\'\' # [[[\n' + b"c." * 99 + b"c = 1.5", 3, 100
    ),
}  # fmt: skip
"""Content, its line and how deep it goes; the first one is what was reported."""
VERBS = {
    "scenario": ("run", "FILE"),
    "session": ("identify", "--out", "out", "staubli_tx60", "FILE"),
    "robot": ("robots", "FILE"),
    "robot to calibrate": ("identify", "--out", "out", "FILE", "session.csv"),
}
"""The commands that read a TOML of the user's."""


@pytest.fixture
def told(monkeypatch, tmp_path):
    """What a verb says of a file in an empty folder; that it wrote nothing is checked."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.toml"

    def call(verb, content=None):
        if content is not None:
            file.write_bytes(content)
        words = [str(file) if word == "FILE" else word for word in VERBS[verb]]
        result = CliRunner().invoke(app, words, catch_exceptions=False)
        assert result.exit_code == 2, result.output
        assert [*tmp_path.iterdir()] == [file]
        lines = result.stderr.splitlines()
        assert all(line.startswith(str(file)) for line in lines)
        return [line.removeprefix(str(file)) for line in lines]

    return call


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("case", ["dotted key, 900 deep", "dotted key, 100,000 deep"])
def test_whoever_reads_a_deep_file_refuses_it_by_its_line(told, verb, case):
    content, line, levels = DEEP[case]
    assert told(verb, content) == [
        f":{line}: is nested {levels} deep; at most 16 levels are allowed; write tables in tables "
        "only where a key asks for it. [S38]"
    ]


@pytest.mark.parametrize("case", DEEP)
def test_a_deep_file_is_refused_before_anything_walks_it(case):
    content, line, levels = DEEP[case]
    with no_hang(), pytest.raises(InputError, match=rf"^x\.toml:{line}: is nested {levels} deep; "):
        toml_document(content, "x.toml")


def test_the_memory_of_the_gate_grows_with_the_length_of_a_file_alone():
    content, *_ = DEEP["dotted key, 20,000 deep"]
    # 1.6 GB where tomllib read it
    with peak_below(1e6), pytest.raises(InputError, match="nested 20000 deep"):
        toml_document(content, "x.toml")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a = 1",
        "a.b.c = 1.5",
        "[a.b]\nc.d = 1\n[e]\nf = 1",
        "[a . 'b.c' . \"d.e\"]\nf = [1.5, [2.25], []]",
        "a = [[{b = 1.5, c = {d = [1]}, e = 2}], 3]\nf.g = 1",
        "a = [ # [[[[[\n  [1.5],\n]\nb.c = 1",
        "a = '''\n[[[[{{{{ a.b.c.d.e = '''\nb = \"[[[[\\\"[[[[\"\nc.d = '[[[['",
        'a = """x"""""\nb = """"""\nc.d.e = \'\'',
        "a = 1979-05-27T07:32:00.999999\nb.c = 1",
    ],
)
def test_depth_is_that_of_what_tomllib_reads(text):
    def depth(value):
        if not isinstance(value, dict | list):
            return 0
        return 1 + max(map(depth, value.values() if isinstance(value, dict) else value), default=0)

    wanted = depth(tomllib.loads(text)) if text else 0
    assert deepest(text)[0] == wanted


def test_files_that_ship_stay_far_below_the_limit():
    shipped = [*(ROOT / "scenes").glob("*.toml"), *(ROOT / "models").rglob("*.toml")]
    assert len(shipped) > 10
    assert max(deepest(file.read_text(encoding="utf-8"))[0] for file in shipped) == 5


@pytest.mark.parametrize("verb", ["scenario", "session", "robot"])
def test_of_many_faults_twenty_are_put_into_words_and_the_others_counted(told, verb, monkeypatch):
    keys, compared = 6_000, []

    def counted(word, *args):
        compared.append(word)
        return get_close_matches(word, *args)

    monkeypatch.setattr(names, "get_close_matches", counted)
    lines = told(verb, b"".join(b"k%d = 1\n" % k for k in range(keys)))
    assert 0 < len(compared) <= 20
    assert len(lines) == 21
    count = int(lines[-1].removeprefix(": and ").removesuffix(" more faults"))
    assert keys - 20 <= count <= keys - 10  # beside the keys, those that are missing


@pytest.mark.parametrize("verb", VERBS)
def test_a_file_of_more_than_a_megabyte_is_not_read(told, tmp_path, verb):
    with (tmp_path / "mine.toml").open("wb") as file:
        file.truncate(5 * 10**9)  # sparse: takes no room
    (line,) = told(verb)
    assert line.startswith(": cannot be read: it has 5000 MB, and at most 1 MB are read; ")


@pytest.mark.parametrize("verb", VERBS)
def test_what_is_no_toml_is_said_the_same_way_by_every_reader(told, verb):
    assert told(verb, b"a = ") == [
        ": is not TOML: Invalid value (at end of document); correct that line; strings need "
        "quotes, numbers and true/false do not. [S38]"
    ]
    assert told(verb, b"a = '\xfc'") == [
        ": byte 5 is not UTF-8; TOML is UTF-8 text; save the file as UTF-8. [S38]"
    ]
    assert told(verb, b"a = " + b"9" * 5000) == [
        ": is not TOML: it holds an endless number; write ordinary numbers. [S38]"
    ]
    assert told(verb, b"\x80\x04\x95cos\nsystem\n") == [
        ": byte 0 is not UTF-8; TOML is UTF-8 text; save the file as UTF-8. [S38]"
    ]


@pytest.mark.parametrize("verb", VERBS)
def test_an_endless_key_is_not_repeated_in_full(told, verb):
    lines = told(verb, b"a" * 900_000 + b" = 1")
    (line,) = (line for line in lines if "aaa" in line)
    assert 'has no key "aaaaaaaa' in line
    assert len(line) < 1000


def test_content_handed_over_by_a_script_passes_the_same_gate():
    with pytest.raises(InputError, match=r"x\.toml: is 2\.0 MB; a TOML file has at most 1 MB"):
        toml_document(b"#" * 2 * MOST_BYTES, "x.toml")
