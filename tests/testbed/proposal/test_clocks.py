"""A log of joints and a log of readings: `new session` matches them by their clocks.

Truth: joints and places of each stop, from which both logs are written.
"""

import re
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from testbed.files.read import read_session
from testbed.proposal.rows import beginning
from testbed.proposal.rows.clocks import _rounded_up
from tests.command import call
from tests.testbed.files.made import ROBOT, csv, made
from tests.testbed.files.test_times import SHOTS, logged
from tests.testbed.proposal.test_session import proposed, refused

DATA = made(m=SHOTS)
STEP = 5.0
STOPS = STEP * np.arange(SHOTS)


def files(folder):
    return [folder / "log.csv", folder / "shots.csv"]


def two(folder, log, shots, rows=range(SHOTS), *, name="time_s"):
    """One line a stop in each file, at these times [s]; the shots of some stops only."""
    rows = list(rows)
    joints = {f"q{j + 1}_deg": np.degrees(DATA.q[:, j]) for j in range(6)}
    places = {f"{a}_mm": 1e3 * DATA.T[rows, k, 3] for k, a in enumerate("xyz")}
    (folder / "log.csv").write_text(csv({name: log} | joints))
    (folder / "shots.csv").write_text(csv({name: shots} | places))
    return rows


def read(folder):
    return read_session(folder / "session.toml", ROBOT).measurements


def test_a_long_log_is_matched_by_the_clock(tmp_path, monkeypatch):
    monkeypatch.setattr(beginning, "MATCHED", 100)
    monkeypatch.setattr(beginning, "TRIED", 100)  # of the log these are two stops
    logged(tmp_path)
    said, written = proposed(tmp_path, files(tmp_path), "--robot", ROBOT.name)
    # shots are 0.04 s beside lines of the log
    assert 'match = "time"\nmatch_within_s = 0.05\n' in written
    assert "times: both clocks are taken for one; readings are up to 0.04 s from the" in said
    assert "to fix" not in said
    assert "errors are 0." in said  # in so many of the first lines that base and tool are fitted
    np.testing.assert_allclose(read(tmp_path).q, DATA.q, atol=1e-12)


@pytest.mark.parametrize("file", ["log.csv", "shots.csv"])
def test_a_row_without_its_time_beside_a_long_log_is_refused(file, tmp_path, monkeypatch):
    monkeypatch.setattr(beginning, "MATCHED", 100)
    logged(tmp_path)
    lines = (tmp_path / file).read_text().splitlines()
    lines[9] = "," + lines[9].partition(",")[2]
    (tmp_path / file).write_text("\n".join(lines))
    said = refused(tmp_path, *files(tmp_path), "--robot", ROBOT.name)
    assert f"{file}: has no times that can be read" in said


def of_day(seconds):
    """Times by a clock that shows no day, about midnight."""
    begin = datetime(2026, 3, 1, 23, 59, tzinfo=UTC)
    return [f"{begin + timedelta(seconds=float(one)):%H:%M:%S.%f}" for one in seconds]


@pytest.mark.parametrize(("name", "shown"), [("time_s", list), ("Uhrzeit", of_day)])
def test_shots_of_some_stops_get_the_joints_of_these(name, shown, tmp_path):
    log, shots = ([*map(str, shown(times))] for times in (STOPS, STOPS[4:] + 1.3))
    rows = two(tmp_path, log, shots, range(4, SHOTS), name=name)
    _, written = proposed(tmp_path, files(tmp_path), "--robot", ROBOT.name)
    assert "match_within_s = 2.0\n" in written
    np.testing.assert_allclose(read(tmp_path).q, DATA.q[rows], atol=1e-12)


def test_of_as_many_rows_the_clock_is_asked_where_their_order_does_not_fit(tmp_path):
    turned = np.random.default_rng(0).permutation(SHOTS)
    two(tmp_path, STOPS, STOPS[turned], turned)
    _, written = proposed(tmp_path, files(tmp_path), "--robot", ROBOT.name)
    assert 'match = "time"' in written
    assert "match_within_s" not in written  # the times are equal
    np.testing.assert_allclose(read(tmp_path).q, DATA.q[turned], atol=1e-12)
    two(tmp_path, STOPS, STOPS + 9e4)  # clocks that nobody set
    (tmp_path / "session.toml").unlink()
    _, written = proposed(tmp_path, files(tmp_path), "--robot", ROBOT.name)
    assert 'match = "order"' in written


@pytest.mark.parametrize(
    ("late", "why"),
    [
        (3600.0, "no joints within 5 s of 25 readings"),
        # nearer to the next stop than to its own one, and both are within the reach
        (2.7, "within 5 s of this reading the joints are not one pose"),
    ],
    ids=["an hour apart", "between two stops"],
)
def test_clocks_that_cannot_tell_the_stop_are_refused(late, why, tmp_path):
    two(tmp_path, STOPS, STOPS[:25] + late, range(25))
    done = call("new", "session", *files(tmp_path), "--robot", ROBOT.name, "--out",
                tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    assert why in " ".join(done.stderr.split())


def test_joints_of_the_stop_after_do_not_pass_as_those_of_the_reading(tmp_path):
    two(tmp_path, STOPS, STOPS[:25] + 3.1, range(25))  # 1.9 s before the next one, within 2 s
    done = call("new", "session", *files(tmp_path), "--robot", ROBOT.name, "--out",
                tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    assert "move the readings one row" in " ".join(done.stderr.split())


def late(folder, seconds):
    """The shots of `logged` by a clock that is this much behind that of the log [s]."""
    lines = (folder / "shots.csv").read_text().splitlines()
    for k, line in enumerate(lines[1:], start=1):
        time, _, rest = line.partition(",")
        lines[k] = (
            f"{(datetime.fromisoformat(time) - timedelta(seconds=seconds)).isoformat()},{rest}"
        )
    (folder / "shots.csv").write_text("\n".join(lines))


def test_clocks_that_differ_are_brought_together_by_the_stops(tmp_path):
    """It said to set both clocks alike, and then to drop all readings but two."""
    logged(tmp_path)
    late(tmp_path, 347.231)
    said, written = proposed(tmp_path, files(tmp_path), "--robot", ROBOT.name)
    # each shot is 1.54 s after its stop began, which lasts 2.9 s in the log: 345.69 to 348.59 s
    assert "clock_offset_s = 347.1\n" in written
    assert "since each of 29 readings then falls into one of as many stops" in " ".join(
        said.split()
    )
    np.testing.assert_allclose(read(tmp_path).q, DATA.q, atol=1e-12)


def test_no_difference_of_clocks_is_guessed_where_a_stop_has_no_reading(tmp_path, monkeypatch):
    """A log of which no line was near a reading ended in an IndexError."""
    monkeypatch.setattr(beginning, "MATCHED", 100)
    logged(tmp_path)
    lines = (tmp_path / "shots.csv").read_text().splitlines()
    (tmp_path / "shots.csv").write_text("\n".join([*lines[:9], *lines[10:]]))
    late(tmp_path, 1e4)
    said = refused(tmp_path, *files(tmp_path), "--robot", ROBOT.name)
    assert "no joints within 0.1 s of 28 readings" in said
    assert "state by how much they differ (clock_offset_s under [joints])" in said
    assert "--drop-invalid" not in said


def test_no_flag_is_proposed_that_leaves_too_few(tmp_path):
    """Next was `identify --drop-invalid`, which refused the three poses that were left."""
    table = {f"q{j + 1}_deg": np.degrees(DATA.q[:, j]) for j in range(6)}
    table |= {f"{a}_mm": [*map(str, 1e3 * DATA.T[:3, k, 3]), *["-"] * (SHOTS - 3)]
              for k, a in enumerate("xyz")}  # fmt: skip
    (tmp_path / "d.csv").write_text(csv(table))
    said, written = proposed(tmp_path, [tmp_path / "d.csv"], "--robot", ROBOT.name)
    assert "3 different poses give 9 equations" in said
    assert "--drop-invalid" not in said.partition("Next")[2]
    assert "--drop-invalid" not in written.partition("# Then")[2].splitlines()[0]


def test_readings_on_the_way_are_refused_in_words(tmp_path, monkeypatch):
    """A log of the tracker at ten readings a second was proposed, moving rows and all."""
    monkeypatch.setattr(beginning, "MATCHED", 100)
    logged(tmp_path)
    log = (tmp_path / "log.csv").read_text().splitlines()
    q = np.radians([[float(cell) for cell in line.split(",")[1:]] for line in log[1:]])
    places = 1e3 * DATA.truth.poses(q)[:, :3, 3]
    times = [line.partition(",")[0] for line in log[1:]]
    seen = {f"{axis}_mm": places[:, k] for k, axis in enumerate("xyz")}
    (tmp_path / "shots.csv").write_text(
        csv({"time": times[::2]} | {k: v[::2] for k, v in seen.items()})
    )
    said = refused(tmp_path, *files(tmp_path), "--robot", ROBOT.name)
    assert re.search(
        r"\d+ readings \(.*\) of \d+ were taken while the arm moved: within 0.2 s", said
    )
    assert "keep one reading of each stop: of a log, the mean of those at which the arm" in said


def test_a_reach_is_rounded_up_to_a_plain_number():
    wanted = {
        0.04: 0.05,
        0.05: 0.05,
        0.051: 0.1,
        1.3: 2.0,
        2.0: 2.0,
        7.0: 10.0,
        0.1: 0.1,
        1e-3: 1e-3,
    }
    assert {size: _rounded_up(size) for size in wanted} == wanted
