"""A job sheet for people and programs: one table of the report, a CSV, entries of result.json."""

from collections.abc import Iterable, Sequence

from testbed.jobsheet.sheet import JobSheet
from testbed.report.page import Section, Table
from testbed.report.text import csv_text
from testbed.store.quantities import AS_NAMED, Quantity, below, unitless

JOB_SHEET = "job_sheet.csv"
Row = tuple[str, str]


def job_rows(sheet: JobSheet, more: Iterable[Row] = ()) -> tuple[Row, ...]:
    """What is stated, and what it is; rows of the result after it, without empty ones."""
    tool, air = sheet.instrument, sheet.ambient
    certificate = [
        tool.certificate,
        f"of {tool.calibrated}" if tool.calibrated else "",
        f"valid until {tool.valid_until}" if tool.valid_until else "",
    ]
    span = air.temperature
    ambient = [
        "" if span is None else f"{span[0]:g} to {span[1]:g} degC",
        "" if air.pressure is None else f"{air.pressure:g} hPa",
        "" if air.humidity is None else f"{air.humidity:g} % relative humidity",
    ]
    rows = (
        ("job", sheet.number),
        ("customer", sheet.customer),
        ("serial number of the robot", sheet.serial_number),
        ("operator", sheet.operator),
        ("instrument", tool.name),
        ("serial number of the instrument", tool.serial_number),
        ("its certificate", ", ".join(filter(None, certificate))),
        ("air", ", ".join(filter(None, ambient))),
        ("data rights", sheet.data_rights),
        *more,
    )
    return tuple((what, value) for what, value in rows if value)


def job_section(rows: Sequence[Row]) -> Section | None:
    """The sheet as one table; None where nothing is stated."""
    if not rows:
        return None
    table = Table("As stated in the session", ("what", "value"), tuple(rows), "ll", size="small")
    return Section("job", "Job sheet", (table,), "record")


def job_csv(rows: Sequence[Row]) -> str:
    """job_sheet.csv."""
    return csv_text(("what", "value"), rows)


def job_numbers(sheet: JobSheet) -> list[Quantity]:
    """The sheet for result.json; null where nobody said."""
    own = ("number", "serial_number", "customer", "operator", "data_rights")
    tool = ("name", "serial_number", "certificate", "calibrated", "valid_until")
    air = {
        "temperature_degC": sheet.ambient.temperature,
        "pressure_hpa": sheet.ambient.pressure,
        "humidity_percent": sheet.ambient.humidity,
    }
    return [
        *unitless({name: getattr(sheet, name) or None for name in own}),
        *below("instrument", unitless({n: getattr(sheet.instrument, n) or None for n in tool})),
        *below("ambient", [Quantity(name, value, AS_NAMED) for name, value in air.items()]),
    ]
