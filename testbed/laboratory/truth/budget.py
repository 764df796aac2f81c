"""What each term of the truth contributes: how far it alone moves the tool over given poses."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.geometry.jacobian import joint_columns
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.terms import NEEDED, only, terms_of
from testbed.robots.catalog import Robot
from testbed.scenario.laboratory import TruthSettings

REPEATABILITY = "repeatability"


@dataclass(frozen=True, slots=True, eq=False)
class TruthBudget:
    """The error of the true robot, term by term; displacements are true minus nominal tool."""

    names: tuple[str, ...]
    """(k,) terms that are switched on; repeatability, which scatters, is the last one."""
    rms_mm: Array
    """(k,) root mean square displacement of the tool by each term alone [mm]."""
    displacement_mm: Array
    """(d, m, 3) displacement by each term alone, world axes; not of repeatability [mm]."""
    together_mm: Array
    """(m, 3) displacement by all of them at once, without repeatability [mm]."""

    @property
    def together_rms_mm(self) -> float:
        """Root mean square displacement by all terms at once, repeatability included [mm]."""
        scatter = self.rms_mm[len(self.displacement_mm) :]
        return float(np.sqrt(_rms(self.together_mm) ** 2 + (scatter**2).sum()))

    @property
    def interaction_mm(self) -> float:
        """Root mean square of what the terms together do beyond the sum of each alone [mm]."""
        return _rms(self.together_mm - self.displacement_mm.sum(axis=0))


def truth_budget(
    robot: Robot,
    truth: TruthSettings,
    seed: int,
    q: Array,
    *,
    time: Array | None = None,
    previous: Array | None = None,
    moves: Array | None = None,
) -> TruthBudget:
    """What each term of a scenario's truth contributes to the error of the tool.

    Each term is switched on alone, with what it draws in the scenario, and moves the nominal robot;
    one that is nothing without others, beside these, and moves them.
    Repeatability counts with its expectation, to first order.

    Parameters
    ----------
    robot : Robot
        Nominal robot.
    truth : TruthSettings
        [truth] of the scenario.
    seed : int
        Seed of the scenario.
    q : (m, n) array
        Poses over which the contributions are averaged [rad, m].
    time, previous, moves : optional
        As in `TrueRobot.poses`.
    """
    model = robot.model
    nominal = model.poses(q)[:, :3, 3]

    def position(*terms: str) -> Array:
        true = draw_truth(robot, only(truth, *terms), seed)
        return true.poses(q, time=time, previous=previous, moves=moves)[:, :3, 3]

    def displacement(term: str) -> Array:
        beside = NEEDED.get(term, ())
        return 1e3 * (position(*beside, term) - (position(*beside) if beside else nominal))

    names = terms_of(truth)
    fixed = [name for name in names if name != REPEATABILITY]
    alone = np.array([displacement(name) for name in fixed]).reshape(len(fixed), len(q), 3)
    rms = [_rms(one) for one in alone]
    if REPEATABILITY in names:
        sd = draw_truth(robot, only(truth, REPEATABILITY), seed).joint_repeatability
        J = model.poses_and_jacobian(q)[1][:, :3, joint_columns(model.chain)] * sd
        rms.append(1e3 * float(np.sqrt((J**2).sum(axis=(1, 2)).mean())))
    return TruthBudget(names, np.array(rms), alone, 1e3 * (position(*fixed) - nominal))


def _rms(displacement: Array) -> float:
    """Root mean square length of vectors (m, 3)."""
    return float(np.sqrt((displacement**2).sum(axis=-1).mean()))
