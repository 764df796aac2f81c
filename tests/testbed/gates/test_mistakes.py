"""What a schema finds wrong is one whole sentence in our words: place, value, range, unit, fix."""

import re
import tomllib
import unicodedata

import pytest
from pydantic import TypeAdapter, ValidationError

from calib.errors import InputError
from testbed import assets
from testbed.files.session_toml import SessionFile
from testbed.gates.mistakes import NAMES, validated
from testbed.robots.file import RobotFile
from testbed.scenario.scenario import Scenario
from testbed.strict import PlainText, Strict, models_in
from testbed.studies import SHIPPED, load_scenario
from tests.testbed.test_bounds import leaves, with_value

TX60 = tomllib.loads((assets.models() / "staubli_tx60" / "robot.toml").read_text("utf-8"))
LONG = "n" * 210
CUT = "n" * 57
SESSION = {
    f'[points.reflectors_mm]\n{LONG} = [1, 2, 3]': (
        f'[points] reflectors_mm has the key "{CUT[:-1]}...; expected at most 200 characters; '
    ),
    f"[points.columns]\n{LONG} = 3": (
        f"[points] columns.{CUT}... is 3; it must be text; put it in quotes."
    ),
    '[points.columns]\n"" = "x"': '[points] columns has the key ""; expected at least 1 character',
    f'[frames]\nfile = "{LONG}"': f'file is "{CUT[:-1]}...; expected at most 200 characters',
    '[points]\nreflectors_mm = { A = 3 }': 'A is 3; allowed are "free" or a list; choose one of',
    '[points]\nreflectors_mm = { A = "fre" }': 'or a list; did you mean "free"? [S37]',
    "[points]\nreflectors_mm = { A = [1, 2] }": "reflectors_mm.A has 2 entries; add what is missi",
    "[points]\nreflectors_mm = { A = [1, 2, 3, 4] }": "A has 4 entries; it must have at most 3",
    '[points]\nreflectors_mm = { A = [1, "a", 3] }': "A[1] is \"a\"; it must be a number; write it",
    '[points]\nreflectors_mm = ["A"]': 'is ["A"]; it must be a table; write [points.reflectors_mm]',
    "[start]\nanchors_mm = { A = [0, 0, 1e9] }": "A[2] is 1000000000.0; it must be 100000000 mm or",
    "points = 3": "[points] is 3; it must be a table; write [points] and its keys below.",
    "[drift]\nnests = []": "nests has 0 entries; it must have at least 1; correct the list.",
    '[drift]\nnests = [""]': '[drift] nests[0] is ""; expected at least 1 character; write it out.',
    '[drift]\nfile = "a"': '[drift] needs the key "nests".',
    "[uncertainty]\nmpe_um = [1]": "[uncertainty] mpe_um has 1 entry; add what is missing.",
    "[uncertainty]\nposition_um = nan": "is nan; it must be a finite number; write an ordinary",
    "[uncertainty]\nposition_um = 2020-01-01": 'is "2020-01-01"; it must be a number; write it',
    "[uncertainty]\nrotation_mdeg = 0": "is 0; it must be 1e-06 mdeg or larger; choose a value",
    "[dialect]\nheader = 1": "[dialect] header is 1; it must be true or false; write one of them",
    "[identification]\nfree = 3": "free is 3; it must be text or a list of texts; put names in",
    "[identification]\nfree = [3]": "free[0] is 3; it must be text; put it in quotes.",
    "format = 2": "x.toml: format is 2; this version reads format 1; write format = 1. [D42]",
    "name = 3": "x.toml: name is 3; it must be text; put it in quotes. [S37]",
    '[frames]\nfile = "a"\nfiles = ["b"]': "[frames]: write either file or files. [S37]",
}  # fmt: skip
ROBOT = {
    ("joints", 1, "theta_deg"): ("x", '[joints 2] theta_deg is "x"; it must be a number; write it'),
    ("joints", 1, "mass_kg"): (-1, "mass_kg is -1; it must be 1e-09 kg or larger; choose a value"),
    ("joints", 1, "max_speed_deg_s"): (1e9, "is 1000000000.0; it must be 1000000 deg/s or smaller"),
    ("joints", 1, "kind"): ("rotary", '[joints 2] kind is "rotary"; allowed are "revolute", "pri'),
    ("joints", 1, "inertia_kg_m2"): ([1.0, 0.2, 0.2], "[joints 2]: inertia_kg_m2: the largest"),
    ("joints", 1, "center_mm"): ([1.0], "center_mm has 1 entry; it must have at least 3;"),
    ("joints",): (3, "[joints] is 3; it must be a list; put it in [brackets]."),
    ("parts", 0, "file"): ("../x.obj", '"../x.obj"; it must stay inside the model\'s folder'),
    ("name",): ("../x", 'name is "../x"; allowed are small letters, digits and _, a letter first'),
    ("never_collide",): ([[0, 9]], "robot.toml: never_collide has [0, 9]; allowed: two of 0 to 6"),
}  # fmt: skip
FOREIGN = re.compile(r"should|\b[Ii]nput\b|String|Tuple|validation|union|\btag\b|: [a-z]+ be ")
"""Words of pydantic's own sentences."""


def told(document, schema, where):
    with pytest.raises(InputError) as caught:
        validated(document, schema, where)
    return str(caught.value)


@pytest.mark.parametrize("text", SESSION)
def test_a_mistake_in_a_session_is_one_whole_sentence(text):
    line = told(tomllib.loads(text), SessionFile, "x.toml").split("\n")[-1]
    assert SESSION[text] in line
    assert line.startswith("x.toml: ")
    assert line.count(CUT[:-1]) <= 1
    assert not FOREIGN.search(line)


@pytest.mark.parametrize("path", ROBOT)
def test_a_mistake_in_a_robot_is_one_whole_sentence(path):
    value, says = ROBOT[path]
    line = told(with_value(TX60, path, value), RobotFile, "robot.toml")
    assert says in line
    assert not FOREIGN.search(line)


# no file can say None: TOML has no such value
@pytest.mark.parametrize("value", [1e300, -1e300, "x", True, [], {}])
def test_whatever_a_number_becomes_pydantic_says_nothing_itself(value):
    for path in list(leaves(TX60))[::7]:
        line = told(with_value(TX60, path, value), RobotFile, "robot.toml")
        assert not FOREIGN.search(line), line


def test_a_range_is_told_with_the_unit_of_its_key():
    """Every size of a robot that has one; a share of color has none."""
    for path in leaves(TX60):
        line = told(with_value(TX60, path, 1e300), RobotFile, "robot.toml")
        unit = re.search(r"must be [-\d.e+]+ (.*?) ?or smaller", line)[1]
        assert unit == ("" if path[0] == "colors" else unit)
        key = next(part for part in reversed(path) if isinstance(part, str))
        assert unit.replace(" ", "").replace("/", "") == {
            "d_mm": "mm", "inertia_kg_m2": "kgm2", "max_speed_deg_s": "degs"
        }.get(key, "" if path[0] == "colors" else key.rpartition("_")[2])  # fmt: skip


def schemas():
    """Every table of every file."""
    load_scenario("quick")  # the studies' tables are known then
    assert SHIPPED
    waiting, seen = [Strict, SessionFile, RobotFile, Scenario], []
    for schema in waiting:
        for other in (
            *schema.__subclasses__(),
            *(one for field in schema.model_fields.values() for one in models_in(field.annotation)),
        ):
            if other not in waiting:
                waiting.append(other)
        seen.append(schema)
    return seen


def patterns_in(document):
    """Every pattern of a JSON schema."""
    if isinstance(document, dict):
        if isinstance(document.get("pattern"), str):
            yield document["pattern"]
        document = list(document.values())
    for inner in document if isinstance(document, list) else ():
        yield from patterns_in(inner)


def test_every_pattern_of_a_name_has_its_words():
    found = {one for schema in schemas() for one in patterns_in(schema.model_json_schema())}
    assert found == {*NAMES, TypeAdapter(PlainText).json_schema()["pattern"]}


def test_plain_text_is_one_line_without_control_characters():
    """All of Unicode: what is a control, an end of a line, or turns the writing is none."""
    text = TypeAdapter(PlainText)
    for number in (*range(0x3000), 0xFEFF, 0xFFFD, 0xFFFE, 0xFFFF, 0x1F916):
        letter = chr(number)
        kind, turns = unicodedata.category(letter), unicodedata.bidirectional(letter)
        steers = kind in ("Cc", "Zl", "Zp") or turns in (
            "LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"
        )  # fmt: skip
        try:
            text.validate_json(f'"a\\u{number:04x}b"' if number < 65536 else f'"{letter}"')
            accepted = True
        except ValidationError:
            accepted = False
        assert accepted == (not steers and number not in (0xFFFE, 0xFFFF)), hex(number)
        assert accepted or len(f"a{letter}b".splitlines()) <= 2
        assert not accepted or len(f"a{letter}b".splitlines()) == 1
