"""What a preset or robot decides follows it: in `changed`, in written files, in old run folders."""

import json
import tomllib
from copy import deepcopy

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.errors import InputError
from testbed.cli.campaign import scenario_of as scenario_of_command
from testbed.robots.catalog import load_robot, robot_names
from testbed.run.play import load_run, play_run, rederive
from testbed.scenario import read
from testbed.scenario.hashes import scenario_hash
from testbed.scenario.origin import COMMENT
from testbed.scenario.presets import TRUTH_PRESETS
from testbed.scenario.read import changed, dump_scenario
from testbed.store import layout
from testbed.studies import declared_tables, load_scenario, parse_scenario, scenario_of
from testbed.studies.many_robots import TRUTHS, truth_of_kind
from testbed.toml_text import toml_lines
from tests.testbed.studies.trial.fake_campaign import Fake, content

TRACKERS = ("paper", "at960")
PRESETS = tuple(TRUTH_PRESETS)
PAIRS = [(one, (PRESETS * 2)[i + k]) for i, one in enumerate(PRESETS) for k in range(2)]
"""Each preset with itself, and with the next."""
BASE = {
    "format": 1,
    "name": "base",
    "robot": "staubli_tx60",
    "truth": {"preset": "rigid"},
    "tracker": {"preset": "paper"},
    "trial": [{"name": "a", "poses": 20, "method": "random"}],
}


def of_text(document):
    """The scenario of a file that says what a document says."""
    return parse_scenario("\n".join(toml_lines(document)), where="scenario")


def having(*keys, base=BASE):
    """A document with some keys written by hand, tables before the keys in them."""
    document = deepcopy(base)
    for dotted, value in keys:
        *tables, key = dotted.split(".")
        table = document
        for name in tables:
            table = table.setdefault(name, {})
        table[key] = deepcopy(value)
    return document


def old(text):
    """The file as an older version wrote it, without a word about who gave which number."""
    return text.split(COMMENT)[0]


def edited(text, *changes):
    """A file with some of its text replaced by hand."""
    for before, after in changes:
        assert text.count(before) == 1
        text = text.replace(before, after)
    return text


def refused(text):
    """The one sentence that a file is refused with."""
    with pytest.raises(InputError) as caught:
        parse_scenario(text, where="x.toml")
    (line,) = str(caught.value).splitlines()
    return line


def preset(name):
    return f'preset = "{name}"'


@pytest.mark.parametrize(("first", "other"), PAIRS)
def test_another_preset_of_the_truth_decides_all_its_numbers_anew(first, other):
    base = of_text(having(("truth.preset", first)))
    wanted = of_text(having(("truth.preset", other)))
    assert changed(base, {"truth.preset": other}) == wanted
    assert changed(base, {"truth": {"preset": other}}) == wanted
    assert (
        changed(parse_scenario(dump_scenario(base), where="x"), {"truth.preset": other}) == wanted
    )
    for key, value in TRUTH_PRESETS[other].items():
        found = getattr(changed(base, {"truth.preset": other}).truth, key)
        assert (list(found) if isinstance(found, tuple) else found) == value
    own = having(("truth.preset", first), ("truth.harmonic_mdeg", 2.5))
    kept = changed(of_text(own), {"truth.preset": other, "truth.thermal_k": 1.0})
    assert kept.truth.harmonic_mdeg == 2.5  # given by hand, like the next in the same call
    own["truth"] |= {"preset": other, "thermal_k": 1.0}
    assert kept == of_text(own)


@pytest.mark.parametrize("other", TRACKERS)
@pytest.mark.parametrize("first", TRACKERS)
def test_another_tracker_decides_its_noise_and_what_repeatability_is_left(first, other):
    base = of_text(having(("tracker.preset", first)))
    found = changed(base, {"tracker.preset": other})
    assert found == of_text(having(("tracker.preset", other)))
    assert found.truth.joint_repeatability_mdeg == {"paper": 0.0, "at960": None}[other]
    assert changed(base, {"tracker": {"preset": other}}) == found


def test_a_number_that_only_the_old_tracker_has_is_refused():
    base = of_text(having(("tracker.position_um", 5.0)))
    with pytest.raises(InputError, match=r'no key "position_um"; it belongs to preset = "paper"'):
        changed(base, {"tracker.preset": "at960"})


@pytest.mark.parametrize("other", robot_names())
@pytest.mark.parametrize("first", robot_names())
def test_another_robot_brings_its_place_estimators_and_joints(first, other):
    base = of_text(having(("robot", first), ("truth.preset", "soft"), ("tracker.preset", "at960")))
    found = changed(base, {"robot": other})
    document = having(("robot", other), ("truth.preset", "soft"), ("tracker.preset", "at960"))
    assert found == of_text(document)
    robot = load_robot(other)
    assert found.pool.box_center_mm == robot.workspace.box_center_mm
    assert found.tracker.station_mm == robot.workspace.station_mm
    assert found.pool.joint_ranges_deg == tuple(robot.workspace.joint_ranges_deg or ())
    assert len(found.truth.harmonic_mdeg) == robot.model.chain.n_joints
    own = {"robot": other, "pool.box_size_mm": [500.0, 500.0, 500.0]}
    assert changed(base, own) == of_text(document | {"pool": {"box_size_mm": [500.0] * 3}})


KEYS = {
    "truth.preset": st.sampled_from([*TRUTH_PRESETS, "stiff"]),
    "truth.harmonic_mdeg": st.sampled_from([0, 6.0, [1.0] * 6, [1.0] * 7]),
    "truth.gravity_mdeg": st.sampled_from([[0, 0, 0], [10.0, 6.0, 8.0]]),
    "truth.joint_repeatability_mdeg": st.sampled_from(["robot", 0.0, 1.5]),
    "truth.perturb": st.sampled_from(["links", "wen2022", ["d1", "d2"]]),
    "tracker.preset": st.sampled_from([*TRACKERS, "at690"]),
    "tracker.position_um": st.sampled_from([17.5, 5.0]),
    "tracker.rotation_mdeg": st.sampled_from([11.0, [2.0, 2.0, 3.5]]),
    "tracker.station_mm": st.sampled_from([[2600.0, -2000.0, 300.0], [3000.0, 0.0, 0.0]]),
    "robot": st.sampled_from(robot_names()),
    "seed": st.integers(0, 9),
    "title": st.sampled_from(["", "a . b"]),
    "pool.size": st.sampled_from([10, 25, 1000]),
    "pool.box_size_mm": st.sampled_from([[900.0, 1200.0, 800.0], [500.0, 500.0, 500.0]]),
    "test.poses": st.integers(0, 3),
    "identification.estimators": st.sampled_from([["whitened"], ["whitened", "paper"]]),
    "identification.prior": st.sampled_from([{}, {"sd_mm": {"base.x": 5.0}}]),
    "identification.prior.angles_deg": st.sampled_from([0.1, 0.2]),
    "coverage.robots": st.sampled_from([0, 5]),
    "plan": st.sampled_from([{}, {"poses": 12}, {"target_um": 20.0}]),
    "plan.goal.kind": st.sampled_from(["box", "list"]),
    "plan.goal.poses": st.sampled_from([50, 200]),
    "plan.goal.joints_deg": st.just([[0.0, 10.0, 80.0, 0.0, 20.0, 0.0]]),
    "trial": st.just([{"name": "b", "poses": 12, "method": "detmax"}]),
}
"""Keys that decide others, keys that are decided, and keys of every kind of table."""
CHANGES = st.lists(st.sampled_from(list(KEYS)), max_size=6, unique=True).flatmap(
    # tables before the keys in them
    lambda names: st.tuples(*(st.tuples(st.just(name), KEYS[name]) for name in sorted(names)))
)


def outcome(act):
    """A scenario, or what its refusal says but for where."""
    try:
        return act()
    except InputError as error:
        return [line.split(": ", 1)[1] for line in str(error).splitlines()]


@settings(max_examples=60)
@given(CHANGES, CHANGES, st.booleans())
def test_a_change_does_what_editing_the_text_does(written, changes, through_a_file):
    try:
        base = of_text(having(*written))
    except InputError:
        return
    if through_a_file:
        base = parse_scenario(dump_scenario(base), where="x")
    document = having(*changes, base=base.given)
    assert outcome(lambda: changed(base, dict(changes))) == outcome(lambda: of_text(document))


@settings(max_examples=40)
@given(CHANGES)
def test_a_written_scenario_reads_back_as_it_was_given(changes):
    try:
        scenario = of_text(having(*changes))
    except InputError:
        return
    again = parse_scenario(dump_scenario(scenario), where="again")
    assert (again, again.given) == (scenario, scenario.given)
    assert dump_scenario(again) == dump_scenario(scenario)
    # what was given is all there is to know
    assert scenario_of(scenario.given) == scenario
    # and an older version's file has the same numbers, so the same hashes
    before = read.parse_scenario(
        old(dump_scenario(scenario)), declared_tables, where="old", finished=True
    )
    assert before.document() == scenario.document()
    assert parse_scenario(dump_scenario(before), where="again") == before


def named_in(line, other):
    """Keys of another preset that a sentence names."""
    names = line.removeprefix(f'x.toml: [truth] preset is "{other}", but ').split(" beside ")[0]
    keys = names.replace(" and ", ", ").split(", ")
    return [key for key in keys if not key.endswith(" more")]


def without_keys(text, keys):
    return "\n".join(row for row in text.splitlines() if row.split(" = ")[0] not in keys)


@pytest.mark.parametrize("given_by_hand", [True, False])
@pytest.mark.parametrize(("first", "other"), PAIRS)
def test_an_edited_preset_beside_the_numbers_of_another_is_refused(first, other, given_by_hand):
    document = having(("truth.preset", first))
    if not given_by_hand:
        document.pop("tracker")  # and all tables that are filled in
    text = dump_scenario(of_text(document))
    if first == other:
        assert parse_scenario(text, where="x") == of_text(document)
        return
    lie = edited(text, (preset(first), preset(other)))
    for file in (lie, old(lie)):
        line = refused(file)
        assert line.startswith(f'x.toml: [truth] preset is "{other}", but ')
        assert f'those of "{first}"; delete them, so that the new name fills them in' in line
        assert f'; or write "{first}" again; or ' in line
    # what the sentence says helps: each of the three ways out
    keys = named_in(line, other)
    while " more beside " in line:  # of many, some at a time
        line = refused(without_keys(lie, keys))
        keys += named_in(line, other)
    wanted = document | {"truth": {"preset": other}}
    assert parse_scenario(without_keys(lie, keys), where="x") == of_text(wanted)
    assert parse_scenario(edited(lie, (preset(other), preset(first))), where="x") == of_text(
        document
    )
    meant = ", ".join(f'"truth.{key}"' for key in keys)
    table = "[origin]\ngiven = [" if "[origin]" not in old(lie) else ""
    kept = parse_scenario(f"{old(lie)}{table}{meant}]", where="x")
    assert kept.truth.preset == other
    assert kept.document()["truth"] | {"preset": first} == of_text(document).document()["truth"]
    marked = edited(lie, ("given = [", f"given = [\n  {meant},"))
    assert parse_scenario(marked, where="x").document() == kept.document()


def test_the_way_out_is_one_that_there_is():
    """[origin] is named where it stands, asked for in a file without it, and left out of a call."""
    text = dump_scenario(of_text(BASE))
    lie = edited(text, (preset("rigid"), preset("soft")))
    assert "; or add TABLE.KEY of what shall stay to given, at the end." in refused(lie)
    assert refused(old(lie)).endswith(
        '; or write [origin] at the end, and below it given = ["TABLE.KEY"] with what shall stay. '
        "[S37]"
    )
    before = read.parse_scenario(old(text), declared_tables, where="old", finished=True)
    with pytest.raises(InputError, match=r'those of "rigid"; change them too, or leave "rigid"\.'):
        changed(before, {"truth.preset": "soft"})
    soft = of_text(having(("truth.preset", "soft"))).document()["truth"]
    meant = {f"truth.{key}": value for key, value in soft.items()}
    assert changed(before, meant).document()["truth"] == soft
    assert changed(before, {"truth": {"preset": "soft"}}).document()["truth"] == soft


@pytest.mark.parametrize("first", TRACKERS)
def test_an_edited_tracker_beside_the_numbers_of_another_is_refused(first):
    (other,) = {*TRACKERS} - {first}
    document = having(("tracker.preset", first))
    text = edited(dump_scenario(of_text(document)), (preset(first), preset(other)))
    text = text.replace(f'tracker = "{other}"', f'tracker = "{first}"')
    line = refused(text)
    assert line.startswith(
        f'x.toml: [tracker] preset is "{other}", but [truth] joint_repeatability'
    )
    assert f'those of "{first}"; ' in line
    # without [origin] the keys of the other tracker are unknown; once they are gone, one is left
    rows = old(text).splitlines()
    start = rows.index("[tracker]")
    end = rows.index("", start)
    line = refused("\n".join([*rows[: start + 2], *rows[end:]]))
    assert line.startswith(
        f'x.toml: [tracker] preset is "{other}", but [truth] joint_repeatability_mdeg beside it is '
        f'that of "{first}"; delete it, '
    )


@pytest.mark.parametrize("first", robot_names())
def test_an_edited_robot_beside_the_numbers_of_another_is_refused(first):
    for other in robot_names():
        text = dump_scenario(of_text(having(("robot", first))))
        if first == other:
            continue
        lie = text.replace(f'robot = "{first}"', f'robot = "{other}"', 1)
        for file in (lie, old(lie)):
            line = refused(file)
            assert line.startswith(f'x.toml: robot is "{other}", but ')
            assert "[tracker] station_mm, [pool] box_center_mm" in line
            assert f'those of "{first}"; ' in line


def test_a_key_that_is_gone_may_still_be_named_and_a_run_opens_whatever_is_named():
    scenario = load_scenario("stations")
    text = dump_scenario(scenario)
    assert '"fixtures.reflectors_mm.C"' in text
    gone = "\n".join(row for row in text.splitlines() if not row.startswith("C = "))
    gone = edited(gone, ('free = ["B", "C", "P2"]', 'free = ["B", "P2"]'))
    assert list(parse_scenario(gone, where="x").fixtures.reflectors_mm) == ["A", "B"]
    slip = edited(text, ('"fixtures.reflectors_mm.C"', '"fixtures.reflector_mm.C"'))
    assert refused(slip).endswith(
        'given has "fixtures.reflector_mm.C", which is not a key of a scenario; did you mean '
        '"fixtures.reflectors_mm"? [S37]'
    )
    opened = read.parse_scenario(slip, declared_tables, where="x", finished=True)
    assert opened.document() == scenario.document()


def test_two_edits_are_told_in_one_sentence():
    text = dump_scenario(of_text(BASE))
    lie = edited(text, (preset("rigid"), preset("soft")))
    line = refused(lie.replace('"staubli_tx60"', '"kuka_iiwa7"', 1))
    assert line.startswith('x.toml: robot is "kuka_iiwa7" and [truth] preset is "soft", but ')
    assert 'beside them are those of "staubli_tx60" and "rigid"; ' in line


def test_single_numbers_may_differ_from_their_preset():
    for own in (
        {"harmonic_mdeg": 6.0},
        {"gravity_mdeg": [10.0, 6.0, 8.0]},
        {"gravity_mdeg": [10.0, 6.0, 8.0], "harmonic_mdeg": 6.0},  # all of wen2022, by hand
        {"harmonic_mdeg": 3.0, "gravity_mdeg": [10.0, 6.0, 8.0]},
    ):
        document = BASE | {"truth": {"preset": "rigid"} | own}
        scenario = of_text(document)
        assert scenario.truth.preset == "rigid"
        assert parse_scenario(dump_scenario(scenario), where="x") == scenario
        if own != {"gravity_mdeg": [10.0, 6.0, 8.0], "harmonic_mdeg": 6.0}:
            before = parse_scenario(old(dump_scenario(scenario)), where="x")
            assert before.document() == scenario.document()
    # a number edited in a written file is somebody's own from then on
    text = edited(
        dump_scenario(of_text(BASE)), ("harmonic_mdeg = 0.0\nhigh", "harmonic_mdeg = 2.0\nhigh")
    )
    scenario = parse_scenario(text, where="x")
    assert scenario == of_text(having(("truth.harmonic_mdeg", 2.0)))
    assert changed(scenario, {"truth.preset": "soft"}).truth.harmonic_mdeg == 2.0
    at960 = having(("tracker.preset", "at960"), ("truth.joint_repeatability_mdeg", 0.0))
    before = parse_scenario(old(dump_scenario(of_text(at960))), where="x")
    assert before.document() == of_text(at960).document()


def test_numbers_that_hang_on_an_edited_number_are_played_as_they_stand():
    """29 poses of a plan came of a pool of 1000; nobody said that they follow it."""
    text = edited(dump_scenario(of_text(BASE)), ("size = 1000", "size = 25"))
    scenario = parse_scenario(text, where="x")
    assert (scenario.pool.size, scenario.plan.poses) == (25, 29)
    assert changed(of_text(BASE), {"pool.size": 25}).plan.poses == 25
    assert parse_scenario(dump_scenario(scenario), where="x") == scenario


def test_numbers_of_a_file_are_what_is_played_even_if_presets_have_changed_since(monkeypatch):
    scenario = of_text(having(("truth.preset", "soft")))
    text = dump_scenario(scenario)
    monkeypatch.setitem(TRUTH_PRESETS["soft"], "gravity_mdeg", [1.0, 2.0, 3.0])
    assert parse_scenario(text, where="x").document() == scenario.document()
    assert of_text(having(("truth.preset", "soft"))).truth.gravity_mdeg == (1.0, 2.0, 3.0)


def test_targets_keep_the_order_of_the_file():
    scenario = load_scenario("stations")
    names = list(scenario.fixtures.reflectors_mm)
    text = dump_scenario(scenario)
    assert list(parse_scenario(text, where="x").fixtures.reflectors_mm) == names
    more = edited(
        text, ("[fixtures.reflectors_mm]", "[fixtures.reflectors_mm]\nnew = [9.0, 9.0, 90.0]")
    )
    assert list(parse_scenario(more, where="x").fixtures.reflectors_mm) == ["new", *names]


def test_tables_put_into_a_scenario_count_as_given():
    base = of_text(BASE)
    quiet = base.tracker.model_copy(update={"position_um": 5.0})
    scenario = base.model_copy(update={"tracker": quiet})
    assert changed(scenario, {"seed": 3}).tracker.position_um == 5.0
    assert changed(base, {"seed": 3}).tracker.position_um == 17.5
    assert parse_scenario(dump_scenario(scenario), where="x").tracker == quiet


def test_a_change_leaves_what_it_was_given_alone():
    base, truth = of_text(BASE), {"preset": "soft"}
    before = deepcopy(base.given)
    changed(base, {"truth": truth, "truth.harmonic_mdeg": 1.0})
    assert truth == {"preset": "soft"}
    assert base.given == before
    with pytest.raises(
        InputError, match=r'"trial\.0\.poses" cannot be changed: trial is not a table'
    ):
        changed(base, {"trial.0.poses": 3})


@pytest.mark.parametrize("tracker", TRACKERS)
@pytest.mark.parametrize("robot", robot_names())
def test_kinds_of_robots_in_a_study_are_those_of_their_presets(robot, tracker):
    """Whatever way the scenario of the study was come by."""
    base = of_text(BASE)
    scenario = changed(base, {"robot": robot, "tracker.preset": tracker, "truth.thermal_k": 9.0})
    for truth in TRUTHS:
        if (robot, truth) != ("kuka_iiwa7", "unmodelled"):
            named = having(("robot", robot), ("tracker.preset", tracker), ("truth.preset", truth))
            assert truth_of_kind(scenario, truth) == of_text(named).truth


def test_another_seed_on_the_command_line_keeps_what_was_given(tmp_path):
    file = tmp_path / "base.toml"
    for text in ("\n".join(toml_lines(BASE)), dump_scenario(of_text(BASE))):
        file.write_text(text, encoding="utf-8")
        scenario, _ = scenario_of_command(str(file), 8)
        assert scenario == of_text(BASE | {"seed": 8})


def play(out, scenario, **options):
    fake = Fake()
    return play_run(scenario, out, studies=(fake,), derive=fake.derive, **options)


def test_run_folders_of_older_versions_open_and_go_on(tmp_path):
    """Theirs say nothing of what was given, and their preset may be a mere label."""
    scenario = load_scenario("quick")
    label = old(dump_scenario(scenario)).replace(preset("rigid"), preset("wen2022"))
    mislabelled = scenario.model_copy(
        update={"truth": scenario.truth.model_copy(update={"preset": "wen2022"})}
    )
    for name, what, text in (
        ("run", scenario, old(dump_scenario(scenario))),
        ("label", mislabelled, label),
    ):
        folder = tmp_path / name
        play(folder, what)
        expected = content(folder)
        (folder / layout.SCENARIO).write_text(text, encoding="utf-8")
        opened = load_scenario(folder, finished=True)
        assert opened.document() == what.document()
        (folder / layout.RESULT).unlink()
        rederive(folder, (layout.RESULT,), studies=(Fake(),), derive=Fake().derive)
        assert content(folder)[layout.RESULT] == expected[layout.RESULT]
        manifest = json.loads((folder / layout.MANIFEST).read_text())
        robot = load_robot(what.robot)
        assert manifest["scenario_sha256"] == scenario_hash(opened, robot)
        outcome = play(folder, opened, resume=True)
        assert set(outcome.kept) == set(outcome.records.values)
        kept = {path: data for path, data in content(folder).items() if path != layout.SCENARIO}
        assert kept == {p: data for p, data in expected.items() if p != layout.SCENARIO}
        assert tomllib.loads((folder / layout.SCENARIO).read_text())["origin"]
    with pytest.raises(
        InputError, match=r'preset is "wen2022", but gravity_mdeg and harmonic_mdeg'
    ):
        parse_scenario(label, where="x")
    # an edited one is still refused, by its hash
    lie = edited(dump_scenario(scenario), (preset("rigid"), preset("wen2022")))
    for text in (label, lie):
        (tmp_path / "run" / layout.SCENARIO).write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=r"was changed since the run"):
            load_run(tmp_path / "run", studies=(Fake(),))
