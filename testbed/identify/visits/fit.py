"""A fit with the frames of held-out visits among its numbers, and its errors at every row."""

from dataclasses import replace

from calib.arrays import Bool
from calib.measurement.observations import Measurements
from testbed.identify.errors import figures_of, row_errors
from testbed.identify.records import FittedModel, HeldOutSplit
from testbed.identify.visits.frames import OwnFrames


def with_own_frames(
    fit: FittedModel, own: OwnFrames, measurements: Measurements, used: Bool, split: HeldOutSplit
) -> FittedModel:
    """The fit with these frames fitted to their poses, all else held; errors told anew."""
    identification, scatter = own.of_fit(fit)
    errors = row_errors(identification.model, measurements)
    return replace(
        fit,
        identification=identification,
        scatter=scatter,
        misses=errors,
        train=figures_of(errors, measurements, used),
        test=figures_of(errors, measurements, split.is_test) if split.is_test.any() else None,
    )
