"""A session as a calibration needs it: with a test, with scatter, names of rows, its origin."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.frames import right_jacobian_inverse
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from calib.measurement.corrections import Corrections
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict
from testbed.files.conditions import joined as joined_conditions
from testbed.files.rows.say import taken_as_usual
from testbed.files.session import Session, Stated
from testbed.files.tried.interpretations import Probe
from testbed.files.visits.probing import tried_words
from testbed.identify.records import Origin
from testbed.robots.catalog import Robot
from testbed.scenario.hashes import robot_hash

TARGET = ", target "
"""What stands before the name of a target in that of a row."""


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
            "instrument", allowed="it must be one instrument that did not move",
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
        unread=tuple(dict.fromkeys([*session.unread, *other.unread])),
        corrections=Corrections.stacked(
            [(len(mine), session.corrections), (len(theirs), other.corrections)]
        ),
        stated=_both_stated(session.stated, other.stated),
        simulated=session.simulated or other.simulated,
        noise_assumed=session.noise_assumed or other.noise_assumed,
        place=(*session.place, *other.place),
        read_back=_both(session.read_back, other.read_back),
        time=None,  # two files begin their clocks at different times
        order=np.concatenate([session.in_time, len(mine) + other.in_time]),
        numbered=False,
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
        return Stated(inverted=one.inverted or two.inverted)
    return replace(one, numbers=np.concatenate([one.numbers, two.numbers]))


def scatter_root(session: Session, model: RobotModel) -> Array:
    """Root S (m, 6, n) of what the joints scatter at each row, where it is not in the noise yet.

    Of the target that it looks at, in the axes of the station that saw it; a distance along itself.
    """
    seen, pose = predict(model, session.measurements), session.measurements.is_pose
    root = seen.rows[:, :, joint_columns(model.chain)] * session.joint_scatter
    # no noise follows what was read: turns of the tool, not of the residual
    root[pose, 3:] = np.linalg.solve(
        right_jacobian_inverse(seen.residual[pose, 3:]), root[pose, 3:]
    )
    return np.asarray(root)


def with_scatter(session: Session, root: Array) -> Measurements:
    """The rows with what joints scatter in their noise; `scatter_root` (m, 6, n) is its root."""
    measurements = session.measurements
    if not root.any():
        return measurements
    S = measurements.covariance + root @ np.swapaxes(root, 1, 2)
    return replace(measurements, covariance=S)


def row_names(session: Session, measurements: Measurements) -> list[str]:
    """(m,) what sentences call each row: pose, and visit, target or place where these differ."""
    several = bool((measurements.repeat > 0).any())
    names = []
    for row in range(len(measurements)):
        name = f"pose {session.pose_name(row)}"
        if several:
            name += f", visit {int(measurements.repeat[row]) + 1}"
        if len(session.reflector_names) > 1 and measurements.reflector[row] >= 0:
            name += f"{TARGET}{session.reflector_names[int(measurements.reflector[row])]}"
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
        exact=any(one.exact for one in probes),
        noise_assumed=session.noise_assumed,
    )


def _without_folders(session: Session, sentences: tuple[str, ...]) -> tuple[str, ...]:
    """Sentences that name files without the folders of this machine."""
    folders = {f"{file.path.parent}/" for file in session.files} - {"./", "/"}
    for folder in sorted(folders, key=len, reverse=True):
        sentences = tuple(text.replace(folder, "") for text in sentences)
    return sentences
