"""Kinds of robots in addition to the presets of the truth: hidden or shared errors, or other use.

The errors of a `slight` robot come from physics that no estimator has. After the best geometric fit
they are a quarter to three quarters of the noise, which tests do not detect. The other kinds differ
in how they are measured or used.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from calib.arrays import Array, Index
from calib.measurement.observations import Measurements
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.scenario.laboratory import At960Tracker, TruthSettings
from testbed.streams import stream
from testbed.studies.coverage.settings import SLIGHT, CoverageSettings

T = TypeVar("T")
MISFITS: tuple[Mapping[str, Any], ...] = (
    {"drive_nm_per_mrad": (90.0, 90.0, 40.0, 12.0, 10.0, 6.0)},
    {"high_harmonic_mdeg": 2.5},
    {
        "drive_nm_per_mrad": (180.0, 180.0, 80.0, 24.0, 20.0, 12.0),
        "bearing_nm_per_mrad": (600.0, 500.0, 300.0, 100.0, 80.0, 50.0),
        "high_harmonic_mdeg": 2.5,
        "backlash_mdeg": 2.0,
        "backlash_side": "load",
    },
)
"""Sag of springs, waves of high order, and a mixture with bending bearings and play, in turn."""
SOFT = ("drive_nm_per_mrad", "bearing_nm_per_mrad")
SIZES = (0.25, 0.75)
"""Range of the misfit of a slight robot, in sd of the noise per axis."""
SIZED_AT = 100
"""Number of postures of the pool over which the size of a misfit is computed."""
UNIT = 0.05
"""Scale of `MISFITS` at which sizes are computed; small, so that all effects are linear."""
FELT = 1e-4
"""Smallest misfit at that scale, in units of the noise, for terms to affect an arm."""
LEVEL = 1e-6
"""Least variation over the pool of a number that divides it [m, rad]; some arms have one height."""
MEMORY = 15.0
"""Correlation length of the noise of a drifting station, in rows."""
MORE_KG = 3.0
"""Payload of a loaded robot in use, which it did not have when measured [kg]."""
PLACES = ("half", "joint 1", "elbow", "low")
"""Ways to divide the pool into a part for calibration and one for use, for robots in turn."""
APART = (0.4, 0.6)
"""Fractions of the pool: that in the measured part, and that below the used part."""


@dataclass(frozen=True, slots=True, eq=False)
class Use:
    """Where a robot is measured and used, and how."""

    laboratory: Laboratory
    """The laboratory in which this robot is measured."""
    used: Laboratory
    """The laboratory in which it is used."""
    payload: tuple[float, float]
    """Payload when measured and when used [kg]."""
    one_move: bool
    """Whether it is judged by single moves."""


def drawn(laboratory: Laboratory, kind: str, robot: int, truth: TruthSettings | None = None) -> Use:
    """Robot number `robot` of one kind in the laboratory; the kind's `truth` if at hand."""
    scenario, name = laboratory.scenario, ("coverage", "robot", robot)
    truth = truth or scenario.table(CoverageSettings).truth_of(scenario, kind)
    if kind in SLIGHT:
        size = stream(scenario.seed, "coverage", "slight", robot).uniform(*SIZES)
        found = (slight(laboratory, truth, terms, size, robot) for terms in in_turn(MISFITS, robot))
        truth = next(one for one in found if one is not None)  # any arm has waves
    if kind == "hidden" and isinstance(scenario.tracker, At960Tracker):
        tracker = scenario.tracker.model_copy(update={"systematic": True})
        laboratory = replace(laboratory, scenario=scenario.model_copy(update={"tracker": tracker}))
    own = laboratory.with_robot(truth, *name)
    used, more = own, truth.payload_kg
    if kind == "loaded":
        more += MORE_KG
        used = laboratory.with_robot(truth.model_copy(update={"payload_kg": more}), *name)
    return Use(own, used, (truth.payload_kg, more), kind == "one_move")


def in_turn(several: Sequence[T], robot: int) -> Iterator[T]:
    """All of them, starting with another one for each robot."""
    return (several[(robot + k) % len(several)] for k in range(len(several)))


def slight(
    laboratory: Laboratory, truth: TruthSettings, terms: Mapping[str, Any], size: float, robot: int
) -> TruthSettings | None:
    """The truth with `terms`, scaled to a misfit of `size` sd of the noise after a geometric fit.

    None if there is no misfit, as for the sag of an arm whose axes are all upright.

    References
    ----------
    Misfit is the residual of the best geometric fit over the pool, root mean square per axis:
    effects that geometry absorbs do not count.
    """
    q = laboratory.pool_q[:SIZED_AT]
    still = truth.model_copy(update={"angle_sd_deg": 0.0, "length_sd_mm": 0.0})
    small = still.model_copy(update=scaled(laboratory, terms, UNIT))
    own = laboratory.with_robot(small, "coverage", "robot", robot)
    T, J = laboratory.setting.nominal.poses_and_jacobian(q)
    error = (own.held_out(q)[:, :3, 3] - T[:, :3, 3]).ravel()
    rows = J[:, :3].reshape(len(error), -1)
    left = error - rows @ np.linalg.lstsq(rows, error, rcond=1e-9)[0]
    noise = np.sqrt(np.trace(laboratory.covariance(q)[:, :3, :3], axis1=1, axis2=2).mean() / 3)
    missed = np.sqrt(np.mean(left**2))
    if missed < FELT * noise:
        return None
    scale = UNIT * size * float(noise / missed)
    return truth.model_copy(update=scaled(laboratory, terms, scale))


def scaled(laboratory: Laboratory, terms: Mapping[str, Any], scale: float) -> dict[str, Any]:
    """Terms of the truth with `scale` times the effect, for an arm of any number of joints."""
    from testbed.scenario.presets import along

    joints = laboratory.robot.model.chain.n_joints
    found: dict[str, Any] = {}
    for key, value in terms.items():
        if key in SOFT:
            found[key] = tuple(stiffness / scale for stiffness in along(list(value), joints))
        else:
            found[key] = value if isinstance(value, str) else value * scale
    return found


def apart(
    laboratory: Laboratory, robot: int, counts: tuple[int, int, int]
) -> tuple[Array, Array, Array]:
    """Postures to identify from, to hold out, and to judge at; the last in another part.

    The part follows from one number: how far to the side, turned, bent or high a posture is. It is
    measured below the quantile `APART[0]` of the pool, and used above `APART[1]`.
    """
    told = (
        (place, where(laboratory, place, laboratory.pool_q)) for place in in_turn(PLACES, robot)
    )
    place, there_is = next(one for one in told if np.ptp(one[1]) > LEVEL)  # joint 1 does turn
    low, high = np.quantile(there_is, APART)
    train, held_out, judged = counts
    here, there = np.zeros((2, 0, laboratory.pool_q.shape[1]))
    rng = stream(laboratory.scenario.seed, "coverage", "apart", robot)
    while len(here) < train + held_out or len(there) < judged:
        q = laboratory.candidates().draw(rng, size=sum(counts), exclude=laboratory.pool_q).q
        at = where(laboratory, place, q)
        here, there = np.vstack([here, q[at < low]]), np.vstack([there, q[at > high]])
    return here[:train], here[train : train + held_out], there[:judged]


def where(laboratory: Laboratory, place: str, q: Array) -> Array:
    """(m,) the number that divides the workspace, or the range of a joint, into parts."""
    if place == "joint 1":
        return np.abs(q[:, 0] - np.median(laboratory.pool_q[:, 0]))
    if place == "elbow":
        return q[:, min(2, q.shape[1] - 1)]
    return laboratory.setting.nominal.poses(q)[:, 1 if place == "half" else 2, 3]


def remembering(
    laboratory: Laboratory, parts: tuple[Measurements, Measurements]
) -> tuple[Measurements, Measurements]:
    """Rows in time order with position noise correlated over `MEMORY` rows, of stated variance.

    References
    ----------
    First-order autoregression of the noise in units of its stated standard deviation.
    """
    keep, before = np.exp(-1 / MEMORY), np.zeros(3)
    found: list[Measurements] = []
    for rows in parts:
        truth = laboratory.truth.poses(rows.q)[:, :3, 3]
        root = np.linalg.cholesky(rows.covariance[:, :3, :3])
        white = np.linalg.solve(root, (rows.position - truth)[:, :, None])[:, :, 0]
        for k in range(len(white)):
            first = not found and k == 0
            white[k] = white[k] if first else keep * before + np.sqrt(1 - keep**2) * white[k]
            before = white[k]
        found.append(replace(rows, position=truth + (root @ white[:, :, None])[:, :, 0]))
    return found[0], found[1]


def in_random_order(laboratory: Laboratory, chosen: Index, robot: int) -> Index:
    """The chosen poses in random order, as they are visited to detect drift."""
    rng = stream(laboratory.scenario.seed, "coverage", "order", robot)
    return np.asarray(rng.permutation(chosen))
