"""New robots and scenes are taken by the verbs that follow, and check tells every kind of file."""

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truebed
from calib.errors import InputError
from testbed import assets
from testbed.laboratory.truth.setting import make_setting
from testbed.robots.catalog import TRACKER, load_robot, robot_names
from testbed.run.play import robot_of
from testbed.scenario.read import changed, dump_scenario, scenario_path
from testbed.studies import load_scenario
from tests.command import call
from tests.testbed.files.made import columns, csv, made, poses_csv, with_spread


def link_table(robot, folder, head, lengths, angles):
    """The link numbers of a shipped robot as people write them."""
    chain = load_robot(robot).model.chain
    lower, upper = load_robot(robot).limits.T * angles
    columns = [chain.links[:, 0] * angles, chain.links[:, 1] * lengths, chain.links[:, 2] * lengths,
               chain.links[:, 3] * angles, lower, upper]  # fmt: skip
    rows = [
        ";".join(f"{v:.15g}".replace(".", ",") for v in row) for row in zip(*columns, strict=True)
    ]
    (folder / "ur10.csv").write_text("\n".join([";".join(head), *rows]), encoding="utf-8")
    return folder / "ur10.csv"


@pytest.mark.parametrize(
    ("head", "lengths", "angles", "assumed"),
    [
        (("theta_deg", "d_mm", "a_mm", "alpha_deg", "lower_deg", "upper_deg"), 1e3, 180 / np.pi, 0),
        (("Theta [rad]", "d [m]", "a [m]", "Alpha [rad]", "Min [rad]", "Max [rad]"), 1.0, 1.0, 1),
        (("θ", "d", "a", "α", "min", "max"), 1.0, 1.0, 6),
        (("Theta", "D", "A", "Alpha", "q min", "q max"), 1e3, 180 / np.pi, 6),
    ],
)
def test_a_table_of_link_numbers_becomes_the_robot(head, lengths, angles, assumed, tmp_path):
    out = tmp_path / "robot.toml"
    done = call(
        "new", "robot", link_table("universal_ur10", tmp_path, head, lengths, angles), "--out", out
    )
    assert done.exit_code == 0, done.stderr
    # the angles theta are all 0: their unit is no matter
    assert done.stdout.count("assumed") == assumed
    mine, shipped = load_robot(out), load_robot("universal_ur10")
    assert mine.name == "ur10"
    np.testing.assert_allclose(
        mine.model.chain.links, shipped.model.chain.links, rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(mine.limits, shipped.limits, rtol=0, atol=1e-11)
    assert call("check", out).exit_code == 0


@pytest.mark.parametrize(
    ("head", "told"),
    [
        ("theta,d,a,alpha,beta", ["theta is in deg, by the size of alpha",
                                  "a is in mm, by the size of d"]),
        ("theta,d [mm],a,alpha [deg],beta", ["theta is in deg, as alpha [deg]",
                                             "a is in mm, as d [mm]"]),
    ],
)  # fmt: skip
def test_columns_of_a_table_that_are_alike_have_one_unit(head, told, tmp_path):
    # offsets of a calibration are small: 5 mm are not 5 m, nor 0.4 deg 0.4 rad
    table = tmp_path / "dh.csv"
    table.write_text(f"{head}\n0.4,400,5,90,0\n-0.1,0,3,0,0.02\n")
    out = tmp_path / "robot.toml"
    done = call("new", "robot", table, "--out", out)
    assert done.exit_code == 0, done.stderr
    for sentence in told:
        assert sentence in done.stdout
    by_hand = [[0.4, 400, 5, 90, 0], [-0.1, 0, 3, 0, 0.02]] * np.array(
        [np.pi / 180, 1e-3, 1e-3, np.pi / 180, np.pi / 180]
    )
    np.testing.assert_allclose(load_robot(out).model.chain.links, by_hand, rtol=1e-12, atol=0)


@pytest.mark.parametrize("first", [(0, 0), (90, 40)])
def test_a_table_in_the_order_of_craig_is_read_as_its_names_say(tmp_path, first):
    """Truth: the product of Rx(alpha) Tx(a) Rz(theta) Tz(d), line by line, up to the last x.

    What stands before the first joint moves the base alone.
    """
    rows = [(*first, 285, 0), (-90, 0, 0, -90), (180, 760, 0, -90), (-90, 30, 540, 0)]
    names = "alpha_{i-1} [deg],a_{i-1} [mm],d_i [mm],theta_i [deg]"
    text = "\n".join([names, *(",".join(map(str, row)) for row in rows)])
    (tmp_path / "craig.csv").write_text(text)
    done = call("new", "robot", tmp_path / "craig.csv", "--out", tmp_path / "robot.toml")
    assert done.exit_code == 0
    assert "Craig" not in done.stdout
    assert ("move only the base: not used" in done.stdout) == any(first)
    q = np.array([0.3, -0.7, 1.1, 0.4])
    T = np.eye(4)
    for (alpha, a, d, theta), turn in zip([(0, 0, 285, 0), *rows[1:]], q, strict=True):
        X, Z = np.eye(4), np.eye(4)
        X[:3, :3] = Rotation.from_euler("x", alpha, degrees=True).as_matrix()
        Z[:3, :3] = Rotation.from_euler("z", turn + np.radians(theta)).as_matrix()
        X[0, 3], Z[2, 3] = a / 1e3, d / 1e3
        T = T @ X @ Z
    found = load_robot(tmp_path / "robot.toml").model.poses(q[None])[0]
    np.testing.assert_allclose(found, T, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("long", "turn"), [(1e3, 180 / np.pi), (1.0, 1.0)])
def test_a_table_may_say_which_joints_slide(long, turn, tmp_path):
    rows = [
        ("R", 0, 0.4, 0.325, 0, -2.9, 2.9),
        ("R", 0, 0, 0.225, np.pi, -2.6, 2.6),
        ("P", 0, 0, 0, 0, 0, 0.2),
        ("R", 0, 0.05, 0, 0, -6.2, 6.2),
    ]
    table = "type,theta,d,a,alpha,min,max\n"
    for kind, *row in rows:
        last = long if kind == "P" else turn
        sizes = zip(row, (turn, long, long, turn, last, last), strict=True)
        table += ",".join([kind, *(f"{value * unit:.15g}" for value, unit in sizes)]) + "\n"
    (tmp_path / "scara.csv").write_text(table)
    out = tmp_path / "robot.toml"
    done = call("new", "robot", tmp_path / "scara.csv", "--out", out)
    assert done.exit_code == 0, done.stderr
    assert f"min of joints that slide is in {'mm' if long == 1e3 else 'm'}, as d" in done.stdout
    robot = load_robot(out)
    assert robot.model.chain.kinds == ("revolute", "revolute", "prismatic", "revolute")
    numbers = np.array([row[1:] for row in rows])
    np.testing.assert_allclose(robot.model.chain.links[:, :4], numbers[:, :4], atol=1e-11)
    np.testing.assert_allclose(robot.limits, numbers[:, 4:], atol=1e-11)


def test_joints_that_slide_have_other_limits_where_a_table_has_none(tmp_path):
    (tmp_path / "arm.csv").write_text("Kind,d_mm,a_mm,alpha_deg\nlinear,400,0,90\nrotary,0,225,0\n")
    out = tmp_path / "robot.toml"
    done = call("new", "robot", tmp_path / "arm.csv", "--out", out)
    assert "limits of 180 deg, or 1000 mm where it slides, to either side" in done.stdout
    np.testing.assert_allclose(load_robot(out).limits, [[-1, 1], [-np.pi, np.pi]])


def test_a_line_of_units_below_the_names_says_those_of_the_links(tmp_path):
    table = link_table("universal_ur10", tmp_path, ("θ", "d", "a", "α", "min", "max"), 1.0, 1.0)
    names, *rows = table.read_text(encoding="utf-8").splitlines()
    table.write_text("\n".join([names, "rad;m;m;rad;rad;rad", *rows]), encoding="utf-8")
    done = call("new", "robot", table, "--out", tmp_path / "robot.toml")
    assert done.exit_code == 0
    said = [line for line in done.stdout.splitlines() if line.strip().startswith("assumed")]
    assert len(said) == 1
    assert "call these columns alpha_i-1 and a_i-1" in done.stdout
    np.testing.assert_allclose(
        load_robot(tmp_path / "robot.toml").model.chain.links,
        load_robot("universal_ur10").model.chain.links, rtol=0, atol=1e-12,
    )  # fmt: skip


def test_a_column_that_numbers_the_joints_is_no_assumption(tmp_path):
    table = tmp_path / "links.csv"
    table.write_text("Joint,maker,theta_deg,d_mm,a_mm,alpha_deg\n1,x,0,100,300,90\n2,y,0,0,200,0\n")
    said = call("new", "robot", table, "--out", tmp_path / "robot.toml").stdout
    assert "not used: maker" in said
    assert "Joint," not in said


def test_a_robot_to_fill_in_is_told_as_such(tmp_path):
    out = tmp_path / "robot.toml"
    assert "every link number is 0" in call("new", "robot", "--joints", 7, "--out", out).stdout
    assert load_robot(out).model.chain.n_joints == 7
    done = call("check", out)
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.endswith(
        "robot has no lengths: all d and a are 0; write the link numbers. [S37]\n"
    )
    out.write_text(out.read_text().replace("d_mm = 0.0", "d_mm = 100.0"))
    assert "a robot, robot: 7 joints, link lengths of 700 mm in total" in call("check", out).stdout


def test_an_arm_whose_axes_meet_where_it_ends_is_no_robot_to_fill_in(tmp_path):
    """A slide, or a table that turns, described by its maker."""
    links = '<link name="foot"/><link name="tool0"/>'
    for kind in ("revolute", "prismatic"):
        (tmp_path / "arm.urdf").write_text(
            f'<robot name="one">{links}<joint name="a" type="{kind}"><parent link="foot"/>'
            '<child link="tool0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
            "</robot>"
        )
        done = call("check", tmp_path / "arm.urdf")
        assert (done.exit_code, done.stderr) == (0, "")
        assert "a robot description, one: 1 joint, link lengths of 0 mm in total" in done.stdout


@pytest.mark.parametrize(
    ("joints", "told"),
    [
        ("321", "links.csv:3: joint 2 stands below 3; order the lines from the base to the flange"),
        (["J1", "J2", "J2"], "links.csv:4: joint J2 stands below J2; order the lines from the"),
        ("134", "links.csv:3: joint 3 stands below 1; order the lines"),
        (["A", "B", "A"], None),
        ("012", None),
    ],
)
def test_lines_that_their_own_numbers_contradict_are_no_arm(joints, told, tmp_path):
    rows = "".join(f"{name},0,{100 + k},0,90\n" for k, name in enumerate(joints))
    (tmp_path / "links.csv").write_text(f"joint,theta_deg,d_mm,a_mm,alpha_deg\n{rows}")
    out = tmp_path / "robot.toml"
    done = call("new", "robot", tmp_path / "links.csv", "--out", out)
    assert done.exit_code == (0 if told is None else 2), done.output
    assert out.exists() == (told is None)
    assert (told or "") in done.stderr


def test_link_numbers_are_in_the_units_that_their_names_state(tmp_path):
    """Not in those that are guessed from their sizes: 31 cm are no 31 mm."""
    (tmp_path / "links.csv").write_text(
        "theta [gon],d [cm],a [ft],alpha [mrad],max speed\n0,31,0.5,1500,90\n100,0,1,0,90\n"
    )
    done = call("new", "robot", tmp_path / "links.csv", "--out", tmp_path / "robot.toml")
    assert "max speed is in deg/s, by its size" in done.stdout
    links = load_robot(tmp_path / "robot.toml").model.chain.links[:, :4]
    expected = [[0, 0.31, 0.1524, 1.5], [np.pi / 2, 0, 0.3048, 0]]
    np.testing.assert_allclose(links, expected, rtol=0, atol=1e-11)
    (tmp_path / "links.csv").write_text("theta_deg,d [deg],a_mm,alpha_deg\n0,3,4,5\n")
    done = call("new", "robot", tmp_path / "links.csv", "--out", tmp_path / "new.toml")
    assert done.stderr.endswith(
        "d [deg] is in deg, and must be a length; write one of m, mm, um, in, cm, ft. [M21]\n"
    )


def test_limits_of_what_slides_are_lengths(tmp_path):
    head = "type,theta_deg,d_mm,a_mm,alpha_deg,lower [mm],upper [mm]\n"
    (tmp_path / "links.csv").write_text(f"{head}P,0,0,100,90,-50,400\nP,0,0,200,90,0,300\n")
    done = call("new", "robot", tmp_path / "links.csv", "--out", tmp_path / "robot.toml")
    assert done.exit_code == 0, done.stderr
    limits = load_robot(tmp_path / "robot.toml").limits
    np.testing.assert_allclose(limits, [[-0.05, 0.4], [0.0, 0.3]], rtol=0, atol=1e-12)


def test_a_table_without_link_numbers_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("theta,d,length\n1,2,3\n")
    (tmp_path / "b.csv").write_text("theta,d,a,alpha\n1,x,3,4\n")
    (tmp_path / "c.csv").write_text("theta,d_mm,a,alpha\ndeg,m,m,deg\n1,2,3,4\n")
    for name, told in (
        ("a.csv", "a.csv: has no column for a_mm, alpha_deg; theta_deg, d_mm"),
        ("b.csv", 'b.csv:2: d is "x"; write a number. [M25]'),
        ("c.csv", "c.csv: is called d_mm, and the line below the names says m; correct the one"),
    ):
        done = call("new", "robot", tmp_path / name, "--out", tmp_path / "robot.toml")
        assert (done.exit_code, done.stdout) == (2, "")
        assert told in done.stderr
    assert not (tmp_path / "robot.toml").exists()


@pytest.mark.parametrize("robot", robot_names())
def test_a_new_scene_fits_its_robot(robot, tmp_path):
    out = tmp_path / "my scene.toml"
    assert call("new", "scene", robot, "--out", out).exit_code == 0
    scenario = load_scenario(out)
    assert robot_of(scenario, "a").name == robot
    assert (scenario.name, len(scenario.trial)) == ("my_scene", 2)
    assert f"a scenario, my_scene, for {robot}; trials: designed-" in call("check", out).stdout
    again = call("new", "scene", robot, "--out", out)
    assert (again.exit_code, "exists already" in again.stderr) == (2, True)


@pytest.mark.parametrize(
    ("scene", "changes", "told"),
    [
        ("quick", {"tracker.station_mm": [300.0, 0.0, 300.0]}, "in the robot's work space"),
        ("quick", {"tracker.station_mm": [2.6, -2.0, 0.3]}, "it is in mm: are these meters?"),
        ("quick", {"tracker.station_mm": [2600.0, 0.0, -3000.0]}, "below the floor"),
        ("stations", {"fixtures.stations_mm": [[300.0, 0.0, 300.0]]}, "stations_mm entry 1"),
        ("stations", {"fixtures.anchors_mm": {"P1": [0.0, 0.0, 0.0]}, "fixtures.free": ["B"]},
         'anchor "P1" at (0, 0, 0) mm sees nothing'),
    ],
)  # fmt: skip
def test_where_no_tracker_can_stand_the_check_says_so_as_the_run_does(
    scene, changes, told, tmp_path
):
    file = tmp_path / "scene.toml"
    scenario = changed(load_scenario(scene), {"pool.size": 100, **changes})
    file.write_text(dump_scenario(scenario), encoding="utf-8")
    done = call("check", file)
    assert (done.exit_code, done.stdout) == (2, "")
    assert told in done.stderr
    with pytest.raises(InputError) as caught:
        make_setting(scenario)
    assert str(caught.value) in done.stderr


def test_a_plan_that_looks_for_its_station_stands_wherever_it_finds_best(tmp_path):
    """Not at that of [tracker], of which a run would say that no tracker can stand there."""
    file, places = tmp_path / "scene.toml", {"plan.stations.list_mm": [[2600.0, -2000.0, 300.0]]}
    scenario = changed(
        load_scenario("quick"), {"tracker.station_mm": [300.0, 0.0, 300.0], **places}
    )
    file.write_text(dump_scenario(scenario), encoding="utf-8")
    assert call("check", file).exit_code == 0


@pytest.mark.parametrize("named", ["arm.urdf", "models", "models/robot.toml"])
def test_a_new_scene_finds_its_robot_from_wherever_it_is_read(named, tmp_path, monkeypatch):
    """Paths of a scenario begin in its own folder, the user's in the one where he is."""
    shipped = load_robot("staubli_tx60").folder
    (tmp_path / "models").mkdir()
    (tmp_path / "scenes").mkdir()
    (tmp_path / "models/robot.toml").write_text(
        (shipped / "robot.toml").read_text().split("[[parts]]")[0]
    )
    text = (shipped / "staubli_tx60.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(re.sub(r"(?s)<(visual|collision).*?</\1>", "", text))
    monkeypatch.chdir(tmp_path)
    for out in ("scene.toml", "scenes/scene.toml"):
        assert call("new", "scene", named, "--out", out).exit_code == 0
    monkeypatch.chdir("/")
    for out in ("scene.toml", "scenes/scene.toml"):
        assert robot_of(load_scenario(tmp_path / out), "a").name == "staubli_tx60"


@pytest.mark.study
@pytest.mark.parametrize("robot", robot_names())
def test_a_new_scene_is_played(robot, tmp_path):
    out = tmp_path / "scene.toml"
    call("new", "scene", robot, "--out", out)
    assert call("run", out, "--out", tmp_path / "run", "--quiet").exit_code == 0


def test_check_tells_sessions_and_tables(tmp_path):
    (tmp_path / "a.csv").write_text(poses_csv())
    said = call("check", tmp_path / "a.csv", "--robot", "staubli_tx60").stdout
    assert "a.csv: a table, 29 rows" in said
    assert "29 rows of 29 poses; commanded joints; uncertainties from" in said
    assert "with only base and tool fitted, the errors are 0." in said
    (tmp_path / "b.csv").write_text(poses_csv().replace("q1_deg", "J1"))
    said = call("check", tmp_path / "b.csv", "--robot", "staubli_tx60").stdout
    own = len(poses_csv().splitlines()[0].split(","))
    assert f"columns: J1 as q1, {own - 1} with the names that truebed uses\n" in said
    assert "identify needs a session.toml: truebed new session" in said
    (tmp_path / "session.toml").write_text('[frames]\nfile = "a.csv"\n')
    said = call("check", tmp_path).stdout
    assert "a session of frames" in said
    assert "name the robot with --robot" in said
    (tmp_path / "session.toml").write_text(
        'robot = "staubli_tx60"\n[joints]\nfile = "a.csv"\n[frames]\nfile = "a.csv"\n'
    )
    parts = ["identify"] * 20 + ["test"] * 9
    (tmp_path / "a.csv").write_text(csv(with_spread(columns(made())) | {"split": parts, "euler":
                                    ["XYZ"] * 29}))  # fmt: skip
    assert "29 rows of 29 poses, 9 rows held out;" in call("check", tmp_path).stdout
    document = json.loads(call("check", tmp_path, "--json").stdout)
    assert document["sentences"][0] == "a session of frames"
    assert any(text.startswith("29 rows of 29 poses") for text in document["sentences"])
    assert not (tmp_path / "runs").exists()


def test_check_tells_a_drawn_instrument():
    folder = assets.models() / TRACKER
    said = call("check", folder / "tracker.toml").stdout
    assert "a drawn instrument, laser_tracker" in said


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (
            "// AXES = CARTESIAN: X, Y, Z (mm)\nA, 1.5, 2.5, 3.5\nB, 4.5, 5.5, 6.5",
            "an export of po",
        ),
        ("/POS\nP[1]{ GP1: J1= 1 deg, J2= 2 deg, J3= 3 deg, J4= 4 deg };", "a TP program (FANUC)"),
        ("1 2.5 3.5\n2 4.5 5.5", "a table whose columns have no names, 2 rows"),
    ],
)
def test_check_says_what_other_files_are_with_a_robot_as_without(text, what, tmp_path):
    (tmp_path / "a.txt").write_text(text)
    for more in ([], ["--robot", "staubli_tx60"]):
        done = call("check", tmp_path / "a.txt", *more)
        assert done.exit_code == 0
        assert what in done.stdout
    assert "identify needs a session.toml" in " ".join(done.stdout.split())


def test_check_refuses_as_the_verb_would(tmp_path):
    cases = {
        "a.toml": ("[frames]\nfil = 1\n", 'has no key "fil"'),
        "b.toml": ("= 1", "is not TOML"),
        "c.toml": ('format = 1\nname = "x"\njoints = [{kind = "revolute"}]', "[joints 1] needs"),
        "d.toml": ("[trial]\nseed = 1\n", "[S37]"),
        "e.urdf": ("<robot", "[R"),
        "f.csv": ("", "is empty"),
    }
    for name, (text, told) in cases.items():
        (tmp_path / name).write_text(text)
        done = call("check", tmp_path / name)
        assert (done.exit_code, done.stdout) == (2, ""), name
        assert told in done.stderr, done.stderr
    (tmp_path / "none").mkdir()
    for name in (tmp_path / "none", tmp_path / "nothing.csv", "/dev/null"):
        done = call("check", name)
        assert (done.exit_code, done.stderr.count("\n")) == (2, 1)


def test_check_refuses_a_trial_with_too_few_poses_in_the_words_of_run(tmp_path):
    """Six equations a pose for 30 numbers: five give as many as there are, six leave some over."""
    scene = scenario_path("quick")[0].read_text(encoding="utf-8")
    for poses, code in ((3, 2), (5, 2), (6, 0)):
        file = tmp_path / f"few{poses}.toml"
        file.write_text(scene.replace("poses = 29", f"poses = {poses}", 1), encoding="utf-8")
        done = call("check", file)
        assert done.exit_code == code
        if code:
            played = call("run", file, "--out", tmp_path / "run")
            assert played.exit_code == 2
            assert done.stderr == played.stderr
            assert (
                f"{6 * poses} equations for 30 parameters; write poses = 6 or more" in done.stderr
            )


@pytest.mark.parametrize("above", ["", "# alpha, a, theta, d\n"])
def test_link_numbers_without_names_are_to_be_named(above, tmp_path):
    """They were to get names of joints and places, or a session.toml."""
    (tmp_path / "mdh.csv").write_text(above + "0,0,0,118\n1.57,0,3.14,0\n0,612.7,0,0\n")
    out = tmp_path / "robot.toml"
    done = call("new", "robot", tmp_path / "mdh.csv", "--out", out)
    assert done.exit_code == 2
    said = " ".join(done.stderr.split())
    assert "does not name its columns; theta_deg, d_mm, a_mm, alpha_deg" in said
    assert "session.toml" not in said


def test_a_urdf_becomes_a_folder_with_its_robot_toml(tmp_path, monkeypatch):
    """Its owner was sent to Python, and `new robot` said that the file was no table."""
    monkeypatch.chdir(tmp_path)
    arm = load_robot("staubli_tx60")
    truebed.write_robot(arm, arm.model, "given")
    done = call("new", "robot", "given/staubli_tx60.urdf", "--tip", "tool0")
    assert done.exit_code == 0, done.stderr
    assert done.stdout.splitlines() == [
        "Robot      staubli_tx60/robot.toml", "Next       truebed check staubli_tx60/robot.toml",
    ]  # fmt: skip
    made, q = load_robot("staubli_tx60/robot.toml"), np.random.default_rng(0).normal(size=(20, 6))
    np.testing.assert_allclose(made.model.poses(q), arm.model.poses(q), rtol=0, atol=1e-12)
    assert len(made.visuals) == len(arm.visuals)
    assert call("check", "staubli_tx60/robot.toml").exit_code == 0
    # a file or a folder may be named, and nothing is written over
    call("new", "robot", "given/staubli_tx60.xml", "--tip", "tool", "--out", "named/robot.toml")
    assert load_robot("named").name == "staubli_tx60"
    again = call("new", "robot", "given/staubli_tx60.urdf", "--tip", "tool0")
    assert again.exit_code == 2
    assert "staubli_tx60: has robot.toml already" in again.stderr


def test_where_the_base_of_a_urdf_s_chain_stands_is_said_and_kept(tmp_path):
    """Poses of a program are stated there from then on, and no more in the root link."""
    arm = tmp_path / "arm.urdf"
    arm.write_text(
        '<robot name="k"><link name="world"/><link name="a"/><link name="b"/><link name="c"/>'
        '<joint name="w" type="revolute"><parent link="world"/><child link="a"/>'
        '<origin xyz="1 0 0.5"/><axis xyz="0 0 -1"/>'
        '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        '<joint name="v" type="revolute"><parent link="a"/><child link="b"/>'
        '<origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>'
        '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        '<joint name="t" type="fixed"><parent link="b"/><child link="c"/>'
        '<origin xyz="0.5 0 0"/></joint></robot>'
    )
    done = call("new", "robot", arm, "--out", tmp_path / "k")
    said = (
        "programs for it state poses in its base, at (1000, 0, 500) mm in the root link of arm.urdf"
    )
    assert said in done.stdout
    made = load_robot(tmp_path / "k")
    assert any(said in note for note in made.notes)
    np.testing.assert_allclose(made.model.chain.T_world_base[:3, 3], [1, 0, 0.5], atol=1e-12)


def test_only_a_urdf_or_mjcf_has_a_tip(tmp_path):
    table = tmp_path / "dh.csv"
    table.write_text("d_mm,a_mm,alpha_deg\n400,5,90\n")
    done = call("new", "robot", table, "--tip", "tool0", "--out", tmp_path / "robot.toml")
    assert done.exit_code == 2
    assert done.stderr == (
        f"{table}: a tip and meshes are asked of a URDF or MJCF alone; leave them out. [S37]\n"
    )
    assert not (tmp_path / "robot.toml").exists()
