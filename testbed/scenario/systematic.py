"""[uncertainty.systematic]: what an instrument gets wrong in all readings alike, as stated."""

from typing import Annotated

from pydantic import model_validator

from testbed.bounds import ANGLE_SD, COORDINATE, DIRECTION, LENGTH_SD, RANGE_SCALE, shown
from testbed.strict import Strict

Coordinate = Annotated[float, COORDINATE.signed("mm")]
Floor = Annotated[float, LENGTH_SD.or_zero("um")]
AngleFloor = Annotated[float, ANGLE_SD.or_zero("mdeg")]
ScaleFloor = Annotated[float, RANGE_SCALE.or_zero("um/m")]
Component = Annotated[float, DIRECTION.signed("")]
LEAST_UP = 1e-3
"""Of the largest number of a direction."""


class SystematicTable(Strict):
    """[uncertainty.systematic]: what the instrument gets wrong in all readings alike (k = 1)."""

    range_offset_um: Floor = 0.0
    """Of all ranges alike."""
    scale_um_per_m: ScaleFloor = 0.0
    """Of all ranges, per meter."""
    encoder_amplitude_um: tuple[Floor, ScaleFloor] = (0.0, 0.0)
    """Across the beam, of what goes with sin(azimuth) and sin(2 elevation) in any phase: constant,
    and per meter of range."""
    target_offset_um: Floor = 0.0
    """Of each target's place on the tool, per axis of the tool."""
    target_turn_mdeg: AngleFloor = 0.0
    """Of the 6-D target's rotation on the tool, per axis of the tool."""
    level_mdeg: AngleFloor = 0.0
    """Of each of the two tilts of the station against gravity: of absolute positions alone."""
    station_mm: tuple[Coordinate, Coordinate, Coordinate] | None = None
    """Where the beam starts in the frame of the coordinates: of the first station, which is the
    world. The coordinates of further stations are in their own frames."""
    station_up: tuple[Component, Component, Component] = (0.0, 0.0, 1.0)
    """Direction of the standing axis, in the same frame."""

    @property
    def sizes(self) -> dict[str, float]:
        """Size of each part; of the encoders the larger number."""
        alone = ("range_offset_um", "scale_um_per_m", "target_offset_um", "target_turn_mdeg",
                 "level_mdeg")  # fmt: skip
        sizes = {key: getattr(self, key) for key in alone}
        return sizes | {"encoder_amplitude_um": max(self.encoder_amplitude_um)}

    @model_validator(mode="after")
    def _some_size(self) -> "SystematicTable":
        """One part with a size, and a direction upwards."""
        # squares of what is smaller are no numbers
        if max(self.sizes.values()) < shown(LENGTH_SD.least, "um"):
            raise ValueError(
                f"no part has a size; write one of {', '.join(self.sizes)}, or remove the table"
            )
        if max(map(abs, self.station_up)) < LEAST_UP:
            raise ValueError(
                f"station_up is not a direction; one number must be {LEAST_UP:g} or more"
            )
        return self
