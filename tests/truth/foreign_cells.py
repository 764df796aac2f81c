"""What the project states of foreign arms, and what is true: one row of figures per robot."""

from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import truebed
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.model_choice import choose
from calib.identification.prior import Prior, weak_prior
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import Measurements
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.regions import mahalanobis_squared
from calib.uncertainty.statement.gain import estimator_gain, of_all_numbers
from calib.uncertainty.tool_point import tool_statement
from tests.reference import TX60_LINKS
from tests.truth.foreign import KINDS, PLACES, TX60, UR5, candidates, true_arm
from tests.truth.foreign_tracker import (
    JOINT_SD,
    STATED_CONSTANTS,
    ForeignTracker,
    shared_columns,
    with_constants,
    write_campaign,
)

NOISE = 9.2e-6
"""Of one reading with the repeatability of the joints, per axis [m]."""
TARGETS = 60
UR5_LINKS = np.array(
    [
        [0, 0.089159, 0, np.pi / 2, 0],
        [0, 0, -0.425, 0, 0],
        [0, 0, -0.39225, 0, 0],
        [0, 0.10915, 0, np.pi / 2, 0],
        [0, 0.09465, 0, -np.pi / 2, 0],
        [0, 0.0823, 0, 0, 0],
    ]
)
"""The maker's public Denavit-Hartenberg table: theta, d, a, alpha, and no beta [m, rad]."""


@dataclass(frozen=True)
class Cell:
    """Robots of one kind, measured and used in one way."""

    kind: str = "rigid"
    """One of `KINDS`, or "slight": all of them in turn, each of a size from .25 to .75."""
    size: float = 0.0
    """Of the misfit, in sd of the noise per axis."""
    train: int = 40
    held_out: int = 20
    place: str = "same"
    """Of `PLACES`."""
    memory: float = 0.0
    """Of the noise, in rows."""
    constants: bool = False
    """Whether the station has errors of its own, and whether they are stated."""
    stated: bool = True
    payload: float = 0.0
    """Added at use [kg]."""
    off_axis: float | None = None
    """Of the one reflector whose place is read, for a UR5 [m]; None: full poses, a TX60."""
    through_files: bool = False
    chosen: bool = False
    """Whether the readings choose the model, from geometry alone to joint maps."""


@dataclass(frozen=True)
class Told:
    """What one robot's campaign states, and what of it is true."""

    believed: float
    """Share of the targets in the believed region of the mean; nan where none has one."""
    alone: float
    """Share in the region from parameters alone."""
    move: float
    """Share of single moves in the region of one move."""
    move_in_mean: float
    """Share of single moves in the region of the mean."""
    conformal: float
    """Share in the radius that needs no model."""
    plain: float
    """Share in the believed region before it grows."""
    radius: float
    """Mean radius of the believed region, of the ball of its volume [m]."""
    alone_radius: float
    conformal_radius: float
    oracle: float
    """The same told the size of the misfit, with the factor that holds just 95 % here."""
    upper: float
    """Misfit in the region [m]."""
    seen: float
    """p of the tests: misfit, drift."""
    remembers: float
    outside: float
    """Share of the targets that are refused."""
    reaches: float
    """Whether the statement reaches the set."""


def drawn(cell, robot, rng):
    """One robot's arm with the size of its misfit, its tracker, and where it is measured."""
    body = TX60 if cell.off_axis is None else UR5
    kind, size, more = cell.kind, cell.size, {}
    if kind == "slight":
        kind, size = KINDS[robot % len(KINDS)], rng.uniform(0.25, 0.75)
    if cell.off_axis is not None:  # 60 mm before the flange, along the arm drawn at zero
        more["tool"] = np.array([cell.off_axis, -0.06, 0.0])
    arm = true_arm(rng, kind, size * NOISE, body=body, **more)
    tracker = ForeignTracker(memory=cell.memory)
    if cell.constants:
        tracker = with_constants(tracker, rng)
    here = PLACES[cell.place][0]
    q = [candidates(rng, n, body, here) for n in (cell.train, cell.held_out)]
    return arm, size, tracker, q


def readings(cell, arm, tracker, rng, train, held_out):
    """The fit, both tables with their places in time, as a script would make them."""
    q = np.concatenate([train, held_out])
    order = rng.permutation(len(q))
    seen, R = tracker.read(arm, q[order], rng)
    frame = tracker.frame
    p, R = seen @ frame[:3, :3].T + frame[:3, 3], frame[:3, :3] @ R
    along, across, turned = tracker.stated(arm.poses(q[order])[0])
    noise = np.zeros((len(q), 6, 6))
    noise[:, :3, :3] = ((along**2 + 2 * across**2) / 3)[:, None, None] * np.eye(3)
    noise[:, 3:, 3:] = (turned**2)[:, None, None] * np.eye(3)
    model = RobotModel(Chain(TX60_LINKS if cell.off_axis is None else UR5_LINKS))
    offset, kind = np.zeros((len(q), 3)), "pose"
    if cell.off_axis is not None:
        offset, kind = np.broadcast_to([cell.off_axis, 0.0, 0.06], offset.shape), "point"
    noise = with_joint_noise(model, q[order], noise, np.full(6, JOINT_SD), offset=offset)
    if kind == "point":
        noise[:, 3:], noise[:, :, 3:] = 0.0, 0.0
    rows = Measurements(
        q=q[order], position=p, rotation=R, covariance=noise, kind=np.full(len(q), kind),
        offset=offset, pose_id=order, repeat=np.zeros(len(q), int),
    )  # fmt: skip
    of_train = np.flatnonzero(order < len(train))
    of_test = np.flatnonzero(order >= len(train))
    seen = rows.rows(of_train)
    choice = _chosen(model, seen) if cell.chosen else None
    if choice is not None and choice.chosen == "extended":
        fit = choice.identification
    else:
        fit = identify(model, seen, parameters_of(model))
    return fit, seen, rows.rows(of_test), (of_train, of_test)


def _chosen(model, seen):
    """The choice as `identify` makes it: of frames no more is known than where to look."""
    free = parameters_of(model)
    usual = weak_prior(free)
    frame = np.array(["." in name for name in usual.names])
    wide = Prior(usual.mean, np.where(frame, 1.0, usual.sd), usual.names)
    links = weak_prior(free.freeing([name for name in usual.names if "." not in name]))
    return choose(model, seen, free, prior=wide, own_prior=links)


def from_files(arm, tracker, rng, train, held_out, *, constants=False):
    """What `identify` makes of a session, as a user writes one."""
    settings = STATED_CONSTANTS if constants else ""
    with TemporaryDirectory() as folder:
        session = write_campaign(Path(folder), arm, tracker, rng, train, held_out, settings)
        with session.open("a", encoding="utf-8") as file:
            file.write('\n[identification]\nmodel = "geometric"\n')
        return truebed.identify("staubli_tx60", session)


def left_by_constants(fit, train, columns):
    """Covariance (P, P) of all numbers from readings' columns (m, 6, k), each in its own sd."""
    left = np.einsum("mfe,mek->fk", estimator_gain(fit, train), columns)
    return of_all_numbers(fit, left @ left.T)


def told(cell, robot):
    """One robot of a cell, measured, judged and used."""
    rng = np.random.default_rng([robot, 7])
    arm, size, tracker, q = drawn(cell, robot, rng)
    target = np.zeros(3) if cell.off_axis is None else np.array([cell.off_axis, 0.0, 0.06])
    if cell.through_files:
        found = from_files(arm, tracker, rng, *q, constants=cell.constants and cell.stated)
        there = np.linalg.inv(tracker.frame)
        fit, judgement = found.fit.identification, found.proof
    else:
        fit, train, test, order = readings(cell, arm, tracker, rng, *q)
        there, shared = np.eye(4), None
        if cell.constants and cell.stated:
            shared = left_by_constants(fit, train, shared_columns(tracker, arm, train.q))
        sd = np.full(6, JOINT_SD)
        known = Circumstances(order=order, shared=shared, repeatability=sd, target=tuple(target))
        judgement = judge(fit, test, train=train, circumstances=known)
    at = candidates(rng, TARGETS, arm.body, PLACES[cell.place][1])
    used = replace(arm, payload=arm.payload + cell.payload)
    points = used.poses(at)[0] @ there[:3, :3].T + there[:3, 3]
    moves = used.poses(at + JOINT_SD * rng.normal(size=at.shape))[0]
    moves = moves @ there[:3, :3].T + there[:3, 3]
    return figures(size * NOISE, judgement, fit, at, points, moves, target)


def figures(size, judgement, fit, at, points, moves, target):
    """What is stated at targets (n, 6), against their points and where single moves end (n, 3)."""
    belief = judgement.belief
    alone = tool_statement(fit.model, at, fit.full_covariance, target=target)
    error = np.linalg.norm(points - alone.position, axis=1)
    ball = judgement.conformal.radius if judgement.conformal is not None else np.nan
    applies = belief.proven.applies(at)
    inside = applies.place != "outside"
    region = belief.regions(at, target=target)
    plain = belief.regions(at, target=target, growth=1.0)
    move = belief.regions(at, target=target, repeatability=np.full(6, JOINT_SD))
    told_size = replace(belief, misfit=replace(belief.misfit, upper=size))
    best = told_size.regions(at, target=target, growth=1.0)
    scores = mahalanobis_squared(points - best.position, best.covariance)
    best = replace(best, factor=float(np.sqrt(np.quantile(scores, 0.95))))
    slow = judgement.drifting
    return Told(
        believed=float(region.holds(points)[inside].mean()) if inside.any() else np.nan,
        alone=float(alone.holds(points).mean()),
        move=float(move.holds(moves).mean()),
        move_in_mean=float(region.holds(moves).mean()),
        conformal=float((error <= ball).mean()),
        plain=float(plain.holds(points).mean()),
        radius=region.mean_radius,
        alone_radius=alone.mean_radius,
        conformal_radius=ball,
        oracle=best.mean_radius,
        upper=belief.misfit.upper,
        seen=belief.misfit.p_value,
        remembers=np.nan if slow is None else slow.p_value,
        outside=float(1 - inside.mean()),
        reaches=float(applies.reaches),
    )


@cache
def played(cell, robots):
    """Figures of many robots, each an array (robots,)."""
    rows = [told(cell, robot) for robot in range(robots)]
    return Told(*(np.array([getattr(row, field.name) for row in rows]) for field in fields(Told)))
