"""The proof of a calibration on held-out rows, and what no single number says of it."""

import numpy as np

from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification, Status
from calib.identification.result import ILL_CONDITIONED
from calib.measurement.observations import Measurements
from calib.uncertainty.judgement import Judgement, judge
from testbed.identify.records import FittedModel
from testbed.streams import stream
from testbed.units import in_units, significant, unit_of

REPLICATES = 400
"""Virtual calibrations that check whether linear propagation holds; 4 % in each deviation."""
MOST_ROWS = 300
"""Larger tables are not replicated: their linear intervals are tight enough to be linear."""


def proof_of(
    result: Identification, train: Measurements, test: Measurements, *, seed: int
) -> Judgement:
    """Judge the identification that is handed out by held-out rows (also by none)."""
    small = len(train) <= MOST_ROWS
    rng = stream(seed, "bootstrap") if small else None
    return judge(result, test, train=train, rng=rng, replicates=REPLICATES)


LEAST_TURN, LEAST_SLIDE = np.radians(10.0), 0.010
"""Range of a joint at the training poses below which it counts as not moved [rad, m]."""


def warnings_of(
    geometric: FittedModel, chosen: FittedModel, train: Measurements
) -> tuple[str, ...]:
    """Sentences on the poses, by the geometric fit, and on the fit that was chosen."""
    result = chosen.identification
    texts = [*_still(geometric, train), *_condition(geometric)]
    if result.status is not Status.CONVERGED:
        texts.append(f"the fit {result.status.value}")
    if result.p_value > 1 - RED:
        texts.append(
            "the residuals are smaller than the stated noise: the stated uncertainty is too large"
        )
    return tuple(texts)


def _still(fit: FittedModel, train: Measurements) -> tuple[str, ...]:
    """Which joints were hardly moved: nothing was learnt of them, and nothing tests it."""
    kinds = np.array(fit.identification.model.chain.kinds)
    least = np.where(kinds == "revolute", LEAST_TURN, LEAST_SLIDE)
    still = np.flatnonzero(np.ptp(train.q, axis=0) < least) + 1
    if not len(still):
        return ()
    many = len(still) > 1
    return (
        f"joint{'s' * many} {', '.join(map(str, still))} moved by less than "
        f"{np.degrees(LEAST_TURN):.0f} deg or {1e3 * LEAST_SLIDE:.0f} mm: nothing here says how "
        f"well the result holds where {'they stand' if many else 'it stands'} otherwise",
    )


def _condition(fit: FittedModel) -> tuple[str, ...]:
    """Whether the poses are too much alike, and which number suffers most."""
    result = fit.identification
    if result.reduction.condition <= ILL_CONDITIONED:
        return ()
    lengths = result.parameters.is_length[result.parameters.free_index]
    u = result.standard_uncertainty
    worst = result.least_known
    value = float(in_units(u, lengths)[worst])
    return (
        f"the poses are much alike: condition {significant(result.reduction.condition, 2)}; least "
        f"known is {result.names[worst]}, U = {significant(2 * value, 2)} "
        f"{unit_of(bool(lengths[worst]))} from the stated noise; vary the wrist and the tool's "
        "orientation more",
    )
