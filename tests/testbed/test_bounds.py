"""No number beyond sense is read: every number of a robot, and the table of what makes sense."""

import tomllib
from math import inf

import pytest

from calib.errors import InputError
from testbed import assets, bounds
from testbed.bounds import Bound
from testbed.faults import flat
from testbed.gates.mistakes import validated
from testbed.robots.file import RobotFile
from testbed.scenario.presets import written
from testbed.studies import load_scenario, parse_scenario
from testbed.toml_text import toml_lines

TX60 = tomllib.loads((assets.models() / "staubli_tx60" / "robot.toml").read_text("utf-8"))
TABLE = [each for each in vars(bounds).values() if isinstance(each, Bound)]


def leaves(value, path=()):
    """Every number of a document that has a fraction, and where it stands."""
    if isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in pairs:
            yield from leaves(inner, (*path, key))
    elif isinstance(value, float):
        yield path


def with_value(document, path, value):
    """The document with another value at a place."""
    key, *rest = path
    inner = with_value(document[key], rest, value) if rest else value
    if isinstance(document, dict):
        return document | {key: inner}
    return [*document[:key], inner, *document[key + 1 :]]


def test_every_bound_keeps_squares_and_inverses_numbers():
    assert len(TABLE) > 10
    for bound in TABLE:
        assert 0 <= bound.least < bound.most <= 1e12
        assert bound.least == 0 or 1 / bound.least**4 < 1e300
        if bound.usual != (0.0, inf):
            assert bound.least < bound.usual[0] < bound.usual[1] < bound.most


def test_a_range_is_told_in_the_unit_of_the_file():
    assert bounds.MASS.allowed("kg") == "a mass is 1e-09 to 1000000 kg"
    assert bounds.LINK.allowed("mm") == "a length of a robot is at most 1000000 mm"
    assert bounds.LENGTH_SD.allowed("um", usual=True) == (
        "a standard uncertainty of a length is usually 0.1 to 10000 um"
    )


@pytest.mark.parametrize("value", [1e300, -1e300, 1e308])
def test_no_number_of_a_robot_is_read_beyond_its_range(value):
    places = list(leaves(TX60))
    assert len(places) > 100
    for path in places:
        with pytest.raises(InputError, match=r"\[C41\]"):
            validated(with_value(TX60, path, value), RobotFile, "robot.toml")


@pytest.mark.parametrize("scene", ["quick", "plan_tx60"])
def test_no_number_of_a_scenario_is_read_beyond_its_range(scene):
    document = load_scenario(scene).document()
    goal = {"kind": "list", "tool_mm_deg": [[500.0, 0.0, 300.0, 0.0, 0.0, 0.0]], "weights": [1.0]}
    document["plan"] = document["plan"] | {"goal": goal, "stations": {"list_mm": [[1.0, 0.0, 0.0]]}}
    document = load_document(document).document()
    places = list(leaves({key: part for key, part in document.items() if key != "origin"}))
    assert len(places) > 60
    for path in places:
        with pytest.raises(InputError, match=r"\[C41\]"):
            load_document(with_value(document, path, 1e300))


def load_document(document):
    return parse_scenario("\n".join(toml_lines(written(document))).encode(), where="x.toml")


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("mass_kg", 1e308, r"mass_kg is 1e\+308; it must be 1000000 kg or smaller"),
        ("mass_kg", 1e-300, r"mass_kg is 1e-300; it must be 1e-09 kg or larger"),
        ("max_speed_deg_s", 1e300, r"max_speed_deg_s is 1e\+300; it must be 1000000 deg/s or "),
        ("max_speed_deg_s", 1e-300, r"max_speed_deg_s is 1e-300; it must be 0.0001 deg/s or "),
        ("a_mm", 1e300, r"a_mm is 1e\+300; it must be 1000000 mm or smaller"),
        ("repeatability_urad", 1e300, r"repeatability_urad is 1e\+300; it must be 1000000 urad or"),
    ],
)
def test_a_robot_file_says_how_much_is_allowed(key, value, says):
    with pytest.raises(InputError, match=rf"^robot.toml: \[joints 2\] {says}"):
        validated(with_value(TX60, ("joints", 1, key), value), RobotFile, "robot.toml")


@pytest.mark.parametrize("mark", ["\x00", "\x1b", "\n", "\x7f", "\x9b", "\u2028", "\u202e"])
def test_a_control_character_in_a_text_of_a_robot_is_refused_at_reading(mark):
    texts = [path for path, value in flat(TX60).items() if isinstance(value, str)]
    assert ("title",) in texts
    for path in texts:
        with pytest.raises(InputError, match=r"\[S37\]") as caught:
            validated(with_value(TX60, path, f"a{mark}b"), RobotFile, "robot.toml")
        if path == ("title",):
            assert "allowed is one line without control characters" in str(caught.value)
