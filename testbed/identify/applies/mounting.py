"""Which way gravity acts on an arm, where along -z of its base it explains nothing."""

from dataclasses import replace

import numpy as np

from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.identification.climb import best_alone
from calib.identification.climbing import ASKED
from calib.identification.gravity_ladder import gravity_ladder
from calib.identification.joint_models import extended_parameters
from calib.identification.levels import Level, prior_of
from calib.identification.model_choice import extended_by
from calib.identification.row_ladders import row_ladders
from calib.information.sizes import SAG
from testbed.identify.calibration import Calibration
from testbed.identify.frames import wide_prior
from testbed.identify.outliers import Looking
from testbed.units import significant

TURNS = ((0, 90, 0), (0, -90, 0), (90, 0, 0), (-90, 0, 0), (180, 0, 0))
"""Rotation vectors of bases on four walls and a ceiling [deg]."""
ALIKE = {(0, -90, 0): (0, 90, 0), (-90, 0, 0): (90, 0, 0), (180, 0, 0): (0, 0, 0)}
"""Bases in which gravity acts the other way round: what gives way may have either sign, and bends
the arm alike."""
LOUD = 2.0
"""Residual of the chosen model, in units of the stated noise, from which on gravity is asked for
although it is taken: the usual misfit of an arm with gears is not worth five more climbs."""

PLAIN = 30.0
"""Log evidence by which another way must gain more. What no model explains gains some too: up to 13
on 16 upright arms with gears that erred by 0.3 mrad; on a wall it was 100 and more."""


def mounting_words(calibration: Calibration, looking: Looking, near: RobotModel) -> tuple[str, ...]:
    """That gravity explains the readings if the arm hangs on a wall or ceiling, where it does.

    Asked only where a test refutes the numbers, the robot's file does not turn its base, and either
    no level of the ladder of gravity is taken as the arm is said to stand, or the residuals are
    loud all the same: then five other ways are tried, by the evidence that the levels gain on the
    training rows beside the waves and the play that the model has. Alone they would be no judge:
    the wave of a gear at joint 1 looks like what a wall does to it, and other waves hide what a
    wall does. Springs and a tilt follow much of a wrong way, too: another must gain more than this
    one.

    Parameters
    ----------
    calibration : Calibration
        Without these words.
    looking : Looking
        Its training rows.
    near : RobotModel
        A fit of their geometry.
    """
    offers = [offer for offer in calibration.choice.offered if offer.ladder == "gravity"]
    offered = any(not np.isnan(offer.gain) for offer in offers)
    turned = (calibration.nominal.chain.T_world_base[:3, :3] != np.eye(3)).any()
    if not calibration.refuted or turned or not offered:
        return ()
    taken = any(offer.outcome == "taken" for offer in offers)
    if taken and calibration.fit.noise_factor < LOUD:
        return ()
    if calibration.moved is not None:  # that is the reason
        return ()
    upright, *gains = _gains(looking, near, _others(calibration, looking))
    most = max(gains)
    if most <= max(0.0, upright) + PLAIN:
        return ()
    likely = [str(list(t)) for t, gain in zip(TURNS, gains, strict=True) if gain > most - ASKED]
    what = "does not explain the readings, but may if the arm hangs on a wall or ceiling"
    told = f"log evidence +{significant(most, 2)}"
    if taken:
        what = "explains less of the readings than if the arm hung on a wall or ceiling"
        told += f", not +{significant(max(upright, 0.0), 2)}"
    return (
        f"Gravity is assumed to act along -z of the base, and the sag it causes there {what} "
        f"({told}): if the arm hangs so, state it in robot.toml ([base] rotation_vector_deg = "
        f"{' or '.join(likely)})",
    )


def _others(calibration: Calibration, looking: Looking) -> tuple[Level, ...]:
    """Levels of the chosen model that are none of gravity."""
    offered = calibration.choice.offered
    names = {(offer.ladder, offer.level) for offer in offered if offer.outcome == "taken"}
    rows = row_ladders(looking.frames.start, looking.train, looking.known)
    return tuple(
        level
        for ladder in (*looking.bends, *rows)
        for level in ladder.levels
        if ladder.name != "gravity" and (ladder.name, level.name) in names
    )


def _gains(looking: Looking, near: RobotModel, beside: tuple[Level, ...]) -> list[float]:
    """Log evidence of what gravity bends beside other levels: upright, and on each other base."""
    start, parameters, robot = looking.frames.start, looking.frames.parameters, looking.robot
    nominal, free, prior = start, parameters, wide_prior(parameters, start)
    if beside:
        nominal, found = extended_by(start, looking.train, parameters, beside, prior=prior)
        free, near = extended_parameters(start, nominal, parameters), found.model
        prior = prior.joined(prior_of(beside))
    ladders = {}
    for turn in ((0, 0, 0), *TURNS):
        if turn not in ALIKE:
            stands = np.eye(4)
            stands[:3, :3] = exp_so3(np.radians(turn))
            ladders[turn] = gravity_ladder(
                start, replace(looking.mounted, T_world_base=stands), moments=robot.moments,
                limits=robot.limits, payload=looking.train.conditions.usual_payload, sag=SAG,
            )  # fmt: skip
    each = best_alone(nominal, near, looking.train, free, [*ladders.values()], prior=prior)
    gains = {
        turn: -np.inf if best is None else best[1] for turn, best in zip(ladders, each, strict=True)
    }
    return [gains[ALIKE.get(turn, turn)] for turn in ((0, 0, 0), *TURNS)]
