"""The story of a plan as a row of frames: the candidates, the budget, the tour, the goal."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array, Index
from testbed.plan.records import Plan
from testbed.recording.story import candidates, eased, frames_per_pose, glide

PlanPhaseName = Literal["candidates", "budget", "tour", "goal"]
PLAN_PHASES: tuple[PlanPhaseName, ...] = ("candidates", "budget", "tour", "goal")
LOCAL: dict[PlanPhaseName, str] = {
    "candidates": "candidate",
    "budget": "number",
    "tour": "pose",
    "goal": "goal_pose",
}
"""Name of each phase's own timeline."""
CANDIDATE_FRAMES, BUDGET_FRAMES = 144, 60
MOST_GOALS = 30
"""Goal postures the robot goes to; the others are drawn as points."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanPhase:
    """A stretch of the timeline and where its rows lie on it."""

    name: PlanPhaseName
    start: int
    stop: int
    """First step after the phase."""
    at: Index
    """(k,) step of each item."""

    @property
    def local(self) -> str:
        """Name of the phase's own timeline."""
        return LOCAL[self.name]


@dataclass(frozen=True, slots=True, eq=False)
class PlanStory:
    """A plan, laid out on the timeline."""

    plan: Plan
    phases: tuple[PlanPhase, ...]
    q: Array
    """(s, n) drawn joint values at every step [rad, m]."""
    goals: Index
    """Goal postures that are visited."""

    @property
    def n_steps(self) -> int:
        """Steps of the whole timeline."""
        return len(self.q)

    def phase(self, name: PlanPhaseName) -> PlanPhase:
        """The phase with this name."""
        return self.phases[PLAN_PHASES.index(name)]


def tell_plan(plan: Plan) -> PlanStory:
    """Lay out the frames of a plan."""
    tour = plan.tour
    goals = np.unique(np.linspace(0, len(plan.goal.q) - 1, MOST_GOALS).round().astype(np.int64))
    goals = goals[: len(plan.goal.q)]
    per_pose, per_goal = frames_per_pose(len(tour)), frames_per_pose(len(goals))
    counts = len(plan.curve.counts)
    budget = counts * max(1, BUDGET_FRAMES // counts)
    lengths = (CANDIDATE_FRAMES, budget, per_pose * len(tour), per_goal * len(goals))
    starts = np.concatenate([[0], np.cumsum(lengths)])
    at: tuple[Index, ...] = (
        starts[:1],
        starts[1] + np.round(np.linspace(0, budget - 1, counts)).astype(np.int64),
        starts[2] + per_pose * np.arange(len(tour)) + max(per_pose - 2, 0),
        starts[3] + per_goal * np.arange(len(goals)) + max(per_goal - 2, 0),
    )
    phases = tuple(
        PlanPhase(name, int(starts[k]), int(starts[k + 1]), at[k])
        for k, name in enumerate(PLAN_PHASES)
    )
    q = np.vstack(
        [
            glide(candidates(plan.pool.q, CANDIDATE_FRAMES), CANDIDATE_FRAMES),
            np.repeat(tour.start[None], budget, axis=0),
            driven(plan, per_pose),
            glide(plan.goal.q[goals], lengths[3]),
        ]
    )
    return PlanStory(plan, phases, q, goals)


def driven(plan: Plan, frames: int) -> Array:
    """Joint values (s, n) along the tour, `frames` per pose, through its stops on the way."""
    tour, before, rows = plan.tour, plan.tour.start, []
    moving = max(frames - 2, 1)
    for q, vias in zip(tour.q, tour.vias, strict=True):
        corners = np.vstack([before, *vias, q])
        legs = np.abs(np.diff(corners, axis=0)).max(axis=1)
        way = np.concatenate([[0.0], np.cumsum(legs)])
        part = eased(np.arange(1, moving + 1) / moving) * way[-1]
        leg = np.clip(np.searchsorted(way, part, side="left") - 1, 0, len(legs) - 1)
        share = (part - way[leg]) / np.maximum(legs[leg], 1e-12)
        points = corners[leg] + share[:, None] * (corners[leg + 1] - corners[leg])
        points[-1] = q
        rows.append(np.vstack([points, np.repeat(q[None], frames - moving, axis=0)]))
        before = q
    return np.vstack(rows)
