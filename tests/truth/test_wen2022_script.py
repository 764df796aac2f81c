"""The studies of Wen et al. 2022, held to a script that works them out from the files of a run."""

import ast
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtri

from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.information.observability import indices
from calib.information.rank import singular_values
from calib.measurement import tables
from calib.measurement.accuracy import point_distances
from calib.measurement.residual import paper_stack
from calib.uncertainty.monte_carlo import distance_spread
from testbed.run.derive import derived_file
from testbed.run.play import play_run
from testbed.scenario.read import changed
from testbed.store.layout import ARRAYS, RESULT
from testbed.studies import load_scenario
from testbed.studies.wen2022 import paper
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, TX60_LINKS, WEN24, pool_r, tx60
from tests.truth import wen2022_arm as arm
from tests.truth import wen2022_script as script

QUICK = {"uncertainty.replications": 0, "studies.pose_count": False, "studies.random_sets": 0}
"""What these tests do not read; the other numbers do not change by that."""
SMALL = {
    **QUICK,
    "studies.random_sets": 12,
    "pool.size": 160,
    "test.poses": 12,
    "uncertainty.draws": 4000,
}
DESIGNED = {"best-61": "O1", "best-29": "O2"}
TRIALS = (*DESIGNED, "random-61", "random-29")
CALIBRATED = ("indices", "index", "own_before", "own_after", "error")
COVARIANCE = np.diag([SIGMA_POSITION**2] * 3 + [SIGMA_ROTATION**2] * 3)

pytestmark = pytest.mark.truth


def played(folder, changes):
    """The run folder of the paper's scene with some keys changed, without report and recording."""

    def derive(name, records):
        return derived_file(name, records) if name in (RESULT, ARRAYS) else b""

    play_run(changed(load_scenario("wen2022"), changes), folder, derive=derive)
    return script.read_run(folder)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return played(tmp_path_factory.mktemp("paper") / "run", SMALL)


def budgets(run):
    """(u_best, u_random) as recorded, by the trial whose repeats are u_best; the paper's first."""
    record = run.records["paper_budget"]
    names = [record[f"trials.{k}"] for k in range(record["trials.#"])]
    return {name: (u, record["random"]) for name, u in zip(names, record["best"], strict=True)}


def recomputed(run, trial):
    """(u_best, u_random, u_r of the random set) from the repeats and contributors of a run."""
    parts = [run.records["paper_budget"][name] for name in script.CONTRIBUTORS]
    return script.type_a(run.repeated(trial)), script.root_sum_square(*parts), parts[0]


def visits(run, trial):
    """All visits of one trial, measured here again: joints, positions, rotations by visit."""
    places = run.records[trial]["selection.indices"]
    every = range(run.scenario["uncertainty"]["repeats"])
    seen = [script.visit(run, places, "visit", trial, repeat=k) for k in every]
    return [np.array(part) for part in zip(*seen, strict=True)]


def placed(run):
    """Nominal links, and the frames of base and tool by name."""
    links, base, tool = script.nominal(run)
    return links, {"base": base, "tool": tool}


# what the script is made of


@pytest.mark.parametrize("module", [arm, script])
def test_the_script_imports_numpy_and_nothing_of_the_project(module):
    for node in ast.walk(ast.parse(Path(module.__file__).read_text(encoding="utf-8"))):
        names = [node.module] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        for name in names:
            assert name.split(".")[0] in {"numpy", *sys.stdlib_module_names} or name == arm.__name__


def test_two_transcriptions_of_table_3_agree():
    assert arm.NAMES == WEN24
    for column in ("best", "random"):
        printed = paper.table3(f"u_{column}")
        np.testing.assert_allclose(arm.table3(column), printed, rtol=1e-14)


def test_the_jacobian_of_the_script_is_the_complex_step_of_its_poses():
    rng = np.random.default_rng(1)
    links = TX60_LINKS + 0.1 * rng.standard_normal((40, 6, 5))
    q = rng.uniform(-3, 3, (40, 6))
    _, R, J = arm.forward(links, q, slopes=True)
    for k in range(len(arm.NAMES)):
        step = np.zeros(len(arm.NAMES), dtype=complex)
        step[k] = 1e-30j
        p_k, R_k = arm.forward(arm.moved(links.astype(complex), step), q)
        turn = R_k.imag / 1e-30 @ np.swapaxes(R, -1, -2)
        rows = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=-1)
        # products of unit vectors and arms below 2 m
        np.testing.assert_allclose(J[:, :3, k], p_k.imag / 1e-30, atol=1e-14)
        np.testing.assert_allclose(J[:, 3:, k], rows, atol=1e-14)


# the budget


@pytest.mark.parametrize("trial", DESIGNED)
def test_type_a_of_the_stored_repeats_is_the_published_one(run, trial):
    for mode in ("paper", "whitened"):
        u = script.type_a(run.repeated(trial, mode))
        np.testing.assert_allclose(run.arrays[f"{trial}/{mode}/type_a"], u, rtol=1e-9)


def test_the_recorded_budget_and_its_published_ratios_follow_from_repeats_and_contributors(run):
    for trial, recorded in budgets(run).items():
        u_best, u_random, u_r = recomputed(run, trial)
        np.testing.assert_allclose(recorded, [u_best, u_random], rtol=1e-9)
        published = run.result["paper_budget"]["trials"][trial]
        ratios = script.mean_ratio(u_best, u_random), script.mean_ratio(u_best, u_r)
        names = "mean_u_ratio_best_to_random", "mean_u_r_ratio_best_to_random"
        assert [published[name] for name in names] == pytest.approx(ratios, rel=1e-9)


def test_the_headline_is_of_the_set_that_o2_chose_as_in_the_paper(run):
    published = run.result["paper_budget"]
    assert next(iter(budgets(run))) == published["trial"] == "best-29"
    u_best, u_random, u_r = recomputed(run, "best-29")
    names = "mean_u_ratio_best_to_random", "mean_u_r_ratio_best_to_random"
    ratios = script.mean_ratio(u_best, u_random), script.mean_ratio(u_best, u_r)
    assert [published[name] for name in names] == pytest.approx(ratios, rel=1e-9)


def test_the_contributors_of_random_sets_follow_from_the_seed(run):
    for name, u in zip(script.CONTRIBUTORS, script.random_budget(run), strict=True):
        # the package ends a fit 1e-10 of its stated u away; model error makes that 100 times the
        # scatter of repeats
        np.testing.assert_allclose(run.records["paper_budget"][name], u, rtol=1e-7)


@pytest.mark.study
def test_the_ratio_of_the_paper_is_that_of_its_29_poses_in_the_scene_at_full_size(tmp_path):
    run = played(tmp_path / "run", QUICK)
    ratios = {}
    for trial in DESIGNED:
        u_best, u_random, u_r = recomputed(run, trial)
        ratios[trial] = script.mean_ratio(u_best, u_random), script.mean_ratio(u_best, u_r)
    # two digits stated
    assert ratios["best-29"] == pytest.approx((0.37, 1.75), abs=0.005)
    assert ratios["best-61"] == pytest.approx((0.19, 0.87), abs=0.005)


# calibrations


@pytest.mark.parametrize("trial", TRIALS)
def test_every_visit_measured_and_calibrated_again_gives_the_stored_steps_and_errors(run, trial):
    (links, frames), record = placed(run), run.records[trial]
    q, position, rotation = visits(run, trial)
    np.testing.assert_allclose(position[0], record["measurements.position"], atol=1e-14)
    np.testing.assert_allclose(rotation[0], record["measurements.rotation"], atol=1e-14)
    noise = record["measurements.covariance"]
    held_out = run.setting["test_q"], run.setting["test_true"][:, :3, 3]
    found = arm.calibrated_sets(links, q, position, rotation, noise, *held_out, **frames)
    stored = [record[f"observability.correct.{name}"] for name in ("O1", "O2")]
    np.testing.assert_allclose(found["index"][0], stored, rtol=1e-9)
    for mode in arm.SYSTEMS:
        name = f"estimates.{run.place(trial, mode)}"
        step = arm.calibrate(links, q, position, rotation, mode, covariance=noise, **frames)
        u = np.sqrt(np.diagonal(record[f"{name}.identification.covariance"]))
        # the package ends a fit where all 24 numbers together are 1e-10 u away
        assert (np.abs(step - run.repeated(trial, mode)) / u).max() < 1e-9
        for when, figures in (("before", found["before"]), ("after", found[mode])):
            errors = [
                f"{name}.comparison.{of}_{when}.mean" for of in ("identification", "accuracy")
            ]
            np.testing.assert_allclose(figures[0], [record[key] for key in errors], rtol=1e-9)


@pytest.mark.parametrize(("place", "trial"), list(enumerate(DESIGNED)))
def test_all_random_sets_measured_and_calibrated_again_give_the_recorded_figures(run, place, trial):
    (links, frames), study = placed(run), f"sets.{place}"
    record = run.records["random_calibrations"]
    assert (record[f"{study}.trial"], record[f"{study}.failed.#"]) == (trial, 0)
    noise = run.records[trial]["measurements.covariance"]
    held_out = run.setting["test_q"], run.setting["test_true"][:, :3, 3]
    designed = [run.records[trial]["selection.indices"]], "visit"
    # drawn here again from the stream of the indices
    rng = script.stream(run.scenario["seed"], "random_sets", trial)
    size, N = len(designed[0][0]), len(run.setting["pool_q"])
    count = run.scenario["studies"]["random_sets"]
    drawn = [np.sort(rng.choice(N, size, replace=False)) for _ in range(count)]
    for kind, (sets, name) in {
        "designed": designed,
        "random": (drawn, "random_calibrations"),
    }.items():
        seen = [script.visit(run, chosen, name, trial, repeat=k) for k, chosen in enumerate(sets)]
        q, position, rotation = (np.array(part) for part in zip(*seen, strict=True))
        found = arm.calibrated_sets(links, q, position, rotation, noise, *held_out, **frames)
        stored = {key: record[f"{study}.{kind}.{key}"] for key in CALIBRATED}
        np.testing.assert_array_equal(stored["indices"], sets)
        np.testing.assert_allclose(stored["index"].T, found["index"], rtol=1e-9)
        np.testing.assert_allclose(stored["own_before"], found["before"][:, 0], rtol=1e-9)
        assert record["before"] == pytest.approx(found["before"][0, 1], rel=1e-9)
        for k, mode in enumerate(("paper", "whitened")):
            own_after, error = found[mode].T
            np.testing.assert_allclose(stored["own_after"][k], own_after, rtol=1e-9)
            np.testing.assert_allclose(stored["error"][k], error, rtol=1e-9)


@pytest.mark.parametrize("poses", [29, 61])
def test_random_sets_calibrated_side_by_side_are_those_identified_one_by_one(poses):
    nominal, rng, pool = tx60(), np.random.default_rng(poses), pool_r(200)
    true = arm.moved(TX60_LINKS, np.where(arm.LENGTH, 1e-4, 3e-4) * rng.standard_normal(24))
    q, test_q = pool[[rng.choice(150, poses, replace=False) for _ in range(4)]], pool[150:]
    p, R = arm.forward(true, q)
    position = p + SIGMA_POSITION * rng.standard_normal(p.shape)
    rotation = R @ arm.rotation_of(SIGMA_ROTATION * rng.standard_normal(p.shape))
    held_out, _ = arm.forward(true, test_q)
    found = arm.calibrated_sets(TX60_LINKS, q, position, rotation, COVARIANCE, test_q, held_out)
    parameters = parameters_of(nominal, arm.NAMES)
    T = np.zeros((4, poses, 4, 4))
    T[..., :3, 3], T[..., :3, :3], T[..., 3, 3] = position, rotation, 1
    for k in range(4):
        seen = tables.poses(q[k], T[k], sd=(SIGMA_POSITION, SIGMA_ROTATION))
        rows = paper_stack(nominal, seen).A[:, parameters.free_index]
        singular = singular_values(rows * np.where(arm.LENGTH, 1e-3, 1.0))
        correct = indices(singular, poses).correct
        np.testing.assert_allclose(found["index"][k], [correct.O1, correct.O2], rtol=1e-9)
        for mode in arm.SYSTEMS:
            fit = identify(nominal, seen, parameters, mode=mode)
            step = arm.calibrate(
                TX60_LINKS, q[[k]], position[[k]], rotation[[k]], mode, covariance=COVARIANCE
            )
            assert (np.abs(step[0] - fit.step) / fit.standard_uncertainty).max() < 1e-9
            errors = [
                point_distances(seen_at, fit.model.poses(at)[:, :3, 3]).mean()
                for seen_at, at in ((position[k], q[k]), (held_out, test_q))
            ]
            np.testing.assert_allclose(found[mode][k], errors, rtol=1e-9)


# the tool point


def stated(run):
    """u (24,) of the 24 numbers by source of the recorded study, and the place of each source."""
    record = run.records["tool_point"]
    first, *others = budgets(run)
    ours = dict(zip(("best", "random"), budgets(run)[first], strict=True))
    by_name = {f"table 3 {side}": arm.table3(side) for side in ("best", "random")}
    by_name |= {f"ours {side}": ours[side] for side in ("best", "random")}
    by_name |= {f"ours, {name}": budgets(run)[name][0] for name in others}
    names = [record[f"source.{k}"] for k in range(record["source.#"])]
    return [(k, name, by_name[name]) for k, name in enumerate(names)]


def poses_of(run):
    """The zero pose and the held-out poses."""
    return np.vstack([np.zeros((1, 6)), run.setting["test_q"]])


def test_the_recorded_cloud_is_that_of_the_same_draws(run):
    (links, frames), record = placed(run), run.records["tool_point"]
    for k, source, u in stated(run):
        rng = script.stream(run.scenario["seed"], "tool_point", source)
        cloud, distance = arm.tool_cloud(links, u, poses_of(run), rng, record["draws"], **frames)
        np.testing.assert_allclose(record["spread"][k], cloud.std(axis=0, ddof=1), rtol=1e-9)
        sd = distance.std(axis=0, ddof=1)
        np.testing.assert_allclose(record["distance_sd"][k], sd, rtol=1e-9)
        ends = distance[:, 0].min(), distance[:, 0].max()
        # differences of numbers 1e4 times as large
        np.testing.assert_allclose(
            record["distance_range"][k], ends - distance[:, 0].mean(), rtol=1e-8
        )


def test_all_six_ranges_at_the_zero_pose_are_those_of_the_same_draws():
    nominal, zero = tx60(), np.zeros((1, 6))
    for column in ("best", "random"):
        u = np.zeros(nominal.n_numbers)
        u[[nominal.names.index(name) for name in arm.NAMES]] = arm.table3(column)
        spread = distance_spread(nominal, zero, u, np.random.default_rng(3), draws=4000)
        cloud, _ = arm.tool_cloud(
            TX60_LINKS, arm.table3(column), zero, np.random.default_rng(3), 4000
        )
        ranges = np.stack([cloud[:, 0].min(axis=0), cloud[:, 0].max(axis=0)], axis=-1)
        # micrometers beside 0.67 m: the last digits of the difference are lost
        np.testing.assert_allclose(spread.axis_extremes[0], ranges, rtol=1e-9)


def test_the_recorded_cloud_is_one_of_independent_normal_numbers(run):
    (links, frames), record = placed(run), run.records["tool_point"]
    draws = record["draws"]
    for k, source, u in stated(run):
        rng = np.random.default_rng([5, k])
        cloud, distance = arm.tool_cloud(links, u, poses_of(run), rng, draws, **frames)
        # two standard deviations of so many draws differ by 1 / sqrt(draws) of them; 5 times that
        # for 200 figures together
        for recorded, own in ((record["spread"][k], cloud), (record["distance_sd"][k], distance)):
            ratio = recorded / own.std(axis=0, ddof=1)
            assert np.abs(ratio - 1).max() < 5 / np.sqrt(draws), source
        # smallest and largest of so many normal numbers, one in a thousand beyond on each side
        least, most = ndtri(np.array([5e-4, 1 - 5e-4]) ** (1 / draws))
        reach = record["distance_range"][k] / record["distance_sd"][k][0] * [-1, 1]
        assert ((reach > least) & (reach < most)).all(), source
