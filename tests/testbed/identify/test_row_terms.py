"""A calibration from rows that say how warm the arm was and which row came first."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.geometry.chain import forward
from calib.geometry.operating import OperatingConditions, approaches
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.programs.correct import correct_program
from testbed.identify.applies import targets
from testbed.identify.applies.targets import statement_at
from testbed.identify.applies.unsaid import unsaid_words
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.states import in_own_frames
from testbed.identify.words import reasons
from tests.calibrated import robot, session_of, table_of, true_model
from tests.reference import DEG, pool_r
from tests.testbed.files.made import csv

PLAY, KAPPA = np.array([4, 3, 2, 3, 4, 5]) * 1e-3 * DEG, 17e-6
WARMTH = 20 + 8 * (1 - np.exp(-np.arange(110) / 40))


class Warmed:
    """A robot with play, warm as each row says: what `table_of` measures."""

    def __init__(self):
        self.model = true_model()

    def poses(self, q):
        q = q + PLAY * approaches(q)
        links = np.tile(self.model.chain.links, (len(q), 1, 1))
        links[:, :, 1:3] *= (1 + KAPPA * (WARMTH - 20))[:, None, None]
        return np.concatenate(
            [
                forward(replace(self.model.chain, links=own), row[None])
                for own, row in zip(links, q, strict=True)
            ]
        )


@cache
def session():
    q = pool_r(110)
    at = OperatingConditions(approach=approaches(q), temperature=WARMTH)
    table = table_of(Warmed(), q)
    return session_of(
        replace(table, conditions=at),
        model="choose",
        conditions=Conditions(temperature=WARMTH),
        is_test=np.arange(110) % 3 == 0,
        split_stated=True,
        simulated=True,
    )


@cache
def found():
    return calibrate(robot(), session(), Options(seed=1))


def test_play_and_growth_are_taken_measured_and_reported():
    names = found().fit.identification.names
    told = dict(zip(names, found().fit.identification.step, strict=True))
    sd = dict(zip(names, found().fit.identification.standard_uncertainty, strict=True))
    for j in range(6):
        name = f"approach{j + 1}"
        assert told[name] == pytest.approx(PLAY[j], abs=3.3 * sd[name])
    assert told["lengths"] == pytest.approx(KAPPA, abs=3.3 * sd["lengths"])
    outcome = {offer.ladder: offer.outcome for offer in found().choice.offered}
    assert outcome["approach"] == outcome["lengths"] == "taken"
    assert outcome["torque"] == "not offered: the file has no such columns"
    assert outcome["gear"] == "not offered: no ratio or order is stated"
    geometric, chosen = found().fits
    # measured 29 and 49 um, of which the noise of the readings is 28
    assert chosen.test.position.mean < 0.7 * geometric.test.position.mean


def test_targets_far_from_the_mean_warmth_are_less_certain(tmp_path, monkeypatch):
    """The radius holds what is not known of the growth: grown by J_k u(k) (T - T0).

    As if the file's tool were what was measured: else the flange is what is not known.
    """
    monkeypatch.setattr(targets, "tool_point", lambda _: np.zeros(3))
    q = found().stated_q[:6]
    joints = {f"q{j + 1}_deg": np.degrees(q[:, j]) for j in range(6)}
    radii, sentences = {}, {}
    used = WARMTH[found().is_used].mean()
    for name, warm in (("unsaid", None), ("mean", used), ("hot", 27.9)):
        more = {} if warm is None else {"temperature_degC": np.full(6, warm)}
        (tmp_path / f"{name}.csv").write_text(csv(joints | more))
        done = correct_program(
            tmp_path / f"{name}.csv", robot(), in_own_frames(found()), tmp_path / f"{name}_out.csv",
            measured=found().conditions, set_up=found().set_up,
        )  # fmt: skip
        radii[name] = statement_at(found(), done).radius_mean
        sentences[name] = " ".join(done.sentences)
    assert (radii["hot"] > radii["mean"]).all()
    # two or three kelvins of 17 um/m about the mean, at half a meter: as much as the region itself;
    # at the first target from either side, too
    assert (radii["unsaid"][1:] > 1.3 * radii["mean"][1:]).all()
    assert radii["mean"][0] > 1.3 * np.median(radii["mean"][1:])
    assert f"those at {used:.4g} degC, the mean of the measurements" in sentences["unsaid"]
    assert "those at 27.9 degC" in sentences["hot"]
    assert "each target is assumed to be approached from the one before it" in sentences["hot"]


def test_the_verdict_says_what_its_radius_takes_as_known():
    (text,) = unsaid_words(found())
    assert "know the side from which each joint comes and the temperature of the arm; if" in text
    radius = float(text.split()[-2])
    # the play of six joints at a meter: some 100 um, three times the region where it is known
    assert radius > 2e6 * found().proof.point.radius_mean
    assert f"{text}." in reasons(found())


def test_regions_follow_the_conditions_of_their_poses():
    belief, q = found().proof.belief, found().stated_q[:4]
    at = OperatingConditions(temperature=np.full(4, 40.0))
    model = belief.model
    k = model.names.index("lengths")
    _, J = model.poses_and_jacobian(q, at)
    kappa = J[:, :3, k] * np.sqrt(belief.covariance[k, k])
    hot, usual = belief.regions(q, at=at, growth=1.0), belief.regions(q, growth=1.0)
    # what is not known of the growth alone, which no other number makes up for there
    assert (hot.point**2 > 0.5 * usual.point**2 + 0.5 * (kappa**2).sum(axis=1)).all()
    warm = belief.proven.applies(q, at).leverage
    assert (warm > belief.proven.applies(q).leverage).all()
