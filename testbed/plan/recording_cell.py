"""The cell and the words of a plan's recording."""

import numpy as np

from calib.arrays import Array
from testbed.plan.recording_story import PlanPhaseName, PlanStory
from testbed.plan.records import Plan
from testbed.plan.words import PROMISED, certificate_word, headline_rows, minutes, promise
from testbed.recording.cell import draw_arm, draw_beam, draw_box, draw_station
from testbed.recording.pen import Color, Pen, viridis
from testbed.report.page import SIMULATED
from testbed.robots.catalog import Robot
from testbed.units import counted

REASONS: tuple[tuple[str, Color], ...] = (
    ("red", (220, 60, 50)),
    ("orange", (245, 150, 40)),
    ("black", (40, 40, 40)),
    ("pink", (240, 120, 200)),
    ("brown", (130, 80, 40)),
    ("white", (255, 255, 255)),
)
"""Colors of rejected candidates by reason after the box; none of them is a color of the pool."""
CHOSEN, HELD_OUT = (90, 170, 255), (255, 180, 60)
"""Light: their numbers are written in the same colors on dark labels."""
OBSTACLE_COLOR = (150, 140, 128, 255)
GOAL_BOX_COLOR = (58, 140, 72, 200)
LABELLED = 60
"""More poses than this are not numbered."""


def _points(plan: Plan, q: Array) -> Array:
    """Nominal tool positions (m, 3) [m]."""
    return np.asarray(plan.nominal.poses(q)[:, :3, 3])


def draw_cell(writer: Pen[PlanStory], robot: Robot, floor: float) -> None:
    """Robot, tracker, obstacles and the two boxes, at all times."""
    import rerun as rr

    story, plan = writer.story, writer.story.plan
    chain, pool = plan.nominal.chain, plan.scenario.pool
    draw_arm(writer, "world/robot", robot, story.q, (chain,), np.zeros(story.n_steps, np.int64))
    T = plan.nominal.poses(story.q)
    probe = plan.readings[-1]
    aim = T[:, :3, :3] @ _offset(plan, probe.position)
    target = T[:, :3, 3] + aim
    draw_station(writer, plan.T_world_tracker, target, floor)
    tour = story.phase("tour")
    draw_beam(writer, plan.T_world_tracker, target, tour.start, tour.stop)
    center, size = np.array(pool.box_center_mm) / 1e3, np.array(pool.box_size_mm) / 1e3
    draw_box(writer, "world/box", chain, center, size)
    goal = plan.scenario.plan.goal
    if goal.kind == "box":
        middle = np.array(goal.center_mm or pool.box_center_mm) / 1e3
        edges = np.array(goal.size_mm or pool.box_size_mm) / 1e3
        draw_box(writer, "world/goal_box", chain, middle, edges, GOAL_BOX_COLOR)
    for k, obstacle in enumerate(plan.obstacles):
        path = f"world/obstacle{k + 1}"
        writer.transforms(path, obstacle.T_world_obstacle)
        if obstacle.mesh is None:
            box = rr.Boxes3D(
                centers=[0, 0, 0],
                sizes=obstacle.size,
                colors=OBSTACLE_COLOR,
                fill_mode="transparentfillmajorwireframe",  # what is behind it stays in sight
            )
            writer.static(f"{path}/body", box)
        else:
            body = rr.Mesh3D(
                vertex_positions=obstacle.mesh.vertices,
                triangle_indices=obstacle.mesh.faces,
                albedo_factor=OBSTACLE_COLOR,
            )
            writer.static(f"{path}/body", body)


def _offset(plan: Plan, seen: Array) -> Array:
    """(3,) the target the beam goes to, in the tool frame, from its readings at the tour [m]."""
    T = plan.nominal.poses(plan.tour.q[:1])[0]
    world = plan.T_world_tracker[:3, :3] @ seen[0] + plan.T_world_tracker[:3, 3]
    return np.asarray(T[:3, :3].T @ (world - T[:3, 3]))


def draw_candidates(writer: Pen[PlanStory]) -> None:
    """The pool by leverage until the tour begins; rejected candidates by reason at first."""
    import rerun as rr

    plan, phase = writer.story.plan, writer.story.phase("candidates")
    low, high = np.quantile(plan.leverage, (0.02, 0.98))
    colors = viridis(plan.leverage - low, float(high - low))
    pool = rr.Points3D(plan.pool.T[:, :3, 3], radii=0.0045, colors=colors)
    writer.at(phase.start, "world/pool", pool)
    writer.clear(writer.story.phase("tour").start, ["world/pool"])
    paths = []
    for name, (_, color) in reasons_shown(plan).items():
        q = plan.pool.rejected_q[[reason == name for reason in plan.pool.rejected_reason]]
        path = f"world/rejected/{name.replace(' ', '_')}"
        writer.at(phase.start, path, rr.Points3D(_points(plan, q), radii=0.006, colors=color))
        paths.append(path)
    writer.clear(phase.stop, paths)


def reasons_shown(plan: Plan) -> dict[str, tuple[str, Color]]:
    """Name and value of the color of each reason that rejected candidates are shown for."""
    pool = plan.pool
    names = [name for name in pool.rejection_names[1:] if name in pool.rejected_reason]
    return {name: REASONS[k % len(REASONS)] for k, name in enumerate(names)}


def draw_tour(writer: Pen[PlanStory]) -> None:
    """Chosen poses with their numbers, and the way of the tool as it grows."""
    import rerun as rr

    story, plan = writer.story, writer.story.plan
    phase, tour = story.phase("tour"), plan.tour
    points = _points(plan, tour.q)
    test = np.array([role == "test" for role in tour.roles])
    colors = np.where(test[:, None], HELD_OUT, CHOSEN).astype(np.uint8)
    labels = [str(k + 1) for k in range(len(tour))]
    writer.at(
        story.phase("budget").start,
        "world/chosen",
        rr.Points3D(
            points,
            radii=0.010,
            colors=colors,
            labels=labels if len(tour) <= LABELLED else None,
            show_labels=len(tour) <= LABELLED,
        ),
    )
    path = _points(plan, story.q[phase.start : phase.stop])
    steps = np.arange(phase.start, phase.stop)
    writer.every_step(
        "world/path",
        rr.LineStrips3D.columns(strips=[[path[: k + 1]] for k in range(len(path))]),
        steps,
    )
    writer.static("world/path", rr.LineStrips3D.from_fields(radii=0.0018, colors=(28, 92, 190)))
    writer.clear(phase.stop, ["world/chosen", "world/path"])


def draw_goal(writer: Pen[PlanStory]) -> None:
    """The goal's tool points by uncertainty, when the goal is looked at."""
    import rerun as rr

    story, plan = writer.story, writer.story.plan
    T = plan.nominal.poses(plan.goal.q)
    points = T[:, :3, 3] + T[:, :3, :3] @ plan.goal.point
    low = 0.6 * float(plan.u.min())
    colors = viridis(plan.u - low, float(plan.u.max()) - low)
    writer.at(
        story.phase("goal").start, "world/goal", rr.Points3D(points, radii=0.009, colors=colors)
    )


PHASE_COLORS: dict[PlanPhaseName, Color] = {
    "candidates": (128, 104, 98),
    "budget": (150, 110, 190),
    "tour": (52, 128, 196),
    "goal": (58, 140, 72),
}


def draw_texts(writer: Pen[PlanStory]) -> None:
    """The summary at all times, the explanation of each phase when it begins."""
    import rerun as rr

    markdown = rr.MediaType.MARKDOWN
    writer.static("summary", rr.TextDocument(summary(writer.story.plan), media_type=markdown))
    writer.static(
        "phase",
        rr.StateConfiguration(values=list(PHASE_COLORS), colors=list(PHASE_COLORS.values())),
    )
    for phase in writer.story.phases:
        text = explanation(writer.story, phase.name)
        writer.at(phase.start, "now", rr.TextDocument(text, media_type=markdown))
        writer.at(phase.start, "phase", rr.StateChange(state=phase.name))


def summary(plan: Plan) -> str:
    """The promise first, then the plan in numbers."""
    scenario = plan.scenario
    lines = [
        f"#### {scenario.title or scenario.name}",
        f"**{SIMULATED}** (plan of {scenario.name}, seed {scenario.seed})",
        "",
        promise(plan),
        "",
        "| | | |",
        "|---|--:|---|",
        *(
            f"| {what} | {value} | {unit} |"
            for k, (what, value, unit) in enumerate(headline_rows(plan))
            if k not in PROMISED
        ),
    ]
    return "\n".join(lines)


def explanation(story: PlanStory, phase: PlanPhaseName) -> str:
    """What is on the screen in a phase, in a few lines."""
    plan = story.plan
    pool, tour, k = plan.pool, plan.tour, plan.scenario.plan.coverage
    if phase == "candidates":
        shown = reasons_shown(plan)
        refused = [
            f"- refused, {name}: {int(count)}" + (f" ({shown[name][0]})" if name in shown else "")
            for name, count in zip(pool.rejection_names, pool.rejection_counts, strict=True)
            if count
        ]
        lines = [
            f"#### 1 Candidates: {len(pool.q)} of {pool.n_drawn} drawn",
            "- purple over green to yellow: the pool, with growing leverage",
            *refused,
            "- refused ones are shown inside the box only, at most 100 of each",
        ]
    elif phase == "budget":
        lines = [
            "#### 2 Number of poses",
            f"- blue curve: predicted U (k = {k:g}) of designed sets",
            "- vermilion: no set of that size goes below; gray: random sets, amber: target"
            if plan.curve.target is not None
            else "- vermilion: no set of that size goes below; gray: random sets",
            f"- from {plan.curve.counts[0]} to {plan.curve.counts[-1]} poses",
            f"- {plan.curve.sentence or plan.proof.sentence}",
            f"- {certificate_word(plan)}",
        ]
    elif phase == "tour":
        lines = [
            f"#### 3 Tour: {counted(len(tour), 'pose')} in {minutes(tour.duration)}",
            "- numbers: measuring order; blue: to identify from, orange: held out",
            "- line: the way of the tool; red: the beam",
            f"- {tour.sentence}",
        ]
    else:
        lines = [
            f"#### 4 Goal: {plan.goal.sentence}",
            "- purple over green to yellow: tool points of the goal, with growing uncertainty",
            f"- U (k = {k:g}): RMS {k * plan.u_mean * 1e6:.3g} µm, "
            f"worst {k * plan.u_worst * 1e6:.3g} µm",
        ]
    return "\n".join(lines)
