"""Arrays that robots at the same poses share in a climb: terms, loads of springs, the prior."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.evidence.spring_products import ModelSprings, Products, products_of
from calib.identification.folds import parts_of
from calib.identification.levels import Ladder, Level
from calib.identification.prior import Prior
from calib.kernels.loops import spring_loop_for
from calib.measurement.observations import Measurements

MOST_ROWS = 400
"""Number of rows up to which their covariance is smaller than a joint map's normal equations."""

Apart: TypeAlias = tuple[tuple[Level, ...], Level | None]
"""Levels of terms, those with most columns first, and the level of springs if there is one."""


class ClimbPlan(NamedTuple):
    """Arrays that are the same for all robots of a climb."""

    ladders: tuple[Ladder, ...]
    terms: dict[Level, tuple[Index, Array]]
    """For each level of terms the joint (k,) that each term turns, and the turn (m, k) of a
    coefficient of one prior sd [rad, m]."""
    fewest: dict[Level, tuple[Index, Array]]
    """Columns with the same covariance of the rows, at most as many per joint as there are poses.
    """
    springs: dict[Level, tuple[ModelSprings, Index, Array]]
    """For each level of springs these, their places (p,) among the 3 n bends, and their loads
    (m, p, 1 + f) per unit moment."""
    precision: Array
    """(f, f) precision of the geometry's prior [1/m^2, 1/(m rad), 1/rad^2]."""
    mean: Array
    """(f,) prior mean, as a step from the nominal geometry [m, rad]."""
    constant: float
    """Log determinant of the prior's precision."""
    part: list[Index]
    """Indices of the poses of each part that is left out."""
    pose: Index
    """(m,) pose of each row."""
    loop: Callable[..., None] | None
    """Compiled loop that fits springs; None with too few robots for it."""
    apart: dict[tuple[Level, ...], Apart]
    """Results of `apart` so far, by the levels of a model."""


def plan_of(
    nominal: RobotModel,
    tables: Sequence[Measurements],
    parameters: Parameters,
    ladders: tuple[Ladder, ...],
    prior: Prior,
    robots: int = 1,
) -> ClimbPlan | None:
    """Shared arrays for the climb of so many robots; None if arrays cannot express it.

    They can for full poses from one station at the same joint values, each measured once, without
    stated payloads, up to `MOST_ROWS` rows; for a nominal chain without joint errors and fixtures;
    and for ladders of waves with prior mean zero and at most one ladder of springs. All other cases
    climb one by one, which takes five to seven times as long: points and distances, stated
    payloads, terms of approach, torque and temperature, and joint errors of the nominal model.
    """
    table = tables[0]
    plain = all(
        one.conditions.payload is None and np.array_equal(one.pose_id, table.pose_id)
        for one in tables
    )
    once = len(np.unique(table.together)) == len(table)
    bare = not nominal.joint_errors.names and not nominal.fixtures.n_numbers
    if not (plain and once and bare) or 6 * len(table) > MOST_ROWS:
        return None
    levels = [level for ladder in ladders for level in ladder.levels if level.names]
    sprung = [level for level in levels if level.errors.springs is not None]
    only = all(not level.errors.terms for level in sprung)
    waves = all(term.is_wave for level in levels for term in level.errors.terms)
    one = len({k for k, ladder in enumerate(ladders) for each in ladder.levels if each in sprung})
    if not (only and waves and one <= 1) or any(level.mean.any() for level in levels):
        return None
    springs = [level.errors.springs for level in sprung if level.errors.springs is not None]
    terms = {
        level: (np.array(level.errors.joints), level.errors.basis(table.q) * level.sd)
        for level in levels
        if level not in sprung
    }
    part = parts_of(table, np.random.default_rng(0))
    order = [prior.names.index(name) for name in parameters.free_names]
    precision = prior.precision[np.ix_(order, order)]
    return ClimbPlan(
        ladders,
        terms,
        {level: _fewest(*columns) for level, columns in terms.items()},
        _sprung(sprung, *products_of(springs, table.q, 0)),
        precision,
        prior.mean[order],
        float(np.linalg.slogdet(precision)[1]),
        [] if part is None else [np.flatnonzero(part == k) for k in np.unique(part)],
        np.unique(table.together, return_inverse=True)[1].ravel(),
        spring_loop_for(robots) if sprung else None,
        {},
    )


def _fewest(joints: Index, values: Array) -> tuple[Index, Array]:
    """Columns (m, k) of joints (k,) that give the rows the same covariance, at most m per joint."""
    found = []
    for joint in np.unique(joints):
        own = values[:, joints == joint]
        if own.shape[1] > len(own):
            own = np.asarray(np.linalg.qr(own.T, mode="r")).T
        found.append((np.full(own.shape[1], joint), own))
    return np.concatenate([one[0] for one in found]), np.hstack([one[1] for one in found])


def _sprung(
    levels: Sequence[Level], products: Products, loads: Array
) -> dict[Level, tuple[ModelSprings, Index, Array]]:
    """Springs of each level, their places among the bends, and their loads."""
    wide, found = loads.shape[2] if loads.size else 1, {}
    for level in levels:
        springs = products.of(level.errors, level.sd)
        place, weighs = np.divmod(springs.columns.reshape(len(springs.load), -1), wide)
        own = np.ascontiguousarray(loads[:, place[:, 0]][:, :, weighs[0]])
        found[level] = springs, np.array(products.places)[place[:, 0]], own
    return found


def apart(plan: ClimbPlan, levels: tuple[Level, ...]) -> Apart:
    """Levels of a model, split into those of terms and that of springs."""
    if levels not in plan.apart:
        terms = [level for level in levels if level in plan.terms]
        terms.sort(key=lambda level: -len(plan.fewest[level][0]))
        sprung = next((level for level in levels if level in plan.springs), None)
        plan.apart[levels] = tuple(terms), sprung
    return plan.apart[levels]
