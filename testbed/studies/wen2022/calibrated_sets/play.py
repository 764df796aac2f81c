"""Every designed set among random sets of its size: each measured once, calibrated and judged.

The random sets are those whose indices the record ``random_sets`` has. Both estimators fit the
paper's numbers from the nominal robot. Like `play`, this module uses the truth.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.design import random_selection
from calib.errors import CalibError
from calib.geometry.frames import target_points
from calib.identification.fit_each import Fits, fit_each
from calib.identification.many.tables import ManyTables
from calib.information.observability import index_of_singular
from calib.information.rank import singular_values
from calib.measurement.accuracy import point_distances
from calib.measurement.observations import Measurements
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import TrialSettings
from testbed.streams import stream
from testbed.studies.protocol import Records
from testbed.studies.trial.compare import measured_distance
from testbed.studies.trial.records import Trial
from testbed.studies.wen2022.calibrated_sets.records import (
    INDICES,
    AgainstRandom,
    CalibratedSets,
    RandomCalibrations,
)
from testbed.studies.wen2022.records import ESTIMATORS


def random_calibrations(
    scenario: Scenario, setting: Setting, needed: Records, piece: int
) -> RandomCalibrations:
    """The set of one designed trial, as measured there, among random ones; one piece per trial."""
    bench, settings = open_laboratory(scenario, setting), scenario.designed[piece]
    name, trial = settings.name, needed.get(settings.name, Trial)
    sets = drawn_sets(scenario, settings, len(setting.pool_q))
    names = ("random_calibrations", name)
    visits = bench.pool_visits(sets, *names, count=len(sets)) or [
        bench.measure_pool(chosen, *names, repeat=k) for k, chosen in enumerate(sets)
    ]
    designed, nothing = calibrated(bench, trial.selection.indices[None], [trial.measurements])
    random, failed = calibrated(bench, sets, visits)
    if nothing or not len(random.indices):
        raise CalibError(
            f"{name} and random sets of its size cannot be compared: "
            f"{'; '.join(nothing or failed[:1])}",
            code="T1",
            field=name,
        )
    one = AgainstRandom(name, settings.poses, settings.criterion, designed, random, failed)
    before = held_out_errors(setting, [setting.nominal.poses(setting.test_q)])
    return RandomCalibrations(float(before[0]), (one,))


def gather(parts: Sequence[RandomCalibrations]) -> RandomCalibrations:
    """The trials of all parts."""
    return RandomCalibrations(parts[0].before, tuple(one for part in parts for one in part.sets))


def drawn_sets(scenario: Scenario, settings: TrialSettings, pool: int) -> Index:
    """Random sets (k, m) of a trial's size, those of the record ``random_sets``."""
    rng = stream(scenario.seed, "random_sets", settings.name)
    count = scenario.studies.random_sets
    return np.array([random_selection(pool, settings.poses, rng) for _ in range(count)])


def calibrated(
    bench: Laboratory, sets: Index, visits: Sequence[Measurements] | ManyTables
) -> tuple[CalibratedSets, tuple[str, ...]]:
    """Calibrate sets (K, m) from one visit each; also a sentence for each without an estimate."""
    setting, free = bench.setting, bench.free("paper")
    fits = [fit_each(setting.nominal, visits, free, mode=mode) for mode in ESTIMATORS]
    good = np.logical_and.reduce([found.converged for found in fits])
    kept = [k for k, fine in enumerate(good) if fine]
    seen = [visits.one(k) if isinstance(visits, ManyTables) else visits[k] for k in kept]
    blocks = bench.design_blocks("paper")
    singular = np.array(
        [singular_values(blocks[chosen].reshape(-1, blocks.shape[-1])) for chosen in sets[good]]
    ).reshape(-1, blocks.shape[-1])
    found = CalibratedSets(
        indices=sets[good],
        index=np.array([index_of_singular(singular, sets.shape[1], name) for name in INDICES]),
        own_before=np.array([measured_distance(table, setting.nominal).mean() for table in seen]),
        own_after=np.array(
            [
                [
                    measured_distance(table, one.models[k]).mean()
                    for k, table in zip(kept, seen, strict=True)
                ]
                for one in fits
            ]
        ),
        error=np.array(
            [
                held_out_errors(setting, [one.models[k].poses(setting.test_q) for k in kept])
                for one in fits
            ]
        ),
    )
    return found, tuple(lost(fits, int(k)) for k in np.flatnonzero(~good))


def held_out_errors(setting: Setting, predicted: Sequence[Array]) -> Array:
    """Mean distance (K,) of predicted poses (t, 4, 4) each to the true held-out points [m]."""
    true = target_points(setting.test_true, setting.target)
    return np.array(
        [point_distances(true, target_points(T, setting.target)).mean() for T in predicted]
    )


def lost(fits: Sequence[Fits], k: int) -> str:
    """Sentence on a set without an estimate, and the reason."""
    mode, found = next(
        (mode, found)
        for mode, found in zip(ESTIMATORS, fits, strict=True)
        if not found.converged[k]
    )
    return f"set {k + 1}, {mode}: the fit {found.status[k].value}"
