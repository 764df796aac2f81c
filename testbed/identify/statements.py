"""Every statement on the tool point at a new pose, as one radius: what it promises, and its use."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, FloatOrNan, frozen
from calib.identification.identify import Identification
from calib.shown import length_words
from calib.uncertainty.regions import coverage_factor
from calib.uncertainty.statement.gain import of_all_numbers
from calib.uncertainty.statement.stated_point import common_radius
from calib.uncertainty.tool_point import ToolStatement, tool_statement
from testbed.identify.calibration import Calibration
from testbed.identify.shared import states_instrument
from testbed.units import counted, probability

BELIEVED, NOT_NEEDED = "believed", "not needed"
UNSETTLED = "not before what the verdict names is settled"


@dataclass(frozen=True, slots=True)
class StatedRadius:
    """One of them."""

    key: str
    """In result.json."""
    name: str
    """For people."""
    radius: FloatOrNan
    """Of a ball about the predicted point [m]."""
    promise: str
    """What it holds, and with which probability."""
    use: str
    """Whether it is believed, or why not."""


def statements_of(calibration: Calibration) -> tuple[StatedRadius, ...]:
    """The believed region of the mean and of one move first, then what it is compared with."""
    proof = calibration.proof
    other = NOT_NEEDED if proof.belief is not None else "no region is believed"
    return (*_believed(calibration), *_compared(calibration, other))


def _believed(calibration: Calibration) -> list[StatedRadius]:
    """The region; of one move where something tells how well joints come back."""
    point, belief = calibration.proof.point, calibration.proof.belief
    if point is None or belief is None:
        return []
    held = f"{100 * point.probability:g} %"
    misfit = length_words(belief.misfit.upper, point.radius_mean, um=".1f")
    within = f"{held} of true mean points; includes noise and a misfit of up to {misfit} per axis"
    drifting = calibration.proof.drifting
    between = calibration.repeats_drift is not None
    if between or (drifting is not None and drifting.covariance is not None):
        within += ", a drift"
    stated = states_instrument(calibration.shared)
    within += ", and systematic errors" if stated else ", but no systematic errors"
    whole = "stand in no frame that is shown" if calibration.unshown else "are off as a whole"
    if calibration.source.exact:
        whole = "were computed, not measured"
    use = BELIEVED
    if not calibration.believable:
        use = f"believed, but not tested: held-out poses {whole}"
    elif not calibration.settled:
        use = UNSETTLED
    found = [StatedRadius("region_mean", "believed region: mean of many moves", point.radius_mean,
                       within, use)]  # fmt: skip
    if np.isfinite(point.radius_move):
        what = f"{held} of the ends of single moves; includes the same and joint repeatability"
        name = "believed region: where one move ends"
        found.append(StatedRadius("region_move", name, point.radius_move, what, use))
    return found


def _compared(calibration: Calibration, other: str) -> list[StatedRadius]:
    """What stands beside the region, and is contained in it or needs other assumptions."""
    proof, result = calibration.proof, calibration.fit.identification
    found = []
    if result.mode == "whitened":
        refuted = calibration.refuted and not calibration.not_linear
        why = "refuted by a test" if refuted else other
        if refuted and proof.held_out is not None:
            why += f" (held-out p {probability(proof.held_out.p_value)})"
        radius = common_radius(_by_numbers(calibration, result.full_covariance))
        what = "95 % if the model and the stated noise are exactly right"
        found.append(StatedRadius("parameters", "parameters alone", radius, what, why))
    if proof.bootstrap is not None:
        why = other if proof.bootstrap.agrees else "included in the region"
        why = why if proof.bootstrap.settled else "did not converge"
        covariance = of_all_numbers(result, proof.bootstrap.empirical)
        radius = common_radius(_by_numbers(calibration, covariance))
        what = f"the same, from {counted(proof.bootstrap.replicates, 'virtual calibration')}"
        found.append(StatedRadius("bootstrap", "virtual calibrations", radius, what, why))
    if proof.discrepancy is not None:
        wide = _by_numbers(calibration, result.full_covariance, discrepancy=True)
        what = "about 95 %, as if model errors were drawn anew at each pose"
        name = "parameters and discrepancy"
        found.append(StatedRadius("discrepancy", name, common_radius(wide), what, other))
    if proof.conformal is not None:
        low, high = proof.conformal.content_range()
        what = (
            f"{100 * proof.conformal.probability:g} % of measured points with their noise; needs "
            f"no model (this one: {100 * low:.0f} to {100 * high:.0f} %, with 95 % confidence)"
        )
        why = other if proof.belief is not None else "all that is left"
        found.append(
            StatedRadius("conformal", "held-out radius (split conformal)", proof.conformal.radius,
                      what, why)
        )  # fmt: skip
    return found


def _by_numbers(
    calibration: Calibration, covariance: Array, *, discrepancy: bool = False
) -> ToolStatement:
    """The tool point at the stated poses from the covariance of all numbers; in the same frame."""
    result: Identification = calibration.fit.identification
    belief = calibration.proof.belief
    if belief is not None and belief.datum is not None and not discrepancy:
        alone = replace(
            belief, covariance=frozen(covariance), misfit=replace(belief.misfit, upper=0.0),
            factor=coverage_factor(3, belief.probability),
        )  # fmt: skip
        return alone.regions(calibration.stated_q, target=calibration.target)
    return tool_statement(
        result.model, calibration.stated_q, covariance,
        discrepancy=calibration.proof.discrepancy if discrepancy else None,
        target=calibration.target,
    )  # fmt: skip
