"""A robot identified from several visits, and judged by one in frames of its own."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.errors import InputError
from calib.identification.identify import identify
from calib.measurement.observations import joined
from calib.measurement.prediction import predict
from calib.uncertainty.statement.gain import estimator_gain
from testbed.files.read import read_session
from testbed.files.session_toml import FRAMES_ALONE
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.calibration import Calibration
from testbed.identify.handback.delivered import Delivered
from testbed.identify.results import headline, split_csv
from testbed.identify.to_do.next_step import next_step
from testbed.identify.visits.frames import own_frames
from testbed.identify.visits.report import radius_there, visit_section, visit_words
from testbed.identify.visits.split import split_of_session
from testbed.identify.words import terminal_text, verdict
from testbed.store.npz import record_bytes, record_from
from tests.testbed.files.campaign import HEAD, NOISE, TURN, place, session, visit, written
from tests.testbed.files.made import ROBOT, made

GEOMETRIC = Options(model="geometric")
HELD = ("held_out = true", "frame_poses = 10")


@cache
def campaign(folder, *, seed=0):
    """Two sessions that identify, a third one that judges in frames of its own."""
    return read_session(
        written(
            folder,
            {"a": visit(0, 40, seed=seed), "b": visit(1, 30, seed=seed),
             "c": visit(2, 50, seed=seed)},
            session("a"), session("b"), session("c", *HELD),
        ),
        ROBOT,
    )  # fmt: skip


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    return campaign(tmp_path_factory.mktemp("three"))


@pytest.fixture(scope="module")
def found(three):
    return calibrate(ROBOT, three, GEOMETRIC)


def test_frames_of_every_visit_are_found_and_the_held_out_one_agrees(found):
    model = found.fit.identification.model
    assert found.fit.identification.names[-24:-18] == tuple(
        f"station2.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")
    )
    # 30 numbers of one visit, and base and tool of the two others
    assert found.fit.identification.rank == len(found.fit.identification.names) == 54
    for k in (1, 2):
        # what was measured: the base of visit k seen from its station
        seen = np.linalg.inv(model.fixtures.stations[k - 1]) @ model.chain.T_world_base
        # tens of micrometres of the frames, at meters; links differ in numbers alike in effect
        np.testing.assert_allclose(seen[:3, 3], place(k)[0][:3, 3], atol=1.5e-3)
    judged = found.measurements.rows(found.split.is_test)
    assert judged.n_poses == 40
    assert set(judged.tool.tolist()) == {2}
    assert found.proof.held_out.p_value > 1e-3
    assert found.proof.belief.n_guards == 40
    assert not found.elsewhere


def test_the_region_of_a_held_out_visit_holds_its_true_points_with_its_frames(found):
    """Wider than with the frames of the first session: ten poses tell frames less than forty."""
    rows = found.split.is_test
    table = found.measurements.rows(rows)
    belief = found.proof.belief
    there = belief.seen_regions(table)
    true = visit(2, 50).truth.poses(table.q)[:, :3, 3]
    # rigid robots: 99.7 % of 150 of them; of one robot no tenth of 40 poses is missed
    assert there.holds(true).mean() > 0.9
    here = np.trace(belief.regions(table.q).covariance, axis1=1, axis2=2).mean()
    assert np.trace(there.covariance, axis1=1, axis2=2).mean() > 1.2 * here
    assert radius_there(found, rows) > found.proof.point.radius_mean


def test_the_training_does_not_know_the_held_out_visit(three, found):
    """Links, frames and their covariance are those of the two sessions alone."""
    rows = found.is_used
    alone = [k for k, name in enumerate(found.fit.identification.names)
             if not name.startswith(("station3", "tool3"))]  # fmt: skip
    again = identify(
        found.fit.identification.model, found.measurements.rows(rows),
        found.fit.identification.parameters.freeing(
            [found.fit.identification.names[k] for k in alone]
        ),
    )  # fmt: skip
    # where the fit ended, and where it ends again: a part of the uncertainty
    assert np.abs(again.step / again.standard_uncertainty).max() < 1e-4
    np.testing.assert_allclose(
        found.fit.identification.covariance[np.ix_(alone, alone)], again.covariance, rtol=1e-6,
        atol=1e-22,
    )  # fmt: skip


def test_the_covariance_of_held_out_frames_is_that_of_one_fit_whose_frame_rows_hardly_count(
    three, found
):
    """In the limit of frame rows without weight one least squares is the two steps: a sandwich."""
    own = own_frames(three, found.before, found.split)
    fit = found.fit.identification
    table = joined([found.measurements.rows(found.is_used), found.measurements.rows(own.rows)])
    seen, free = predict(fit.model, table), fit.parameters.free_index
    m, scale = int(found.is_used.sum()), fit.parameters.free_scale
    A = seen.rows[:, :, free] * scale
    W = np.linalg.inv(table.covariance)
    light = np.where(np.arange(len(table)) < m, 1.0, 1e-7)[:, None, None]
    H = np.einsum("mef,meg,mgh->fh", A, W * light, A)
    F = np.linalg.solve(H, np.einsum("mef,meg->fmg", A, W * light).reshape(len(H), -1))
    N = np.zeros((6 * len(table),) * 2)
    for k in range(len(table)):
        N[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = table.covariance[k]
    both = scale[:, None] * (F @ N @ F.T) * scale
    sd = np.sqrt(np.diag(both))
    # of correlations; 1e-7 of weight leaves that much of the frame rows in the links
    np.testing.assert_allclose(
        fit.covariance / np.outer(sd, sd), both / np.outer(sd, sd), atol=1e-5
    )


def test_rows_of_frames_hardly_count_in_what_the_proof_makes_of_an_estimate(three, found):
    """Gains of one fit with their light weights are those of the two steps: F N F' is C."""
    own = own_frames(three, found.before, found.split)
    fit = own.weighed(found.fit.identification, found.is_used)
    table = found.measurements.rows(found.is_used | own.rows)
    F = estimator_gain(fit, table)
    both = np.einsum("mfe,meg,mhg->fh", F, table.covariance, F)
    sd = np.sqrt(np.diag(both))
    # of correlations; the weight of 1e-6 leaves that much of the frame rows in the links
    np.testing.assert_allclose(
        fit.covariance / np.outer(sd, sd), both / np.outer(sd, sd), atol=1e-4
    )
    # the noise of rows that hardly count is not the usual noise: 17.5 um are stated for all
    assert abs(found.proof.belief.misfit.noise_sd - 17.5e-6) < 1e-9


def test_results_say_which_session_is_which(three, found):
    told = Delivered((), (), 0)
    result = headline(found, told)["sessions"]
    assert result["c"]["held_out"]
    assert [result["c"][part]["rows"] for part in ("fit_its_frames", "judge")] == [10, 40]
    assert result["b"]["identify"]["mean_mm"] < 0.05
    blocks = visit_section(found).blocks
    assert [len(block.rows) for block in blocks[1:]] == [3, 4]
    assert 'are those of session "a"' in terminal_text(found, told)
    assert "10 more of c to fit its frames, drawn at random (seed 0)" in found.split.sentence
    text = split_csv(found)
    assert [text.count(f",{part},") for part in ("identify", "frames", "test")] == [70, 10, 40]
    again = record_from(record_bytes("k", found, "s"), "k", Calibration, "s")
    assert again.visits == three.visits
    assert np.array_equal(again.visit, three.visit)


def test_errors_of_a_session_are_means_over_poses_and_turns_are_those_of_poses_alone(found):
    m = len(found.measurements)
    kinds = np.where(np.arange(m) % 4 < 2, "pose", "point")
    twice = replace(
        found.measurements, pose_id=(np.arange(m) + 1) // 3, repeat=np.arange(m) % 3, kind=kinds
    )
    several = replace(found, measurements=twice)
    judge = dict(enumerate(several.split.is_test & (several.visit == 2)))
    poses, turns = {}, {}
    for row, used in judge.items():
        if used:
            of = int(twice.pose_id[row])
            poses.setdefault(of, []).append(float(several.fit.misses.position[row]) ** 2)
            if kinds[row] == "pose":
                turns.setdefault(of, []).append(float(several.fit.misses.rotation[row]) ** 2)
    length = [1e3 * (sum(one) / len(one)) ** 0.5 for one in poses.values()]
    turn = [np.degrees((sum(one) / len(one)) ** 0.5) for one in turns.values()]
    assert len(length) < 40
    told = headline(several, Delivered((), (), 0))["sessions"]["c"]["judge"]
    assert told["rows"] == 40
    # sums in another order
    assert told["mean_mm"] == pytest.approx(sum(length) / len(length), rel=1e-12)
    assert told["max_mm"] == pytest.approx(max(length), rel=1e-12)
    assert told["mean_deg"] == pytest.approx(sum(turn) / len(turn), rel=1e-12)
    cells = next(row for row in visit_section(several).blocks[2].rows if row[1] == "judge")
    assert cells[2] == "40"
    assert cells[4] == f"{sum(length) / len(length):.4f}"
    assert cells[7] == f"{sum(turn) / len(turn):.4f}"
    said = next(text for text in visit_words(several) if text.startswith("session c"))
    assert f"{sum(length) / len(length):.4f} mm after" in said


def test_sessions_that_all_identify_give_held_out_poses_of_each(tmp_path):
    """Another base, the same tool: drawn poses of both judge, and share every frame."""
    read = read_session(
        written(
            tmp_path, {"a": visit(0, 40), "b": visit(1, 40, tool=0)},
            session("a"), session("b", 'tool = "same as a"'),
        ),
        ROBOT,
    )  # fmt: skip
    found = calibrate(ROBOT, read, Options(model="geometric", held_out=30))
    judged = found.measurements.rows(found.split.is_test)
    assert set(judged.station.tolist()) == {0, 1}
    assert not judged.tool.any()
    assert found.fit.identification.rank == 36
    assert found.proof.held_out.p_value > 1e-3


def test_a_calibrated_robot_is_placed_anew_by_frames_alone(tmp_path):
    robot = replace(ROBOT, model=replace(ROBOT.model, chain=made().truth.chain))
    text = HEAD.replace("[frames]", '[frames]\nfile = "a.csv"')
    head = text + f'[identification]\nfree = "{FRAMES_ALONE}"\n'
    read = read_session(written(tmp_path, {"a": visit(5, 40)}, head=head), ROBOT)
    found = calibrate(robot, read, Options(held_out=30))
    result = found.fit.identification
    assert {name.split(".")[0] for name in result.names} == {"base", "tool"}
    assert np.array_equal(result.model.chain.links, made().truth.chain.links)
    assert abs(result.chi_square - result.dof) < 5 * np.sqrt(2 * result.dof)
    assert verdict(found).startswith("With only the frames fitted")
    assert "Do not use" not in next_step(found)
    with pytest.raises(InputError, match='--model is "extended"'):
        calibrate(robot, read, Options(model="extended"))


@pytest.mark.parametrize(
    ("counts", "lines", "said"),
    [
        ((30, 2), (), 'frames of session "b".*2 different poses give 12 equations.*at least 3'),
        ((2, 30), (), 'frames of session "a".*2 different poses give 12 equations.*at least 3'),
        ((30, 10), HELD, 'session "b" has 10 poses, and its frames take 10'),
    ],
    ids=["of b", "of a", "none left to judge"],
)
def test_frames_that_nothing_determines_are_refused_by_name(tmp_path, counts, lines, said):
    a, b = (visit(k, m) for k, m in enumerate(counts))
    read = read_session(
        written(tmp_path, {"a": a, "b": b}, session("a"), session("b", *lines)), ROBOT
    )
    with pytest.raises(InputError, match=said):
        calibrate(ROBOT, read, replace(GEOMETRIC, held_out=None if lines else 0))


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (4, r'"b" \(2 of its 4 poses, the rest held out\): 2 different poses give 12 equations'),
        (1, r'"b" \(0 of its 1 pose, the rest held out\): no pose determines them; measure 6'),
    ],
)
def test_frames_whose_poses_are_held_out_say_so(tmp_path, count, said):
    """Ten rows at one joint vector are one pose."""
    few = visit(1, count)
    some = np.arange(max(count, 10)) % count
    few = replace(few, q=few.q[some], T=few.T[some])
    folder = written(tmp_path, {"a": visit(0, 40), "b": few}, session("a"), session("b"))
    read = read_session(folder, ROBOT)
    with pytest.raises(InputError, match=said) as error:
        calibrate(ROBOT, read, GEOMETRIC)
    assert error.value.where.startswith(str(folder / "session.toml"))


def test_a_session_that_does_not_stand_where_it_is_said_to_is_called_by_its_name(tmp_path):
    """Its tool was remounted and its station moved; the file says both are those of others."""
    read = read_session(
        written(
            tmp_path, {"a": visit(0, 40), "b": visit(1, 30), "c": visit(2, 20)},
            session("a"), session("b"),
            session("c", "held_out = true", 'base = "same as b"', 'tool = "same as a"'),
        ),
        ROBOT,
    )  # fmt: skip
    found = calibrate(ROBOT, read, GEOMETRIC)
    assert verdict(found).startswith("The held-out rows of session c are off as a whole by ")
    step = next_step(found)  # they have a session of their own already
    own = 'base = "free", tool = "free" and frame_poses = 10 in their [[session]].'
    assert step.endswith(f"show where they stand: {own}")


def test_one_file_in_two_sessions_is_refused(tmp_path):
    text = [session("a"), session("b").replace('"b.csv"', '"a.csv"')]
    with pytest.raises(InputError, match='"b" has 40 readings of session "a" again'):
        read_session(written(tmp_path, {"a": visit(0, 40)}, *text), ROBOT)


def test_a_held_out_pose_at_joints_that_identify_judges_nothing(tmp_path):
    """The home pose, measured in every visit."""
    a, c = visit(0, 40), visit(2, 30)
    T = c.truth.poses(a.q[:1])
    again = replace(c, q=np.concatenate([c.q, a.q[:1]]), T=np.concatenate([c.T, T]))
    read = read_session(
        written(tmp_path, {"a": a, "c": again}, session("a"), session("c", *HELD)), ROBOT
    )
    for seed in range(3):  # the pose is drawn for the frames by one in three
        split = split_of_session(read, train=None, held_out=None, seed=seed)
        assert not split.is_test[-1]
        assert not split.is_train[-1]
        assert "1 no proof, because they are at training joints" in split.sentence


def test_the_stated_target_is_one_that_the_first_session_saw(tmp_path):
    """Each with reflectors of its own: from the first base nobody knows those of the second."""
    lines = [f"q{j + 1}_deg" for j in range(6)] + [f"{n}_{x}_mm" for n in "AB" for x in "xyz"]
    rng, arms = np.random.default_rng(3), np.array([[0.1, 0.0, 0.05], [0.0, 0.12, 0.08]])

    def reflectors(k):
        data = visit(k, 30)
        q = data.q * [0.05, 1, 1, 1, 1, 1]  # joint 1 hardly moves: base and tool are alike
        T = data.truth.poses(q)
        points = [T[:, :3, 3] + T[:, :3, :3] @ arm for arm in arms]
        seen = np.hstack(points) + NOISE * rng.standard_normal((30, 6))
        rows = np.hstack([np.degrees(q), 1e3 * seen])
        return "\n".join([",".join(lines), *(",".join(map(repr, row)) for row in rows.tolist())])

    targets = {n: [f"{n}_{x}_mm" for x in "xyz"] for n in "AB"}
    head = HEAD.replace('[frames]\neuler = "XYZ"', "").replace(
        f"rotation_mdeg = {np.degrees(TURN) * 1e3:.6g}\n", ""
    )
    head += "[points.targets]\n" + "".join(f"{n} = {names}\n" for n, names in targets.items())
    files = {"a": reflectors(0), "b": reflectors(1)}
    read = read_session(written(tmp_path, files, session("a"), session("b"), head=head), ROBOT)
    found = calibrate(ROBOT, read, replace(GEOMETRIC, held_out=20))
    assert found.target.reflector in found.measurements.reflector[found.measurements.station == 0]
    there = [radius_there(found, found.split.is_test & (found.measurements.station == k))
             for k in (0, 1)]  # fmt: skip
    # those of the second are known there ten times worse, base and tool being so alike
    assert found.proof.point.radius_mean < 2 * max(there)
