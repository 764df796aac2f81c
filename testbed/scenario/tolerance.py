"""[tolerance] of a session or a scenario: how far the tool may miss, and how that is decided."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import model_validator

from testbed.bounds import CELL, TRACKER_SD, shown
from testbed.strict import Strict

BALL = 2.795
"""R95 of three coordinates with standard uncertainty 1: the root of chi-square(3) at 95 %."""
Rule = Literal["guarded", "simple"]
"""Those of `calib.uncertainty.statement.conformity`."""


@dataclass(frozen=True, slots=True)
class Decision:
    """A tolerance and the rule by which it is decided."""

    tolerance: float
    """Largest distance of the mean tool point from where it should be [m]."""
    rule: Rule


class ToleranceTable(Strict):
    """[tolerance]: how far the tool may miss, and by which rule that is decided."""

    position_um: Annotated[float, CELL.size("um")]
    """Largest distance of the mean tool point from where it should be."""
    rule: Rule | None = None
    """guarded: pass where R95 still fits within the tolerance; simple: no guard band, but no pass
    where R95 alone is larger than the tolerance."""

    @model_validator(mode="after")
    def _by_a_rule(self) -> "ToleranceTable":
        """No decision without the rule that it was made by."""
        if self.rule is None:
            raise ValueError(
                f"position_um is {self.position_um:g}, and no rule says how that is decided; write "
                'rule = "guarded" (a pass keeps R95 away from the limit) or rule = "simple" (no '
                "guard band: at the limit a pass has a risk of 50 % or more)"
            )
        return self

    @property
    def odd(self) -> tuple[str, ...]:
        """A sentence on a tolerance that is hardly meant: no reading could show that it is kept."""
        least = shown(BALL * TRACKER_SD, "um")
        if self.position_um >= least:
            return ()
        return (
            f"[tolerance] position_um is {self.position_um:g}: no laser tracker can show less than "
            f"R95 = {least:.2g} um; check the unit ({self.position_um:g} mm is "
            f"{1e3 * self.position_um:g} um)",
        )

    @property
    def decision(self) -> Decision:
        """It in SI units."""
        assert self.rule is not None  # else there is no such table
        return Decision(self.position_um * 1e-6, self.rule)
