"""What is believed of an identification by held-out rows, repeats and the order in time.

Rows that stand in another frame are no evidence; what a drift leaves is added, and where enough
poses are held out, their errors are counted. A few poses that stand out are evidence, and named;
whether there is another frame is asked of the others.
"""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, check
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.tool_target import ToolTarget
from calib.uncertainty.circumstances import Circumstances, MeasuredNoise
from calib.uncertainty.drift.drifting import Drifting, drifting
from calib.uncertainty.frames.other_frame import (
    FEWEST,
    OtherFrame,
    after_the_motion,
    other_frame,
    unshown_frame,
)
from calib.uncertainty.outlying.angles import loud_turns
from calib.uncertainty.outlying.poses import (
    Strays,
    far_off,
    strays_beside,
    strays_of,
    without_motion,
)
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.believe import adding, believe
from calib.uncertainty.statement.counted import counted
from calib.uncertainty.statement.left_out import left_out_covariance, left_out_growth
from calib.uncertainty.statement.stated_point import StatedPoint, common_radius, stated_point


def proven_belief(
    fit: Identification, train: Measurements, test: Measurements, known: Circumstances,
    numbers: Array | None, probability: float, quiet: MeasuredNoise,
) -> tuple[Belief | None, OtherFrame | None, Drifting | None, Strays | None]:  # fmt: skip
    """The belief, None where the rows bound no misfit; another frame, a drift, what stands out.

    Parameters
    ----------
    fit : Identification
        From `train`.
    train, test : Measurements
        What identified, and what is held out: no evidence and no guard where in another frame.
    known : Circumstances
        What else is known of the campaign.
    numbers : (P, P) array, optional
        Covariance of all numbers, where it is not that of the fit [m^2, m rad, rad^2].
    probability : float
        Content of every statement.
    quiet : MeasuredNoise
        Of both tables; see `measured_noise`.
    """
    turned = loud_turns(fit, train, test)
    known = replace(known, shared=_with_drift(fit, known))

    def believed(held_out: Measurements | None) -> Belief:
        less = (quiet.train, None if held_out is None else quiet.test)
        found = believe(
            fit, train, held_out, covariance=numbers, shared=known.shared, repeats=quiet.repeats,
            probability=probability, target=known.target, drawn=known.drawn,
            quiet=None if quiet.train is train else less, stops=known.stops,
            guarding=None if held_out is None else quiet.guards,
        )  # fmt: skip
        counts = known.unstated and quiet.repeats is None and found.n_guards + found.n_ranged > 0
        found = replace(found, noise_counts=counts)
        if turned is None:
            return found
        guards = None if held_out is None else quiet.guards
        return replace(adding(found, turned.covariance, guards), turned=turned.size)

    use: Measurements | None = test if len(test) else None
    belief = believed(use)
    points = test.rows(~test.is_distance)
    sure = belief if np.isfinite(belief.misfit.upper) else believed(None)
    alone, strays, unshown = None, None, belief.datum is not None and len(points) > 0
    if unshown:
        use, belief = None, believed(None)
    elif far_off(sure, points):
        alone = believed(None)
        strays = strays_of(alone, points, fit, train)
        if strays is not None:
            points = points.rows(~np.isin(points.pose_id, strays.poses))
    frame = (
        unshown_frame(belief, points, fit, train)
        if unshown
        else _likeliest_frame(sure, points, fit, train, visits=known.stations_are_visits)
    )
    if frame is not None and frame.found and not frame.unshown:
        alone = believed(None) if alone is None else alone
        frame = replace(frame, within=_half_radius(alone, points, known))
        ruler = alone if np.isfinite(alone.misfit.upper) else sure
        frame = after_the_motion(frame, ruler, points, fit, train)
        if frame.in_part and strays is None:
            frame, strays = _without_few(frame, sure, ruler, points, fit, train)
        elif frame.found and strays is not None:
            strays = without_motion(
                strays, alone.model, test.rows(~test.is_distance), seen_by=frame.station,
                station=frame.both or not frame.at_tool, target=frame.both or frame.at_tool,
            )  # fmt: skip
        use, belief = (None, alone) if frame.found else (use, belief)
    slow = None
    shared: Array | float = 0.0 if known.shared is None else known.shared
    if known.order is not None:
        nobody = np.zeros(0, dtype=np.int64)
        slow = drifting(
            fit, train, known.order[0], test if use is not None else test.rows(nobody),
            known.order[1] if use is not None else known.order[1][nobody],
            hidden=belief.misfit, whatever=bool(known.unmodelled),
        )  # fmt: skip
        if slow is not None and slow.covariance is not None:
            belief = adding(belief, slow.covariance, None if use is None else quiet.guards)
            shared = shared + slow.covariance
    belief = counted(belief, None if use is None else quiet.guards, shared=shared)
    return (belief if np.isfinite(belief.misfit.upper) else None), frame, slow, strays


def _with_drift(fit: Identification, known: Circumstances) -> Array | None:
    """What all readings share (P, P), and by which any tool point may stand off as the arm drifts.

    A drift that visits show is in no misfit, which poses have, and in no scatter of the joints: as
    a place of the base that may be anywhere in it, it is at each tool point as large as it was.
    """
    if known.drifts <= 0:
        return known.shared
    names = fit.model.names
    own = np.isin(names, [f"base.{axis}" for axis in "xyz"])
    wanders = np.diag(np.where(own, known.drifts**2, 0.0))
    return wanders if known.shared is None else known.shared + wanders


def _without_few(
    frame: OtherFrame, sure: Belief, alone: Belief, points: Measurements, fit: Identification,
    train: Measurements,
) -> tuple[OtherFrame, Strays | None]:  # fmt: skip
    """The motion of all held-out poses but a few that stand out beside it, if it explains these."""
    own = points.rows(points.station == frame.station)
    one = (not frame.at_tool, frame.at_tool)
    for station, target in (one, one[::-1], (True, True)):
        found = strays_beside(alone, own, fit, train, station=station, target=target)
        if found is None:
            continue
        strays, rest = found[0], own.rows(found[1])
        again = replace(other_frame(sure, rest, fit, train), within=frame.within)
        again = after_the_motion(again, alone, rest, fit, train)
        if again.found:
            return again, strays
    return frame, None


def _likeliest_frame(
    belief: Belief, points: Measurements, fit: Identification, train: Measurements, *, visits: bool
) -> OtherFrame | None:
    """Whether rows stand in another frame; of several visits the likeliest, after Bonferroni."""
    if not np.isfinite(belief.misfit.upper):
        return None
    each = [points.rows(points.station == s) for s in np.unique(points.station)]
    if len(each) > 1 and not visits:
        return None
    asked = [some for some in each if some.n_poses >= FEWEST]
    found = [other_frame(belief, some, fit, train) for some in asked]
    count = len(found)
    return min(
        (
            replace(one, p_base=min(1.0, count * one.p_base), p_tool=min(1.0, count * one.p_tool))
            for one in found
        ),
        key=lambda one: min(one.p_base, one.p_tool), default=None,
    )  # fmt: skip


def _half_radius(alone: Belief, points: Measurements, known: Circumstances) -> float:
    """Half of R95 at the held-out poses, by what is believed without their readings [m]."""
    if not np.isfinite(alone.misfit.upper):
        return 0.0
    there = alone.regions(points.q, target=known.target, at=points.conditions)
    return common_radius(there) / 2


def stated_radius(
    belief: Belief, fit: Identification, train: Measurements, test: Measurements,
    frame: OtherFrame | None, known: Circumstances, quiet: MeasuredNoise,
) -> StatedPoint:  # fmt: skip
    """The believed radius at poses like the held-out ones, or else those identified from.

    At poses identified from, each counts as one that was left out, for further ones like it are.
    """
    held = len(test) > 0 and (frame is None or not frame.found)
    where = test if held else train
    sd = known.repeatability
    if sd is not None:
        (sd,) = check(f"{belief.model.chain.n_joints}", repeatability=sd)
    first = np.unique(where.pose_id, return_index=True)[1]
    unseen = growth = None
    if not held:
        T, J = belief.model.poses_and_jacobian(where.q[first], where.conditions.rows(first))
        there = ToolTarget.of(known.target).positions_and_rows(belief.model, T, J)
        unseen = left_out_covariance(fit, train, belief.relative(*there))
        unseen *= belief.misfit.larger_noise**2
        growth = left_out_growth(fit, train, belief.proven)
    return stated_point(
        belief, where.q[first], at=where.conditions.rows(first),
        target=known.target, held_out=held, repeatability=sd,
        told_by=known.told_by,
        measured=quiet.guards.rows(~quiet.guards.is_distance)
        if held and belief.n_guards
        else None,
        visits=known.stations_are_visits, unseen=unseen, growth=growth,
    )  # fmt: skip
