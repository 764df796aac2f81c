"""The extended model and the choice between it and geometry alone."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import rot_x, rot_y
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.identification.joint_models import (
    ASKED,
    choose,
    extended_model,
    extended_parameters,
    gravity_is_closed,
    shared_waves,
)
from calib.identification.prior import Prior, weak_prior
from calib.measurement.observations import Measurements
from calib.measurement.residual import stacked
from tests.reference import DEG, TX60_LINKS, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

POOL = pool_r()
GOALS = pool_r(300, seed=99)
MDEG = 1e-3 * DEG


def bent(seed: int) -> RobotModel:
    """A true robot with sag of 10, 6, 8 mdeg and harmonics of some 6 mdeg."""
    rng = np.random.default_rng(seed)
    size = np.array([10, 6, 8, *np.tile([6, 6, 3, 3], 6)]) * MDEG
    size[3:] *= rng.uniform(-1.2, 1.2, 24)
    terms = JointErrors((*gravity_terms(6), *harmonic_terms(6)), size)
    return RobotModel(rigid_truth(rng).chain, terms)


def seen(truth: RobotModel, m: int, seed: int, first: int = 0) -> Measurements:
    return measured(truth, POOL[first : first + m], np.random.default_rng(seed))


def test_the_extended_model_has_27_terms_and_moves_nothing():
    wide = extended_model(tx60())
    assert wide.n_numbers == 42 + 27
    assert wide.names[42:45] == ("gravity2.upper", "gravity2.fore", "gravity3.fore")
    assert wide.names[45:49] == tuple(f"harmonic1.{w}" for w in ("sin1", "cos1", "sin2", "cos2"))
    np.testing.assert_array_equal(wide.poses(POOL[:20]), tx60().poses(POOL[:20]))


def test_terms_already_known_are_kept_and_not_doubled():
    known = JointErrors(gravity_terms(6), np.array([1, 2, 3]) * MDEG)
    wide = extended_model(RobotModel(tx60().chain, known))
    assert len(wide.joint_errors.terms) == 27
    np.testing.assert_array_equal(wide.joint_errors.coefficients[:3], known.coefficients)
    assert extended_model(wide).names == wide.names


def with_base(T) -> Chain:
    return Chain(TX60_LINKS, T_world_base=T)


@pytest.mark.parametrize(
    ("chain", "closed"),
    [
        (Chain(TX60_LINKS), True),
        (with_base(rot_x(0.5 * DEG)), True),
        (with_base(rot_x(5 * DEG)), False),
        (with_base(rot_x(180 * DEG)), True),
        (with_base(rot_y(90 * DEG)), False),
        (Chain(TX60_LINKS[:2]), False),
        (Chain(TX60_LINKS * ([1, 1, 0, 1, 1])), False),
        (Chain(TX60_LINKS, ("revolute", "prismatic", *["revolute"] * 4)), False),
        (Chain(TX60_LINKS + np.pi * (np.arange(30) == 8).reshape(6, 5)), False),
    ],
    ids=[
        "tx60",
        "tilted a little",
        "tilted",
        "hanging",
        "on a wall",
        "two joints",
        "no upper arm",
        "rail",
        "flip",
    ],
)
def test_gravity_is_added_only_where_its_closed_form_holds(chain, closed):
    assert gravity_is_closed(chain) is closed
    names = extended_model(RobotModel(chain)).joint_errors.names
    assert ("gravity2.upper" in names) is closed


def test_the_closed_form_is_the_torque_of_weights_on_the_arm():
    """Torque on joints 2 and 3 by virtual work: -d(height)/dq of two masses, by differences."""
    chain, q = tx60().chain, POOL[:30]

    def heights(at):
        """World heights of a point halfway up the arm and of the wrist."""
        fore = Chain(chain.links[:4]).links.copy()
        elbow = RobotModel(Chain(chain.links[:2])).poses(at[:, :2])[:, 2, 3]
        wrist = RobotModel(Chain(fore)).poses(at[:, :4])[:, 2, 3]
        return np.stack([elbow, wrist])

    step = np.zeros(6)
    # d3 = 20 mm lies along the parallel axes and does not turn: pure sines remain
    for joint in (1, 2):
        step[:] = 0
        step[joint] = 1e-6
        drop = -(heights(q + step) - heights(q - step)) / 2e-6
        waves = np.stack([np.sin(q[:, 1]), np.sin(q[:, 1] + q[:, 2])], axis=1)
        for torque in drop:
            fit = np.linalg.lstsq(waves, torque)[0]
            assert np.abs(waves @ fit - torque).max() < 1e-9
            assert fit.min() > -1e-9


def test_prismatic_joints_have_no_harmonics():
    links = np.vstack([[0.0, 0, 0.1, -90 * DEG, 0.01], TX60_LINKS])
    wide = extended_model(RobotModel(Chain(links, ("prismatic", *["revolute"] * 6))))
    assert not any(name.startswith("harmonic1") for name in wide.names)
    assert sum(name.startswith("harmonic") for name in wide.names) == 24


def test_the_extended_table_frees_what_was_free_and_all_terms():
    wide = extended_model(tx60())
    table = extended_parameters(tx60(), wide, parameters_of(tx60(), WEN24, length=0.5))
    assert table.free_names == (*WEN24, *wide.names[42:])
    np.testing.assert_array_equal(table.scale, parameters_of(wide, length=0.5).scale)


@pytest.mark.parametrize("free", [WEN24, None], ids=["24", "42"])
@pytest.mark.parametrize("m", [29, 61])
def test_a_bent_robot_asks_for_the_extended_model_and_a_rigid_one_does_not(free, m):
    for seed in range(3):
        rigid = rigid_truth(np.random.default_rng(seed))
        for truth, expected in ((bent(seed), "extended"), (rigid, "geometric")):
            choice = choose(
                tx60(),
                seen(truth, m, seed),
                parameters_of(tx60(), free),
                held_out=seen(truth, 40, seed + 50, first=500),
            )
            assert choice.chosen == expected
            assert choice.identification is choice.identifications[expected == "extended"]
            assert all(found.status is Status.CONVERGED for found in choice.identifications)
            assert choice.sentence.startswith(f"{expected}: the measurements")
            assert "on 40 held-out poses the mean error goes from" in choice.sentence
            off = choice.identification.model.poses(GOALS)[:, :3, 3] - truth.poses(GOALS)[:, :3, 3]
            assert np.linalg.norm(off, axis=1).mean() < 0.03e-3


def test_log_evidence_is_the_ratio_of_the_densities_of_the_measurements():
    """Near the nominal robot all is linear: two normal densities, written out."""
    table = measured(tx60(), POOL[:12], np.random.default_rng(1))
    parameters, tight = parameters_of(tx60()), weak_prior(parameters_of(tx60()))
    prior = Prior(tight.mean, 1e-2 * tight.sd, tight.names)
    wide = extended_model(tx60())
    added = weak_prior(parameters_of(wide, wide.names[42:]))
    terms = Prior(added.mean, 1e-2 * added.sd, added.names)
    choice = choose(tx60(), table, parameters, prior=prior, term_prior=terms)
    stack, density = stacked(wide, table), []
    for k, sd in ((42, prior.sd), (69, np.concatenate([prior.sd, terms.sd]))):
        B = stack.A[:, :k] * sd
        C = np.eye(len(B)) + B @ B.T
        density.append(-(stack.r @ np.linalg.solve(C, stack.r) + np.linalg.slogdet(C)[1]) / 2)
    assert choice.log_evidence == pytest.approx(density[1] - density[0], abs=1e-3)


def test_held_out_poses_must_confirm_what_the_evidence_asks_for():
    """Judged by poses that the geometric fit itself foretells, the evidence is overruled."""
    table = seen(bent(2), 61, 3)
    alone = choose(tx60(), table)
    assert alone.chosen == "extended"
    assert alone.held_out_error.size == 0
    model = alone.identifications[0].model
    overruled = choose(tx60(), table, held_out=seen(model, 40, 4, first=500))
    assert overruled.chosen == "geometric"
    assert overruled.log_evidence > ASKED
    assert "the measurements ask for joint errors" in overruled.sentence
    assert ", but on 40 held-out poses" in overruled.sentence


def test_held_out_error_is_the_mean_distance_in_meters():
    held_out = seen(bent(4), 30, 5, first=500)
    choice = choose(tx60(), seen(bent(4), 29, 6), held_out=held_out)
    for found, error in zip(choice.identifications, choice.held_out_error, strict=True):
        gap = found.model.poses(held_out.q)[:, :3, 3] - held_out.position
        assert error == pytest.approx(np.linalg.norm(gap, axis=1).mean(), rel=1e-12)


def test_the_wave_that_stands_twice_is_reported_as_its_sum():
    """sin q2 is sag and harmonic: each alone is half prior, the sum is known."""
    truth = bent(5)
    choice = choose(tx60(), seen(truth, 150, 7), parameters_of(tx60(), WEN24))
    found = choice.identifications[1]
    (sentence,) = choice.notes
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


def test_held_out_poses_that_were_identified_from_are_refused():
    error = refused(held_out=seen(tx60(), 20, 11, first=28))
    assert (error.code, error.field) == ("A3", "held_out")
    assert "row 0 of the held-out poses is among those identified from" in str(error)
    assert refused(held_out=seen(tx60(), 0, 11)).field == "held_out"


def test_evidence_needs_a_prior_of_every_number():
    error = refused(prior=weak_prior(parameters_of(tx60(), WEN24)))
    assert (error.code, error.field) == ("A3", "prior")
    assert "base.x is free and has no prior" in str(error)


def test_a_model_that_has_all_terms_already_cannot_be_extended():
    wide = extended_model(tx60())
    with pytest.raises(InputError, match="no joint term to add") as caught:
        choose(wide, seen(tx60(), 29, 12))
    assert caught.value.field == "nominal"


def test_progress_is_told_for_both_fits():
    told: list[int] = []
    choice = choose(tx60(), seen(bent(8), 29, 13), report=lambda k, _cost: told.append(k))
    steps = [found.iterations for found in choice.identifications]
    assert told == [k for count in steps for k in range(1, count + 1)]


def test_an_extended_fit_of_few_poses_is_held_by_its_prior():
    """Five poses give 30 equations for 69 numbers."""
    wide = extended_model(tx60())
    parameters = parameters_of(wide)
    found = identify(wide, seen(bent(9), 5, 14), parameters, prior=weak_prior(parameters))
    assert found.status is Status.CONVERGED
    assert found.rank == 69
    assert (found.standard_uncertainty <= weak_prior(parameters).sd * (1 + 1e-9)).all()
