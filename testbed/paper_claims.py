"""The 17 claims of Wen et al. 2022 that are examined: what is said, printed, and compared."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the paper, and what is put beside it."""

    number: int
    """Number in the report."""
    statement: str
    """The claim in one sentence."""
    printed: str
    """What the paper prints."""
    compared: str
    """What is computed here to compare with."""


CLAIMS = (
    Claim(
        1,
        "With all joints at zero the nominal tool point is known exactly.",
        "(0, 20, 670) mm",
        "nominal forward kinematics",
    ),
    Claim(
        2,
        "At the zero pose the tool uncertainty of the optimal set is a tenth of the random one.",
        "u 0.0034 mm best, 0.031 mm random",
        "Monte Carlo of |P| from Table 3 with independent parameters, and the 3-D figure beside it",
    ),
    Claim(
        3,
        "The drawn tool positions at the zero pose stay within these ranges.",
        "x -0.0508 to 0.0437 mm (best)",
        "range of 10 000 draws, which for normal draws is about 3.85 standard deviations each way",
    ),
    Claim(
        4,
        "Over 50 points the mean tool uncertainty tells the optimal from the random set.",
        "u 0.0069 mm best, 0.0649 mm random",
        "the same Monte Carlo, averaged over the held-out poses",
    ),
    Claim(
        5,
        "Optimal poses cut the tool uncertainty to a tenth.",
        "ratio 0.106",
        "ratio of the two means of claim 4, of |P| and of the 3-D figure",
    ),
    Claim(
        6,
        "The combined parameter uncertainties of Table 3 are root sums of squares.",
        "24 rows, seven columns",
        "root sum of squares and ratio of each printed row",
    ),
    Claim(
        7,
        "The tool uncertainty is that of g = sqrt(Px + Py + Pz).",
        "g = sqrt(Px + Py + Pz)",
        "g as printed and g = |P|: only the second gives the printed figures",
    ),
    Claim(
        8,
        "Singular values of the identification Jacobian leave 24 identifiable parameters.",
        "24 parameters",
        "rank of the 30 link columns, and the parameter that was dropped though identifiable",
    ),
    Claim(
        9,
        "Two poses suffice in principle; the index settles at 61 (O1) and 29 (O2) poses.",
        "mu >= 2; m = 61 and 29",
        "smallest number of poses of full rank, and the pose-number rule on this campaign's pool",
    ),
    Claim(
        10,
        "The indices O3, O4 and O5 do not settle with the number of poses.",
        "figure of O1 to O5 against the number of poses",
        "the same curves divided by the root of the number of poses",
    ),
    Claim(
        11,
        "O5, the sum of reciprocal singular values, is to be maximized.",
        "O5 = sum of 1 / sigma",
        "its reciprocal, which is large for good sets",
    ),
    Claim(
        12,
        "Calibration reduces the mean error on the calibration poses.",
        "Table 1: 0.545 to 0.086, 0.593 to 0.069, 0.377 to 0.057, 0.587 to 0.064 mm",
        "mean position error on the calibration poses, before and after, paper mode",
    ),
    Claim(
        13,
        "On the test poses optimal sets are a quarter more accurate than random ones.",
        "Table 2: 0.459 mm before; 0.097, 0.127, 0.098, 0.132 mm after",
        "mean position error on the held-out poses, before and after, paper mode",
    ),
    Claim(
        14,
        "Optimal poses cut the parameter uncertainties to a ninth.",
        "mean ratio 0.11",
        "the same protocol, and its two parts: repeats alone, and what only the random side counts",
    ),
    Claim(
        15,
        "Optimal poses reduce the uncertainty of the calibrated robot.",
        "ratio 0.11",
        "like for like: standard uncertainty of optimal against random sets of the same size",
    ),
    Claim(
        16,
        "The stated tool uncertainty of the optimal set is the uncertainty of the robot.",
        "u 0.0069 mm",
        "share of held-out poses whose true error lies inside the stated 95 % region",
    ),
    Claim(
        17,
        "The model is too nonlinear for linear propagation, so Monte Carlo is needed.",
        "Monte Carlo with M = 10 000",
        "largest difference between Monte Carlo and linear propagation on the same draws",
    ),
)
"""What the paper says, in the order of the report."""
