"""[[session]]: several visits of one robot are read as one session, each with its own frames."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from tests.testbed.files.campaign import HEAD, session, table, visit, written
from tests.testbed.files.made import ROBOT


def read(folder, visits, *sessions, head=HEAD):
    return read_session(written(folder, visits, *sessions, head=head), ROBOT)


def test_visits_are_joined_with_stations_and_tools_numbered_through(tmp_path):
    """Held-out ones come last; what is shared has one number, whoever says so first."""
    found = read(
        tmp_path,
        {"a": visit(0, 8), "b": visit(1, 7), "c": visit(2, 12, tool=1), "d": visit(3, 9, base=0)},
        session("c", "held_out = true", "frame_poses = 6", 'tool = "same as b"'),
        session("a"),
        session("b"),
        session("d", 'base = "same as a"'),
    )
    assert [one.name for one in found.visits] == ["a", "b", "d", "c"]
    expected = {"a": (0, 0), "b": (1, 1), "d": (0, 2), "c": (2, 1)}
    for k, one in enumerate(found.visits):
        rows = found.measurements.rows(found.visit == k)
        assert set(zip(rows.station.tolist(), rows.tool.tolist(), strict=True)) == {
            expected[one.name]
        }
        assert (one.station, one.mounted) == expected[one.name]
    own = {one.name: {name.split(".")[0] for name in one.numbers} for one in found.visits}
    assert own == {"a": set(), "b": {"station2", "tool2"}, "d": {"tool3"}, "c": {"station3"}}
    assert [(one.base, one.tool) for one in found.visits] == [
        ("own", "own"), ("own", "own"), ("a", "own"), ("own", "b"),
    ]  # fmt: skip
    assert found.fixtures.counts == (0, 0, 2, 2)
    assert found.is_test.tolist() == [False] * 24 + [True] * 12
    assert found.pose_name(8) == "b/1"
    assert len(set(found.measurements.pose_id.tolist())) == 36
    assert found.order.tolist() == list(range(36))


def test_a_visit_may_state_its_own_noise_conditions_and_columns(tmp_path):
    renamed = table(visit(1, 7)).replace("x_mm", "X", 1)
    found = read(
        tmp_path,
        {"a": visit(0, 8), "b": renamed, "c": visit(2, 7)},
        session("a", 'conditions = { payload_kg = 2.0, payload_center_mm = [0, 0, 50], '
                'date = "2026-01-02" }'),
        session(
            "b", 'payload = "same as c"', 'frames = { columns = { x_mm = "X" } }',
            "uncertainty = { position_um = 50, rotation_mdeg = 20, joint_repeatability = "
            '"included" }',
            'conditions = { date = "2026-05-01" }',
        ),
        session("c", 'payload = "same as a"'),
        head=HEAD + "[conditions]\ntemperature_degC = 21\n",
    )  # fmt: skip
    assert found.conditions.payload.tolist() == [2.0] * 22
    assert found.measurements.conditions.center.tolist() == [[0.0, 0.0, 0.05]] * 22
    assert found.conditions.temperature.tolist() == [21.0] * 22
    assert found.set_up.date == "2026-01-02 and 2026-05-01"
    sd = np.sqrt(found.measurements.covariance[:, 0, 0])
    np.testing.assert_allclose(sd[:8], 17.5e-6)
    np.testing.assert_allclose(sd[8:15], 50e-6)


def test_reflectors_are_of_their_tool(tmp_path):
    def seen(data):
        return table(data, target=["R1"] * len(data.q))

    head = HEAD.replace('[frames]\neuler = "XYZ"', '[points]\nreflectors_mm = { R1 = "free" }')
    found = read(
        tmp_path,
        {"a": seen(visit(0, 8)), "b": seen(visit(1, 8)), "c": seen(visit(2, 8))},
        session("a"), session("b"), session("c", 'tool = "same as a"'), head=head,
    )  # fmt: skip
    assert found.reflector_names == ("a/R1", "b/R1")
    assert [found.measurements.reflector[8 * k] for k in range(3)] == [0, 1, 0]
    # reflectors of unknown place stand for the tool: it has no numbers beside them
    assert found.fixtures.counts == (2, 0, 2, 0)
    assert {n.split(".")[0] for n in found.visits[1].numbers} == {"station2", "reflector2"}


def test_a_file_of_one_session_is_read_as_ever(tmp_path):
    """Nothing but the names of poses, and the record of the visit, tells one [[session]] apart."""
    head = HEAD.replace("[frames]", '[frames]\nfile = "a.csv"')
    plain = read(tmp_path / "alone", {"a": visit(0, 8)}, head=head)
    joined = read(tmp_path / "joined", {"a": visit(0, 8)}, session("a"))
    assert not plain.visits
    assert plain.visit is None
    assert len(joined.visits) == 1
    for name in plain.measurements.__slots__:
        mine, theirs = (getattr(each.measurements, name) for each in (plain, joined))
        if isinstance(mine, np.ndarray):
            assert np.array_equal(mine, theirs), name


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ({"b": ['base = "same as x"']}, 'base is "same as x"; allowed is "free", and "same as'),
        ({"b": ['tool = "a"']}, 'tool is "a"; allowed is .*did you mean "same as a"'),
        ({"a": ['base = "same as b"'], "b": ['base = "same as a"']}, "in a circle: a -> b -> a"),
        ({"b": ['payload = "same as b"']}, 'payload "same as" goes in a circle: b -> b'),
        ({"b": ['payload = "same as a"']}, "which states none"),
        ({"b": ["held_out = true"]}, "frames of its own, fitted to nothing"),
        ({"b": ["held_out = true", "frame_poses = 5"]}, "6 or larger"),
        ({"b": ["frame_poses = 6"]}, "no frames to fit"),
        ({"a": ["held_out = true", "frame_poses = 6"], "b": ["held_out = true",
          "frame_poses = 6"]}, "nothing is left to identify from"),
    ],
    ids=str,
)  # fmt: skip
def test_sharing_that_makes_no_sense_is_refused_in_a_sentence(tmp_path, lines, said):
    sessions = [session(name, *lines.get(name, ())) for name in ("a", "b")]
    with pytest.raises(InputError, match=said):
        read(tmp_path, {"a": visit(0, 8), "b": visit(1, 8)}, *sessions)


def test_sessions_without_poses_and_two_of_one_name_are_refused(tmp_path):
    visits = {"a": visit(0, 8)}
    with pytest.raises(InputError, match='session "b" has no poses: it names no file'):
        read(tmp_path, visits, session("a"), '[[session]]\nname = "b"\n')
    with pytest.raises(InputError, match='two sessions are called "a"'):
        read(tmp_path, visits, session("a"), session("a"))
    empty = table(visit(1, 8)).split("\n")[0] + "\n"
    with pytest.raises(InputError, match=r"b\.csv"):
        read(tmp_path, visits | {"b": empty}, session("a"), session("b"))


def test_what_only_one_session_can_have_is_refused(tmp_path):
    visits = {"a": visit(0, 8), "b": visit(1, 8)}
    both = (session("a"), session("b"))
    with pytest.raises(InputError, match=r"\[start\] beside \[\[session\]\]"):
        read(tmp_path, visits, *both, head=HEAD + "[start]\n")
    with pytest.raises(InputError, match=r"each .*names its own file"):
        read_session(tmp_path / "a.csv", ROBOT, config=written(tmp_path, visits, *both) /
                     "session.toml")  # fmt: skip
    own = "uncertainty = { position_um = 20, rotation_mdeg = 10, joint_repeatability = "
    for more, said in (
        ('"robot" }', "another joint_repeatability than a"),
        ('"included", systematic = { target_offset_um = 5.0 } }', "other systematic parts of"),
    ):
        with pytest.raises(InputError, match=f'session "b" has {said}'):
            read(tmp_path, visits, session("a"), session("b", own + more))


def test_a_fault_in_the_file_of_one_visit_names_that_file(tmp_path):
    bad = table(visit(1, 8)).replace("e", "", 0)
    lines = bad.split("\n")
    lines[3] = lines[3].replace(lines[3].split(",")[8], "far", 1)
    with pytest.raises(InputError, match=r"b\.csv"):
        read(tmp_path, {"a": visit(0, 8), "b": "\n".join(lines)}, session("a"), session("b"))


def test_a_fault_in_the_tables_of_one_visit_names_that_visit(tmp_path):
    """Several have the same keys, and the fault is of one."""
    own = session("b", "conditions = { payload_kg = 100 }")
    with pytest.raises(InputError, match=r'session\.toml: session "b": \[conditions\] payload_kg'):
        read(tmp_path, {"a": visit(0, 8), "b": visit(1, 8)}, session("a"), own)


@pytest.mark.parametrize("other", ["", "current{}_A"])
def test_drives_are_followed_only_where_all_visits_have_the_same_columns(tmp_path, other):
    def seen(k, stem):
        loads = {stem.format(j + 1): np.linspace(-1, 1, 8) for j in range(6) if stem}
        return table(visit(k, 8), **loads)

    names = "torque{}_Nm", other or "torque{}_Nm", other
    visits = {name: seen(k, names[k]) for k, name in enumerate("abc")}
    one = read(tmp_path, {name: visits[name] for name in "ab"}, session("a"), session("b"))
    assert (one.rows_say.drive == "torque") == (not other)
    all_of_them = read(tmp_path, visits, *map(session, "abc"))
    assert all_of_them.rows_say.drive == ""
    assert "not every session" in dict(all_of_them.rows_say.unsaid)["torque"]


def test_rows_of_the_session_keep_their_visit(tmp_path):
    found = read(tmp_path, {"a": visit(0, 8), "b": visit(1, 7)}, session("a"), session("b"))
    some = found.rows(np.arange(15) % 2 == 0)
    assert some.visit.tolist() == [0] * 4 + [1] * 4
    assert replace(found).visits == found.visits
