"""The budget of Wen et al. 2022 on the one robot of the campaign, by the paper's estimator."""

import numpy as np

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.identification.identify import Identification, Mode, identify
from calib.measurement.observations import Measurements
from calib.uncertainty.type_a import best_budget, location_regions, random_budget
from testbed.laboratory.truth.laboratory import Laboratory, Setting, open_laboratory
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import BudgetSettings
from testbed.streams import stream
from testbed.studies.protocol import Records
from testbed.studies.trial.records import Trial
from testbed.studies.wen2022.paper_set import designed_trials
from testbed.studies.wen2022.records import PaperBudget, environment

FEWEST_LOCAL = 10
"""Poses in a region below which its calibration says more of their choice than of the place."""


def fitted(laboratory: Laboratory, seen: Measurements, mode: Mode = "paper") -> Identification:
    """The paper's numbers from one table."""
    return identify(laboratory.setting.nominal, seen, laboratory.free("paper"), mode=mode)


def location_sets(
    setting: Setting, budget: BudgetSettings, rng: np.random.Generator
) -> list[Index]:
    """One random set from each of the four regions of the pool, whose estimates give u_w."""
    x, y = budget.location_border_mm
    regions, sets = location_regions(setting.pool_nominal[:, :3, 3], (x / 1e3, y / 1e3)), []
    for region in range(4):
        members = np.flatnonzero(regions == region)
        if len(members) < FEWEST_LOCAL:
            raise refuse(
                "pool.box_size_mm",
                len(members),
                code="M27",
                message=f"region {region + 1} of the pool has {len(members)} poses, too few to "
                "calibrate there and see how the place matters",
                fix=f"enlarge [pool] size, or let the box reach over x = {x:g} mm and y = {y:g} mm "
                "([budget] location_border_mm)",
            )
        count = min(budget.location_poses, len(members))
        sets.append(rng.choice(members, count, replace=False))
    return sets


def repeats_of(trial: Trial) -> Array:
    """Steps (v, f) of the paper's estimator from every visit of a trial's poses [m or rad]."""
    return next(one.repeated for one in trial.estimates if one.mode == "paper")


def paper_budget_study(scenario: Scenario, setting: Setting, needed: Records) -> PaperBudget:
    """The paper's contributors: repeats, number of poses, location; designed sets against random.

    The repeats of a designed set are those of its trial, first visit included.

    References
    ----------
    Wen et al. 2022, eqs. (7) to (9).
    """
    bench, n = open_laboratory(scenario, setting), len(setting.pool_q)
    trials = designed_trials(scenario)
    rng = stream(scenario.seed, "paper_budget", "sets")
    constants, names = scenario.budget, bench.free("paper").free_names
    u_c = environment(constants, names)
    one = rng.choice(n, min(constants.poses, n), replace=False)
    local = location_sets(setting, constants, rng)
    sized = [rng.choice(n, min(size, n), replace=False) for size in constants.pose_numbers]

    def estimates(sets: list[Index], name: str) -> Array:
        """Steps (k, f) of the paper's estimator, one visit of each set."""
        visits = (bench.measure_pool(p, "paper_budget", name, repeat=k) for k, p in enumerate(sets))
        return np.array([fitted(bench, seen).step for seen in visits])

    best = [best_budget(repeats_of(needed.get(name, Trial)), u_c) for name in trials]
    random = random_budget(
        estimates([one] * scenario.uncertainty.repeats, "repeats"),
        estimates(sized, "pose_number"),
        estimates(local, "location"),
        u_c,
    )
    return PaperBudget(
        names=names,
        trials=trials,
        best_repeatability=np.array([one.repeatability for one in best]),
        repeatability=random.repeatability,
        pose_number=random.pose_number,
        location=random.location,
        environment=random.environment,
        best=np.array([one.combined for one in best]),
        random=random.combined,
    )
