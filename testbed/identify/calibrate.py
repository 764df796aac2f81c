"""The straight line of `identify`: from sessions to a calibrated, proven robot."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.identification.identify import Identification, identify
from calib.identification.joint_models import extended_model
from calib.identification.outlier_search import noise_factor
from calib.identification.robust import LOSSES, Loss
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import Measurements, joined
from testbed.files.probe import Probe, probe
from testbed.files.read import Session
from testbed.files.session import Stated
from testbed.identify.errors import figures_of, misses_of, scatter_covariance
from testbed.identify.fit import checked_model, fit
from testbed.identify.frames import Frames, frames_of
from testbed.identify.outliers import held_out_outliers, training_outliers
from testbed.identify.proof import proof_of, warnings_of
from testbed.identify.records import Calibration, Fit, Gross, ModelName, Source, Split
from testbed.identify.split import split_of
from testbed.robots.catalog import Robot
from testbed.scenario.hashes import robot_hash

AUTO = "auto"
STEPS = ("frames", "gross errors", "identification", "held-out poses", "files")
"""What progress tells of; the last one is the writing of the folder."""
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class Options:
    """What a user may decide."""

    train: int | None = None
    """Poses to identify from; all others are held out."""
    held_out: int | None = None
    """Poses to hold out; all others identify."""
    seed: int = 0
    """Of every draw: the split, the poses that confirm a model, virtual calibrations."""
    model: str | None = None
    """geometric, extended or choose; None: as the session says."""
    loss: str = AUTO
    """auto: least squares without rows that plainly do not fit; or a loss of `identify` over all
    rows."""


def calibrate(
    robot: Robot,
    session: Session,
    options: Options | None = None,
    *,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate a robot from a measuring session and judge the result on held-out poses.

    Held-out rows take no part in anything before the last step: not in the frames, not in the
    search for gross errors, not in the choice of the model. Only the reading of the files looks at
    all rows alike, with nominal links: for units, and for shots that missed by centimeters.

    Parameters
    ----------
    robot : Robot
        As its maker describes it.
    session : Session
        As `testbed.files.read.read_session` gives it.
    options : Options, optional
        What a user may decide.
    progress : callable, optional
        Told what begins, steps done, steps in all.

    Raises
    ------
    InputError
        The data do not fit the robot or are misread (which other reading fits is said), they are
        too few, or an option is out of range.
    """
    options = Options() if options is None else options
    tell = progress or (lambda *_: None)
    model = checked_model(session.model if options.model is None else options.model)
    loss = _loss_of(options.loss)
    stated = session.is_test if session.split_stated else None
    split = split_of(
        session.measurements,
        stated,
        first_visits=session.visits == "first",
        train=options.train,
        held_out=options.held_out,
        seed=options.seed,
    )
    tell(STEPS[0], 0, len(STEPS))
    probed = probe(robot, session)
    probed.raise_if_wrong()
    frames = frames_of(robot, session, session.measurements.rows(split.is_train))
    measurements = with_scatter(session, frames)
    tell(STEPS[1], 1, len(STEPS))
    plain, left_out, factor, sentences, warnings = _gross(
        frames, measurements, split, session, options.loss
    )
    used = split.is_train & ~left_out
    train = measurements.rows(used)
    tell(STEPS[2], 2, len(STEPS))
    made = fit(
        frames.start,
        train,
        frames.parameters,
        model=model,
        loss=loss,
        seed=options.seed,
        plain=None if left_out.any() or loss != "squared" else plain,
        mounted=robot.model.chain,
    )
    fits = tuple(
        _fit(name, found, frames, robot.model.chain, measurements, train, used, split.is_test)
        for name, found in made.identifications
    )
    chosen = next(one for one in fits if one.model == made.choice.chosen)
    tell(STEPS[3], 3, len(STEPS))
    before = misses_of(frames.before, measurements)
    test = measurements.rows(split.is_test)
    gross = Gross(
        noise_factor=factor,
        left_out=frozen(left_out, np.bool_),
        sentences=sentences,
        held_out_sentences=held_out_outliers(
            chosen.misses, split.is_test, row_names(session, measurements)
        ),
    )
    proof = proof_of(chosen.identification, train, test, seed=options.seed)
    train_figures = figures_of(before, measurements, used)
    if train_figures is None:
        raise RuntimeError("no training row is left")
    return Calibration(
        source=source_of(robot, session, probed),
        nominal=robot.model,
        before=frames.before,
        own_frames=frames.own,
        frames=frames.sentences,
        measurements=measurements,
        pose_names=session.pose_names,
        time=session.time,
        temperature=session.temperature,
        split=split,
        gross=gross,
        before_misses=before,
        before_train=train_figures,
        before_test=figures_of(before, measurements, split.is_test),
        fits=fits,
        choice=made.choice,
        proof=proof,
        warnings=(*warnings, *warnings_of(fits[0], chosen, train)),
    )


def with_scatter(session: Session, frames: Frames) -> Measurements:
    """The rows with the joints' own scatter in their covariances, where it is not in them yet."""
    measurements = session.measurements
    if not session.joint_scatter.any():
        return measurements
    covariance = with_joint_noise(
        frames.before, measurements.q, measurements.covariance, session.joint_scatter
    )
    return replace(measurements, covariance=covariance)


def _gross(
    frames: Frames, measurements: Measurements, split: Split, session: Session, loss: str
) -> tuple[Identification, Bool, float, tuple[str, ...], tuple[str, ...]]:
    """The plain fit, rows to leave out (m,), noise factor, the rows in words, and warnings."""
    places = np.flatnonzero(split.is_train)
    train = measurements.rows(places)
    plain = identify(frames.start, train, frames.parameters)
    names = row_names(session, measurements)
    found = training_outliers(
        frames.start, train, frames.parameters, plain, [names[k] for k in places]
    )
    left_out = np.zeros(len(measurements), dtype=bool)
    if loss == AUTO:
        left_out[places[found.rows]] = True
    return plain, left_out, found.noise_factor, found.sentences, found.warnings


def _fit(
    name: ModelName,
    found: Identification,
    frames: Frames,
    mounted: Chain,
    measurements: Measurements,
    train: Measurements,
    used: Bool,
    is_test: Bool,
) -> Fit:
    """One identification with its misses."""
    missed = misses_of(found.model, measurements)
    figures = figures_of(missed, measurements, used)
    if figures is None:
        raise RuntimeError("no training row is left")
    start = frames.start
    if name == "extended":
        start = extended_model(start, mounted)
    return Fit(
        model=name,
        identification=found,
        scatter=scatter_covariance(start, found, train),
        noise_factor=noise_factor(found.model, train),
        misses=missed,
        train=figures,
        test=figures_of(missed, measurements, is_test),
    )


def _loss_of(option: str) -> Loss:
    """The loss that an option asks for; auto fits least squares to what is no gross error."""
    if option == AUTO:
        return "squared"
    for loss in LOSSES:
        if option == loss:
            return loss
    raise InputError(
        f'--loss is "{option}"',
        code="C41",
        field="--loss",
        value=option,
        allowed=", ".join((AUTO, *LOSSES)),
    )


def with_test(session: Session, other: Session) -> Session:
    """The session with the rows of another one held out; both in one measuring frame.

    Raises
    ------
    InputError
        The files look at different things, or poses were used for both.
    """
    mine, theirs = session.measurements, other.measurements
    targets = [
        (one.fixtures.counts, one.reflector_names, one.anchor_names) for one in (session, other)
    ]
    if targets[0] != targets[1]:
        raise InputError(
            "the held-out file looks at other reflectors, anchors or stations",
            code="M35",
            where=other.name,
            field="--test",
            allowed="the same targets from the same stations",
            fix="measure both in one session",
        )
    both = joined([mine, replace(theirs, pose_id=theirs.pose_id + len(session.pose_names))])
    return replace(
        session,
        files=(*session.files, *other.files),
        measurements=both,
        pose_names=(*session.pose_names, *(f"{name} (test)" for name in other.pose_names)),
        is_test=np.concatenate([np.zeros(len(mine), dtype=bool), np.ones(len(theirs), dtype=bool)]),
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


def source_of(robot: Robot, session: Session, probed: Probe) -> Source:
    """Where a calibration's numbers come from."""
    return Source(
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
