"""A session as a calibration needs it: what is held out, scatter, row names, origin."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from calib.arrays import Array, Bool, Index, frozen
from calib.errors import refuse
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict
from calib.uncertainty.conformal import fewest_poses
from calib.uncertainty.held_out import SAME_POSE
from testbed.files.conditions import joined as joined_conditions
from testbed.files.probe import Probe
from testbed.files.rows.say import taken_as_usual
from testbed.files.session import Session, Stated
from testbed.files.visits.probing import tried_words
from testbed.identify.order import order_of
from testbed.identify.records import HeldOutSplit, Origin
from testbed.robots.catalog import Robot
from testbed.scenario.hashes import robot_hash
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


def with_test(session: Session, other: Session) -> Session:
    """The session with the rows of another one held out; both in one measuring frame.

    Raises
    ------
    InputError
        The files look at different things, or poses were used for both.
    """
    if session.visits or other.visits:
        raise refuse(
            "--test", code="M35", where=other.name,
            message="--test is given beside a file of several sessions",
            fix="state it as a [[session]] of that file with held_out = true",
        )  # fmt: skip
    mine, theirs = session.measurements, other.measurements
    one, two = (
        (each.fixtures.counts, each.reflector_names, each.anchor_names) for each in (session, other)
    )
    if one != two:
        raise refuse(
            "--test", code="M35", where=other.name, fix="measure both in one session",
            message="the held-out file looks at other reflectors, anchors or stations",
            allowed="the same targets from the same stations",
        )  # fmt: skip
    if other.systematic not in (None, session.systematic):
        raise refuse(
            "--test", code="M35", where=other.name, fix="state the same parts in both files",
            message="the held-out file states other systematic parts, or another place of the "
            "instrument", allowed="one instrument that stands where it stood",
        )  # fmt: skip
    dates = (session.set_up.date, other.set_up.date)
    both = joined([mine, replace(theirs, pose_id=theirs.pose_id + len(session.pose_names))])
    return replace(
        session,
        files=tuple(dict.fromkeys([*session.files, *other.files])),
        measurements=both,
        pose_names=(*session.pose_names, *(f"{name} (test)" for name in other.pose_names)),
        is_test=np.repeat([False, True], [len(mine), len(theirs)]),
        split_stated=True,
        approach=None,
        masked=(*session.masked, *other.masked),
        warnings=tuple(
            dict.fromkeys(
                [
                    *session.warnings,
                    *other.warnings,
                    *taken_as_usual(mine.conditions, theirs.conditions),
                ]
            )
        ),
        notes=tuple(dict.fromkeys([*session.notes, *other.notes])),
        stated=_both_stated(session.stated, other.stated),
        simulated=session.simulated or other.simulated,
        place=(*session.place, *other.place),
        read_back=_both(session.read_back, other.read_back),
        time=None,  # two files begin their clocks at different times
        order=np.concatenate([order_of(session), len(mine) + order_of(other)]),
        conditions=joined_conditions([(one.where, one.conditions) for one in (session, other)]),
        set_up=replace(session.set_up, date=" and ".join(dict.fromkeys(filter(None, dates)))),
    )


def _both(one: Array | None, two: Array | None) -> Array | None:
    """Both columns as one, if both files have it."""
    return None if one is None or two is None else np.concatenate([one, two])


def _both_stated(one: Stated, two: Stated) -> Stated:
    """How the rotations of both stand in their files, if in the same form."""
    alike = (one.form, one.inverted) == (two.form, two.inverted)
    if not alike or one.numbers is None or two.numbers is None:
        return Stated()
    return replace(one, numbers=np.concatenate([one.numbers, two.numbers]))


def with_scatter(session: Session, model: RobotModel) -> Measurements:
    """The rows with the joints' own scatter in their covariances, where it is not in them yet."""
    measurements = session.measurements
    if not session.joint_scatter.any():
        return measurements
    if session.visits:  # of the tool that was mounted, in the axes of the station that saw it
        J = predict(model, measurements).rows[:, :, joint_columns(model.chain)]
        J = J * session.joint_scatter
        return replace(measurements, covariance=measurements.covariance + J @ np.swapaxes(J, 1, 2))
    covariance = with_joint_noise(
        model, measurements.q, measurements.covariance, session.joint_scatter
    )
    return replace(measurements, covariance=covariance)


def row_names(session: Session, measurements: Measurements) -> list[str]:
    """(m,) what sentences call each row: pose, and visit, target or place where these differ."""
    several = bool((measurements.repeat > 0).any())
    names = []
    for row in range(len(measurements)):
        name = f"pose {session.pose_name(row)}"
        if several:
            name += f", visit {int(measurements.repeat[row]) + 1}"
        if len(session.reflector_names) > 1 and measurements.reflector[row] >= 0:
            name += f", target {session.reflector_names[int(measurements.reflector[row])]}"
        if measurements.is_distance[row]:
            name += f", distance from {session.anchor_names[int(measurements.anchor[row])]}"
        elif len(session.station_names) > 1 and not session.visits:
            name += f", station {session.station_names[int(measurements.station[row])]}"
        names.append(name)
    return names


def origin_of(robot: Robot, session: Session, probes: Sequence[Probe]) -> Origin:
    """Where a calibration's numbers come from."""
    return Origin(
        name=session.name,
        files=tuple((file.path.name, file.sha256) for file in session.files),
        robot=robot.name,
        robot_title=robot.title,
        robot_sha256=robot_hash(robot),
        robot_notes=tuple(robot.notes),
        simulated=session.simulated,
        joints=session.joint_source,
        uncertainty=_without_folders(session, (session.uncertainty,))[0],
        masked=_without_folders(session, session.masked),
        drift=_without_folders(
            session, (session.drift.sentence, *session.drift.wrong) if session.drift else ()
        ),
        probe=_without_folders(session, (*session.notes, *tried_words(session, probes))),
        warnings=_without_folders(
            session, (*session.warnings, *(text for one in probes for text in one.warnings))
        ),
    )


def _without_folders(session: Session, sentences: tuple[str, ...]) -> tuple[str, ...]:
    """Sentences that name files without the folders of this machine."""
    folders = {f"{file.path.parent}/" for file in session.files} - {"./", "/"}
    for folder in sorted(folders, key=len, reverse=True):
        sentences = tuple(text.replace(folder, "") for text in sentences)
    return sentences


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
        _require_apart(measurements, stated)
        kept, held = (_poses(measurements, rows) for rows in (~stated, stated))
        sentence = f"the data state the split: {kept} to identify from, {held} held out"
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
        "nothing tests this result"
        if held_out == 0
        else f"all {counted(count, 'pose')} are needed to identify: none is held out, so nothing "
        "tests this result; measure more poses"
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
            message=f"{len(both)} of {held_out} {stand} at joints that identify, too",
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
        sentence += "; only first visits identify"
    return HeldOutSplit(
        frozen(is_test, np.bool_), frozen(is_train, np.bool_), stated, seed, sentence
    )


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
    needed = int(np.ceil(SPARE * numbers / each))
    wanted = max(round(HELD_OUT_SHARE * count), fewest_poses())
    return max(0, min(wanted, count - needed))


def _poses(measurements: Measurements, rows: Bool) -> str:
    """Poses among some rows, counted."""
    return counted(len(np.unique(measurements.pose_id[rows])), "pose")
