"""On which side of a plane anchors stand, where nominal tool points stay in it.

Distances to a planar arm are the same from an anchor and from its image beyond the plane: nominal
links tell them apart in nothing. True axes are tilted by hundredths of a degree, and so is the
plane: on the wrong side, links make up for it, by as much as their tolerance allows.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.prior import weak_prior
from calib.identification.start.closed_forms import beyond
from calib.identification.start.ranging import TOGETHER, on_all_sides
from calib.information.sizes import FRAMES
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predicted_positions
from calib.measurement.residual import linearize

WIDE = 100.0
"""Times the usual width that frames may lie from where nominal links have them."""
SURE = 10.0
"""Fall of chi-square from which another side is taken: odds of a hundred to one."""


def on_their_sides(
    model: RobotModel, measurements: Measurements, names: Collection[str]
) -> RobotModel:
    """The model with each free anchor on the side that links near nominal explain best.

    Parameters
    ----------
    model : RobotModel
        Nominal links, with frames fitted to the measurements.
    measurements : Measurements
        Covariances count here.
    names : collection of str
        Names of the numbers of base, tool and fixtures that were fitted; others are held.

    References
    ----------
    Chi-square of one Gauss-Newton step of links and frames under the weak prior: what is linear of
    some tenths of a millimeter over meters.
    """
    images = {
        k: image
        for k in np.unique(measurements.anchor[measurements.is_distance]).tolist()
        if f"anchor{k + 1}.x" in names and (image := _image(model, measurements, k)) is not None
    }
    numbers, among = [*images], ~np.isin(measurements.anchor, [*images])
    for first in (0, *range(TOGETHER, len(numbers))):
        some = numbers[first : TOGETHER if not first else first + 1]
        among |= np.isin(measurements.anchor, some) & measurements.is_distance
        rows = measurements.rows(among)
        sides = [
            replace(model, fixtures=replace(model.fixtures, anchors=anchors))
            for anchors in on_all_sides(model.fixtures.anchors, {k: images[k] for k in some})
        ]
        left = [_left(one, rows, names) for one in sides]
        if min(left) < left[0] - SURE:  # the first is the model as it is
            model = sides[int(np.argmin(left))]
    return model


def _image(model: RobotModel, measurements: Measurements, k: int) -> Array | None:
    """Anchor k (3,) beyond the plane in which its tool points lie [m]; None where in none."""
    rows = measurements.rows(measurements.is_distance & (measurements.anchor == k))
    return beyond(predicted_positions(model, rows), model.fixtures.anchors[k])


def _left(model: RobotModel, rows: Measurements, names: Collection[str]) -> float:
    """Chi-square that the best links and frames near the model leave."""
    links = model.names[6 : model.chain.n_numbers - 6]
    parameters = parameters_of(model, [*links, *names])
    sd = weak_prior(parameters, model).sd
    frame = [name.startswith(FRAMES) for name in parameters.free_names]
    stack, near = linearize(model, rows), np.diag(1 / (sd * np.where(frame, WIDE, 1.0)))
    A = np.concatenate([stack.A[:, parameters.free_index], near])
    r = np.concatenate([stack.r, np.zeros(len(sd))])
    step = np.linalg.lstsq(A, r, rcond=None)[0]
    return float(np.square(r - A @ step).sum())
