"""How far gravity moves the tool of the true arm over its workspace, and what a model leaves."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import target_points
from calib.geometry.joint_errors import JointErrors
from testbed.laboratory.truth.laboratory import resting_arm
from testbed.studies.trial.records import Campaign, Estimate

SEEN = 5e-6
"""A sag that is smaller everywhere is not shown: no tracker sees it [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Sag:
    """Sag at the poses of the pool; what moves, warms up or has play is not in it."""

    place: Array
    """(m, 2) of the tool in the plane of the arm: distance from the base's upright, height [m]."""
    size: Array
    """(m,) how far gravity moves the tool [m]."""
    left: Array
    """(m,) how far the true tool is from where the identified model has it [m]."""


def sag_of(campaign: Campaign, estimate: Estimate) -> Sag | None:
    """The sag of the true arm; None where gravity moves nothing that could be seen."""
    setting = campaign.setting
    q, true, target = setting.pool_q, setting.true, setting.target
    stiff = replace(true, joint_errors=without_gravity(true.joint_errors))
    arm = resting_arm(campaign.scenario, setting)
    rest = true.poses(q) if arm is None else arm.poses(q + true.joint_errors.offsets(q))
    bent, straight = (target_points(T, target) for T in (rest, stiff.poses(q)))
    size = np.linalg.norm(bent - straight, axis=1)
    if size.max() < SEEN:
        return None
    found = target_points(estimate.identification.model.poses(q), target)
    nominal = setting.pool_nominal[:, :3, 3] - setting.nominal.chain.T_world_base[:3, 3]
    place = np.column_stack([np.linalg.norm(nominal[:, :2], axis=1), nominal[:, 2]])
    return Sag(place, size, np.linalg.norm(bent - found, axis=1))


def without_gravity(errors: JointErrors) -> JointErrors:
    """The joint errors without the sag that they hold in closed form."""
    kept = [k for k, term in enumerate(errors.terms) if not term.name.startswith("gravity")]
    return JointErrors(tuple(errors.terms[k] for k in kept), errors.coefficients[kept])
