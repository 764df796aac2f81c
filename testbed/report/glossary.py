"""Words of every report that states a tool point, explained once."""

from testbed.report.page import Points, Section

GLOSSARY = (
    "u: standard uncertainty, k = 1; of a point the root of the summed variances along x, y, z.",
    "U = 2 u: contains one number with 95.4 % probability; a ball of radius 2 u contains a point "
    "with at least that.",
    "R95: radius about the predicted point that contains the true one with 95 % probability, at "
    "poses like the held-out ones.",
    "Region: the ellipsoid that does so at one pose, with k = 2.80 (2-D 2.45, 1-D 1.96).",
    "Held-out pose: a pose from which nothing was identified.",
    "Guard: 19 or more held-out poses, whose errors may raise k.",
    "Misfit: error of the robot that the model cannot describe, per axis; the region includes it "
    "up to a limit.",
    "Mean of many moves: average position over repeated moves to one pose.",
    "Transfer g: how much of the misfit reaches a target; the region grows with g, and none is "
    "stated above 9.",
)


def glossary_section() -> Section:
    """The words, folded at the end of a report."""
    return Section("words", "Words used", (Points(GLOSSARY),), part="record")
