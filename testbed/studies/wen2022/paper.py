"""What Wen et al. 2022 print, and the 17 claims of theirs that are examined.

Source: Wen et al., Chinese Journal of Scientific Instrument 43(9), 2022: calibration of a Staubli
TX60 with a laser tracker, optimal against random pose sets. Units as printed: mm and deg.

The tracker is a Leica AT960 with T-MAC, six degrees of freedom (MPE 15 um + 6 um/m); the robot
moves at 62.5 mm/s and waits 4 s. 1000 poses of a box of 900 x 1200 x 800 mm are the pool, 50 the
test; 100 random sets are drawn, and each set is measured 10 times. Two poses are called enough for
24 parameters, over 12 rows per pose; a pose holds six freedoms.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array, frozen

Column = Literal[
    "u_r_best", "u_r_random", "u_p_random", "u_w_random", "u_best", "u_random", "ratio"
]
PARTS: tuple[Column, ...] = ("u_r_best", "u_r_random", "u_p_random", "u_w_random")
"""Of the combined uncertainties: the first of u_best, the others of u_random."""


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """One row of Table 3; angles (theta, alpha, beta) in deg, lengths (d, a) in mm."""

    name: str
    """Parameter, named as in `RobotModel.names`."""
    nominal: float
    """Nominal value [deg or mm]."""
    u_r_best: float
    """Repeatability, optimal set [deg or mm]."""
    u_r_random: float
    """Repeatability, random set [deg or mm]."""
    u_p_random: float
    """Number of poses, random sets [deg or mm]."""
    u_w_random: float
    """Location of the poses, random sets [deg or mm]."""
    u_best: float
    """Combined, optimal set [deg or mm]."""
    u_random: float
    """Combined, random sets [deg or mm]."""
    ratio: float
    """u_best / u_random."""

    @property
    def is_length(self) -> bool:
        """Length [mm] or else angle [deg]."""
        return self.name[:-1] in {"d", "a"}


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
    """On its own poses, nominal model [mm]."""
    after_mm: float
    """On its own poses, identified model [mm]."""
    held_out_mm: float
    """On the 50 test poses, identified model [mm]."""

    @property
    def kind(self) -> str:
        """Size and choice of the set, as tables name it."""
        return f"{self.poses} {f'optimal ({self.index})' if self.optimal else 'random'}"


ZERO_POSE_MM = (0.0, 20.0, 670.0)
"""Nominal tool point at zero joint angles [mm]."""
POSE_NUMBER = {"O1": 61, "O2": 29}
"""Number of poses at which the mean index of random sets is called stable."""
DRAWS = 10_000
"""Of the Monte Carlo of the tool point."""

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
"""Smallest and largest x of 10 000 draws at the zero pose, optimal set [mm]."""
U_MEAN_BEST_MM, U_MEAN_RANDOM_MM = 0.0069, 0.0649
"""Mean standard uncertainty of |P| over the 50 test points [mm]."""
TOOL_RATIO = 0.106
"""Ratio of these means."""
PARAMETER_RATIO = 0.11
"""Mean of the last column of Table 3, as stated in the text."""

# name, nominal, u_r best, u_r random, u_p, u_w, u best, u random, ratio; deg and mm
TABLE3 = (
    ParameterRow("theta1", 0, 0.0004, 0.0014, 0.001, 0.0032, 0.0004, 0.0036, 0.11),
    ParameterRow("d1", 0, 0.0027, 0.0117, 0.014, 0.0123, 0.0027, 0.022, 0.12),
    ParameterRow("a1", 0, 0.0007, 0.0027, 0.0033, 0.0079, 0.0007, 0.009, 0.08),
    ParameterRow("alpha1", -90, 0.0006, 0.0009, 0.0009, 0.0013, 0.0006, 0.0018, 0.33),
    ParameterRow("theta2", -90, 0.0001, 0.0001, 0.0005, 0.0007, 0.0001, 0.0009, 0.11),
    ParameterRow("a2", 290, 0.0006, 0.003, 0.0099, 0.0095, 0.0006, 0.014, 0.04),
    ParameterRow("alpha2", 0, 0.0004, 0.0004, 0.0006, 0.0008, 0.0004, 0.0011, 0.36),
    ParameterRow("beta2", 0, 0.0003, 0.0008, 0.001, 0.0021, 0.0003, 0.0036, 0.08),
    ParameterRow("theta3", 90, 0.0015, 0.0069, 0.0058, 0.0098, 0.0015, 0.0133, 0.11),
    ParameterRow("d3", 20, 0.005, 0.0223, 0.0425, 0.0304, 0.005, 0.0568, 0.09),
    ParameterRow("a3", 0, 0.0078, 0.035, 0.0315, 0.0543, 0.0078, 0.0719, 0.11),
    ParameterRow("alpha3", 90, 0.001, 0.0024, 0.0096, 0.0053, 0.001, 0.0112, 0.09),
    ParameterRow("theta4", 0, 0.0009, 0.0009, 0.0021, 0.0043, 0.0009, 0.0049, 0.18),
    ParameterRow("d4", 310, 0.0009, 0.0055, 0.0091, 0.0111, 0.0009, 0.0154, 0.06),
    ParameterRow("a4", 0, 0.0003, 0.0011, 0.0024, 0.0045, 0.0003, 0.0052, 0.06),
    ParameterRow("alpha4", -90, 0.0015, 0.005, 0.0057, 0.0079, 0.0015, 0.0109, 0.14),
    ParameterRow("theta5", 0, 0.0002, 0.0019, 0.0026, 0.0059, 0.0002, 0.0067, 0.03),
    ParameterRow("d5", 0, 0.0004, 0.0022, 0.0042, 0.0073, 0.0004, 0.0087, 0.05),
    ParameterRow("a5", 0, 0.0006, 0.0029, 0.0032, 0.006, 0.0006, 0.0074, 0.08),
    ParameterRow("alpha5", 90, 0.0007, 0.0014, 0.0039, 0.0057, 0.0007, 0.007, 0.1),
    ParameterRow("theta6", 0, 0.0005, 0.0031, 0.0049, 0.005, 0.0005, 0.0077, 0.06),
    ParameterRow("d6", 70, 0.0005, 0.0019, 0.0066, 0.0039, 0.0005, 0.0079, 0.06),
    ParameterRow("a6", 0, 0.0018, 0.0062, 0.0119, 0.0065, 0.0018, 0.0149, 0.12),
    ParameterRow("alpha6", 0, 0.0009, 0.0026, 0.0078, 0.0033, 0.0009, 0.0089, 0.1),
)
"""In chain order. Trap: u_random of beta2 is printed 0.0036, its own components add to 0.0025."""

PARAMETERS = tuple(row.name for row in TABLE3)
"""Names of the paper's 24 parameters."""


def table3(column: Column) -> Array:
    """One column of Table 3 (24,) in m and rad, in the order of `PARAMETERS`; ratio as printed."""
    values = np.array([getattr(row, column) for row in TABLE3])
    if column == "ratio":
        return frozen(values)
    return frozen(values * [1e-3 if row.is_length else np.pi / 180 for row in TABLE3])


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the paper."""

    number: int
    """Number in the report."""
    statement: str
    """The claim in one sentence."""
    printed: str
    """What the paper prints."""


CLAIMS = (
    Claim(1, "With all joints at zero the nominal tool point is known exactly.", "(0, 20, 670) mm"),
    Claim(
        2,
        "At the zero pose the tool uncertainty of the optimal set is a tenth of the random one.",
        "u 0.0034 mm best, 0.031 mm random",
    ),
    Claim(
        3,
        "The drawn tool positions at the zero pose stay within these ranges.",
        "x -0.0508 to 0.0437 mm (best)",
    ),
    Claim(
        4,
        "Over 50 points the mean tool uncertainty tells the optimal from the random set.",
        "u 0.0069 mm best, 0.0649 mm random",
    ),
    Claim(5, "Optimal poses cut the tool uncertainty to a tenth.", "ratio 0.106"),
    Claim(
        6,
        "The combined parameter uncertainties of Table 3 are root sums of squares.",
        "24 rows, seven columns",
    ),
    Claim(7, "The tool uncertainty is that of g = sqrt(Px + Py + Pz).", "g = sqrt(Px + Py + Pz)"),
    Claim(
        8,
        "Singular values of the identification Jacobian leave 24 identifiable parameters.",
        "24 parameters",
    ),
    Claim(
        9,
        "Two poses suffice in principle; the index settles at 61 (O1) and 29 (O2) poses.",
        "mu >= 2; m = 61 and 29",
    ),
    Claim(
        10,
        "The indices O3, O4 and O5 do not settle with the number of poses.",
        "figure of O1 to O5 against the number of poses",
    ),
    Claim(
        11,
        "O5, the sum of reciprocal singular values, is to be maximized.",
        "O5 = sum of 1 / sigma",
    ),
    Claim(
        12,
        "Calibration reduces the mean error on the calibration poses.",
        "Table 1: 0.545 to 0.086, 0.593 to 0.069, 0.377 to 0.057, 0.587 to 0.064 mm",
    ),
    Claim(
        13,
        "On the test poses optimal sets are a quarter more accurate than random ones.",
        "Table 2: 0.459 mm before; 0.097, 0.127, 0.098, 0.132 mm after",
    ),
    Claim(14, "Optimal poses cut the parameter uncertainties to a ninth.", "mean ratio 0.11"),
    Claim(15, "Optimal poses reduce the uncertainty of the calibrated robot.", "ratio 0.11"),
    Claim(
        16,
        "The stated tool uncertainty of the optimal set is the uncertainty of the robot.",
        "u 0.0069 mm",
    ),
    Claim(
        17,
        "The model is too nonlinear for linear propagation, so Monte Carlo is needed.",
        "Monte Carlo with M = 10 000",
    ),
)
"""What the paper says, in the order of the report."""
