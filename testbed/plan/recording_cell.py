"""What a recording of a plan shows in the cell: stations, obstacles, candidates, tour, goal."""

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import target_points
from testbed.plan.records import Plan
from testbed.recording import style
from testbed.recording.cell import draw_beam, draw_box, draw_station
from testbed.recording.pen import Pen
from testbed.recording.story import floor_height
from testbed.recording.timeline import Phase, growing
from testbed.robots.robot import Robot

OBSTACLE_COLOR = (150, 140, 128, 255)
GOAL_BOX_COLOR = (*style.LEAF, 200)
MOST_STAGES = 60
"""Rows in which the way of the tool grows."""
CHOSEN, HELD_OUT = style.BLUE, style.ORANGE
"""Colors of the poses that identify and of those that judge."""
DARKEST = 0.6
"""Times the least u at which the colors of the goal begin: at zero all would look alike."""


def draw_cell(plan: Plan, robot: Robot, pen: Pen) -> None:
    """Tracker, obstacles and the two boxes, at all times."""
    import rerun as rr

    chain, pool, goal = plan.nominal.chain, plan.scenario.pool, plan.scenario.plan.goal
    target = _target(plan, pen.timeline.q)
    draw_station(pen, plan.T_world_tracker, target, floor_height(chain, robot))
    center, size = np.array(pool.box_center_mm) / 1e3, np.array(pool.box_size_mm) / 1e3
    draw_box(pen, "world/box", chain, center, size)
    if goal.kind == "box":
        center = np.array(goal.center_mm or pool.box_center_mm) / 1e3
        size = np.array(goal.size_mm or pool.box_size_mm) / 1e3
        draw_box(pen, "world/goal_box", chain, center, size, GOAL_BOX_COLOR)
    for k, obstacle in enumerate(plan.obstacles):
        path = f"world/obstacle{k + 1}"
        pen.transforms(path, obstacle.T_world_obstacle)
        if obstacle.mesh is None:
            box = rr.Boxes3D(
                centers=[0, 0, 0],
                sizes=obstacle.size,
                colors=OBSTACLE_COLOR,
                fill_mode="transparentfillmajorwireframe",  # what is behind it stays in sight
            )
            pen.static(f"{path}/body", box)
        else:
            body = rr.Mesh3D(
                vertex_positions=obstacle.mesh.vertices,
                triangle_indices=obstacle.mesh.faces,
                albedo_factor=OBSTACLE_COLOR,
            )
            pen.static(f"{path}/body", body)


def _target(plan: Plan, q: Array) -> Array:
    """What the beam goes to (s, 3), the last target of the predicted readings [m]."""
    first = plan.nominal.poses(plan.tour.q[:1])[0]
    seen = plan.T_world_tracker[:3, :3] @ plan.readings[-1].position[0]
    offset = first[:3, :3].T @ (seen + plan.T_world_tracker[:3, 3] - first[:3, 3])
    return target_points(plan.nominal.poses(q), offset)


def draw_candidates(plan: Plan, pen: Pen, phase: Phase) -> None:
    """The pool until the tour begins; rejected candidates, an entity a reason, at first."""
    import rerun as rr

    pool = rr.Points3D(plan.pool.T[:, :3, 3], radii=0.0045, colors=style.CANDIDATE_COLOR)
    pen.at(phase.start, "world/pool", pool)
    pen.clear(pen.timeline.phase("tour").start, "world/pool")
    for name in sorted({*plan.pool.rejected_reason} - {*plan.pool.rejection_names[:1]}):
        q = plan.pool.rejected_q[[reason == name for reason in plan.pool.rejected_reason]]
        path = f"world/rejected/{name.replace(' ', '_')}"
        refused = rr.Points3D(_points(plan, q), radii=0.006, colors=style.VERMILION)
        pen.at(phase.start, path, refused)
        pen.clear(phase.stop, path)


def draw_chosen(plan: Plan, pen: Pen, phase: Phase) -> None:
    """Chosen poses, until the tour has passed them."""
    import rerun as rr

    tour = plan.tour
    test = np.array([role == "test" for role in tour.roles])
    chosen = rr.Points3D(
        _points(plan, tour.q),
        radii=0.010,
        colors=np.where(test[:, None], HELD_OUT, CHOSEN).astype(np.uint8),
    )
    pen.at(phase.start, "world/chosen", chosen)
    pen.clear(pen.timeline.phase("tour").stop, "world/chosen")


def draw_tour(plan: Plan, pen: Pen, phase: Phase) -> None:
    """The way of the tool as it grows, the beam, and the number of the pose.

    One number at a time, which cannot lie on another one.
    """
    import rerun as rr

    draw_beam(pen, phase, plan.T_world_tracker[:3, 3], _target(plan, pen.timeline.q))
    path = _points(plan, pen.timeline.q[phase.start : phase.stop])
    lengths = growing(len(path), MOST_STAGES)
    strips = rr.LineStrips3D.columns(strips=[[path[:length]] for length in lengths])
    pen.every_step("world/path", strips, phase.steps[lengths - 1])
    count = len(plan.tour)
    numbers = rr.Points3D.columns(
        positions=_points(plan, plan.tour.q), labels=[str(k + 1) for k in range(count)]
    )
    pen.rows("world/number", phase, numbers)
    look = rr.Points3D.from_fields(radii=1e-4, colors=(255,) * 3, show_labels=True)
    pen.static("world/number", look)
    pen.clear(phase.stop, "world/number")
    pen.static("world/path", rr.LineStrips3D.from_fields(radii=0.0018, colors=style.BLUE))
    pen.clear(phase.stop, "world/path")


def draw_goal(plan: Plan, pen: Pen, phase: Phase) -> None:
    """The goal's tool points by their u, when the goal is looked at."""
    import rerun as rr

    T = plan.nominal.poses(plan.goal.q)
    points = target_points(T, plan.goal.point)
    low = DARKEST * float(plan.u.min())
    colors = style.viridis(plan.u - low, float(plan.u.max()) - low)
    pen.at(phase.start, "world/goal", rr.Points3D(points, radii=0.009, colors=colors))


def _points(plan: Plan, q: Array) -> Array:
    """Nominal tool positions (m, 3) [m]."""
    return np.asarray(plan.nominal.poses(q)[:, :3, 3])
