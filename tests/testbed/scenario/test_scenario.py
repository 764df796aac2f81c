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
from testbed.robots.parts import IN_PLACE, Form, Primitive
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


TRIAL = {"name": "a", "poses": 20, "method": "random"}
TAKEN = (*RESERVED, *(key for table in declared_tables(()).values() for key in table.keys))


@pytest.mark.parametrize("name", TAKEN)
def test_no_trial_has_the_name_of_another_record(name):
    (line,) = faults(deepcopy(SMALL) | {"trial": [TRIAL | {"name": name}]})
    assert "has a reserved name" in line


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


def test_the_hash_knows_what_a_robot_would_hit():
    """Shapes and meshes, where they are, and whether they are drawn; runs go on from it."""
    first, *others = ROBOT.visuals
    aside = ((1.0, 0.0, 0.0, 0.1), *IN_PLACE[1:])
    meshes = [dataclasses.replace(first, **change) for change in ({"affine": aside},
              {"drawn": False}, {"collides": not first.collides}, {"link": 1})]  # fmt: skip
    seen = [dataclasses.replace(ROBOT, visuals=(one, *others)) for one in (first, *meshes)]
    body = Primitive(first.rgb, True, 2, "arm", form=Form("box", (0.1, 0.1, 0.3)))
    less = Form("box", (0.1, 0.1, 0.2))
    shapes = [dataclasses.replace(body, **change) for change in ({}, {"affine": aside},
              {"form": less}, {"link": 3}, {"collides": False})]  # fmt: skip
    seen += [dataclasses.replace(ROBOT, primitives=(one,)) for one in shapes]
    assert len(set(map(robot_hash, seen))) == len(seen)
    assert robot_hash(seen[0]) == robot_hash(ROBOT)


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
