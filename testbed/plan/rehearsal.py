"""A plan rehearsed: the radius that its calibration will state, by virtual calibrations."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification, identify
from calib.identification.ladders import ladders_of
from calib.identification.levels import Level
from calib.identification.model_choice import extended_by
from calib.identification.prior import Prior, own_prior, weak_prior
from calib.identification.row_ladders import travel_ladder
from calib.measurement.observations import Measurements
from calib.shown import Shown
from calib.uncertainty.circumstances import Circumstances
from calib.uncertainty.judgement import judge
from calib.uncertainty.statement.distance import largest_radius, radius_over
from calib.uncertainty.statement.instrument import InstrumentErrors
from calib.uncertainty.statement.shared import shared_errors
from calib.uncertainty.statement.stated_point import widened
from testbed.laboratory.bench import Bench
from testbed.laboratory.goal import Goal
from testbed.streams import stream

DRAWS = 10
"""Rehearsals of each kind: the median of their radii is known to a twentieth."""
MOSTLY = 0.9
"""Share of them that keep to a radius which a target is compared with."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Rehearsals(Shown):
    """Radii that virtual calibrations state: at their held-out poses, over the goal, at its worst.

    Columns of each array, in ascending order; no row where nothing will be stated, nan where the
    statement does not reach the goal: such rehearsals are not counted there.
    """

    links: Array
    """(k, 3) where the links alone are identified [m]."""
    joints: Array
    """(k, 3) where sag and waves of the joints and scales of slides are identified as well, as of
    most arms; none if the links are not free [m]."""

    draws: int
    """Rehearsals of each kind; 0 without held-out poses."""

    @property
    def medians(self) -> Array:
        """(2, 3) of links and joints: at held-out poses, over the goal, at its worst [m]."""
        columns = [column[np.isfinite(column)] for both in (self.links, self.joints)
                   for column in both.T]  # fmt: skip
        found = [np.median(column) if len(column) else np.nan for column in columns]
        return np.reshape(found, (2, 3))

    def mostly(self, *, worst: bool) -> float:
        """Radius over the goal, or at its worst, that most rehearsals of joint errors keep to [m].

        Nine of ten, that is; inf where more of them state none.
        """
        every = np.full(max(self.draws, 1), np.inf)
        found = self.joints[:, 2 if worst else 1]
        every[: len(found)] = np.where(np.isfinite(found), found, np.inf)
        return float(np.quantile(every, MOSTLY, method="inverted_cdf"))


def rehearsed(
    bench: Bench,
    goal: Goal,
    parameters: Parameters,
    train: Measurements,
    held_out: Measurements,
    errors: InstrumentErrors | None,
) -> Rehearsals:
    """Radii that calibrations of a robot without misfit state, with and without joint errors.

    The nominal robot is read with the stated noise, identified and judged as `identify` does it: a
    misfit that noise may hide is in the region, and so is the doubt of what the robot's file says
    of how joints come back. Most arms sag and wave, and slides travel too far, so that `identify`
    adds joint errors to its model. How much more uncertain it becomes depends on these numbers and
    their prior, not on what they turn out to be: they are identified of the nominal robot, too.

    Parameters
    ----------
    bench : Bench
        The laboratory, at the plan's station.
    goal : Goal
        Where the tool must be right.
    parameters : Parameters
        The numbers to be identified.
    train, held_out : Measurements
        What the tracker would read of the nominal robot, with its noise.
    errors : InstrumentErrors, optional
        What all readings share, as stated.
    """
    links, joints = [], []
    if len(held_out):
        model, rng = bench.robot.model, stream(bench.scenario.seed, "plan", "rehearsal")
        held_out = replace(held_out, pose_id=held_out.pose_id + len(train))
        scatter = _joint_scatter(bench, train), _joint_scatter(bench, held_out)
        levels, prior = usual_levels(model, train.q), links_prior(model, parameters)
        for _ in range(DRAWS):
            own, theirs = (_read(table, rng) for table in (train, held_out))
            read = own, theirs, scatter, errors
            links.append(_radii(bench, goal, identify(model, own, parameters), *read))
            if levels and prior is not None:
                _, found = extended_by(model, own, parameters, levels, prior=prior)
                joints.append(_radii(bench, goal, found, *read))
    draws = DRAWS if len(held_out) else 0
    return Rehearsals(_believed(links), _believed(joints), draws)


def may_bend(model: RobotModel, parameters: Parameters, q: Array) -> bool:
    """Whether a calibration at joints q (m, n) could add joint errors to its model."""
    return bool(usual_levels(model, q)) and links_prior(model, parameters) is not None


def usual_levels(model: RobotModel, q: Array) -> tuple[Level, ...]:
    """The joint errors that a calibration at joints q (m, n) mostly adds.

    The least level of sag and of waves, and the scales of slides.
    """
    ladders = *ladders_of(model), travel_ladder(model, q)
    return tuple(each.levels[1] for each in ladders if len(each.levels) > 1)


def links_prior(model: RobotModel, parameters: Parameters) -> Prior | None:
    """The prior of the free links beside joint errors; None where no link is free."""
    links = set(model.names[6 : model.chain.n_numbers - 6])
    names = [name for name in parameters.free_names if name in links]
    if not names:
        return None
    usual, own = weak_prior(parameters.freeing(names), model), own_prior(parameters, model)
    return usual if own is None else usual.joined(own)


def _radii(
    bench: Bench, goal: Goal, found: Identification, own: Measurements, theirs: Measurements,
    scatter: tuple[Array, Array], errors: InstrumentErrors | None,
) -> Array:  # fmt: skip
    """Radii (3,) stated at held-out poses, over the reached goal postures, at their worst [m]."""
    beam, point = bench.tracker.T_world_tracker[None], goal.point.tolist()
    shared = None if errors is None else shared_errors(errors, found, own, theirs, beam).covariance
    known = Circumstances(
        shared=shared,
        target=(point[0], point[1], point[2]),
        doubted=scatter if bench.sigma_q.any() else None,
    )
    judged = judge(found, theirs, train=own, circumstances=known)
    if judged.belief is None or judged.point is None:
        return np.full(3, np.nan)
    reached = judged.belief.proven.applies(goal.q).place != "outside"
    over = worst = np.nan
    if reached.any():
        region = widened(judged.belief.regions(goal.q[reached], target=known.target))
        share = goal.weights[reached] / goal.weights[reached].sum()
        over, worst = radius_over(region, share), largest_radius(region)
    return np.array([judged.point.radius_mean, over, worst])


def _believed(radii: list[Array]) -> Array:
    """Radii (k, 3) of the rehearsals that state any, ascending by the first."""
    found = np.reshape(radii, (-1, 3))
    return frozen(sorted(found[np.isfinite(found[:, 0])].tolist())).reshape(-1, 3)


def _read(table: Measurements, rng: np.random.Generator) -> Measurements:
    """A table with noise of its covariances on what it reads."""
    noise = np.linalg.cholesky(table.covariance) @ rng.standard_normal((len(table), 6, 1))
    moved, turned = noise[:, :3, 0], exp_so3(noise[:, 3:, 0])
    poses = table.is_pose[:, None, None]
    return replace(
        table,
        position=frozen(table.position + moved),
        rotation=frozen(np.where(poses, turned @ table.rotation, table.rotation)),
    )


def _joint_scatter(bench: Bench, table: Measurements) -> Array:
    """Part (m, 6, 6) of the covariances that the robot's file states, of how joints come back."""
    T = bench.robot.model.poses(table.q)
    own = bench.tracker.own_covariance(bench.tracker.targets(T), T[:, :3, :3])
    size = 6 if bench.tracker.measures == "pose" else 3
    out = np.zeros_like(own)
    out[:, :size, :size] = (table.covariance - own)[:, :size, :size]
    return out
