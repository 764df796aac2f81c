"""How many held-out poses a statement asks for."""

from math import ceil

from calib.arrays import require_probability

FEWEST = 10
"""Below them no covariance of what the model leaves out (3 x 3) is stated."""


def fewest_poses(probability: float = 0.95) -> int:
    """Smallest n for which the k-th smallest of n errors exists: 19 for 95 %."""
    require_probability(probability, "C41")
    return ceil(probability / (1 - probability) - 1e-9)
