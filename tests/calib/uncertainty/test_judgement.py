"""The one proof: the same numbers as its parts, none where they decide nothing, and short words."""

import dataclasses

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.measurement.observations import joined
from calib.uncertainty.bootstrap import bootstrap
from calib.uncertainty.conformal import conformal
from calib.uncertainty.discrepancy import discrepancy
from calib.uncertainty.held_out import held_out
from calib.uncertainty.judgement import judge
from calib.uncertainty.trust import trust
from tests.reference import WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured


def measured_tables(count=40):
    """A fit, what it was identified from, and what was held out; all of one robot."""
    rng = np.random.default_rng(3)
    truth = rigid_truth(rng)
    train = measured(truth, pool_r()[:29], rng)
    test = measured(truth, pool_r(count, seed=99), rng)
    return identify(tx60(), train, parameters_of(tx60(), WEN24)), train, test


def test_a_judgement_is_what_its_parts_are_to_the_last_bit():
    fit, train, test = measured_tables()
    made = judge(fit, test, train=train, rng=np.random.default_rng(5), replicates=100)
    seen = held_out(fit.model, fit.full_covariance, test, train.q)
    played = bootstrap(fit.model, train, fit.parameters, np.random.default_rng(5), replicates=100)
    spread, ball = discrepancy(seen), conformal(seen.distance)
    assert made.held_out.chi_square == seen.chi_square
    assert np.array_equal(made.discrepancy.covariance, spread.covariance)
    assert made.conformal == ball
    assert np.array_equal(made.bootstrap.estimates, played.estimates)
    wanted = trust(fit, held_out=seen, discrepancy=spread, conformal=ball, bootstrap=played)
    assert made.trust == wanted


def test_several_rows_of_a_pose_count_once_by_the_worst():
    fit, train, test = measured_tables()
    again = dataclasses.replace(test, position=test.position + 1e-3)
    once, twice = judge(fit, again), judge(fit, joined([test, again]))
    assert len(twice.held_out) == 40
    assert twice.conformal == once.conformal
    assert twice.held_out.chi_square == judge(fit, test, train=train).held_out.chi_square


def test_virtual_calibrations_are_played_only_where_they_decide_anything():
    fit, train, test = measured_tables()

    def played(fit, **options):
        rng = np.random.default_rng(5)
        return judge(fit, test, train=train, rng=rng, replicates=100, **options).bootstrap

    assert judge(fit, test, train=train).bootstrap is None
    assert played(fit) is not None
    for rejected in ({"status": Status.LIMIT}, {"p_value": 0.0}):
        changed = dataclasses.replace(fit, **rejected)
        assert played(changed) is None
        assert played(changed, rejected_too=True) is not None
    robust = dataclasses.replace(fit, loss="cauchy")
    assert played(robust, rejected_too=True) is None
    with pytest.raises(InputError, match="virtual calibrations need the table"):
        judge(fit, test, rng=np.random.default_rng(5))


@pytest.mark.parametrize(
    ("count", "spread", "ball"), [(9, False, False), (10, True, False), (19, True, True)]
)
def test_what_too_few_poses_cannot_state_is_left_out(count, spread, ball):
    fit, train, test = measured_tables(count)
    made = judge(fit, test, train=train)
    assert (made.discrepancy is not None, made.conformal is not None) == (spread, ball)


def test_no_pose_of_the_identification_may_judge_it():
    fit, train, _ = measured_tables()
    with pytest.raises(InputError, match="pose 0 of the identification"):
        judge(fit, train, train=train)


def test_words_are_short_in_a_shell_and_whole_in_a_summary():
    fit, train, test = measured_tables()
    made = judge(fit, test, train=train)
    assert repr(made).startswith("Judgement(believe='model', held-out poses: 40, conformal radius:")
    lines = made.summary().splitlines()
    assert [line.split(":")[0] for line in lines[:4]] == [
        "held-out poses",
        "discrepancy",
        "conformal radius",
        "believe",
    ]
    assert lines[-1] == made.trust.sentence
    nothing = judge(fit, test.rows(np.zeros(40, dtype=bool)))
    assert repr(nothing) == "Judgement(believe='model', held-out poses: 0, conformal radius: none)"
