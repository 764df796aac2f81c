"""The documents: every key of every file is described, and pages only name what is there."""

import inspect
import json
import re
import shlex
from dataclasses import is_dataclass
from functools import reduce
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import get_args, get_type_hints

import pytest
import typer

import calib
from made.fields import allowed_of, keys
from made.formats import FILES, described, page, places
from made.gallery import OF_ONE_CAMPAIGN, PICTURES, QUESTIONS, SPREAD, at_five_seeds
from made.gallery import page as scene_page
from made.notebooks import PAGES as NOTEBOOKS
from made.notebooks import cells, notebook
from made.outputs import WORDS, compiled, meanings, paths, undescribed
from testbed.assets import scene_names
from testbed.cli import app
from testbed.identify.handback.results import TIP_HEAD
from testbed.robots.links import Link
from testbed.scenario.laboratory import PaperTracker
from tests.real import test_arms as arms

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = {
    str(path.relative_to(DOCS)): path.read_text(encoding="utf-8")
    for path in [*DOCS.glob("*.md"), *DOCS.glob("[a-z]*/*.md")]
    if path.parent.name != "scenes" or path.name == "index.md"
}
"""Every page that is written by hand."""
INSTALLED = (
    "python3 -m venv",
    "pip install jupyterlab",
    "pip install numpy",
    "pip install --no-deps",
    "pip install 'truebed[",
)
"""Beginnings of commands that change the environment, which no test does."""


def api_names() -> list[str]:
    """Functions and classes of `calib` that the API pages show."""
    auto = re.compile(r"auto(?:function|class):: (calib\.\S+)")
    return [name for page in PAGES.values() for name in auto.findall(page)]


def test_help_shows_the_annotations_of_the_documented_as_they_are_written():
    told = {}
    for name in api_names():
        shown = resolve_name(":".join(name.rsplit(".", 1)))
        calls = [shown] if inspect.isfunction(shown) else vars(shown).values()
        for call in (getattr(one, "__func__", one) for one in calls):
            if inspect.isfunction(call) and call.__name__[0] != "_":
                told[f"{name} {call.__name__}"] = str(inspect.signature(call))
    assert len(told) > 100
    assert not [name for name, text in told.items() if "_SupportsArray" in text]


@pytest.mark.parametrize("file", FILES)
def test_every_key_of_every_file_is_described(file):
    silent = [
        f"{place or 'top'}: {key.name} ({model.__name__})"
        for model, place in places(file).items()
        for key in keys(model)
        if len(described(key)) < 4
    ]
    assert not silent


@pytest.mark.parametrize("file", FILES)
def test_every_key_with_a_number_states_its_unit_or_has_none(file):
    for model in places(file):
        for key in keys(model):
            if re.search(r"_(mm|um|deg|mdeg|kg|s|h|k|nm)$", key.name):
                assert key.unit, f"{model.__name__}.{key.name}"


def test_a_key_reads_as_its_schema_says():
    (position,) = (key for key in keys(PaperTracker) if key.name == "position_um")
    assert (position.unit, position.default) == ("µm", "`17.5`")
    assert position.allowed == "number, 1e-06 to 10000"
    assert position.meaning == "Standard deviation per axis."


def test_a_sentence_is_that_of_the_class_that_declares_the_field():
    class Inner(Link):
        kind: str = "inner"

    assert {key.name: key.meaning for key in keys(Inner)}["d_mm"].startswith("Offset along")


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        ({"type": "number", "exclusiveMinimum": 0, "maximum": 9}, "number, above 0 and at most 9"),
        ({"anyOf": [{"type": "boolean"}, {"type": "null"}]}, "`true`, `false`"),
        ({"type": "array", "prefixItems": [{"type": "number"}] * 3}, "3 entries: number"),
        ({"type": "array", "items": {"type": "string"}}, "list: text"),
    ],
)  # fmt: skip
def test_what_is_allowed_in_words(schema, words):
    assert allowed_of(schema) == words


def test_every_link_on_a_format_page_has_its_end():
    for file in FILES:
        text = page(file)
        anchors = set(re.findall(r"^\((.*)\)=$", text, flags=re.MULTILINE))
        assert len(anchors) == len(places(file))
        assert set(re.findall(r"\]\(#(.*?)\)", text)) <= anchors


def fences(text):
    """Language and text of every block of a page; ``{play} sh`` for what the build runs."""
    return re.findall(r"^```(\{?\w+\}?(?: \w+)?)\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def commands(text):
    """Command lines of the blocks that are only shown."""
    for language, block in fences(text):
        if language == "sh":
            yield from block.replace("\\\n", " ").strip().splitlines()


def parsed(words):
    """The verb of a `truebed` command line, whose arguments and options are refused if unknown."""
    command = typer.main.get_command(app)
    while hasattr(command, "commands"):
        name, *words = words
        command = command.commands[name]
    command.make_context(command.name, list(words))
    return command.name


@pytest.mark.parametrize("name", PAGES)
def test_a_python_script_on_a_page_is_one_that_the_build_runs(name):
    assert not [block for language, block in fences(PAGES[name]) if language == "python"]


@pytest.mark.parametrize("name", PAGES)
def test_code_that_the_build_runs_fits_its_column(name):
    shown = [
        line
        for language, block in fences(PAGES[name])
        if language.startswith("{play}") and not block.startswith(":hidden:")
        for line in block.splitlines()
        if not line.startswith(":")
    ]
    # 98 characters of 7.2 px lie in the 736 px that the theme gives text on a screen of 1280 px
    assert not [line for line in shown if len(line) > 98]


@pytest.mark.parametrize("name", PAGES)
def test_a_command_that_is_only_shown_exists_with_its_options(name):
    for line in commands(PAGES[name]):
        if line.startswith(INSTALLED):
            continue
        first, *words = shlex.split(line)
        if first == "truebed":
            assert parsed(words)
        else:
            assert (first, words[0]) == ("python", "-m")
            assert find_spec(words[1])
            assert all((ROOT / word).exists() for word in words if word.startswith("tests/"))


@pytest.mark.parametrize("name", PAGES)
def test_a_page_names_what_its_code_needs_beside_a_plain_installation(name):
    """Who follows a page has what the README installs, which brings neither pandas nor scenes."""
    shown = "".join(block for language, block in fences(PAGES[name]) if "{play}" in language)
    assert "to_pandas" not in shown or "truebed[frames]" in PAGES[name]
    assert not re.search(r"\bscenes/\w+\.", shown) or "clone" in PAGES[name]


def test_a_wrong_command_would_be_seen():
    with pytest.raises(KeyError):
        parsed(["rum", "quick"])
    with pytest.raises(Exception, match="--sead"):
        parsed(["run", "quick", "--sead", "3"])


@pytest.mark.parametrize("name", PAGES)
def test_verbs_and_scenes_in_the_text_of_a_page_exist(name):
    verbs = typer.main.get_command(app).commands
    for verb, word in re.findall(r"`truebed ([a-z0-9]+)(?: ([a-z0-9_]+))?", PAGES[name]):
        assert verb in verbs
        assert verb != "run" or not word or word in scene_names()


def test_every_scene_has_its_page_with_its_question_and_its_figures():
    assert set(QUESTIONS) == set(scene_names())
    for name in scene_names():
        text = scene_page(name)
        assert QUESTIONS[name] in text
        (line,) = commands(text)
        assert parsed(shlex.split(line)[1:]) in ("run", "plan")
        assert (name in SPREAD) == bool(at_five_seeds(name))
        if name in SPREAD:
            pattern = PICTURES.get(name, OF_ONE_CAMPAIGN)[0]
            assert any(re.search(pattern, row.partition(": five")[0]) for row in SPREAD[name])


def test_the_citation_names_this_version():
    version = re.search(r'^version = "(.*)"', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert f"version: {version[1]}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"version = {{{version[1]}}}" in PAGES["cite.md"]


def test_every_figure_of_every_scene_is_described_and_nothing_else():
    golden = (ROOT / "tests" / "golden").glob("*.json")
    files = [file for file in golden if file.stem not in ("spread", "plan_tx60")]
    names = {path for file in files for path in paths(json.loads(file.read_text(encoding="utf-8")))}
    found = {path: meanings("run", path) for path in names}
    assert not [path for path, patterns in found.items() if not patterns]
    used = {patterns[0] for patterns in found.values()}
    assert not set(WORDS["run"]) - used


def test_columns_of_files_that_no_page_writes_are_described():
    assert not undescribed("tool_in_use.csv", TIP_HEAD)


def test_a_pattern_stands_for_one_name_and_not_for_a_path():
    assert compiled("trials/*/poses").fullmatch("trials/random-29/poses")
    assert not compiled("trials/*/poses").fullmatch("trials/a/b/poses")
    assert compiled("q*_deg|q*_mm").fullmatch("q3_mm")
    assert not compiled("a.b").fullmatch("acb")


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_its_page_whose_cells_the_build_runs(name):
    text = (DOCS / f"{name}.ipynb").read_text(encoding="utf-8")
    assert text == notebook(PAGES[f"{name}.md"]), "write it again: python -m made.notebooks in docs"


@pytest.mark.study
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_the_cells_of_a_notebook_run_by_themselves(name, tmp_path, monkeypatch):
    pytest.importorskip("pandas")
    text = (DOCS / f"{name}.ipynb").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names = {}
    for cell in json.loads(text)["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)


def test_a_page_becomes_cells_without_options_and_roles():
    page = "# A\n\nSee {doc}`/concepts/nees`.\n\n```{play} python\n:figure: a.png\nx = 1\n```\n"
    assert cells(page) == [("markdown", "# A\n\nSee `concepts/nees`."), ("code", "x = 1")]


def test_what_measured_arms_reach_is_what_their_study_found():
    page = PAGES["proven.md"].partition("## Real arms")[2].partition("```sh")[0]
    figures = set(re.findall(r"0\.\d{3}", page))
    assert len(figures) > 8
    assert not [figure for figure in figures if figure not in (arms.__doc__ or "")]


def test_the_readme_is_read_in_a_few_minutes():
    """What a newcomer needs stands there; the rest is in docs/."""
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 1800


def named_in(kind):
    """Classes of calib that an annotation names."""
    parts = [one for part in get_args(kind) for one in named_in(part)]
    return [kind, *parts] if inspect.isclass(kind) and not get_args(kind) else parts


def taken_and_given(thing):
    """Classes that a function takes or gives, or that the fields of a class hold."""
    kinds = get_type_hints(thing).values()
    return {
        one
        for kind in kinds
        for one in named_in(kind)
        if one.__module__.startswith("calib.") and is_dataclass(one)
    }


def test_what_functions_on_the_pages_take_and_give_is_on_a_page_as_well():
    """Who reads that distances are measured from anchors of the fixtures asks what those are."""
    pages = "\n".join(page.read_text("utf-8") for page in (DOCS / "api").glob("*.md"))
    written = {name.split(".")[-1] for name in re.findall(r"autoclass:: (calib\S+)", pages)}
    functions = [
        reduce(getattr, name.split(".")[1:], calib)
        for name in re.findall(r"autofunction:: (calib\.(?:design\.|uncertainty\.)?\w+)\n", pages)
    ]
    classes = [calib.RobotModel, calib.Judgement, calib.CalibratedRobot, calib.Measurements]
    asked = {kind.__name__ for thing in (*functions, *classes) for kind in taken_and_given(thing)}
    missing = asked - written
    assert not missing
