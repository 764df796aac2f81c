"""What the truths of the specification, section 5, leave behind after plain fits of many robots."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from calib.arrays import Array, Index
from calib.design import Problem, exchange
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize, paper_stack, whitened_blocks
from calib.measurement.tables import covariances_of_sd
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.laboratory.truth.robot import TrueRobot, draw_truth
from testbed.robots.catalog import load_robot
from testbed.scenario.laboratory import PaperTracker, TruthSettings
from testbed.studies import scenario_of
from tests.reference import DEG, READABLE30, SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60

POOL, HELD_OUT = pool_r(), pool_r(300, seed=99)
NOMINAL = tx60()


def settings(preset: str, **changes: object) -> TruthSettings:
    """[truth] of a preset, as a scenario file would resolve it."""
    document = {
        "format": 1,
        "name": "outcomes",
        "robot": "staubli_tx60",
        "truth": {"preset": preset, **changes},
        "trial": [{"name": "any", "poses": 29, "method": "random"}],
    }
    return scenario_of(document).truth


def extended() -> RobotModel:
    """The nominal robot with the 27 joint terms of the specification, section 6, all zero."""
    terms = (*gravity_terms(6), *harmonic_terms(6))
    return RobotModel(NOMINAL.chain, JointErrors(terms, np.zeros(len(terms))))


def weak_sd(model: RobotModel) -> Array:
    """Prior sd of all numbers (P,), specification section 6 [m, rad]."""

    def one(name: str, length: bool) -> float:
        if name.startswith("gravity"):
            return 50e-3 * DEG
        if name.startswith("harmonic"):
            return (20e-3 if name.endswith("1") else 12e-3) * DEG
        if name.startswith(("base", "tool")):
            return 1e-3 if length else 0.1 * DEG
        return 0.6e-3 if length else 0.1 * DEG

    return np.array([one(*pair) for pair in zip(model.names, model.is_length, strict=True)])


@dataclass(frozen=True)
class Fit:
    """A least-squares fit by Gauss-Newton, apart from the identification room."""

    start: RobotModel
    free: Sequence[str]
    paper: bool = False
    prior: bool = False

    def __call__(self, seen: Measurements) -> tuple[RobotModel, float]:
        """The fitted model, and chi-square per degree of freedom."""
        index = [self.start.names.index(name) for name in self.free]
        model, sd = self.start, weak_sd(self.start)[index]
        for _ in range(5):
            stack = paper_stack(model, seen) if self.paper else linearize(model, seen)
            A, r = stack.A[:, index], stack.r
            if self.prior:
                A = np.vstack([A, np.diag(1 / sd)])
                r = np.concatenate([r, -self.start.step_to(model)[index] / sd])
            scale = np.linalg.norm(A, axis=0)
            step = np.zeros(model.n_numbers)
            step[index] = np.linalg.lstsq(A / scale, r, rcond=None)[0] / scale
            model = model.moved(step)
        r = linearize(model, seen).r
        A = linearize(model, seen).A[:, index]
        M = A.T @ A
        used = np.trace(np.linalg.solve(M + np.diag(self.prior / sd**2), M))
        return model, float(r @ r / (len(r) - used))


FITS = {
    "ols24": Fit(NOMINAL, WEN24, paper=True),
    "gls24": Fit(NOMINAL, WEN24),
    "gls30": Fit(NOMINAL, READABLE30),
    "extended": Fit(extended(), extended().names, prior=True),
}


@cache
def best_set(m: int, names: tuple[str, ...] = READABLE30) -> Index:
    """Places (m,) in the pool of a D-optimal set for a geometric model."""
    parameters = parameters_of(NOMINAL).freeing(names)
    covariance = covariances_of_sd((SIGMA_POSITION, SIGMA_ROTATION), 6, len(POOL))
    blocks = whitened_blocks(NOMINAL, POOL, covariance)[:, :, parameters.free]
    return exchange(
        Problem.of_blocks(blocks * parameters.free_scale, m, "D"),
        np.random.default_rng(0),
        restarts=2,
    ).indices


def robots(preset: str, count: int, **changes: object) -> Iterator[tuple[int, TrueRobot]]:
    """So many true robots of a preset."""
    robot, truth = load_robot("staubli_tx60"), settings(preset, **changes)
    for seed in range(count):
        yield seed, draw_truth(robot, truth, seed)


def seen_of(true: TrueRobot, q: Array, seed: int) -> Measurements:
    """One visit with `paper` noise, joint by joint from joint zero."""
    tracker, rng = tracker_from(PaperTracker(), NOMINAL.chain), np.random.default_rng([seed, 1])
    T = true.poses(q, rng=rng, previous=np.vstack([np.zeros((1, 6)), q[:-1]]))
    covariance = tracker.covariance(NOMINAL, q, np.zeros(6))
    return tracker.measure(T, q, np.arange(len(q)), 0, covariance, rng)


@dataclass(frozen=True)
class Outcome:
    """Medians over robots of the mean held-out position error [mm]."""

    before: float
    before_low: float
    before_high: float
    random: float
    designed: float
    chi_random: float
    chi_designed: float


def outcome(preset: str, fit: str, m: int, count: int, **changes: object) -> Outcome:
    """Before and after one fit, poses at random and D-optimal."""
    chosen, rows = best_set(m), []
    for seed, true in robots(preset, count, **changes):
        p = true.poses(HELD_OUT)[:, :3, 3]
        before = np.linalg.norm(p - NOMINAL.poses(HELD_OUT)[:, :3, 3], axis=1).mean()
        row = [before]
        random = np.random.default_rng([seed, 2]).choice(len(POOL), m, replace=False)
        for poses in (random, chosen):
            model, chi = FITS[fit](seen_of(true, POOL[poses], seed))
            after = np.linalg.norm(p - model.poses(HELD_OUT)[:, :3, 3], axis=1).mean()
            row += [after, chi]
        rows.append(row)
    table = np.array(rows)
    before, random, chi_random, designed, chi_designed = np.median(table, axis=0)
    low, high = np.quantile(table[:, 0], [0.05, 0.95])
    mm = 1e3
    return Outcome(
        before * mm, low * mm, high * mm, random * mm, designed * mm, chi_random, chi_designed
    )
