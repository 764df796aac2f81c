"""A: the mean variance of the parameters themselves, in scaled columns."""

from dataclasses import dataclass
from typing import ClassVar

from calib.information.criteria.linear import Linear


@dataclass(frozen=True, slots=True, eq=False)
class A(Linear):
    """Value -tr M^-1; figure sqrt(tr M^-1), the standard uncertainty of all parameters together."""

    name: str = "A"

    unit: ClassVar[str] = "m"
    meaning: ClassVar[str] = "root summed variance of the scaled parameters"
