"""The poses of a plan and the uncertainty predicted for them; the one door to calib's design."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.design import (
    UNTOLD,
    PoseBudget,
    Problem,
    best_next,
    certify,
    exchange,
    pose_budget,
    random_selection,
)
from calib.design.blocks import has_full_rank, unobservable_in_words
from calib.design.certificate import no_proof
from calib.design.problem import NO_POSES
from calib.design.relaxation import relaxation
from calib.errors import InputError, refuse
from testbed.laboratory.tracker.predicted import goal_u
from testbed.lengths import as_stated
from testbed.plan.lengths import length
from testbed.plan.promises import OVER, efficiency_word, factor_words
from testbed.plan.records import Curve, NextPose, Proof
from testbed.plan.task import DesignTask, rms
from testbed.units import UM, counted

RANDOM_SETS = 40
"""Random sets behind each value of the curve."""
CURVE_RESTARTS = 2
"""Local searches of the exchange at each point of the curve."""
CURVE_POINTS = 9
MOST_POSES = 200
"""Largest number of poses looked at for a target."""
NEXT_POSES = 5
NO_TARGET = 1e-12
"""Below what any number of poses reaches [m]: the curve alone is wanted."""


def designed(task: DesignTask, rng: np.random.Generator) -> tuple[Index, str, PoseBudget]:
    """The chosen places (m,) in the pool, who found them, and what other numbers of poses reach.

    With a target the number is the smallest that reaches it, and the method is that of the set
    kept: the scenario's, or the exchange behind the curve.

    Raises
    ------
    InputError
        The poses cannot tell the numbers apart, or no number of poses reaches the target.
    """
    if task.target is None:
        # first the set: its errors name the number of poses asked for
        places = _told(task, task.select(task.settings.poses, rng).indices)
        problem = task.problem(len(task.blocks), task.judge)
        counts = _counts(problem, task.settings.poses)
        budget = pose_budget(problem, NO_TARGET, rng, counts=counts, restarts=1)
        return np.sort(places), task.settings.method, budget
    most = min(MOST_POSES, len(task.blocks))
    if most < task.fewest:
        raise too_few(task, most)
    problem = task.problem(most, task.judge)
    # where no set of the largest number reaches it, there is nothing to climb to
    only = [problem.m] if relaxation(problem).figure > task.target else None
    budget = pose_budget(problem, task.target, rng, counts=only, restarts=CURVE_RESTARTS)
    if (budget.smallest or most) < task.fewest:
        # reached without an equation to spare: from there on
        spare = replace(problem, fewest=task.fewest)
        budget = pose_budget(spare, task.target, rng, restarts=CURVE_RESTARTS)
    if budget.smallest is None:
        target, k = task.settings.target_um, task.settings.coverage * 1e6
        reached, possible = float(budget.reached[-1]) * k, float(budget.possible[-1]) * k
        part = k * task.u_shared(budget.chosen)
        shared = f" ({_three(part)} um from the tracker's systematic errors)" if task.inputs else ""
        raise refuse(
            "plan.target_um", target,
            f"they reach {_three(reached)} um{shared}, and no set of so many goes below "
            f"{_three(possible)} um",
            code="S37", fix="ask for less, measure better, or enlarge [pool] size",
            message=f"[plan] target_um is {target:g}, which "
            f"{_poses(len(budget.chosen), 'do', 'does')} not reach",
        )  # fmt: skip
    own, method = _found(task, budget.smallest, rng), task.settings.method
    places = budget.chosen if own is None else min((own, budget.chosen), key=task.u)
    if places is budget.chosen:
        method = "exchange"
    while len(places) > max(budget.proven or 1, task.fewest):
        # the curve's few starts may miss a smaller set that the method itself finds
        fewer = _found(task, len(places) - 1, rng)
        if fewer is None or task.u(fewer) > task.target:
            break
        places, method = fewer, task.settings.method
    return np.sort(places), method, budget


def check_enough(task: DesignTask) -> None:
    """Refuse a number of poses that leaves the calibration no equation to judge itself by."""
    if 0 < task.settings.poses < task.fewest:
        raise too_few(task, task.settings.poses)


def too_few(task: DesignTask, m: int) -> InputError:
    """The error for m poses whose equations are no more than the numbers, as `identify` has it."""
    _, r, p = task.blocks.shape
    equations = len(task.before) + m * r
    beside = f", with the {len(task.before) // r} measured already," if len(task.before) else ""
    value = task.settings.poses
    what = f"[plan] poses is {value}" if value else f"the pool has {m}"
    return refuse(
        "plan.poses", value, code="M27",
        message=f"{what}: {counted(m, 'pose')}{beside} {'give' if m > 1 else 'gives'} {equations} "
        f"equations for {p} numbers, and a calibration needs more equations than numbers",
        fix=f"{'write poses =' if value else 'enlarge [pool] size to'} {task.fewest} or more",
    )  # fmt: skip


def _found(task: DesignTask, m: int, rng: np.random.Generator) -> Index | None:
    """The scenario's method's set of m poses; None if it finds none that tells all numbers."""
    try:
        places = task.select(m, rng).indices
    except InputError as error:
        if error.code != UNTOLD:
            raise
        return None
    return places if task.is_told_by(places) else None


def _told(task: DesignTask, places: Index) -> Index:
    """The set, if it tells all numbers apart: one drawn at random may not."""
    if task.is_told_by(places):
        return places
    words = unobservable_in_words(task.rows(places)[:, : task.p], task.names)
    raise refuse(
        "plan.method", task.settings.method, words, code=UNTOLD,
        message=f"the {counted(len(places), 'pose')} of [plan] method "
        f'"{task.settings.method}" cannot tell the {task.p} numbers apart',
        fix='write method = "exchange", or more poses',
    )  # fmt: skip


def _counts(problem: Problem, m: int) -> list[int]:
    """Numbers of poses to show around m."""
    fewest = min(problem.fewest + 1, m)
    most = min(max(2 * m, fewest + 1), len(problem.pool))
    return sorted({m, *(int(value) for value in np.geomspace(fewest, most, CURVE_POINTS).round())})


def curve_of(
    task: DesignTask, budget: PoseBudget, smallest: int, places: Index, rng: np.random.Generator
) -> Curve:
    """The budget with the plan's own set in it and random sets beside it.

    The set may have more poses than the smallest number that reaches the target.
    """
    told = np.isfinite(budget.reached)
    counts, u, bound = budget.counts[told], budget.reached[told], budget.possible[told]
    sets = [budget.sets[k] for k in np.flatnonzero(told)]
    m, at = len(places), int(np.searchsorted(counts, len(places)))
    if at == len(counts) or counts[at] != m:
        limit = certify(task.problem(m, task.judge), places)
        counts, u = np.insert(counts, at, m), np.insert(u, at, np.inf)
        bound = np.insert(bound, at, np.nan if limit is None else limit.figure_bound)
        sets.insert(at, places)
    # the plan's point is what it promises, even where another set does better
    sets[at] = places
    own = task.u(places)
    u = np.where(counts == m, np.minimum(own, u), u)
    if not task.inputs:
        # another pose never hurts: what fewer poses reach, more reach as well; errors in common
        # may reach the goal through it
        u = np.minimum.accumulate(u)
    fewest = None if task.target is None else max(budget.proven or 0, task.fewest)
    return Curve(
        counts=frozen(counts, np.int64),
        u=frozen(np.where(counts == m, own, u)),
        shared=frozen([task.u_shared(places) for places in sets]),
        # and what more poses cannot, fewer cannot either
        bound=frozen(np.fmax.accumulate(bound[::-1])[::-1]),
        random=frozen(random_u(task, counts, rng)),
        random_sets=RANDOM_SETS,
        target=task.target,
        reached=fewest if fewest in (None, 0) else smallest,
        fewest=fewest,
        sentence="" if fewest is None else _sentence(task, smallest, fewest),
    )


def _sentence(task: DesignTask, m: int, proven: int) -> str:
    """What is proven about the number of poses."""
    settings = task.settings
    over = OVER["G" if settings.target_is == "worst" else "V"]
    target, here = settings.target_um / UM, 0.0
    if not proven:
        here = settings.coverage * task.u(NO_POSES)
    said = as_stated(target, here).replace("um", "µm")
    asked = f"U = {said} ({factor_words(settings.coverage, over)})"
    reach = _poses(m, "reach", "reaches", "more pose" if len(task.before) else "pose")
    if not proven:
        before = counted(len(task.before) // task.blocks.shape[1], "pose")
        gives = f"they give {length(here, target)} without another"
        return f"The {before} measured already reach {asked}: {gives}"
    if m == proven:
        return f"{reach} {asked}, and it is proven that no fewer can"
    return f"{reach} {asked}; it is proven that fewer than {proven} from this pool do not"


def _three(size: float) -> str:
    """Three digits, in the unit of the key that it is held against."""
    return f"{float(f'{size:.3g}'):g}"


def _poses(m: int, verb: str, singular: str, noun: str = "pose") -> str:
    """So many poses do something."""
    return f"{counted(m, noun)} {singular if m == 1 else verb}"


def proof_of(task: DesignTask, places: Index) -> Proof:
    """How far a set can be from the best one of its size."""
    found = certify(task.problem(len(places), task.criterion), places)
    if found is None:
        return Proof(None, None, no_proof(task.criterion))
    sentence, k, criterion = found.sentence, task.settings.coverage, task.settings.criterion
    if criterion in OVER:
        # in the unit of everything else a plan says: expanded, not standard, uncertainty
        bound, reached = k * found.figure_bound, k * found.figure
        even = ", even if its estimate found the tracker's systematic errors as well"
        sentence = (
            f"{criterion}-efficiency at least {efficiency_word(found.efficiency)}: no other set of "
            f"{len(places)} from the {len(task.blocks)} poses of the pool goes below "
            f"U = {length(bound, reached, digits=4)} "
            f"({factor_words(k, OVER[criterion])}){even if task.inputs else ''}; "
            f"this set reaches {length(reached, bound, digits=4)}"
        )
    elif task.inputs:
        sentence += "; the criterion counts noise alone, not the tracker's systematic errors"
    return Proof(found.efficiency, found.figure_bound, sentence)


def random_u(task: DesignTask, counts: Index, rng: np.random.Generator) -> Array:
    """Median (k,) of the goal uncertainty over random sets; nan if half of them tell nothing."""
    values = np.empty(len(counts))
    for i, m in enumerate(counts):
        sets = [random_selection(len(task.blocks), int(m), rng) for _ in range(RANDOM_SETS)]
        values[i] = np.median(
            [
                task.u(places) if has_full_rank(task.rows(places)[:, : task.p]) else np.inf
                for places in sets
            ]
        )
    return np.where(np.isfinite(values), values, np.nan)


def next_poses(task: DesignTask, places: Index) -> tuple[NextPose, ...]:
    """The best poses to measure in addition to a set, judged by the goal's uncertainty."""
    if len(places) == len(task.blocks):
        return ()
    ranking = best_next(task.problem(1, task.judge, given=places), shown=NEXT_POSES)
    return tuple(
        NextPose(int(place), float(u))
        for place, u in zip(ranking.indices, ranking.figure, strict=True)
    )


def quick_design(task: DesignTask, m: int, rng: np.random.Generator) -> Index:
    """A set of m poses to compare stations by: the same number and procedure for each."""
    return exchange(task.problem(m, task.judge), rng, restarts=1).indices


def leverages(blocks: Array, M: Array) -> Array:
    """Leverage tr K_jj (N,) of blocks (N, r, p): their weight against information M (p, p)."""
    n, r, p = blocks.shape
    half = np.linalg.solve(np.linalg.cholesky(M), blocks.reshape(-1, p).T)
    return np.asarray((half**2).sum(axis=0).reshape(n, r).sum(axis=1))


def u_while_measuring(task: DesignTask, places: Index) -> Array:
    """Goal uncertainty (m,) after each pose of a set in order; nan while it is endless."""
    out = np.full(len(places), np.nan)
    for k in range(len(places)):
        A = task.rows(places[: k + 1])
        if has_full_rank(A[:, : task.p]):
            out[k] = rms(goal_u(A.T @ A, task.goals.rows).whole, task.goals.weights)
    return out
