"""Wrong readings of a file are named, the right one passes, and nothing is switched."""

import re
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import inverse
from calib.geometry.model import RobotModel
from calib.measurement import tables
from testbed.files import probe as probing
from testbed.files.alternatives import Alternative
from testbed.files.frames_fit import Misfit, fit_frames
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.files.rows import shifts
from testbed.files.rows.counts import Count
from testbed.files.tried import ranged
from testbed.files.tried.interpretations import Probe, Tried
from testbed.files.tried.links_fit import LinksFit, links_fit
from testbed.files.visits.probing import probed
from testbed.robots.catalog import load_robot
from tests.testbed.files.made import ROBOT, Made, N, columns, csv, made, with_spread

SIGMAS = "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n"


def read(folder, table, frames='euler = "XYZ"', kind="frames", robot=ROBOT):
    (folder / "a.csv").write_text(csv(table))
    (folder / "s.toml").write_text(f"[{kind}]\n{frames}\n{SIGMAS}")
    return read_session(folder / "a.csv", robot, config=folder / "s.toml")


def scaled(table, names, factor):
    return table | {name: table[name] * factor for name in names}


PLACES = ("x_mm", "y_mm", "z_mm")
TURNS = ("rx_deg", "ry_deg", "rz_deg")
JOINTS = tuple(f"q{j + 1}_deg" for j in range(N))


def moved(table, shift):
    """Readings that belong to the joints `shift` rows later."""
    return table | {k: np.roll(v, shift) for k, v in table.items() if k in PLACES + TURNS}


def coupled(table, a, b, sign):
    q = table[f"q{b}_deg"] + sign * table[f"q{a}_deg"]
    return table | {f"q{b}_deg": q}


def quaternions(order):
    def change(_):
        own = columns(made(), form="quaternion")
        there = np.array([own[f"q{a}"] for a in "wxyz"])[["wxyz".index(a) for a in order]]
        return own | dict(zip(("qw", "qx", "qy", "qz"), there, strict=True))

    return change


def later(own, factor):
    """The last nine positions of 29 times a factor."""
    return own | {k: own[k] * np.where(np.arange(29) < 20, 1.0, factor) for k in PLACES}


MISTAKES = {
    "mm as m": (lambda t: scaled(t, PLACES, 1e3), "M21", "in mm, not m"),
    "m as mm": (lambda t: scaled(t, PLACES, 1e-3), "M21", "in m, not mm"),
    "inches": (lambda t: scaled(t, PLACES, 1 / 25.4), "M21", "in inches"),
    "joints rad as deg": (lambda t: scaled(t, JOINTS, np.pi / 180), "M20", "in rad, not deg"),
    "a joint's sign": (lambda t: scaled(t, JOINTS[3:4], -1), "M20", "joint 4 turns the other way"),
    "coupling 2-3": (lambda t: coupled(t, 2, 3, 1), "M20", r"joint 3 is q3 - q2"),
    "coupling 5-6": (lambda t: coupled(t, 5, 6, -1), "M20", r"joint 6 is q6 \+ q5"),
    "joints 4, 5 rad as deg": (
        lambda t: scaled(t, JOINTS[3:5], np.pi / 180),
        "M20",
        "q4, q5 are in rad, not deg",
    ),
    "last rows rad as deg": (
        lambda t: t | {k: np.where(np.arange(29) < 20, t[k], np.radians(t[k])) for k in JOINTS},
        "M20",
        "joints of some rows, the first in line 22, are in rad",
    ),
    "last rows in inches": (
        lambda t: later(t, 1 / 25.4),
        "M21",
        "some rows, the first in line 22, ",
    ),
    "last rows in m": (lambda t: later(t, 1e-3), "M21", "line 22, are in m, not mm"),
    "euler order": (lambda _: columns(made(), euler="ZYX"), "M24", "in the order ZYX"),
    "fixed axes": (lambda _: columns(made(), euler="xyz"), "M24", "xyz about fixed axes"),
    "angles rad": (lambda t: scaled(t, TURNS, np.pi / 180), "M24", "in rad, not deg"),
    "quaternion x y z w": (quaternions("xyzw"), "M22", "hold x y z w"),
    "q2 and q5 swapped": (
        lambda t: t | {"q2_deg": t["q5_deg"], "q5_deg": t["q2_deg"]},
        "M20",
        "q2 and q5 are swapped",
    ),
    "x and z swapped": (
        lambda t: t | {"x_mm": t["z_mm"], "z_mm": t["x_mm"]},
        "M32",
        "columns x and z are swapped",
    ),
    "inverse": (lambda _: columns(made(), gives="T_tool_tracker"), "M32", "inverse transforms"),
    "mirrored x": (lambda t: scaled(t, PLACES[:1], -1), "M32", "x has the other sign"),
    "mirrored z": (lambda t: scaled(t, PLACES[2:], -1), "M32", "z has the other sign"),
    "shifted by one": (lambda t: moved(t, 1), "M31", r"row k\+1 belongs to pose k"),
    "shifted by three": (lambda t: moved(t, -3), "M31", r"row k-3 belongs to pose k"),
}


def test_the_right_reading_passes_and_its_margin_is_told(tmp_path):
    session = read(tmp_path, columns(made()))
    found = probe(ROBOT, session)
    found.raise_if_wrong()
    assert found.stated.position < 1.0e-3
    assert found.best.misfit.score > 20 * found.stated.score
    assert found.sentence.startswith("with only base and tool fitted, the errors are 0.")
    assert not found.warnings
    assert 0.88 < found.spread < 1.26


@pytest.mark.parametrize("name", MISTAKES)
def test_a_wrong_reading_is_named(tmp_path, name):
    change, code, told = MISTAKES[name]
    found = probe(ROBOT, read(tmp_path, change(columns(made()))))
    with pytest.raises(InputError, match=told) as caught:
        found.raise_if_wrong()
    assert caught.value.code == code
    assert caught.value.fix


def test_transposed_matrices_are_named(tmp_path):
    data = made()
    T = data.T.copy()
    T[:, :3, :3] = np.swapaxes(T[:, :3, :3], 1, 2)
    session = read(tmp_path, columns(Made(data.q, T, data.truth), form="matrix"), "")
    with pytest.raises(InputError, match="the other way round"):
        probe(ROBOT, session).raise_if_wrong()


def points(data):
    table = columns(data, form="none")
    p = data.T[:, :3, 3] + data.T[:, :3, :3] @ [0.05, 0.03, 0.08]
    return table | dict(zip(PLACES, 1e3 * p.T, strict=True))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: scaled(t, PLACES, 1e3), "in mm, not m"),
        (lambda t: scaled(t, PLACES[1:2], -1), "one of x, y, z has the other sign"),
        (lambda t: scaled(t, JOINTS[1:2], -1), "joint 2 turns the other way"),
        (lambda t: moved(t, 1), "row k\\+1 belongs to pose k"),
    ],
)
def test_points_alone_tell_the_same(tmp_path, change, told):
    right = probe(ROBOT, read(tmp_path, points(made()), "", "points"))
    right.raise_if_wrong()
    assert right.stated.position < 1.2e-3
    with pytest.raises(InputError, match=told):
        probe(ROBOT, read(tmp_path, change(points(made())), "", "points")).raise_if_wrong()


FAR_OFF = {"off": 45.0, "m": 40}
"""Links 6.8 mm and 1.8 deg from nominal."""


@pytest.mark.parametrize("kind", ["frames", "points"])
def test_an_arm_far_from_nominal_is_read_where_its_links_explain_it(kind, tmp_path):
    data = made(3, **FAR_OFF)
    table = columns(data) if kind == "frames" else points(data)
    found = probe(ROBOT, read(tmp_path, table, 'euler = "XYZ"' * (kind == "frames"), kind))
    assert found.stated.score > found.far
    found.raise_if_wrong()
    assert found.linked.left < 2e-3
    assert f"alone leave {found.stated.shown}, far more than usual, and links" in found.warnings[0]
    assert found.linked.sentence in found.sentence


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: scaled(t, JOINTS[1:2], -1), "joint 2 turns the other way, and links up to"),
        (lambda t: scaled(t, JOINTS[3:5], np.pi / 180), "q4, q5 are in rad, not deg, and links"),
        (lambda t: moved(t, 1), "row k\\+1 belongs to pose k, and links"),
    ],
)
def test_a_wrong_reading_of_an_arm_far_from_nominal_is_named(change, told, tmp_path):
    table = change(points(made(3, **FAR_OFF)))
    with pytest.raises(InputError, match=told):
        probe(ROBOT, read(tmp_path, table, "", "points")).raise_if_wrong()


@pytest.mark.parametrize(("left", "refused"), [(1.5e-3, False), (0.4e-3, True)])
def test_what_bends_an_arm_is_taken_for_no_other_reading(left, refused, tmp_path, monkeypatch):
    """A heavy arm that sagged by 8 mm was refused: q3 + 0.0012 q2 left 7.8 mm, links 1.5 mm.

    Of the reading itself links left 1.6 mm, a hair too much to explain 7.9 mm. Neither explains
    it: the arm sags, and only a reading that links explain much better is another one.
    """
    own, other = Misfit(7.9e-3, 0.0), Misfit(7.8e-3, 0.0)
    # the order in which probe asks: of the reading as it is stated, then of others
    links = iter([LinksFit(1.6e-3, 2.4e-3, 5e-3, explains=False), LinksFit(left, 2.4e-3, 5e-3)])
    monkeypatch.setattr(probing, "misfit_of", lambda *_, **__: own)
    monkeypatch.setattr(
        probing, "ratios_that_fit", lambda _, one, __: [(Count("if it is", "", 2, one.q), other)]
    )
    monkeypatch.setattr(probing, "links_fit", lambda *_, **__: next(links))
    found = probe(ROBOT, read(tmp_path, points(made()), "", "points"))
    assert (found.wrong is not None) == refused
    assert found.sentence.startswith("with only base and tool fitted, the errors are 7.9 mm")


@pytest.mark.parametrize("read_back", [0.0, 1e-4])
def test_links_are_asked_of_poses_left_out_with_all_their_shots(read_back):
    """Twelve numbers and thirty of links explain any six poses, however far they are off.

    Joints that are read back differ from shot to shot of one pose.
    """
    data, rng = made(0, 6), np.random.default_rng(0)
    xyz = data.T[:, :3, 3] + rng.normal(scale=20e-3, size=(6, 3))
    shots = [np.repeat(one, 3, axis=0) for one in (data.q, xyz)]
    noise = rng.normal(scale=1e-5, size=(18, 3))
    q = shots[0] + read_back * rng.standard_normal((18, 6))
    table = tables.points(q, shots[1] + noise, sd=1e-3)
    assert not links_fit(ROBOT.model, table, left=30e-3).explains


@pytest.mark.parametrize("kind", ["frames", "points"])
def test_a_station_that_moved_by_meters_between_two_rows_is_named(kind, tmp_path):
    """It was asked whether this is the robot that was measured, since one fit leaves meters."""
    data = made(3, 40)
    there, T = made(5, 40).truth.chain.T_world_base, data.T.copy()
    T[25:] = there @ inverse(data.truth.chain.T_world_base) @ T[25:]
    data = Made(data.q, T, data.truth)
    table = columns(data) if kind == "frames" else points(data)
    found = probe(ROBOT, read(tmp_path, table, 'euler = "XYZ"' * (kind == "frames"), kind))
    with pytest.raises(InputError, match=r"was moved just before .*a\.csv:27: what comes") as error:
        found.raise_if_wrong()
    assert "as a [[session]] of their own" in str(error.value)


def test_readings_of_another_robot_are_no_two_stations(tmp_path):
    data = made(3, 40)
    table = points(data) | dict(zip(PLACES, np.random.default_rng(0).normal(size=(3, 40)) * 300,
                                    strict=True))  # fmt: skip
    found = probe(ROBOT, read(tmp_path, table, "", "points"))
    assert found.moved_at == ""
    with pytest.raises(InputError, match="is this the robot that was measured"):
        found.raise_if_wrong()


def distances(data, factor=1.0):
    table = columns(data, form="none")
    p = data.T[:, :3, 3] + data.T[:, :3, :3] @ [0.05, 0.03, 0.08]
    own = {k: v for k, v in table.items() if k not in PLACES}
    far = np.linalg.norm(p - [1.0, 2.0, 0.0], axis=1)
    return own | {"distance_mm": 1e3 * factor * far, "anchor": ["A"] * len(p)}


def test_distances_are_probed_by_the_general_start(tmp_path):
    config = 'anchors_mm = { A = "free" }\n[uncertainty]\ndistance_um = 30\n'

    def session(table):
        (tmp_path / "a.csv").write_text(csv(table))
        (tmp_path / "s.toml").write_text(f"[ranges]\n{config}")
        return read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")

    data = made(9, 60)
    right = probe(ROBOT, session(distances(data)))
    right.raise_if_wrong()
    assert right.stated.position < 1e-3
    with pytest.raises(InputError, match="distances are in mm, not m"):
        probe(ROBOT, session(distances(data, 1e3))).raise_if_wrong()


def test_distances_of_an_arm_far_from_nominal_are_read_with_a_warning(tmp_path, monkeypatch):
    # other readings take a slow start each, and play no part in this; nor does what links leave
    links = LinksFit(1e-3, 6e-3, 0.1)
    for name in ("distance_alternatives", "_other_distances"):
        monkeypatch.setattr(ranged, name, lambda _: ())
    monkeypatch.setattr(ranged, "links_fit", lambda *_, **__: links)
    (tmp_path / "a.csv").write_text(csv(distances(made(3, 60, off=45.0))))
    (tmp_path / "s.toml").write_text(
        '[ranges]\nanchors_mm = { A = "free" }\n[uncertainty]\ndistance_um = 30\n'
    )
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    found = probe(ROBOT, session)
    found.raise_if_wrong()
    assert found.stated.score > found.far
    assert found.warnings == (
        f"base and tool alone leave {found.stated.shown}, far more than usual, and "
        f"{links.sentence}",
    )


def test_the_same_distances_are_worked_out_once_and_others_anew(tmp_path, monkeypatch):
    """Of files that nothing fits, `new session` asked four times, for 27 s."""
    starts, kept = [], ranged.start_frames
    monkeypatch.setattr(ranged, "start_frames", lambda *a, **k: starts.append(a) or kept(*a, **k))
    table = distances(made(9, 30))
    config = '[ranges]\nanchors_mm = { A = "free" }\n[uncertainty]\ndistance_um = 30\n'
    (tmp_path / "s.toml").write_text(config)

    def asked():
        (tmp_path / "a.csv").write_text(csv(table))
        session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
        return probe(ROBOT, session).stated.position, len(starts)

    (one, count), (again, still) = asked(), asked()
    assert (again, still) == (one, count)
    table["distance_mm"] = table["distance_mm"] + np.where(np.arange(30) == 3, 1.0, 0.0)
    other, more = asked()
    assert more > count
    assert other > one


@pytest.mark.slow
@pytest.mark.parametrize("shift", [1, -1])
def test_distances_beside_the_joints_of_other_rows_are_named(shift, tmp_path):
    table = distances(made(9, 60))
    table["distance_mm"] = np.roll(table["distance_mm"], shift)
    (tmp_path / "a.csv").write_text(csv(table))
    (tmp_path / "s.toml").write_text(
        '[ranges]\nanchors_mm = { A = "free" }\n[uncertainty]\ndistance_um = 30\n'
    )
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    with pytest.raises(InputError, match=rf"row k{'[+]' if shift > 0 else ''}{shift} belongs to"):
        probe(ROBOT, session).raise_if_wrong()


def three_targets(m=25):
    """Cells of points on three reflectors, those of one pose one after the other."""
    data = made(3, m)
    own = columns(data, form="none", ids=False)
    arms = np.array([[0.05, 0.03, 0.08], [-0.05, 0.03, 0.08], [0.0, -0.06, 0.07]])
    p = data.T[:, None, :3, 3] + np.einsum("mij,tj->mti", data.T[:, :3, :3], arms)
    joints = {k: np.repeat(own[k], 3) for k in JOINTS}
    places = {k: 1e3 * p.reshape(-1, 3)[:, axis] for axis, k in enumerate(PLACES)}
    return joints | {"target": ["A", "B", "C"] * m} | places


@pytest.mark.parametrize("shift", [1, -1, 2, -2])
@pytest.mark.parametrize("what", [JOINTS, PLACES])
def test_shifted_lines_of_several_targets_are_named(what, shift, tmp_path):
    """Some targets may fit all the same: joints of the next line are often of the same pose."""
    right = three_targets()
    probe(ROBOT, read(tmp_path, right, "", "points")).raise_if_wrong()
    table = right | {k: np.roll(right[k], -shift) for k in what}
    further = shift if what is JOINTS else -shift
    with pytest.raises(InputError, match=rf"row k\{further:+d} belongs to") as caught:
        probe(ROBOT, read(tmp_path, table, "", "points")).raise_if_wrong()
    assert caught.value.code == "M31"


def test_one_target_whose_shots_have_slipped_is_named(tmp_path):
    table = three_targets()
    mine = np.array(table["target"]) == "B"
    for k in PLACES:
        table[k] = table[k].copy()
        table[k][mine] = np.roll(table[k][mine], -1)
    with pytest.raises(InputError, match="row k-1 of one target belongs to pose k"):
        probe(ROBOT, read(tmp_path, table, "", "points")).raise_if_wrong()


@pytest.mark.slow
def test_another_robot_is_not_taken_for_this_one(tmp_path):
    other = load_robot("universal_ur10")
    links = ROBOT.model.chain.links.copy()
    links[1, 2] += 0.15  # a forearm that is 150 mm longer
    longer = replace(
        ROBOT, model=replace(ROBOT.model, chain=replace(ROBOT.model.chain, links=links))
    )
    for robot in (other, longer):
        data = made(1, 40, robot=robot)
        q = np.clip(data.q, *ROBOT.limits.T)
        T = data.truth.poses(q)
        session = read(tmp_path, columns(Made(q, T, data.truth)))
        with pytest.raises(InputError, match="is this the robot that was measured") as caught:
            probe(ROBOT, session).raise_if_wrong()
        assert caught.value.code == "M32"
    (tmp_path / "s.toml").write_text(
        f'[frames]\neuler = "XYZ"\n{SIGMAS}[prior]\nlength_mm = 60\n'  # who says so is believed
    )
    probe(
        ROBOT, read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    ).raise_if_wrong()


def test_what_is_better_and_still_absurd_is_no_reading():
    bad = Misfit(position=800.0, rotation=0.1)
    told = Tried(Alternative("joints", "if", "do", "M20", "joints"), Misfit(16.0, 0.1))
    found = Probe("a.csv", "arm", bad, (told,), 1.0)
    assert found.wrong is None
    for tried in ((told,), (replace(told, misfit=Misfit(900.0, 0.1)),)):
        said = r"by 800 m and 5.7 deg, and none of 1 other interpretation comes .* the robot that"
        with pytest.raises(InputError, match=said):
            replace(found, tried=tried).raise_if_wrong()


def test_a_constant_orientation_is_no_mistake(tmp_path):
    """Hand-eye has no answer then; the positions have."""
    data = made(2, 200)
    rng = np.random.default_rng(0)
    # a wrist that undoes what the arm turns: search is not needed, poses need not be reachable
    chain = ROBOT.model.chain
    q = np.zeros((40, N))
    q[:, 1] = rng.uniform(-1, 1, 40)
    q[:, 2] = rng.uniform(-1, 1, 40)
    q[:, 4] = -(q[:, 1] + q[:, 2])  # three parallel axes: the sum turns the tool
    T = data.truth.poses(q)
    turns = T[:, :3, :3] @ T[0, :3, :3].T
    assert np.abs(turns - np.eye(3)).max() < 0.01
    assert chain.n_joints == 6
    found = probe(ROBOT, read(tmp_path, columns(Made(q, T, data.truth))))
    assert found.stated.position < 2e-3


def test_few_poses_are_not_probed_but_for_the_unit(tmp_path):
    few = columns(made(m=5))
    found = probe(ROBOT, read(tmp_path, few))
    assert found.stated is None
    found.raise_if_wrong()
    with pytest.raises(InputError, match="M21"):
        probe(ROBOT, read(tmp_path, scaled(few, PLACES, 1e3))).raise_if_wrong()


def test_the_controllers_own_poses_are_no_measurement(tmp_path):
    q = made().q
    T = ROBOT.model.poses(q)
    found = probe(ROBOT, read(tmp_path, columns(Made(q, T, ROBOT.model))))
    assert "a controller's own poses" in found.warnings[0]
    # four decimals of a millimeter leave a few hundred nanometers, which are told in plain digits
    T = T.copy()
    T[:, :3, 3] = np.round(T[:, :3, 3] + 2e-7 * np.sign(np.sin(1e9 * T[:, :3, 3])), 7)
    found = probe(ROBOT, read(tmp_path, columns(Made(q, T, ROBOT.model))))
    assert re.search(r"positions to \d{3} nm: these are a controller's own", found.warnings[0])
    # hundredths of a millimeter leave 5 um, as no robot does that was measured
    T[:, :3, 3] = np.round(T[:, :3, 3], 5)
    own = Made(q, T, ROBOT.model)
    (said,) = probe(ROBOT, read(tmp_path, columns(own))).warnings
    assert "all that the digits of the file allow: are these a controller's own poses" in said
    few = replace(made(), T=made().T.copy())
    few.T[:, :3, 3] = np.round(few.T[:, :3, 3], 5)
    assert not probe(ROBOT, read(tmp_path, columns(few))).warnings


def test_joints_copied_from_a_screen_beside_the_controllers_poses_are_told(tmp_path):
    """Three decimals of a degree move the flange by micrometers; no file says who wrote them."""
    q = made().q
    shown = np.radians(np.round(np.degrees(q), 3))
    T = ROBOT.model.poses(q)
    T[:, :3, 3] = np.round(T[:, :3, 3], 6)
    (said,) = probe(ROBOT, read(tmp_path, columns(Made(shown, T, ROBOT.model)))).warnings
    assert "all that the digits of the file allow: are these a controller's own poses" in said
    # two decimals move it by more than a tracker scatters: commanded joints are what they are
    q = np.radians(np.round(np.degrees(q), 2))
    T = ROBOT.model.poses(q)
    T[:, :3, 3] += 1e-5 * np.random.default_rng(0).standard_normal((len(q), 3))
    assert not probe(ROBOT, read(tmp_path, columns(Made(q, T, ROBOT.model)))).warnings


def test_what_a_pendant_shows_is_told_by_its_two_decimals(tmp_path):
    """Hundredths of a degree leave 40 um of the controller's own poses, and nothing was said."""
    q = made().q.copy()
    q[:, 5] = np.radians(90)  # one that stays where it is
    shown = np.radians(np.round(np.degrees(q), 2))
    T = ROBOT.model.poses(q)
    T[:, :3, 3] = np.round(T[:, :3, 3], 5)
    (said,) = probe(ROBOT, read(tmp_path, columns(Made(shown, T, ROBOT.model)))).warnings
    assert "all that the digits of the file allow: are these a controller's own poses" in said
    # what was measured of a real arm with the same digits is not
    T = made().truth.poses(shown)
    T[:, :3, 3] = np.round(T[:, :3, 3] + 2.5e-5 * np.sin(1e9 * T[:, :3, 3]), 5)
    assert not probe(ROBOT, read(tmp_path, columns(Made(shown, T, ROBOT.model)))).warnings
    # nor of an arm that was identified, which leaves as little
    own = replace(ROBOT, model=made().truth)
    assert not probe(own, read(tmp_path, columns(Made(shown, T, ROBOT.model)))).warnings


def test_poses_computed_from_the_joints_that_were_read_back_are_told(tmp_path):
    """Those were commanded differ by micrometers, and nothing was said."""
    q = made().q
    table = columns(Made(q + 2e-5, ROBOT.model.poses(q), ROBOT.model))
    table |= {f"q{j + 1}_read_rad": q[:, j] for j in range(N)}
    (tmp_path / "a.csv").write_text(csv(table))
    (tmp_path / "s.toml").write_text(
        f'[joints]\nsource = "commanded"\n[frames]\neuler = "XYZ"\n{SIGMAS}'
    )
    found = probe(ROBOT, read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml"))
    assert found.exact
    assert found.warnings[0].endswith("these are a controller's own poses, not measurements")


def test_joints_read_back_too_early_are_told(tmp_path):
    data = made()
    rng = np.random.default_rng(0)
    table = columns(data) | {
        f"q{j + 1}_read_rad": data.q[:, j] + 2e-3 * rng.standard_normal(29) for j in range(N)
    }
    (tmp_path / "a.csv").write_text(csv(table))
    (tmp_path / "s.toml").write_text(
        f'[joints]\nsource = "read-back"\n[frames]\neuler = "XYZ"\n{SIGMAS}'
    )
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    found = probe(ROBOT, session)
    found.raise_if_wrong()
    assert found.warnings[0].startswith("the commanded joints fit better")


def test_a_file_that_gives_the_inverse_is_probed_in_its_own_terms(tmp_path):
    own = columns(made(), gives="T_tool_tracker", euler="ZYX")
    right = read(tmp_path, own, 'euler = "ZYX"\ngives = "T_tool_tracker"')
    probe(ROBOT, right).raise_if_wrong()
    wrong = read(tmp_path, own, 'euler = "XYZ"\ngives = "T_tool_tracker"')
    with pytest.raises(InputError, match="in the order ZYX"):
        probe(ROBOT, wrong).raise_if_wrong()
    np.testing.assert_allclose(
        inverse(made().T)[0, :3, 3] * 1e3, [own[name][0] for name in PLACES], rtol=1e-12
    )


def test_of_thousands_of_poses_sixty_are_compared(tmp_path, monkeypatch):
    session, rows = read(tmp_path, with_spread(columns(made(4, 2700)))), []

    def counted(F, *args, **how):
        rows.append(len(F))
        return fit_frames(F, *args, **how)

    monkeypatch.setattr(shifts, "fit_frames", counted)
    probe(ROBOT, session).raise_if_wrong()
    assert max(rows) == shifts.ROWS


def robots(count, m, kind):
    """Scores of the right reading and the best wrong one for many robots."""
    import tempfile
    from pathlib import Path

    right, wrong, turned = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(100, 100 + count):
            data = made(seed, m)
            table = columns(data) if kind == "frames" else points(data)
            frames = 'euler = "XYZ"' if kind == "frames" else ""
            found = probe(ROBOT, read(Path(folder), table, frames, kind))
            right.append(found.stated.position)
            turned.append(found.stated.rotation)
            wrong.append(found.best.misfit.score)
    return np.array(right), np.array(turned), np.array(wrong)


@pytest.mark.truth
def test_right_and_wrong_readings_lie_far_apart():
    right, turned, wrong = robots(8, 29, "frames")
    # 0.04 deg at each of six axes of an arm of 0.9 m: 0.6 mm each, not all of it seen
    assert right.max() < 2e-3
    assert np.degrees(turned.max()) < 0.2
    assert wrong.min() > 0.020


@pytest.mark.study
def test_sixty_robots_are_read_rightly(record_property):
    for kind, far in (("frames", 0.020), ("points", 0.0079)):
        right, turned, wrong = robots(60, 29, kind)
        figures = (right.min(), right.max(), np.degrees(turned.max()), wrong.min())
        record_property(kind, [float(figure) for figure in figures])
        assert right.max() < 2e-3
        assert wrong.min() > far
        assert (wrong > 5 * right).all()


def test_a_gantry_that_is_off_by_micrometers_is_no_controller(tmp_path):
    """Joints commanded to a tenth of a millimeter were taken for the digits of a screen."""
    links = np.array([[0, 0, 0, -np.pi / 2, 0], [-np.pi / 2, 0, 0, -np.pi / 2, 0], [0.0] * 5])
    arm = replace(
        ROBOT, name="gantry", model=RobotModel(Chain(links, ("prismatic",) * 3)),
        limits=np.tile([-2.0, 2.0], (3, 1)),
    )  # fmt: skip
    rng = np.random.default_rng(1)
    q = np.round(rng.uniform(0, 1, (40, 3)), 4)
    seen = arm.model.poses(q)[:, :3, 3] + 3e-6 * rng.normal(size=(40, 3))
    table = {f"q{k + 1}_mm": 1e3 * q[:, k] for k in range(3)}
    table |= {f"{axis}_mm": 1e3 * seen[:, k] for k, axis in enumerate("xyz")}
    (tmp_path / "d.csv").write_text(csv(table))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "d.csv"\n[points]\nfile = "d.csv"\n[uncertainty]\nposition_um = 5\n'
    )
    assert not probe(arm, read_session(tmp_path, arm)).warnings


def test_a_target_that_was_changed_between_two_rows_may_be_what_moved(tmp_path):
    """It was told as an instrument or a robot that was moved, and as nothing else."""
    data = made(seed=2, m=30)
    table = {key: value for key, value in columns(data).items() if key[0] != "r"}
    T = data.truth.poses(data.q)
    away = 1e3 * T[15:, :3, :3] @ np.array([0.2, 0.3, 0.1])
    for k, axis in enumerate("xyz"):
        table[f"{axis}_mm"] = np.concatenate(
            [table[f"{axis}_mm"][:15], 1e3 * T[15:, k, 3] + away[:, k]]
        )
    (tmp_path / "d.csv").write_text(csv(table))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "d.csv"\n[points]\nfile = "d.csv"\n[uncertainty]\nposition_um = 20\n'
    )
    with pytest.raises(
        InputError, match=r"or the target on its flange was moved just before d\.csv:17"
    ):
        probe(ROBOT, read_session(tmp_path, ROBOT)).raise_if_wrong()


@pytest.mark.parametrize("held_out", [4, 10])
def test_a_wrong_reading_is_one_however_few_rows_are_held_out(held_out, tmp_path):
    """Too few to be asked by themselves, or each part by itself."""
    table = columns(made(m=30), form="none")
    parts = ["identify"] * (30 - held_out) + ["test"] * held_out
    (tmp_path / "a.csv").write_text(csv(table | {"y_mm": -table["y_mm"], "split": parts}))
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    with pytest.raises(InputError, match="if one of x, y, z has the other sign") as caught:
        probed(ROBOT, session)
    assert caught.value.code == "M32"
