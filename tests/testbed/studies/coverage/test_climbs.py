"""Robots of a study climb together as each of them does alone, of every kind."""

import numpy as np
import pytest

from calib.identification.climb import climb
from calib.identification.folds import parts_of
from calib.identification.many.climb import climb_many
from calib.identification.many.single import identify_many
from calib.identification.prior import weak_prior
from calib.kernels.loops import MANY_SPRUNG
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.streams import stream
from testbed.studies import load_scenario
from testbed.studies.coverage.visits import measure_robots, poses_of
from testbed.studies.trial.play import criterion_of, select
from tests.calib.identification.test_many_climb import held_to

ROBOTS = range(8)


@pytest.mark.study
@pytest.mark.parametrize("robots", [len(ROBOTS), MANY_SPRUNG])
@pytest.mark.parametrize(
    "kind", ["rigid", "wen2022", "soft", "elastic", "drives", "unmodelled", "slight"]
)
def test_robots_of_a_kind_climb_as_each_does_alone(kind, robots):
    """Whole ladders, at the poses of the shipped scene; as some of few and of many."""
    scenario = load_scenario("coverage")
    bench, trial = open_laboratory(scenario, make_setting(scenario)), scenario.trial[0]
    random, criterion = stream(scenario.seed, "select", trial.name), criterion_of(bench, trial)
    chosen = select(bench.design_blocks(trial.rows), trial, random, criterion).indices
    poses = [poses_of(bench, k) for k in ROBOTS]
    seen = [one.seen for one in measure_robots(bench, kind, chosen, ROBOTS, poses)]
    nominal, free, ladders = bench.setting.nominal, bench.free("whitened"), bench.ladders
    prior = weak_prior(free, nominal)
    near = [one.model for one in identify_many(nominal, seen, free, prior=prior)]
    found = climb_many(nominal, near, seen, free, ladders, prior=prior, robots=robots)
    for one, model, table in zip(found, near, seen, strict=True):
        part = parts_of(table, np.random.default_rng(0))
        alone = climb(nominal, model, table, free, ladders, part, prior=prior)
        held_to(one, alone, table.q)
