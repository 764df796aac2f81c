"""Any folder for any verb that looks: it does what it can, or says what the folder is."""

import json
import shutil
from pathlib import Path

import pytest

import truebed
from calib.errors import InputError
from testbed.cli import handout, viewer
from testbed.cli.compared import COLUMNS, columns, document, figure
from testbed.cli.measured import folder_of
from testbed.store.npz import pretty_json
from tests.command import call

VERBS = ("view", "report", "record", "compare")
PLANNED = {
    "format": 1, "scenario": "small", "robot": "staubli_tx60", "poses": 18, "duration_s": 174.3,
    "predicted": {"R95_over_goal_um": 26.74, "R95_worst_um": 29.4, "misfit_seen_um": 9.26},
    "certificate": {"efficiency": 0.9325791},
}  # fmt: skip
MEASURED = {
    "format": 1, "kind": "calibration", "session": "spring", "robot": "arm", "model": "extended",
    "split": {"train_poses": 61, "held_out_poses": 20},
    "before": {"held_out": {"mean_mm": 0.385}},
    "models": {"extended": {"held_out": {"mean_mm": 0.0927, "p95_mm": 0.1657}}},
    "statements": {"R95_mean_um": 216.3, "guards": 0}, "verdict": {"believable": True},
}  # fmt: skip
TESTED = {
    "format": 1, "test": "cycles", "data": {"cycles": 30}, "verdict": {"decision": None},
    "figures": {"AP": {"P1": {"value_um": 12.0}, "P2": {"value_um": 15.0}}},
}  # fmt: skip
VERSIONS = {"versions": {"truebed": "0"}}
ABOUT = {"format": 1, "kind": "calibration", "input_sha256": "0", **VERSIONS}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """One folder of each kind below `runs`, but for a campaign."""
    monkeypatch.chdir(tmp_path)
    files = {
        "runs/plan/plan.json": PLANNED, "runs/plan/plan.rrd": "",
        "runs/ident/result.json": MEASURED, "runs/ident/manifest.json": ABOUT,
        "runs/iso/iso9283.csv": "", "runs/iso/result.json": TESTED, "robot/robot.toml": "",
        "data/session.toml": "", "empty/any.txt": "", "runs/.hidden/plan.json": PLANNED,
        "none/.hidden": "", "begun/scenario.toml": "", "runs/ident/trials/a.npz": "",
        **{f"tables/{name}.csv": "" for name in "abcde"},
    }  # fmt: skip
    for name, content in files.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        data = content.encode() if isinstance(content, str) else pretty_json(content)
        Path(name).write_bytes(data)
    return tmp_path


SAYS = {
    "data": "data: holds measurements to identify a robot from; truebed identify ROBOT data. [D42]",
    "robot": "robot: is the folder of a robot; truebed robots robot/robot.toml. [D42]",
    "empty": "empty: is not a run folder: it holds any.txt; give a folder that truebed "
    "wrote. [D42]",
    "none": "none: is not a run folder: it is empty; give a folder that truebed wrote. [D42]",
    "tables": "tables: is not a run folder: it holds a.csv, b.csv, c.csv, d.csv and 1 more; to "
    "calibrate from measurements, type truebed new session tables/a.csv. [D42]",
    "begun": "begun: is not a run folder: it holds scenario.toml; to play its scenario, type "
    "truebed run begun/scenario.toml --out NEW_FOLDER. [D42]",
    "runs/ident/trials": "runs/ident/trials: is not a run folder: it lies inside runs/ident, a run "
    "folder; give runs/ident. [D42]",
    "runs/iden": 'runs/iden: does not exist; did you mean "runs/ident"? [D42]',
    "runs/paln": 'runs/paln: does not exist; did you mean "runs/plan"? [D42]',
    "plan": 'plan: does not exist; did you mean "runs/plan"? [D42]',
    "qqq": "qqq: does not exist; check the path; truebed run SCENE writes one. [D42]",
    "empty/any.txt": "empty/any.txt: is a file; folders are wanted; give a folder that truebed "
    "wrote. [D42]",
    "runs/ident/result.json": "runs/ident/result.json: is a file; folders are wanted; give the "
    "folder it lies in: runs/ident. [D42]",
}


@pytest.mark.parametrize("folder", SAYS)
@pytest.mark.parametrize("verb", VERBS)
def test_a_folder_that_no_verb_can_show_is_told_with_the_way_out(verb, folder, here):
    done = call(verb, folder)
    assert (done.exit_code, done.stdout, done.stderr) == (2, "", f"{SAYS[folder]}\n")


@pytest.mark.parametrize("folder", ["none", "tables", "begun", "runs/ident/trials"])
def test_a_script_is_told_the_same(folder, here):
    with pytest.raises(InputError) as caught:
        truebed.load(folder)
    assert str(caught.value) == SAYS[folder]


IDENTIFIES = {
    "runs/campaign": "runs/campaign: is a run folder, which holds no measurement files; a table, "
    "or a folder with session.toml; truebed run runs/campaign --out runs/campaign --resume "
    "--export FOLDER writes them. [S38]",
    "runs/plan": "runs/plan: is a plan's folder: what is to be measured, not what was; a table, or "
    "a folder with session.toml; give the table of what was measured at its poses. [S38]",
    "runs/ident": "runs/ident: is the folder of a calibration already; a table, or a folder with "
    "session.toml; give the files it was made from. [S38]",
    "page.csv": "page.csv: is a page of HTML or XML; measurements are read from text only, and "
    "nothing is unpacked; save the table as CSV. [S39]",
    "tables": "tables: has no session.toml: it holds a.csv, b.csv, c.csv, d.csv and 1 more; a "
    "table, or a folder with session.toml; to calibrate from measurements, type truebed new "
    "session tables/a.csv. [S38]",
    "runs/plan/plan.jsn": 'runs/plan/plan.jsn: does not exist; did you mean "runs/plan/plan.json"? '
    "[M35]",
    "nowhere/a.csv": "nowhere/a.csv: does not exist; there is no folder nowhere. [M35]",
}  # fmt: skip


@pytest.mark.parametrize("data", IDENTIFIES)
def test_identify_says_what_it_was_given_instead_of_measurements(data, here):
    Path("runs/campaign").mkdir()
    Path("page.csv").write_text("<!DOCTYPE html><html><body>Log in</body></html>\n")
    about = {"format": 1, "scenario_sha256": "0", **VERSIONS}
    Path("runs/campaign/manifest.json").write_bytes(pretty_json(about))
    done = call("identify", "staubli_tx60", data, "--out", "out")
    assert (done.exit_code, done.stdout, done.stderr) == (2, "", f"{IDENTIFIES[data]}\n")
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("word", "meant"),
    [("UR10", "universal_ur10"), ("ur", "universal_ur10"), ("TX-60", "staubli_tx60"),
     ("Stäubli", "staubli_tx60"), ("kuka", "kuka_iiwa7"), ("iwa7", "kuka_iiwa7")],
)  # fmt: skip
def test_a_robot_is_known_by_a_part_of_its_name(word, meant, here):
    for words in (("robots", word), ("identify", word, "a.csv"), ("new", "scene", word)):
        assert f'did you mean "{meant}"? [S37]' in call(*words).stderr
    said = call("robots", "abc").stderr
    assert said.endswith("there is kuka_iiwa7, staubli_tx60, universal_ur10. [S37]\n")
    assert 'did you mean "robot/robot.toml"?' in call("robots", "robot/robt.toml").stderr


@pytest.mark.parametrize(
    ("scene", "told"),
    [
        ("tables/a.csv", "tables/a.csv is a table, and a scenario is a .toml; to calibrate from "
         "measurements, type truebed new session tables/a.csv. [S37]"),
        ("arm.urdf", "arm.urdf is the description of a robot, and a scenario is a .toml; to begin "
         "a scenario for it, type truebed new scene arm.urdf. [S37]"),
        ("empty", "empty has no scenario.toml: it holds any.txt; give a folder that truebed wrote. "
         "[S37]"),
        ("UR10", "to begin one for a robot, type truebed new scene universal_ur10. [S37]"),
    ],
)  # fmt: skip
def test_what_is_no_scene_is_told_with_the_way_on(scene, told, here):
    Path("arm.urdf").write_text("<robot/>")
    for verb in ("run", "plan"):
        done = call(verb, scene)
        assert (done.exit_code, done.stderr.endswith(f"{told}\n")) == (2, True), done.stderr


def test_a_scene_is_known_by_a_part_of_its_name_or_path(here):
    assert 'did you mean "position_only"?' in call("run", "position").stderr
    assert 'did you mean "begun/scenario.toml"?' in call("run", "begun/scenari.toml").stderr


@pytest.mark.parametrize("verb", VERBS[:3])
def test_a_folder_of_several_names_them(verb, here):
    done = call(verb, "runs")
    assert done.exit_code == 2
    assert done.stderr == (
        "runs: holds 3 folders of truebed; give one of them: runs/ident, runs/iso, runs/plan. "
        "[D42]\n"
    )


def test_what_was_written_whole_is_not_made_again(here):
    said = call("report", "runs/iso").stderr
    assert "not made again; open runs/iso/report.html, or type truebed view runs/iso" in said
    for verb in ("report", "record"):
        assert "runs/plan/plan_report.html, or type truebed view" in call(verb, "runs/plan").stderr


def test_a_plan_and_a_test_are_viewed_as_a_run_is(here, monkeypatch):
    seen = []
    monkeypatch.setattr(viewer, "open_viewer", lambda file, _: seen.append(file))
    assert call("view", "runs/plan").exit_code == call("view", "runs/iso").exit_code == 0
    assert seen == [Path("runs/plan/plan.rrd"), Path("runs/iso/iso9283.rrd")]
    # one that an older version wrote has no record to make it from
    assert (
        "test.npz: cannot be read, and older versions wrote none"
        in call("record", "runs/iso").stderr
    )
    refused = call("view", "runs/plan", "--trial", "a")
    assert refused.exit_code == 2
    assert "which has no trials; leave --trial out. [C41]" in refused.stderr


@pytest.mark.parametrize(
    ("folder", "told"),
    [
        # what is certified is rounded down, as in the report of the plan
        ("runs/plan", ["small", "18", "174", "26.7", "29.4", "0.932"]),
        ("runs/ident", ["spring", "extended", "61", "20", "0.3850", "0.0927", "216", "yes", "0"]),
        ("runs/iso", ["cycles", "30", "15"]),
    ],
)
def test_folders_of_a_kind_stand_in_one_table(folder, told, here):
    shutil.copytree(folder, "second")
    done = call("compare", folder, "second")
    assert done.exit_code == 0
    assert all(done.stdout.count(f" {word}") >= 2 for word in told)
    printed = json.loads(call("compare", folder, "--json").stdout)
    assert list(printed["runs"]) == [folder]


def test_a_folder_of_several_kinds_has_a_table_of_each(here):
    done = call("compare", "runs")
    assert done.exit_code == 0
    titles = ("What plans promise", "Tests after ISO 9283", "Calibrations")
    assert all(done.stdout.count(title) == 1 for title in titles)
    assert "Equal" not in done.stdout
    printed = json.loads(call("compare", "runs", "--json").stdout)
    assert sorted(printed["runs"]) == ["runs/ident", "runs/iso", "runs/plan"]


@pytest.mark.parametrize("kind", COLUMNS)
def test_a_document_without_a_figure_has_a_dash(kind):
    for broken in ({}, {"predicted": 3, "figures": {"AP": {"P1": "x"}}, "model": ["a"]}):
        _, (row,) = columns(kind, [broken])
        assert set(row) == {"-"}


def test_a_folder_without_its_figures_is_refused_in_a_sentence(here):
    Path("runs/ident/result.json").unlink()
    done = call("compare", "runs/ident")
    assert done.exit_code == 2
    assert done.stderr.startswith("runs/ident: has no result.json: what wrote it was not finished")
    assert done.stderr.endswith("[D42]\n")
    assert done.stderr.count("\n") == 1


def test_a_damaged_file_is_told(here):
    Path("runs/plan/plan.json").write_text("{")
    done = call("compare", "runs/plan")
    assert done.exit_code == 2
    assert "runs/plan/plan.json" in done.stderr
    assert figure({"a": 1}, "a/b") is None
    assert document("iso9283", Path("runs/iso"))["test"] == "cycles"


@pytest.mark.parametrize(("folder", "name"), [("plan", "plan_report"), ("iso", "report")])
def test_the_report_of_a_plan_or_a_test_is_printed_as_it_was_written(
    folder, name, here, monkeypatch
):
    monkeypatch.setattr(handout, "require_browser", lambda: "printer")
    monkeypatch.setattr(handout, "print_pdf", lambda page, by: page.with_suffix(f".{by}"))
    page = Path("runs", folder, f"{name}.html")
    assert (
        f"{page}: is not there; plan or test again" in call("report", page.parent, "--pdf").stderr
    )
    page.write_text("written")
    done = call("report", page.parent, "--pdf")
    assert (done.exit_code, done.stdout) == (0, f"runs/{folder}/{name}.printer\n")
    assert page.read_text() == "written"
    assert "not made again" in call("report", page.parent, "--pdf", "--embed").stderr


def test_what_is_made_of_the_folder_one_stands_in_has_its_name(tmp_path, monkeypatch):
    (tmp_path / "cell" / "spring").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "cell" / "spring")
    names = [str(folder_of(Path(data), "identified")) for data in (".", "..", "a.csv")]
    assert names == [f"runs/{name}-identified" for name in ("spring", "cell", "a")]


@pytest.mark.parametrize(
    "words",
    [
        ["run", "quick", "--out", "runs/ident", "--resume"],
        ["merge", "runs/ident", "runs/plan", "--out", "new"],
    ],
)
def test_a_run_does_not_go_on_in_the_folder_of_something_else(words, here):
    done = call(*words)
    assert done.exit_code == 2
    assert "runs/ident: holds a calibration, not a campaign; " in done.stderr
    assert not (here / "new").exists()


def test_a_column_of_micrometers_is_one_of_millimeters_where_its_largest_asks_for_it():
    one, other = ({"statements": {"R95_mean_um": R95}} for R95 in (412.0, 4310.0))
    place = list(COLUMNS["calibration"]).index("R95 um")
    for found, head, cells in (
        ([one], "R95 um", ["412"]),
        ([one, other, {}], "R95 mm", ["0.412", "4.31", "-"]),
        ([{"statements": {"R95_mean_um": 999.6}}], "R95 mm", ["1.00"]),
    ):
        heads, rows = columns("calibration", found)
        assert heads[place] == head
        assert [row[place] for row in rows] == cells
