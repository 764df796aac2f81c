"""Nests on the floor: a drift that is there is found and taken off, one that is not is left."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import exp_so3, log_so3, step_transform
from calib.measurement.corrections import rigid_fit_covariance
from testbed.files.nests.drift import correct_drift, judge_drift
from testbed.files.nests.motions import best_fit
from testbed.files.read import read_held_out, read_session
from testbed.files.readings import Readings
from tests.testbed.files.made import ROBOT, N, columns, csv, made

NESTS = {
    "B1": [2.0, 0.0, -0.3],
    "B2": [0.0, 2.5, -0.3],
    "B3": [-1.5, 0.0, 0.8],
    "B4": [1.0, 1.0, 2.0],
}
DATA = made(8, 40, 0.0)
ARM = np.array([0.05, 0.03, 0.08])


def measured(
    folder,
    *,
    drift,
    noise,
    rng,
    rounds=5,
    nests=NESTS,
    limit=0.2,
    spoil=None,
    lifted=None,
    missed=(),
    unshot=(),
    stated="position_um = 5",
):
    """Rounds over the nests among the poses, by a station that moves in proportion."""
    rows = {k: [] for k in ("pose_id", "target", *(f"q{j + 1}_rad" for j in range(N)))}
    rows |= {f"{a}_m": [] for a in "xyz"}
    per = len(DATA.q) // (rounds - 1)
    true = []
    shots = []
    for r in range(rounds):
        shots += [(-1, name, np.array(p)) for name, p in nests.items()]
        if r < rounds - 1:
            for k in range(r * per, (r + 1) * per):
                p = DATA.T[k, :3, :3] @ ARM + DATA.T[k, :3, 3]
                shots.append((k, "SMR", p))
                true.append(p)
    for n, (k, name, p) in enumerate(shots):
        share = n / (len(shots) - 1)
        T = step_transform(share * np.asarray(drift))
        seen = T[:3, :3] @ p + T[:3, 3] + noise * rng.standard_normal(3)
        if spoil == n:
            seen[0] += 0.4e-3
        if lifted is not None and name in lifted:
            far, some = lifted[name]
            seen += np.array(far) * (sum(one[1] == name for one in shots[:n]) in some)
        if n in missed:
            seen[:] = 0.0
        if n in unshot:
            continue
        q = DATA.q[k] if k >= 0 else np.zeros(N)
        for key, value in zip(rows, (str(max(k, 0)), name, *q, *seen), strict=True):
            rows[key].append(value)
    (folder / "a.csv").write_text(csv(rows, form="{:.17g}"))
    (folder / "s.toml").write_text(
        f"[points]\n[uncertainty]\n{stated}\n[drift]\nnests = {list(nests)}\n"
        f"limit_mm = {limit}\n".replace("'", '"')
    )
    return read_session(folder / "a.csv", ROBOT, config=folder / "s.toml"), np.array(true)


def test_a_rigid_motion_is_found_exactly():
    rng = np.random.default_rng(0)
    a, R = rng.standard_normal((5, 3)), exp_so3(np.array([0.3, -1.0, 2.0]))
    found, t = best_fit(a, a @ R.T + [1.0, 2.0, 3.0])
    np.testing.assert_allclose(found, R, atol=1e-14)
    np.testing.assert_allclose(t, [1.0, 2.0, 3.0], atol=1e-14)


def test_a_drift_well_above_its_uncertainty_is_taken_off(tmp_path):
    step = [80e-6, -50e-6, 30e-6, 10e-6, 0.0, -20e-6]
    session, true = measured(tmp_path, drift=step, noise=3e-6, rng=np.random.default_rng(1))
    drift = session.drift
    assert drift.corrected
    assert drift.sentence in session.notes
    assert len(session.measurements) == len(true)
    left = np.linalg.norm(session.measurements.position - true, axis=1)
    # 3 um per axis of a shot and of a round, instead of up to 100 um
    assert np.sqrt(np.square(left).mean()) < 10e-6
    assert 60e-6 < drift.shift[-1] < 150e-6
    assert drift.uncertainty < 8e-6


def test_a_drift_within_its_uncertainty_is_only_reported(tmp_path):
    session, true = measured(tmp_path, drift=np.zeros(6), noise=8e-6, rng=np.random.default_rng(3))
    assert not session.drift.corrected
    left = session.measurements.position - true
    # exactly as it was measured
    assert np.abs(np.std(left) / 8e-6 - 1) < 0.3
    assert "not taken off" in session.drift.sentence


def test_the_stated_uncertainty_of_a_shift_holds(tmp_path):
    """Without drift, shifts are as large as stated: sqrt(3) of one axis at most."""
    ratio = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        drift = measured(tmp_path, drift=np.zeros(6), noise=5e-6, rng=rng)[0].drift
        ratio += list(drift.shift[1:] / drift.uncertainty)
    # the worst axis is stated: the mean of |shift| over it lies between half and sqrt(3)
    assert 0.5 < np.sqrt(np.mean(np.square(ratio))) < 3**0.5


def test_a_wrong_lock_at_a_nest_does_not_count(tmp_path):
    rng = np.random.default_rng(2)
    session, _ = measured(tmp_path, drift=np.zeros(6), noise=3e-6, rng=rng, spoil=15)
    assert len(session.drift.wrong) == 1
    assert "mm from its median" in session.drift.wrong[0]
    assert session.drift.shift.max() < 20e-6


def test_a_nest_that_was_unseated_and_set_right_again_is_named_and_left_out(tmp_path):
    """Its .15 mm were taken for noise of all nests, which made R95 four times as wide."""
    rng, far = np.random.default_rng(5), [0.08e-3, -0.1e-3, 0.07e-3]
    step = [80e-6, -50e-6, 30e-6, 10e-6, 0.0, -20e-6]
    known = {"drift": step, "noise": 5e-6, "rounds": 6}
    session, true = measured(tmp_path, rng=rng, lifted={"B2": (far, (2, 3))}, **known)
    said = "nest B2 is not where the others have it in rounds 3, 4, as if it was unseated"
    assert [said in text for text in session.warnings].count(True) == 1
    assert sum("nest B2 is not where the others" in text for text in session.drift.wrong) == 2
    assert len(session.drift.wrong) == 2
    left = np.linalg.norm(session.measurements.position - true, axis=1)
    assert np.sqrt(np.square(left).mean()) < 20e-6
    good, _ = measured(tmp_path, rng=np.random.default_rng(5), **known)
    assert not good.drift.wrong
    # two rounds have three nests instead of four, and the one that moved made it 23 times as much
    variance = np.trace(session.drift.covariance[:, :3, :3], axis1=1, axis2=2)
    usual = np.trace(good.drift.covariance[:, :3, :3], axis1=1, axis2=2)
    assert variance.max() < 3 * usual.max()


@pytest.mark.parametrize("seed", range(3))
def test_which_of_nests_was_unseated_is_not_guessed(tmp_path, seed):
    """Half of the rounds with it elsewhere, three nests of which any may be it, or noise alone."""
    three = {name: NESTS[name] for name in ("B1", "B2", "B3")}
    far = {"B2": ([0.15e-3, 0.0, 0.0], (0, 1))}
    for noise, how in (
        (5e-6, {"lifted": far, "rounds": 4}),
        (5e-6, {"lifted": far, "rounds": 6, "nests": three}),
        (15e-6, {"rounds": 6}),
    ):
        rng = np.random.default_rng(seed)
        session, _ = measured(tmp_path, drift=np.zeros(6), noise=noise, rng=rng, **how)
        assert not session.drift.wrong


@pytest.mark.parametrize(
    ("nests", "told"),
    [
        ({"B1": [2.0, 0, 0], "B2": [0, 2.0, 0]}, "2 nests cannot show how a station turns"),
        ({f"B{k}": [2.0 * k, 0, 0] for k in range(1, 5)}, "nests in one line"),
    ],
)
def test_nests_that_show_no_rotation_are_refused(tmp_path, nests, told):
    with pytest.raises(InputError, match=told):
        measured(tmp_path, drift=np.zeros(6), noise=0, rng=np.random.default_rng(0), nests=nests)


def test_a_nest_that_is_never_in_its_place_is_named(tmp_path):
    """Of two rounds both lie 0.2 mm from their median: which one is right nobody knows."""
    second_round_b2 = len(NESTS) + len(DATA.q) + 1
    with pytest.raises(InputError, match="nest B2 has no shot near its median"):
        measured(
            tmp_path,
            drift=np.zeros(6),
            noise=0,
            rng=np.random.default_rng(0),
            rounds=2,
            limit=0.15,
            spoil=second_round_b2,
        )


THREE = {name: NESTS[name] for name in ("B1", "B2", "B3")}
STILL = {"drift": np.zeros(6), "noise": 3e-6, "nests": THREE}


def rng():
    return np.random.default_rng(5)


@pytest.mark.parametrize("bad", [*range(11)])
def test_a_round_without_three_good_shots_is_named_and_left_out(tmp_path, bad):
    shot = bad * (3 + 4) + 1
    for spoiled in ({"spoil": shot}, {"missed": [shot]}):
        session, _ = measured(tmp_path, rounds=11, rng=rng(), **STILL, **spoiled)
        line = 2 + shot - 1
        told = f"round {bad + 1} over the nests (from line {line}) left out"
        told += ": fewer than three good shots"
        assert [text for text in session.warnings if text == f"{tmp_path / 'a.csv'}: {told}"]
        assert len(session.drift.steps) == 10
        assert np.isfinite(session.measurements.position).all()
        assert session.drift.wrong[0].startswith(f"{tmp_path / 'a.csv'}:{line + 1}: nest B2 ")


def test_a_round_whose_good_shots_are_in_one_line_does_not_count(tmp_path):
    """They fix no turn about the line: readings were turned by whatever rounding made of it."""
    nests = {f"B{k}": [k, 0.0, -0.3] for k in (2, 3, 4)} | {"B5": [2.0, 2.0, 1.0]}
    step, shot = [80e-6, -50e-6, 30e-6, 0.0, 0.0, 0.0], 2 * (4 + 10) + 3
    session, true = measured(
        tmp_path, drift=step, noise=3e-6, nests=nests, missed=[shot], rng=rng()
    )  # fmt: skip
    assert np.abs(session.measurements.position - true).max() < 50e-6
    assert session.warnings[0].endswith("left out: fewer than three good shots out of one line")


@pytest.mark.parametrize("bad", [0, 4, 10])
@pytest.mark.parametrize("nests", [THREE, NESTS], ids=["three", "four"])
def test_a_shot_that_is_not_in_the_file_is_named_and_the_other_rounds_count(tmp_path, bad, nests):
    """As if it had been missed: the same rounds, the same drift."""
    how = {**STILL, "drift": [80e-6, -50e-6, 30e-6, 0.0, 0.0, 0.0], "nests": nests}
    shot = bad * (len(nests) + 4) + 1
    session, _ = measured(tmp_path, rounds=11, rng=rng(), **how, unshot=[shot])
    missed, _ = measured(tmp_path, rounds=11, rng=rng(), **how, missed=[shot])
    file = tmp_path / "a.csv"
    assert session.drift.wrong == (f"{file}: nest B2 was not shot in round {bad + 1}",)
    told = [text for text in session.warnings if f"round {bad + 1} over the nests" in text]
    assert len(told) == (len(nests) == 3)
    np.testing.assert_array_equal(session.drift.steps, missed.drift.steps)
    # times between the rounds are counted by rows, of which one is not there
    np.testing.assert_allclose(
        session.measurements.position, missed.measurements.position, rtol=0, atol=3e-6
    )


def test_the_drift_is_found_without_the_first_round(tmp_path):
    step = [80e-6, -50e-6, 30e-6, 0.0, 0.0, 0.0]
    session, _ = measured(tmp_path, drift=step, noise=1e-6, rng=rng(), nests=THREE, missed=[2])
    assert session.drift.corrected
    assert len(session.drift.steps) == 4


def test_too_many_lost_rounds_are_refused_with_their_lines(tmp_path):
    with pytest.raises(
        InputError, match=r"rounds 1, 2 over the nests \(from lines 2, 15\) of 5"
    ) as caught:
        measured(tmp_path, rng=rng(), **STILL, missed=[1, 14])
    assert caught.value.code == "M27"
    assert caught.value.where == str(tmp_path / "a.csv")


@pytest.mark.parametrize("missed", [[1], [5]])
def test_a_missed_shot_needs_no_direction_for_an_mpe(tmp_path, missed):
    """Shot 1 is at a nest, shot 5 at the robot: 0 0 0 lies at the tracker's own origin."""
    session, true = measured(tmp_path, rng=rng(), **STILL, missed=missed, stated="mpe_um = [15, 6]")
    assert len(session.measurements) == len(true) - (missed == [5])
    assert np.isfinite(session.measurements.covariance).all()
    left_out = session.drift.wrong if missed == [1] else session.masked
    line = f"{tmp_path / 'a.csv'}:3" if missed == [1] else "line 7"
    assert any(line in text for text in left_out)


def test_nests_need_no_joints_in_the_file_of_both(tmp_path):
    whole, _ = measured(tmp_path, **STILL | {"drift": np.full(6, 40e-6)}, rng=rng())
    lines = (tmp_path / "a.csv").read_text().splitlines()
    head = lines[0].split(",")
    joints = [head.index(f"q{j + 1}_rad") for j in range(N)]
    rows = [line.split(",") for line in lines]
    for row in rows[1:]:
        if row[head.index("target")] in THREE:
            for k in joints:
                row[k] = ""
    (tmp_path / "a.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    blank = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    assert blank.drift.corrected
    assert blank.warnings == whole.warnings
    np.testing.assert_array_equal(blank.measurements.position, whole.measurements.position)
    np.testing.assert_array_equal(blank.measurements.q, whole.measurements.q)
    # a row of the robot without its joints is refused as before
    rows[-5][joints[0]] = ""
    (tmp_path / "a.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    with pytest.raises(InputError, match="1 of 55 rows has cells that are not numbers"):
        read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")


def readings_at(position, target, order, noise):
    """Points (m, 3) [m] of one target or of several, without joints."""
    m = len(position)
    names = (target,) * m if isinstance(target, str) else tuple(target)
    return Readings(
        kind="point", where="a.csv", place=tuple(f"a.csv:{k}" for k in order), order=order,
        position=position, rotation=np.tile(np.eye(3), (m, 1, 1)), distance=np.zeros(m),
        covariance=np.tile(noise**2 * np.eye(6), (m, 1, 1)), target=names, anchor=("",) * m,
        station=("",) * m, uncertainty="stated",
    )  # fmt: skip


@pytest.mark.parametrize("stated", [1.0, 0.1], ids=["as stated", "more than stated"])
def test_what_the_nests_leave_in_the_readings_is_as_large_as_said(stated):
    """Readings without noise of their own, by a station that moved between two of four rounds."""
    names, nests = list(NESTS), np.array(list(NESTS.values()))
    rng, noise, squares = np.random.default_rng(7), 20e-6, []
    true = rng.uniform(-0.5, 0.5, (6, 3))
    T = [np.eye(4)] * 2 + [step_transform(np.array([4e-4, 0, -3e-4, 0, 2e-4, 0]))] * 2
    for _ in range(100):
        shots = [T[r][:3, :3] @ p + T[r][:3, 3] for r in range(4) for p in nests]
        shots += noise * rng.standard_normal((16, 3))
        order = np.concatenate([7 * r + np.arange(4) for r in range(4)])
        drift, begins, _ = judge_drift(
            readings_at(np.array(shots), names * 4, order, stated * noise), names,
            true.mean(axis=0), limit=5e-3,
        )  # fmt: skip
        seen = true @ T[2][:3, :3].T + T[2][:3, 3]
        robot = readings_at(seen, "SMR", 18 + np.arange(6) / 2, 1e-6)
        found = correct_drift(robot, drift, begins, true.mean(axis=0))
        off = (found.position - true).mean(axis=0)
        left, each = found.corrections, np.zeros((4, 3, 6))
        for which, share in zip(left.which.T, left.share.T, strict=True):
            error = share[:, None, None] * (left.motion[:, :3] @ left.roots[which])
            np.add.at(each, which, error / len(left.lever))
        S = sum(one @ one.T for one in each)
        squares.append(off @ np.linalg.solve(S, off) / 3)
    # 300 squares of a normal number: 0.08 each way and three of them, and the scatter of 12
    # residuals (freedom 18) counts as at least what is stated, and as t has it
    assert 0.6 < np.mean(squares) < 1.25


def test_the_covariance_of_a_rigid_fit_is_that_of_its_derivatives():
    rng, nests = np.random.default_rng(2), np.array(list(NESTS.values()))
    middle, columns, step = np.array([0.3, -0.2, 0.5]), [], 1e-6
    for at in np.ndindex(nests.shape):
        ends = []
        for sign in (1.0, -1.0):
            seen = nests.copy()
            seen[at] += sign * step
            R, t = best_fit(nests, seen)
            ends.append(np.concatenate([R @ middle + t, log_so3(R)]))
        columns.append((ends[0] - ends[1]) / (2 * step))
    gain = np.array(columns).reshape(4, 3, 6).swapaxes(1, 2)
    root = 1e-5 * rng.standard_normal((4, 3, 3))
    noise = root @ root.mT
    found = rigid_fit_covariance(nests, middle, noise)
    expected = (gain @ noise @ gain.mT).sum(axis=0)
    assert np.allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_a_session_says_which_rows_share_what_its_nests_are_wrong_by(tmp_path):
    step = [80e-6, -50e-6, 30e-6, 10e-6, 0.0, -20e-6]
    session, true = measured(tmp_path, drift=step, noise=3e-6, rng=np.random.default_rng(1))
    left = session.corrections
    assert len(left.covariance) == 5
    share = np.zeros((len(true), 5))
    np.add.at(share, (np.arange(len(true))[:, None], left.which), left.share)
    # every step is of two rounds, and between two of them in proportion
    assert np.allclose(share.sum(axis=1), 0.0)
    assert (share[:, 1:] >= 0).all()
    assert ((share[:, 1:] > 0).sum(axis=1) <= 2).all()
    middle = session.measurements.position - left.lever
    assert np.allclose(middle, middle[0], atol=1e-12)
    some = session.rows(np.arange(len(true)) % 2 == 0)
    assert np.array_equal(some.corrections.share, left.share[::2])
    still, _ = measured(tmp_path, drift=np.zeros(6), noise=8e-6, rng=np.random.default_rng(3))
    assert still.corrections is None


@pytest.mark.parametrize("sa", [False, True])
def test_a_drift_whose_nests_have_a_file_of_their_own_is_reported_and_left(tmp_path, sa):
    """Nothing says between which poses the nests were shot, however the poses are numbered."""
    rng, points = np.random.default_rng(3), DATA.T[:, :3, :3] @ ARM + DATA.T[:, :3, 3]
    step = np.array([6e-5, 3e-5, 3e-5, 9e-5, -6e-5, 3e-5])
    moved = [step_transform(r / 3 * step) for r in range(4)]
    nests = [
        (r, name, T[:3, :3] @ p + T[:3, 3] + 5e-6 * rng.standard_normal(3))
        for r, T in enumerate(moved)
        for name, p in NESTS.items()
    ]
    seen = [(0, f"p{k}", point) for k, point in enumerate(points)]
    for file, shots in (("seen.csv", seen), ("nests.csv", nests)):
        cells = [(f"{r}", name, *(f"{1e3 * x:.6f}" for x in point)) for r, name, point in shots]
        head = [] if sa else ["pose_id,target,x_mm,y_mm,z_mm"]
        rows = [*head, *(",".join(row if sa else (row[1], *row[1:])) for row in cells), ""]
        (tmp_path / file).write_text("\n".join(rows))
    joints = {"pose_id": [shot[1] for shot in seen]}
    joints |= {f"q{j + 1}_rad": DATA.q[:, j] for j in range(N)}
    (tmp_path / "joints.csv").write_text(csv(joints, form="{:.17g}"))
    exported = 'format = "sa"\nlength = "mm"\npose = "target"\n' if sa else ""
    (tmp_path / "session.toml").write_text(
        f'[points]\nfile = "seen.csv"\n{exported}[joints]\nfile = "joints.csv"\n[uncertainty]\n'
        f'position_um = 5\n[drift]\nfile = "nests.csv"\nnests = {list(NESTS)}\n'.replace("'", '"')
    )
    session = read_session(tmp_path / "session.toml", ROBOT)
    drift, T, middle = session.drift, moved[-1], points.mean(axis=0)
    true = np.linalg.norm(T[:3, :3] @ middle + T[:3, 3] - middle)
    assert abs(drift.shift[-1] - true) < 3 * np.sqrt(3) * drift.uncertainty  # of one axis
    assert not drift.corrected
    assert drift.sentence.endswith("not taken off")  # and not: as it is small
    assert any("between which poses" in text for text in session.warnings)
    # written to a nanometer
    np.testing.assert_allclose(session.measurements.position, points, rtol=0, atol=1e-9)


def test_nests_of_one_session_are_none_of_the_table_that_judges_it(tmp_path):
    """Their file belongs to the other rows, and is not asked for again."""
    table = columns(DATA, form="none", ids=False)
    for name, rows in (("a", slice(0, 30)), ("t", slice(30, 40))):
        (tmp_path / f"{name}.csv").write_text(csv({k: v[rows] for k, v in table.items()}))
    shots = [(name, *(1e3 * np.array(place))) for _ in range(3) for name, place in NESTS.items()]
    rows = [f"{name},{x},{y},{z}" for name, x, y, z in shots]
    (tmp_path / "nests.csv").write_text("\n".join(["target,x_mm,y_mm,z_mm", *rows]))
    session = tmp_path / "session.toml"
    session.write_text(
        '[joints]\nfile = "a.csv"\n[points]\nfile = "a.csv"\n[uncertainty]\nposition_um = 5\n'
        f'[drift]\nfile = "nests.csv"\nnests = {list(NESTS)}\n'.replace("'", '"')
    )
    assert read_session(session, ROBOT).drift is not None
    apart = read_held_out(tmp_path / "t.csv", ROBOT, session)
    assert apart.drift is None
    np.testing.assert_allclose(
        apart.measurements.position, DATA.T[30:, :3, 3], rtol=0, atol=1e-12
    )  # fifteen digits
