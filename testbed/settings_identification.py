"""[identification]: what the estimators may move, what they believe, which model they fit."""

from typing import Annotated, Literal

from pydantic import Field

from testbed.settings_types import Settings

Spread = Annotated[float, Field(gt=0.0, le=1e4)]
"""Standard deviation of a prior."""
Named = dict[str, Spread]
PRIOR = ("identification", "prior")
"""Where the prior stands in the file."""
SINGLE = {"sd_deg": False, "sd_mm": True}
"""Keys of the prior that name numbers, and whether these are lengths."""


class PriorSettings(Settings):
    """[identification.prior]: how far from nominal the numbers may be, before any measurement.

    Standard deviations; a table with no key in it is the weak prior.
    """

    angles_deg: Spread = 0.1
    """Angles of the links."""
    lengths_mm: Spread = 0.6
    """Lengths of the links."""
    frame_angles_deg: Spread = 0.1
    """Rotation of base and tool, per axis."""
    frame_lengths_mm: Spread = 1.0
    """Position of base and tool, per axis."""
    gravity_mdeg: Spread = 50.0
    """Coefficients of sag; only the extended model has them."""
    harmonics_mdeg: tuple[Spread, Spread] = (20.0, 12.0)
    """Coefficients of once and twice a turn; only the extended model has them."""
    sd_deg: Named = Field(default_factory=dict)
    """Single numbers by name, angles: `alpha2 = 0.01`."""
    sd_mm: Named = Field(default_factory=dict)
    """Single numbers by name, lengths: `"base.x" = 5.0`."""


class IdentificationSettings(Settings):
    """[identification]: what the estimators may move, and how the default one works."""

    free: str | tuple[str, ...] = "identifiable"
    """"identifiable", a free set of the robot, or parameter names."""
    base: Literal["free", "fixed"] = "free"
    tool: Literal["free", "fixed"] = "free"
    estimators: Annotated[tuple[Literal["whitened", "paper"], ...], Field(min_length=1)] = (
        "whitened",
        "paper",
    )
    model: Literal["geometric", "extended", "choose"] = "geometric"
    """Of the default estimator: geometry alone, with sag and harmonics, or what the evidence asks
    for."""
    loss: Literal["squared", "huber", "cauchy"] = "squared"
    """Of the default estimator: how much a shot counts that lies far off."""
    prior: PriorSettings | None = None
    """Of the default estimator. Without this table the geometric model has no prior, and the
    extended one the weak one."""
