"""The image of an arm beyond the plane of its tool points, where nothing tells them apart.

Distances from points of unknown place are the same to an arm and to its image, which stand with
these points on the other side. Of an arm that is planar by its nominal links, both are as near to
these: what tilts its axes out of the plane has either sign.
"""

import numpy as np

from calib.arrays import Array
from calib.identification.identify import Identification
from calib.identification.start.closed_forms import plane_normal
from calib.measurement.observations import Measurements
from calib.measurement.tool_target import ToolTarget
from calib.uncertainty.held_out import first_of_pose


def mirror_step(fit: Identification, train: Measurements, target: ToolTarget) -> Array:
    """Step (P,) from the image to the arm identified: twice that from a plane arm [m, rad].

    Of those numbers that move tool points across the plane; zero where these lie in none.
    """
    once, step = first_of_pose(train), np.zeros(fit.model.n_numbers)
    T, J = fit.model.poses_and_jacobian(once.q, once.conditions)
    position, rows = target.positions_and_rows(fit.model, T, J)
    normal = plane_normal(position)
    if normal is None:
        return step
    across = np.einsum("i,mip->mp", normal, rows)
    whole, across = np.square(rows).sum(axis=(0, 1)), np.square(across).sum(axis=0)
    step[fit.parameters.free_index] = fit.step
    # by symmetry, a number of a plane arm moves its points either in the plane or across it
    return np.asarray(np.where(2 * across > whole, 2 * step, 0.0))
