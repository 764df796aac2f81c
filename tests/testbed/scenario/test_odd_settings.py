"""What is hardly meant is said, and played all the same."""

import pytest
from scipy.stats import chi2

from testbed.assets import scene_names
from testbed.files.read import read_session
from testbed.scenario.checks import odd_settings
from testbed.scenario.read import changed
from testbed.scenario.tolerance import BALL
from testbed.studies import load_scenario
from tests.command import call
from tests.testbed.files.made import ROBOT, columns, csv, made

TOLD = "[tracker] position_um is 0.01: no laser tracker measures better than 1 um; check the unit"


@pytest.mark.parametrize("scene", scene_names())
def test_no_scene_that_ships_is_odd(scene):
    assert odd_settings(load_scenario(scene)) == ()


def test_a_noise_below_that_of_any_tracker_is_said(tmp_path):
    quick = load_scenario("quick")
    quiet = changed(quick, {"tracker.position_um": 0.01}, where="test")
    assert odd_settings(quiet) == (TOLD,)
    assert odd_settings(changed(quick, {"tracker.position_um": 1.0}, where="test")) == ()
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'format = 1\nname = "a"\nrobot = "staubli_tx60"\n[tracker]\nposition_um = 0.01\n'
        '[[trial]]\nname = "a"\nmethod = "random"\nposes = 20\n'
    )
    said = call("check", scene)
    assert f"warning: {TOLD}" in said.stdout, said.stderr
    # refused later, so that nothing is computed: the warning stands before it
    (tmp_path / "run").write_text("")
    for verb in ("run", "plan"):
        words = [verb, str(scene), "--out", str(tmp_path / "run")]
        done = call(*words)
        assert done.stderr.startswith(f"warning: {scene}: {TOLD}\n")
        assert "warning" not in call(*words, "--quiet").stderr


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"truth.preset": "elastic", "truth.payload_kg": 0.0,
          "truth.payload_center_mm": (0.0, 0.0, 90.0)},
         "[truth] payload_center_mm changes nothing: payload_kg is 0"),
        ({"truth.encoder_periods": 512},
         "[truth] encoder_periods changes nothing: encoder_mdeg is 0"),
        ({"truth.gear_ratio": 81.0}, "[truth] gear_ratio changes nothing: gear_mdeg is 0"),
        ({"truth.backlash_side": "load"},
         "[truth] backlash_side changes nothing: backlash_mdeg is 0"),
        ({"truth.thermal_k": 5.0, "truth.thermal_um_per_m_k": 0.0},
         "[truth] thermal_k changes nothing: thermal_um_per_m_k is 0"),
        ({"truth.thermal_h": 2.0, "truth.thermal_um_per_m_k": 12.0},
         "[truth] thermal_h and thermal_um_per_m_k change nothing: thermal_k is 0"),
        ({"truth.preset": "elastic", "truth.dwell_s": 0.2, "truth.speed_deg_s": 120.0},
         "[truth] speed_deg_s and dwell_s change nothing: motion is false"),
        ({"tracker.preset": "at960", "tracker.encoder_um": (20.0, 5.0), "tracker.level_mdeg": 1.0},
         "[tracker] encoder_um and level_mdeg change nothing: systematic is false"),
        ({"tracker.preset": "at960", "tracker.nests_s": 60.0},
         "[tracker] nests_s changes nothing: drift_um_per_sqrt_h is 0"),
        ({"tracker.preset": "at960", "tracker.outlier_mm": 2.0},
         "[tracker] outlier_mm changes nothing: outliers is 0"),
        ({"budget.poses": 40, "budget.environment_mm": 0.1},
         "[budget] poses and environment_mm change nothing: [studies] paper_budget is false"),
        ({"studies.pose_count_max": 90},
         "[studies] pose_count_max changes nothing: pose_count is false"),
        ({"plan.target_is": "worst"}, "[plan] target_is changes nothing: target_um is 0"),
    ],
)  # fmt: skip
def test_a_key_whose_term_is_switched_off_is_said(changes, sentence):
    """And not where the term is on; nor where somebody wrote what it is anyway."""
    quick = changed(load_scenario("quick"), {"truth": {"preset": "rigid"}, "tracker": {}})
    scenario = changed(quick, changes)
    assert odd_settings(scenario) == (sentence,)
    on = {
        "truth.encoder_mdeg": 1.0, "truth.gear_mdeg": 1.0, "truth.backlash_mdeg": 1.0,
        "truth.thermal_k": 1.0, "truth.thermal_um_per_m_k": 12.0, "studies.pose_count": True,
        "studies.paper_budget": True, "plan.target_um": 30.0, "plan.poses": 0,
    }  # fmt: skip
    if "truth.payload_center_mm" in changes:
        on["truth.payload_kg"] = 1.0
    if "truth.dwell_s" in changes:
        on["truth.motion"] = True
    if "tracker.preset" in changes:
        on |= {
            "tracker.systematic": True, "tracker.outliers": 1, "tracker.drift_um_per_sqrt_h": 1.0
        }  # fmt: skip
    assert odd_settings(changed(scenario, on)) == ()
    assert odd_settings(changed(quick, {"truth.thermal_h": 1.0, "truth.damping": 0.05})) == ()


def test_of_points_no_rotation_counts_and_of_a_study_nothing_is_said():
    points = changed(load_scenario("position_only"), {"tracker.rotation_mdeg": (9.0, 9.0, 9.0)})
    assert odd_settings(points) == ('[tracker] rotation_mdeg changes nothing: measures is "point"',)
    alone = changed(
        load_scenario("stations"), {"fixtures.stations_mm": [], "fixtures.free": ["B", "C"]}
    )
    turned = changed(alone, {"fixtures.turn_sd_deg": 1.0})
    assert odd_settings(turned) == (
        "[fixtures] turn_sd_deg changes nothing: there are no stations_mm",
    )
    study = changed(load_scenario("coverage"), {"truth.dwell_s": 0.2})
    assert odd_settings(study) == ()  # its kinds of robots switch terms on by themselves


def test_sources_of_a_tracker_count_together():
    scenario = load_scenario("stations")
    small = {"tracker.range_um": (0.3, 0.1), "tracker.centering_um": 0.5}
    assert odd_settings(changed(scenario, small, where="test")) == ()
    small |= {"tracker.transverse_um": (0.2, 0.1)}
    (said,) = odd_settings(changed(scenario, small, where="test"))
    largest = "at one meter the largest of range_um, transverse_um and centering_um is 0.5"
    assert f"{largest}: no laser tracker" in said


@pytest.mark.parametrize(
    ("key", "value", "odd"),
    [("position_um", "0.01", True), ("position_um", "0.99", True), ("position_um", "1.0", False),
     ("mpe_um", "[0.1, 0.2]", True), ("mpe_um", "[0.5, 6.0]", False)],
)  # fmt: skip
def test_the_same_of_what_a_session_states(key, value, odd, tmp_path):
    (tmp_path / "a.csv").write_text(csv(columns(made(), form="none")))
    table = 'file = "a.csv"\n'
    (tmp_path / "s.toml").write_text(
        f"[joints]\n{table}[points]\n{table}[uncertainty]\n{key} = {value}\n"
    )
    said = [text for text in read_session(tmp_path / "s.toml", ROBOT).warnings if "better" in text]
    assert len(said) == odd
    if odd:
        assert "no laser tracker measures better than 1 um; check the unit" in said[0]
        assert said[0].startswith(f"{tmp_path}/s.toml: [uncertainty] {key} is ")


@pytest.mark.parametrize(("size", "odd"), [("0.00001", True), ("0.001", False)])
def test_a_column_of_nanometers_is_said_with_its_line(size, odd, tmp_path):
    table = columns(made(), form="none") | {f"u{axis}_mm": [size] * 29 for axis in "xyz"}
    (tmp_path / "a.csv").write_text(csv(table))
    said = [text for text in read_session(tmp_path / "a.csv", ROBOT).warnings if "odd" in text]
    assert len(said) == odd
    assert not odd or 'line 2 ux_mm "0.00001"' in said[0]


def test_a_tolerance_that_no_tracker_could_show_is_said(tmp_path):
    assert pytest.approx(chi2(3).ppf(0.95) ** 0.5, abs=5e-4) == BALL
    small = {"tolerance.position_um": 0.15, "tolerance.rule": "guarded"}
    quick = load_scenario("quick")
    (said,) = odd_settings(changed(quick, small, where="test"))
    told = "R95 = 2.8 um; check the unit (0.15 mm is 150 um)"
    assert said.startswith("[tolerance] position_um is 0.15: ")
    assert said.endswith(told)
    assert odd_settings(changed(quick, small | {"tolerance.position_um": 3}, where="test")) == ()
    (tmp_path / "a.csv").write_text(csv(columns(made(), form="none")))
    table = 'file = "a.csv"\n'
    (tmp_path / "s.toml").write_text(
        f"[joints]\n{table}[points]\n{table}[uncertainty]\nposition_um = 20\n"
        '[tolerance]\nposition_um = 0.15\nrule = "simple"\n'
    )
    (said,) = read_session(tmp_path / "s.toml", ROBOT).warnings
    assert said.endswith(told)
