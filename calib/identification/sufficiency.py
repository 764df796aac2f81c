"""Whether a table holds enough independent equations for what is to be identified from it."""

from dataclasses import replace

import numpy as np

from calib.errors import TooFewPosesError
from calib.geometry.inverse import spread
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.reduction import reduce
from calib.measurement.grouping import count_distinct
from calib.measurement.observations import GIVEN, Measurements
from calib.measurement.residual import linearize


def require_equations(
    nominal: RobotModel, measurements: Measurements, parameters: Parameters
) -> None:
    """Raise `TooFewPosesError` unless there are more independent equations than unknowns.

    The numbers are counted by the rank that many poses of this kind would have; one equation more
    than that leaves a residual to judge the fit by.
    """
    if 6 * count_distinct(measurements.q[measurements.is_pose]) > parameters.n_free:
        return
    count, have = independent_equations(measurements, parameters)
    if have > parameters.n_free:
        return
    numbers = _generic_rank(nominal, measurements, parameters)
    if have > numbers:
        return
    poses = "1 different pose gives" if count == 1 else f"{count} different poses give"
    message = f"{poses} {have} equations for {numbers} parameters"
    raise TooFewPosesError(message, least=numbers * count // have + 1, count=count)


def independent_equations(measurements: Measurements, parameters: Parameters) -> tuple[int, int]:
    """Number of different joint vectors, and of independent equations that their rows can give.

    Repeats add none. Distances to one reflector at one joint vector give at most the three of its
    position, and all rows there at most the six of its pose; the rest can only determine fixtures.
    """
    first = np.unique(
        np.column_stack([measurements.q, measurements.target_key]), axis=0, return_index=True
    )[1]
    few = measurements.rows(first)
    poses, pose = np.unique(few.q, axis=0, return_inverse=True)
    places = np.column_stack([pose.ravel(), few.offset, few.reflector, few.is_pose, few.tool])
    _, place, of_place = np.unique(places, axis=0, return_index=True, return_inverse=True)
    each = np.bincount(of_place.ravel(), few.equations)
    of_places = np.minimum(each, np.where(few.is_pose[place], 6, 3))
    rows = np.bincount(pose.ravel()[place], of_places, minlength=len(poses))
    have = np.minimum(rows, 6)
    free = [name.split(".")[0].rstrip("0123456789") for name in parameters.free_names]
    anchors, reflectors, stations = (free.count(x) for x in ("anchor", "reflector", "station"))
    tools = free.count("tool") - sum(name.startswith("tool.") for name in parameters.free_names)
    # several anchors or stations see one place, several reflectors make one pose: beyond it
    # they determine where these are; of reflectors alone how they stand to each other
    if (few.reflector != GIVEN).all():
        reflectors = max(reflectors - 6, 0)
    more = min(int((each - of_places).sum()), anchors + stations)
    more += min(int((rows - have).sum()), reflectors + stations + tools)
    return len(poses), int(have.sum()) + more


def _generic_rank(nominal: RobotModel, measurements: Measurements, parameters: Parameters) -> int:
    """Rank of the free numbers for many poses of this kind, spread over the joints."""
    m = 2 * parameters.n_free
    q = spread(np.tile([-2.0, 2.0], (nominal.chain.n_joints, 1)), m)
    kinds = np.unique(measurements.target_key, axis=0, return_index=True)[1]
    # every kind of row in turn, each at enough poses
    turn = np.arange(m * len(kinds)) % len(kinds)
    table = replace(
        measurements.rows(kinds[turn]),
        q=np.repeat(q, len(kinds), axis=0),
        pose_id=np.repeat(np.arange(m), len(kinds)),
        repeat=np.zeros(len(turn), dtype=np.int64),
    )
    table = replace(table, rotation=nominal.poses(table.q)[:, :3, :3])
    A = linearize(nominal, table).A[:, parameters.free_index] * parameters.free_scale
    return reduce(A, parameters, model=nominal).rank
