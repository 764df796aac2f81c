"""Figures printed by Wen et al. 2022.

Source: Wen et al., Chinese Journal of Scientific Instrument 43(9), 2022: calibration of a Staubli
TX60 with a laser tracker, optimal against random pose sets. Units as printed: mm and deg.

The tracker is a Leica AT960 with T-MAC, six degrees of freedom (MPE 15 um + 6 um/m); the robot
moves at 62.5 mm/s and waits 4 s. 1000 poses of a box of 900 x 1200 x 800 mm are the pool, 50 the
test; 100 random sets are drawn, and each set is measured 10 times. The paper states that two poses
are enough for 24 parameters, with 12 rows per pose; a pose has only six degrees of freedom.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from calib.arrays import Array

Column = Literal[
    "nominal", "u_r_best", "u_r_random", "u_p_random", "u_w_random", "u_best", "u_random", "ratio"
]
COLUMNS: tuple[Column, ...] = get_args(Column)
"""Columns of Table 3: nominal value; repeatability of the optimal and a random set, number of poses
and their location of random sets; combined uncertainty of the optimal and of random sets; their
ratio."""
PARTS = COLUMNS[1:5]
"""Parts of the combined uncertainties: the first of u_best, the others of u_random."""


@dataclass(frozen=True, slots=True)
class SetErrors:
    """One row of Tables 1 and 2: mean position errors before and after calibration with one set."""

    index: Literal["O1", "O2"]
    """Observability index that fixed the number of poses, and chose the optimal ones."""
    poses: int
    """Poses in the set."""
    optimal: bool
    """Chosen by the index, or else random."""
    before_mm: float
    """Error on its own poses, nominal model [mm]."""
    after_mm: float
    """Error on its own poses, identified model [mm]."""
    held_out_mm: float
    """Error on the 50 test poses, identified model [mm]."""

    def is_like(self, poses: int, designed: bool, index: str) -> bool:
        """Whether a set has this size and was chosen in the same way."""
        chosen = designed == self.optimal and (index == self.index or not designed)
        return chosen and poses == self.poses

    @property
    def kind(self) -> str:
        """Size and choice of the set, as tables name it."""
        return f"{self.poses} {f'optimal ({self.index})' if self.optimal else 'random'}"


ZERO_POSE_MM = (0.0, 20.0, 670.0)
"""Nominal tool point at zero joint angles [mm]."""
POSE_NUMBER = {"O1": 61, "O2": 29}
"""Number of poses at which the mean index of random sets is called stable."""
TABLE3_INDEX = "O2"
"""Index that chose the optimal set of Table 3 and of the tool point, with 29 poses; the random side
has 50 poses and more."""
TABLE3_BEST, TABLE3_RANDOM = "table 3 best", "table 3 random"
"""Names of its two columns of combined uncertainties when propagated to the tool."""
DRAWS = 10_000
"""Number of draws of the Monte Carlo of the tool point."""

SETS = (
    SetErrors("O1", 61, True, 0.545, 0.086, 0.097),
    SetErrors("O1", 61, False, 0.593, 0.069, 0.127),
    SetErrors("O2", 29, True, 0.377, 0.057, 0.098),
    SetErrors("O2", 29, False, 0.587, 0.064, 0.132),
)
"""The rows of Tables 1 and 2."""
TABLE2_BEFORE_MM = 0.459
"""Mean position error of the nominal model on the test poses [mm]."""

U_ZERO_BEST_MM, U_ZERO_RANDOM_MM = 0.0034, 0.031
"""Standard uncertainty of |P| at the zero pose [mm]; Table 3 gives at most 0.0031 for the first."""
X_RANGE_ZERO_BEST_MM = (-0.0508, 0.0437)
"""Smallest and largest x of 10 000 draws at the zero pose, optimal set [mm]; the other five ranges
that the paper prints are not in our sources."""
U_MEAN_BEST_MM, U_MEAN_RANDOM_MM = 0.0069, 0.0649
"""Mean standard uncertainty of |P| over the 50 test points [mm]."""
TOOL_RATIO = 0.106
"""Ratio of these means."""
PARAMETER_RATIO = 0.11
"""Mean of the last column of Table 3, as stated in the text."""


@dataclass(frozen=True, slots=True)
class Misprint:
    """An impossible printed form, and the one used here instead."""

    what: str
    printed: str
    used: str
    """The form used in this program; "as printed" if the printed one is only shown."""
    why: str


MISPRINTS = (
    Misprint(
        "index O1",
        "root 1/m of the product, m poses",
        "root 1/p, p numbers",
        "the geometric mean of p singular values",
    ),
    Misprint(
        "indices O3, O4, O5 against the number of poses",
        "not divided by the root of the number of poses",
        "both: curves as printed, and divided by that root",
        "only per pose do they settle; O1 and O2 have no such drift, and the rule rests on these",
    ),
    Misprint(
        "index O5",
        "sum of reciprocal singular values, maximized",
        "the reciprocal of that sum; curves as printed beside it",
        "the printed sum is largest for the worst set",
    ),
    Misprint(
        "step 4 of DETMAX",
        "candidates 1 to m",
        "candidates 1 to N - m, all poses outside the set",
        "only so can every pose of the pool enter",
    ),
    Misprint(
        "smallest number of poses", "mu >= 2", "mu >= 4", "twelve rows of a pose hold six freedoms"
    ),
    Misprint(
        "distance of the tool point",
        "g = sqrt(Px + Py + Pz)",
        "g = sqrt(Px^2 + Py^2 + Pz^2)",
        "only that is a length, and only that gives the printed figures",
    ),
    Misprint(
        "Table 3, u random of beta2",
        "0.0036 deg",
        "as printed where Table 3 is carried to the tool; 0.0025 deg where it is taken apart",
        "its components add to 0.0025",
    ),
    Misprint(
        "u of |P| at the zero pose, optimal set",
        "0.0034 mm",
        "what Table 3 gives, 0.0030 mm",
        "0.0034 is not within reach of the printed uncertainties",
    ),
    Misprint(
        "four regions of the workspace",
        "not said where they lie",
        "quarters of the box, [budget] location_border_mm",
        "any others can be given",
    ),
)
"""Printed forms that are not used."""

# `COLUMNS` of each parameter; angles (theta, alpha, beta) in deg, lengths (d, a) in mm
TABLE3 = {
    "theta1": (0, 0.0004, 0.0014, 0.001, 0.0032, 0.0004, 0.0036, 0.11),
    "d1": (0, 0.0027, 0.0117, 0.014, 0.0123, 0.0027, 0.022, 0.12),
    "a1": (0, 0.0007, 0.0027, 0.0033, 0.0079, 0.0007, 0.009, 0.08),
    "alpha1": (-90, 0.0006, 0.0009, 0.0009, 0.0013, 0.0006, 0.0018, 0.33),
    "theta2": (-90, 0.0001, 0.0001, 0.0005, 0.0007, 0.0001, 0.0009, 0.11),
    "a2": (290, 0.0006, 0.003, 0.0099, 0.0095, 0.0006, 0.014, 0.04),
    "alpha2": (0, 0.0004, 0.0004, 0.0006, 0.0008, 0.0004, 0.0011, 0.36),
    "beta2": (0, 0.0003, 0.0008, 0.001, 0.0021, 0.0003, 0.0036, 0.08),
    "theta3": (90, 0.0015, 0.0069, 0.0058, 0.0098, 0.0015, 0.0133, 0.11),
    "d3": (20, 0.005, 0.0223, 0.0425, 0.0304, 0.005, 0.0568, 0.09),
    "a3": (0, 0.0078, 0.035, 0.0315, 0.0543, 0.0078, 0.0719, 0.11),
    "alpha3": (90, 0.001, 0.0024, 0.0096, 0.0053, 0.001, 0.0112, 0.09),
    "theta4": (0, 0.0009, 0.0009, 0.0021, 0.0043, 0.0009, 0.0049, 0.18),
    "d4": (310, 0.0009, 0.0055, 0.0091, 0.0111, 0.0009, 0.0154, 0.06),
    "a4": (0, 0.0003, 0.0011, 0.0024, 0.0045, 0.0003, 0.0052, 0.06),
    "alpha4": (-90, 0.0015, 0.005, 0.0057, 0.0079, 0.0015, 0.0109, 0.14),
    "theta5": (0, 0.0002, 0.0019, 0.0026, 0.0059, 0.0002, 0.0067, 0.03),
    "d5": (0, 0.0004, 0.0022, 0.0042, 0.0073, 0.0004, 0.0087, 0.05),
    "a5": (0, 0.0006, 0.0029, 0.0032, 0.006, 0.0006, 0.0074, 0.08),
    "alpha5": (90, 0.0007, 0.0014, 0.0039, 0.0057, 0.0007, 0.007, 0.1),
    "theta6": (0, 0.0005, 0.0031, 0.0049, 0.005, 0.0005, 0.0077, 0.06),
    "d6": (70, 0.0005, 0.0019, 0.0066, 0.0039, 0.0005, 0.0079, 0.06),
    "a6": (0, 0.0018, 0.0062, 0.0119, 0.0065, 0.0018, 0.0149, 0.12),
    "alpha6": (0, 0.0009, 0.0026, 0.0078, 0.0033, 0.0009, 0.0089, 0.1),
}
"""In chain order. Note that u_random of beta2 is printed as 0.0036, but its parts add to 0.0025."""

PARAMETERS = tuple(TABLE3)
"""Names of the paper's 24 parameters, as in `RobotModel.names`."""


def is_length(parameter: str) -> bool:
    """Whether a parameter is a length [mm] or else an angle [deg]."""
    return parameter[:-1] in {"d", "a"}


def printed(column: Column) -> Array:
    """One column of Table 3 (24,) as printed, in the order of `PARAMETERS` [mm or deg]."""
    return np.array([row[COLUMNS.index(column)] for row in TABLE3.values()])


def table3(column: Column) -> Array:
    """One column of Table 3 (24,) in m and rad, in the order of `PARAMETERS`."""
    return printed(column) * [1e-3 if is_length(name) else np.pi / 180 for name in PARAMETERS]
