"""Reading sessions: what is written comes back, in every dialect and from every arrangement."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import inverse, step_transform
from calib.identification.start.start import start_frames
from testbed.files.columns import covariance_names
from testbed.files.read import ReadOptions, read_held_out, read_session
from tests.testbed.files.made import ROBOT, Made, N, columns, csv, made, poses_csv, with_spread

# 15 digits are written: 1e-12 mm, and 1e-12 deg over an arm of 3 m
CLOSE = {"rtol": 0, "atol": 1e-12}


def saved(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


def agrees(session, data):
    table = session.measurements
    np.testing.assert_allclose(table.q, data.q, **CLOSE)
    np.testing.assert_allclose(table.position, data.T[:, :3, 3], **CLOSE)
    np.testing.assert_allclose(table.rotation, data.T[:, :3, :3], **CLOSE)
    return True


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
@pytest.mark.parametrize("eol", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(",", "."), (";", ","), (";", "."), ("\t", ","), (" ", "."), (" ", ",")],
)
def test_every_dialect_reads_the_same_numbers(tmp_path, encoding, eol, separator, decimal):
    text = poses_csv(separator=separator, decimal=decimal, eol=eol)
    note = "# gemessen von M. Müller" + eol
    assert agrees(read_session(saved(tmp_path / "a.csv", note + text, encoding), ROBOT), made())


@pytest.mark.parametrize("form", ["euler", "quaternion", "matrix"])
@pytest.mark.parametrize("gives", ["T_tracker_tool", "T_tool_tracker"])
@pytest.mark.parametrize("euler", ["XYZ", "ZYX", "zyx", "xyz", "YZX"])
def test_stated_conventions_are_obeyed(tmp_path, form, gives, euler):
    if form != "euler" and euler != "XYZ":
        return
    data = made()
    saved(tmp_path / "a.csv", csv(columns(data, form=form, euler=euler, gives=gives)))
    toml = saved(
        tmp_path / "s.toml",
        f'[frames]\neuler = "{euler}"\ngives = "{gives}"\n'
        "[uncertainty]\nposition_um = 17.5\nrotation_mdeg = 11\n",
    )
    assert agrees(read_session(tmp_path / "a.csv", ROBOT, config=toml), data)


@pytest.mark.parametrize("stated", ["keys", "columns"])
def test_noise_of_inverse_transforms_is_that_of_the_rows_as_they_stand(tmp_path, stated):
    """A camera on the flange that turns by a little sees the board beside it: both move."""
    data = made()
    table = columns(data, gives="T_tool_tracker") | {"euler": ["XYZ"] * len(data.q)}
    keys = "[uncertainty]\nposition_um = 17.5\nrotation_mdeg = 11\n"
    if stated == "columns":
        table, keys = with_spread(table), ""
    saved(tmp_path / "a.csv", csv(table))
    toml = saved(tmp_path / "s.toml", f'[frames]\ngives = "T_tool_tracker"\n{keys}')
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert agrees(session, data)
    away, turn = data.T[:, :3, 3], np.radians(0.011)
    across = np.eye(3) * (away**2).sum(1)[:, None, None] - away[:, :, None] * away[:, None, :]
    noise = session.measurements.covariance
    expected = 17.5e-6**2 * np.eye(3) + turn**2 * across
    # rounding of numbers of 1e-7 m^2 and rad^2
    np.testing.assert_allclose(noise[:, :3, :3], expected, rtol=1e-9, atol=1e-18)
    turned = np.tile(turn**2 * np.eye(3), (len(data.q), 1, 1))
    np.testing.assert_allclose(noise[:, 3:, 3:], turned, rtol=1e-9, atol=1e-18)


def test_columns_of_another_program_are_mapped_and_units_stated(tmp_path):
    data = made()
    own = columns(data)
    theirs = {f"Achse {j + 1}": np.radians(own[f"q{j + 1}_deg"]) for j in range(N)}
    theirs |= {f"M_{a}": own[f"{a}_mm"] / 25.4 for a in "xyz"}
    theirs |= {f"M_r{a}": own[f"r{a}_deg"] for a in "xyz"}
    saved(tmp_path / "a.csv", csv(theirs, separator=";", decimal=","))
    mapping = "".join(f'q{j + 1}_rad = "Achse {j + 1}"\n' for j in range(N))
    places = "".join(f'{a}_in = "M_{a}"\nr{a}_deg = "M_r{a}"\n' for a in "xyz")
    toml = saved(
        tmp_path / "s.toml",
        f'[joints.columns]\n{mapping}[frames]\neuler = "XYZ"\n[frames.columns]\n{places}'
        "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n",
    )
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert agrees(session, data)
    assert not session.warnings
    variance = np.diagonal(session.measurements.covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(variance[:, :3], (20e-6) ** 2)
    np.testing.assert_allclose(variance[:, 3:], np.radians(0.010) ** 2)


def test_files_apart_are_matched_by_pose_id_in_any_order(tmp_path):
    data = made()
    table = columns(data)
    joints = {k: v for k, v in table.items() if k[0] in "pq"}
    seen = with_spread({k: v[::-1] for k, v in table.items() if k[0] != "q"})
    saved(tmp_path / "j.csv", csv(joints))
    saved(tmp_path / "f.csv", csv(seen, separator="\t"))
    saved(
        tmp_path / "session.toml",
        '[joints]\nfile = "j.csv"\n[frames]\nfile = "f.csv"\neuler = "XYZ"\n',
    )
    session = read_session(tmp_path, ROBOT)
    np.testing.assert_allclose(session.measurements.q, data.q[::-1], **CLOSE)
    assert session.pose_name(0) == "29"
    assert [file.path.name for file in session.files] == ["session.toml", "f.csv", "j.csv"]
    assert all(len(file.sha256) == 64 for file in session.files)


def test_files_apart_can_be_matched_by_order(tmp_path):
    data = made()
    table = columns(data, ids=False)
    saved(tmp_path / "j.csv", csv({k: v for k, v in table.items() if k[0] == "q"}))
    saved(tmp_path / "f.csv", csv(with_spread({k: v for k, v in table.items() if k[0] != "q"})))
    saved(
        tmp_path / "session.toml",
        'match = "order"\n[joints]\nfile = "j.csv"\n[frames]\nfile = "f.csv"\neuler = "XYZ"\n',
    )
    assert agrees(read_session(tmp_path / "session.toml", ROBOT), data)


def test_equal_commanded_joints_without_names_are_visits_of_one_pose(tmp_path):
    a, b = columns(made(0, 5), ids=False), columns(made(0, 5, 30e-6), ids=False)
    twice = with_spread({k: np.concatenate([a[k], b[k]]) for k in a})
    saved(tmp_path / "a.csv", csv(twice | {"euler": ["XYZ"] * 10}))
    table = read_session(tmp_path / "a.csv", ROBOT).measurements
    assert table.pose_id.tolist() == [*range(5), *range(5)]
    assert table.repeat.tolist() == [0] * 5 + [1] * 5


def test_visits_split_and_what_stands_beside_are_kept(tmp_path):
    data = made(m=6)
    table = with_spread(columns(data)) | {
        "euler": ["XYZ"] * 6,
        "pose_id": [1, 1, 2, 2, 3, 3],
        "repeat": [0, 1, 0, 1, 0, 1],
        "split": ["identify"] * 4 + ["test"] * 2,
        "approach": ["+", "-"] * 3,
        "temperature_degC": np.linspace(20, 21, 6),
        "time": [f"2024-03-01T10:00:{s:02d}" for s in range(0, 60, 10)],
    }
    table |= {f"q{j + 1}_deg": np.repeat(np.degrees(data.q[::2, j]), 2) for j in range(N)}
    session = read_session(saved(tmp_path / "a.csv", csv(table)), ROBOT)
    assert session.split_stated
    assert session.is_test.tolist() == [False] * 4 + [True] * 2
    assert session.approach == ("+", "-") * 3
    np.testing.assert_allclose(session.time, np.arange(0, 60, 10))
    np.testing.assert_allclose(session.conditions.temperature, np.linspace(20, 21, 6))
    toml = saved(tmp_path / "s.toml", '[frames]\n[identification]\nvisits = "first"\n')
    first = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert first.wanted.visits == "first"
    assert first.measurements.repeat.tolist() == [0, 1] * 3


def test_read_back_joints_are_kept_beside_the_commanded_ones(tmp_path):
    data = made()
    own = with_spread(columns(data)) | {"euler": ["XYZ"] * 29}
    own |= {f"q{j + 1}_read_rad": data.q[:, j] + 1e-3 for j in range(N)}
    saved(tmp_path / "a.csv", csv(own))
    for source, other in (("commanded", 1e-3), ("read-back", -1e-3)):
        toml = saved(tmp_path / "s.toml", f'[joints]\nsource = "{source}"\n[frames]\n')
        session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
        assert session.joint_source == source
        np.testing.assert_allclose(session.read_back - session.measurements.q, other, atol=1e-9)


def points_of(data, arms, names):
    """Rows of several reflectors at each pose."""
    table = {k: [] for k in ("pose_id", "target", *(f"q{j + 1}_rad" for j in range(N)))}
    table |= {f"{a}_m": [] for a in "xyz"}
    for k, (q, T) in enumerate(zip(data.q, data.T, strict=True)):
        for arm, name in zip(arms, names, strict=True):
            p = T[:3, :3] @ arm + T[:3, 3]
            for key, value in zip(table, (f"{k}", name, *q, *p), strict=True):
                table[key].append(value)
    return table


ARMS = np.array([[0.05, 0.03, 0.08], [-0.06, 0.02, 0.07], [0.01, -0.07, 0.05]])


def test_reflectors_of_unknown_place_become_fixtures_that_a_closed_form_finds(tmp_path):
    data = made(3, 40)
    saved(tmp_path / "a.csv", csv(points_of(data, ARMS, "ABC"), form="{:.17g}"))
    toml = saved(tmp_path / "s.toml", "[points]\n[uncertainty]\nposition_um = 20\n")
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert session.reflector_names == ("A", "B", "C")
    assert session.fixtures.counts == (3, 0, 0, 0)
    start = start_frames(replace(ROBOT.model, fixtures=session.fixtures), session.measurements)
    found = start.model.fixtures.reflectors
    # the tool frame is not seen, but the triangle of the reflectors is; 0.15 mm robot errors
    for a, b in ((0, 1), (1, 2), (2, 0)):
        apart = np.linalg.norm(found[a] - found[b]) - np.linalg.norm(ARMS[a] - ARMS[b])
        assert abs(apart) < 0.5e-3


def test_reflectors_of_known_place_are_offsets_in_the_tool_frame(tmp_path):
    data = made(3, 12)
    saved(tmp_path / "a.csv", csv(points_of(data, ARMS, "ABC"), form="{:.17g}"))
    places = ", ".join(f"{n} = {(1e3 * arm).tolist()}" for n, arm in zip("ABC", ARMS, strict=True))
    toml = saved(
        tmp_path / "s.toml",
        f"[points]\nreflectors_mm = {{ {places} }}\n[uncertainty]\nposition_um = 20\n",
    )
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert not session.fixtures.n_numbers
    np.testing.assert_allclose(session.measurements.offset[:3], ARMS, atol=1e-15)
    start = start_frames(ROBOT.model, session.measurements)
    assert start.position_rms < 2e-3


def test_one_reflector_without_a_place_is_the_tool_point(tmp_path):
    data = made(3, 20)
    saved(tmp_path / "a.csv", csv(points_of(data, ARMS[:1], ["SMR"])))
    toml = saved(tmp_path / "s.toml", "[points]\n[uncertainty]\nposition_um = 20\n")
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert session.fixtures.counts == (0, 0, 0, 0)
    assert not session.measurements.offset.any()


def test_polar_readings_are_the_same_points(tmp_path):
    data = made(3, 8)
    table = points_of(data, ARMS[:1], ["SMR"])
    p = np.array([table.pop(f"{a}_m") for a in "xyz"]).T
    r = np.linalg.norm(p, axis=1)
    polar = table | {
        "range_mm": 1e3 * r,
        "azimuth_deg": np.degrees(np.arctan2(p[:, 1], p[:, 0])),
        "zenith_deg": np.degrees(np.arccos(p[:, 2] / r)),
    }
    toml = saved(tmp_path / "s.toml", "[points]\n[uncertainty]\nposition_um = 20\n")
    session = read_session(saved(tmp_path / "a.csv", csv(polar)), ROBOT, config=toml)
    np.testing.assert_allclose(session.measurements.position, p, **CLOSE)


def test_stations_are_one_file_each_or_a_column_and_the_second_one_is_found(tmp_path):
    data = made(4, 30)
    T_first_second = step_transform(np.array([1.0, -2.0, 0.3, 0.1, 0.2, 2.0]))
    second = Made(data.q[15:], inverse(T_first_second) @ data.T[15:], data.truth)
    first = Made(data.q[:15], data.T[:15], data.truth)
    a, b = (with_spread(columns(part)) | {"euler": ["XYZ"] * 15} for part in (first, second))
    b["pose_id"] = b["pose_id"] + 15
    saved(tmp_path / "a.csv", csv(a))
    saved(tmp_path / "b.csv", csv(b))
    saved(tmp_path / "session.toml", '[frames]\nfiles = ["a.csv", "b.csv"]\n')
    apart = read_session(tmp_path, ROBOT)
    saved(tmp_path / "b.csv", csv(b | {"pose_id": a["pose_id"]}))
    with pytest.raises(InputError, match=r"b\.csv:2: .* other joints than in line 2 of \S*a\.csv;"):
        read_session(tmp_path, ROBOT)
    column = ["east"] * 15 + ["west"] * 15
    both = {k: [*a[k], *b[k]] for k in a} | {"station": column}
    one = read_session(saved(tmp_path / "c.csv", csv(both)), ROBOT)
    assert one.station_names == ("east", "west")
    for session in (apart, one):
        assert session.measurements.station.tolist() == [0] * 15 + [1] * 15
        model = replace(ROBOT.model, fixtures=session.fixtures)
        found = start_frames(model, session.measurements).model.fixtures.stations[0]
        # a robot wrong by 0.15 mm and 0.04 deg tells a station to millimeters
        np.testing.assert_allclose(found[:3, 3], T_first_second[:3, 3], atol=5e-3)


@pytest.mark.parametrize("again", [[], [1]], ids=["once", "pose 2 again, seen by one"])
def test_stations_need_not_see_every_pose_but_each_pose_is_seen(again, tmp_path):
    data, visits = made(m=20), [*range(20), *again]
    joints = {k: v[visits] for k, v in columns(data).items() if k[0] in "pq"}
    saved(tmp_path / "joints.csv", csv(joints))
    seen = {"pose_id": np.arange(1, 21)}
    seen |= {f"{a}_mm": data.T[:, k, 3] * 1e3 for k, a in enumerate("xyz")}
    saved(
        tmp_path / "session.toml",
        '[joints]\nfile = "joints.csv"\n[points]\nfiles = ["one.csv", "two.csv"]\n'
        "[uncertainty]\nposition_um = 17.5\n",
    )
    for first, second in ((12, 8), (12, 13)):
        for name, rows in (("one", slice(first)), ("two", slice(second, None))):
            more = again if name == "one" else []
            part = {k: np.append(v[rows], v[more] + 1e-3 * (k[0] != "p")) for k, v in seen.items()}
            part["pose_id"] = part["pose_id"].astype(int)
            saved(tmp_path / f"{name}.csv", csv(part))
        if second < first:
            session = read_session(tmp_path, ROBOT)
            assert len(session.measurements) == 12 + 12 + len(again)
            assert session.warnings == (
                "one.csv: 8 poses are in other files only",
                "two.csv: 8 poses are in other files only",
            )
    with pytest.raises(InputError, match=r"one\.csv: there is no reading of pose 13;"):
        read_session(tmp_path, ROBOT)


def test_joints_beside_each_of_several_targets_are_those_of_one_stop(tmp_path):
    """A file of joints may show other readings as well; rows of other joints are no stop."""
    seen = points_of(made(3, 20), ARMS[:2], "AB")
    table = {k: list(v) for k, v in seen.items() if k[0] in "pq"}
    saved(tmp_path / "seen.csv", csv({k: v for k, v in seen.items() if k[0] != "q"}))
    saved(
        tmp_path / "session.toml",
        '[joints]\nfile = "joints.csv"\n[points]\nfile = "seen.csv"\n[uncertainty]\n'
        "position_um = 20\n",
    )
    saved(tmp_path / "joints.csv", csv(table))
    session = read_session(tmp_path, ROBOT)
    np.testing.assert_allclose(session.measurements.q, np.repeat(made(3, 20).q, 2, axis=0), **CLOSE)
    table["q1_rad"][7] += 1e-3
    saved(tmp_path / "joints.csv", csv(table))
    with pytest.raises(InputError, match=r"joints\.csv has joints twice for pose"):
        read_session(tmp_path, ROBOT)


def test_a_log_that_comes_back_to_poses_gives_each_visit_its_own_joints(tmp_path):
    data, rows = made(5, 12), [*range(12), 3, 0]
    q = data.q[rows] + 1e-5 * (np.arange(14) >= 12)[:, None]
    seen = {k: v[rows] for k, v in with_spread(columns(data)).items() if k[0] != "q"}
    seen["x_mm"] = seen["x_mm"] + np.arange(14) * 1e-3  # no reading is the copy of another
    joints = {"pose_id": seen["pose_id"]} | {f"q{j + 1}_rad": q[:, j] for j in range(N)}
    files = '[joints]\nfile = "joints.csv"\n[frames]\nfile = "seen.csv"\neuler = "XYZ"\n'
    saved(tmp_path / "session.toml", files)
    saved(tmp_path / "joints.csv", csv(joints))
    saved(tmp_path / "seen.csv", csv(seen))
    table = read_session(tmp_path, ROBOT).measurements
    np.testing.assert_allclose(table.q, q, **CLOSE)
    assert table.repeat.tolist() == [0] * 12 + [1, 1]
    lost = [({k: np.delete(v, row) for k, v in seen.items()}, pose)
            for row, pose in ((12, "pose 4;"), (0, "pose 1;"))]  # fmt: skip
    for others, poses in (*lost, (seen | {"repeat": [*range(14)]}, "poses 1, 4;")):
        saved(tmp_path / "seen.csv", csv(others))
        with pytest.raises(InputError, match=f"joints twice for {poses} correct .* or number the"):
            read_session(tmp_path, ROBOT, options=ReadOptions(drop_invalid=True))


def test_distances_name_their_anchors(tmp_path):
    data = made(5, 30)
    anchors = {"A": [0.0, 0.0, 0.0], "B": [2000.0, 0.0, 0.0], "C": [0.0, 2000.0, 500.0]}
    table = {"pose_id": [], "anchor": [], "distance_mm": []}
    table |= {f"q{j + 1}_rad": [] for j in range(N)}
    for k, (q, T) in enumerate(zip(data.q, data.T, strict=True)):
        for name, place in anchors.items():
            p = 1e3 * (T[:3, :3] @ ARMS[0] + T[:3, 3])
            row = (f"{k}", name, np.linalg.norm(p - place), *q)
            for key, value in zip(table, row, strict=True):
                table[key].append(value)
    saved(tmp_path / "a.csv", csv(table, form="{:.17g}"))
    places = 'A = [0.0, 0.0, 0.0], B = [2000.0, 0.0, 0.0], C = "free"'
    toml = saved(
        tmp_path / "s.toml",
        f"[ranges]\nanchors_mm = {{ {places} }}\n[uncertainty]\ndistance_um = 30\n",
    )
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    table = session.measurements
    assert set(table.kind) == {"distance"}
    assert session.anchor_names == ("A", "B", "C")
    assert session.fixed == tuple(f"anchor{k}.{axis}" for k in (1, 2) for axis in "xyz")
    assert session.free_anchors == (2,)
    np.testing.assert_allclose(session.fixtures.anchors[1], [2.0, 0.0, 0.0])
    np.testing.assert_allclose(table.covariance[:, 0, 0], (30e-6) ** 2)


def test_mpe_is_read_by_the_stated_rule(tmp_path):
    data = made()
    saved(tmp_path / "a.csv", csv(columns(data)))
    for rule, part in (("rectangular", 3**-0.5), ("two_sigma", 0.5), ("typical", 0.25)):
        toml = saved(
            tmp_path / "s.toml",
            '[frames]\neuler = "XYZ"\n[uncertainty]\nmpe_um = [15, 6]\n'
            f'mpe_rule = "{rule}"\nrotation_mdeg = 10\n',
        )
        session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
        reach = np.linalg.norm(data.T[:, :3, 3], axis=1)
        np.testing.assert_allclose(
            session.measurements.covariance[:, 0, 0], ((15e-6 + 6e-6 * reach) * part) ** 2, 1e-9
        )
        assert rule in session.uncertainty


def test_a_point_needs_the_covariance_of_its_position_alone(tmp_path):
    data = made(3, 8)
    root = np.random.default_rng(5).normal(scale=2e-5, size=(8, 3, 3))
    truth = root @ np.swapaxes(root, 1, 2)
    entries = {
        name: truth[:, i, j]
        for name, i, j in zip(covariance_names(3), *np.triu_indices(3), strict=True)
    }
    table = points_of(data, ARMS[:1], ["SMR"]) | entries
    saved(tmp_path / "a.csv", csv(table))
    toml = saved(tmp_path / "s.toml", "[points]\n")
    read = read_session(tmp_path / "a.csv", ROBOT, config=toml).measurements
    np.testing.assert_allclose(read.covariance[:, :3, :3], truth, rtol=1e-9, atol=1e-20)
    saved(tmp_path / "a.csv", csv({k: v for k, v in table.items() if k != "cov_y_z_m2"}))
    with pytest.raises(InputError, match="there are 5 of 6 columns of the covariance; cov_y_z_m2"):
        read_session(tmp_path / "a.csv", ROBOT, config=toml)


def test_expanded_uncertainties_are_halved_and_kept_above_a_stated_least(tmp_path):
    table = columns(made())
    table |= {f"U95{a}_mm": np.full(29, u) for a, u in zip("xyz", (0.04, 0.02, 0.01), strict=True)}
    table |= {f"U95r{a}_deg": np.full(29, 0.02) for a in "xyz"}
    saved(tmp_path / "a.csv", csv(table))
    toml = saved(
        tmp_path / "s.toml", '[frames]\neuler = "XYZ"\n[uncertainty]\nat_least_position_um = 8\n'
    )
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    u = np.sqrt(np.diagonal(session.measurements.covariance, axis1=1, axis2=2))[0]
    np.testing.assert_allclose(u[:3], [20e-6, 10e-6, 8e-6], rtol=1e-12)
    np.testing.assert_allclose(u[3:], np.radians(0.01), rtol=1e-12)


@pytest.mark.parametrize("named", [True, False])
def test_held_out_rows_in_a_csv_are_read_as_the_session_says(tmp_path, named):
    """Units, conventions and uncertainties; not its files. A session.toml says its own."""
    said = '[joints]\nfile = "a.csv"\n[frames]\neuler = "XYZ"\nfile = "a.csv"\n'
    said = said if named else '[frames]\neuler = "XYZ"\nfile = "a.csv"\n'
    own = "[uncertainty]\nposition_um = 21\nrotation_mdeg = 12\n[conditions]\npayload_kg = 3\n"
    (tmp_path / "a.csv").write_text(csv(columns(made())))
    (tmp_path / "session.toml").write_text(said + own)
    other = made(seed=5)
    test = tmp_path / "far" / "test.csv"
    test.parent.mkdir()
    test.write_text(csv(columns(other)))
    for data in (tmp_path, tmp_path / "session.toml"):
        found = read_held_out(test, ROBOT, data)
        np.testing.assert_allclose(found.measurements.q, other.q, atol=1e-12)
        sd = np.sqrt(np.diagonal(found.measurements.covariance, axis1=1, axis2=2))
        np.testing.assert_allclose(sd[:, :3], 21e-6, rtol=1e-12)
        np.testing.assert_allclose(sd[:, 3:], np.radians(12e-3), rtol=1e-12)
        assert found.conditions.payload.tolist() == [3.0] * 29
        assert [file.path.name for file in found.files] == ["session.toml", "test.csv"]
    # with a session.toml of its own nothing is taken over
    (test.parent / "session.toml").write_text(said.replace("a.csv", "test.csv"))
    with pytest.raises(InputError, match="uncertaint"):
        read_held_out(test.parent, ROBOT, tmp_path)
    # a CSV beside a CSV is read by --config, or as it stands
    with pytest.raises(InputError, match="how they turn the tool"):
        read_held_out(test, ROBOT, tmp_path / "a.csv")
    config = tmp_path / "config.toml"
    config.write_text('[frames]\neuler = "XYZ"\n' + own)
    found = read_held_out(test, ROBOT, tmp_path / "a.csv", config=config)
    assert len(found.measurements) == 29


def test_missed_shots_are_left_out_and_named(tmp_path):
    table = with_spread(columns(made())) | {"euler": ["XYZ"] * 29}
    for key in ("x_mm", "y_mm", "z_mm"):
        table[key] = table[key].copy()
        table[key][[3, 7]] = 0.0
    session = read_session(saved(tmp_path / "a.csv", csv(table)), ROBOT)
    assert len(session.measurements) == 27
    assert session.masked == (
        f"{tmp_path}/a.csv: 2 rows left out (lines 5, 9): missed shots, written as 0 0 0",
    )


def test_wrong_locks_and_swapped_rows_are_left_out_and_told_apart(tmp_path):
    data = made(6, 40)
    T = data.T.copy()
    T[5, :3, 3] += [0.3, 0.2, -0.15]  # 391 mm
    T[[20, 21]] = T[[21, 20]]
    T[[9, 33]] = T[[33, 9]]
    wrong = Made(data.q, T, data.truth)
    session = read_session(saved(tmp_path / "a.csv", poses_csv(wrong)), ROBOT)
    assert len(session.measurements) == 35
    told = [sentence.rpartition("/")[2] for sentence in session.masked]
    assert told[0].startswith("a.csv:7: left out: 39")
    assert "fits" not in told[0]
    fits = [sentence.rpartition(", ")[2] for sentence in told[1:]]
    assert fits == [f"fits the joints of line {line}" for line in (35, 23, 22, 11)]


@pytest.mark.parametrize("label", ["target", "station"])
def test_a_reading_under_the_name_of_another_is_left_out_with_the_line_of_that(tmp_path, label):
    """Two targets 90 mm apart, or two stations 5 m apart, exchanged in the rows of one pose."""
    data = made(6, 40)
    other = data.T.copy()
    if label == "target":
        other[:, :3, 3] += data.T[:, :3, :3] @ [0.0, 0.09, 0.0]
    else:
        other[:, :3, 3] += [3.0, -4.0, 0.2]
    seen = np.stack([data.T[:, :3, 3], other[:, :3, 3]], axis=1)  # (40, 2, 3)
    seen[7] = seen[7, ::-1]
    table = {"pose_id": np.repeat(np.arange(40), 2), label: ["A", "B"] * 40}
    table |= {f"q{k + 1}_rad": np.repeat(data.q[:, k], 2) for k in range(6)}
    table |= {f"{axis}_m": seen[:, :, k].ravel() for k, axis in enumerate("xyz")}
    saved(tmp_path / "a.csv", csv(table))
    places = 'reflectors_mm = { A = "free", B = "free" }\n' * (label == "target")
    text = f'[points]\nfile = "a.csv"\n{places}[uncertainty]\nposition_um = 20\n'
    session = read_session(saved(tmp_path / "session.toml", text), ROBOT)
    told = [sentence.rpartition(", ")[2] for sentence in session.masked]
    assert told == [f"fits the {label} of line 17", f"fits the {label} of line 16"]


def test_rows_that_are_no_numbers_are_left_out_on_request_only(tmp_path):
    table = with_spread(columns(made())) | {"euler": ["XYZ"] * 29}
    text = csv(table).splitlines()
    cells = text[4].split(",")
    cells[9] = "nan"
    text[4] = ",".join(cells)
    saved(tmp_path / "a.csv", "\n".join(text))
    with pytest.raises(InputError, match="M25"):
        read_session(tmp_path / "a.csv", ROBOT)
    session = read_session(tmp_path / "a.csv", ROBOT, options=ReadOptions(drop_invalid=True))
    assert len(session.measurements) == 28
    assert "line 5" in session.warnings[0]
    np.testing.assert_allclose(session.measurements.q, np.delete(made().q, 3, axis=0), **CLOSE)


def test_zero_uncertainties_are_what_their_printing_hides(tmp_path):
    table = columns(made()) | {"euler": ["XYZ"] * 29}
    table |= {f"u{a}_mm": ["0.012"] * 29 for a in "xz"} | {"uy_mm": ["0.000"] * 20 + ["0.003"] * 9}
    table |= {f"ur{a}_deg": ["0.01"] * 29 for a in "xyz"}
    session = read_session(saved(tmp_path / "a.csv", csv(table)), ROBOT)
    floor = 1e-6 / 12**0.5  # a micrometer printed, known to +-half of it
    np.testing.assert_allclose(session.measurements.covariance[:20, 1, 1], floor**2, rtol=1e-9)
    assert "uy_mm is zero in 20 of 29 rows" in session.warnings[0]


def test_zeros_of_more_decimals_than_an_instrument_has_are_no_uncertainty(tmp_path):
    """A tenth of a nanometer would make these rows, or this axis, all that counts."""
    table = columns(made()) | {"euler": ["XYZ"] * 29}
    table |= {f"u{a}_mm": ["0.012000"] * 29 for a in "xz"}
    table |= {"uy_mm": ["0.000000"] * 9 + ["0.030000"] * 20}
    table |= {f"ur{a}_deg": ["0.01"] * 29 for a in "xyz"}
    session = read_session(saved(tmp_path / "a.csv", csv(table)), ROBOT)
    np.testing.assert_allclose(session.measurements.covariance[:, 1, 1], 9e-10, rtol=1e-9)
    assert "is zero in 9 of 29 rows; taken as 0.03 mm, the median of" in session.warnings[0]
    table["uy_mm"] = ["0.000000"] * 29
    with pytest.raises(InputError, match="uy_mm is zero in all rows"):
        read_session(saved(tmp_path / "b.csv", csv(table)), ROBOT)


def test_a_column_that_looks_misspelled_is_named(tmp_path):
    table = with_spread(columns(made())) | {"euler": ["XYZ"] * 29, "repaet": [0] * 29}
    session = read_session(saved(tmp_path / "a.csv", csv(table)), ROBOT)
    assert session.warnings[0].endswith('column "repaet" is not used; did you mean "repeat"?')


def test_rounded_clocks_order_nothing(tmp_path):
    table = with_spread(columns(made())) | {"euler": ["XYZ"] * 29, "time": ["2.02011E+13"] * 29}
    session = read_session(saved(tmp_path / "a.csv", csv(table)), ROBOT)
    assert session.time is None
    assert "rounded to one value" in session.warnings[0]


def test_every_column_that_was_not_read_is_named(tmp_path):
    """Foreign ones, and uncertainties that session.toml overrides."""
    table = with_spread(columns(made())) | {"euler": ["XYZ"] * 29, "Operator": ["M"] * 29}
    file = saved(tmp_path / "a.csv", csv(table | {"Goal x": np.arange(29.0)}))
    (note,) = [text for text in read_session(file, ROBOT).notes if "not used" in text]
    assert note == f"{file}: not used: Operator, Goal x"
    toml = saved(tmp_path / "s.toml", "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n")
    (note,) = [t for t in read_session(file, ROBOT, config=toml).notes if "not used" in t]
    assert note.endswith(
        "not used: ux_mm, uy_mm, uz_mm, urx_deg, ury_deg, urz_deg, Operator, Goal x"
    )
