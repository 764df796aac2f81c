"""What a job sheet holds, and what is odd about the certificate of its instrument."""

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Instrument:
    """The instrument that measured, and its certificate; empty where nobody said."""

    name: str = ""
    serial_number: str = ""
    certificate: str = ""
    """Its number."""
    calibrated: str = ""
    """ISO day on the certificate."""
    valid_until: str = ""
    """ISO day, the last one that counts."""

    @property
    def called(self) -> str:
        """The certificate in a sentence."""
        number = f" {self.certificate}" if self.certificate else ""
        return f"the certificate{number} of {self.name or 'the instrument'}"

    def warnings(self, day: str) -> tuple[str, ...]:
        """What a certificate is not good for on the ISO day of measuring, or from a day to another.

        An empty one: nobody said.
        """
        limits = (self.calibrated, self.valid_until)
        if not any(limits):
            return ()
        if not day:
            return (
                f"nothing shows whether {self.called} was valid: no date of measuring is stated "
                "under [conditions]",
            )
        # ISO days compare as texts
        first, _, last = day.partition(" to ")
        last = last or first
        if self.valid_until and last > self.valid_until:
            return (
                f"{self.called} was valid until {self.valid_until}, and the robot was measured on "
                f"{last}: the uncertainty of the readings rests on an instrument out of date",
            )
        if self.calibrated and first < self.calibrated:
            return (
                f"{self.called} is of {self.calibrated}, and the robot was measured before, on "
                f"{first}: that day needs the certificate before it",
            )
        return ()


@dataclass(frozen=True, slots=True)
class Ambient:
    """The air in which was measured; None where nobody said."""

    temperature: tuple[float, float] | None = None
    """Lowest and highest [degC]."""
    pressure: float | None = None
    """[hPa]"""
    humidity: float | None = None
    """Relative [%]."""


@dataclass(frozen=True, slots=True)
class JobSheet:
    """Who measured what for whom; empty where nobody said."""

    number: str = ""
    """Of the job."""
    serial_number: str = ""
    """Of the robot."""
    customer: str = ""
    operator: str = ""
    data_rights: str = ""
    """Whose the data are, and who may see them."""
    instrument: Instrument = field(default_factory=Instrument)
    ambient: Ambient = field(default_factory=Ambient)
