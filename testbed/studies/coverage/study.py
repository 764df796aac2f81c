"""The study of coverage: one record per kind of robot, and the study itself."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import Array, Bool
from calib.shown import ResultTable, Shown
from testbed.studies.coverage.settings import CoverageSettings
from testbed.studies.kinds import KindsStudy

MODELS = ("geometric", "extended")
"""Order of the first axis of the arrays below."""
STATEMENTS = ("region", "model", "discrepancy", "conformal")
"""Order of the second axis: the believed region, and for comparison that of the parameters alone,
the same with discrepancy, and a ball that needs no model."""
BELIEVED = STATEMENTS[0]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CoverageStudy(Shown):
    """R robots of one kind, each calibrated, validated and judged against its noise-free truth."""

    truth: str
    """Kind of the robots."""
    level: float
    """Probability that every statement promises."""
    judged: int
    """Number of held-out poses that judge each robot."""
    inside: Annotated[Array, 2, 4, "R"]
    """(2, 4, R) share of held-out points inside, per model and statement; for the believed region
    at the poses that have one, or at all if none has."""
    radius: Annotated[Array, 2, 4, "R"]
    """(2, 4, R) mean radius of the ball with the region's volume, at the same poses [m]."""
    p_value: Annotated[Array, 2, "R"]
    """(2, R) p-value of the residuals of the calibration."""
    held_out_p: Annotated[Array, 2, "R"]
    """(2, R) p-value of the errors at the validation poses."""
    flagged: Annotated[Bool, 2, "R"]
    """(2, R) whether a test contradicts the region from the parameters alone."""
    believed: Annotated[Array, 2, "R"]
    """(2, R) share of held-out points with a believed region; elsewhere the statement does not
    apply, or nothing is believed."""
    growth: Annotated[Array, 2, "R"]
    """(2, R) mean factor on the misfit's variance there, which grows away from held-out poses."""
    p_drift: Annotated[Array, 2, "R"]
    """(2, R) p-value of the test for noise with memory."""
    converged: Annotated[Bool, 2, "R"]
    """(2, R) whether the fit converged."""
    extended: Annotated[Bool, "R"]
    """(R,) whether the evidence supports the extended model."""
    log_evidence: Annotated[Array, "R"]
    """(R,) log odds of the extended model."""
    before: Annotated[Array, "R"]
    """(R,) mean held-out error of the nominal model [m]."""
    mean_error: Annotated[Array, 2, "R"]
    """(2, R) mean held-out error against the truth [m]."""
    names: Annotated[tuple[str, ...], "f"]
    """(f,) numbers of the geometric model; none if it cannot match the truth."""
    normal_error: Annotated[Array, "f", "R"]
    """(f, R) estimate minus truth of these numbers, over its stated standard uncertainty."""
    nees: Array
    """(R,) normalized estimation error squared of these numbers, expected f; else (0,)."""

    def tables(self) -> dict[str, ResultTable]:
        """``coverage``: share inside each statement of each model, averaged over robots."""
        cells = [(i, j) for i in range(len(MODELS)) for j in range(len(STATEMENTS))]
        made = [self.made(i, j) for i, j in cells]
        shares = [self.inside[i, j, some] for (i, j), some in zip(cells, made, strict=True)]
        sizes = [self.radius[i, j, some] for (i, j), some in zip(cells, made, strict=True)]
        columns = {
            "truth": self.truth,
            "model": [MODELS[i] for i, _ in cells],
            "statement": [STATEMENTS[j] for _, j in cells],
            "robots": [int(some.sum()) for some in made],
            "inside": [share.mean() for share in shares],
            "sd": [share.std(ddof=1) if share.size > 1 else np.nan for share in shares],
            "radius_um": [1e6 * size.mean() for size in sizes],
        }
        return {"coverage": ResultTable(columns)}

    def made(self, model: int, statement: int) -> Bool:
        """Robots (R,) on which a statement is made somewhere; if on none, all are judged anyway."""
        if STATEMENTS[statement] != BELIEVED or not self.believed[model].any():
            return np.ones(self.before.size, dtype=bool)
        return np.asarray(self.believed[model] > 0)


STUDY = KindsStudy(CoverageSettings, CoverageStudy)
