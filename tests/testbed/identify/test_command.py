"""The verb `identify`: a campaign exported and read again is the same, bit for bit; clean ends."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from testbed.identify.folder import load_calibration
from testbed.robots.catalog import load_robot
from testbed.run import play as runner
from testbed.run.export import export_campaign
from testbed.run.play import play_run
from testbed.scenario.read import changed, dump_scenario
from testbed.studies import load_scenario, scenario_of
from tests.command import call
from tests.testbed.files.made import columns, csv, made, with_spread
from tests.testbed.studies.trial.fake_campaign import SCENARIO, Fake, campaign_of

SMALL = {
    "pool.size": 60,
    "test.poses": 20,
    "uncertainty.repeats": 2,
    "uncertainty.replications": 0,
    "studies.random_sets": 0,
    "identification.estimators": ["whitened"],
    "trial": [{"name": "only", "poses": 24, "method": "random"}],
}

URDF = load_robot("staubli_tx60").folder / "staubli_tx60.urdf"


@cache
def campaign():
    """A rigid robot, 24 random poses, 20 held out."""
    return play_run(changed(load_scenario("quick"), SMALL)).campaign


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("command") / "files"
    export_campaign(campaign(), load_robot("staubli_tx60"), folder)
    return folder


@pytest.fixture(scope="module")
def done(exported):
    out = exported.parent / "out"
    return out, call("identify", URDF, exported / "session.toml", "--out", out)


def test_what_was_exported_gives_the_same_parameters_as_the_run(done):
    out, result = done
    assert result.exit_code == 0
    found, _ = load_calibration(out)
    ours = campaign().trials[0].estimates[0].identification
    theirs = found.fit.identification
    assert theirs.names == ours.names
    # the same numbers to the last bit: 17 digits, the same rows, the same start
    np.testing.assert_allclose(theirs.step, ours.step, rtol=0, atol=1e-12)
    chains = theirs.model.chain, ours.model.chain
    for name in ("links", "T_world_base", "T_flange_tool"):
        np.testing.assert_allclose(*(getattr(one, name) for one in chains), rtol=0, atol=1e-12)
    np.testing.assert_allclose(theirs.covariance, ours.covariance, rtol=1e-9)
    assert int(found.split.is_test.sum()) == 20
    assert found.source.simulated


def test_the_command_says_what_came_out_and_what_to_type_next(done):
    out, result = done
    lines = result.stdout.splitlines()
    assert lines[0] == "SIMULATED - not a calibration certificate"
    assert any(line.startswith("Verdict: The mean position error on 20 held-out") for line in lines)
    own = Path("robot") / "staubli_tx60_corrected.urdf"
    assert lines[-2:] == [
        f"Your URDF  {out / own}  in place of {URDF}",
        f"Next       truebed view {out}",
    ]
    assert (out / own).is_file()
    assert json.loads((out / "result.json").read_bytes())["delivered"]["urdf"] == str(own)
    assert f"{own}: your own URDF with corrected origins." in (out / "report.html").read_text()
    assert result.stderr.splitlines()[-1].startswith("done in ")


def test_report_record_and_compare_know_the_folder(done, tmp_path):
    out, _ = done
    before = (out / "report.html").read_bytes()
    (out / "report.html").unlink()
    assert call("report", out).exit_code == 0
    assert (out / "report.html").read_bytes() == before
    (out / "campaign.rrd").unlink()
    assert call("view", out, "--picture", tmp_path / "a.png").exit_code == 2  # no recording
    assert call("record", out).exit_code == 0
    assert (out / "campaign.rrd").is_file()
    compared = call("compare", out, out)
    assert compared.exit_code == 0
    assert compared.stdout.startswith("Calibrations")
    assert re.search(r"R95 um +relative +believed +guarded by\n", compared.stdout)
    figures = json.loads((out / "result.json").read_bytes())
    after = figures["models"][figures["model"]]["held_out"]["mean_mm"]
    assert f"{after:.4f}" in compared.stdout
    assert f"{figures['statements']['R95_mean_um']:.3g}" in compared.stdout


def test_bad_words_end_with_code_2_and_leave_nothing(exported, done, tmp_path):
    data = exported / "session.toml"
    out = tmp_path / "new"
    for words, told in (
        ((tmp_path / "none.csv",), "none.csv"),
        ((data, "--train", "3"), "--train is given, but the data say which poses are held out"),
        ((data, "--model", "best"), '--model is "best"'),
        ((data, "--test", tmp_path / "none.csv"), "none.csv"),
        ((data, "--test", data, "--held-out", "0"), "--held-out is given beside --test; leave"),
        ((data, "--test", data, "--train", "9"), "--train is given beside --test; leave"),
        ((data, "--program", tmp_path / "none.csv"), "none.csv"),
    ):
        result = call("identify", "staubli_tx60", *words, "--out", out)
        assert (result.exit_code, told in result.stderr) == (2, True), (words, result.stderr)
        assert not out.exists()
    assert call("identify", "staubli_tx61", data, "--out", out).exit_code == 2
    there = call("identify", "staubli_tx60", data, "--out", done[0], "--json")
    error = json.loads(there.stdout)["error"]
    assert (there.exit_code, error["code"]) == (2, "C40")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_another_table_judges_what_one_identifies(tmp_path):
    """With --test, all rows of the first and none of the second are identified from."""
    data = made(m=40)
    table = with_spread(columns(data, form="none"), turn=False)
    for name, rows in (("a", slice(0, 30)), ("b", slice(30, 40))):
        (tmp_path / f"{name}.csv").write_text(csv({k: v[rows] for k, v in table.items()}))
    out = tmp_path / "out"
    done = call("identify", "staubli_tx60", tmp_path / "a.csv", "--test", tmp_path / "b.csv",
                "--json", "--model", "geometric", "--out", out)  # fmt: skip
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    assert told == json.loads((out / "result.json").read_bytes())
    assert (told["split"]["train_poses"], told["split"]["held_out_poses"]) == (30, 10)
    assert set(told["files_sha256"]) == {"a.csv", "b.csv"}
    robot = load_robot(out / "robot").model.poses(data.q[30:])[:, :3, 3]
    off = np.linalg.norm(robot - data.T[30:, :3, 3], axis=1).mean() * 1e3
    # to the digits of the file
    assert told["models"]["geometric"]["held_out"]["mean_mm"] == pytest.approx(off, abs=1e-4)


def test_run_hands_its_campaign_to_the_export(monkeypatch, tmp_path):
    handed = []
    monkeypatch.chdir(tmp_path)
    fake = Fake()
    monkeypatch.setattr(runner, "all_studies", lambda _: (fake,))
    monkeypatch.setattr(runner, "derived_file", fake.derive)
    monkeypatch.setattr("testbed.studies.trial.records.campaign_of", campaign_of)

    def export(_campaign, robot, folder, **_):
        handed.append((robot.name, folder))

    monkeypatch.setattr("testbed.run.export.export_campaign", export)
    Path("tiny.toml").write_text(dump_scenario(scenario_of(SCENARIO)), encoding="utf-8")
    result = call("run", "tiny.toml", "--export", "files")
    assert result.exit_code == 0
    assert handed == [("staubli_tx60", Path("files"))]
    assert "Exported   files/session.toml" in result.stdout
    Path("taken").mkdir()
    Path("taken/notes.txt").write_text("mine")
    refused = call("run", "tiny.toml", "--export", "taken", "--out", "other")
    assert refused.exit_code == 2
    assert not Path("other").exists()
