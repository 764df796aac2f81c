"""The re-examination of the paper in result.json and arrays.npz; units in the names."""

from collections.abc import Iterator

import numpy as np

from testbed.store.quantities import METRE, ONE, Quantity, Unit, as_json, below, fields_of, in_si
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022.calibrated_sets.records import random_calibrations_of
from testbed.studies.wen2022.calibrated_sets.summary import OverSets, Rank, ranks
from testbed.studies.wen2022.claims import Examined, examine, plays_paper
from testbed.studies.wen2022.cloud.draws import clouds_of, ranges_of
from testbed.studies.wen2022.ratio import over, printed_split
from testbed.studies.wen2022.records import (
    ESTIMATORS,
    STATEMENTS,
    TYPE_A,
    PaperBudget,
    Reexamined,
    paper_budget_of,
    reexamined_of,
    tool_point_of,
)
from testbed.studies.wen2022.stated import Judged, judged_statements
from testbed.studies.wen2022.summary import Reexamination, of_kind, reexamination_of
from testbed.units import Mean

ARRAYS = {name: name for name in ("pool", "u_best", "u_r", "u_p", "u_w")} | {
    "held_out_error_m": "error",
    "own_error_before_m": "own_before",
    "own_error_after_m": "own_after",
    "inside": "inside",
}
"""Names of arrays over robots, and the fields of their record."""
SET_ARRAYS = {name: name for name in ("indices", "index")} | {
    "own_error_before_m": "own_before",
    "own_error_after_m": "own_after",
    "held_out_error_m": "error",
}
"""Names of arrays over calibrated sets, and the fields of their record."""
SPLIT = {name: name for name in ("ratio", "repeats", "counted", "geometric")} | {
    "variance_shares": "shares",
    "u_p_over_u_r": "p_over_r",
    "u_w_over_u_r": "w_over_r",
}
"""Names of the ratio of the protocol and its parts."""
PARTS = ("best", "random", "repeatability", "pose_number", "location")
"""Uncertainties of the paper's budget."""
TABLES = {"own_before_mm": "own_before", "own_after_mm": "own_after", "held_out_mm": "after"}
"""Names of the figures of Tables 1 and 2."""


def published(campaign: Campaign) -> Iterator[Quantity]:
    """The paper's ratios and tool point on this robot, and its protocol on many."""
    budget, tool = paper_budget_of(campaign), tool_point_of(campaign)
    if budget is not None:
        yield Quantity("paper_budget/trial", budget.trials[0])
        yield from below("paper_budget", _ratios(budget, 0))
        for k, name in enumerate(budget.trials):
            yield from below(f"paper_budget/trials/{name}", _ratios(budget, k))
            trial = next(trial for trial in campaign.trials if trial.name == name)
            if (stated := judged_statements(campaign, trial)) is not None:
                yield from below(f"paper_budget/trials/{name}/inside_95", _inside(stated))
    if tool is not None:
        for source, distance, u in zip(tool.source, tool.distance_sd, tool.spatial, strict=True):
            key = f"tool_point/{source}"
            yield Quantity(f"{key}/zero_pose_u_distance_mm", distance[0], METRE)
            yield Quantity(f"{key}/held_out_mean_u_distance_mm", distance[1:].mean(), METRE)
            yield Quantity(f"{key}/zero_pose_u_3d_mm", u[0], METRE)
            yield Quantity(f"{key}/held_out_mean_u_3d_mm", u[1:].mean(), METRE)
        full = np.sqrt(tool.covariance.trace(axis1=2, axis2=3))
        for name, u in zip(tool.trials, full, strict=True):
            key = f"tool_point/full covariance, {name}"
            yield Quantity(f"{key}/zero_pose_u_3d_mm", u[0], METRE)
            yield Quantity(f"{key}/held_out_mean_u_3d_mm", u[1:].mean(), METRE)
    for one in ranges_of(clouds_of(campaign)):
        key = f"tool_point/{one.source}/zero_pose_range/{one.axis}"
        key += "_printed" if one.printed else ""
        yield Quantity(f"{key}/from_nominal_mm", one.ends, METRE)
        yield Quantity(f"{key}/half_width_in_u", one.half_width)
        yield Quantity(f"{key}/as_predicted", one.good)
    examined, again = examine(campaign), reexamination_of(campaign)
    if examined is not None and again is None and plays_paper(campaign.scenario):
        yield Quantity("claims", _claims(examined))
    for rank in ranks(campaign):
        yield from below(f"random_calibrations/{rank.trial}", _rank(rank))
    if again is not None:
        yield from below("reexamined", _reexamined(again, examined))


def _claims(examined: Examined) -> dict[int, dict[str, str]]:
    """Verdict, figure and reasons of each claim."""
    return {
        number: {"verdict": found.verdict, "here": found.ours, "why": found.sentence}
        for number, found in examined.findings.items()
    }


def _ratios(budget: PaperBudget, k: int) -> list[Quantity]:
    """Ratios of the k-th designed set to the random side."""
    return [
        Quantity("mean_u_ratio_best_to_random", budget.ratio[k]),
        Quantity("mean_u_r_ratio_best_to_random", budget.repeats_ratio[k]),
    ]


def _inside(stated: Judged) -> list[Quantity]:
    """Shares of truth inside the paper's type A statements, and by the covariance of its fit."""
    return [
        *map(Quantity, (f"type_a_{name}" for name in TYPE_A), stated.type_a),
        Quantity("type_a_numbers", stated.numbers),
        Quantity("unweighted_fit_region", stated.unweighted),
        Quantity("unweighted_fit_numbers", stated.unweighted_numbers),
    ]


def published_arrays(campaign: Campaign) -> list[Quantity]:
    """Arrays over robots, and over calibrated sets on this one."""
    many = {
        f"reexamined/{study.truth}/{name}": getattr(study, field)
        for study in reexamined_of(campaign)
        for name, field in ARRAYS.items()
    }
    study = random_calibrations_of(campaign)
    sets = {
        f"random_calibrations/{one.trial}/{kind}/{name}": getattr(getattr(one, kind), field)
        for one in (study.sets if study else ())
        for kind in ("designed", "random")
        for name, field in SET_ARRAYS.items()
    }
    budget = paper_budget_of(campaign)
    parts = {} if budget is None else {f"paper_budget/{n}": getattr(budget, n) for n in PARTS}
    return in_si(many | sets | parts)


def _rank(rank: Rank) -> Iterator[Quantity]:
    """One designed set among random ones; figures independent of the estimator occur once."""
    key = rank.estimator
    if key == ESTIMATORS[0]:
        yield Quantity("poses", rank.poses)
        yield Quantity("index/name", rank.index)
        yield Quantity("index/designed", rank.designed_index)
        yield from _spread("index/random", rank.random_index)
        yield Quantity("own_before_mm", rank.own_before, METRE)
        yield from _spread("random_own_before", rank.random_own_before, METRE)
        yield Quantity("starts_lower_than", rank.starts_lower_than)
    names = {"held_out_mm": "designed", "own_after_mm": "own_after"}
    counts = {name: name for name in ("sets", "better_than", "own_lower_than")}
    yield from below(key, fields_of(rank, names | counts))
    yield from _spread(f"{key}/random_held_out", rank.random, METRE)
    yield Quantity(f"{key}/random_held_out_smallest_mm", rank.smallest, METRE)
    yield Quantity(f"{key}/random_held_out_largest_mm", rank.largest, METRE)
    yield from _spread(f"{key}/random_own_after", rank.random_own_after, METRE)
    yield Quantity(f"{key}/rank_correlation", rank.correlation)
    yield Quantity(f"{key}/rank_correlation_ci_95", rank.correlation_ends)


def _spread(name: str, figure: OverSets, unit: Unit = ONE) -> Iterator[Quantity]:
    """Mean and standard deviation between sets, lengths in mm."""
    ending = "_mm" if unit is METRE else ""
    yield Quantity(f"{name}_mean{ending}", figure.mean, unit)
    yield Quantity(f"{name}_sd{ending}", figure.sd, unit)


def _reexamined(again: Reexamination, examined: Examined | None) -> Iterator[Quantity]:
    """Every figure of the re-examination with its interval, and the verdict on each claim."""
    yield Quantity("robots", again.robots)
    yield Quantity("pools", len(again.sets.pool_q))
    yield Quantity("judged_on", again.judged.truth)
    yield Quantity("claims", {} if examined is None else _claims(examined))
    yield Quantity("claims_that_hold", examined.count("holds") if examined else 0)
    yield from below("printed", fields_of(printed_split(), SPLIT))
    for name, counts in zip(("O1", "O2"), again.sets.pose_number.T, strict=True):
        yield Quantity(f"pose_number/{name}/median", np.median(counts))
        yield Quantity(f"pose_number/{name}/smallest", counts.min())
        yield Quantity(f"pose_number/{name}/largest", counts.max())
    for one in again.predictions:
        key = f"predicted/{one.trial} against random {one.against}, {one.estimator}"
        yield from below(key, fields_of(one, {"numbers": "numbers", "tool": "tool"}))
    for kind in again.kinds:
        yield from below(f"truths/{kind.truth}", _on_one_kind(again, kind))


def _on_one_kind(again: Reexamination, kind: Reexamined) -> Iterator[Quantity]:
    """The figures on one kind of robots."""
    yield Quantity("before_mm", over(kind.before, kind.pool), METRE)
    for split in of_kind(again.splits, kind):
        yield from below(f"protocol/{split.trial}", fields_of(split, SPLIT))
    if not again.errors:
        yield Quantity("error", {})
    for one in of_kind(again.errors, kind):
        key = f"error/{one.trial}, {one.estimator}"
        yield from below(key, fields_of(one, {"designed_mm": "error", "random_mm": "other"}))
        yield Quantity(f"{key}/ratio", np.exp(one.ratio.value))
        yield Quantity(f"{key}/ci_95", [np.exp(one.ratio.low), np.exp(one.ratio.high)])
        yield Quantity(f"{key}/joint_ci_95", [np.exp(one.joint.low), np.exp(one.joint.high)])
        yield Quantity(f"{key}/outcome", one.outcome)
    for held in of_kind(again.statements, kind):
        key = f"inside_95/{held.trial}"
        names, shares = (*STATEMENTS, "numbers"), (*held.shares, held.numbers)
        yield from below(key, map(Quantity, names, map(_share, shares)))
        yield from below(key, fields_of(held, {"stated_u_mm": "u"}))
    tables = [
        {"poses": row.printed.poses, "optimal": row.printed.optimal}
        | as_json(fields_of(row, TABLES))
        for row in again.paper_rows(kind)
    ]
    yield Quantity("tables", tables)


def _share(mean: Mean) -> dict[str, object]:
    """A share with its interval, limited to 0 and 1."""
    return {"value": mean.value, "ci_95": [max(mean.low, 0.0), min(mean.high, 1.0)]}
