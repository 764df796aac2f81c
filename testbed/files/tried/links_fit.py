"""What base, tool and links leave at poses left out: of arms whose links are far from nominal.

Base and tool alone leave centimeters there, as they do of a wrong reading. With links fitted as
well the right reading predicts poses that had no part in the fit; a wrong one does not, or only
with links that no arm has.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.errors import InputError
from calib.geometry.frames import transform
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.folds import FOLDS
from calib.identification.identify import identify
from calib.identification.prior import Prior, weak_prior
from calib.identification.start.start import start_frames
from calib.measurement.grouping import first_met, united
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.tables import points, poses
from testbed.files.alternatives import Interpretation
from testbed.files.frames_fit import LEVER, TIMES
from testbed.files.rows.stops import NEAR, NEAR_SLIDE, near_joints

LENGTH, ANGLE = 8e-3, float(np.radians(1.5))
"""Standard deviations from nominal of links that are far from it [m, rad]."""
FARTHEST = 4.0
"""How many of these a link may be away. Right readings of simulated arms end below 3, wrong ones
above 10."""
NOISE = 1e-3
"""Of positions: what a fit of links leaves of an arm that is so far from nominal [m]."""
WIDE = 100.0
"""How many times wider than usual frames may lie from their start."""
MOST = 0.8
"""Part of the poses left out that has to be explained; the others may be gross errors."""


@dataclass(frozen=True, slots=True)
class LinksFit:
    """Links fitted to what base and tool alone leave."""

    left: float
    """Error at poses left out that most of them do not exceed, as `Misfit.score` [m]; of links that
    miss too much of what they were fitted to, the error there."""
    length: float
    """Largest error of a link's length [m]."""
    angle: float
    """Largest error of a link's angle [rad]."""
    explains: bool = True
    """Whether that is so much less than base and tool alone leave."""

    @property
    def sentence(self) -> str:
        """The links in words."""
        return (
            f"links up to {self.length * 1e3:.2g} mm and {np.degrees(self.angle):.2g} deg from "
            f"nominal leave {self.left * 1e3:.2g} mm at poses that they were not fitted to"
        )


def table_of(read: Interpretation) -> Measurements:
    """Readings as a table of equal weights."""
    if read.rotation is None:
        return points(read.q, read.position, sd=NOISE)
    return poses(read.q, transform(read.rotation, read.position), sd=(NOISE, NOISE / LEVER))


def links_fit(
    model: RobotModel,
    table: Measurements,
    left: float,
    *,
    stated: Array | None = None,
    free_anchors: Collection[int] = (),
) -> LinksFit | None:
    """Base, tool and links fitted to readings; None if no arm has such links, or rows are too few.

    Parameters
    ----------
    model : RobotModel
        Nominal.
    table : Measurements
        Readings of one target, or distances.
    left : float
        What base and tool alone leave [m].
    stated : (n, 5) array, optional
        Standard deviations of links that somebody states; larger ones than usual count [rad, m, m,
        rad, rad].
    free_anchors : collection of int
        As in `start_frames`.
    """
    usual = np.tile([ANGLE, LENGTH, LENGTH, ANGLE, ANGLE], (model.chain.n_joints, 1))
    sd = usual if stated is None else np.maximum(usual, stated)
    try:
        start = start_frames(model, table, free_anchors=free_anchors).model
        whole = _fit(start, table, sd, free_anchors)
        off = np.abs(whole.chain.links - start.chain.links)
        if (off > FARTHEST * sd).any():
            return None
        largest = float(off[:, 1:3].max()), float(off[:, [0, 3, 4]].max())
        if (there := _of_most(_missed(whole, table))) * TIMES > left:
            return LinksFit(there, *largest, explains=False)
        pose = _stops(table, whole)
        part = np.random.default_rng(0).permutation(int(pose.max()) + 1)[pose] % FOLDS
        missed = np.zeros(len(table))
        for k in range(FOLDS):
            rest = _fit(start, table.rows(part != k), sd, free_anchors, near=whole)
            missed[part == k] = _missed(rest, table.rows(part == k))
    except InputError:  # too few to tell
        return None
    elsewhere = _of_most(missed)
    return LinksFit(elsewhere, *largest, explains=elsewhere * TIMES <= left)


def _stops(table: Measurements, model: RobotModel) -> Index:
    """Number (m,) of the place each row was measured at: joints read back differ from shot to shot.

    Shots of one place are left out together, else each would be foretold by the others.
    """
    slides = np.array([kind == "prismatic" for kind in model.chain.kinds])
    near = near_joints(table.q, np.where(slides, NEAR_SLIDE, NEAR))
    return np.unique(united(table.together, first_met(near[:, None])), return_inverse=True)[1]


def _fit(
    start: RobotModel,
    table: Measurements,
    sd: Array,
    free_anchors: Collection[int],
    near: RobotModel | None = None,
) -> RobotModel:
    """The model with frames and links fitted, under prior widths sd (n, 5); joint errors as are."""
    held = {f"anchor{k + 1}" for k in range(len(start.fixtures.anchors))} - {
        f"anchor{k + 1}" for k in free_anchors
    }
    held |= {*start.joint_errors.names}
    free = [name for name in start.names if name not in held and name.split(".")[0] not in held]
    parameters = parameters_of(start, free)
    usual = weak_prior(parameters, start)
    links = dict(zip(start.names[6:], sd.ravel().tolist(), strict=False))
    each = zip(usual.names, usual.sd.tolist(), strict=True)
    widths = [links.get(name, WIDE * width) for name, width in each]
    prior = Prior(usual.mean, widths, usual.names)
    return identify(start, table, parameters, prior=prior, loss="huber", start=near).model


def _missed(model: RobotModel, table: Measurements) -> Array:
    """How far (m,) each reading is off, with rotations as in `Misfit.score` [m]."""
    seen = predict(model, table)
    return np.asarray(np.hypot(seen.misses, LEVER * seen.turns))


def _of_most(missed: Array) -> float:
    """What most of some errors (m,) do not exceed [m]."""
    return float(np.quantile(missed, MOST))
