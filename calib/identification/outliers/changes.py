"""What may change between two readings, and how that displaces the later ones."""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index
from calib.geometry.frames import inverse, points_of_frames, skew
from calib.geometry.gravity import gravity_regressor
from calib.geometry.operating import OperatingConditions
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, predicted_positions, tool_poses

What = Literal["station", "base", "target", "tool", "joint", "load", "robot"]
"""The base is offered only with several stations, the tool only with several targets: with one, a
motion of the base looks like one of the station, and of the tool like one of the target. The robot
is all numbers that are free: those of another arm."""
WARMER = 2.0
"""By so much a meter of steel grows by 24 um [K]."""
LARGEST = 5_000_000
"""Rows times the square of the free numbers above which another robot is not asked for: 40 MB."""


def targets_of(table: Measurements) -> tuple[Array, Index]:
    """Distinct targets on the tool (t, k), and each row's (m,); seen from several stations or not.

    A target is where it lies, what it shows (3 or 6 rows), its number, and the tool that carries
    it.
    """
    carried = [table.offset, table.equations, table.reflector, table.tool]
    targets, which = np.unique(np.column_stack(carried), axis=0, return_inverse=True)
    return targets, which.ravel()


def changes(
    identification: Identification, rows: Measurements, gravity: ArrayLike
) -> Iterator[tuple[What, int, Array]]:
    """Things that may have changed: kind, number, and derivative (m, 6, k) of rows by its change.

    Gravity (3,) is in the frame of the base. A load bends each joint in proportion to its torque.
    Where rows state what bends or lengthens an arm, neither that nor another robot is among them: a
    model that does not follow it misses a step there.
    """
    model = identification.model
    m, n = len(rows), model.chain.n_joints
    p, frames = predicted_positions(model, rows), model.fixtures.station_frames[rows.station]
    T_station_tool = inverse(frames) @ tool_poses(model, rows)
    R = T_station_tool[:, :3, :3]
    full = rows.is_pose[:, None, None]
    stations = np.unique(rows.station)

    def piece(axes: Array, places: Array) -> Array:
        """Derivative (m, 6, 6) of points (m, 3) of a rigid body by its shift and rotation."""
        C = np.zeros((m, 6, 6))
        C[:, :3, :3] = axes
        C[:, :3, 3:] = -axes @ skew(places)
        C[:, 3:, 3:] = full * axes
        return C

    for station in stations:
        here = rows.station == station
        C = piece(np.broadcast_to(np.eye(3), R.shape), p - p[here].mean(axis=0))
        yield "station", int(station), np.where(here[:, None, None], C, 0.0)
    if len(stations) > 1:
        world = points_of_frames(frames, p)
        axes = np.swapaxes(frames[:, :3, :3], 1, 2)
        yield "base", 0, piece(axes, world - world.mean(axis=0))
    targets, which = targets_of(rows)
    for target in range(len(targets)):
        C = np.zeros((m, 6, 6 if rows.is_pose[which == target].any() else 3))
        C[:, :3, :3] = R
        if C.shape[2] > 3:
            C[:, 3:, 3:] = full * R
        yield "target", target, np.where((which == target)[:, None, None], C, 0.0)
    if len(targets) > 1:
        from_origin = (p - T_station_tool[:, :3, 3])[:, :, None]
        places = (np.swapaxes(R, 1, 2) @ from_origin)[..., 0]
        yield "tool", 0, piece(R, places - places.mean(axis=0))
    derivative = predict(model, rows).rows
    names = identification.parameters.names
    for joint in range(n):
        own_name = f"{'d' if model.chain.prismatic[joint] else 'theta'}{joint + 1}"
        yield "joint", joint, derivative[:, :, [names.index(own_name)]]
    if told(rows.conditions):
        return
    torques = gravity_regressor(model.chain, rows.q, gravity=gravity)[:, :, 2, n, 0]
    turns = np.flatnonzero((model.chain.prismatic == 0) & torques.any(axis=0))
    if len(turns):
        own = [names.index(f"theta{joint + 1}") for joint in turns]
        yield "load", 0, derivative[:, :, own] * torques[:, None, turns]
    free = identification.parameters.free_index
    if m * len(free) ** 2 <= LARGEST:
        yield "robot", 0, derivative[:, :, free]


def told(conditions: OperatingConditions) -> bool:
    """Whether rows state loads that differ, torques, or temperatures that differ by much."""
    loads, warmth = conditions.moments, conditions.temperature
    return (
        conditions.torque is not None
        or (loads is not None and bool(np.ptp(loads, axis=0).any()))
        or (warmth is not None and bool(np.ptp(warmth) > WARMER))
    )
