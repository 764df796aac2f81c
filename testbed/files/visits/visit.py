"""What is kept of one visit of several: whose base and tool it has, and how it was measured."""

from dataclasses import dataclass

OWN = "own"


@dataclass(frozen=True, slots=True)
class RobotVisit:
    """One [[session]]: a measuring session of a robot that was measured in others, too."""

    name: str
    base: str
    """"own", or the name of the session whose station and base it has."""
    tool: str
    """"own", or the name of the session whose tool it has."""
    held_out: bool
    """Whether its rows judge: no link number is identified from them."""
    station: int
    """Number of its first station; 0 is the world."""
    mounted: int
    """Number of its tool; 0 is that of the robot."""
    numbers: tuple[str, ...]
    """Names of the numbers that no other session has: its frames and reflectors."""
    frame_poses: int
    """Poses that its own frames are fitted to, where it is held out."""
    uncertainty: str
    """Where its covariances come from."""
    conditions: str
    """Payload, tool and temperature in words; empty if nobody stated them."""
    date: str
    """ISO day; empty if nobody stated it."""
