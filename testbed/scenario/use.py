"""Under which conditions a robot is used or measured, as a table of a scenario or a session."""

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from calib.arrays import frozen
from testbed.bounds import PAYLOAD, TEMPERATURE
from testbed.strict import PlainText, Strict

if TYPE_CHECKING:
    from calib.uncertainty.statement.conditions import Conditions


class UseSettings(Strict):
    """[use] of a session, [plan.use] of a scenario: what is mounted, and how warm it is there."""

    payload_kg: Annotated[float, PAYLOAD.or_zero("kg")] | None = None
    """Mass at the flange beyond the arm's own."""
    tool: Annotated[PlainText, Field(min_length=1, max_length=200)] | None = None
    """Name of what is mounted there."""
    temperature_degC: Annotated[float, TEMPERATURE.signed("degC")] | None = None  # noqa: N815 - the unit
    """Temperature of the robot's links."""

    def rows(self, m: int) -> "Conditions":
        """The stated conditions of m rows."""
        from calib.uncertainty.statement.conditions import Conditions

        payload, temperature = (
            None if value is None else frozen(np.full(m, value))
            for value in (self.payload_kg, self.temperature_degC)
        )
        return Conditions(payload, None if self.tool is None else (self.tool,) * m, temperature)
