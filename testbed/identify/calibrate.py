"""The straight line of `identify`: from sessions to a calibrated, proven robot."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from calib.arrays import frozen
from calib.errors import InputError, refuse
from calib.identification.robust import LOSSES, Loss
from testbed.files.rows.terms import row_terms
from testbed.files.session import Session
from testbed.files.session_toml import FRAMES_ALONE
from testbed.files.tried.interpretations import Probe
from testbed.files.visits.probing import probed
from testbed.identify.applies.coupling import coupling_words
from testbed.identify.applies.in_turn import in_turn_words
from testbed.identify.applies.mounting import mounting_words
from testbed.identify.applies.poses import coarse_joints, warnings_of
from testbed.identify.applies.stated_frames import stated_frame_words
from testbed.identify.applies.travel import travel_words
from testbed.identify.calibration import DRIVES, FRAMES, IN_TURN, MOUNTING, Calibration
from testbed.identify.clean_fit import CleanFit, clean_fit
from testbed.identify.conditions import held_out_warnings
from testbed.identify.errors import figures_of, row_errors
from testbed.identify.far_off import far_held_out, held_out_outliers
from testbed.identify.fit import checked_model, fitted_model, frames_model, plain_fit
from testbed.identify.frames import frames_of
from testbed.identify.handback.handed import hand_back
from testbed.identify.handback.links import prior_share
from testbed.identify.moved import moved_in
from testbed.identify.order import order_words, require_order
from testbed.identify.outliers import Looking, bad_words, first_look, model_words
from testbed.identify.proof import (
    drift_of_repeats,
    guard_warnings,
    of_the_lead,
    proof_of,
    repeatability,
    standing_warnings,
    stated_target,
    target_warnings,
)
from testbed.identify.records import HeldOutSplit, OutlierRows
from testbed.identify.session import origin_of, row_names, scatter_root, with_scatter
from testbed.identify.shared import shared_of
from testbed.identify.splitting import with_poses_held_out
from testbed.identify.visits.apart import require_shared
from testbed.identify.visits.fit import with_own_frames
from testbed.identify.visits.frames import own_frames
from testbed.identify.visits.split import split_of_session
from testbed.progress import Progress
from testbed.robots.catalog import Robot
from testbed.store.layout import DERIVED
from testbed.units import either

AUTO = "auto"
STEPS = ("frames", "gross errors", "identification", "held-out poses", "robot", *DERIVED)
"""What progress tells of; what follows the held-out poses is the writing of the folder."""


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
    report = progress or (lambda *_: None)
    model = checked_model(session.wanted.model if options.model is None else options.model)
    if session.wanted.free == FRAMES_ALONE:
        model = frames_model(options.model)
    loss = loss_of(options.loss)
    report(STEPS[0], 0, len(STEPS))
    # first: joints beside other rows' readings make held-out poses look like those that identify
    probes = probed(robot, session)
    split = split_of_session(
        session, train=options.train, held_out=options.held_out, seed=options.seed
    )
    require_order(session)
    try:
        return _calibrated(robot, session, probes, split, options, model, loss, report)
    except InputError as error:  # of arrays, which know no file, nor what is held out
        told = with_poses_held_out(
            error, session.measurements, train=options.train, held_out=options.held_out
        )
        raise told.located(session.where) from error


def _calibrated(
    robot: Robot,
    session: Session,
    probes: tuple[Probe, ...],
    split: HeldOutSplit,
    options: Options,
    model: str,
    loss: Loss,
    report: Progress,
) -> Calibration:
    """The calibration of a session whose reading is right, from frames to the proof."""
    frames = frames_of(robot, session, session.measurements.rows(split.is_train))
    own = own_frames(session, frames.start, split)
    before = frames.before if own is None else own.placed(frames.before)
    root = scatter_root(session, before)
    measurements = with_scatter(session, root)
    if own is not None:
        own = own.among(measurements)
        before = own.placed(frames.before)
    report(STEPS[1], 1, len(STEPS))
    names, places = row_names(session, measurements), np.flatnonzero(split.is_train)
    called = [names[row] for row in places]
    looking = Looking(
        frames, measurements.rows(places), robot, row_terms(session, robot), options.seed
    )
    plain = plain_fit(frames.start, looking.train, frames.parameters)
    if session.visit is not None:
        require_shared(session, robot.model, looking.train, session.visit[places], plain)
    suspects = first_look(looking, plain)
    report(STEPS[2], 2, len(STEPS))
    clean = clean_fit(
        session, looking, suspects, plain, measurements, split.is_train,
        model=model, loss=loss, leaves_out=options.loss == AUTO,
    )  # fmt: skip
    left_out, used, train, links, shots = (
        clean.left_out, clean.used, clean.train, clean.links, clean.shots
    )  # fmt: skip
    models = tuple(
        fitted_model(name, identification, began, measurements, used, split.is_test, root)
        for name, began, identification in clean.pairs
    )
    if own is not None:
        models = tuple(with_own_frames(each, own, measurements, used, split) for each in models)
    chosen = next(each for each in models if each.model == clean.choice.chosen)
    report(STEPS[3], 3, len(STEPS))
    drifts = drift_of_repeats(chosen.identification.model, session, measurements, ~left_out)
    comes_back = repeatability(
        chosen.identification.model, robot, session, measurements, ~left_out, drifts
    )
    result, rows = chosen.identification, used
    if own is not None:
        result, rows = own.weighed(result, used), used | own.rows
    shown = split.is_test if split.is_test.any() else used
    shared = shared_of(session, result, measurements, rows, shown)
    target = stated_target(of_the_lead(session, measurements), result)
    judged_by = partial(
        proof_of,
        result,
        session,
        measurements,
        used=rows,
        visits=~left_out,
        root=root,
        comes_back=comes_back,
        target=target,
        seed=options.seed,
        shared=None if shared is None else shared.covariance,
        drifts=drifts,
    )
    proof = judged_by(is_test=split.is_test)
    far = far_held_out(chosen.misses, measurements, split.is_test, proof.strays)
    far_names, far_said = held_out_outliers(
        chosen.misses, measurements, split.is_test, far, proof.belief, names
    )
    without = judged_by(is_test=split.is_test & ~far).point if far.any() else None
    stated = train if proof.frame is not None and proof.frame.found else measurements.rows(shown)
    handback = hand_back(
        robot, session, links, prior_share(clean.handed[2], train, len(links.sd)), proof.belief,
        stated.q[np.unique(stated.pose_id, return_index=True)[1]],
        target=target, repeatability=comes_back[0],
    )  # fmt: skip
    misses = row_errors(before, measurements)
    found = Calibration(
        source=origin_of(robot, session, probes),
        nominal=robot.model,
        before=before,
        limits=robot.limits,
        own_frames=frames.own,
        frames=frames.sentences,
        measurements=measurements,
        pose_names=session.pose_names,
        time=session.time,
        conditions=session.conditions,
        set_up=session.set_up,
        order_told_by=order_words(session),
        repeatability=comes_back[0],
        target=target,
        decision=session.decision,
        reflector_names=session.reflector_names,
        stated_reflectors=session.stated_reflectors,
        split=split,
        gross=OutlierRows(
            noise_factor=shots.noise_factor,
            left_out=frozen(left_out, np.bool_),
            sentences=bad_words(shots, looking.train, called, used=not left_out.any()),
            held_out_sentences=far_said,
            held_out_names=far_names,
            radius_without=None if without is None else without.radius_mean,
        ),
        before_misses=misses,
        before_train=figures_of(misses, measurements, used),
        before_test=figures_of(misses, measurements, split.is_test)
        if split.is_test.any()
        else None,
        fits=models,
        choice=clean.choice,
        proof=proof,
        shared=shared,
        visits=session.visits,
        visit=session.visit,
        moved=moved_in(session, robot.model, (chosen, models[0]), measurements, used),
        repeats_drift=drifts,
        handback=handback,
        warnings=(),
    )
    return _warned(found, session, looking, clean, called)


def _warned(
    found: Calibration, session: Session, looking: Looking, clean: CleanFit, called: list[str]
) -> Calibration:
    """A calibration with what is to be known beside it, and what its fits doubt of the file."""
    chosen, train, is_test = found.fit, clean.train, found.split.is_test
    identification = chosen.identification
    placed = stated_frame_words(session, found.before, train)
    hangs = turned = tuple[str, ...]()
    if not (taken := in_turn_words(found, session)):
        hangs = mounting_words(found, replace(looking, train=train), clean.plain.model)
        turned = coupling_words(found, looking.robot)
    warnings = [
        *(() if found.repeats_drift is None else (found.repeats_drift.sentence,)),
        *model_words(clean.shots, looking.train, chosen, called),
        *warnings_of(found.fits[0], chosen, train, looking.robot, session),
        *coarse_joints(session, chosen, train),
        *placed,
        *guard_warnings(session, found.measurements.rows(is_test)),
        *looking.frames.untold,
        *standing_warnings(session, identification, found.proof.belief),
    ]
    if not found.handback.in_use:
        warnings += target_warnings(found.measurements, found.target, session.reflector_names)
    warnings += held_out_warnings(session.conditions, session.set_up, clean.used, is_test)
    warnings += travel_words(identification, found.covariance)
    doubts = {IN_TURN: taken, FRAMES: placed, MOUNTING: hangs, DRIVES: turned}
    return replace(
        found,
        warnings=(*taken, *warnings, *hangs, *turned),
        doubted=tuple(name for name, said in doubts.items() if said),
    )


def loss_of(option: str) -> Loss:
    """The loss that an option asks for; auto fits least squares to what is no gross error."""
    if option == AUTO:
        return "squared"
    for loss in LOSSES:
        if option == loss:
            return loss
    allowed = f"it takes {either((AUTO, *LOSSES))}"
    raise refuse("--loss", option, allowed, code="C41", message=f'--loss is "{option}"')
