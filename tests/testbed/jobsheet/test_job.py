"""The job sheet: what is refused, what warns, and that all of it is printed."""

import csv
import io
from dataclasses import replace

import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.files.session_toml import SESSION_FILE, SessionFile
from testbed.gates.mistakes import validated
from testbed.gates.toml import toml_document
from testbed.identify.report.page import sheet_rows
from testbed.identify.results import headline
from testbed.jobsheet.report import job_csv, job_section
from testbed.jobsheet.sheet import Instrument, JobSheet
from testbed.proposal.text import MAY
from testbed.scenario.tolerance import Decision
from testbed.store.codec import pack, unpack
from tests.calibrated import sound
from tests.testbed.files.campaign import HEAD, visit, written
from tests.testbed.files.campaign import session as visit_of
from tests.testbed.files.made import ROBOT, columns, made, poses_csv, with_spread
from tests.testbed.files.made import csv as csv_of
from tests.testbed.identify.test_report import DELIVERED

SHEET = """
[job]
number = "26-0815"
customer = "Müller & Söhne"
serial_number = "F07_1A2B"
operator = "N. N."
data_rights = "the customer's; not to be passed on"
[job.instrument]
name = "laser tracker"
serial_number = "LT-1"
certificate = "K 4711"
calibrated = "2026-01-31"
valid_until = "2026-10-31"
[job.ambient]
temperature_degC = [20.1, 21]
pressure_hpa = 1013.2
humidity_percent = 45
"""


def sheet_of(text):
    return validated(toml_document(text.encode(), SESSION_FILE), SessionFile, SESSION_FILE).job


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (('"2026-10-31"', '"2025-10-31"'), "valid_until is 2025-10-31, before calibrated, which"),
        (('"2026-10-31"', '"31.10.2026"'), "should be an ISO day such as 2026-11-22"),
        (("[20.1, 21]", "[21, 20]"), "is .21, 20.; write the lowest one first"),
        (("[20.1, 21]", "[21]"), "temperature_degC has 1 entry"),
        (("1013.2", "1.0132"), "pressure_hpa is 1.0132; it must be 100 hPa or larger"),
        (("= 45", "= 145"), "humidity_percent is 145.*100 % or smaller"),
        (("operator =", "operators ="), 'has no key "operators"; did you mean "operator"'),
        (('"N. N."', '"a\\u001b[31mb"'), "one line without control characters"),
    ],
)
def test_a_wrong_entry_is_named(edit, said):
    with pytest.raises(InputError, match=said) as found:
        sheet_of(SHEET.replace(*edit))
    assert len(str(found.value).splitlines()) == 1


def test_the_tables_that_are_proposed_are_those_that_are_read():
    table = MAY.partition("# [job]")
    text = "".join(f"{line.lstrip('# ')}\n" for line in (table[1] + table[2]).splitlines())
    found = sheet_of(text)
    assert found.sheet.ambient.temperature == (20.0, 21.0)
    fields = set(JobSheet.__slots__) | set(Instrument.__slots__) | {"temperature_degC"}
    assert all(name in text for name in fields)


@pytest.mark.parametrize(
    ("day", "said"),
    [
        ("2026-10-31", ""),  # the last day counts
        ("2026-11-01", "was valid until 2026-10-31, and the robot was measured on 2026-11-01"),
        ("2026-01-31", ""),
        ("2026-01-30", "is of 2026-01-31, and the robot was measured before, on 2026-01-30"),
        ("", "no date of measuring is stated"),
    ],
)
def test_a_certificate_is_held_against_the_day_of_measuring(day, said):
    found = sheet_of(SHEET).sheet.instrument.warnings(day)
    assert [said in text for text in found] == [True] * bool(said)
    assert all("certificate K 4711 of laser tracker" in text for text in found)
    assert Instrument("tracker", certificate="1").warnings("") == ()


def test_an_instrument_out_of_date_is_a_warning_of_the_session(tmp_path):
    (tmp_path / "a.csv").write_text(poses_csv())
    toml = tmp_path / SESSION_FILE
    toml.write_text('[conditions]\ndate = "2026-11-22"\n' + SHEET)
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert [text for text in session.warnings if "out of date" in text]
    assert session.set_up.job.customer == "Müller & Söhne"
    toml.write_text(SHEET.replace("2026-10-31", "2027-10-31") + '[conditions]\ndate="2026-11-22"\n')
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert not [text for text in session.warnings if "certificate" in text]


def test_times_that_are_dates_say_from_when_to_when_was_measured(tmp_path):
    """The certificate is held against the last of them, too; a stated date counts for all."""
    toml, own = tmp_path / SESSION_FILE, columns(made()) | {"euler": ["XYZ"] * 29}
    hours = [f"2026-10-{29 + k // 12}T{8 + k % 12:02d}:00:00" for k in range(29)]
    (tmp_path / "a.csv").write_text(csv_of(with_spread(own | {"time": hours})))
    toml.write_text(SHEET)
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    assert session.set_up.date == "2026-10-29 to 2026-10-31"
    assert not [text for text in session.warnings if "certificate" in text]
    toml.write_text(SHEET.replace("2026-10-31", "2026-10-30"))
    session = read_session(tmp_path / "a.csv", ROBOT, config=toml)
    (said,) = [text for text in session.warnings if "out of date" in text]
    assert "was valid until 2026-10-30, and the robot was measured on 2026-10-31" in said
    toml.write_text('[conditions]\ndate = "2026-10-29"\n' + SHEET)
    assert read_session(tmp_path / "a.csv", ROBOT, config=toml).set_up.date == "2026-10-29"
    (tmp_path / "a.csv").write_text(
        csv_of(with_spread(own | {"time": [str(k) for k in range(29)]}))
    )
    toml.write_text(SHEET)
    assert read_session(tmp_path / "a.csv", ROBOT, config=toml).set_up.date == ""


def test_each_visit_of_a_campaign_is_held_against_the_one_certificate(tmp_path):
    head = SHEET.strip() + "\n"
    found = read_session(
        written(
            tmp_path,
            {"a": visit(0, 8), "b": visit(1, 7)},
            visit_of("a", 'conditions = { date = "2026-05-01" }'),
            visit_of("b", 'conditions = { date = "2026-11-22" }'),
            head=HEAD + head,
        ),
        ROBOT,
    )
    assert found.set_up.job == sheet_of(SHEET).sheet
    said = [text for text in found.warnings if "certificate" in text]
    assert len(said) == 1
    assert "measured on 2026-11-22" in said[0]


def test_every_entry_is_printed_and_comes_back_from_the_record():
    job = sheet_of(SHEET).sheet
    assert unpack(JobSheet, pack(job)) == job
    plain = sound()
    found = replace(
        plain,
        set_up=replace(plain.set_up, job=job, date="2026-06-01"),
        decision=Decision(1e-3, "guarded"),
    )
    rows = sheet_rows(found, DELIVERED)
    told = " ".join(value for _, value in rows)
    for line in SHEET.splitlines():
        if "= " in line and "[" not in line:
            assert line.partition("= ")[2].strip('"') in told, line
    assert "2026-06-01" in told
    assert "1 mm, guarded" in told
    assert "robot corrected: PASS" in dict(rows)["decision"]
    assert list(csv.reader(io.StringIO(job_csv(rows))))[1:] == [list(row) for row in rows]
    assert job_section(rows).blocks[0].rows == rows
    numbers = headline(found, DELIVERED)["job"]
    assert numbers["instrument"]["valid_until"] == "2026-10-31"
    assert numbers["ambient"] == {
        "temperature_degC": [20.1, 21.0], "pressure_hpa": 1013.2, "humidity_percent": 45.0,
    }  # fmt: skip
    assert job_section(sheet_rows(plain, DELIVERED)) is None
    assert headline(plain, DELIVERED)["job"]["customer"] is None
