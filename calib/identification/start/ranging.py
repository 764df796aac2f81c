"""Reflectors and anchors from distances alone, one after the other, at known flange poses."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.frames import points_of_frames, transform_points
from calib.identification.start.alignment import StartProblem
from calib.identification.start.closed_forms import beyond, fitted_frame, multilaterated

FEWEST_RANGES = 4
"""Fewest distances that determine a point in space linearly."""
TOGETHER = 5
"""Anchors whose sides of a plane are decided together, in all combinations."""


def from_distances(problem: StartProblem, arms: Array, base: Array | None) -> tuple[Array, Array]:
    """Arms (k, 3) in the flange frame and anchors (s, 3) in the base frame, from distances [m].

    Known arms and, with the frame `base` (4, 4) in the world, known anchors locate the others in
    turn; what cannot be located is nan.
    """
    table, fixtures = problem.measurements, problem.model.fixtures
    arms, anchors = arms.copy(), np.full((len(fixtures.anchors), 3), np.nan)
    if base is not None:
        known = (fixtures.anchors - base[:3, 3]) @ base[:3, :3]
        anchors[problem.known_anchor] = known[problem.known_anchor]
    far = np.flatnonzero(table.is_distance)
    R, p = problem.F[far, :3, :3], problem.F[far, :3, 3]
    target, anchor, distance = problem.target[far], table.anchor[far], table.distance[far]
    # each round places at least one more point, or is the last
    for _ in range(len(arms) + len(anchors)):
        before = np.isfinite(arms).sum() + np.isfinite(anchors).sum()
        # anchors from targets that are known on the flange
        for k in np.unique(anchor):
            rows = (anchor == k) & np.isfinite(arms[target, 0])
            if np.isnan(anchors[k, 0]) and rows.sum() >= FEWEST_RANGES:
                points = (R[rows] @ arms[target[rows]][:, :, None])[:, :, 0] + p[rows]
                anchors[k] = multilaterated(points, distance[rows])
        # targets from anchors that are known in the base frame
        for k in np.unique(target):
            rows = (target == k) & np.isfinite(anchors[anchor, 0])
            if np.isnan(arms[k, 0]) and rows.sum() >= FEWEST_RANGES:
                # the anchor as the flange sees it lies at distance d from the reflector
                apart = (anchors[anchor[rows]] - p[rows])[:, None, :] @ R[rows]
                arms[k] = multilaterated(apart[:, 0], distance[rows])
        if np.isfinite(arms).sum() + np.isfinite(anchors).sum() == before:
            break
    return arms, anchors


def on_all_sides(anchors: Array, images: dict[int, Array]) -> Iterator[Array]:
    """Anchors (s, 3), with their images by number in every combination, none of these first."""
    for others in product((False, True), repeat=len(images)):
        own = anchors.copy()
        for (k, image), other in zip(images.items(), others, strict=True):
            own[k] = image if other else own[k]
        yield own


def on_known_sides(problem: StartProblem, arms: Array, anchors: Array, known: Index) -> Array:
    """Anchors (s, 3) in the base frame, with `known` ones (k,) on their sides of a plane [m].

    Of an arm that stays in one, their places in the world decide: by the least that Procrustes'
    motion leaves, the first of them in all combinations.
    """
    table, best, least = problem.measurements, anchors, np.inf
    images = {}
    for k in known.tolist():
        rows = table.is_distance & (table.anchor == k)
        points = points_of_frames(problem.F[rows], arms[problem.target[rows]])
        if np.isfinite(points).all() and (image := beyond(points, anchors[k])) is not None:
            images[k] = image
    if not images:
        return anchors
    places = problem.model.fixtures.anchors[known]
    for own in on_all_sides(anchors, dict([*images.items()][:TOGETHER])):
        base = fitted_frame(places, own[known], np.eye(3))
        left = float(np.square(transform_points(base, own[known]) - places).sum())
        if left < least:
            best, least = own, left
    return best
