"""A target whose distance from the flange no pose tells: joint errors must not run away with it."""

from dataclasses import replace

import numpy as np

from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status
from calib.measurement import tables
from calib.measurement.prediction import predicted_positions
from testbed.identify.fit import fit
from testbed.identify.frames import frames_of
from testbed.robots.catalog import load_robot
from tests.calibrated import session_of

LINKS = (
    *((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, -90.0), (-90.0, 0.0, 290.0, 0.0)),
    *((90.0, 20.0, 0.0, 90.0), (0.0, 310.0, 0.0, -90.0), (0.0, 0.0, 0.0, 90.0)),
    (0.0, 70.0, 0.0, 0.0),
)
"""theta [deg], d, a [mm] and alpha [deg]: a column that lifts an arm of six axes."""


def lifted(folder):
    tables_of = [
        f'[[joints]]\nkind = "{kind}"\ntheta_deg = {theta}\nd_mm = {d}\na_mm = {a}\n'
        f"alpha_deg = {alpha}\nlower_{unit} = {low}\nupper_{unit} = {high}\n"
        for (theta, d, a, alpha), (kind, unit, low, high) in zip(
            LINKS, [("prismatic", "mm", 0, 4000), *[("revolute", "deg", -200, 200)] * 6],
            strict=True,
        )
    ]  # fmt: skip
    file = folder / "lift.toml"
    file.write_text('format = 1\nname = "lift"\n' + "".join(tables_of))
    return load_robot(str(file))


def upright(n, seed, off):
    """Poses (n, 7) whose flange points up within `off` [rad]."""
    rng = np.random.default_rng(seed)
    q = np.zeros((n, 7))
    q[:, 0] = rng.choice([0.5, 1.5, 2.5], n)
    q[:, 1], q[:, 2] = rng.uniform(-2, 2, n), rng.uniform(-0.9, 0.9, n)
    q[:, 3] = rng.uniform(0.3, 2, n)
    q[:, 5] = -q[:, 2] - q[:, 3] + off * rng.standard_normal(n)
    q[:, 6] = rng.uniform(-3, 3, n)
    return q


def where(model, q):
    return predicted_positions(model, tables.points(q, np.zeros((len(q), 3)), sd=1e-3))


def leaning(model, q, lean, waves=((7, 0.15, 1),)):
    """Points (n, 3) of an arm whose column bends under it, and whose gears wobble by 0.15 deg."""
    real = q.copy()
    for order, size, turned in waves:
        real[:, 1:] += np.radians(size) * np.sin(order * q[:, 1:] + turned * np.arange(6))
    p = where(model, real)
    tilt = np.stack([-p[:, 1], p[:, 0], 0 * p[:, 0]], axis=1) * (1 + q[:, :1]) / 2
    return p + np.cross(lean * tilt, p)


LEAN = 0.015


def fitted(model, off):
    """Fits of 52 such poses, each with its errors at 200 others [m], and the choice."""
    q, noise = upright(52, 2, off), 3e-4
    seen = leaning(model, q, LEAN)
    seen += noise * np.random.default_rng(0).standard_normal(seen.shape)
    pairs, choice = fit(
        model, tables.points(q, seen, sd=noise), parameters_of(model),
        model="choose", loss="squared", seed=0,
    )  # fmt: skip
    new = upright(200, 52, off)
    truth = leaning(model, new, LEAN)
    found = {name: one.model for name, _, one in pairs}
    left = {name: np.linalg.norm(where(one, new) - truth, axis=1).mean() for name, one in
            found.items()}  # fmt: skip
    return found, left, choice


def test_a_target_is_not_carried_off_by_joint_errors(tmp_path):
    start = lifted(tmp_path).model
    found, left, choice = fitted(start, 0.002)
    assert choice.chosen == "extended"
    away = dict(zip(start.names, start.chain.step_to(found["extended"].chain), strict=True))
    assert max(abs(away["tool.z"]), abs(away["base.z"])) < 0.5
    assert "these poses do not tell" in choice.sentence
    assert left["extended"] < left["geometric"]


def test_nor_by_those_that_were_requested(tmp_path):
    """Waves of one and two a turn, which the extended model has."""
    model, noise = lifted(tmp_path).model, 1e-4
    q, waves = upright(52, 2, 0.0003), ((1, 0.2, 3), (2, 0.1, 1))
    seen = leaning(model, q, 0.005, waves)
    seen += noise * np.random.default_rng(0).standard_normal(seen.shape)
    pairs, choice = fit(
        model, tables.points(q, seen, sd=noise), parameters_of(model),
        model="extended", loss="squared", seed=0,
    )  # fmt: skip
    extended = pairs[1][2].model
    away = dict(zip(model.names, model.chain.step_to(extended.chain), strict=False))
    assert max(abs(away["tool.z"]), abs(away["base.z"])) < 0.5
    assert choice.sentence.startswith("extended, as requested; these poses do not tell ")
    new = upright(200, 52, 0.0003)
    truth = leaning(model, new, 0.005, waves)
    errors = [np.linalg.norm(where(one.model, new) - truth, axis=1) for _, _, one in pairs]
    assert errors[1].mean() < 1.05 * errors[0].mean()


def test_nor_by_noise_where_the_flange_points_up_within_the_digits_of_the_joints(tmp_path):
    """1e-4 deg: some 0.1 mm of noise are, in the end, a target 16 m away."""
    arm = lifted(tmp_path)
    rng, nominal = np.random.default_rng(1), arm.model
    off = rng.standard_normal(nominal.chain.links.shape) * [1e-3, 3e-4, 3e-4, 1e-3, 1e-3]
    true = replace(nominal, chain=replace(nominal.chain, links=nominal.chain.links + off))
    q, noise = upright(30, 3, 2e-6), 1e-4
    rows = tables.points(q, where(true, q) + noise * rng.standard_normal((30, 3)), sd=noise)
    frames = frames_of(arm, session_of(rows), rows)
    assert np.abs(nominal.chain.step_to(frames.before.chain)[:3]).max() < 0.5
    ((_, _, found),), choice = fit(
        frames.start, rows, frames.parameters, model="geometric", loss="squared", seed=0, held=True
    )
    assert found.status is Status.CONVERGED
    assert "these poses do not tell base.z, which the fit carried" in choice.sentence
    assert np.abs(nominal.chain.step_to(found.model.chain)[:3]).max() < 0.5
    new = upright(200, 52, 2e-6)
    left = np.linalg.norm(where(found.model, new) - where(true, new), axis=1)
    assert left.mean() < noise  # 83 um, and 109 um with the target 16 m away


def test_nothing_is_held_where_poses_tell_where_the_target_is(tmp_path):
    _, _, choice = fitted(lifted(tmp_path).model, 0.4)
    assert "these poses do not tell" not in choice.sentence
