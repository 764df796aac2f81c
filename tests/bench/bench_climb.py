"""Speed of the choice of a model, beside whole fits of every level; run by hand.

``pytest tests/bench/bench_climb.py --benchmark-only``, one thread. Aim: the climb costs less than
one fit of the model that it finds.
"""

import numpy as np
import pytest

from calib.geometry.parameters import parameters_of
from calib.identification.climb import climb
from calib.identification.identify import identify
from calib.identification.ladders import ladders_of
from calib.identification.model_choice import choose, extended_by
from calib.identification.prior import weak_prior
from tests.calib.identification.test_climb import mapped
from tests.calib.identification.test_joint_models import seen
from tests.reference import tx60

POSES = 100
PARAMETERS = parameters_of(tx60())
PRIOR = weak_prior(PARAMETERS)


@pytest.fixture(scope="module")
def table():
    """Poses of a robot whose joints turn beside their commands by fast waves."""
    return seen(mapped(1, size=4.0), POSES, 2)


@pytest.mark.benchmark(group="choice of a model, 100 poses")
def test_climb_about_one_linear_system(benchmark, table):
    near = identify(tx60(), table, PARAMETERS, prior=PRIOR).model
    part = np.arange(POSES) % 4
    benchmark(climb, tx60(), near, table, PARAMETERS, ladders_of(tx60()), part, prior=PRIOR)


@pytest.mark.benchmark(group="choice of a model, 100 poses")
def test_choice_with_both_fits(benchmark, table):
    benchmark(choose, tx60(), table)


@pytest.mark.benchmark(group="choice of a model, 100 poses")
def test_whole_fits_of_every_level_and_fold(benchmark, table):
    """One round of a climb by brute force: each level from all poses, the best in four folds."""
    levels = [level for ladder in ladders_of(tx60()) for level in ladder.levels[1:]]
    rests = [table.rows(np.arange(POSES) % 4 != k) for k in range(4)]

    def whole():
        found = [extended_by(tx60(), table, PARAMETERS, [one], prior=PRIOR)[1] for one in levels]
        best = levels[int(np.argmax([each.log_evidence for each in found]))]
        return [extended_by(tx60(), rest, PARAMETERS, [best], prior=PRIOR) for rest in rests]

    benchmark.pedantic(whole, rounds=2)
