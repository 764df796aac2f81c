"""Times of rows: with a time zone they are moments in the world."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.read import ReadOptions, read_session
from testbed.files.rows.times import days_of, moments_of
from testbed.files.table import DataTable
from testbed.files.text import Sheet
from tests.hangs import no_hang
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread

COUNT = 60
MOMENTS = [datetime(2026, 10, 25, 0, 30, tzinfo=UTC) + timedelta(minutes=k) for k in range(COUNT)]
"""One a minute, half of them before clocks in most of Europe went back at 01:00 UTC."""


def read(folder, texts):
    table = with_spread(columns(made(m=COUNT))) | {"euler": ["XYZ"] * COUNT, "time": texts}
    (folder / "a.csv").write_text(csv(table))
    return read_session(folder / "a.csv", ROBOT)


def stated(offsets):
    """The moments as clocks show them that are some hours ahead."""
    return [
        moment.astimezone(timezone(timedelta(hours=hours))).isoformat()
        for moment, hours in zip(MOMENTS, offsets, strict=True)
    ]


@pytest.mark.parametrize(
    "texts",
    [
        stated([2] * 30 + [1] * 30),
        stated([0, 2] * 30),
        [text.replace("+00:00", "Z") for text in stated([0] * COUNT)],
        [moment.strftime("%Y-%m-%d %H:%M") for moment in MOMENTS],
        [moment.strftime("%Y%m%dT%H%M%S.250") for moment in MOMENTS],
        [moment.strftime("%d.%m.%Y %H:%M:%S") for moment in MOMENTS],
        [moment.strftime("%d. %m. %Y; %H:%M").replace(";", "") for moment in MOMENTS],
        [moment.strftime("%-d.%-m.%Y %-H:%M:%S.5") for moment in MOMENTS],
        [moment.strftime("%m/%d/%Y %-I:%M:%S %p") for moment in MOMENTS],
        [moment.strftime("%-d/%-m/%Y %H:%M") for moment in MOMENTS],
        [moment.strftime("%Y/%-m/%d %H:%M:%S") for moment in MOMENTS],
        [moment.strftime("%H:%M:%S.250") for moment in MOMENTS],
        [(moment - timedelta(hours=1)).strftime("%-H:%M") for moment in MOMENTS],
    ],
    ids=[
        "clocks that go back",
        "two zones",
        "UTC",
        "no zone",
        "basic form",
        "dots",
        "dots and spaces",
        "no zeros",
        "month first",
        "day first",
        "year first",
        "time of day",
        "over midnight",
    ],
)
def test_rows_one_minute_apart_are_so_in_every_way_to_write_them(tmp_path, texts):
    session = read(tmp_path, texts)
    np.testing.assert_array_equal(session.time, 60.0 * np.arange(COUNT))
    assert not session.warnings


def test_times_of_day_that_go_back_or_jump_by_half_a_day_are_not_used(tmp_path):
    texts = [moment.strftime("%H:%M:%S") for moment in MOMENTS]
    for wrong in (
        [*texts[:5], "00:10:00", *texts[6:]],
        [*texts[:-1], "14:00:00"],
        [*texts[:-1], "24:00:00"],
        [*texts[:-1], "2026-10-25 01:29:00"],
    ):
        session = read(tmp_path, wrong)
        assert session.time is None
        assert "the times cannot be read" in session.warnings[0]
    assert read(tmp_path, texts).set_up.date == ""  # the day is not said


def test_times_with_and_without_a_zone_are_not_compared(tmp_path):
    texts = stated([2] * COUNT)
    texts[5], texts[40] = texts[5].removesuffix("+02:00"), texts[40].removesuffix("+02:00")
    session = read(tmp_path, texts)
    assert session.time is None
    (warning,) = session.warnings
    assert warning == (
        f"{tmp_path / 'a.csv'}: 58 of 60 times state a time zone and the others do not: "
        "they are not used"
    )


def test_days_with_dots_are_those_of_iso_dates(tmp_path):
    iso = read(tmp_path, [moment.strftime("%Y-%m-%d %H:%M") for moment in MOMENTS])
    dots = read(tmp_path, [moment.strftime("%d.%m.%Y %H:%M") for moment in MOMENTS])
    assert dots.set_up.date == iso.set_up.date == "2026-10-25"


def test_slashes_that_leave_day_and_month_open_order_one_day_and_not_two(tmp_path):
    october = [moment.replace(day=10) for moment in MOMENTS]
    told = read(tmp_path, [moment.strftime("%m/%d/%Y %H:%M") for moment in october])
    np.testing.assert_array_equal(told.time, 60.0 * np.arange(COUNT))
    assert told.set_up.date == "2026-10-10"
    may = [moment.replace(day=5) for moment in MOMENTS]
    one = read(tmp_path, [moment.strftime("%d/%m/%Y %I:%M %p") for moment in may])
    np.testing.assert_array_equal(one.time, told.time)
    assert one.set_up.date == ""  # 5 October, or 10 May
    later = [moment + timedelta(days=k // 30) for k, moment in enumerate(may)]
    two = read(tmp_path, [moment.strftime("%d/%m/%Y %H:%M") for moment in later])
    assert two.time is None
    assert "the times cannot be read" in two.warnings[0]


def test_a_row_that_is_left_out_takes_no_time_from_the_others(tmp_path):
    table = with_spread(columns(made(m=COUNT))) | {"euler": ["XYZ"] * COUNT}
    table["time"] = [moment.strftime("%Y-%m-%d %H:%M") for moment in MOMENTS]
    lines = csv(table).splitlines()
    (tmp_path / "a.csv").write_text("\n".join([*lines, "Mean" + "," * lines[0].count(",")]))
    session = read_session(tmp_path / "a.csv", ROBOT, options=ReadOptions(drop_invalid=True))
    np.testing.assert_array_equal(session.time, 60.0 * np.arange(COUNT))


def test_numbers_without_a_unit_are_said_to_be_taken_as_seconds(tmp_path):
    session = read(tmp_path, list(map(str, range(COUNT))))
    np.testing.assert_array_equal(session.time, np.arange(COUNT))
    (said,) = session.warnings
    assert said.endswith("numbers without a unit and taken as seconds; call their column time_s if "
                         "they are")  # fmt: skip


SHOTS = 29
RATE = 10.0


def logged(folder, *, moves=2.0, stands=3.0, late=0.04, zone="", stop=None):
    """A log of joints ten times a second, and shots in the middle of each stop by the same clock.

    Between stops all joints move evenly. The tracker saw the moment `late` seconds beside a line of
    the log; with `stop`, that shot was taken halfway on the way there.
    """
    data = made(m=SHOTS)
    period = moves + stands
    times = np.arange(0.0, SHOTS * period, 1 / RATE)
    stop_of, into = np.minimum(times // period, SHOTS - 1).astype(int), times % period
    share = np.clip(into / moves, 0.0, 1.0)[:, None]
    before = data.q[np.maximum(stop_of - 1, 0)]
    q = before + share * (data.q[stop_of] - before)
    shots = np.arange(SHOTS) * period + moves + stands / 2 + late
    if stop is not None:
        shots[stop] -= moves / 2 + stands / 2
    begin = datetime(2026, 3, 1, 14, 5, tzinfo=UTC).replace(tzinfo=None)

    def written(seconds):
        return [(begin + timedelta(seconds=float(one))).isoformat() + zone for one in seconds]

    log = {"time": written(times)}
    log |= {f"q{j + 1}_deg": np.degrees(column) for j, column in enumerate(q.T)}
    (folder / "log.csv").write_text(csv(log))
    seen = with_spread(columns(data, ids=False)) | {"euler": ["XYZ"] * SHOTS}
    seen = {name: column for name, column in seen.items() if not name.startswith("q")}
    (folder / "shots.csv").write_text(csv({"time": written(shots)} | seen))
    return data


def by_time(folder, within=0.2, match="time", more=""):
    """The session of both files, matched by their times."""
    file = folder / "session.toml"
    file.write_text(
        f'match = "{match}"\nmatch_within_s = {within}\n{more}'
        '[joints]\nfile = "log.csv"\n[frames]\nfile = "shots.csv"\n'
    )
    return read_session(file, ROBOT)


@pytest.mark.parametrize("zone", ["", "Z"])
def test_shots_get_the_joints_of_a_log_at_their_moment(tmp_path, zone):
    data = logged(tmp_path, zone=zone)
    session = by_time(tmp_path)
    np.testing.assert_allclose(session.measurements.q, data.q, atol=1e-12)
    assert session.measurements.n_poses == SHOTS
    assert any("matched by time with log.csv, up to 0.04 s apart" in one for one in session.notes)


def test_a_shot_at_the_moment_of_the_first_line_of_a_stop_is_read(tmp_path):
    """The line before it is of the way: a log and shots that both count whole seconds are so."""
    data = logged(tmp_path)
    log = (tmp_path / "log.csv").read_text().splitlines()
    shots = (tmp_path / "shots.csv").read_text().splitlines()
    joints = np.array([line.split(",")[1:] for line in log[1:]], dtype=float)
    for k in range(SHOTS):
        there = np.abs(joints - np.degrees(data.q[k])).max(axis=1) < 1e-9
        first = log[1 + int(np.argmax(there))].split(",")[0]
        shots[1 + k] = ",".join([first, *shots[1 + k].split(",")[1:]])
    (tmp_path / "shots.csv").write_text("\n".join(shots) + "\n")
    session = by_time(tmp_path, within=0.01)
    np.testing.assert_allclose(session.measurements.q, data.q, atol=1e-12)


def test_a_shot_on_the_way_or_without_joints_near_it_is_refused(tmp_path):
    logged(tmp_path, stop=7)
    with pytest.raises(
        InputError, match=r"shots.csv:9: within 0.2 s .* joint \d differs by"
    ) as one:
        by_time(tmp_path)
    assert one.value.code == "M31"
    logged(tmp_path)
    with pytest.raises(InputError, match=r"no joints within 0.01 s of 29 readings .*0.04 s away"):
        by_time(tmp_path, within=0.01)
    logged(tmp_path, zone="Z")
    text = (tmp_path / "shots.csv").read_text().replace("Z,", ",")
    (tmp_path / "shots.csv").write_text(text)
    with pytest.raises(InputError, match="dates with time zones"):
        by_time(tmp_path)
    (tmp_path / "shots.csv").write_text(text.replace("time,", "moment,", 1))
    with pytest.raises(InputError, match="has no times that can be read"):
        by_time(tmp_path)


@pytest.mark.parametrize("match", ["time", "order"])
def test_a_stated_difference_of_the_clocks_is_taken_off(match, tmp_path):
    data = logged(tmp_path, late=0.04 - 347.2)
    if match == "order":  # which asks for as many joints as shots
        q = {f"q{j + 1}_deg": np.degrees(data.q[:, j]) for j in range(6)}
        (tmp_path / "log.csv").write_text(csv(q))
    text = (
        f'match = "{match}"\nmatch_within_s = 0.2\n[joints]\nfile = "log.csv"\n'
        'clock_offset_s = 347.2\n[frames]\nfile = "shots.csv"\n'
    )
    (tmp_path / "session.toml").write_text(text)
    session = read_session(tmp_path / "session.toml", ROBOT)
    np.testing.assert_allclose(session.measurements.q, data.q, atol=1e-12)
    told = any("s apart with its clock 347.2 s ahead" in one for one in session.notes)
    odd = any("clock_offset_s changes nothing" in one for one in session.warnings)
    assert (told, odd) == (match == "time", match == "order")


@pytest.mark.parametrize("hours", [23, 25])
def test_times_of_day_that_come_again_match_nothing(hours, tmp_path):
    """Shots of the second day got the joints of the first, at equal times."""
    data, begin = columns(made(m=SHOTS)), datetime(2026, 3, 1, 10, tzinfo=UTC)
    moments = [begin + timedelta(hours=hours) * k / (SHOTS - 1) for k in range(SHOTS)]
    times = {"time": [f"{one:%H:%M:%S}" for one in moments]}
    (tmp_path / "log.csv").write_text(csv(times | {k: v for k, v in data.items() if k[0] == "q"}))
    shots = {k: v for k, v in with_spread(data).items() if not k.startswith(("q", "pose"))}
    (tmp_path / "shots.csv").write_text(csv(times | shots | {"euler": ["XYZ"] * SHOTS}))
    if hours < 24:
        np.testing.assert_allclose(by_time(tmp_path).measurements.q, made(m=SHOTS).q, atol=1e-12)
    else:
        with pytest.raises(InputError, match="its times of day go over 24 hours or more"):
            by_time(tmp_path)


def test_more_joints_than_shots_are_told_of_their_times_and_a_reach_without_them_is_odd(tmp_path):
    logged(tmp_path)
    with pytest.raises(InputError, match='or let match = "time" hold their times'):
        by_time(tmp_path, match="order")
    data = columns(made(m=SHOTS))
    (tmp_path / "log.csv").write_text(csv({k: v for k, v in data.items() if k[0] in "pq"}))
    shots = {k: v for k, v in with_spread(data).items() if not k.startswith("q")}
    (tmp_path / "shots.csv").write_text(csv(shots | {"euler": ["XYZ"] * SHOTS}))
    said = by_time(tmp_path, match="pose_id").warnings
    assert any("match_within_s changes nothing" in one for one in said)


@pytest.mark.parametrize("day", ["2026-03-01 ", "2026-03-01T", "1.3.2026 ", ""])
@pytest.mark.parametrize("drop", [False, True])
def test_dates_in_a_column_of_seconds_are_told_how_to_name_it(tmp_path, day, drop):
    """Without a row that can be read there is no first one to count from."""
    table = with_spread(columns(made())) | {"euler": ["XYZ"] * 29}
    table["time_s"] = [f"{day}10:00:{k:02d}" for k in range(29)]
    (tmp_path / "a.csv").write_text(csv(table))
    said = r"no row is left" if drop else r"time_s .*; call the column time if these are dates"
    with pytest.raises(InputError, match=said):
        read_session(tmp_path / "a.csv", ROBOT, options=ReadOptions(drop_invalid=drop))


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S", "%H:%M:%S", "%d/%m/%Y %H:%M:%S"])
def test_the_dates_of_a_long_log_are_read_in_time(form):
    """Where a row takes all cells of its column, 20,000 rows take minutes."""
    count, begun = 20_000, datetime(2026, 3, 15, 10, tzinfo=UTC)
    rows = tuple(((begun + timedelta(seconds=k)).strftime(form),) for k in range(count))
    sheet = Sheet("a.csv", ("time",), rows, tuple(range(count)), "comma", "UTF-8")
    table, good = DataTable(sheet, {"time": "time"}, "."), np.arange(count) % 3 > 0
    with no_hang():
        moments, said = moments_of(table, good)
        days_of(table, good)
    assert moments is not None
    assert not said
    since = moments.seconds - moments.seconds[1]
    np.testing.assert_allclose(since[good], np.flatnonzero(good) - 1.0, rtol=0, atol=1e-5)
    assert np.isnan(since[~good]).all()
