"""What a model predicts for each row of a table: residuals, and derivatives by its numbers."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.errors import refuse
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import (
    inverse,
    length,
    log_so3,
    points_of_frames,
    right_jacobian_inverse,
    skew,
    turn_angle,
)
from calib.geometry.model import RobotModel
from calib.measurement.observations import GIVEN, Measurements
from calib.measurement.remembered import remembered


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Measured minus predicted, in the axes of each row's station, before any weighting."""

    residual: Array
    """(m, 6) [p_seen - p (m); Log(R_seen R') (rad)]; a point fills three, a distance one [m]."""
    rows: Array
    """(m, 6, P) derivative of the prediction by the numbers of the model; zero where not filled."""
    filled: Bool
    """(m, 6) which entries a row has."""

    @property
    def misses(self) -> Array:
        """(m,) length of the residual in position or distance [m]."""
        return np.asarray(np.linalg.norm(self.residual[:, :3], axis=1))

    @property
    def turns(self) -> Array:
        """(m,) angle of the residual rotation [rad]; zero for other than pose rows."""
        return np.asarray(np.linalg.norm(self.residual[:, 3:], axis=1))


@remembered
def predict(model: RobotModel, measurements: Measurements) -> Prediction:
    """Residuals and derivatives of every row of a table, by all numbers of the model."""
    T, J = model.poses_and_jacobian(measurements.q, measurements.conditions)
    mount(T, J, model, measurements)
    found = predict_at(T, J, model.fixtures, model.first_fixture, measurements)
    for shared in (found.residual, found.rows, found.filled):
        shared.setflags(write=False)
    return found


def predict_at(
    T: Array, J: Array, fixtures: Fixtures, first: int, measurements: Measurements
) -> Prediction:
    """Residual and derivative at tool poses already computed.

    Parameters
    ----------
    T : (m, 4, 4) array
        Poses of each row's tool in the world [m].
    J : (m, 6, P) array
        Jacobian [dp; dr] of the tool in world axes, with zero columns for the fixtures;
        overwritten.
    fixtures : Fixtures
        Places of reflectors, anchors and stations.
    first : int
        Column of the first number of the fixtures.
    measurements : Measurements
        What was measured.

    Raises
    ------
    InputError
        A3: a row names a reflector, anchor, station or tool that the model does not have.

    References
    ----------
    Sola, Deray, Atchuthan, arXiv 1812.01537, eq. (144): the derivative of the rotation is
    Jr^-1(e) Jw, exact for any residual e. That of a point at tool coordinates c is Jp + Jw x (R c),
    and R by c itself; that of a distance along the unit vector u is u' times it, and -u' by the
    anchor. A step [t; r] of the station moves p_s = R_s'(p - t_s) by -t + p_s x r, and turns the
    rotation seen by -r.
    """
    require_fixtures(fixtures, measurements)
    p, R = T[:, :3, 3], T[:, :3, :3]
    aimed = np.flatnonzero(~measurements.is_pose)
    if len(aimed):
        p = p.copy()
        arm = (R[aimed] @ targets(fixtures, measurements)[aimed, :, None])[:, :, 0]
        p[aimed] += arm
        J[aimed, :3] -= skew(arm) @ J[aimed, 3:]
        _reflector_columns(J, R, first, measurements)
    far = np.flatnonzero(measurements.is_distance)
    reach = np.zeros(len(p))
    if len(far):
        reach[far] = _distance_rows(J, p, far, fixtures, first, measurements)
    away = np.flatnonzero(measurements.station)
    if len(away):
        p, R = p.copy(), R.copy()
        _station_rows(J, p, R, away, fixtures, first, measurements)
    residual = np.concatenate([measurements.position - p, np.zeros((len(p), 3))], axis=1)
    pose = np.flatnonzero(measurements.is_pose)
    if len(pose):
        e = log_so3(measurements.rotation[pose] @ np.swapaxes(R[pose], -1, -2))
        residual[pose, 3:] = e
        J[pose, 3:] = right_jacobian_inverse(e) @ J[pose, 3:]
    residual[far] = 0.0
    residual[far, 0] = measurements.distance[far] - reach[far]
    filled = np.arange(6) < measurements.equations[:, None]
    J[aimed, 3:] = 0.0
    J[far, 1:] = 0.0
    return Prediction(residual, J, filled)


def targets(fixtures: Fixtures, measurements: Measurements) -> Array:
    """Positions (m, 3) of each row's reflector in the tool frame [m]."""
    named = measurements.reflector != GIVEN
    if not named.any():
        return measurements.offset
    require_fixtures(fixtures, measurements)
    places = fixtures.reflectors[measurements.reflector]
    return np.where(named[:, None], places, measurements.offset)


@remembered
def tool_poses(model: RobotModel, measurements: Measurements) -> Array:
    """Poses T_world_tool (m, 4, 4) of the tool that was mounted when each row was measured [m]."""
    require_fixtures(model.fixtures, measurements)
    T = model.poses(measurements.q, measurements.conditions)
    if measurements.tool.any():
        back = inverse(model.chain.T_flange_tool)
        T = T @ np.concatenate([np.eye(4)[None], back @ model.fixtures.tools])[measurements.tool]
    T.setflags(write=False)
    return T


def predicted_positions(model: RobotModel, measurements: Measurements) -> Array:
    """Predicted positions (m, 3) of tool origin or reflector, in the station's frame [m].

    For a distance row it is the position of its reflector in the world.
    """
    return _positions(tool_poses(model, measurements), model, measurements)


def missed(
    model: RobotModel, measurements: Measurements, T: Array | None = None
) -> tuple[Array, Array]:
    """`misses` (m,) [m] and `turns` (m,) [rad] of point and pose rows, without any derivative.

    `T` are their `tool_poses` (m, 4, 4), if already at hand.
    """
    T = tool_poses(model, measurements) if T is None else T
    S = model.fixtures.station_frames[measurements.station][:, :3, :3]
    turned = measurements.rotation @ np.swapaxes(T[:, :3, :3], 1, 2) @ S
    place = measurements.position - _positions(T, model, measurements)
    turn = turn_angle(turned)
    return np.linalg.norm(place, axis=1), np.where(measurements.is_pose, turn, 0.0)


def _positions(T: Array, model: RobotModel, measurements: Measurements) -> Array:
    """Positions (m, 3) of what each row measures, in its station's frame, for tools at T [m]."""
    p = points_of_frames(T, targets(model.fixtures, measurements))
    if not measurements.station.any():
        return p
    S = model.fixtures.station_frames[measurements.station]
    return np.asarray((np.swapaxes(S[:, :3, :3], 1, 2) @ (p - S[:, :3, 3])[:, :, None])[:, :, 0])


def perfect(model: RobotModel, measurements: Measurements) -> Measurements:
    """The table with the values that the model predicts in place of those measured."""
    p = predicted_positions(model, measurements)
    pose, far = measurements.is_pose, measurements.is_distance
    S = model.fixtures.station_frames[measurements.station][:, :3, :3]
    R = np.swapaxes(S, 1, 2) @ tool_poses(model, measurements)[:, :3, :3]
    distance = np.zeros(len(p))
    from_anchor = p[far] - model.fixtures.anchors[measurements.anchor[far]]
    distance[far] = np.linalg.norm(from_anchor, axis=1)
    return replace(
        measurements,
        position=np.where(far[:, None], 0.0, p),
        rotation=np.where(pose[:, None, None], R, np.eye(3)),
        distance=distance,
    )


def require_fixtures(fixtures: Fixtures, measurements: Measurements) -> None:
    """Raise an `InputError` (A3) if a row names a fixture that the model does not have."""
    for name, have in (
        ("reflector", len(fixtures.reflectors)),
        ("anchor", len(fixtures.anchors)),
        ("station", 1 + len(fixtures.stations)),
        ("tool", 1 + len(fixtures.tools)),
    ):
        index = getattr(measurements, name)
        if index.max(initial=-1) >= have:
            row = int(np.argmax(index >= have))
            raise refuse(
                name,
                int(index[row]),
                ("", "0")[have] if have < 2 else f"0 to {have - 1}",
                code="A3",
                message=f"{name}[{row}] is {index[row]}, and the model has {have or 'no'} {name}"
                + "s" * (have != 1),
                fix="give the model the fixtures that the table names (RobotModel.fixtures)",
            )


def mount(T: Array, J: Array, model: RobotModel, measurements: Measurements) -> None:
    """Turn poses and Jacobian of the chain's tool into those of the tools that were mounted.

    The origin of a mounted tool moves by dp + dr x arm; the columns of the chain's tool become
    zero, and those of the mounted tool are steps in its own axes.

    Parameters
    ----------
    T, J : (m, 4, 4) and (m, 6, P + k) arrays
        Poses and Jacobian of the chain's tool, in world axes; changed in place. The k columns
        beyond those of the model are of further numbers that move the flange.
    model : RobotModel
        The model with its tools.
    measurements : Measurements
        Says which tool was mounted at each row.
    """
    if not measurements.tool.any():
        return
    end = model.chain.n_numbers
    start = model.first_fixture + model.fixtures.first_tool
    mounted = tool_poses(model, measurements)
    for k in np.unique(measurements.tool[measurements.tool > 0]):
        rows = np.flatnonzero(measurements.tool == k)
        arm = mounted[rows, :3, 3] - T[rows, :3, 3]
        J[rows, :, end - 6 : end] = 0.0
        J[rows, :3] -= skew(arm) @ J[rows, 3:]
        own, R = start + 6 * (k - 1), mounted[rows, :3, :3]
        J[rows, :3, own : own + 3] = J[rows, 3:, own + 3 : own + 6] = R
        T[rows] = mounted[rows]


def _reflector_columns(J: Array, R: Array, first: int, measurements: Measurements) -> None:
    """Fill in the derivative of rows by the coordinates of their reflector: the tool's axes."""
    named = np.flatnonzero(measurements.reflector != GIVEN)
    own = first + 3 * measurements.reflector[named, None] + np.arange(3)
    J[named[:, None, None], np.arange(3)[:, None], own[:, None, :]] = R[named]


def _distance_rows(
    J: Array, p: Array, far: Index, fixtures: Fixtures, first: int, measurements: Measurements
) -> Array:
    """Turn rows of points into rows of distances, in place; return the predicted distances [m]."""
    from_anchor = p[far] - fixtures.anchors[measurements.anchor[far]]
    reach = length(from_anchor)
    # at the anchor itself no direction is right: the row then determines nothing
    u = from_anchor / np.where(reach > 0, reach, 1.0)[:, None]
    J[far, 0] = (u[:, None, :] @ J[far, :3])[:, 0]
    start = first + 3 * len(fixtures.reflectors)
    J[far[:, None], 0, start + 3 * measurements.anchor[far, None] + np.arange(3)] = -u
    return reach


def _station_rows(
    J: Array,
    p: Array,
    R: Array,
    away: Index,
    fixtures: Fixtures,
    first: int,
    measurements: Measurements,
) -> None:
    """Express p, R and J of rows measured from further stations in the axes of these, in place."""
    start = first + 3 * (len(fixtures.reflectors) + len(fixtures.anchors))
    for s in np.unique(measurements.station[away]):
        rows = np.flatnonzero(measurements.station == s)
        T = fixtures.stations[s - 1]
        back = T[:3, :3].T
        p[rows] = (p[rows] - T[:3, 3]) @ T[:3, :3]
        R[rows] = back @ R[rows]
        J[rows, :3], J[rows, 3:] = back @ J[rows, :3], back @ J[rows, 3:]
        k = start + 6 * (s - 1)
        J[rows, :3, k : k + 3] = -np.eye(3)
        J[rows, :3, k + 3 : k + 6] = skew(p[rows])
        J[rows, 3:, k + 3 : k + 6] = -np.eye(3)
