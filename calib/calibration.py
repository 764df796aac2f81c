"""Calibration in one call: frames, reduction, fit and tests; judged by other poses."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np

from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.identification.outliers.tails import long_tails
from calib.identification.prior import Prior, frame_places, own_prior, own_words
from calib.identification.result import Identification
from calib.identification.robust import Loss
from calib.identification.start.likeness import (
    require_fitted_likeness,
    require_meters,
    require_nominal_likeness,
)
from calib.identification.start.start import Start, start_frames
from calib.identification.untold.barely_told import barely_told, barely_told_words
from calib.kinds import checked_kinds
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import ResultTable, Shown
from calib.uncertainty.judgement import Circumstances, Judgement, judge

TURNED = 0.05
"""Largest rotation of a frame [rad] at which a prior in its old axes still holds."""


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedRobot(Shown):
    """A calibrated robot: its identification, the start of the fit, and the measurements."""

    identification: Identification
    """Identified model with covariance and tests."""
    start: Start
    """The nominal links with the frames found from the measurements."""
    measured: Measurements
    """Table that it was identified from."""

    def __repr__(self) -> str:
        return f"CalibratedRobot({self.identification!r}, from {len(self.measured)} rows)"

    def tables(self) -> dict[str, ResultTable]:
        """``numbers`` with U and unit; ``residuals``: measured minus predicted position [m]."""
        points = self.measured.rows(~self.measured.is_distance)
        x, y, z = predict(self.model, points).residual[:, :3].T
        rest = ResultTable({"pose": points.pose_id, "x_m": x, "y_m": y, "z_m": z})
        return {**self.identification.tables(), "residuals": rest}

    @property
    def model(self) -> RobotModel:
        """The identified robot."""
        return self.identification.model

    def summary(self) -> str:
        """Text with frames, numbers and their U, tests of the fit, and what is not identifiable."""
        misfit = f"nominal links miss by {1e3 * self.start.position_rms:.3f} mm rms"
        frames = [note for note in self.start.notes if note not in self.identification.notes]
        own = own_words(self.start.model, self.identification.parameters)
        lines = [*frames, misfit, own, self.identification.summary(), self._worst_rows()]
        return "\n".join(line for line in lines if line)

    def _worst_rows(self) -> str:
        """Which few rows have most of the squares; empty where none stand out."""
        fit = self.identification
        if fit.mode != "whitened" or fit.loss != "squared" or fit.status is not Status.CONVERGED:
            return ""
        tails = long_tails(fit, self.measured, self.measured.rows([]))
        if tails is None or not tails.poses:
            return ""
        names = [str(pose) for pose in tails.poses]
        return f"warning: {tails.worst_words(names)}; {tails.remedy}"

    @checked_kinds
    def judge(
        self,
        test: Measurements,
        *,
        circumstances: Circumstances | None = None,
        rng: np.random.Generator | None = None,
    ) -> Judgement:
        """Judge the calibration by poses that it never used; see `calib.judge`.

        Parameters
        ----------
        test : Measurements
            Held-out poses or points, drawn from where the robot will be used.
        circumstances : Circumstances, optional
            Further facts about the campaign.
        rng : numpy.random.Generator, optional
            Generator for virtual calibrations; without it none are played.
        """
        return judge(
            self.identification, test, train=self.measured, circumstances=circumstances, rng=rng
        )


@checked_kinds
def calibrate(
    model: RobotModel,
    measured: Measurements,
    *,
    free: Iterable[str] | None = None,
    free_tool: bool = True,
    free_anchors: Collection[int] = (),
    prior: Prior | None = None,
    loss: Loss = "squared",
    report: Callable[[int, float], None] | None = None,
) -> CalibratedRobot:
    """Calibrate a robot from measurements; only its nominal links need to be known.

    Base, tool and fixtures are found first, then all free numbers together. Of numbers that the
    measurements cannot tell apart some stay nominal; the summary lists them. Joint errors that the
    model has already get the weak prior unless another is given: see `own_prior`.

    Parameters
    ----------
    model : RobotModel
        The robot as its maker describes it.
    measured : Measurements
        Poses, points or distances; see `calib.poses`, `calib.points`, `calib.distances`.
    free : iterable of str, optional
        Names of the numbers to identify; by default all but known anchors and a held tool. Base,
        tool and fixtures are found first in any case; if not free, they keep the values found.
    free_tool : bool
        Whether the tool is found; False holds it as in the model.
    free_anchors : collection of int
        Anchors of the fixtures, from 0, whose position in the world is unknown.
    prior, loss, report
        As in `calib.identify`; the prior refers to the numbers of `model`, not to the frames found.

    Raises
    ------
    InputError
        Too few measurements (how many are needed is stated); M21: links or sd are in no meters;
        M32: the measurements are not of such an arm, in other units, joints in another order, or
        rotations transposed.

    Examples
    --------
    >>> from calib.geometry.chain import Chain
    >>> from calib.measurement.tables import points
    >>> links = [[0, 0.4, 0.1, -1.57, 0], [0, 0, 0.5, 0, 0], [0, 0, 0.4, 0, 0]]
    >>> arm = RobotModel(Chain(links))
    >>> rng = np.random.default_rng(0)
    >>> q = rng.uniform(-2, 2, (60, 3))
    >>> xyz = arm.poses(q)[:, :3, 3] + rng.normal(scale=20e-6, size=(60, 3))
    >>> train, test = points(q, xyz, sd=20e-6).split(held_out=20)
    >>> result = calibrate(arm, train)
    >>> result.identification.status.name, result.judge(test).trust.believe
    ('CONVERGED', 'region')
    """
    require_meters(model, measured)
    start = start_frames(model, measured, free_tool=free_tool, free_anchors=free_anchors)
    if free_tool:  # a tool that is held may be far off
        require_nominal_likeness(start)
    every = free is None
    if free is None:
        known = {f"anchor{k + 1}" for k in range(len(model.fixtures.anchors))}
        held = known - {f"anchor{k + 1}" for k in free_anchors}
        if not free_tool:
            held.add("tool")
        free = [name for name in model.names if name.split(".")[0] not in held]
    parameters = parameters_of(start.model, free)
    believed = () if prior is None else prior.names
    rest = parameters.freeing(name for name in parameters.free_names if name not in believed)
    if (own := own_prior(rest, start.model)) is not None:
        prior = own if prior is None else prior.joined(own)
    if prior is not None:
        prior = _from_start(prior, model, start.model)
    found = identify(start.model, measured, parameters, prior=prior, loss=loss, report=report)
    if found.status is not Status.CONVERGED:
        weak = barely_told(found, parameters, start.model)
        if weak is not None:
            both = weak if prior is None else prior.joined(weak)
            again = identify(
                start.model, measured, parameters, prior=both, loss=loss, report=report
            )
            if again.status is Status.CONVERGED:
                found = replace(again, notes=(*again.notes, barely_told_words(weak)))
    if every and free_tool and found.status is Status.CONVERGED:
        require_fitted_likeness(found.model, start, measured)
    return CalibratedRobot(found, start, measured)


def _from_start(prior: Prior, model: RobotModel, start: RobotModel) -> Prior:
    """The same prior with its steps counted from the frames found instead of from `model`.

    Raises
    ------
    InputError
        A3: it is of a frame that was found to be rotated, so that its axes are different.
    """
    place = [model.names.index(name) for name in prior.names if name in model.names]
    if len(place) < len(prior.names):
        return prior  # the fit names what the model does not have
    moved = start.step_to(model)
    for k in frame_places(model):
        own = [name for name in prior.names if k <= model.names.index(name) < k + 6]
        if own and np.linalg.norm(moved[k + 3 : k + 6]) > TURNED:
            degrees = float(np.degrees(np.linalg.norm(moved[k + 3 : k + 6])))
            message = (
                f"the prior names {own[0]}, and the measurements show that frame turned by "
                f"{degrees:.3g} deg from the model's"
            )
            fix = "place the frame of the model nearer, or leave it out of the prior"
            raise refuse("prior", own[0], code="A3", message=message, fix=fix)
    if not np.any(moved[place]):
        return prior
    step = np.zeros(model.n_numbers)
    step[place] = prior.mean
    return replace(prior, mean=start.step_to(model.moved(step))[place])
