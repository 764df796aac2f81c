"""Which poses identify and which are held out."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from calib.arrays import Bool, Index, frozen
from calib.errors import InputError, TooFewPosesError, refuse
from calib.held_out_counts import fewest_poses
from calib.measurement.observations import Measurements
from calib.uncertainty.held_out import SAME_POSE
from testbed.identify.records import HeldOutSplit
from testbed.streams import stream
from testbed.units import counted

HELD_OUT_SHARE = 1 / 3
SPARE = 3.0
"""Equations per number that identification keeps before poses are held out: 15 full poses of a
six-axis arm. Fewer were too few for a real one: of 8 draws of 8 or 10 poses of a measured UR10,
three left errors of centimeters and more on the others; of 14 poses, none."""


def all_identify(train: int | None, held_out: int | None) -> None:
    """Refuse a number of poses to draw beside --test: C41."""
    for option, value in (("--train", train), ("--held-out", held_out)):
        if value is not None:
            raise refuse(
                option, value, code="C41", message=f"{option} is given beside --test",
                fix=f"leave {option} out: all poses of DATA identify, those of --test are held out",
            )  # fmt: skip


def split_of(
    measurements: Measurements,
    stated: Bool | None,
    *,
    first_visits: bool = False,
    train: int | None = None,
    held_out: int | None = None,
    seed: int = 0,
) -> HeldOutSplit:
    """The split stated by the data, or one drawn by poses.

    Parameters
    ----------
    measurements : Measurements
        Every row.
    stated : (m,) array of bool or None
        Held-out rows that the data state.
    first_visits : bool
        Identify from the first visit of each pose only.
    train, held_out : int, optional
        Poses to identify from, or to hold out; one of the two.
    seed : int
        Of the draw.

    Raises
    ------
    InputError
        A number that does not fit the table, one given beside a stated split, or a stated split
        that holds out joints which identify.
    """
    draws = stream(seed, "split")  # which refuses a seed, whether it decides the split or not
    if stated is not None:
        wanted = "--train" if train is not None else "--held-out" if held_out is not None else ""
        if wanted:
            raise refuse(
                wanted, code="C41", fix=f"leave {wanted} out, or take the split out of the data",
                message=f"{wanted} is given, but the data say which poses are held out",
            )  # fmt: skip
        if stated.all():
            raise refuse(
                "split", code="M27", fix="write identify in the rows that shall identify",
                message="no row is left to identify from: the data hold out all of them",
            )  # fmt: skip
        _require_apart(measurements, stated)
        kept, held = (_poses(measurements, rows) for rows in (~stated, stated))
        sentence = f"split as the data state: {kept} to identify from, {held} held out"
        return _split(measurements, stated, True, seed, sentence, first_visits)
    group = groups(measurements)
    count = int(group.max()) + 1
    out = _count(measurements, count, train, held_out)
    order = draws.permutation(count)
    is_test = np.isin(group, order[count - out :]) if out else np.zeros(len(group), dtype=bool)
    sentence = (
        f"{counted(out, 'pose')} of {count} drawn at random (seed {seed}) and held out, "
        f"{count - out} to identify from"
        if out
        else f"all {counted(count, 'pose')} identify, as --held-out 0 asks: none is held out, so "
        "nothing tests the result"
        if held_out == 0
        else f"all {counted(count, 'pose')} are needed to identify: none is held out, so nothing "
        "tests the result; measure more poses"
    )
    return _split(measurements, is_test, False, seed, sentence, first_visits)


def _require_apart(measurements: Measurements, is_test: Bool) -> None:
    """Refuse held-out rows at joints that identify, whatever they are called."""
    group = groups(measurements)
    both = np.intersect1d(group[is_test], group[~is_test])
    if len(both):
        held_out = counted(len(np.unique(group[is_test])), "held-out pose")
        stand = "stands" if len(both) == 1 else "stand"
        raise refuse(
            "split", len(both), "held-out poses of their own", code="M35",
            message=f"{len(both)} of {held_out} {stand} at the same joints as a training pose",
            fix="measure other poses, or leave these out of one side",
        )  # fmt: skip


def _split(
    measurements: Measurements,
    is_test: Bool,
    stated: bool,
    seed: int,
    sentence: str,
    first_visits: bool,
) -> HeldOutSplit:
    """The split, later visits left out of it if only first ones identify."""
    is_train = ~is_test
    if first_visits and (measurements.repeat > 0).any():
        is_train &= measurements.repeat == 0
        sentence += "; only the first visit of each pose identifies"
    return HeldOutSplit(
        frozen(is_test, np.bool_), frozen(is_train, np.bool_), stated, seed, sentence
    )


def with_poses_held_out(
    error: InputError,
    measurements: Measurements,
    train: int | None = None,
    held_out: int | None = None,
) -> InputError:
    """The error of too few poses to identify from, where the split holds out enough: its fix.

    Any other error as it is, and one that says where it stands: it is of single visits.
    """
    count = int(groups(measurements).max()) + 1
    if not isinstance(error, TooFewPosesError) or error.where or count < error.least:
        return error
    least = error.least
    how = (
        f"--train {least} or more"
        if train is not None
        else f"--held-out {count - least} or fewer"
        if held_out is not None
        else "hold out fewer"
    )
    return refuse(
        error.field, error.value, code=error.code, message=error.message,
        fix=f"identify from at least {least} of the {count}: {how}",
    )  # fmt: skip


def groups(measurements: Measurements) -> Index:
    """Number (m,) of the pose each row belongs to: rows of one pose or at one joint vector."""
    q = np.round(measurements.q / SAME_POSE) * SAME_POSE
    _, place = np.unique(q, axis=0, return_inverse=True)
    _, pose = np.unique(measurements.pose_id, return_inverse=True)
    place, pose = place.ravel(), pose.ravel()
    n = int(place.max()) + 1
    edges = coo_array((np.ones(len(pose)), (place, n + pose)), shape=(n + int(pose.max()) + 1,) * 2)
    label = connected_components(edges, directed=False)[1][place]
    # numbered as they come, so that the draw does not hang on how components are found
    first, number = np.unique(label, return_index=True)[1], np.unique(label, return_inverse=True)[1]
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[number.ravel()])


def _count(measurements: Measurements, count: int, train: int | None, held_out: int | None) -> int:
    """Poses to hold out."""
    if train is not None and held_out is not None:
        raise refuse(
            "--train", train, code="C41", message="--train and --held-out are both given",
            fix="give one of them: all other poses go to the other side",
        )  # fmt: skip
    for option, value, fewest in (("--train", train, 1), ("--held-out", held_out, 0)):
        if value is not None and not fewest <= value <= count - 1:
            allowed = f"{fewest} to {count - 1}: the data hold {counted(count, 'pose')}"
            raise refuse(option, value, allowed, code="C41")
    if train is not None:
        return count - train
    if held_out is not None:
        return held_out
    # as many numbers as a serial arm of so many joints lets full poses tell apart
    numbers = 4 * measurements.q.shape[1] + 6
    each = min(measurements.n_equations / count, 6.0)
    spare, wanted = count - int(np.ceil(SPARE * numbers / each)), round(HELD_OUT_SHARE * count)
    # fewer guard no statement: they test, and each of them costs accuracy
    if spare >= fewest_poses():
        wanted = max(wanted, fewest_poses())
    return max(0, min(wanted, spare))


def _poses(measurements: Measurements, rows: Bool) -> str:
    """Poses among some rows, counted."""
    return counted(len(np.unique(measurements.pose_id[rows])), "pose")
