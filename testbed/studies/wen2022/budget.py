"""The budget of Wen et al. 2022 on the one robot of the campaign, by the paper's estimator."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.identification.identify import Identification, Mode, identify
from calib.identification.many.fit import fit_many
from calib.measurement.observations import Measurements
from calib.uncertainty.type_a import best_budget, location_regions, random_budget
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import BudgetSettings
from testbed.streams import stream
from testbed.studies.protocol import Records
from testbed.studies.trial.records import Trial
from testbed.studies.wen2022.paper_set import designed_trials
from testbed.studies.wen2022.records import PaperBudget, environment
from testbed.units import counted, listed

FEWEST_LOCAL = 10
"""Fewest poses of a region; with fewer, their choice matters more than the place."""


def fitted(laboratory: Laboratory, seen: Measurements, mode: Mode = "paper") -> Identification:
    """The paper's numbers from one table."""
    return identify(laboratory.setting.nominal, seen, laboratory.free("paper"), mode=mode)


def steps_of(
    laboratory: Laboratory, sets: Sequence[Index], *names: str | int, pose_time: float = 0.0
) -> Array:
    """Estimates (k, f) of the paper's estimator from one visit of each set [m or rad].

    Visits follow each other in time, `pose_time` a pose [s]. Sets of one size are visited and
    fitted all at once if arrays can express them; otherwise one by one.
    """
    free, size = laboratory.free("paper"), len(sets[0])
    if all(len(chosen) == size for chosen in sets) and 6 * size > free.n_free:
        same = all(np.array_equal(chosen, sets[0]) for chosen in sets)
        own = np.array(sets[:1] if same else sets)
        tables = laboratory.pool_visits(own, *names, count=len(sets), span=size * pose_time)
        if tables is not None:
            fits = fit_many(laboratory.setting.nominal, tables, free, mode="paper")
            if fits.converged.all():
                return fits.steps
    visits = (
        laboratory.measure_pool(chosen, *names, repeat=k, start=k * len(chosen) * pose_time)
        for k, chosen in enumerate(sets)
    )
    return np.array([fitted(laboratory, seen).step for seen in visits])


def regions_of(setting: Setting, budget: BudgetSettings) -> list[Index]:
    """Places in the pool of the poses in each of the four regions."""
    x, y = budget.location_border_mm
    regions = location_regions(setting.pool_nominal[:, :3, 3], (x / 1e3, y / 1e3))
    return [np.flatnonzero(regions == region) for region in range(4)]


def location_sets(
    setting: Setting, budget: BudgetSettings, rng: np.random.Generator
) -> list[Index]:
    """One random set from each of the four regions of the pool, whose estimates give u_w.

    With the paper's own number, 50 poses, a smaller region gives all that it has.
    """
    (x, y), wanted, sets = budget.location_border_mm, budget.location_poses, list[Index]()
    usual = BudgetSettings().location_poses
    for region, members in enumerate(regions_of(setting, budget), 1):
        count, why, lower = len(members), "", ""
        if count < FEWEST_LOCAL:
            why = "too few to calibrate there and see how the place matters"
        elif count < wanted != usual:
            why, lower = f"and [budget] location_poses asks for {wanted}", "choose fewer, "
        if why:
            raise refuse(
                "pool.box_size_mm",
                count,
                code="M27",
                message=f"region {region} of the pool has {counted(count, 'pose')}, {why}",
                fix=f"{lower}enlarge [pool] size, or let the box reach over x = {x:g} mm and "
                f"y = {y:g} mm ([budget] location_border_mm)",
            )
        sets.append(rng.choice(members, min(wanted, count), replace=False))
    return sets


def fewer_than_usual(setting: Setting, budget: BudgetSettings) -> str:
    """The random sets of the paper that a small pool cannot provide, in words; empty if none."""
    n, told = len(setting.pool_q), list[str]()
    if large := sorted(size for size in {budget.poses, *budget.pose_numbers} if size > n):
        told.append(f"sets of {listed([str(size) for size in large])} poses are all {n} of it")
    counts = [len(members) for members in regions_of(setting, budget)]
    if min(counts) < budget.location_poses:
        have = listed([str(min(count, budget.location_poses)) for count in counts])
        told.append(f"the regions have {have} poses instead of {budget.location_poses}")
    return f"The pool is small: {' and '.join(told)}." if told else ""


def repeats_of(trial: Trial) -> Array:
    """Steps (v, f) of the paper's estimator from every visit of a trial's poses [m or rad]."""
    return next(one.repeated for one in trial.estimates if one.mode == "paper")


def paper_budget_study(scenario: Scenario, setting: Setting, needed: Records) -> PaperBudget:
    """The paper's uncertainty budget: repeats, number and location of poses, designed and random.

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

    best = [best_budget(repeats_of(needed.get(name, Trial)), u_c) for name in trials]
    random = random_budget(
        steps_of(bench, [one] * scenario.uncertainty.repeats, "paper_budget", "repeats"),
        steps_of(bench, sized, "paper_budget", "pose_number"),
        steps_of(bench, local, "paper_budget", "location"),
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
