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


@dataclass(frozen=True, slots=True)
class MjcfText:
    """An MJCF as its owner wrote it, and where its arm ends."""

    path: Path
    """The file."""
    data: bytes = field(repr=False)
    """All of it, as it was when the robot was read, without the files that it includes."""
    tip: str
    """Name of the body or site at which the arm ends."""
    folder: Path
    """What holds all files that it names."""


OwnText = UrdfText | MjcfText
"""A description of somebody else."""
