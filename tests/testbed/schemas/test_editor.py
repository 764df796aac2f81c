"""What editors are told of files: valid schemas, as strict as the readers, beside the files."""

import json
import tomllib
from copy import deepcopy
from functools import cache

import pytest
from jsonschema import Draft7Validator

from calib.errors import CalibError
from testbed.assets import models, scenes
from testbed.gates.comments import statements, with_comments
from testbed.gates.mistakes import validated
from testbed.robots.file import RobotFile
from testbed.scenario.read import dump_scenario
from testbed.schemas.described import meaning
from testbed.schemas.editor import schema
from testbed.schemas.files import FILES, roots
from testbed.studies import load_scenario, scenario_of
from tests.command import call

SESSION = {
    "format": 1,
    "robot": "staubli_tx60",
    "match": "pose_id",
    "joints": {"file": "joints.csv"},
    "frames": {"files": ["a.csv", "b.csv"]},
    "drift": {"nests": ["B1", "B2", "B3"]},
    "uncertainty": {"position_um": 20, "systematic": {"scale_um_per_m": 0.2}},
    "conditions": {"date": "2026-03-02"},
    "session": [{"name": "spring", "file": "spring.csv"}],
}


@cache
def editor(file):
    return Draft7Validator(schema(file))


def shipped(file):
    places = {
        "scene": sorted(scenes().glob("*.toml")),
        "robot": sorted(models().glob("*/robot.toml")),
        "tracker": sorted(models().glob("*/tracker.toml")),
    }
    return places.get(file, [])


@pytest.mark.parametrize("file", FILES)
def test_a_schema_is_valid_and_every_shipped_file_keeps_it(file):
    printed = json.loads(call("schema", file).stdout)
    assert printed == schema(file)
    Draft7Validator.check_schema(printed)
    for path in shipped(file):
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        assert not [error.message for error in editor(file).iter_errors(document)], path
    if file == "session":
        assert not [error.message for error in editor(file).iter_errors(SESSION)]


@pytest.mark.parametrize("file", FILES)
def test_every_key_that_has_a_sentence_shows_it(file):
    tables = schema(file)["definitions"] | {"": schema(file)}
    for _, model in roots(file):
        own = tables[model.__name__ if model.__name__ in tables else ""]["properties"]
        for name in model.model_fields:
            assert meaning(model, name) in own[name].get("description", "")


def damaged(document):
    """The document without one of its keys, with one too many, and with values of other kinds."""
    for table, key in [(None, key) for key in document] + [
        (table, key) for table, inner in document.items() if isinstance(inner, dict)
        for key in inner
    ]:  # fmt: skip
        for value in (None, -1, "word", {}, True, [1, 2, 3]):
            if (key, value) == ("format", True):
                continue  # Python's true is 1
            copy = deepcopy(document)
            place = copy if table is None else copy[table]
            if value is None:
                del place[key]
                place_too = deepcopy(document)
                (place_too if table is None else place_too[table])[f"{key}x"] = 1
                yield place_too
            else:
                place[key] = value
            yield copy


def reads(file, document):
    """Whether the program takes a document; what it says of files is another question."""
    try:
        if file == "scene":
            scenario_of(document)
        else:
            validated(document, roots(file)[0][1], "x")
    except CalibError:
        return False
    return True


@pytest.mark.parametrize(
    ("file", "document"),
    [
        ("scene", tomllib.loads((scenes() / "quick.toml").read_text(encoding="utf-8"))),
        ("session", SESSION),
        ("robot", tomllib.loads((models() / "kuka_iiwa7/robot.toml").read_text(encoding="utf-8"))),
    ],
    ids=["scene", "session", "robot"],
)
def test_an_editor_underlines_nothing_that_the_program_takes(file, document):
    taken = refused = seen = 0
    for one in damaged(document):
        good, fine = reads(file, one), editor(file).is_valid(one)
        assert fine or not good, [error.message for error in editor(file).iter_errors(one)]
        taken, refused, seen = taken + good, refused + (not good), seen + (not fine)
    # most mistakes are those of one key; the rest needs a robot, or other keys
    assert taken > 5
    assert seen > 0.9 * refused


def test_a_scene_that_leaves_all_to_presets_is_whole_to_an_editor_too():
    least = {"format": 1, "name": "a", "robot": "staubli_tx60"}
    assert editor("scene").is_valid(least | {"plan": {}})
    assert editor("scene").is_valid(least | {"plan": {}, "tracker": {"position_um": 3.0}})
    assert not editor("scene").is_valid(least)
    twice = least | {"plan": {}, "tracker": {"preset": "at960", "position_um": 3.0}}
    assert not editor("scene").is_valid(twice)


@pytest.mark.parametrize("name", ["plan_tx60", "stations", "wen2022_moving"])
def test_a_scene_is_printed_with_its_comments_and_reads_as_before(name):
    text = call("scenes", name).stdout
    assert text.startswith("#:schema ./scene.schema.json\n")
    whole = dump_scenario(load_scenario(name))
    assert tomllib.loads(text) == tomllib.loads(whole)
    source = (scenes() / f"{name}.toml").read_text(encoding="utf-8")
    comments = [
        (one.path, said) for one in statements(source) for said in (*one.above, one.behind) if said
    ]
    assert comments
    there = {
        (one.path, said) for one in statements(text) for said in (*one.above, one.behind) if said
    }
    assert set(comments) <= there
    assert editor("scene").is_valid(tomllib.loads(text))


def test_a_comment_stays_with_what_it_is_about():
    source = """\
# head
b = "# no comment"  # of b
[[t]]  # of the first
x = [
  1,  # one
  2,
]
[[t]]
# above
"d e".f = 1 # of f
# the end
"""
    text = 'b = 2\n\n[[t]]\nx = 1\n\n[[t]]\nx = 3\n\n[t."d e"]\nf = 4\n'
    assert [one.path for one in statements(source)] == [
        ("b",), ("t", 0), ("t", 0, "x"), ("t", 1), ("t", 1, "d e", "f"), None,
    ]  # fmt: skip
    assert with_comments(text, source) == (
        "# head\nb = 2  # of b\n\n[[t]]  # of the first\n# one\nx = 1\n\n[[t]]\nx = 3\n\n"
        '[t."d e"]\nf = 4\n# the end\n'
    )


def test_a_new_file_lies_beside_the_schema_that_its_first_line_names(tmp_path):
    out = tmp_path / "robot.toml"
    done = call("new", "robot", "--joints", 6, "--out", out)
    assert f"Schema     {tmp_path / 'robot.schema.json'}  for editors" in done.stdout
    line, text = out.read_text().split("\n", 1)
    beside = out.parent / line.removeprefix("#:schema ")
    assert Draft7Validator(json.loads(beside.read_text())).is_valid(tomllib.loads(text))
    validated(tomllib.loads(text), RobotFile, "x")
    beside.write_text('{"title": "truebed: of an older version"}')
    assert call("new", "robot", "--out", tmp_path / "b.toml").exit_code == 0
    assert json.loads(beside.read_text()) == schema("robot")


@pytest.mark.parametrize("theirs", ["{}", "[", '{"title": "mine"}', "[1]"])
def test_a_foreign_file_of_that_name_is_left_alone(theirs, tmp_path):
    (tmp_path / "scene.schema.json").write_text(theirs)
    out = tmp_path / "scene.toml"
    assert call("new", "scene", "staubli_tx60", "--out", out).exit_code == 0
    assert (tmp_path / "scene.schema.json").read_text() == theirs
    assert not out.read_text().startswith("#:schema")


def test_a_schema_that_is_not_there_is_refused_with_those_that_are():
    done = call("schema", "sesion")
    assert done.exit_code == 2
    assert done.stderr == (
        'there is no schema of "sesion"; there are scene, session, robot, tracker; '
        'did you mean "session"? [C41]\n'
    )
    told = 'there is no schema of "foo"; there are scene, session, robot, tracker. [C41]\n'
    assert call("schema", "foo").stderr == told
