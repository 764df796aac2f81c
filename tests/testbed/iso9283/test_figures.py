"""Figures of virtual cycles against closed forms, and against formulas written out once more."""

import csv
import importlib.util
import io
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from calib.errors import InputError
from testbed.files.read import ReadOptions
from testbed.iso9283 import grouped
from testbed.iso9283.decided import decisions, would_decide
from testbed.iso9283.figure_words import show
from testbed.iso9283.play import play_test
from testbed.iso9283.read import read_test
from testbed.iso9283.report_figures import angle_section, direction_section
from testbed.iso9283.results import headline, iso_csv
from testbed.iso9283.shown import shown_test
from testbed.iso9283.words import mark, reasons, verdict
from tests.testbed.iso9283.made import (
    BIAS,
    CUBE,
    changed,
    dropped,
    path_rows,
    pose_rows,
    scatter,
    text_of,
)

PROTOTYPE = Path(__file__).parents[4] / "shared" / "prototypes" / "reference" / "iso9283.py"
UM = 1e-6


def played(folder, rows, toml="", *, separator=",", **options):
    """The result of a table, by a session.toml if there is one."""
    (folder / "cycles.csv").write_text(text_of(rows, separator))
    config = None
    if toml:
        config = folder / "session.toml"
        config.write_text(toml)
    test = read_test(folder / "cycles.csv", config=config, options=ReadOptions(**options))
    return play_test(test)


def values(result, name):
    return np.array([figure.value for figure in result.of(name)]) / UM


def test_known_bias_and_scatter_come_out(tmp_path):
    """Means are exact by construction; twelve digits in the file leave 1e-6 um."""
    result = played(tmp_path, pose_rows(n=30, sd=10.0))
    np.testing.assert_allclose(values(result, "AP"), np.linalg.norm(BIAS, axis=1), atol=1e-4)
    for k, axis in enumerate("xyz"):
        np.testing.assert_allclose(values(result, f"AP_{axis}"), BIAS[:, k], atol=1e-4)
    # covariances are exactly 100 um^2: u of a mean is 10 / sqrt(30) along every direction
    u = [figure.u / UM for figure in result.of("AP")[:4]]
    np.testing.assert_allclose(u, 10 / np.sqrt(30), rtol=1e-6)
    half = stats.t(29).ppf(0.975) * 10 / np.sqrt(30)
    span = [(f.upper - f.value) / UM for f in result.of("AP")[:4]]
    np.testing.assert_allclose(span, half, rtol=1e-6)
    # the mean length of the scatter of a barycenter, where its command is hit
    assert result.of("AP")[4].floor / UM == pytest.approx(np.sqrt(8 / np.pi / 30) * 10, rel=1e-6)


def test_rp_is_that_of_the_formula_written_out_and_of_the_prototype(tmp_path):
    result = played(tmp_path, pose_rows(n=12, sd=7.0, seed=3))
    seen = CUBE[:, None] + (BIAS[:, None] + scatter(12, 5, 7.0, 3)) * 1e-3
    by_hand = []
    for cycles in seen:
        center = [sum(c[i] for c in cycles) / 12 for i in range(3)]
        away = [sum((c[i] - center[i]) ** 2 for i in range(3)) ** 0.5 for c in cycles]
        mean = sum(away) / 12
        by_hand.append(mean + 3 * (sum((a - mean) ** 2 for a in away) / 11) ** 0.5)
    np.testing.assert_allclose(values(result, "RP"), np.array(by_hand) * 1e3, atol=1e-4)
    if not PROTOTYPE.is_file():
        pytest.skip("the prototype is not beside this repository")
    spec = importlib.util.spec_from_file_location("prototype", PROTOTYPE)
    prototype = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(prototype)
    np.testing.assert_allclose(values(result, "RP"), prototype.repeatability(seen) * 1e3, atol=1e-4)
    np.testing.assert_allclose(
        values(result, "AP"), prototype.accuracy(seen, CUBE) * 1e3, atol=1e-4
    )


def test_distances_have_their_sign_and_the_instruments_scale_in_u(tmp_path):
    bias = np.zeros((5, 3))
    bias[1] = [30, 30, 30]  # P2 lies further out along its diagonal
    toml = (
        "[uncertainty.systematic]\nscale_um_per_m = 20\nstation_mm = [0, 0, 0]\n"
        '[uncertainty]\nposition_um = 3\n[iso9283]\nframe = "robot"\n'
    )
    result = played(tmp_path, pose_rows(n=30, sd=5.0, bias=bias), toml)
    pair = next(f for f in result.of("AD") if f.where == "P1 to P2")
    wanted = np.sqrt(3) * 200
    assert pair.value / UM == pytest.approx(30 * np.sqrt(3), abs=0.2)  # s^2/D and rounding
    back = next(f for f in result.of("AD") if f.where == "P2 to P3")
    assert back.value > 0
    # a scale of 20 um/m, and two barycenters of 5 um
    assert pair.shared / UM == pytest.approx(20 * wanted * 1e-3, rel=1e-3)
    own = np.linalg.norm(scatter(30, 5, 5.0)[1] - scatter(30, 5, 5.0)[0] + 0.0, axis=1)
    assert own.size == 30
    assert pair.u / UM > pair.shared / UM
    # AP of the same instrument: the scale at 1.1 m from the station, along the beam
    P1 = result.of("AP")[0]
    assert P1.shared <= 20e-6 * np.linalg.norm(CUBE[0]) * 1e-3 * (1 + 1e-9)
    assert "Systematic errors" not in " ".join(reasons(result))
    RD = next(f for f in result.of("RD") if f.where == "P1 to P2")
    assert RD.floor / UM == pytest.approx(3 * 3 * np.sqrt(2), rel=0.02)  # c4(30) = 0.991


def test_orientation_is_by_rotation_vectors(tmp_path):
    turns = scatter(30, 5, 2e-3, seed=5) + np.array([0.01, 0, 0])  # deg
    result = played(tmp_path, pose_rows(turns=turns))
    angle = np.degrees([f.value for f in result.of("AP_angle")])
    np.testing.assert_allclose(angle, 0.01, rtol=1e-4)  # angles of 1e-4, squared
    for axis in "xyz":
        spread = np.degrees([f.value for f in result.of(f"RP_angle_{axis}")])
        np.testing.assert_allclose(spread, 3 * 2e-3, rtol=1e-3)
    uncommanded = [
        {k: v for k, v in row.items() if not k.startswith("command_rv")}
        for row in pose_rows(turns=turns)
    ]
    toml = "[uncertainty.systematic]\ntarget_turn_mdeg = 6\nstation_mm = [0, 0, 0]\n"
    stated, bare = played(tmp_path, pose_rows(turns=turns), toml), played(tmp_path, uncommanded)
    for one, two in zip(result.of("AP_angle"), stated.of("AP_angle"), strict=True):
        assert np.degrees(two.shared) == pytest.approx(6e-3, rel=1e-6)
        assert two.u == pytest.approx(np.hypot(one.u, two.shared))
    assert [f.value for f in bare.of("RP_angle_y")] == [f.value for f in result.of("RP_angle_y")]
    assert not bare.of("AP_angle")
    assert "so that orientation has no AP" in " ".join(bare.test.notes)
    assert angle_section(bare).anchor == "angles"


def test_directions_of_approach_give_their_largest_gap(tmp_path):
    ways = {"left": (0, 0, 0), "right": (60, 0, 0), "above": (0, 80, 0)}
    rows = []
    for k, (way, shift) in enumerate(ways.items()):
        # cycles counted on through all directions
        rows += [
            row | {"approach": way, "cycle": row["cycle"] + 5 * k}
            for row in pose_rows(n=5, sd=2.0, bias=BIAS + np.array(shift), seed=k)
        ]
    result = played(tmp_path, [row | {"time_s": k} for k, row in enumerate(rows)])
    np.testing.assert_allclose(values(result, "vAP"), 100.0, atol=1e-4)
    assert len(result.of("AP")) == 15
    assert {f.where for f in result.of("vAP")} == {"P1", "P2", "P3", "P4", "P5"}
    pairs = [f.where for f in result.of("AD")]
    assert len(pairs) == 30
    assert all(pair.count("from left") in (0, 2) for pair in pairs)
    shown = shown_test(result)
    assert list(shown.labels.values()) == ["P1", "P2", "P3", "P4", "P5"]
    section = direction_section(result)
    assert [row[:2] for row in section.blocks[0].rows] == [(f"P{k}", "100.0") for k in range(1, 6)]
    # three poses at one place whose own names have such words are three poses
    named = list(replace(shown, sent_to=shown.poses).labels.values())
    assert named[0] == "P1 from left, P1 from right, P1 from above"
    fewer = [row for row in rows if row["cycle"] < 15]
    with pytest.raises(InputError, match="cycle 5 of each direction of approach has no reading"):
        played(tmp_path, fewer)


def test_a_drift_is_read_and_said_and_its_absence_is_too(tmp_path):
    rows = pose_rows(n=30, sd=4.0)
    later = [
        row | {"x_mm": row["x_mm"] + 0.05 * (row["cycle"] > 20)} if row["pose_id"] == "P1" else row
        for row in rows
    ]
    result = played(tmp_path, later)
    P1 = result.of("dAP")[0]
    assert P1.value / UM == pytest.approx(50, abs=3 * 4 * np.sqrt(2 / 10))
    assert "The robot drifts (p = 0.001" in verdict(result)
    assert f"AP changes by up to {show(P1.value, P1)} um (pose P1)" in verdict(result)
    assert "AP of pose P1 changes by" in " ".join(reasons(result))
    passed = played(tmp_path, later, "[iso9283]\nlimits_um = {AP = 900}\n")
    assert mark(passed) == "✓ PASS at the stated limits (it drifts)"
    assert "if the drift stays within" in decisions(passed)[0].sentence
    calm = played(tmp_path, rows)
    assert "drift" not in " ".join(reasons(calm)).lower()
    assert "Drift is not significant (p =" in verdict(calm)
    still = [{k: v for k, v in row.items() if k != "time_s"} for row in rows]
    untimed = played(tmp_path, still)
    assert "Drift was not tested: there are no times" in " ".join(reasons(untimed))
    assert "rift" not in verdict(untimed)


def test_clocks_that_go_back_by_an_hour_are_no_time_that_goes_back(tmp_path):
    """30 cycles in two hours and a half, local times with their zone, winter time at 01:00 UTC."""
    rows = pose_rows(n=30, sd=4.0, cycle_time=300.0)
    begin, clocks = datetime(2026, 10, 25, 0, 0, tzinfo=UTC), []
    for row in rows:
        moment = begin + timedelta(seconds=row["time_s"])
        zone = timezone(timedelta(hours=2 if moment.hour < 1 else 1))
        texts = {k: v for k, v in row.items() if k != "time_s"}
        clocks.append(texts | {"time": moment.astimezone(zone).isoformat()})
    result, plain = played(tmp_path, clocks), played(tmp_path, rows)
    np.testing.assert_array_equal(result.test.visits.time, plain.test.visits.time)
    np.testing.assert_array_equal(values(result, "dAP"), values(plain, "dAP"))
    some = [row | {"time": row["time"][:19]} if k < 7 else row for k, row in enumerate(clocks)]
    mixed = played(tmp_path, some)
    assert "143 of 150 times state a time zone and the others do not" in mixed.test.warnings[0]
    assert not mixed.of("dAP")


def test_cycles_that_follow_each_other_or_stray_are_said_and_widen_the_limits(tmp_path):
    e = np.random.default_rng(12).standard_normal((30, 3))
    for k in range(1, 30):
        e[k] = 0.9 * e[k - 1] + np.sqrt(1 - 0.9**2) * e[k]
    rows = [
        {key: value for key, value in row.items() if key != "time_s"}
        | {f"{a}_mm": row[f"{a}_mm"] + 0.02 * e[row["cycle"] - 1, i] for i, a in enumerate("xyz")}
        | {"cycle": 100 + row["cycle"]}
        for row in pose_rows(n=30, sd=2.0)
    ]
    slow, calm = played(tmp_path, rows), played(tmp_path, pose_rows(n=30, sd=20.0))
    assert "Successive cycles are correlated (p = 0.001" in " ".join(reasons(slow))
    assert "Cycles are like those" not in " ".join(reasons(calm))
    wide, usual = (one.of("AP")[0].upper - one.of("AP")[0].lower for one in (slow, calm))
    assert wide > 2 * usual
    rows[40]["x_mm"] += 0.3
    assert "Cycle 109 of pose P1 strays" in " ".join(reasons(played(tmp_path, rows)))


def test_limits_that_long_tails_break_are_said_to_be_broken(tmp_path):
    """Student's t with 4 degrees of freedom: RP lies beyond its limits at a third of poses."""
    rng, said = np.random.default_rng(4), "the limits of RP and RD assume normal scatter and do not"
    rows = pose_rows(n=30, sd=4.0)
    wild = [
        row | {f"{a}_mm": row[f"{a}_mm"] + 0.02 * rng.standard_t(4) for a in "xyz"} for row in rows
    ]
    assert said in " ".join(reasons(played(tmp_path, wild)))
    assert said not in " ".join(reasons(played(tmp_path, rows)))


def test_paths_beside_their_command_give_at_and_rt_by_hand(tmp_path):
    shifts = np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, 0, 0.0]]) * 0.05
    result = played(tmp_path, path_rows(n=5, shifts=shifts))
    AT, RT = result.of("AT")[0], result.of("RT")[0]
    assert AT.value / UM == pytest.approx(200, abs=1e-3)
    assert RT.value / UM == pytest.approx(50 * (0.8 + 3 * 0.2**0.5), abs=1e-3)
    assert "Path line has 5 runs, and ISO 9283:1998 asks for 10" in " ".join(reasons(result))
    # along the path nothing counts
    late = shifts + np.random.default_rng(1).standard_normal((5, 1)) * [2.0, 0, 0]
    again = played(tmp_path, path_rows(n=5, shifts=late))
    for name in ("AT", "RT"):
        assert again.of(name)[0].value == pytest.approx(result.of(name)[0].value, rel=1e-9)


def test_paths_read_as_they_come_are_cut_where_the_command_says(tmp_path):
    shifts = np.random.default_rng(2).standard_normal((6, 3)) * [3, 0.05, 0.05]
    rows = path_rows(n=6, m=80, shifts=shifts)
    numbered = played(tmp_path, rows)
    bare = [
        {k: v for k, v in row.items() if k != "path_point" and not k.startswith("command")}
        for row in rows
        if row["path_point"] % 7 != 3  # not even the same number of readings
    ]
    points = [
        {"path": "line", "path_point": k + 1, "x_mm": 820 + 30.0 * k, "y_mm": -50, "z_mm": 600}
        for k in range(24)
    ]
    (tmp_path / "points.csv").write_text(text_of(points))
    toml = '[paths]\nfile = "cycles.csv"\ncommanded = "points.csv"\n'
    sampled = played(tmp_path, bare, toml)
    for name in ("AT", "RT"):
        one, two = numbered.of(name)[0].value, sampled.of(name)[0].value
        assert one == pytest.approx(two, rel=1e-9)  # lines: every plane shows the same


def test_rounding_of_corners_that_no_reading_shows_is_said(tmp_path):
    """Readings 2 mm apart along an L, none at its corner; a straight path has nothing to say."""
    s = np.arange(1.0, 200, 2)
    places = np.stack([np.minimum(s, 100), np.maximum(s - 100, 0), 0 * s], axis=1)
    rows = [
        {"path": "L", "cycle": k + 1, "x_mm": x, "y_mm": y, "z_mm": z + 0.01 * k}
        for k in range(5)
        for x, y, z in places
    ]
    points = [
        {"path": "L", "path_point": k + 1, "x_mm": min(k * 10, 100), "y_mm": max(k * 10 - 100, 0)}
        | {"z_mm": 0}
        for k in range(21)
    ]
    (tmp_path / "points.csv").write_text(text_of(points))
    toml = '[paths]\nfile = "cycles.csv"\ncommanded = "points.csv"\n'
    result = played(tmp_path, rows, toml)
    assert result.of("AT")[0].value / UM == pytest.approx(20, abs=1e-3)
    assert "path L are 2.00 mm apart (median): a corner that is rounded" in " ".join(
        reasons(result)
    )
    straight = played(tmp_path, path_rows(n=5, shifts=np.zeros((5, 3))))
    assert "rounded" not in " ".join(reasons(straight))


def test_a_second_lap_that_is_off_fails_though_the_first_lies_on_every_point(tmp_path):
    """Readings 0.3 mm above their commands in the second lap; numbered, and as they come."""
    rows = []
    for c in range(10):
        for k in range(73):
            angle = 2 * np.pi * k / 36
            sent = [900 + 100 * np.cos(angle), 100 * np.sin(angle), 600.0]
            row = {"path": "circle", "path_point": k + 1, "cycle": c + 1}
            row |= {f"{a}_mm": sent[i] + 0.3 * (k > 36) * (i == 2) for i, a in enumerate("xyz")}
            rows.append(row | {f"command_{a}_mm": sent[i] for i, a in enumerate("xyz")})
    limits = '[iso9283]\nframe = "robot"\nlimits_um = { AT = 50 }\n'
    numbered = played(tmp_path, rows, limits)
    points = [{k.removeprefix("command_"): v for k, v in row.items()} for row in rows[:73]]
    (tmp_path / "points.csv").write_text(text_of(points))
    bare = [{k: row[k] for k in ("path", "cycle", "x_mm", "y_mm", "z_mm")} for row in rows]
    toml = '[paths]\nfile = "cycles.csv"\ncommanded = "points.csv"\n' + limits
    for result in (numbered, played(tmp_path, bare, toml)):
        # twelve digits in the file
        assert values(result, "AT")[0] == pytest.approx(300, abs=1e-4)
        assert mark(result).startswith("✗ FAIL")
        (path,) = result.paths
        np.testing.assert_allclose(path.AT[:37] / UM, 0, atol=1e-4)
        np.testing.assert_allclose(path.AT[37:] / UM, 300, atol=1e-4)


def test_runs_that_end_two_micrometers_before_a_turn_are_no_runs_that_miss_it(tmp_path):
    there = path_rows(n=10, m=11, off=(-0.002, 0.3, 0.0))
    back = path_rows(n=10, m=10, off=(-0.002, 0.0, 0.0))
    rows = there + [row | {"path_point": 22 - row["path_point"], "time_s": 0} for row in back]
    rows = [{k: v for k, v in row.items() if k != "time_s"} for row in rows]
    (path,) = played(tmp_path, rows).paths
    np.testing.assert_allclose(path.AT / UM, [300.0] * 11 + [0.0] * 10, atol=0.1)  # 0.002 of 10 mm


def test_a_fitted_frame_takes_a_rigid_motion_and_nothing_else(tmp_path):
    from scipy.spatial.transform import Rotation

    bias, station = 50 * np.random.default_rng(4).standard_normal((5, 3)), [-1500, 700, 100]
    toml = (
        '[iso9283]\nframe = "fitted"\n[uncertainty]\nposition_um = 2\n[uncertainty.systematic]\n'
        "scale_um_per_m = 5\nencoder_amplitude_um = [9, 0]\nstation_mm = {}\nstation_up = {}\n"
    )
    plain = played(tmp_path, pose_rows(bias=bias), toml.format(station, [0, 0, 1]))
    R, t = Rotation.from_rotvec([0.3, -0.2, 1.0]), np.array([100.0, -2000, 30])
    moved = []
    for row in pose_rows(bias=bias):
        x = R.apply([row[f"{a}_mm"] for a in "xyz"]) + t
        moved.append(row | {f"{a}_mm": x[i] for i, a in enumerate("xyz")})
    away = (R.apply(station) + t).tolist()
    other = played(tmp_path, moved, toml.format(away, R.apply([0, 0, 1]).tolist()))
    for one, two in zip(plain.figures, other.figures, strict=True):
        # twelve digits of 2 m are 2e-6 um
        assert (one.name, one.where) == (two.name, two.where)
        assert one.value == pytest.approx(two.value, abs=1e-9), one.name
        assert one.u == pytest.approx(two.u, rel=1e-3, abs=1e-10), one.name
    assert "best fit over 5 points" in other.frame
    limited = played(tmp_path, moved, '[iso9283]\nframe = "fitted"\nlimits_um = {AP = 900}\n')
    assert "PASS" in decisions(limited)[0].sentence
    assert "in the frame that was fitted to the same readings" in decisions(limited)[0].sentence


def test_a_fitted_frame_moves_paths_with_the_poses(tmp_path):
    from scipy.spatial.transform import Rotation

    R, t = Rotation.from_rotvec([0.3, -0.2, 1.0]), np.array([100.0, -2000, 30])
    shifts = 0.1 * np.random.default_rng(0).standard_normal((4, 3))
    rows, moved = pose_rows(n=4) + path_rows(n=4, m=6, shifts=shifts), []
    for row in rows:
        x = R.apply([row[f"{a}_mm"] for a in "xyz"]) + t
        moved.append(row | {f"{a}_mm": x[i] for i, a in enumerate("xyz")})
    toml = '[iso9283]\nframe = "fitted"\n[uncertainty]\nposition_um = 3\n'
    one, two = (played(tmp_path, each, toml) for each in (rows, moved))
    assert min(*values(one, "AT"), *values(one, "RT")) > 50
    for name in ("AT", "RT"):
        # twelve digits of 2 m are 2e-6 um
        np.testing.assert_allclose(values(one, name), values(two, name), rtol=0, atol=1e-4)


def test_stated_noise_turns_with_the_readings(tmp_path):
    rows = [row | {"x_mm": -row["y_mm"], "y_mm": row["x_mm"]} for row in pose_rows(n=4)]
    noise = {"ux_mm": 1e-3, "uy_mm": 2e-3, "uz_mm": 3e-3}
    found = played(tmp_path, [row | noise for row in rows], '[iso9283]\nframe = "fitted"\n')
    # a quarter turn back: what was y is x; the fit turns by 60 um of 400 mm more
    variances = np.diagonal(found.test.visits.noise, axis1=1, axis2=2)
    np.testing.assert_allclose(variances[0], [4e-12, 1e-12, 9e-12], rtol=1e-5)


def test_limits_are_decided_with_their_confidence(tmp_path):
    toml = (
        "[iso9283]\nlimits_um = {AP = 100, RP = 28, RD = 33, AT = 5, dAP = 50}\n"
        "[uncertainty]\nposition_um = 2\n"
    )
    result = played(tmp_path, pose_rows(n=30, sd=10.0), toml)
    found = {one.name: one for one in decisions(result)}
    words = {name: one.word for name, one in found.items()}
    # RP is about 35 um, its lower limit 30, of which 2 um of noise make less than 1; AP 80 plus 3.7
    assert words == {
        "AP": "PASS", "RP": "FAIL", "RD": "UNDECIDED", "AT": "UNDECIDED", "dAP": "PASS",
    }  # fmt: skip
    assert "nothing that was measured gives AT" in found["AT"].sentence
    assert "cycles would decide it" in found["RD"].sentence
    assert mark(result).startswith("✗ FAIL at the stated limits")
    near = played(tmp_path, pose_rows(sd=10.0), "[iso9283]\nlimits_um = {AP = 82, dAP = 12}\n")
    assert {one.word for one in decisions(near)} == {"UNDECIDED"}  # 80.0 of 76.2 to 83.7
    assert "more cycles would not decide it, as every block has 10" in decisions(near)[1].sentence
    assert "; dAP is up to 8.4 um (pose P3; 0.0 to" in verdict(near)
    assert reasons(near)[1].startswith("dAP limit 12 um: UNDECIDED")
    assert mark(near) == "? UNDECIDED at the stated limits"
    # Student's t leaves 76.27; scatter across the 80 um makes them longer by 0.04 in a bad case
    assert "AP is up to 80.0 um (pose P1; 95 % limits 76.2 to 83.7)" in verdict(result)


def test_what_systematic_errors_leave_open_more_cycles_do_not_decide(tmp_path):
    """And a limit beyond them they do, as many as are said."""
    toml = (
        "[uncertainty]\nposition_um = 2\n[uncertainty.systematic]\nscale_um_per_m = 10\n"
        "station_mm = [-1500, 700, 100]\n[iso9283]\nlimits_um = {{AP = {}}}\n"
    )
    few = played(tmp_path, pose_rows(n=10, sd=30.0), toml.format(85))
    said = decisions(few)[0].sentence
    # at P1, 2.4 m along the beam and 80 um off along x
    assert "the stated systematic errors alone give u = 24.0 um" in said
    many = played(tmp_path, pose_rows(n=1000, sd=30.0), toml.format(85))
    assert decisions(many)[0].word == "UNDECIDED"
    figure = max(few.of("AP"), key=lambda one: one.most)
    n = int(would_decide(figure, 140 * UM).split()[1])
    # Student's t of 10 cycles is larger than that of more
    assert decisions(played(tmp_path, pose_rows(n=n, sd=30.0), toml.format(140)))[0].word == "PASS"


def test_poses_at_one_place_have_no_distance(tmp_path):
    rows = pose_rows(n=4, commands=CUBE[[0, 1, 0]], bias=np.full((3, 3), 10.0))
    pairs = {figure.where for figure in played(tmp_path, rows).of("AD")}
    assert pairs == {"P1 to P2", "P2 to P3"}


def test_noise_of_endlessly_many_readings_is_what_a_lower_limit_is_freed_of(tmp_path):
    """Of five cycles noise alone reads less than of so many as the limit is of."""
    toml = "[uncertainty]\nposition_um = 4\n"
    figure = max(played(tmp_path, pose_rows(n=5), toml).of("RP"), key=lambda f: f.least)
    # Maxwell distribution: mean and three standard deviations
    assert figure.noise == pytest.approx(4e-6 * (np.sqrt(8 / np.pi) + 3 * np.sqrt(3 - 8 / np.pi)))
    own, too_much = (np.sqrt(figure.least**2 - x**2) for x in (figure.noise, figure.floor))
    limit = (own + too_much) / 2 / UM
    toml += f"[iso9283]\nlimits_um = {{RP = {limit}}}\n"
    assert decisions(played(tmp_path, pose_rows(n=5), toml))[0].word == "UNDECIDED"


def test_commands_all_within_a_millimeter_are_said_to_be_in_another_unit(tmp_path):
    """Both sides called mm and given in m spread alike; their figures are 1000 times too small."""
    names = [f"{what}{axis}_mm" for what in ("", "command_") for axis in "xyz"]
    rows = [row | {name: row[name] * 1e-3 for name in names} for row in pose_rows(n=4)]
    said = "All commands lie within 0.4"
    assert any(said in one and "another unit" in one for one in reasons(played(tmp_path, rows)))
    assert not any("another unit" in one for one in reasons(played(tmp_path, pose_rows(n=4))))


def test_a_fit_that_lowers_nothing_is_not_said_to(tmp_path):
    """Readings that are their commands deviate by rounding alone, before a fit and after it."""
    rows = [row | {f"{a}_mm": row[f"command_{a}_mm"] for a in "xyz"} for row in pose_rows(n=4)]
    assert "would lower" not in played(tmp_path, rows).frame
    assert "would lower" in played(tmp_path, pose_rows(n=4)).frame


def test_noise_that_is_stated_larger_than_all_that_scatters_is_said_to_be(tmp_path):
    for noise, said in ((8, "the stated noise is too large"), (4, "the robot itself repeats")):
        found = played(tmp_path, pose_rows(sd=4.0), f"[uncertainty]\nposition_um = {noise}\n")
        assert said in " ".join(reasons(found))


def test_so_many_cycles_decide_as_they_were_said_to(tmp_path):
    few = played(tmp_path, pose_rows(n=10, sd=10.0))
    figure = few.of("AP")[0]
    limit = figure.value + 0.5 * (figure.upper - figure.value)
    said = would_decide(figure, limit)
    n = int(said.split()[1])
    # four times as many by sqrt(n); Student's t falls, too, from 2.26 to 2.02
    assert n == 40
    many = played(tmp_path, pose_rows(n=n, sd=10.0)).of("AP")[0]
    assert many.upper <= limit
    assert played(tmp_path, pose_rows(n=n // 2, sd=10.0)).of("AP")[0].upper > limit


def test_few_cycles_are_no_figures_of_the_standard(tmp_path):
    result = played(tmp_path, pose_rows(n=10))
    assert mark(result) == "? Measured with fewer cycles than ISO 9283:1998 asks for"
    assert "these are not the standard's figures" in " ".join(reasons(result))
    assert mark(played(tmp_path, pose_rows())).startswith("✓ Measured with as many cycles")


def test_incomplete_cycles_are_left_out_when_asked(tmp_path):
    rows = dropped(pose_rows(n=8), pose_id="P2", cycle=3)
    rows = changed(rows, {"x_mm": "lost"}, pose_id="P4", cycle=6)
    result = played(tmp_path, rows, drop_invalid=True)
    assert result.test.visits.cycles == 6
    assert any("left out: 3, 6" in note for note in result.test.notes)
    zeros = changed(pose_rows(n=8), {"x_mm": 0, "y_mm": 0, "z_mm": 0}, pose_id="P4", cycle=6)
    assert played(tmp_path, zeros, drop_invalid=True).test.visits.cycles == 7


def test_missed_shots_among_readings_in_few_digits_are_no_touched_place(tmp_path):
    """All cycles of a pose are alike in tenths of a millimeter, as a tip in its socket would be."""
    rows = [
        row | {name: round(row[name], 1) for name in ("x_mm", "y_mm", "z_mm")}
        for row in pose_rows(n=12, sd=1.0, bias=0 * BIAS)
    ]
    for cycle in (2, 5, 9):
        rows = changed(rows, {"x_mm": 0, "y_mm": 0, "z_mm": 0}, pose_id="P4", cycle=cycle)
    assert played(tmp_path, rows, drop_invalid=True).test.visits.cycles == 9


def test_other_dialects_units_and_names_are_the_same_test(tmp_path):
    rows = pose_rows(n=5)
    first = played(tmp_path, rows)
    foreign = [
        {
            "Punkt": row["pose_id"], "Nr": row["cycle"],
            **{f"{a.upper()} [m]": f"{row[f'{a}_mm'] / 1e3:.15g}".replace(".", ",") for a in "xyz"},
            **{f"soll{a}": f"{row[f'command_{a}_mm']:g}".replace(".", ",") for a in "xyz"},
        }
        for row in rows
    ]  # fmt: skip
    columns = {"pose_id": "Punkt", "cycle": "Nr"}
    columns |= {f"{a}_m": f"{a.upper()} [m]" for a in "xyz"}
    columns |= {f"command_{a}_mm": f"soll{a}" for a in "xyz"}
    toml = "[cycles.columns]\n" + "".join(f'{k} = "{v}"\n' for k, v in columns.items())
    again = played(tmp_path, foreign, toml, separator=";")
    for one, two in zip(first.of("AP", "RP"), again.of("AP", "RP"), strict=True):
        assert one.value == pytest.approx(two.value, abs=1e-10)


def test_commands_may_stand_in_a_file_of_their_own(tmp_path):
    rows = pose_rows(n=4)
    first = played(tmp_path, rows)
    sent = [
        {"pose_id": f"P{k + 1}", "x_mm": p[0], "y_mm": p[1], "z_mm": p[2]}
        for k, p in enumerate(CUBE)
    ]
    (tmp_path / "sent.csv").write_text(text_of(sent))
    bare = [{k: v for k, v in row.items() if not k.startswith("command")} for row in rows]
    again = played(tmp_path, bare, '[cycles]\ncommanded = "sent.csv"\n')
    for one, two in zip(first.figures, again.figures, strict=True):
        assert one.value == two.value


def test_a_path_of_too_many_points_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(grouped, "MOST_POINTS", 20)
    with pytest.raises(
        InputError, match=r"has 25 commanded points; expected at most 20; .* \[M36\]"
    ):
        played(tmp_path, path_rows(n=3))


def test_every_figure_stands_in_the_table_and_in_the_json(tmp_path):
    rows = pose_rows(n=20, turns=scatter(20, 5, 1e-3)) + [
        row | {"time_s": row["time_s"] + 1e4, "rvx_deg": 0, "rvy_deg": 0, "rvz_deg": 0,
               "command_rvx_deg": 0, "command_rvy_deg": 0, "command_rvz_deg": 0}
        for row in path_rows()
    ]  # fmt: skip
    result = played(tmp_path, rows)
    table = list(csv.DictReader(io.StringIO(iso_csv(result))))
    numbers = headline(result)["figures"]
    names = {"AP", "AP_x", "AP_y", "AP_z", "RP", "AP_angle", "RP_angle_x", "RP_angle_y",
             "RP_angle_z", "AD", "RD", "dAP", "dRP", "AT", "RT"}  # fmt: skip
    assert {row["figure"] for row in table} == names == set(numbers)
    assert len(table) == len(result.figures) == sum(map(len, numbers.values()))
    for row in table:
        own = numbers[row["figure"]][row["where"]]
        assert own[f"value_{row['unit']}"] == pytest.approx(float(row["value"]), rel=1e-5)
        assert float(row["lower_95"]) <= float(row["value"]) <= float(row["upper_95"])
        assert float(row["u"]) >= 0
