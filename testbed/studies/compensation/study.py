"""The study of the closed loop, ISO 9283 before and after, with one record per kind of robot."""

from dataclasses import dataclass
from typing import Annotated

from calib.arrays import Array, Bool, Index, Labels
from calib.shown import Shown
from testbed.studies.compensation.settings import CompensationSettings
from testbed.studies.kinds import KindsStudy

VARIANTS = ("before", "geometric", "chosen")
"""Order of the first axis of the arrays below: the program as it was, corrected by the geometric
model, corrected by the model that the evidence chooses (the same one on many robots)."""
FIGURES = ("AP", "RP", "AP angle")
"""Figures of a pose, in the order of their axis; the first two in m, the third in rad."""
WORTH = ("value", "uncertainty", "floor")
"""Entries of every figure: its value, standard uncertainty, noise floor."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CompensationStudy(Shown):
    """R robots of one kind: an ISO 9283 test before and after the targets were corrected."""

    truth: str
    """Preset of the robots."""
    trial: str
    """Trial whose poses calibrated them."""
    poses: int
    """Number of these poses."""
    cycles: int
    """Visits of each of the five poses."""
    T: Annotated[Array, 5, 4, 4]
    """(5, 4, 4) commanded poses, world [m]."""
    q: Annotated[Array, 5, "n"]
    """(5, n) nominal joint targets [rad, m]."""
    figures: Annotated[Array, 3, 3, 3, "R", 5]
    """(3, 3, 3, R, 5) variant, figure, worth, robot, pose [m or rad]."""
    distances: Annotated[Array, 3, 2, 3, "R"]
    """(3, 2, 3, R) variant, AD and RD, worth, robot [m]; of the way from pose 2 to pose 4."""
    true: Annotated[Array, 3, "R", 5]
    """(3, R, 5) truth: distance of the noise-free tool from the command [m]."""
    held_out: Annotated[Array, 3, 2, "R"]
    """(3, 2, R) mean and 95th percentile of the true held-out errors of the model: nominal,
    geometric, chosen [m]."""
    extended: Annotated[Bool, "R"]
    """(R,) whether the evidence supports the extended model."""
    corrected: Annotated[Bool, 3, "R", 5]
    """(3, R, 5) whether a target was corrected without reservation; True before."""
    reach: Annotated[Array, 2, "R", 5]
    """(2, R, 5) transfer and leverage of the chosen model at the corrected targets: errors there
    from terms that it lacks, and from noise, relative to those at the held-out poses."""
    place: Annotated[Labels, "R", 5]
    """(R, 5) "inside", "edge" or "outside" of where a statement of the chosen model applies."""
    step: Annotated[Array, 3, "R"]
    """(3, R) largest joint correction [rad, or m]."""
    targets: Annotated[Array, 3, "R", 5, "n"]
    """(3, R, 5, n) joint targets that were executed [rad, m]."""
    readings: Annotated[Array, 3, 5, "c", 3]
    """(3, 5, c, 3) of the first robot: read positions minus commanded ones [m]."""
    pose_id: Annotated[Index, 5]
    """(5,) numbers of the poses in the standard, from 1."""


STUDY = KindsStudy(CompensationSettings, CompensationStudy)
