"""The text that a robot was read from, kept to be handed back with other numbers."""

from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True)
class UrdfText:
    """A URDF as its owner wrote it, and where its arm ends."""

    path: Path
    """The file."""
    data: bytes = field(repr=False)
    """All of it, as it was when the robot was read."""
    tip: str
    """Name of the link at which the arm ends."""
