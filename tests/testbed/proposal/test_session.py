"""Ten files of ten kinds: what `new session` writes of them, `identify` takes."""

import re
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from calib.geometry.frames import log_so3
from testbed.files import probe as probing
from testbed.files.probe import probe
from testbed.files.read import read_session
from tests.command import call
from tests.testbed import files
from tests.testbed.files.campaign import table as visit_table
from tests.testbed.files.campaign import visit
from tests.testbed.files.made import ROBOT, columns, csv, made, poses_csv

M = 40
ARM = np.array([0.05, 0.03, 0.08])
JOINTS = ("q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg")
ROS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
       "wrist_2_joint", "wrist_3_joint")  # fmt: skip


def data():
    return made(3, M)


def points():
    """Of a reflector beside the flange [mm]."""
    return (data().T[:, :3, 3] + data().T[:, :3, :3] @ ARM) * 1e3


def joints(*names, factor=1.0):
    own = columns(data())
    return {name: own[joint] * factor for name, joint in zip(names, JOINTS, strict=True)}


def places(*names, values=None):
    return dict(zip(names, (points() if values is None else values).T, strict=True))


def write(folder, **files):
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text, encoding="utf-8")
    return [folder / name.replace("__", ".") for name in files]


def own_csv(folder):
    return write(folder, a__csv=poses_csv(data()))


def rotation_vectors(folder):
    own = columns(data())
    turn = np.degrees(log_so3(data().T[:, :3, :3]))
    table = {name: own[name] for name in (*JOINTS, "x_mm", "y_mm", "z_mm")}
    return write(
        folder, a__csv=csv(table | {f"rv{a}_deg": turn[:, k] for k, a in enumerate("xyz")})
    )


def sa_points(folder):
    rows = [f"Coll,  Main,  {k + 1},  {x:.6f},  {y:.6f},  {z:.6f},  02/12/25 16:38:29"
            for k, (x, y, z) in enumerate(points())]  # fmt: skip
    head = [
        "// Points Relative to Coordinate Frame 'A::WORLD'",
        "// AXES = CARTESIAN: X, Y, Z (mm)",
    ]
    named = {"pose_id": np.arange(1, M + 1)} | joints(*JOINTS)
    return write(folder, joints__csv=csv(named), points__txt="\n".join([*head, *rows]))


def sa_frames(folder):
    own = columns(data(), euler="xyz")
    numbers = np.column_stack([own[f"{a}_mm"] for a in "xyz"] + [own[f"r{a}_deg"] for a in "xyz"])
    rows = [", ".join([f"F{k}", *(f"{v:.6f}" for v in row)]) for k, row in enumerate(numbers)]
    return write(
        folder, joints__csv=csv(joints(*JOINTS)), frames__txt="\n".join(["// Frames", *rows])
    )


def sa_quaternions(folder, order="xyzw"):
    own = columns(data(), form="quaternion")
    numbers = np.column_stack([own[f"{a}_mm"] for a in "xyz"] + [own[f"q{a}"] for a in order])
    rows = [", ".join([f"F{k}", *(f"{v:.9f}" for v in row)]) for k, row in enumerate(numbers)]
    return write(folder, joints__csv=csv(joints(*JOINTS)), frames__txt="\n".join(rows))


def sa_scalar_first(folder):
    return sa_quaternions(folder, "wxyz")


def leica(folder):
    table = {"Point ID": [f"P{k}" for k in range(M)]} | places("X [mm]", "Y [mm]", "Z [mm]")
    table |= joints(*(f"A{k} (deg)" for k in range(1, 7))) | {"Comment": ["ok"] * M}
    return write(folder, export__csv=csv(table))


def semicolons(folder):
    table = joints(*(f"J{k}" for k in range(1, 7))) | places("X", "Y", "Z")
    return write(folder, a__csv=csv(table, separator=";", decimal=","))


def workbook(folder):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.title = "Joints"
    tables = {"Joints": {"Pose": np.arange(M)} | joints(*(f"Joint {k} [°]" for k in range(1, 7))),
              "Tracker": {"Pose": np.arange(M)} | places("x", "y", "z")}  # fmt: skip
    for name, table in tables.items():
        sheet = book[name] if name in book.sheetnames else book.create_sheet(name)
        sheet.append(list(table))
        for row in zip(*table.values(), strict=True):
            sheet.append([float(value) for value in row])
    book.save(folder / "a.xlsx")
    return [folder / "a.xlsx"]


def ros(folder):
    own = columns(data())
    table = joints(*ROS, factor=np.pi / 180) | {f"Goal {a}": own[f"{a}_mm"] for a in "xyz"}
    table |= {f"measurement_{a}": own[f"{a}_mm"] / 1e3 for a in "xyz"}
    table |= {f"measurement_r{a}": own[f"r{a}_deg"] for a in "xyz"}
    return write(folder, a__csv=csv(table))


def headerless(folder):
    table = joints(*JOINTS) | places("x", "y", "z")
    return write(folder, a__csv="\n".join(csv(table).splitlines()[1:]))


def rapid(folder):
    own = np.column_stack(list(joints(*JOINTS).values()))
    absent = "[9E9,9E9,9E9,9E9,9E9,9E9]"
    targets = [", ".join(f"{value:.9f}" for value in row) for row in own]
    lines = [
        f"  CONST jointtarget p{k} := [[{row}],{absent}]; ! {k}" for k, row in enumerate(targets)
    ]
    lines = ["MODULE Cal", *lines, "ENDMODULE"]
    table = places("X/mm", "Y/mm", "Z/mm")
    return write(folder, cal__mod="\n".join(lines), tracker__csv=csv(table))


def tracker(folder):
    table = places("X", "Y", "Z") | {f"U95{a}": np.full(M, 0.035) for a in "XYZ"}
    named = joints(*(f"axis_{k}" for k in range(1, 7)))
    return write(folder, joints__csv=csv(named), tracker__csv=csv(table | {"Time": ["12:00"] * M}))


KINDS = (
    own_csv,
    rotation_vectors,
    sa_points,
    sa_frames,
    sa_quaternions,
    sa_scalar_first,
    leica,
    semicolons,
    workbook,
    ros,
    headerless,
    rapid,
    tracker,
)


def proposed(folder, files, *more):
    done = call("new", "session", *files, "--out", folder / "session.toml", *more)
    assert done.exit_code == 0, done.stderr
    return done.stdout, (folder / "session.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_what_is_proposed_is_read_as_it_was_meant(kind, tmp_path):
    files = kind(tmp_path)
    _, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    session = read_session(tmp_path / "session.toml", ROBOT)
    table = session.measurements
    # nine decimals of a degree, or six of a millimeter, are written
    np.testing.assert_allclose(table.q, data().q, rtol=0, atol=2e-11)
    meant = points() / 1e3 if not table.is_pose.any() else data().T[:, :3, 3]
    np.testing.assert_allclose(table.position, meant, rtol=0, atol=1e-9)
    if table.is_pose.all():
        np.testing.assert_allclose(table.rotation, data().T[:, :3, :3], rtol=0, atol=2e-8)
    found = probe(ROBOT, session)
    found.raise_if_wrong()
    assert found.stated.position < 2e-3
    # the figures that `check` and `identify` give
    said = f"fitted to a nominal staubli_tx60, errors are {found.stated.shown}"
    assert f"with only base and tool {said}" in text.replace("\n# ", " ")
    assert tomllib.loads(text)["robot"] == "staubli_tx60"
    assert call("check", tmp_path).exit_code == 0


def test_files_are_named_from_their_folder_however_they_are_given(tmp_path, monkeypatch):
    """By a path through another folder, or one of them from the root."""
    (tmp_path / "b" / "c").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    files = [Path("b/c/../joints.csv"), tmp_path / "b" / "points.csv"]
    named = {"pose_id": np.arange(M)}
    files[0].write_text(csv(named | joints(*JOINTS)))
    files[1].write_text(csv(named | places("x_mm", "y_mm", "z_mm")))
    done = call("new", "session", *files, "--robot", "staubli_tx60")
    assert done.exit_code == 0, done.stderr
    written = tomllib.loads(Path("session.toml").read_text(encoding="utf-8"))
    assert [written[key]["file"] for key in ("joints", "points")] == [
        "b/joints.csv",
        "b/points.csv",
    ]
    np.testing.assert_allclose(
        read_session(tmp_path / "session.toml", ROBOT).measurements.q, data().q, rtol=0, atol=2e-11
    )


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_what_is_proposed_identifies(kind, tmp_path):
    proposed(tmp_path, kind(tmp_path), "--robot", "staubli_tx60")
    out = tmp_path / "out"
    done = call("identify", "staubli_tx60", tmp_path / "session.toml", "--out", out, "--quiet")
    assert done.exit_code == 0, done.stderr
    assert (out / "report.html").is_file()


@pytest.mark.parametrize("kind", [leica, semicolons, headerless, rapid], ids=lambda k: k.__name__)
def test_without_a_robot_units_are_by_size_and_that_is_said(kind, tmp_path):
    said, text = proposed(tmp_path, kind(tmp_path))
    assert said.startswith("no robot was named: units and conventions are guessed from")
    assert "no robot was named" in text
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.q, data().q, rtol=0, atol=2e-11)
    np.testing.assert_allclose(table.position, points() / 1e3, rtol=0, atol=1e-9)


@pytest.mark.study
@pytest.mark.parametrize("series", ["Series_B", "Series_C", "Series_D"])
def test_the_session_of_a_real_robot_is_the_one_written_by_hand(series, tmp_path):
    """Landgraf et al. 2021: `;`, decimal commas, ROS names, targets and scatter beside them."""
    here = Path(__file__).parents[3].parent / "shared" / "data" / "ipa_ur10" / series
    if not here.is_dir():
        pytest.skip("the UR10 measurements are not part of this repository")
    (file,) = here.glob("measurements*.csv")
    (tmp_path / "a.csv").write_bytes(file.read_bytes())
    said, text = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", "universal_ur10")
    mine = tomllib.loads(text)
    by_hand = tomllib.loads((Path(files.__file__).parent / "ur10.toml").read_text())
    beside = {"time": "Timestamp", "temperature_degC": "measurement_temperature"}
    assert mine["joints"]["columns"] == by_hand["joints"]["columns"] | beside
    assert mine["frames"]["columns"] == by_hand["frames"]["columns"] | beside
    assert mine["frames"]["euler"] == by_hand["frames"]["euler"]
    assert '"Goal x", "Goal y", "Goal z"' in text
    assert "too little" not in said


def refused(tmp_path, *words):
    out = tmp_path / "session.toml"
    before = out.read_bytes() if out.exists() else None
    done = call("new", "session", *words, "--out", out)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert (out.read_bytes() if out.exists() else None) == before
    return done.stderr


def test_nothing_is_written_over_another_or_where_nothing_is_understood(tmp_path):
    (file,) = semicolons(tmp_path)
    folder = tmp_path / "below"
    folder.mkdir()
    (folder / "a.csv").write_text("x_t,x_dif,joint_1\n1,2,3\n4,5,6\n")
    said = refused(tmp_path, folder / "a.csv")
    assert "has no column known as a reading; columns X Y Z" in said
    assert "x_t, x_dif are targets or differences: give what was measured" in said
    (folder / "polar.csv").write_text("joint_1,Hz [gon],D [mm]\n1,20,3000\n")
    said = refused(tmp_path, folder / "polar.csv")
    assert "export the X Y Z of the same points" in said
    assert "beside Hz [gon], name one azimuth" in said
    (folder / "b.csv").write_text("1,2,3,4,5,6,7,8,9\n")
    assert "b.csv: is one line of numbers: nothing states" in refused(
        tmp_path, file, folder / "b.csv"
    )
    (folder / "c.csv").write_text("1,2,3\n")
    assert "c.csv: is one line of numbers: nothing states" in refused(tmp_path, folder / "c.csv")
    assert "is a folder" in refused(tmp_path, folder)
    assert "does not exist" in refused(tmp_path, tmp_path / "c.csv")
    assert 'there is no robot "tx60"' in refused(tmp_path, file, "--robot", "tx60")
    done = call("new", "session", file, "--out", folder / "session.toml")
    assert (done.exit_code, "lie in the folder of the session" in done.stderr) == (2, True)
    assert f"copy it there, or give --out in {tmp_path}. [R6]" in done.stderr
    done = call("new", "session", file, "--out", folder / "none" / "session.toml")
    assert (done.exit_code, "/none does not exist" in done.stderr) == (2, True)
    (tmp_path / "session.toml").write_text("mine")
    assert "session.toml: exists already; choose another --out" in refused(tmp_path, file)


@pytest.mark.slow
def test_another_robot_fits_no_reading_and_a_missed_shot_still_shows_it(tmp_path, monkeypatch):
    """Links are fitted to the stated reading and to the best others, each once: they take long."""
    fitted, links_fit = [], probing.links_fit

    def counted(model, table, *further, **named):
        fitted.append((table.q.tobytes(), table.position.tobytes()))
        return links_fit(model, table, *further, **named)

    monkeypatch.setattr(probing, "links_fit", counted)
    said, _ = proposed(tmp_path, headerless(tmp_path), "--robot", "universal_ur10")
    assert 0 < len(fitted) == len(set(fitted)) <= 1 + probing.MOST_LINKS
    assert re.search(
        r"none of \d+ interpretations of these files fits a nominal universal_ur10: is", said
    )
    (tmp_path / "session.toml").unlink()
    rows = (tmp_path / "a.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    slipped = [",".join([*one[:6], *other[6:]]) for one, other in pairwise(cells)]
    (tmp_path / "a.csv").write_text("\n".join([*rows[:20], *slipped[20:]]))
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", "staubli_tx60")
    assert re.search(r"errors are [01]\.\d+ mm", said)


def test_files_of_one_kind_are_stations(tmp_path):
    """The second one sees another frame, and not every pose."""
    named = {"Pose": np.arange(M)}
    turned = points() @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + [100.0, 200.0, 300.0]
    rows = slice(5, None)
    two = {"Pose": named["Pose"][rows]} | places("X", "Y", "Z", values=turned[rows])
    files = write(
        tmp_path,
        joints__csv=csv(named | joints(*(f"J{k}" for k in range(1, 7)))),
        one__csv=csv(named | places("X", "Y", "Z")),
        two__csv=csv(two),
    )
    said, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert tomllib.loads(text)["points"]["files"] == ["one.csv", "two.csv"]
    assert "assumed  stations: each file is one" in said
    assert "unused" not in said
    session = read_session(tmp_path / "session.toml", ROBOT)
    assert session.station_names == ("1", "2")
    assert len(session.measurements) == 2 * M - 5


def test_a_column_of_stations_is_read_by_other_names_and_files_come_before_one_that_tells_none(
    tmp_path,
):
    """One file with the rows of both stations; two files that only name the make of the tracker."""
    turned = points() @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + [100.0, 200.0, 300.0]
    q = joints(*(f"J{k}" for k in range(1, 7)))
    one, two = (
        {"Pose": np.arange(M), "Station": [name] * M} | q | places("X", "Y", "Z", values=seen)
        for name, seen in (("LT 1", points()), ("LT 2", turned))
    )
    both = {key: [*one[key], *two[key]] for key in one}
    _, text = proposed(tmp_path, write(tmp_path, a__csv=csv(both)), "--robot", "staubli_tx60")
    assert tomllib.loads(text)["points"]["columns"]["station"] == "Station"
    assert read_session(tmp_path / "session.toml", ROBOT).station_names == ("LT 1", "LT 2")
    (tmp_path / "session.toml").unlink()
    alike = [csv(each | {"Station": ["AT960"] * M}) for each in (one, two)]
    files = write(tmp_path, one__csv=alike[0], two__csv=alike[1])
    said, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert "to fix" not in said
    assert "station" not in tomllib.loads(text)["points"]["columns"]


def test_files_of_one_head_with_joints_of_their_own_are_visits(tmp_path):
    """Three visits of one arm; where the joints are the same, the files are stations."""
    files = write(
        tmp_path, **{f"{name}__csv": visit_table(visit(k, 20)) for k, name in enumerate("abc")}
    )
    said, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert "3 files have the same columns and joints of their own" in said
    assert [one["file"] for one in tomllib.loads(text)["session"]] == ["a.csv", "b.csv", "c.csv"]
    read = read_session(tmp_path / "session.toml", ROBOT)
    assert [one.name for one in read.visits] == ["a", "b", "c"]
    assert read.fixtures.counts == (0, 0, 2, 2)
    told = call("check", tmp_path / "session.toml").stdout
    assert "3 sessions of one robot: a, b, c" in told
    assert told.count("with only base and tool fitted, the errors are") == 3


def test_visits_that_count_their_poses_anew_are_visits_whichever_counts_they_share(tmp_path):
    """Of the two counts some were shared and some not: the second file was refused as contradicting
    the first, M31."""
    counts = ("a", range(20, 40)), ("b", [*range(15, 25), *range(50, 60)])
    for k, (name, count) in enumerate(counts):
        (tmp_path / f"{name}.csv").write_text(visit_table(visit(k, 20), pose_id=list(count)))
    files = [tmp_path / "a.csv", tmp_path / "b.csv"]
    said, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert "2 files have the same columns and joints of their own" in said
    assert "to fix" not in said
    assert [one["file"] for one in tomllib.loads(text)["session"]] == ["a.csv", "b.csv"]
    read = read_session(tmp_path / "session.toml", ROBOT)
    assert len(set(read.measurements.pose_id.tolist())) == 40


def test_files_called_so_judge_with_the_frames_of_the_others(tmp_path):
    """They were proposed as visits with frames of their own, a third of whose poses then judged."""
    names = ("day_1", "day_2", "Validation-2")
    files = write(
        tmp_path, **{f"{name}__csv": visit_table(visit(k, 20)) for k, name in enumerate(names)}
    )
    said, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert "by its name Validation-2.csv only judges the calibration" in said
    assert "Of the others, 2 files have the same columns" in said
    assert [
        (one["base"], one["tool"], one.get("held_out", False))
        for one in tomllib.loads(text)["session"]
    ] == [("free", "free", False)] * 2 + [("same as day_1", "same as day_1", True)]
    read = read_session(tmp_path / "session.toml", ROBOT)
    assert read.is_test.sum() == 20
    assert read.fixtures.counts == (0, 0, 1, 1)  # those of day_2
    # files of one name in two folders
    (tmp_path / "session.toml").unlink()
    for k, name in enumerate(("cal_data", "val_data")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.csv").write_text(visit_table(visit(k, 20)), encoding="utf-8")
    files = [tmp_path / name / "a.csv" for name in ("cal_data", "val_data")]
    _, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    read = read_session(tmp_path / "session.toml", ROBOT)
    assert [(one.name, one.held_out) for one in read.visits] == [
        ("cal_data a.csv", False), ("val_data a.csv", True),
    ]  # fmt: skip
    # words of another meaning, and files that are all called so
    for pair in (("contest", "latest"), ("test_1", "test_2")):
        (tmp_path / "session.toml").unlink()
        files = write(
            tmp_path, **{f"{name}__csv": visit_table(visit(k, 20)) for k, name in enumerate(pair)}
        )
        _, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
        assert all("held_out" not in one for one in tomllib.loads(text)["session"])


@pytest.mark.parametrize("targets", [1, 3])
def test_files_of_one_head_without_names_of_poses_are_visits(targets, tmp_path):
    """The first half of the rows in one file, the others in another frame in a second one."""
    places_of = [data().T[:, :3, 3] + data().T[:, :3, :3] @ (ARM + np.array([0, 0.05 * k, 0]))
                 for k in range(targets)]  # fmt: skip
    half = np.arange(M) < M // 2
    for name, rows, shift in (("a", half, 0.0), ("b", ~half, 2.5)):
        table = {
            joint: column[rows] for joint, column in joints(*(f"J{k}" for k in range(1, 7))).items()
        }
        for k, seen in enumerate(places_of):
            label = f"N{k + 1} " if targets > 1 else ""
            table |= places(*(f"{label}{a}" for a in "XYZ"), values=1e3 * (seen[rows] + shift))
        (tmp_path / f"{name}.csv").write_text(csv(table))
    said, text = proposed(
        tmp_path, [tmp_path / "a.csv", tmp_path / "b.csv"], "--robot", "staubli_tx60"
    )
    assert "2 files have the same columns and joints of their own" in said
    assert "unused" not in said
    assert [one["file"] for one in tomllib.loads(text)["session"]] == ["a.csv", "b.csv"]
    read = read_session(tmp_path / "session.toml", ROBOT)
    assert len(read.measurements) == targets * M
    assert len(read.visits) == 2


def test_files_without_headers_of_one_form_are_visits(tmp_path):
    """Only the longest was read, and the others were called unused."""

    def bare(rows, shift=0.0):
        q = np.degrees(data().q[rows])
        return "".join(
            ",".join(f"{value:.6f}" for value in (*own, *seen)) + "\n"
            for own, seen in zip(q, 1e3 * (data().T[rows, :3, 3] + shift), strict=True)
        )

    half = np.arange(M) < M // 2
    files = write(tmp_path, a__csv=bare(half), verify__csv=bare(~half))
    _, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert "unused" not in text
    a, judge = tomllib.loads(text)["session"]
    assert a["file"] == "a.csv"
    assert (judge["file"], judge["base"], judge["held_out"]) == ("verify.csv", "same as a", True)
    read = read_session(tmp_path / "session.toml", ROBOT)
    assert np.array_equal(read.is_test, ~half)
    # the same joints seen from elsewhere are no visit
    (tmp_path / "session.toml").unlink()
    files = write(tmp_path, a__csv=bare(half), b__csv=bare(half, 1.0))
    said, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert "session" not in tomllib.loads(text)
    assert "unused   b.csv" in said


def test_several_targets_and_missed_shots_leave_files_of_one_head_stations(tmp_path):
    """Joints beside each of two targets; each station missed some shots, and a pose the other saw.

    The same poses at other joints are visits, and so are poses of other names.
    """
    q, seen = joints(*(f"J{k}" for k in range(1, 7))), points()
    rows = np.repeat(np.arange(M), 2)
    own = {"Pose": rows, "Target": np.tile([1, 2], M)} | {k: v[rows] for k, v in q.items()}
    seen = np.stack([seen, seen + 100 * data().T[:, :3, 2]], axis=1).reshape(-1, 3)
    own |= places("X", "Y", "Z", values=seen)
    kept = {"one": np.arange(2 * M) > 2, "two": (rows != M - 1) & (np.arange(2 * M) != 9)}
    tables = {k: {name: v[use] for name, v in own.items()} for k, use in kept.items()}
    tables["two"] |= {"X": -tables["two"]["Y"], "Y": tables["two"]["X"] + 500}
    files = write(tmp_path, **{f"{k}__csv": csv(table) for k, table in tables.items()})
    said, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert tomllib.loads(text)["points"]["files"] == ["one.csv", "two.csv"]
    assert "file" not in tomllib.loads(text)["joints"]  # each file says its own
    assert "unused" not in said
    read = read_session(tmp_path / "session.toml", ROBOT).measurements
    assert np.bincount(read.station).tolist() == [k.sum() for k in kept.values()]
    assert read.n_poses == M
    renamed = tables["two"] | {"Pose": 100 + tables["two"]["Pose"]}
    write(tmp_path, two__csv=csv(renamed))
    (tmp_path / "session.toml").unlink()
    _, text = proposed(tmp_path, files, "--robot", "staubli_tx60")
    assert [one["name"] for one in tomllib.loads(text)["session"]] == ["one", "two"]


def test_a_file_that_is_left_aside_is_named(tmp_path):
    files = [*semicolons(tmp_path), *write(tmp_path, b__csv="time,note\n1,a\n")]
    said, text = proposed(tmp_path, files)
    assert "unused   b.csv\n" in said
    assert "# Not used:\n#   b.csv\n" in text


def test_words_of_a_file_stay_words(tmp_path):
    """Names that would end a string, a comment or a line of TOML."""
    own = places("X", "Y", "Z") | joints(*(f"J{k}" for k in range(1, 7)))
    odd = {'"a""b]"': np.arange(M), "c\\nd": np.arange(M), "x'#": np.arange(M)}
    (file,) = write(tmp_path, a__csv=csv(own | odd, separator=";"))
    _, text = proposed(tmp_path, [file])
    assert tomllib.loads(text)["points"]["columns"] == {"x_mm": "X", "y_mm": "Y", "z_mm": "Z"}
    assert '# not used: "a\\"b]", "c\\\\nd", "x\'#"' in text


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("drive", ["Torque A{} [Nm]", "Motor current {} (mA)"])
def test_drives_payload_warmth_and_order_are_proposed(apart, drive, tmp_path):
    own = joints(*(f"J{k}" for k in range(1, 7)))
    load = np.random.default_rng(0).normal(0, 20, (M, 6)).round(6)
    own |= {drive.format(k + 1): load[:, k] for k in range(6)}
    beside = {
        "Order": np.arange(M),
        "Load [kg]": np.full(M, 2.0),
        "Temp [C]": np.linspace(20, 25, M),
    }
    center = zip("XYZ", (5, 0, 60), strict=True)
    beside |= {f"Payload {axis} [mm]": np.full(M, value) for axis, value in center}
    named, seen = {"Pose": np.arange(M)}, places("X", "Y", "Z")
    if apart:
        files = write(tmp_path, a__csv=csv(named | own), b__csv=csv(named | seen | beside))
    else:
        files = write(tmp_path, a__csv=csv(named | own | seen | beside))
    proposed(tmp_path, files, "--robot", "staubli_tx60")
    session = read_session(tmp_path / "session.toml", ROBOT)
    found, unit = session.measurements.conditions, 1e-3 if "mA" in drive else 1.0
    np.testing.assert_allclose(found.torque, unit * load, atol=1e-9)
    assert session.rows_say.drive == ("current" if "mA" in drive else "torque")
    assert found.payload.tolist() == [2.0] * M
    np.testing.assert_allclose(found.center, np.tile([0.005, 0, 0.06], (M, 1)), atol=1e-15)
    assert found.temperature[-1] == 25.0
    assert np.abs(found.approach[1:]).min() == 1.0
    assert not any("not used" in note for note in session.notes)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_few_distances_do_not_win_over_many_points(backwards, tmp_path):
    """With a free anchor twenty distances fit better, and identify would refuse them."""
    named = {"pose_id": np.arange(M)} | joints(*JOINTS)
    far = {"distance_mm": np.linalg.norm(points() - [1e3, 2e3, 0], axis=1), "anchor": ["A"] * M}
    few = {name: np.asarray(column)[:20] for name, column in (named | far).items()}
    files = write(tmp_path, a__csv=csv(named | places("x_mm", "y_mm", "z_mm")), b__csv=csv(few))
    said, text = proposed(tmp_path, files[:: -1 if backwards else 1], "--robot", "staubli_tx60")
    told = tomllib.loads(text)
    assert (told["points"]["file"], told["ranges"]["file"]) == ("a.csv", "b.csv")
    assert "unused" not in said
    assert "to fix" not in said
    (tmp_path / "session.toml").unlink()
    said, text = proposed(tmp_path, [tmp_path / "b.csv"], "--robot", "staubli_tx60")
    sentence = "b.csv: 20 different poses give 20 equations for 24 parameters"
    assert f"to fix   {tmp_path}/{sentence}" in said
    done = call("identify", "staubli_tx60", tmp_path / "session.toml", "--out", tmp_path / "out")
    assert sentence in done.stderr


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ((), "uncertainty: no column has it; position_um = 30 is assumed"),
        (
            ("std_x", "std_y", "std_z"),
            "uncertainty: std_x and 2 more are not used: scatter within a reading is less than its "
            'uncertainty; where it is that, write [points.columns] ux_mm = "std_x"',
        ),
        (("Sigma",), "uncertainty: Sigma is not used: scatter within a reading"),
        (("Ux", "Uy", "Uz"), "uncertainty: Ux, Uy, Uz are taken as standard uncertainties (k = 1)"),
        (("x unc.", "y unc.", "z unc."), "x unc., y unc., z unc. are taken as standard uncert"),
        (("standard", "stdx"), "uncertainty: no column has it; position_um = 30 is assumed"),
    ],
)
def test_columns_of_scatter_are_named_where_uncertainty_is_assumed(tmp_path, names, said):
    table = joints(*JOINTS) | places("x_mm", "y_mm", "z_mm") | dict.fromkeys(names, np.ones(M))
    (file,) = write(tmp_path, a__csv=csv(table))
    out = tmp_path / "session.toml"
    shown = call("new", "session", file, "--out", out)
    assert shown.exit_code == 0, shown.output
    text = out.read_text(encoding="utf-8")
    assert said in text
    assumed = names[:1] not in (("Ux",), ("x unc.",))
    assert tomllib.loads(text).get("uncertainty", {}).get("assumed", False) is assumed
    assert read_session(out, ROBOT).noise_assumed is assumed


def test_rows_that_are_far_off_are_said_to_be_and_not_explained_by_links(tmp_path):
    """One in seven by 0.4 m: base and tool were said to leave 15 cm, which links explain."""
    table = {k: [f"{v:.9g}" for v in values] for k, values in columns(data(), form="none").items()}
    far = range(3, M, 7)
    for k in far:
        table["x_mm"][k] = f"{float(table['x_mm'][k]) + 400 + k:.9g}"
    (file,) = write(tmp_path, a__csv=csv(table))
    said, _ = proposed(tmp_path, [file], "--robot", "staubli_tx60")
    assert re.match(rf"with only .*, errors are 0\.\d+ mm, without {len(far)} rows far off", said)
    assert "links up to" not in said
    assert f"a.csv:{far[0] + 2}: left out: 40" in said
