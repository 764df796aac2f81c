"""The choice between geometry alone and joint errors: by evidence, confirmed at poses left out."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.identification.climbing import ASKED
from calib.identification.folds import parts_of, some_poses
from calib.identification.identify import Status, identify
from calib.identification.joint_models import extended_model, shared_waves
from calib.identification.ladders import ladders_of
from calib.identification.levels import with_errors
from calib.identification.model_choice import choose, extended_by, reason_of
from calib.identification.prior import Prior, weak_prior
from calib.measurement.observations import joined
from calib.measurement.residual import linearize
from calib.measurement.tables import poses as poses_of
from tests.calib.identification.test_joint_models import GOALS, MDEG, POOL, bent, seen
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, WEN24, rigid_truth, tx60
from tests.truth.measuring import measured


@pytest.mark.slow
@pytest.mark.parametrize("free", [WEN24, None], ids=["24", "42"])
@pytest.mark.parametrize("m", [29, 61])
def test_a_bent_robot_asks_for_the_extended_model_and_a_rigid_one_does_not(free, m):
    seed = m % 3
    rigid = rigid_truth(np.random.default_rng(seed))
    for truth, expected in ((bent(seed), "extended"), (rigid, "geometric")):
        choice = choose(tx60(), seen(truth, m, seed), parameters_of(tx60(), free))
        assert choice.chosen == expected
        assert choice.identification is choice.identifications[expected == "extended"]
        assert all(found.status is Status.CONVERGED for found in choice.identifications)
        assert choice.sentence.startswith(expected)
        off = choice.identification.model.poses(GOALS)[:, :3, 3] - truth.poses(GOALS)[:, :3, 3]
        assert np.linalg.norm(off, axis=1).mean() < 0.03e-3


def test_log_evidence_is_the_ratio_of_the_densities_of_the_measurements():
    """Near the nominal robot all is linear: two normal densities, written out."""
    table = measured(tx60(), POOL[:12], np.random.default_rng(1))
    parameters, tight = parameters_of(tx60()), weak_prior(parameters_of(tx60()))
    prior = Prior(tight.mean, 1e-2 * tight.sd, tight.names)
    ladders = [
        replace(one, levels=tuple(replace(level, sd=1e-2 * level.sd) for level in one.levels))
        for one in ladders_of(tx60())
    ]
    choice = choose(tx60(), table, parameters, prior=prior, ladders=ladders)
    scale = choice.climb.noise_factor
    levels = {level.name: level for ladder in ladders for level in ladder.levels}
    for offer in choice.climb.offered:
        if np.isnan(offer.gain):  # what gravity never bends
            continue
        level = levels[offer.level]
        wide, density = with_errors(tx60(), level.errors), []
        stack = linearize(wide, table)
        for k, sd in ((42, prior.sd), (42 + len(level.sd), np.append(prior.sd, level.sd))):
            B, r = stack.A[:, :k] * sd / scale, stack.r / scale
            C = np.eye(len(B)) + B @ B.T
            density.append(-(r @ np.linalg.solve(C, r) + np.linalg.slogdet(C)[1]) / 2)
        assert offer.gain == pytest.approx(density[1] - density[0], abs=1e-3)


def test_a_robot_with_joint_errors_of_its_own_is_called_so():
    """What its file holds stays, whether the measurements ask for more or not."""
    truth = rigid_truth(np.random.default_rng(4))
    choice = choose(tx60(), seen(truth, 29, 4), parameters_of(tx60(), WEN24))
    assert "do not support joint errors (log" in choice.sentence
    own = reason_of(choice.climb, bent(4)).sentence
    assert own == choice.sentence.replace("joint errors", "joint errors beyond the robot's own")


def test_few_poses_confirm_nothing():
    """The evidence asks, and on a measured UR10 was wrong: 0.9 mm before, 82 mm after."""
    choice = choose(tx60(), seen(bent(2), 19, 3))
    assert choice.chosen == "geometric"
    assert choice.climb.steps[0].gain > ASKED
    assert choice.sentence.endswith("but fewer than 20 poses cannot confirm any")


def test_the_wave_that_stands_twice_is_reported_as_its_sum():
    """sin q2 is sag and harmonic: each alone is half prior, the sum is known."""
    truth = bent(5)
    choice = choose(tx60(), seen(truth, 150, 7), parameters_of(tx60(), WEN24))
    found = choice.identifications[1]
    (sentence,) = shared_waves(found)
    assert sentence.startswith("gravity2.upper and harmonic2.sin1 are the same wave")
    names = ("gravity2.upper", "harmonic2.sin1")
    own = [found.standard_uncertainty[found.names.index(n)] for n in names]
    stated = truth.joint_errors.names
    total = sum(truth.joint_errors.coefficients[stated.index(n)] for n in names) / MDEG
    value, sd = (float(word) for word in sentence.replace(" mdeg", "").split() if _is_number(word))
    assert abs(value - total) < 4 * sd
    assert 3 * sd * MDEG < min(own)
    assert shared_waves(choice.identifications[0]) == ()


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def test_a_gross_error_does_not_call_for_more_terms():
    """Three poses off by a millimeter; a robust fit stays geometric and names them."""
    table = seen(rigid_truth(np.random.default_rng(6)), 61, 8)
    position = table.position.copy()
    position[[3, 30, 50]] += [[1e-3, 0, 0], [0, -1e-3, 0], [0, 1e-3, 1e-3]]
    choice = choose(tx60(), replace(table, position=position), loss="cauchy")
    assert choice.chosen == "geometric"
    named = [note for note in choice.identification.notes if "does not fit the others" in note]
    assert {note.split()[1] for note in named} == {"3", "30", "50"}


def test_gross_errors_hide_no_bend_from_a_robust_choice():
    """Four poses of sixty off by 5 mm: the noise is that of the others."""
    table = seen(bent(6), 60, 8)
    position = table.position.copy()
    position[[3, 17, 30, 50]] += np.random.default_rng(2).normal(size=(4, 3)) * 5e-3
    choice = choose(tx60(), replace(table, position=position), loss="cauchy")
    assert choice.chosen == "extended"
    assert choice.climb.noise_factor < 2
    off = choice.identification.model.poses(GOALS)[:, :3, 3] - bent(6).poses(GOALS)[:, :3, 3]
    assert np.linalg.norm(off, axis=1).mean() < 0.03e-3


def test_where_nothing_was_seen_the_prior_speaks_with_its_own_width_whatever_the_noise():
    table = seen(bent(3), 60, 4)
    q = table.q.copy()
    q[:, 5] = 0.3
    table = poses_of(q, bent(3).poses(q), sd=(SIGMA_POSITION, SIGMA_ROTATION))
    ladder = ladders_of(tx60())[1]
    (waves,) = [level for level in ladder.levels if level.usual]
    prior = weak_prior(parameters_of(tx60()))
    for factor in (1.0, 5.0):
        _, found = extended_by(
            tx60(), table, parameters_of(tx60()), [waves], prior=prior, factor=factor
        )
        at = [found.names.index(f"harmonic6.{name}") for name in ("sin1", "cos2")]
        own = [sd for t, sd in zip(waves.errors.terms, waves.sd, strict=True) if t.name in
               ("harmonic6.sin1", "harmonic6.cos2")]  # fmt: skip
        # one number of theta6 and tool is learned of each by the orientation
        assert found.standard_uncertainty[at] == pytest.approx(np.array(own), rel=0.25)


def test_rows_of_one_pose_are_left_out_together_and_many_poses_thinned():
    table = seen(tx60(), 30, 5)
    visits = joined(
        [replace(table, q=table.q + 1e-9 * k, repeat=table.repeat + k) for k in range(4)]
    )
    part = parts_of(visits, np.random.default_rng(1))
    assert all(len(set(part[visits.pose_id == pose])) == 1 for pose in range(30))
    assert parts_of(visits.rows(visits.pose_id < 19), np.random.default_rng(1)) is None
    few = some_poses(visits, np.random.default_rng(1), 12)
    assert (few.n_poses, len(few)) == (12, 48)
    assert some_poses(visits, np.random.default_rng(1)) is visits


def test_the_extended_fit_is_under_the_same_geometric_prior():
    choice = choose(tx60(), seen(bent(7), 29, 9))
    geometric, extended = (found.prior for found in choice.identifications)
    assert geometric is not None
    assert extended is not None
    assert extended.names[:42] == geometric.names
    np.testing.assert_array_equal(extended.precision[:42, :42], geometric.precision)
    assert not extended.precision[:42, 42:].any()


def refused(**more) -> InputError:
    with pytest.raises(InputError) as caught:
        choose(tx60(), seen(tx60(), 29, 10), **more)
    return caught.value


def test_evidence_needs_a_prior_of_every_number():
    error = refused(prior=weak_prior(parameters_of(tx60(), WEN24)))
    assert (error.code, error.field) == ("A3", "prior")
    assert "base.x is free and has no prior" in str(error)


def test_a_model_that_has_some_terms_already_is_offered_the_others():
    choice = choose(extended_model(tx60()), seen(tx60(), 29, 12))
    assert choice.chosen == "geometric"
    bends = [one for one in choice.climb.offered if one.ladder in ("gravity", "waves")]
    offered = {offer.level: offer.outcome for offer in bends}
    assert offered.pop("sag") == "not offered: the model has it already"
    assert set(offered) == {"waves 1 to 4", "joint map with small waves"}


def test_progress_is_told_for_both_fits():
    told: list[int] = []
    choice = choose(tx60(), seen(bent(8), 29, 13), report=lambda k, _cost: told.append(k))
    steps = [found.iterations for found in choice.identifications]
    assert told == [k for count in steps for k in range(1, count + 1)]


def test_an_extended_fit_of_few_poses_is_held_by_its_prior():
    """Five poses give 30 equations for 69 numbers."""
    wide = extended_model(tx60())
    parameters = parameters_of(wide)
    found = identify(wide, seen(bent(9), 5, 14), parameters, prior=weak_prior(parameters, wide))
    assert found.status is Status.CONVERGED
    assert found.rank == 69
    assert (found.standard_uncertainty <= weak_prior(parameters, wide).sd * (1 + 1e-9)).all()
