"""The virtual laboratory for scripts: measurements of a hidden robot, and errors of a result."""

from dataclasses import dataclass
from hashlib import sha256
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check
from calib.errors import InputError, refuse
from calib.geometry.frames import target_points
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.result import Identification
from calib.kinds import in_short
from calib.measurement.accuracy import point_distances
from calib.measurement.observations import Measurements
from testbed.laboratory.pool import REASONS
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import held_out_conditions, make_setting
from testbed.run.play import robot_of
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.trial.compare import true_step


class HasModel(Protocol):
    """A result with an identified model, as of `calib.identify` or `truebed.identify`."""

    @property
    def model(self) -> RobotModel:
        """The identified robot."""


@dataclass(frozen=True, slots=True, eq=False)
class VirtualLaboratory:
    """A robot with a hidden true geometry, a tracker that measures it, and poses to choose from.

    The truth is used only to compute the error of a result. Every random number comes from a named
    stream of the scenario's seed, so that drawing more of one kind changes no other.
    """

    inside: Laboratory
    """The laboratory of `testbed` behind this interface; its names may change."""
    noise: tuple[str | int, ...] = ()
    """First names of the streams of noise, for another robot than the scenario's."""

    def __repr__(self) -> str:
        return f"VirtualLaboratory({self.scenario!r}, {len(self.poses)} poses)"

    @property
    def scenario(self) -> Scenario:
        """The scenario that it was opened with."""
        return self.inside.scenario

    @property
    def nominal(self) -> RobotModel:
        """The robot as its maker describes it."""
        return self.inside.setting.nominal

    @property
    def free(self) -> Parameters:
        """Parameter table of `nominal`, with the numbers free that the scenario frees."""
        return self.inside.free("whitened")

    @property
    def poses(self) -> Array:
        """(N, n) candidate joint values, without collision and seen by the tracker [rad, m]."""
        return self.inside.pool_q

    @property
    def held_out(self) -> Array:
        """(t, n) poses that no trial measures, at which results are judged [rad, m]."""
        return self.inside.setting.test_q

    def blocks(self, kind: str = "whitened") -> Array:
        """Blocks (N, r, p) of the candidates, for `calib.design.Problem.of_blocks`.

        Parameters
        ----------
        kind : {"whitened", "paper"}
            Rows whitened by the stated noise, with scaled columns; or the rows of Wen et al. 2022,
            for full poses measured from one station.

        Raises
        ------
        InputError
            A3: there is no such kind, or this laboratory does not measure poses as in the paper.
        """
        if kind not in ("whitened", "paper"):
            raise refuse("kind", kind, "whitened or paper", code="A3")
        if kind not in ("whitened", self.inside.usual_rows):
            message = "rows of the paper are of full poses, which this laboratory does not measure"
            fix = 'ask for "whitened" ones'
            raise refuse("kind", kind, code="A3", message=message, fix=fix)
        return self.inside.design_blocks(kind)

    def rng(self, *names: str | int) -> np.random.Generator:
        """Random generator for your own use; the same names give the same numbers.

        The laboratory itself never draws from it, whatever the names.
        """
        return stream(self.scenario.seed, "own", *names)

    def another(self, *names: str | int) -> Self:
        """Laboratory with another random robot of the same kind and the same candidates.

        The names seed the robot and its noise: a name given to `measure` draws other noise there.
        """
        robot = self.inside.with_robot(self.scenario.truth, *names)
        return type(self)(robot, ("another", *names))

    @in_short
    def measure(self, poses: ArrayLike, name: str, *, repeat: int = 0) -> Measurements:
        """Measurements by the tracker, with the covariances that it states.

        Parameters
        ----------
        poses : (m,) array_like of int, (N,) array_like of bool, or (m, n) array_like
            Indices of candidates or a mask of them, or joint values of your own [rad, m]; visited
            in this order.
        name : str
            Seeds the noise: the same name and poses read the same, other poses have other noise.
        repeat : int
            Number of the visit, from 0. Each has its own noise of tracker and robot, and begins
            when as many visits of these poses have ended.

        Raises
        ------
        InputError
            A1, A3: there is no such candidate, or the robot cannot take a pose, or the tracker
            cannot see it.
        """
        given = np.asarray(poses)
        if given.dtype == np.bool_ and given.shape == (len(self.poses),):
            given = np.flatnonzero(given)
        if given.ndim == 0:
            message = f"poses is of the type {type(poses).__name__}"
            fix = "give its indices" if hasattr(poses, "indices") else "give a list"
            allowed = "places (m,) among the candidates, or joints (m, n)"
            raise refuse("poses", poses, allowed, code="A3", message=message, fix=fix)
        if not given.size:
            raise refuse("poses", "empty", "one pose or more", code="A3")
        visit, lab = _visit(repeat), self.inside
        start = visit * lab.visit_time(len(given))
        if given.ndim == 1 and np.issubdtype(given.dtype, np.integer):
            places = self._places(given)
            names = (*self.noise, name, _digest(self.poses[places]))
            return lab.measure_pool(places, *names, repeat=visit, start=start)
        q = self._reachable(given)
        names = (*self.noise, name, _digest(q))
        return lab.measure(q, np.arange(len(q)), *names, repeat=visit, start=start)

    @in_short
    def errors(self, found: RobotModel | HasModel, q: ArrayLike | None = None) -> Array:
        """True minus predicted tool points (m, 3), world axes, without scatter of single moves [m].

        Parameters
        ----------
        found : RobotModel, or a result that has one as ``model``
            Result of `calib.identify`, `calib.calibrate` or `truebed.identify`; or `nominal`.
        q : (m, n) array_like, optional
            Joint values [rad, m]; the held-out poses by default.
        """
        model = found if isinstance(found, RobotModel) else getattr(found, "model", None)
        if not isinstance(model, RobotModel):
            allowed = "a calib.RobotModel, or a result that has one as .model"
            message = f"found is of the type {type(found).__name__}"
            raise refuse("found", found, allowed, code="A3", message=message)
        at = self.held_out if q is None else self._joints(q=q)
        true = self.inside.held_out(at)
        said = model.poses(at, held_out_conditions(self.scenario, at))
        target = self.inside.setting.target
        return np.asarray(target_points(true, target) - target_points(said, target))

    @in_short
    def mean_error(self, found: RobotModel | HasModel, q: ArrayLike | None = None) -> float:
        """Mean length of `errors` [m]; arguments as there."""
        return float(point_distances(self.errors(found, q), np.zeros(3)).mean())

    def true_step(self, found: Identification, seen: Measurements) -> Array:
        """True minus nominal values (f,) of the numbers that were estimated [m, rad].

        Numbers that were not kept are expressed by those that were, as in the estimate.

        Parameters
        ----------
        found : Identification
            Estimate whose ``step`` and ``covariance`` are compared with this.
        seen : Measurements
            Table that it was identified from.
        """
        return true_step(self.inside.setting, found, seen, self.inside.truth.unmodelled)

    def _places(self, places: Index) -> Index:
        """Checked indices of candidates."""
        wrong = (places < 0) | (places >= len(self.poses))
        if wrong.any():
            raise refuse("poses", int(places[wrong][0]), f"0 to {len(self.poses) - 1}", code="A3")
        return places.astype(np.int64)

    def _joints(self, **named: ArrayLike) -> Array:
        """Checked joint values (m, n) of this robot; an error calls them by the name given."""
        return check(f"m {self.nominal.chain.n_joints}", **named)[0]

    def _reachable(self, q: ArrayLike) -> Array:
        """Checked joint values (m, n) that the robot can take where the tracker sees it."""
        q = self._joints(poses=q)
        fault = self.inside.candidates().first_fault(q, box=False)
        if (fault >= 0).any():
            first = int(np.flatnonzero(fault >= 0)[0])
            message = f"pose {first} cannot be measured: {REASONS[fault[first]]}"
            raise refuse("poses", first, code="A3", message=message)
        return q


def _digest(q: Array) -> str:
    """Hash of joint values (m, n), so that poses measured one at a time have noise of their own."""
    # equal for both zeros, and for joint values that differ by rounding of the machine
    return sha256((np.round(q, 9) + 0.0).tobytes()).hexdigest()


def _visit(repeat: int) -> int:
    """Checked number of a visit, as a Python int, which names streams."""
    whole = isinstance(repeat, int | np.integer) and not isinstance(repeat, bool)
    if not whole or repeat < 0:
        raise refuse("repeat", repeat, "a whole number, 0 or larger", code="A3")
    return int(repeat)


def opened(scenario: Scenario) -> VirtualLaboratory:
    """The laboratory of a scenario, with its true robot drawn."""
    where = f'scenario "{scenario.name}"'
    robot_of(scenario, where)
    try:
        return VirtualLaboratory(open_laboratory(scenario, make_setting(scenario)))
    except InputError as error:
        raise error.located(where) from error
