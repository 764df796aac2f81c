"""How a calibration is judged: what a session knows beside its readings, and the judgement."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.geometry.model import RobotModel
from calib.held_out_counts import fewest_poses
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification
from calib.measurement.observations import GIVEN, Measurements
from calib.measurement.tool_target import ToolTarget, places_are_found
from calib.uncertainty.drift.between_repeats import RepeatDrift
from calib.uncertainty.drift.between_rounds import visits_apart
from calib.uncertainty.judgement import Circumstances, Judgement, judge
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.repeats import (
    FEWEST_FREEDOM,
    joint_scatter,
    noise_repeats,
    repeated,
)
from calib.uncertainty.tool_point import tool_statement
from testbed.files.session import Session
from testbed.identify.applies.quiet import quieter
from testbed.robots.robot import Robot
from testbed.streams import stream
from testbed.units import counted

REPLICATES = 400
"""Virtual calibrations that check whether linear propagation holds; 4 % in each deviation."""
MOST_ROWS = 300
"""Larger tables are not replicated: their linear intervals are tight enough to be linear."""
QUIET = 0.3
"""Repeats that scatter by less than this part of the noise of one reading are no readings anew, or
the noise is stated much too large."""


def proof_of(
    result: Identification,
    session: Session,
    measurements: Measurements,
    *,
    used: Bool,
    is_test: Bool,
    visits: Bool,
    root: Array,
    comes_back: tuple[Array, str],
    target: ToolTarget,
    seed: int,
    shared: Array | None = None,
    drifts: RepeatDrift | None = None,
) -> Judgement:
    """Judge the identification that is handed out by held-out rows (also by none).

    Parameters
    ----------
    result : Identification
        Of the chosen model.
    session : Session
        Where the rows come from.
    measurements : Measurements
        All rows (m), the scatter of the joints in their covariances.
    used, is_test, visits : (m,) array of bool
        Rows identified from; held out; all that are no gross errors.
    root : (m, 6, n) array
        Of what the joints scatter at each row, in the covariances [m, rad].
    comes_back : tuple
        Standard deviation (n,) with which each joint does [rad, m], and what tells it.
    target : ToolTarget
        The point of the tool that is stated.
    seed : int
        Of virtual calibrations.
    shared : (P, P) array, optional
        Covariance of all numbers from what all readings of the instrument share [m, rad].
    drifts : RepeatDrift, optional
        A drift that visits of the same poses show.
    """
    train, test = measurements.rows(used), measurements.rows(is_test)
    order = session.in_time
    scatter = measurements.covariance - session.measurements.covariance
    alone = replace(train, covariance=train.covariance - scatter[used])  # the noise of the readings
    known = Circumstances(
        visits=measurements.rows(visits) if session.wanted.visits == "first" else None,
        order=None if session.wanted.order == "unknown" else (order[used], order[is_test]),
        shared=shared,
        repeatability=comes_back[0],
        told_by=comes_back[1],
        drawn=session.wanted.held_out == "drawn",
        doubted=(scatter[used], scatter[is_test]) if session.joint_scatter.any() else None,
        stops=_of_stops(measurements, root, used, is_test),
        target=target,
        unstated=session.noise_assumed or any(part != "angles" for part in quieter(result, alone)),
        stations_are_visits=bool(session.visits),
        drifts=0.0 if drifts is None else drifts.sd,
        pose_names=session.pose_names,
    )
    rng = stream(seed, "bootstrap") if len(train) <= MOST_ROWS else None
    return judge(result, test, train=train, circumstances=known, rng=rng, replicates=REPLICATES)


def _of_stops(
    measurements: Measurements, root: Array, used: Bool, is_test: Bool
) -> tuple[Array, Array] | None:
    """What the joints scatter at rows that identify and that judge; None where no stop has two."""
    stop = np.column_stack([measurements.pose_id, measurements.repeat])
    if not root.any() or len(np.unique(stop, axis=0)) == len(stop):
        return None
    return root[used], root[is_test]


def guard_warnings(session: Session, test: Measurements) -> tuple[str, ...]:
    """Why held-out poses guard no statement, where there are some and they do not."""
    count, needed = test.rows(~test.is_distance).n_poses, fewest_poses()
    if count and session.wanted.held_out == "designed":
        return (
            f"the {counted(count, 'held-out pose')} were designed, as [identification] states: "
            "they test the result, but guard no statement about other poses",
        )
    if 0 < count < needed:
        return (
            f"only {counted(count, 'held-out pose')}: fewer than {needed} guard no statement, so "
            "the misfit is bounded with 95 % probability instead of 90 %",
        )
    return ()


def target_warnings(
    measurements: Measurements, target: ToolTarget, names: Sequence[str]
) -> tuple[str, ...]:
    """What no region contains of a tool point that no row looked at; names of the reflectors."""
    if target.reflector != GIVEN:
        several = len(np.unique(measurements.reflector)) > 1
        found = "the places of the targets were" if several else "the place of the target was"
        which = names[target.reflector] or "this point"
        others = ", the least known of them" * several
        return (
            f"{found} found with the robot: all statements are about {which}{others}; how the "
            "flange lies relative to it is taken from the robot's description, as is the last "
            "link, and no region includes errors of that",
        )
    if (measurements.reflector != GIVEN).any():
        return (
            "the places of the targets were found with the robot: how the tool point lies relative "
            "to them is taken from its description, and no region includes errors of that",
        )
    if not measurements.is_pose.any() and len(np.unique(measurements.offset, axis=0)) == 1:
        return (
            "only one point of the tool was measured: all statements are about that point, none "
            "about the tool's orientation or about another tool",
        )
    return ()


def standing_warnings(
    session: Session, result: Identification, belief: Belief | None
) -> tuple[str, ...]:
    """That repeats may be readings of one stop, which make a misfit of how joints come back.

    Copies with other last digits, or one stop that is found twice in a file, make one of all noise.
    """
    lack = result.lack_of_fit
    if lack is None or lack.p_value >= RED or not one_after_another(session):
        if belief is None or belief.misfit.p_value >= RED:
            return ()
        again = noise_repeats(result.model, session.measurements)
        quiet = 1.0 if again is None else float(np.exp(again.log_scale))
        if quiet >= QUIET:
            return ()
        return (
            f"rows of one pose agree within {quiet:.2g} times the stated noise of a reading: if "
            "they are copies, or shots at one stop, noise that they share counts as misfit; keep "
            "one row of each stop, or approach the poses again in a second round",
        )
    return (
        "the rows of a pose follow each other directly: if the arm stood still between them, they "
        "do not show how well its joints come back, and that scatter counts as misfit; write one "
        "row for each stop (their mean), or approach the poses again in a second round",
    )


def one_after_another(session: Session) -> bool:
    """Whether most rows that repeat a pose follow it with no other pose between them."""
    table, order = session.measurements, np.argsort(session.in_time, kind="stable")
    if session.wanted.order == "unknown":
        return False
    pose = table.pose_id[order]
    stop = np.cumsum(np.concatenate([[0], pose[1:] != pose[:-1]]))
    what = np.unique(np.column_stack([pose, table.target_key[order]]), axis=0, return_inverse=True)
    again = len(pose) - len(what[0])
    at_stops = np.unique(np.column_stack([stop, what[1].ravel()]), axis=0)
    return 2 * (len(pose) - len(at_stops)) > again


def of_the_lead(session: Session, measurements: Measurements) -> Measurements:
    """Rows of the session whose base and tool are handed out; all of them where there is one.

    A target that was seen from another base alone may lie anywhere as far as this one knows.
    """
    return measurements if session.visit is None else measurements.rows(session.visit == 0)


def stated_target(measurements: Measurements, result: Identification) -> ToolTarget:
    """The point of the tool that is stated, of a fit of the measurements.

    The one that all rows look at, if its place is known. Where nothing but targets of unknown place
    was measured, the least known of them: readings test it, and nothing tests a point beside it.
    """
    seen = measurements.reflector
    if places_are_found(measurements) and not measurements.tool.any():
        q, covariance = measurements.q, result.full_covariance
        found = [ToolTarget(reflector=k) for k in np.unique(seen).tolist()]
        spread = [
            np.trace(
                tool_statement(result.model, q, covariance, target=one).covariance, axis1=1, axis2=2
            ).mean()
            for one in found
        ]
        return found[int(np.argmax(spread))]
    places = np.unique(measurements.offset, axis=0)
    if len(places) > 1 or (seen != GIVEN).any():
        return ToolTarget()
    return ToolTarget.of(places[0])


def drift_of_repeats(
    model: RobotModel, session: Session, measurements: Measurements, visits: Bool
) -> RepeatDrift | None:
    """What rows `visits` (m,) of the same poses differ by in time; None if nothing, or no order."""
    some = np.flatnonzero(visits & ~measurements.is_distance)
    if not len(some) or session.wanted.order == "unknown":
        return None
    return visits_apart(model, measurements.rows(some), session.in_time[some])


def repeatability(
    model: RobotModel,
    robot: Robot,
    session: Session,
    measurements: Measurements,
    visits: Bool,
    drift: RepeatDrift | None = None,
) -> tuple[Array, str]:
    """Standard deviation (n,) with which each joint comes back [rad, m], and what tells it.

    Repeats of poses tell it where there are enough, and where the scatter of the joints is known
    apart from that of the instrument: then their upper 95 % limit is taken. What they differ by
    through a drift, joints do not make.
    """
    stated, said, by = robot.repeatability, "the robot's description", "the robot's description"
    if robot.scatter_is_assumed:
        said, by = "assumed, as the robot's file states none", "the assumption"
    some = np.flatnonzero(visits & ~measurements.is_distance)
    seen = measurements.rows(some)
    freedom = sum(3 * (rows.size - len(rows)) for rows in repeated(seen)) if len(seen) else 0
    if not session.joint_scatter.any() or freedom < FEWEST_FREEDOM:
        return stated, said
    own = session.measurements.covariance[some, :3, :3]
    found = joint_scatter(
        model, seen, own, measurements.covariance[some, :3, :3] - own,
        None if drift is None else drift.shift,
    )  # fmt: skip
    if found is None:
        return stated, said
    best, upper = found
    if upper < 1 and one_after_another(session):
        return stated, f"{said}, as repeats without another pose between them show less than that"
    found_of_it = f"{best:.2g} times" if best > 0 else "none of"
    beside = "" if drift is None or drift.joints else "beside a drift, "
    told = (
        f"{beside}repeats show {found_of_it} what {by} states, and allow for {upper:.2g} times as "
        "much, which is used"
    )
    return frozen(upper * stated), told
