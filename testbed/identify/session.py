"""A session as a calibration needs it: a second file held out, scatter, row names, origin."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import Measurements, joined
from testbed.files.probe import Probe
from testbed.files.session import Session, Stated
from testbed.identify.records import Origin
from testbed.robots.catalog import Robot
from testbed.scenario.hashes import robot_hash


def with_test(session: Session, other: Session) -> Session:
    """The session with the rows of another one held out; both in one measuring frame.

    Raises
    ------
    InputError
        The files look at different things, or poses were used for both.
    """
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
    both = joined([mine, replace(theirs, pose_id=theirs.pose_id + len(session.pose_names))])
    return replace(
        session,
        files=(*session.files, *other.files),
        measurements=both,
        pose_names=(*session.pose_names, *(f"{name} (test)" for name in other.pose_names)),
        is_test=np.repeat([False, True], [len(mine), len(theirs)]),
        split_stated=True,
        approach=None,
        masked=(*session.masked, *other.masked),
        warnings=(*session.warnings, *other.warnings),
        notes=(*session.notes, *other.notes),
        stated=_both_stated(session.stated, other.stated),
        simulated=session.simulated or other.simulated,
        place=(*session.place, *other.place),
        read_back=_both(session.read_back, other.read_back),
        time=None,  # two files begin their clocks at different times
        temperature=_both(session.temperature, other.temperature),
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
    covariance = with_joint_noise(
        model, measurements.q, measurements.covariance, session.joint_scatter
    )
    return replace(measurements, covariance=covariance)


def row_names(session: Session, measurements: Measurements) -> list[str]:
    """(m,) how each row is called in sentences: pose, and visit or target where these differ."""
    several = bool((measurements.repeat > 0).any())
    names = []
    for row in range(len(measurements)):
        name = f"pose {session.pose_name(row)}"
        if several:
            name += f", visit {int(measurements.repeat[row]) + 1}"
        if len(session.reflector_names) > 1 and measurements.reflector[row] >= 0:
            name += f", target {session.reflector_names[int(measurements.reflector[row])]}"
        names.append(name)
    return names


def origin_of(robot: Robot, session: Session, probed: Probe) -> Origin:
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
        probe=_without_folders(session, (*session.notes, probed.sentence)),
        warnings=_without_folders(session, (*session.warnings, *probed.warnings)),
    )


def _without_folders(session: Session, sentences: tuple[str, ...]) -> tuple[str, ...]:
    """Sentences that name files without the folders of this machine."""
    folders = {f"{file.path.parent}/" for file in session.files} - {"./", "/"}
    for folder in sorted(folders, key=len, reverse=True):
        sentences = tuple(text.replace(folder, "") for text in sentences)
    return sentences
