"""Times of rows: with a time zone they are moments in the world."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from testbed.files.read import ReadOptions, read_session
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
    ],
)
def test_rows_one_minute_apart_are_so_in_every_way_to_write_them(tmp_path, texts):
    session = read(tmp_path, texts)
    np.testing.assert_array_equal(session.time, 60.0 * np.arange(COUNT))
    assert not session.warnings


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
