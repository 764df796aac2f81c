"""What a pose set is chosen for: the pool in units of its noise, the goal, what is known before."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calib.arrays import Array, Index
from calib.design import METHODS, Problem, Selection
from calib.design.blocks import has_full_rank, information
from calib.information.criteria.base import Criterion
from calib.information.criteria.named import criterion_named
from calib.information.criteria.total import Total
from calib.information.goals import Goals
from testbed.laboratory.tracker.predicted import GoalU, goal_u
from testbed.scenario.planning import PlanSettings


@dataclass(frozen=True, slots=True, eq=False)
class DesignTask:
    """What a pose set is chosen for."""

    blocks: Array
    """(N, r, p) whitened, scaled rows of the pool."""
    shared: Array
    """(N, r, k) what errors that all readings share do to them, each of size one; k may be 0."""
    goals: Goals
    """The tool point at the goal, in scaled units [m]."""
    before: Array
    """(b, p + k) rows of poses measured already; maybe none."""
    settings: PlanSettings
    names: tuple[str, ...]
    """(p,) of the numbers."""

    @property
    def p(self) -> int:
        """Numbers to identify."""
        return int(self.blocks.shape[2])

    @property
    def inputs(self) -> int:
        """Errors that all readings share."""
        return int(self.shared.shape[2])

    @property
    def fewest(self) -> int:
        """Fewest poses that give a calibration more equations than numbers; maybe none."""
        r = int(self.blocks.shape[1])
        return max((self.p - len(self.before)) // r + 1, 0)

    @property
    def criterion(self) -> Criterion:
        """What the set is chosen by; V and G count what all readings share."""
        return self._criterion(self.settings.criterion)

    @property
    def judge(self) -> Criterion:
        """What the curve shows: the mean over the goal, or its worst."""
        return self._criterion("G" if self.settings.target_is == "worst" else "V")

    @property
    def target(self) -> float | None:
        """Standard uncertainty wanted [m]."""
        return self.settings.target_um / self.settings.coverage * 1e-6 or None

    def _criterion(self, name: str) -> Criterion:
        """The criterion of a name, for this goal."""
        return criterion_named(name, goals=self.goals, inputs=self.inputs)

    def rows(self, places: Index) -> Array:
        """Rows (b + m r, p + k) of poses measured already and of a set."""
        chosen = np.concatenate([self.blocks[places], self.shared[places]], axis=2)
        return np.concatenate([self.before, chosen.reshape(-1, chosen.shape[-1])])

    def information(self, places: Index) -> Array:
        """Products (p + k, p + k) of these rows."""
        return information(self.rows(places)[None])

    def is_told_by(self, places: Index) -> bool:
        """Whether a set, with what was measured already, tells all numbers apart."""
        return has_full_rank(self.rows(places)[:, : self.p])

    def expected(self, places: Index) -> GoalU:
        """What a set leaves unknown at the goal."""
        return goal_u(self.information(places), self.goals.rows)

    def u(self, places: Index) -> float:
        """Goal uncertainty of a set, k = 1: mean or worst as the target asks for [m]."""
        u = self.expected(places).whole
        return float(u.max()) if self.settings.target_is == "worst" else rms(u, self.goals.weights)

    def u_shared(self, places: Index) -> float:
        """The part of it that all readings share [m]."""
        seen = self.expected(places)
        if self.settings.target_is == "worst":
            return float(seen.shared[np.argmax(seen.whole)])
        return rms(seen.shared, self.goals.weights)

    def problem(self, m: int, criterion: Criterion, *, given: Index | tuple[()] = ()) -> Problem:
        """To choose m poses beside those measured already."""
        before = self.before[:, : self.p]
        prior = information(before[None]) if len(before) else None
        plain = Problem.of_blocks(
            self.blocks,
            m,
            "D" if isinstance(criterion, Total) else criterion,
            prior=prior,
            given=given,
            names=self.names,
        )
        if not isinstance(criterion, Total):
            return plain
        # its errors have named the numbers; the shared ones are known to within their size
        known = (
            information(self.before[None]) if len(before) else np.zeros((self.p + self.inputs,) * 2)
        )
        known[self.p :, self.p :] += np.eye(self.inputs)
        wide = np.concatenate([self.blocks, self.shared], axis=2)
        return Problem.of_blocks(wide, m, criterion, prior=known, given=given)

    def select(self, m: int, rng: np.random.Generator) -> Selection:
        """The set of m poses that the scenario's method finds."""
        return METHODS[self.settings.method](self.problem(m, self.criterion), rng)

    def covariance(self, M: Array) -> Array:
        """Covariance (p, p) of the scaled numbers from products M (p + k, p + k), all included."""
        p = self.p
        C = np.asarray(cho_solve(cho_factor(M[:p, :p]), np.column_stack([np.eye(p), M[:p, p:]])))
        return np.asarray((C[:, :p] + C[:, :p].T) / 2 + C[:, p:] @ C[:, p:].T)


def rms(u: Array, weights: Array) -> float:
    """Weighted root mean square of u (g,) [m]."""
    return float(np.sqrt(weights @ u**2))
