"""V: the mean variance of the tool point over the poses that matter."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from calib.information.criteria.linear import Linear
from calib.information.goals import Goals


@dataclass(frozen=True, slots=True, eq=False)
class V(Linear):
    """Value -tr(C M^-1), C the mean of J_t'J_t over goal poses; figure the RMS tool-point u [m]."""

    name: str = "V"

    unit: ClassVar[str] = "m"
    meaning: ClassVar[str] = "standard uncertainty of the tool point, RMS over the goal poses"


def v_of(goals: Goals, name: str = "V") -> V:
    """V for a goal."""
    # C = F F' with as many columns as directions matter
    w, U = np.linalg.eigh(goals.mean)
    kept = w > len(w) * np.finfo(np.float64).eps * w[-1]
    root = U[:, kept] * np.sqrt(w[kept])
    root.setflags(write=False)
    return V(name=name, root=root)
