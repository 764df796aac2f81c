"""What leaves with a calibration, and what is believed of a program's targets."""

from dataclasses import dataclass
from typing import Annotated

from calib.arrays import LATER, Array, Bool, Labels
from calib.uncertainty.statement.conformity import Conformity

ROBOT, GEOMETRIC = "robot", "robot_geometric"
"""Folders of the identified robot, and of the geometric model beside an extended one."""
NOT_CORRECTED = "not corrected"
"""The place of a target that was left as written."""


@dataclass(frozen=True, slots=True, eq=False)
class TargetStatement:
    """What is believed at m targets of a program, and decided on them."""

    radius_mean: Annotated[Array, "m"]
    """(m,) R95 of the mean of many moves; zero where no region is stated [m]."""
    radius_move: Array
    """(m,) the same of where one move ends; (0,) if nothing tells how well joints come back [m]."""
    transfer: Annotated[Array, "m"]
    """(m,) g: what reaches the target of what the model misses, as against the held-out poses."""
    leverage: Annotated[Array, "m"]
    """(m,) h: the same of the noise."""
    place: Annotated[Labels, "m"]
    """(m,) inside, edge or outside of what was proven; `NOT_CORRECTED` where the program has the
    target as it was."""
    stated: Annotated[Bool, "m"]
    """(m,) whether a radius is stated: the target is corrected, and has a region."""
    decidable: Annotated[Bool, "m"]
    """(m,) whether it has a region: what an uncorrected one misses can be decided on as well."""
    reaches: bool
    """Whether the statement reaches the program as a whole: not too many targets lie outside."""
    why: tuple[str, ...]
    """(m,) what grows or refuses the region; empty where nothing does."""
    before: Conformity | None
    """Decisions on the program as it was, at the targets with a region; None without a tolerance,
    or without such a target."""
    after: Conformity | None
    """The same of the corrected program."""
    names: Annotated[tuple[str, ...], LATER] = ()
    """(m,) what the program calls each target; empty where it has no name."""
    places: Annotated[tuple[str, ...], LATER] = ()
    """(m,) file and line in which each target stands."""
    departed: Annotated[Bool, "m", LATER] | None = None
    """(m,) whether conditions refuse the region: others than those of the measurements, or ones
    that these do not state."""
    relative: Annotated[bool, LATER] = False
    """Whether the radii are of tool points to each other, as no reading shows a frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Delivered:
    """What was written beside the record, in words."""

    robot: tuple[str, ...]
    """How each file of the identified robot was proven."""
    program: tuple[str, ...]
    """What became of each target of the program; empty without one."""
    program_failed: int
    """Targets that could not be corrected."""
    program_conditions: tuple[str, ...] = ()
    """What the conditions of each target of the program are, beside those of the rows."""
    targets: TargetStatement | None = None
    """What is believed there; None without a program, or where nothing is believed."""
    urdf: Annotated[str, LATER] = ""
    """Path, from the folder, of the user's URDF with corrected origins; empty if there is none."""
    mjcf: Annotated[str, LATER] = ""
    """The same of the user's MJCF."""
    root: Annotated[str, LATER] = ""
    """The frame of the user's URDF or MJCF in which poses of programs stand, in words; empty for
    other robots, whose poses stand in the base of robot.toml."""

    @property
    def own_file(self) -> tuple[str, str]:
        """Kind and path of the user's own file with corrected frames; empty if there is none."""
        return ("MJCF", self.mjcf) if self.mjcf else ("URDF" * bool(self.urdf), self.urdf)
