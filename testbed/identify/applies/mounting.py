"""Which way gravity acts on an arm, where along -z of its base it explains nothing."""

from dataclasses import replace

import numpy as np

from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.identification.climb import climb
from calib.identification.climbing import ASKED
from calib.identification.ladders import ladders_of
from testbed.identify.calibration import Calibration
from testbed.identify.fit import wide_prior
from testbed.identify.outliers import Looking
from testbed.units import significant

TURNS = ((0, 90, 0), (0, -90, 0), (90, 0, 0), (-90, 0, 0), (180, 0, 0))
"""Rotation vectors of bases on four walls and a ceiling [deg]."""
LOUD = 2.0
"""Residual of the chosen model, in units of the stated noise, from which on gravity is asked for
although it is taken: the usual misfit of an arm with gears is not worth five more climbs."""


def mounting_words(calibration: Calibration, looking: Looking, near: RobotModel) -> tuple[str, ...]:
    """That gravity explains the readings if the arm hangs on a wall or ceiling, where it does.

    Asked only where a test refutes the numbers, the robot's file does not turn its base, and either
    no level of the ladder of gravity is taken as the arm is said to stand, or the residuals are
    loud all the same: then five other ways are tried, by the evidence that the levels gain on the
    training rows. Springs and a tilt follow much of a wrong way, too: another must gain more than
    this one.

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
    gained = [offer.gain for offer in offers if not np.isnan(offer.gain)]
    turned = (calibration.nominal.chain.T_world_base[:3, :3] != np.eye(3)).any()
    if not calibration.refuted or turned or not gained:
        return ()
    taken = any(offer.outcome == "taken" for offer in offers)
    if taken and calibration.fit.noise_factor < LOUD:
        return ()
    if calibration.moved is not None:  # that is the reason
        return ()
    start, parameters = looking.frames.start, looking.frames.parameters
    prior, robot, gains = wide_prior(parameters, start), looking.robot, []
    for turn in TURNS:
        stands = np.eye(4)
        stands[:3, :3] = exp_so3(np.radians(turn))
        ladder, _ = ladders_of(
            start, replace(looking.mounted, T_world_base=stands), moments=robot.moments,
            limits=robot.limits, payload=looking.train.conditions.usual_payload,
        )  # fmt: skip
        found = climb(start, near, looking.train, parameters, (ladder,), None, prior=prior)
        gains.append(-np.inf if found.best is None else found.best[1])
    most = max(gains)
    if most <= max(0.0, *gained) + ASKED + np.log(len(TURNS)):  # that many were tried
        return ()
    likely = [str(list(t)) for t, gain in zip(TURNS, gains, strict=True) if gain > most - ASKED]
    what = "does not explain the readings; on a wall or ceiling it may"
    told = f"log evidence +{significant(most, 2)}"
    if taken:
        what = "explains less of the readings than it would on a wall or ceiling"
        told += f", not +{significant(max(gained), 2)}"
    return (
        f"Gravity is taken along -z of the base, and what it bends there {what} ({told}): if the "
        f"arm hangs so, say it in robot.toml ([base] rotation_vector_deg = {' or '.join(likely)})",
    )
