"""The re-examination of the paper in result.json and arrays.npz; units in the names."""

from collections.abc import Iterator, Sequence

import numpy as np

from testbed.store.quantities import METRE, Quantity, as_json, below, fields_of, in_si
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022 import summary
from testbed.studies.wen2022.claims import examine
from testbed.studies.wen2022.records import (
    STATEMENTS,
    PoolSets,
    Reexamined,
    paper_budget_of,
    pools_of,
    reexamined_of,
    tool_point_of,
)

ARRAYS = {name: name for name in ("pool", "u_best", "u_r", "u_p", "u_w")} | {
    "held_out_error_m": "error",
    "own_error_before_m": "own_before",
    "own_error_after_m": "own_after",
    "inside": "inside",
}
"""Names of what each robot gave, and the fields of its record."""
SPLIT = {name: name for name in ("ratio", "repeats", "counted", "geometric")} | {
    "variance_shares": "shares",
    "u_p_over_u_r": "p_over_r",
    "u_w_over_u_r": "w_over_r",
}
"""Names of the ratio of the protocol and its parts."""


def published(campaign: Campaign) -> list[Quantity]:
    """The paper's ratios and tool point on this robot, and its protocol on many."""
    found = []
    budget, tool = paper_budget_of(campaign), tool_point_of(campaign)
    if budget is not None:
        key = "paper_budget/mean_u"
        repeats = budget.best_repeatability / budget.repeatability
        found += [
            Quantity(f"{key}_ratio_best_to_random", float((budget.best / budget.random).mean())),
            Quantity(f"{key}_r_ratio_best_to_random", float(repeats.mean())),
        ]
    if tool is not None:
        for source, distance, u in zip(tool.source, tool.distance_sd, tool.spatial, strict=True):
            found += [
                Quantity(f"tool_point/{source}/{name}", float(value), METRE)
                for name, value in (
                    ("zero_pose_u_distance_mm", distance[0]),
                    ("held_out_mean_u_distance_mm", distance[1:].mean()),
                    ("zero_pose_u_3d_mm", u[0]),
                    ("held_out_mean_u_3d_mm", u[1:].mean()),
                )
            ]
        full = np.sqrt(np.trace(tool.covariance, axis1=1, axis2=2))
        key = "tool_point/full covariance"
        found += [
            Quantity(f"{key}/trial", tool.trial),
            Quantity(f"{key}/zero_pose_u_3d_mm", float(full[0]), METRE),
            Quantity(f"{key}/held_out_mean_u_3d_mm", float(full[1:].mean()), METRE),
        ]
    if reexamined_of(campaign):
        found += below("reexamined", _reexamined(campaign))
    return found


def published_arrays(campaign: Campaign) -> list[Quantity]:
    """What each robot gave."""
    return in_si(
        {
            f"reexamined/{study.truth}/{name}": getattr(study, field)
            for study in reexamined_of(campaign)
            for name, field in ARRAYS.items()
        }
    )


def _reexamined(campaign: Campaign) -> Iterator[Quantity]:
    """Every figure of the re-examination with its interval, and the verdict on each claim."""
    studies, sets, examined = reexamined_of(campaign), pools_of(campaign), examine(campaign)
    findings = () if examined is None else examined.findings
    yield Quantity("robots", studies[0].before.size)
    yield Quantity("pools", len(sets.pool_q))
    yield Quantity("judged_on", summary.like_the_paper(studies).truth)
    claims = {found.number: {"verdict": found.verdict, "here": found.ours} for found in findings}
    yield Quantity("claims", claims)
    yield Quantity("claims_that_hold", sum(found.verdict == "holds" for found in findings))
    yield from below("printed", fields_of(summary.printed_split(), SPLIT))
    for name, counts in zip(("O1", "O2"), sets.pose_number.T, strict=True):
        yield Quantity(f"pose_number/{name}/median", np.median(counts))
        yield Quantity(f"pose_number/{name}/smallest", counts.min())
        yield Quantity(f"pose_number/{name}/largest", counts.max())
    for one in summary.predictions(sets):
        key = f"predicted/{one.trial} against random {one.against}, {one.estimator}"
        yield Quantity(f"{key}/numbers", one.numbers)
        yield Quantity(f"{key}/tool", one.tool)
    errors = summary.errors(studies, sets)
    for study in studies:
        yield from below(f"truths/{study.truth}", _on_one_kind(study, sets, errors))


def _on_one_kind(
    study: Reexamined, sets: PoolSets, errors: Sequence[summary.Errors]
) -> Iterator[Quantity]:
    """The same on one kind of robots."""
    yield Quantity("before_mm", summary.over(study.before, study.pool), METRE)
    for split in summary.splits([study], sets):
        yield from below(f"protocol/{split.trial}", fields_of(split, SPLIT))
    if not errors:
        yield Quantity("error", {})
    for one in (each for each in errors if each.truth == study.truth):
        key = f"error/{one.trial}, {one.estimator}"
        yield Quantity(f"{key}/designed_mm", one.error, METRE)
        yield Quantity(f"{key}/random_mm", one.other, METRE)
        yield Quantity(f"{key}/ratio", np.exp(one.ratio.value))
        yield Quantity(f"{key}/ci_95", [np.exp(one.ratio.low), np.exp(one.ratio.high)])
        yield Quantity(f"{key}/joint_ci_95", [np.exp(one.joint.low), np.exp(one.joint.high)])
        yield Quantity(f"{key}/outcome", one.outcome)
    for held in summary.statements([study]):
        key = f"inside_95/{held.trial}"
        for name, share in zip(STATEMENTS, held.shares, strict=True):
            yield Quantity(f"{key}/{name}", share)
        yield Quantity(f"{key}/numbers", held.numbers)
        yield Quantity(f"{key}/stated_u_mm", held.u, METRE)
    tables = [
        {
            "poses": row.printed.poses,
            "optimal": row.printed.optimal,
            **as_json(
                [
                    Quantity("own_before_mm", row.own_before, METRE),
                    Quantity("own_after_mm", row.own_after, METRE),
                    Quantity("held_out_mm", row.after, METRE),
                ]
            ),
        }
        for row in summary.paper_rows(study, sets) or ()
    ]
    yield Quantity("tables", tables)
