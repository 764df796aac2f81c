"""Tables and verdicts as text: they fit the terminal, and nobody needs its colors or lines."""

import io
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.cli.output import say_found
from testbed.report.text import facts, folded, folded_columns, table, verdict_lines
from testbed.screen_reader import is_plain, plain_if

HEAD = ["trial", "estimator", "poses", "before mm", "after mm", "believable"]
ROWS = [
    ["designed-29", "whitened", "29", "0.6664", "0.0124", "yes"],
    ["designed-29", "paper", "29", "0.6664", "0.0131", "no"],
    ["random-29", "whitened", "29", "0.6664", "0.0186", "yes"],
]


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal(monkeypatch):
    """A terminal of some columns."""

    def of(columns, **environment):
        monkeypatch.setattr(sys, "stdout", Terminal())
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.delenv("NO_COLOR", raising=False)
        monkeypatch.setenv("TERM", "xterm")
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        return sys.stdout

    return of


def cells(text):
    return set(text.replace("─", " ").replace("trial:", " ").replace(",", " ").split())


@pytest.mark.parametrize("columns", [200, 60, 48, 40, 20])
def test_a_table_has_all_its_cells_and_no_line_beyond_the_edge(columns, terminal):
    terminal(columns)
    text = table("Errors", HEAD, ROWS)
    assert max(map(len, text.split("\n"))) <= max(columns, 24)
    assert {cell for row in ROWS for cell in row} <= cells(text)
    assert text.count("believable") >= 1
    wrapped = table("", ["what", "value"], [["a " * 30, "b " * 30]], wrap=True)
    assert max(map(len, wrapped.split("\n"))) <= columns


def test_a_folded_table_repeats_what_tells_its_rows_apart(terminal):
    terminal(48)
    parts = table("", HEAD, ROWS).strip().split("\n\n")
    assert len(parts) == 2
    assert all(part.count("whitened") == 2 and part.count("designed-29") == 2 for part in parts)


def test_a_table_much_too_wide_has_its_rows_by_themselves(terminal):
    """Not five tables of one column each."""
    terminal(40)
    head = [*HEAD[:5], "p95 mm", "max mm", "u mm", "in 95 %", "chi2/dof", HEAD[5]]
    rows = [[*row[:5], "0.0230", "0.0265", "0.0191", "100 %", "0.83", row[5]] for row in ROWS]
    text = table("Errors", head, rows)
    assert max(map(len, text.split("\n"))) <= 40
    assert text.split("\n\n")[:2] == [
        "Errors",
        "designed-29, whitened\n"
        "  poses 29, before mm 0.6664,\n"
        "    after mm 0.0124, p95 mm 0.0230,\n"
        "    max mm 0.0265, u mm 0.0191,\n"
        "    in 95 % 100 %, chi2/dof 0.83,\n"
        "    believable yes",
    ]
    assert len(text.split("\n\n")) == 1 + len(rows)
    terminal(60)
    assert "\n\n\n" not in table("Errors", head, rows)


def test_elsewhere_than_on_a_terminal_a_table_is_one(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    assert "\n\n" not in table("", HEAD, ROWS).strip()


@given(st.lists(st.lists(st.text("ab", max_size=9), min_size=3, max_size=3), min_size=1),
       st.integers(5, 60))  # fmt: skip
def test_each_column_is_in_one_part_and_each_part_fits(columns, edge):
    parts = folded_columns(columns, edge)
    if parts is None:
        return
    keys = [i for i in parts[0] if all(i in part for part in parts)] if parts[1:] else []
    seen = [i for part in parts for i in part if i not in keys]
    assert sorted([*keys, *seen]) == list(range(len(columns)))
    for part in parts:
        assert sum(max(map(len, columns[i])) + 2 for i in part) <= edge


def test_for_a_screen_reader_every_line_is_a_fact(terminal):
    out = terminal(100)
    with plain_if(True):
        text = table("Errors", HEAD, ROWS)
        say_found("Verdict: all is well.", good=True)
        assert folded("x " * 200) == "x " * 200
    assert not is_plain()
    assert text == facts("Errors", HEAD, ROWS)
    assert not set(text) & set("─━│┃ ".replace(" ", ""))
    assert "  after mm: 0.0131" in text.split("\n")
    assert all(":" in line for line in text.split("\n")[1:] if line)
    assert out.getvalue() == "Verdict: all is well.\n"


@pytest.mark.parametrize(
    ("environment", "colored"),
    [({}, True), ({"NO_COLOR": "1"}, False), ({"NO_COLOR": ""}, True), ({"TERM": "dumb"}, False)],
)
def test_a_color_says_nothing_that_words_do_not(environment, colored, terminal):
    out = terminal(80, **environment)
    say_found("Errors\nVerdict: it can be believed.\n  For so many reasons.", good=True)
    text = out.getvalue()
    assert ("\x1b" in text) == colored
    plain = text.replace("\x1b[1;36m", "").replace("\x1b[0m", "")
    assert plain == "Errors\nVerdict: it can be believed.\n  For so many reasons.\n"


def test_sentences_break_at_words_and_hang(terminal):
    terminal(40)
    lines = folded(f"  one {'word ' * 20}end\nshort").split("\n")
    assert max(map(len, lines)) <= 40
    assert lines[0].startswith("  one")
    assert all(line.startswith("    word") for line in lines[1:-2])
    assert lines[-1] == "short"


SAID = {
    "designed-29 brings the mean tool error on held-out posés from 0.666 to 0.012 mm; the mean "
    "tool point lies within 31.4 um of the predicted one with 95 % probability (3-D radius, poses "
    "like the 50 held out), and this can be believed.": 2,
    "Of 24 chosen sets 0 are better than random ones of their size, 2 are worse and 22 "
    "undecided.": 1,
    "On rigid robots the corrected program brings AP from 0.60 mm to 3.8 um. AP is the mean of "
    "five poses and the median of 3 robots; its noise floor is 2.5 um.": 3,
    "At 95 % the believed region keeps its promise on every robot. Of the others: the conformal "
    "ball on every robot; the parameters alone on no robot.": 2,
    "18 poses will locate the mean tool point within 26.7 um (3-D radius, 95 %). This counts "
    "noise alone, over all postures of the goal; at its worst posture the radius is 29.4 um.": 3,
    "PASS at the stated limits. AP is up to 80.0 um (P1; 95 % limits 60 to 90); RP is up to 10 um "
    "(P2; 7 to 15). Measured: 30 cycles of 5 poses.": 4,
    "w" * 300: 1,
    "Short.": 1,
}
"""Verdicts, and the thoughts of each."""


@pytest.mark.parametrize(("sentence", "thoughts"), SAID.items())
def test_each_line_of_a_verdict_is_a_thought_and_nothing_of_it_is_lost(sentence, thoughts):
    line, *rest = verdict_lines(sentence)
    assert line.startswith("Verdict: ")
    assert len(rest) == thoughts - 1
    for told in (line, *rest):
        assert told.count("(") == told.count(")")
        assert told.endswith((".", "w"))
    assert all(told[:2] == "  " and (told[2].isupper() or told[2].isdigit()) for told in rest)
    letters = "".join(c for c in sentence.lower() if c.isalnum())
    told = "".join([line.removeprefix("Verdict:"), *rest]).lower()
    assert "".join(c for c in told if c.isalnum()) == letters


@pytest.mark.parametrize("columns", [100, 80, 40])
@pytest.mark.parametrize("sentence", SAID)
def test_no_line_begins_within_a_thought_but_where_it_was_broken(columns, sentence, terminal):
    """And such a line hangs deeper than those that begin one."""
    terminal(columns)
    thoughts = verdict_lines(sentence)
    lines = folded("\n".join(thoughts)).split("\n")
    assert max(map(len, lines)) <= max(columns, len(max(sentence.split(), key=len)) + 4)
    begins = [line for line in lines if not line.startswith("    ")]
    assert len(begins) == len(thoughts)
    assert all(each.startswith(line) for each, line in zip(thoughts, begins, strict=True))


def test_a_number_and_its_unit_stay_in_one_line(terminal):
    terminal(24)
    lines = folded("  " + "Of all 136 (68 %) lie 9.3 um and 3 mm away in 2 min 54 s. " * 3).split(
        "\n"
    )
    assert max(map(len, lines)) <= 24
    assert not any(line.split()[0].strip("().") in ("%", "um", "mm", "min", "s") for line in lines)


def test_a_broken_verdict_keeps_its_color_and_nothing_else_has_it(terminal):
    out = terminal(40, TERM="xterm")
    say_found(f"Errors\nVerdict: {'it can be believed ' * 4}.\n  For {'many ' * 20}", good=True)
    lines = out.getvalue().rstrip("\n").split("\n")
    marked = [line.startswith("\x1b[") for line in lines]
    assert marked == [False, True, True, True, *[False] * (len(lines) - 4)]
    assert "believed" in lines[3]
    assert len(lines) > 6
