"""[job] of session.toml: its tables."""

from datetime import date
from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from testbed.bounds import PRESSURE, TEMPERATURE
from testbed.jobsheet.sheet import Ambient, Instrument, JobSheet
from testbed.strict import PlainText, Strict

Line = Annotated[PlainText, Field(max_length=200)]
Temperature = Annotated[float, TEMPERATURE.signed("degC")]


def _is_a_day(text: str) -> str:
    """A day of the calendar, written so that everybody reads the same one."""
    try:
        if date.fromisoformat(text).isoformat() == text:
            return text
    except ValueError:
        pass
    raise ValueError("should be an ISO day such as 2026-11-22")


Day = Annotated[str, AfterValidator(_is_a_day)]
"""An ISO day; left out: nobody said."""


class InstrumentTable(Strict):
    """[job.instrument]: what measured, and the certificate that says how well."""

    name: Line = ""
    """Maker and model."""
    serial_number: Line = ""
    """Of the instrument."""
    certificate: Line = ""
    """Number of its calibration certificate."""
    calibrated: Day = ""
    """Day of that calibration."""
    valid_until: Day = ""
    """Last day on which the certificate holds; a later `date` under [conditions] warns."""

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> "InstrumentTable":
        """A certificate is valid from its own day on."""
        if self.calibrated and self.valid_until and self.valid_until < self.calibrated:
            raise ValueError(
                f"valid_until is {self.valid_until}, before calibrated, which is "
                f"{self.calibrated}; correct one of them"
            )
        return self

    @property
    def record(self) -> Instrument:
        """It without the schema."""
        return Instrument(**self.model_dump())


class AmbientTable(Strict):
    """[job.ambient]: the air in which was measured."""

    temperature_degC: tuple[Temperature, Temperature] | None = None  # noqa: N815 - the unit
    """Lowest and highest."""
    pressure_hpa: Annotated[float, PRESSURE.size("hPa")] | None = None
    """Pressure of the air."""
    humidity_percent: Annotated[float, Field(ge=0.0, le=100.0)] | None = None
    """Relative humidity."""

    @model_validator(mode="after")
    def _lowest_first(self) -> "AmbientTable":
        """A range that is one."""
        span = self.temperature_degC
        if span is not None and span[0] > span[1]:
            raise ValueError(
                f"temperature_degC is [{span[0]:g}, {span[1]:g}]; write the lowest one first"
            )
        return self

    @property
    def record(self) -> Ambient:
        """It without the schema."""
        return Ambient(self.temperature_degC, self.pressure_hpa, self.humidity_percent)


class JobTable(Strict):
    """[job]: who measured what for whom."""

    number: Line = ""
    """Of the job or the order."""
    serial_number: Line = ""
    """Of the robot."""
    customer: Line = ""
    """For whom."""
    operator: Line = ""
    """Who measured."""
    data_rights: Line = ""
    """Who may use the data, and for what."""
    instrument: InstrumentTable = InstrumentTable()
    ambient: AmbientTable = AmbientTable()

    @property
    def sheet(self) -> JobSheet:
        """It without the schema."""
        own = self.model_dump(exclude={"instrument", "ambient"})
        return JobSheet(**own, instrument=self.instrument.record, ambient=self.ambient.record)
