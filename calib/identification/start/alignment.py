"""Alignment of frames and fixtures with given flange poses: the problem and its refinement."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import nearest_rigid, skew, step_transform, transform_points
from calib.geometry.model import RobotModel
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from calib.identification.least_squares import solve
from calib.measurement.observations import GIVEN, Measurements
from calib.measurement.prediction import Prediction, predict_at

DAMPING = 0.01
"""Weight of a displacement against a measured length. With a millimeter of misfit a frame moves at
most 5 cm along directions that the data hardly determine, and not at all along undetermined ones.
"""
SCALE = np.array([1.0, 1.0, 1.0, *[CHARACTERISTIC_LENGTH] * 3])
"""Weight of rows: a radian counts like L meters. Errors of the nominal robot dominate here, which
the stated covariances do not describe."""


@dataclass(frozen=True, slots=True, eq=False)
class StartProblem:
    """A table with the flange poses by nominal links, and its targets numbered."""

    model: RobotModel
    F: Array
    """(m, 4, 4) T_base_flange [m]."""
    measurements: Measurements
    target: Index
    """(m,) target that each row measures; for pose rows the last one, the tool origin."""
    offsets: Array
    """(k, 3) targets in the tool frame: given, or nominal for reflectors of the fixtures [m]."""
    reflector: Index
    """(k,) number of each target among the reflectors of the fixtures, or -1."""
    free_tool: bool
    known_anchor: Bool
    """(s,) anchors whose place in the world is known."""
    placed: Bool
    """(1 + t,) stations that other rows have already placed; they keep their places in `model`."""

    @property
    def nominal_arms(self) -> Array:
        """(k, 3) targets in the flange frame with the nominal tool [m]."""
        return self.offsets_through(self.model.chain.T_flange_tool)

    @property
    def given(self) -> Bool:
        """(k,) targets whose place in the tool frame is given."""
        return np.asarray(self.reflector == GIVEN)

    @property
    def fixed(self) -> Bool:
        """(k,) targets whose place on the flange is known beforehand."""
        return self.given & (not self.free_tool)

    def offsets_through(self, tool: Array) -> Array:
        """Targets (k, 3) in the flange frame for a tool frame T_flange_tool (4, 4) [m]."""
        return transform_points(tool, self.offsets)


def start_problem(
    model: RobotModel,
    F: Array,
    measurements: Measurements,
    free_tool: bool,
    free_anchors: Collection[int],
    placed: Collection[int] = (),
) -> StartProblem:
    """The alignment problem of a table, with its distinct targets numbered."""
    # distinct targets: by offset, or by number among the reflectors of the fixtures
    key = np.column_stack([measurements.offset, measurements.reflector])
    distinct, target = np.unique(key[~measurements.is_pose], axis=0, return_inverse=True)
    of_row = np.full(len(measurements), len(distinct))
    of_row[~measurements.is_pose] = target.ravel()
    # the tool origin comes last
    reflector = np.append(distinct[:, 3].astype(np.int64), GIVEN)
    offsets = np.concatenate([distinct[:, :3], np.zeros((1, 3))])
    unknown = reflector != GIVEN
    offsets[unknown] = model.fixtures.reflectors[reflector[unknown]]
    known = ~np.isin(np.arange(len(model.fixtures.anchors)), list(free_anchors))
    held = np.isin(np.arange(1 + len(model.fixtures.stations)), list(placed))
    return StartProblem(model, F, measurements, of_row, offsets, reflector, free_tool, known, held)


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Base, tool and fixtures for given poses of the flange."""

    F: Array
    """(m, 4, 4) T_base_flange by the nominal links [m]."""
    base: Array
    """(4, 4) T_world_base [m]."""
    tool: Array
    """(4, 4) T_flange_tool [m]."""
    fixtures: Fixtures

    @property
    def is_length(self) -> Bool:
        """(12 + f,) whether each number of base, tool and fixtures is a length."""
        frame = (True, True, True, False, False, False)
        return np.array((*frame, *frame, *self.fixtures.is_length))

    def moved(self, step: Array) -> "Alignment":
        """The alignment after a step (12 + f,) [m, rad], as in `RobotModel.moved`."""
        return replace(
            self,
            base=_stepped(self.base, step[:6]),
            tool=_stepped(self.tool, step[6:12]),
            fixtures=self.fixtures.moved(step[12:]),
        )

    def predict(self, measurements: Measurements) -> Prediction:
        """Residual and derivative by base, tool and fixtures of every row."""
        mounted = measurements.tool
        several = bool(mounted.any())
        tool = self.tool
        if several:
            tool = np.concatenate([tool[None], self.fixtures.tools])[mounted]
        T = self.base @ self.F @ tool
        R = T[:, :3, :3]
        J = np.zeros((len(T), 6, 12 + self.fixtures.n_numbers))
        J[:, :3, :3] = J[:, 3:, 3:6] = self.base[:3, :3]
        J[:, :3, 3:6] = -skew(T[:, :3, 3] - self.base[:3, 3]) @ self.base[:3, :3]
        for k in np.unique(mounted).tolist() if several else (0,):
            # the tool of the chain, or a further one among the fixtures
            own = 12 + self.fixtures.first_tool + 6 * (k - 1) if k else 6
            rows = mounted == k if several else slice(None)
            J[rows, :3, own : own + 3] = J[rows, 3:, own + 3 : own + 6] = R[rows]
        return predict_at(T, J, self.fixtures, 12, measurements)

    def rows(self, which: Index) -> "Alignment":
        """The alignment at some of the poses."""
        return replace(self, F=self.F[which])


def _stepped(T: Array, step: Array) -> Array:
    """A frame (4, 4) after a step (6,) [m, rad]; one that is held stays as it is."""
    return nearest_rigid(T @ step_transform(step)) if step.any() else T


@dataclass(frozen=True, slots=True, eq=False)
class _Moved:
    """An alignment during refinement, and its displacement (f,) since the start [m, rad]."""

    alignment: Alignment
    displacement: Array


def refine(
    alignment: Alignment, measurements: Measurements, free: Index, *, most: int = 30
) -> Alignment:
    """Least-squares fit near an alignment over its numbers `free` (f,), with rows times `SCALE`."""
    damping = DAMPING * np.where(alignment.is_length[free], 1.0, CHARACTERISTIC_LENGTH)
    n = alignment.is_length.size

    def evaluate(at: _Moved) -> tuple[Array, Array]:
        here = at.alignment.predict(measurements)
        r = (here.residual * SCALE)[here.filled]
        A = (here.rows * SCALE[:, None])[here.filled][:, free]
        damped = np.concatenate([r, -damping * at.displacement])
        return damped, np.concatenate([A, np.diag(damping)])

    def move(at: _Moved, step: Array) -> _Moved:
        full = np.zeros(n)
        full[free] = step
        return _Moved(at.alignment.moved(full), at.displacement + step)

    # the second pass damps steps from the result of the first, so that damping adds no bias
    for _ in range(2):
        start = _Moved(alignment, np.zeros(len(free)))
        alignment = solve(evaluate, start, move=move, most=most).x.alignment
    return alignment
