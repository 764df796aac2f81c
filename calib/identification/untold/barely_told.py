"""Numbers of links that readings barely tell, and the weak prior that holds them."""

import numpy as np

from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.prior import Prior, weak_prior
from calib.identification.result import Identification
from calib.information.rank import KEEP_TOLERANCE


def barely_told(found: Identification, free: Parameters, model: RobotModel) -> Prior | None:
    """The weak prior of what readings tell less well than it; None where that is nothing.

    A reflector near the axis of the last joint sees the direction of that axis only by the small
    circle it describes: the numbers of the link before are told to degrees and centimeters, so far
    that the model is curved along them and steps do not end. How any carefully built arm may differ
    from its nominal links says more about them.

    Numbers that the reduction dropped because they look like these have the prior as well: what
    cannot be told from a number that has one would else be free in its place.

    Parameters
    ----------
    found : Identification
        A fit without that prior; of its covariance only the size counts.
    free : Parameters
        The numbers that were free in it.
    model : RobotModel
        The nominal model that it started from.
    """
    believed = set(() if found.prior is None else found.prior.names)
    links = set(model.names[6 : 6 + 5 * model.chain.n_joints]) - believed
    usual = weak_prior(found.parameters, model).sd
    barely = {
        name
        for name, u, sd in zip(found.names, found.standard_uncertainty, usual, strict=True)
        # written so that a number without a finite uncertainty counts
        if name in links and not u <= sd
    }
    if not barely:
        return None
    rows = np.isin(found.reduction.kept, sorted(barely))
    share = np.abs(found.reduction.mixing[rows]).max(axis=0, initial=0.0).tolist()
    pairs = zip(free.free_names, share, strict=True)
    like = {name for name, part in pairs if part > KEEP_TOLERANCE} - believed
    return weak_prior(free.freeing(barely | like), model)


def barely_told_words(prior: Prior) -> str:
    """What became of these numbers, and what would tell them."""
    names = ", ".join(prior.names)
    return (
        f"the readings barely tell {names}: the weak prior of a carefully built arm holds them "
        "near nominal; a reflector farther from the axis of the last joint, rotations, or other "
        "poses may tell them"
    )
