"""Tables of observations from plain arrays: poses, points or distances with standard deviations."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, require_numbers, whole_numbers, wrong_shape
from calib.errors import refuse
from calib.geometry.frames import rigid
from calib.kinds import in_short
from calib.measurement.grouping import first_met
from calib.measurement.observations import DISTANCE, GIVEN, POINT, POSE, Measurements


@in_short
def poses(
    q: ArrayLike,
    T: ArrayLike,
    *,
    sd: ArrayLike,
    station: ArrayLike = 0,
    tool: ArrayLike = 0,
    pose_id: ArrayLike | None = None,
    repeat: ArrayLike | None = None,
) -> Measurements:
    """Table of full poses T_station_tool (m, 4, 4) at joints q (m, n).

    Parameters
    ----------
    q : (m, n) array_like
        Commanded joint values [rad, m].
    T : (m, 4, 4) array_like
        Poses measured, in the frame of the station [m].
    sd : array_like
        Standard deviations of position and rotation (2,), or of the six axes (6,) [m, rad]; or
        covariances, one (6, 6) or (m, 6, 6) [m^2, m rad, rad^2].
    station : int or (m,) array_like
        Which station measured the row; 0 is the world frame.
    tool : int or (m,) array_like
        Which tool was mounted; 0 is that of the chain, the others are of the model's fixtures.
    pose_id, repeat : int or (m,) array_like, optional
        Which pose and which visit of it; by default rows at the same joints are visits of one pose.

    Raises
    ------
    InputError
        A1: shapes do not match; A3: a matrix is not rigid, or a standard deviation not above zero.
    """
    (T,) = check("m 4 4", T=T)
    T = rigid(T)
    sd = require_numbers("sd", sd)
    if sd.ndim == 0:
        allowed = "two numbers, of position [m] and rotation [rad], or six, or covariances (6, 6)"
        raise refuse("sd", float(sd), allowed, code="A3")
    covariance = covariances_of_sd(sd, 6, len(T))
    return _table(q, POSE, covariance, T[:, :3, 3], T[:, :3, :3], station=station, tool=tool,
                  pose_id=pose_id, repeat=repeat)  # fmt: skip


@in_short
def points(
    q: ArrayLike,
    xyz: ArrayLike,
    *,
    sd: ArrayLike,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    reflector: ArrayLike = GIVEN,
    station: ArrayLike = 0,
    tool: ArrayLike = 0,
    pose_id: ArrayLike | None = None,
    repeat: ArrayLike | None = None,
) -> Measurements:
    """Table of reflector positions (m, 3) at joints q (m, n).

    Parameters
    ----------
    q : (m, n) array_like
        Commanded joint values [rad, m].
    xyz : (m, 3) array_like
        Positions measured, in the frame of the station [m].
    sd : array_like
        Standard deviation of each axis: one number, or three [m]; or covariances, one (3, 3) or
        (m, 3, 3) [m^2].
    offset : (3,) or (m, 3) array_like
        Where the reflector lies in the tool frame [m]; zero where `reflector` names it.
    reflector : int or (m,) array_like
        Which reflector of the model's fixtures it is, from 0; -1: the one at `offset`.
    station, tool, pose_id, repeat
        As in `poses`, and so are the errors.
    """
    (xyz,) = check("m 3", xyz=xyz)
    covariance = np.tile(np.eye(6), (len(xyz), 1, 1))
    covariance[:, :3, :3] = covariances_of_sd(sd, 3, len(xyz))
    return _table(q, POINT, covariance, xyz, offset=offset, reflector=reflector, station=station,
                  tool=tool, pose_id=pose_id, repeat=repeat)  # fmt: skip


@in_short
def distances(
    q: ArrayLike,
    d: ArrayLike,
    *,
    sd: ArrayLike,
    anchor: ArrayLike = 0,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    reflector: ArrayLike = GIVEN,
    pose_id: ArrayLike | None = None,
    repeat: ArrayLike | None = None,
) -> Measurements:
    """Table of distances (m,) from anchors to a reflector, at joints q (m, n).

    Parameters
    ----------
    q : (m, n) array_like
        Commanded joint values [rad, m].
    d : (m,) array_like
        Distances measured [m].
    sd : float or (m,) array_like
        Standard deviation of all distances, or of each [m].
    anchor : int or (m,) array_like
        Which anchor of the model's fixtures each was measured from, from 0.
    offset, reflector, pose_id, repeat
        As in `points`.

    Raises
    ------
    InputError
        A1: shapes do not match; A3: a distance or a standard deviation is not above zero.
    """
    (d,) = check("m", d=d)
    covariance = np.tile(np.eye(6), (len(d), 1, 1))
    sd = _positive(sd)
    if sd.shape not in ((), (len(d),)):
        raise wrong_shape("sd", sd.shape, f"expected one number, or {len(d)}")
    covariance[:, 0, 0] = np.square(sd)
    return _table(q, DISTANCE, covariance, np.zeros((len(d), 3)), offset=offset,
                  reflector=reflector, anchor=anchor, distance=d, pose_id=pose_id,
                  repeat=repeat)  # fmt: skip


def _table(
    q: ArrayLike,
    kind: str,
    covariance: Array,
    position: Array,
    rotation: Array | None = None,
    *,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    reflector: ArrayLike = GIVEN,
    station: ArrayLike = 0,
    tool: ArrayLike = 0,
    anchor: ArrayLike = GIVEN,
    distance: ArrayLike = 0.0,
    pose_id: ArrayLike | None = None,
    repeat: ArrayLike | None = None,
) -> Measurements:
    """Table of rows of one kind; a single value of a column holds for all rows."""
    m = len(position)
    (q,) = check("m n", q=q)
    if len(q) != m:
        fix = "transpose it" if q.shape[1] == m else "give joints and readings of the same poses"
        message, allowed = f"q has shape {q.shape}", f"expected one row for each of {m} readings"
        raise refuse("q", q.shape, allowed, code="A1", message=message, fix=fix)

    def column(name: str, value: ArrayLike) -> Index:
        numbers = whole_numbers(name, value)
        if numbers.shape not in ((), (m,)):
            raise wrong_shape(name, numbers.shape, f"expected one number, or {m}")
        return np.array(np.broadcast_to(numbers, (m,)))

    offset = require_numbers("offset", offset)
    if offset.shape not in ((3,), (m, 3)):
        raise wrong_shape("offset", offset.shape, f"expected (3,) or ({m}, 3)")
    table = Measurements(
        q=q,
        position=position,
        rotation=np.tile(np.eye(3), (m, 1, 1)) if rotation is None else rotation,
        covariance=covariance,
        kind=np.full(m, kind),
        offset=np.broadcast_to(offset, (m, 3)),
        pose_id=first_met(q) if pose_id is None else column("pose_id", pose_id),
        repeat=column("repeat", 0 if repeat is None else repeat),
        reflector=column("reflector", reflector),
        station=column("station", station),
        anchor=column("anchor", anchor),
        distance=np.broadcast_to(require_numbers("distance", distance), (m,)),
        tool=column("tool", tool),
    )
    if repeat is None:
        seen = np.column_stack([table.pose_id, table.target_key])
        table = replace(table, repeat=_earlier(first_met(seen)))
    return table


def _earlier(group: Index) -> Index:
    """Number (m,) of earlier rows of the same group."""
    order = np.argsort(group, kind="stable")
    counts = np.bincount(group)
    out = np.empty(len(group), dtype=np.int64)
    out[order] = np.arange(len(group)) - np.repeat(np.cumsum(counts) - counts, counts)
    return out


def covariances_of_sd(sd: ArrayLike, size: int, m: int, name: str = "sd") -> Array:
    """Covariances (m, k, k), k = `size`, from standard deviations or covariances as in `poses`."""
    sd = require_numbers(name, sd)
    if size == 6 and sd.shape == (2,):
        sd = np.repeat(sd, 3)
    if sd.shape in ((), (size,)):
        sd = np.diag(np.square(np.broadcast_to(_positive(sd), size)))
    elif sd.shape not in ((size, size), (m, size, size)):
        few = "two numbers" if size == 6 else "one number"
        allowed = f"{few}, {size}, or covariances ({size}, {size}) or ({m}, {size}, {size})"
        raise wrong_shape(name, sd.shape, allowed)
    return np.broadcast_to(sd, (m, size, size))


def _positive(sd: ArrayLike) -> Array:
    """Checked standard deviations; an `InputError` (A3) unless all are finite and above zero."""
    sd = require_numbers("sd", sd)
    if not (np.isfinite(sd) & (sd > 0)).all():
        raise refuse("sd", sd.tolist(), "finite standard deviations above zero", code="A3")
    return sd
