"""The straight line from a session of measurements to a calibrated robot with its proof."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Bool, frozen
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.identification.extended import extended_model
from calib.identification.identify import Identification, identify
from calib.identification.robust import LOSSES, Loss
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import Measurements
from testbed.calibration_fit import checked_model, fit
from testbed.calibration_frames import Frames, frames_of
from testbed.calibration_gross import held_out_suspects, noise_factor, suspects
from testbed.calibration_misses import figures_of, misses_of, scatter_covariance
from testbed.calibration_proof import proof_of
from testbed.calibration_session import row_names, source_of
from testbed.calibration_split import split_of
from testbed.calibration_warnings import warnings_of
from testbed.files.probe import probe
from testbed.files.session import Session
from testbed.records_calibration import (
    Calibration,
    Fit,
    Gross,
    Misses,
    ModelName,
    Split,
)
from testbed.robots.catalog import Robot

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
        As `testbed.files.session.read_session` gives it.
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
        held_out_sentences=held_out_suspects(
            chosen.misses, split.is_test, row_names(session, measurements)
        ),
    )
    proof = proof_of(
        chosen.identification, train, test, _part(chosen.misses, split.is_test), seed=options.seed
    )
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
    found = suspects(frames.start, train, frames.parameters, plain, [names[k] for k in places])
    left_out = np.zeros(len(measurements), dtype=bool)
    if loss == AUTO:
        left_out[places[found.rows]] = True
    many = (found.too_many,) if found.too_many else ()
    return plain, left_out, found.factor, found.sentences, many


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


def _part(misses: Misses, rows: Bool) -> Misses:
    """The misses of some rows."""
    return Misses(misses.vector[rows], misses.position[rows], misses.rotation[rows])


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
