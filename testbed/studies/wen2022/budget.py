"""The budget of Wen et al. 2022 on the one robot of the campaign, by the paper's estimator."""

import numpy as np

from calib.arrays import Array, Index
from calib.identification.identify import Identification, Mode, identify
from calib.measurement.observations import Measurements
from calib.uncertainty.type_a import (
    LOCATION_POSES,
    POSE_NUMBERS,
    best_budget,
    location_regions,
    random_budget,
)
from testbed.laboratory.truth.laboratory import Laboratory, Setting, open_laboratory
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.protocol import Records
from testbed.studies.trial.records import Trial
from testbed.studies.wen2022.paper_set import designed_trials
from testbed.studies.wen2022.records import PaperBudget

RANDOM_BUDGET_POSES = 50
"""Poses of the random set whose repeats give u_r (Wen et al. 2022)."""


def fitted(laboratory: Laboratory, seen: Measurements, mode: Mode = "paper") -> Identification:
    """The paper's numbers from one table."""
    return identify(laboratory.setting.nominal, seen, laboratory.free("paper"), mode=mode)


def region_members(setting: Setting) -> list[Index]:
    """Places in the pool of the poses in each of the four regions."""
    regions = location_regions(setting.pool_nominal[:, :3, 3])
    return [np.flatnonzero(regions == region) for region in range(4)]


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
    one = rng.choice(n, min(RANDOM_BUDGET_POSES, n), replace=False)
    local = [
        rng.choice(members, min(LOCATION_POSES, len(members)), replace=False)
        for members in region_members(setting)
    ]
    sized = [rng.choice(n, min(size, n), replace=False) for size in POSE_NUMBERS]

    def estimates(sets: list[Index], name: str) -> Array:
        """Steps (k, f) of the paper's estimator, one visit of each set."""
        visits = (bench.measure_pool(p, "paper_budget", name, repeat=k) for k, p in enumerate(sets))
        return np.array([fitted(bench, seen).step for seen in visits])

    best = [best_budget(repeats_of(needed.get(name, Trial))) for name in trials]
    random = random_budget(
        estimates([one] * scenario.uncertainty.repeats, "repeats"),
        estimates(sized, "pose_number"),
        estimates(local, "location"),
    )
    return PaperBudget(
        names=bench.free("paper").free_names,
        trials=trials,
        best_repeatability=np.array([one.repeatability for one in best]),
        repeatability=random.repeatability,
        pose_number=random.pose_number,
        location=random.location,
        best=np.array([one.combined for one in best]),
        random=random.combined,
    )
