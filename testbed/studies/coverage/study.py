"""Whether the stated uncertainty holds: one record per kind of robot, and the study."""

from dataclasses import dataclass
from typing import Annotated

from calib.arrays import Array, Bool, Index
from testbed.studies.coverage.settings import CoverageSettings
from testbed.studies.kinds import KindsStudy

MODELS = ("geometric", "extended")
"""Order of the first axis of the arrays below."""
STATEMENTS = ("model", "discrepancy", "conformal")
"""Order of the second: region from the parameters' covariance, the same with discrepancy, ball."""


@dataclass(frozen=True, slots=True, eq=False)
class CoverageStudy:
    """R robots of one kind, each calibrated, validated and judged against its noise-free truth."""

    truth: str
    """Preset of the robots."""
    level: float
    """What every statement promises."""
    judged: int
    """Held-out poses that judge each robot."""
    inside: Annotated[Array, 2, 3, "R"]
    """(2, 3, R) share of the held-out points inside what is stated, per model and statement."""
    radius: Annotated[Array, 2, 3, "R"]
    """(2, 3, R) mean radius of the ball with the region's volume [m]."""
    p_value: Annotated[Array, 2, "R"]
    """(2, R) of the residuals of the calibration."""
    held_out_p: Annotated[Array, 2, "R"]
    """(2, R) of the errors at the validation poses."""
    flagged: Annotated[Bool, 2, "R"]
    """(2, R) whether the program itself says that the model-based region is not valid."""
    believed: Annotated[Index, 2, "R"]
    """(2, R) place in `STATEMENTS` of the one the program says to believe; -1 for none."""
    converged: Annotated[Bool, 2, "R"]
    """(2, R) whether the fit ended with its certificate."""
    extended: Annotated[Bool, "R"]
    """(R,) whether the evidence asked for the extended model."""
    log_evidence: Annotated[Array, "R"]
    """(R,) log odds of the extended model."""
    before: Annotated[Array, "R"]
    """(R,) mean held-out error of the nominal model [m]."""
    mean_error: Annotated[Array, 2, "R"]
    """(2, R) mean held-out error against the truth [m]."""
    names: Annotated[tuple[str, ...], "f"]
    """(f,) numbers of the geometric model; none where it cannot hold the truth."""
    normal_error: Annotated[Array, "f", "R"]
    """(f, R) estimate minus truth of these numbers, over its stated standard uncertainty."""
    nees: Array
    """(R,) normalized estimation error squared of these numbers, expected f; else (0,)."""


STUDY = KindsStudy(CoverageSettings, CoverageStudy)
