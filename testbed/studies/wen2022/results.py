"""The re-examination of the paper in result.json and arrays.npz; units in the names."""

from typing import Any

import numpy as np

from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022.claims import Examined, examine
from testbed.studies.wen2022.claims_many_robots import like_the_paper, paper_rows, pools_of
from testbed.studies.wen2022.records import (
    STATEMENTS,
    paper_budget_of,
    reexamined_of,
    tool_point_of,
)
from testbed.studies.wen2022.summary import (
    Split,
    errors,
    over,
    predictions,
    printed_split,
    splits,
    statements,
)
from testbed.units import METRE, MM, Mean, Quantity, in_si


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
        u3 = np.sqrt((tool.spread**2).sum(axis=-1))
        for source, distance, u in zip(tool.source, tool.distance_sd, u3, strict=True):
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
        found.append(Quantity("reexamined", reexamined_headline(campaign, examine(campaign))))
    return found


def published_arrays(campaign: Campaign) -> list[Quantity]:
    """What each robot gave."""
    return in_si(reexamined_arrays(campaign))


def reexamined_headline(campaign: Campaign, examined: Examined | None) -> dict[str, Any]:
    """Every figure of the re-examination with its interval, and the verdict on each claim."""
    studies, sets = reexamined_of(campaign), pools_of(campaign)
    findings = () if examined is None else examined.findings
    return {
        "robots": studies[0].before.size,
        "pools": len(sets.pool_q),
        "judged_on": like_the_paper(studies).truth,
        "claims": {
            str(found.number): {"verdict": found.verdict, "here": found.ours} for found in findings
        },
        "claims_that_hold": sum(found.verdict == "holds" for found in findings),
        "printed": _split(printed_split()),
        "pose_number": {
            name: {
                "median": float(np.median(counts)),
                "smallest": int(counts.min()),
                "largest": int(counts.max()),
            }
            for name, counts in zip(("O1", "O2"), sets.pose_number.T, strict=True)
        },
        "predicted": {
            f"{one.trial} against random {one.against}, {one.estimator}": {
                "numbers": _mean(one.numbers),
                "tool": _mean(one.tool),
            }
            for one in predictions(sets)
        },
        "truths": {
            study.truth: {
                "before_mm": _mean(over(study.before, study.pool), MM),
                "protocol": {
                    one.trial: _split(one)
                    for one in splits(studies, sets)
                    if one.who == study.truth
                },
                "error": {
                    f"{one.trial}, {one.estimator}": {
                        "designed_mm": _mean(one.error, MM),
                        "random_mm": _mean(one.other, MM),
                        "ratio": float(np.exp(one.ratio.value)),
                        "ci_95": [float(np.exp(one.ratio.low)), float(np.exp(one.ratio.high))],
                        "joint_ci_95": [
                            float(np.exp(one.joint.low)),
                            float(np.exp(one.joint.high)),
                        ],
                        "outcome": one.outcome,
                    }
                    for one in errors(studies, sets)
                    if one.truth == study.truth
                },
                "inside_95": {
                    one.trial: {
                        name: _mean(mean) for name, mean in zip(STATEMENTS, one.shares, strict=True)
                    }
                    | {"numbers": _mean(one.numbers), "stated_u_mm": _mean(one.u, MM)}
                    for one in statements(studies)
                    if one.truth == study.truth
                },
                "tables": [
                    {
                        "poses": row.printed.poses,
                        "optimal": row.printed.optimal,
                        "own_before_mm": _mean(row.own_before, MM),
                        "own_after_mm": _mean(row.own_after, MM),
                        "held_out_mm": _mean(row.after, MM),
                    }
                    for row in paper_rows(study, sets) or ()
                ],
            }
            for study in studies
        },
    }


def reexamined_arrays(campaign: Campaign) -> dict[str, np.ndarray[Any, Any]]:
    """What each robot gave."""
    return {
        f"reexamined/{study.truth}/{name}": getattr(study, field)
        for study in reexamined_of(campaign)
        for name, field in (
            ("pool", "pool"),
            ("u_best", "u_best"),
            ("u_r", "u_r"),
            ("u_p", "u_p"),
            ("u_w", "u_w"),
            ("held_out_error_m", "error"),
            ("own_error_before_m", "own_before"),
            ("own_error_after_m", "own_after"),
            ("inside", "inside"),
        )
    }


def _split(split: Split) -> dict[str, Any]:
    """The ratio of the protocol and its parts."""
    return {
        "ratio": _mean(split.ratio),
        "repeats": _mean(split.repeats),
        "counted": _mean(split.counted),
        "geometric": list(split.geometric),
        "variance_shares": [_mean(part) for part in split.shares],
        "u_p_over_u_r": _mean(split.p_over_r),
        "u_w_over_u_r": _mean(split.w_over_r),
    }


def _mean(mean: Mean, scale: float = 1.0) -> dict[str, Any]:
    """A figure and its 95 % interval; no interval for what is printed or comes from one pool."""
    if not 0.0 < mean.half_width < float("inf"):
        return {"value": mean.value * scale, "ci_95": None}
    return {"value": mean.value * scale, "ci_95": [mean.low * scale, mean.high * scale]}
