"""What is given where a start is looked for: flange poses, and the targets that the rows see."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.model import RobotModel
from calib.measurement.observations import GIVEN, Measurements


@dataclass(frozen=True, slots=True, eq=False)
class StartProblem:
    """A table against the flange poses that nominal links give, its targets numbered."""

    model: RobotModel
    F: Array
    """(m, 4, 4) T_base_flange [m]."""
    measurements: Measurements
    target: Index
    """(m,) which target a row sees; pose rows see the last one, the tool origin."""
    offsets: Array
    """(k, 3) targets in the tool frame: given, or nominal for reflectors of the fixtures [m]."""
    reflector: Index
    """(k,) which reflector of the fixtures a target is, or -1."""
    free_tool: bool
    known_anchor: Bool
    """(s,) anchors whose place in the world is known."""

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
        """Targets (k, 3) in the flange frame with the tool there (4, 4) [m]."""
        return self.offsets @ tool[:3, :3].T + tool[:3, 3]


def start_problem(
    model: RobotModel,
    F: Array,
    measurements: Measurements,
    free_tool: bool,
    free_anchors: Collection[int],
) -> StartProblem:
    """Number the targets of a table."""
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
    return StartProblem(model, F, measurements, of_row, offsets, reflector, free_tool, known)
