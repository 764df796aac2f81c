"""The shipped scenes and scripts: their headline numbers, and what they must show."""

import importlib.util
import json
import re
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import truebed
from testbed.assets import scenes
from testbed.report.page import render
from testbed.run.derive import page_of
from testbed.run.play import play_run
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.versions import all_versions
from tests.golden.write import BY_HAND, LONG, SCENES, golden_file, headline, headline_of, played
from tests.reported import printed_pages, said_twice, words

TOLERANCE = 1e-6
"""Relative. A fit ends within 1e-8 standard deviations of the optimum, and other BLAS kernels leave
1e-9 in a pose set's index; the replicated statistics divide such differences by small numbers."""
UNSTABLE = ("certificate", "p_value", "sentence", "reasons")
"""The certificate is rounding itself; the texts hold rounded numbers."""

MOST_WORDS = {"quick": 1800, "wen2022": 3500}
"""That a report may have, folded sections and notes included."""
MOST_PAGES = 5
"""Of A4, where a browser is there to print."""
MORE_PAGES = {"wen2022": 7}
"""Of the scene that examines a paper claim by claim on its own robot."""
PLANS = ("plan_tx60",)
"""Scenes made for `truebed plan`, which knows no truth; test_plan*.py look at them."""


@cache
def golden(scene):
    """The golden headline of a scene; that a scene plays to it is a test of its own."""
    return json.loads(golden_file(scene).read_text(encoding="utf-8"))


def differences(golden, now, path=""):
    """Sentences, one per number that moved."""
    if isinstance(golden, dict):
        assert isinstance(now, dict)
        missing = sorted(set(golden) ^ set(now))
        found = [f"{path}: only on one side: {', '.join(missing)}"] if missing else []
        for key in sorted(set(golden) & set(now)):
            if key not in UNSTABLE:
                found += differences(golden[key], now[key], f"{path}/{key}")
        return found
    if isinstance(golden, list) and isinstance(now, list) and len(golden) == len(now):
        pairs = enumerate(zip(golden, now, strict=True))
        return [one for k, pair in pairs for one in differences(*pair, f"{path}[{k}]")]
    if isinstance(golden, float) and isinstance(now, float):
        close = abs(now - golden) <= TOLERANCE * max(abs(golden), abs(now), 1e-12)
        return [] if close else [f"{path}: {golden!r} became {now!r}"]
    return [] if golden == now else [f"{path}: {golden!r} became {now!r}"]


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(scene, marks=() if scene == "quick" else pytest.mark.scene)
        for scene in SCENES
        if scene not in BY_HAND
    ],
)
def test_headline_numbers_are_the_golden_ones(scene, tmp_path):
    campaign = played(scene)
    assert differences(golden(scene), headline(campaign)) == []
    page = render(page_of(campaign, all_versions()))
    assert printed_pages(page, tmp_path) <= MORE_PAGES.get(scene, MOST_PAGES)
    if scene in MOST_WORDS:
        assert words(page) <= MOST_WORDS[scene]
        assert said_twice(page) == []


@pytest.mark.study
@pytest.mark.parametrize("scene", BY_HAND)
def test_headline_numbers_of_a_long_scene_are_the_golden_ones(scene, tmp_path):
    campaign = played(scene)
    assert differences(golden(scene), headline(campaign)) == []
    assert printed_pages(render(page_of(campaign, all_versions())), tmp_path) <= MOST_PAGES


@pytest.mark.scene
def test_the_smallest_sets_of_a_long_scene_have_the_golden_numbers():
    """A trial's numbers do not depend on the others, except those about all of them together."""
    whole, part = golden("pose_sets"), headline_of("pose_sets", poses=15)
    names = set(part["trials"])
    assert names == {name for name, trial in whole["trials"].items() if trial["poses"] == 15}

    def of_one(table):
        rows = {name: table[name] for name in sorted(names & set(table))}
        return json.loads(json.dumps(rows), object_hook=without_family)

    def without_family(row):
        return {k: v for k, v in row.items() if k not in ("joint_ci_95", "outcome")}

    for now, then in (
        (part["trials"], whole["trials"]),
        (part["random_sets"], whole["random_sets"]),
        (part["population"]["trials"], whole["population"]["trials"]),
    ):
        assert of_one(now)
        assert differences(of_one(then), of_one(now)) == []


def test_a_trial_of_a_scene_that_only_a_study_plays_has_the_golden_statement():
    """Its file is played again where a statement moves: such a move was once left to the study."""
    name = "best-of-random-29"  # guarded by held-out errors
    scenario = load_scenario("pose_sets_rigid")
    trial = [one for one in scenario.document()["trial"] if one["name"] == name]
    fewer = {"trial": trial, "studies.population": 0, "uncertainty.replications": 2}
    now = headline(play_run(changed(scenario, fewer)).campaign)["trials"][name]
    then = golden("pose_sets_rigid")["trials"][name]
    stated = [one["estimates"]["whitened"]["statement"] for one in (then, now)]
    assert differences(*stated) == []
    # texts hold rounded numbers: none of these is so near a half that BLAS kernels round it apart
    assert stated[0]["trust"]["reasons"] == stated[1]["trust"]["reasons"]


def test_every_shipped_scene_has_a_golden_file_or_is_a_plan_or_another_with_more_robots():
    shipped = {file.stem for file in scenes().glob("*.toml")}
    assert shipped - set(SCENES) == {*PLANS, "million"}
    few, many = load_scenario("coverage"), load_scenario("million")
    kinds = ("rigid", "wen2022", "soft", "unmodelled")
    more = {"coverage.robots": 250_000, "coverage.truths": kinds}
    assert changed(few, {"name": many.name, "title": many.title} | more) == many


@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_has_its_line_in_the_scenes_readme(scene):
    text = (scenes() / "README.md").read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if line.startswith(f"| `{scene}`"))
    first = golden(scene)["trials"][load_scenario(scene).trial[0].name]["estimates"]["whitened"]
    before, after = (first[f"held_out_{when}"]["mean_mm"] for when in ("before", "after"))
    stated = re.search(r"mean held-out error ([0-9.]+) -> ([0-9.]+) mm", line)
    for text, value in zip(stated.groups(), (before, after), strict=True):
        assert text == f"{value:.{len(text.split('.')[1])}f}"


def test_designed_sets_beat_every_random_set_in_their_own_index():
    for scene in SCENES:
        for name, sets in golden(scene).get("random_sets", {}).items():
            if golden(scene)["trials"][name]["method"] == "best_of_random":
                # one of a hundred like those it is compared with
                assert sets["beaten"] > 90, (scene, name)
                continue
            assert sets["beaten"] == sets["of"] == 100, (scene, name)


def test_what_is_believed_holds_on_a_rigid_robot_and_where_the_joints_sag():
    quick, paper = golden("quick"), golden("wen2022")
    for trial in quick["trials"].values():
        assert trial["estimates"]["whitened"]["believable"]
        # unweighted rows claim 12 m - p degrees of freedom and the wrong weights
        assert not trial["estimates"]["paper"]["believable"]
    for trial in paper["trials"].values():
        found = trial["estimates"]["whitened"]
        assert found["p_value"] < 1e-3
        assert found["statement"]["trust"]["refuted"]
        # the parameters alone hold next to nothing, the region with the misfit in it all
        shares = found["statement"]["statements"]
        assert shares["parameters"]["attained"] < 0.1
        assert shares["region"]["attained"] > 0.95
        assert found["statement"]["guards"] == 50
        assert found["believable"]
    assert "with 95 % probability (3-D radius" in paper["verdict"]["sentence"]
    assert "can be believed" in quick["verdict"]["sentence"]


def test_the_pose_sets_are_the_same_on_both_kinds_of_robots_and_promise_the_same():
    """The promise comes from the nominal robot; whether it is kept depends on the true ones."""
    soft, rigid = (golden(scene)["population"]["trials"] for scene in LONG)
    kept = []
    for name, trial in soft.items():
        u = trial["promised_u_3d_rms_mm"]
        assert u == pytest.approx(rigid[name]["promised_u_3d_rms_mm"], rel=1e-12)
        assert trial["whitened"]["rms_mm"] > 3 * u
        kept.append(rigid[name]["whitened"]["rms_mm"] / u)
    # over 8 robots the rms of one set scatters by 10 to 15 %, independently of the other 26 sets:
    # their mean by 3 %, three of those
    assert np.mean(kept) == pytest.approx(1.0, abs=0.09)


def test_one_reflector_tells_27_numbers_apart():
    for trial in golden("position_only")["trials"].values():
        assert trial["estimates"]["whitened"]["rank"] == 27


def test_wen2022_repeats_the_printed_tool_point_figures():
    """Zero pose, u of |P|: 0.0030 mm from Table 3 (the printed 0.0034 is a misprint) and 0.031."""
    figures = golden("wen2022")["tool_point"]
    best, random = figures["table 3 best"], figures["table 3 random"]
    # 10 000 draws leave 0.7 % in a standard deviation; 2 % is three of those
    assert best["zero_pose_u_distance_mm"] == pytest.approx(0.00295, rel=0.02)
    assert random["zero_pose_u_distance_mm"] == pytest.approx(0.0314, rel=0.02)
    ratio = best["held_out_mean_u_distance_mm"] / random["held_out_mean_u_distance_mm"]
    assert ratio == pytest.approx(0.106, abs=0.003)
    # what |P| hides
    assert best["zero_pose_u_3d_mm"] == pytest.approx(0.0173, rel=0.02)
    assert random["zero_pose_u_3d_mm"] == pytest.approx(0.1568, rel=0.02)


def test_wen2022_pose_numbers_lie_where_the_rule_scatters():
    # one repetition of the rule: on the unfiltered pool 24 of them gave 47 to 60 and 18 to 52, and
    # tests/calib/test_pose_count.py holds their medians against 52 to 60 and 25 to 36; collisions
    # and sight move a single one by a few poses more
    counts = golden("wen2022")["pose_count"]
    assert 45 <= counts["O1_poses"] <= 65
    assert 18 <= counts["O2_poses"] <= 52


def test_the_readmes_say_where_the_sets_of_the_paper_stand_among_random_ones():
    figures = golden("wen2022")["random_calibrations"]
    text = (scenes() / "README.md").read_text(encoding="utf-8")
    for trial, sets in figures.items():
        own = sets["paper"]
        spread = own["random_held_out_mean_mm"], own["random_held_out_sd_mm"]
        assert f"{spread[0]:.3f} ± {spread[1]:.3f} mm ({sets['poses']} poses" in text
        assert f"{trial} is better than {own['better_than']}" in text
        assert f"{own['held_out_mm']:.3f} mm ({trial})" in text
        assert own["sets"] == 100
    front = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    first, second = (figures[name]["paper"]["better_than"] for name in ("best-61", "best-29"))
    said = (
        f"the designed set of 61 poses is better than {first} of 100 random sets of its size, and "
        f"the set of 29 poses better than {second} (at five other seeds"
    )
    assert said in " ".join(front.split())


def script(name):
    """A scenario script as a module."""
    spec = importlib.util.spec_from_file_location(name, scenes() / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_script_noise_sweep_error_and_statement_grow_with_the_noise():
    made = script("noise_sweep")
    made.NOISE_UM = made.NOISE_UM[::3]  # the smallest and the largest
    rows = np.array(made.sweep(replications=2))
    assert (np.diff(rows[:, 1:3], axis=0) > 0).all()
    # a linear problem: u is proportional to the noise
    assert rows[:, 2] / rows[:, 0] == pytest.approx(rows[0, 2] / rows[0, 0], rel=1e-3)


@pytest.mark.slow
def test_script_dwell_who_waits_comes_nearer_to_rest():
    made = script("dwell")
    made.ARMS, made.KINDS, made.AT_REST_S = {"fast": made.ARMS["fast"]}, made.KINDS[:2], 3.0
    (*_, damped), (*_, swinging) = made.table(robots=1, poses=3)
    assert damped.shape == (1, len(made.DWELLS_S) + 1, 3)
    at_once, *_, after_1_s, other_side = damped.mean(axis=(0, 2))
    assert at_once > 20
    assert after_1_s < 1
    assert other_side > 3
    assert swinging[:, 1:4].mean() > damped[:, 1:4].mean()  # 0.1 to 0.5 s


@pytest.mark.slow
def test_script_own_robot_is_calibrated(tmp_path):
    campaign = script("own_robot").calibrate(Path(tmp_path))
    estimate = campaign.trials[0].estimates[0]
    # 4 R + 2 P + 6 of a generic chain, for 3 revolute and 1 prismatic joint
    assert estimate.identification.rank == 4 * 3 + 2 * 1 + 6
    found = estimate.comparison
    assert found.accuracy_after.mean < 0.1 * found.accuracy_before.mean


@pytest.mark.slow
def test_script_own_method_finds_the_design_ahead_of_random(monkeypatch):
    made = script("own_method")

    def few(name, changes):
        return truebed.laboratory(name, changes | {"pool.size": 150})

    monkeypatch.setattr(made, "truebed", SimpleNamespace(laboratory=few))
    # 16 % on average, and 20 % more or less from robot to robot: of 12 robots 2.7 standard errors
    errors = made.contest(robots=12)
    assert errors["DETMAX"].mean() < errors["random"].mean()


def test_scripts_stay_short():
    for file in scenes().glob("*.py"):
        assert len(file.read_text(encoding="utf-8").splitlines()) <= 75, file.name
    assert load_scenario("quick").name == "quick"
