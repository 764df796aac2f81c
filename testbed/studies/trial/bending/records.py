"""What a true arm that moves does on its ways, as it is kept; all of it is the truth's."""

from dataclasses import dataclass
from typing import Annotated

from calib.arrays import Array, Index


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """Loops of hysteresis, what still swings after a stop, and two ways to one pose as a film."""

    loop_command: Annotated[Array, "a", "n"]
    """(a, n) motors beside a held-out pose, slowly down and up again [rad]."""
    loop_turn: Annotated[Array, "a", "n"]
    """(a, n) how far each link turns beside where it would rest, meanwhile [rad]."""
    loop_tool: Annotated[Array, "a"]
    """(a,) the same of the tool, along the line between its two ways [m]."""
    loop_width: Annotated[Array, "n"]
    """(n,) of each joint's loop, at the pose [rad]."""
    tool_width: float
    """Of the tool's loop [m]."""
    dwell: Annotated[Array, "d"]
    """(d,) after the motors stopped, as in the campaign [s]."""
    away: Annotated[Array, "d", "w"]
    """(d, w) distance of the tool from where it comes to rest, on w approaches [m]."""
    seen: Annotated[Array, "w"]
    """(w,) the same when the tracker looks [m]."""
    apart: Annotated[Array, "v"]
    """(v,) how far the tool is then from where it is if it came from the other side [m]."""
    film_q: Annotated[Array, "f", "n"]
    """(f, n) motors on two ways to one pose, to their stop and beyond [rad]."""
    film_bends: Annotated[Array, "f", "n", 3]
    """(f, n, 3) bends about x, y, z of every joint beside those at rest [rad]."""
    film_away: Annotated[Array, "f"]
    """(f,) distance of the tool from where it would be at rest [m]."""
    film_starts: Annotated[Index, 2]
    """(2,) where the two ways begin."""
    film_step: float
    """From one row of the film to the next [s]."""
