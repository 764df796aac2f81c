"""The scenario file: strict, complete, and hashed so that only what matters counts."""

import dataclasses
import tomllib
from contextlib import suppress
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.errors import InputError
from testbed.assets import scene_names
from testbed.robots.catalog import load_robot
from testbed.scenario.hashes import LATER_TRUTH, hashed_document, robot_hash, scenario_hash
from testbed.scenario.read import changed, dump_scenario
from testbed.scenario.scenario import RESERVED, Scenario
from testbed.studies import declared_tables, load_scenario, parse_scenario, scenario_of
from tests.campaign import record_hash

SMALL = {
    "format": 1,
    "name": "small",
    "seed": 3,
    "robot": "staubli_tx60",
    "trial": [
        {"name": "a", "poses": 20, "method": "random"},
        {"name": "b", "poses": 20, "method": "greedy"},
    ],
}


def small(**tables):
    return scenario_of(deepcopy(SMALL) | tables)


def faults(document):
    with pytest.raises(InputError) as caught:
        scenario_of(document, where="x.toml")
    return str(caught.value).splitlines()


@pytest.mark.parametrize("name", scene_names())
def test_each_scene_survives_being_written_with_every_default(name):
    scenario = load_scenario(name)
    text = dump_scenario(scenario)
    assert parse_scenario(text, where="again") == scenario
    assert dump_scenario(parse_scenario(text, where="again")) == text
    written = tomllib.loads(text)
    for table, model in (("", Scenario), *((k, None) for k in written)):
        if model is not None:
            absent = {name for name in ("fixtures", "tolerance") if getattr(scenario, name) is None}
            own = {*model.model_fields, *scenario.tables, "origin"}
            assert set(written) == own - absent
        elif isinstance(written[table], dict) and table != "origin":
            settings = scenario.tables.get(table) or getattr(scenario, table)
            fields = set(type(settings).model_fields)
            # a table that is not there says that there is no prior, and nothing of the use
            assert set(written[table]) == fields - {"prior", "use"}


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**63 - 1),
    title=st.text(st.characters(exclude_categories=["C", "Zl", "Zp"]), max_size=20),
    station=st.tuples(*[st.floats(-5e4, 5e4)] * 3),
    noise=st.floats(1e-6, 1e4),
    margin=st.floats(0, 90),
    names=st.lists(st.from_regex(r"[a-z0-9][a-z0-9_.-]{0,8}", fullmatch=True), min_size=1,
                   max_size=4, unique=True),
)  # fmt: skip
def test_any_scenario_survives_the_file(seed, title, station, noise, margin, names):
    names = [name for name in names if name not in TAKEN] or ["x"]
    scenario = small(
        seed=seed,
        title=title,
        tracker={"preset": "paper", "station_mm": list(station), "position_um": noise},
        pool={"joint_margin_deg": margin},
        trial=[{"name": name, "poses": 12, "method": "detmax"} for name in names],
    )
    again = parse_scenario(dump_scenario(scenario).encode(), where="again")
    assert again == scenario
    assert np.float64(again.tracker.position_um).tobytes() == np.float64(noise).tobytes()


def test_presets_fill_in_what_is_not_said_and_give_way_to_what_is():
    assert small().truth.gravity_mdeg == (10.0, 6.0, 8.0)
    assert small(truth={"preset": "rigid"}).truth.gravity_mdeg == (0.0, 0.0, 0.0)
    said = small(truth={"preset": "rigid", "harmonic_mdeg": 2}).truth
    assert (said.harmonic_mdeg, said.gravity_mdeg) == (2.0, (0.0, 0.0, 0.0))
    at960 = small(tracker={"preset": "at960"})
    assert at960.tracker.range_um == (2.0, 0.15)
    assert small().truth.joint_repeatability_mdeg == 0.0  # "paper" noise has it included
    assert at960.truth.joint_repeatability_mdeg is None  # the robot's own
    assert 'joint_repeatability_mdeg = "robot"' in dump_scenario(at960)
    own = small(robot="my/robot.toml")
    assert own.truth.perturb == "links"


def test_a_byte_order_mark_and_windows_line_ends_change_nothing():
    text = dump_scenario(small())
    data = b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode()
    assert parse_scenario(data, where="x") == small()


def test_a_robot_path_starts_from_the_scenario_file(tmp_path):
    document = deepcopy(SMALL) | {"robot": "../arms/mine"}
    file = tmp_path / "mine.toml"
    file.write_text(dump_scenario(scenario_of(document)), encoding="utf-8")
    assert load_scenario(file).robot == str((tmp_path / "../arms/mine").resolve())


def test_every_fault_is_told_at_once_up_to_twenty():
    lines = faults(
        deepcopy(SMALL)
        | {"sed": 3, "pool": {"size": True, "altitude": 2}, "tracker": {"noise_mm": 0.02}}
    )
    assert len(lines) == 4
    assert all(line.startswith("x.toml: ") and line.endswith("]") for line in lines)
    lines = faults(deepcopy(SMALL) | {"pool": {f"key{i}": 1 for i in range(30)}})
    assert len(lines) == 21
    assert lines[-1] == "x.toml: and 10 more faults"


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"tracker": {"nois_um": 1}}, '[tracker] has no key "nois_um"; known keys:'),
        ({"tracker": {"positoin_um": 1}}, 'no key "positoin_um"; did you mean "position_um"?'),
        ({"tracker": {"position_mm": 0.0175}}, 'no key "position_mm"; write position_um = 17.5.'),
        ({"tracker": {"noise_m": 2e-5}}, 'no key "noise_m"; write position_um = 20.'),
        ({"tracker": {"rotation_deg": 0.011}}, "write rotation_mdeg = 11."),
        ({"tracker": {"rotation_rad": 1.0}}, "write rotation_mdeg = 57295.8."),
        ({"tracker": {"station_m": [1, 2, 3]}}, 'the key is "station_mm": give the value in mm'),
        ({"tracker": {"range_um": [1, 2]}}, 'it belongs to preset = "at960"'),
        ({"tracker": {"preset": "at690"}}, '[tracker] preset is "at690"; allowed are "paper"'),
        ({"tracker": {"preset": 3}}, '[tracker] preset is 3; allowed are "paper", "at960"'),
        (
            {"truth": {"preset": "stiff"}},
            '[truth] preset is "stiff"; allowed are "rigid", "wen2022", "soft"',
        ),
        ({"truth": {"size": 3}}, 'has no key "size"; move it to [pool]'),
        ({"pool": {"seed": 3}}, 'has no key "seed"; move it to the top of the file'),
        ({"pool": {"size": 5}}, "[pool] size is 5; it must be 10 or larger"),
        ({"pool": {"size": 1e3}}, "[pool] size is 1000.0; it must be a whole number"),
        ({"pool": {"size": "many"}}, '[pool] size is "many"; it must be a whole number'),
        ({"pool": {"self_collision": 1}}, "self_collision is 1; it must be true or false"),
        ({"pool": {"box_size_mm": [1, 2]}}, "box_size_mm has 2 entries; add what is missing"),
        ({"pool": {"box_size_mm": [1, 2, 3, 4]}}, "has 4 entries; it must have at most 3"),
        ({"pool": {"box_size_mm": [1, -2, 3]}}, "box_size_mm[1] is -2; it must be 1e-06 mm or lar"),
        ({"pool": {"box_size_mm": 5}}, "box_size_mm is 5; it must be a list; put it in [brackets]"),
        ({"pool": 5}, "[pool] is 5; it must be a table"),
        ({"truth": 5}, "[truth] is 5; it must be a table"),
        ({"tracker": 5}, "[tracker] is 5; it must be a table"),
        ({"truth": {"perturb": 3}}, "perturb is 3; it must be text or a list of texts"),
        ({"seed": -1}, "seed is -1; it must be 0 or larger"),
        ({"seed": 2**63}, "seed is 9223372036854775808; it must be smaller than"),
        ({"name": "Big Name"}, 'name is "Big Name"; allowed are small letters, digits, - _ and .'),
        ({"name": "../up"}, 'name is "../up"'),
        ({"title": "two\nlines"}, "allowed is one line without control"),
        ({"uncertainty": {"draws": 0}}, "[uncertainty] draws is 0; it must be 2000 or larger"),
        ({"uncertainty": {"repeats": 1}}, "repeats is 1; it must be 2 or larger"),
        ({"identification": {"estimators": []}}, "has 0 entries; it must have at least 1"),
        ({"identification": {"estimators": ["OLS"]}}, 'allowed are "whitened", "paper"'),
        ({"identification": {"estimators": ["paper"] * 2}}, "estimators contains a name twice"),
        ({"identification": {"base": "loose"}}, 'allowed are "free", "fixed"'),
        ({"trial": []}, "[trial] has 0 entries; it must have at least 1"),
        ({"tracker": {"reflector_mm": [1, 0, 0]}}, 'reflector_mm is set, but measures is "pose"'),
        ({"tracker": {"measures": "point"}}, 'estimators has "paper", which needs full poses'),
        ({"uncertainty": {"draws": float("nan")}}, "[uncertainty] draws is nan; it must be a fin"),
        ({"pool": {"box_size_mm": [1.0, float("inf"), 1.0]}}, "box_size_mm[1] is inf"),
    ],
    ids=lambda value: "" if isinstance(value, dict) else value[:40],
)  # fmt: skip
def test_each_mistake_names_the_table_the_key_the_value_and_the_fix(tables, message):
    (line,) = faults(deepcopy(SMALL) | tables)
    assert message in line
    assert line.startswith("x.toml: ")


TRIAL = {"name": "a", "poses": 20, "method": "random"}
TAKEN = (*RESERVED, *(key for table in declared_tables(()).values() for key in table.keys))


@pytest.mark.parametrize(
    ("trials", "message"),
    [
        ([TRIAL, TRIAL], '[[trial]] name "a" is used 2 times; rename all but one'),
        *(([TRIAL | {"name": name}], "has a reserved name") for name in TAKEN),
        ([TRIAL | {"poses": 2000}], "poses is 2000; [pool] size is 1000"),
        ([TRIAL | {"method": "detmx"}], 'did you mean "detmax"?'),
        ([TRIAL | {"criterion": "T"}], 'criterion is "T"; allowed are "D", "A", "V", "G"'),
        ([TRIAL | {"criterion": "V", "rows": "paper"}], "unweighted rows ignore the noise"),
        ([TRIAL | {"pose": 3}], '[[trial]] "a" has no key "pose"; did you mean "poses"?'),
        ([{"name": "a", "poses": 3}], '[[trial]] "a" method is missing; add method = "detmax"'),
        ([TRIAL, {"poses": 3, "method": "random"}], "[[trial]] 2 name is missing"),
        ([TRIAL | {"name": "A"}], 'name is "A"; allowed are small letters'),
        ([TRIAL | {"name": "con/../x"}], "small letters"),
        (TRIAL, "it must be a list of tables; write [[trial]] with two brackets"),
        ([3], "[[trial]] 1 is 3; it must be a table"),
    ],
    ids=lambda value: "" if not isinstance(value, str) else value[:40],
)
def test_each_mistake_in_a_trial_names_the_trial(trials, message):
    (line,) = faults(deepcopy(SMALL) | {"trial": trials})
    assert message in line


def test_rows_of_the_paper_need_full_poses():
    document = deepcopy(SMALL) | {
        "tracker": {"measures": "point"},
        "identification": {"estimators": ["whitened"]},
        "studies": {"paper_budget": True},
        "trial": [TRIAL | {"rows": "paper"}],
    }
    lines = faults(document)
    assert '[[trial]] "a" rows is "paper", which needs full poses' in lines[0]
    assert "[studies] paper_budget needs full poses" in lines[1]


@pytest.mark.parametrize("missing", ["format", "name", "robot", "trial"])
def test_a_missing_key_is_asked_for(missing):
    document = deepcopy(SMALL)
    del document[missing]
    (line,) = faults(document)
    name = "[trial]" if missing == "trial" else missing
    assert line.startswith(f"x.toml: {name} is missing; add ")


def test_a_newer_format_is_refused_before_anything_else_is_read():
    assert faults(deepcopy(SMALL) | {"format": 2, "other": 1}) == [
        "x.toml: has format 2; this version reads format 1; install a newer truebed. [D42]"
    ]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\xff\xfe[\0", "byte 0 is not UTF-8"),
        ("name = 'Prüfstand'".encode("latin-1"), "byte 10 is not UTF-8"),
        (b"seed = ", "is not TOML: Invalid value "),
        (b"seed = 1\nseed = 2", "is not TOML: Cannot overwrite a value "),
        (b"a = " + b"[" * 2000, "x.toml:1: is nested 2001 deep; at most 16 levels are allowed"),
        (b"seed = " + b"9" * 5000, "is not TOML: it holds an endless number"),
        (b"[tracker]\nposition_um = 12:30:45", "[tracker] position_um is 12:30:45"),
        (b"[tracker]\nposition_um = 1e400", "[tracker] position_um is inf"),
        (b"", "format is missing"),
    ],
)
def test_a_file_that_is_no_scenario_is_refused_in_one_sentence(tmp_path, data, message):
    file = tmp_path / "x.toml"
    file.write_bytes(data)
    with pytest.raises(InputError) as caught:
        load_scenario(file)
    assert message in str(caught.value)


@pytest.mark.parametrize("name", ["wen2202", "no/such/file.toml", "x" * 5000, "a\0b", ""])
def test_a_scene_that_is_not_there_is_answered_with_those_that_are(name):
    with pytest.raises(InputError) as caught:
        load_scenario(name)
    assert "scenes that ship: " in str(caught.value)
    if name == "wen2202":
        assert 'did you mean "wen2022"?' in str(caught.value)


JSONISH = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    | st.dates() | st.times() | st.datetimes(),
    lambda inner: st.lists(inner, max_size=3)
    | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)  # fmt: skip


TOP = st.sampled_from(tuple(Scenario.model_fields)) | st.text(max_size=5)


@settings(max_examples=60)
@given(st.dictionaries(TOP, JSONISH))
def test_whatever_is_in_the_file_only_our_error_comes_out(document):
    with suppress(InputError):
        scenario_of(deepcopy(SMALL) | document, where="x.toml")


@settings(max_examples=60)
@given(st.sampled_from(["truth", "tracker", "pool", "identification", "trial"]), st.data())
def test_whatever_a_key_holds_only_our_error_comes_out(table, data):
    document = tomllib.loads(dump_scenario(small()))
    place = document[table][0] if table == "trial" else document[table]
    place[data.draw(st.sampled_from(sorted(place)))] = data.draw(JSONISH)
    with suppress(InputError):
        scenario_of(document, where="x.toml")


def test_a_change_by_dotted_key_is_checked_like_the_file():
    quiet = changed(small(), {"tracker.position_um": 5.0, "seed": 9})
    assert (quiet.tracker.position_um, quiet.seed) == (5.0, 9)
    with pytest.raises(InputError, match=r"small: \[tracker\] position_um is -5"):
        changed(small(), {"tracker.position_um": -5})


def test_numbers_of_numpy_and_paths_are_taken_for_what_they_are():
    """What a script hands in that loops over np.arange or has its robot's path."""
    changes = {
        "seed": np.int64(9),
        "tracker.position_um": np.float32(5.0),
        "tracker.station_mm": np.array([2600.0, -2000.0, 300.0]),
        "pool.line_of_sight": np.bool_(True),
        "robot": Path("staubli_tx60"),
    }
    plain = {
        "seed": 9,
        "tracker.position_um": 5.0,
        "tracker.station_mm": [2600.0, -2000.0, 300.0],
        "pool.line_of_sight": True,
        "robot": "staubli_tx60",
    }
    one, other = (changed(small(), each) for each in (changes, plain))
    assert one == other
    assert dump_scenario(one) == dump_scenario(other)
    assert repr(one.given) == repr(other.given)
    for value, sentence in (
        (np.float64("nan"), "position_um is nan; it must be a finite number"),
        (np.array([1.0, 2.0]), r"position_um is .1.0, 2.0.; it must be a number"),
        ({1.0}, "it reads as set"),
    ):
        with pytest.raises(InputError, match=sentence):
            changed(small(), {"tracker.position_um": value})
    with pytest.raises(InputError, match='has no key "3"'):
        changed(small(), {3: 3})


def test_a_scenario_cannot_be_changed_in_place():
    with pytest.raises(ValueError, match="frozen"):
        small().seed = 4


ROBOT = load_robot("staubli_tx60")
KEYS = ("setting", "a", "b", "pose_count", "random_sets", "paper_budget", "random_calibrations",
        "tool_point")  # fmt: skip


ON = {"pose_count": True, "paper_budget": True, "tool_point": True}


def played(**tables):
    """The small scenario with every study of [studies] on."""
    return small(**tables | {"studies": ON | tables.get("studies", {})})


def moved_by(change):
    """Keys whose record hash a change moves."""
    return {
        key
        for key in KEYS
        if record_hash(played(), ROBOT, key) != record_hash(played(**change), ROBOT, key)
    }


def test_a_record_hash_moves_with_what_the_record_depends_on_and_with_nothing_else():
    studies = set(KEYS) - {"setting", "a", "b"}
    other = {"name": "b", "poses": 21, "method": "greedy"}
    assert moved_by({"title": "other"}) == set()
    assert moved_by({"name": "other"}) == set()
    assert moved_by({"studies": {"random_sets": 99}}) == studies
    assert moved_by({"trial": [SMALL["trial"][0], other]}) == {"b"} | studies
    assert moved_by({"trial": SMALL["trial"][::-1]}) == studies
    assert moved_by({"uncertainty": {"repeats": 3}}) == set(KEYS) - {"setting"}
    assert moved_by({"identification": {"base": "fixed"}}) == set(KEYS) - {"setting"}
    for change in ({"seed": 4}, {"pool": {"size": 99}}, {"test": {"poses": 9}},
                   {"truth": {"preset": "rigid"}}, {"tracker": {"preset": "at960"}}):  # fmt: skip
        assert moved_by(change) == set(KEYS)
    assert len({record_hash(played(), ROBOT, key) for key in KEYS}) == len(KEYS)


def test_keys_that_came_later_move_a_hash_only_where_they_say_something_new():
    """Run folders of versions that did not know them stay those of the same scenario."""
    usual = {
        "poses": 50,
        "pose_numbers": [30, 50, 70, 90, 110, 130, 150],
        "location_poses": 50,
        "location_border_mm": [250.0, 0.0],
        "environment_mm": 0.0,
        "environment_deg": 0.0,
    }
    assert small().document()["budget"] == usual
    assert moved_by({"budget": usual}) == set()
    hashed = hashed_document(small())
    assert "budget" not in hashed
    assert not any("detmax" in trial for trial in hashed["trial"])
    studies = set(KEYS) - {"setting", "a", "b"}
    for key, value in {"poses": 40, "environment_mm": 0.01, "pose_numbers": [30, 50]}.items():
        assert moved_by({"budget": {key: value}}) == studies
    first, *others = SMALL["trial"]
    assert moved_by({"trial": [first | {"detmax": [40, 2, 1, 80]}, *others]}) == set()
    assert moved_by({"trial": [first | {"detmax": [40, 2, 1, 9]}, *others]}) == {"a"} | studies
    # a motion and a transmission that are off have no keys, and one that is on has all of them
    sprung = {"preset": "elastic", "drive_nm_per_mrad": [90.0] * 6}
    rest, moving = (
        hashed_document(small(truth=sprung | {"motion": on}))["truth"] for on in (False, True)
    )
    assert set(moving) - set(rest) == {"motion", *LATER_TRUTH["motion"]}
    assert not set(LATER_TRUTH["transmission_mdeg"]) & set(rest)
    assert moved_by({"truth": {"speed_deg_s": 9.0, "gear_ratio": 9.0, "payloads_kg": []}}) == set()
    assert moved_by({"truth": {"transmission_waves": [9, 11]}}) == set()
    assert moved_by({"truth": {"transmission_mdeg": 1.0}}) == set(KEYS)
    assert moved_by({"truth": {"gear_mdeg": 1.0}}) == set(KEYS)


def test_the_scenario_hash_moves_with_every_key():
    base = scenario_hash(small(), ROBOT)
    for change in ({"title": "x"}, {"name": "x"}, {"studies": {"tool_point": True}}, {"seed": 4}):
        assert scenario_hash(small(**change), ROBOT) != base
    assert scenario_hash(small(), ROBOT) == base


def test_the_hash_knows_the_robot_by_its_content_not_by_its_place(tmp_path):
    links = np.array(ROBOT.model.chain.links)
    links[0, 1] += 1e-15
    chain = dataclasses.replace(ROBOT.model.chain, links=links)
    model = dataclasses.replace(ROBOT.model, chain=chain)
    assert robot_hash(dataclasses.replace(ROBOT, model=model)) != robot_hash(ROBOT)
    elsewhere = tmp_path / "mesh.obj"
    elsewhere.write_bytes(ROBOT.visuals[0].file.read_bytes())
    first = dataclasses.replace(ROBOT.visuals[0], file=elsewhere)
    moved = dataclasses.replace(ROBOT, visuals=(first, *ROBOT.visuals[1:]), folder=tmp_path)
    assert robot_hash(moved) == robot_hash(ROBOT)
    elsewhere.write_bytes(b"v 0 0 0")
    other = dataclasses.replace(moved, title="another object, not the cached one")
    assert robot_hash(other) != robot_hash(ROBOT)
