"""Whether a plan reaches its target of an arm whose joints sag and wave, as most arms do."""

from dataclasses import dataclass

from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sufficiency(Shown):
    """Whether the poses of a plan reach its target of an arm whose joints sag and wave."""

    radius: float
    """R95 that the calibration will state of such an arm over the goal, or at its worst, as the
    target asks: what nine of ten rehearsals keep to and a quarter more, for misfit that none has;
    inf where more of them state none [m]."""
    allowed: float
    """The largest one that reaches the target [m]."""
    most: int
    """Largest number of poses that was tried."""
    least: float
    """R95 that is stated after so many [m]."""

    @property
    def reached(self) -> bool:
        """Whether the target is reached."""
        return self.radius <= self.allowed
