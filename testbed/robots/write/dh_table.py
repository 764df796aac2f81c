"""The table of an identified robot: each number before, after, the change and its uncertainty."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, check
from calib.errors import refuse
from calib.geometry.frames import right_jacobian_inverse, transform_step
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, shown_in

COVERAGE = 2.0
"""k of the expanded uncertainty."""


@dataclass(frozen=True, slots=True)
class DhRow:
    """One number of a robot, in the unit that people read."""

    name: str
    """As in `RobotModel.names`."""
    unit: str
    """mm, deg, kg, kg m, or 1e-6/K."""
    old: float
    """Nominal."""
    new: float
    """Identified."""
    delta: float
    """New minus old."""
    expanded: float | None
    """U (k = 2); None if the number was held."""


def dh_rows(
    nominal: RobotModel, identified: RobotModel, parameters: Parameters, covariance: Array
) -> tuple[DhRow, ...]:
    """Rows for base, links, tool and joint terms; reflectors and stations are not the robot's.

    Base and tool are listed as position and rotation vector in the frame they are given in. They
    are identified as a step in the frame's axes, so that their uncertainty is transformed:
    dp = R t, d Log R = inv(Jr) r.

    Parameters
    ----------
    nominal : RobotModel
        Model before calibration. Joint terms that it lacks count as zero.
    identified : RobotModel
        Model after calibration.
    parameters : Parameters
        Which numbers of `identified` were free.
    covariance : (f, f) array
        Of the free numbers, in their order [m, rad].

    References
    ----------
    Sola et al. arXiv 1812.01537, right Jacobian of SO(3).
    """
    (covariance,) = check(f"{parameters.n_free} {parameters.n_free}", covariance=covariance)
    n, k = identified.chain.n_joints, len(identified.joint_errors.names)
    if parameters.names[: 12 + 5 * n + k] != identified.names[: 12 + 5 * n + k]:
        message = "parameters are not those of the identified model"
        raise refuse("parameters", code="A3", message=message)
    full = np.zeros((len(parameters.names),) * 2)
    full[np.ix_(parameters.free_index, parameters.free_index)] = covariance
    sd = np.sqrt(np.diagonal(full))
    before = dict(zip(nominal.joint_errors.names, nominal.joint_errors.coefficients, strict=True))
    first, tool, end = 6, 6 + 5 * n, 12 + 5 * n
    old, new = nominal.chain, identified.chain
    parts = (
        _frame(old.T_world_base, new.T_world_base, full[:first, :first]),
        (old.links.ravel(), new.links.ravel(), sd[first:tool]),
        _frame(old.T_flange_tool, new.T_flange_tool, full[tool:end, tool:end]),
        (
            np.array([before.get(name, 0.0) for name in identified.joint_errors.names]),
            identified.joint_errors.coefficients,
            sd[end : end + k],
        ),
    )
    rows = zip(*(np.concatenate(columns) for columns in zip(*parts, strict=True)), strict=True)
    return tuple(
        _row(parameters.names[i], identified.is_length[i], *row) for i, row in enumerate(rows)
    )


def _frame(nominal: Array, identified: Array, covariance: Array) -> tuple[Array, Array, Array]:
    """Position and rotation vector (6,) of a frame before and after, and their uncertainties."""
    old = transform_step(nominal)
    new = _near(transform_step(identified), old)
    moves = np.zeros((6, 6))
    moves[:3, :3], moves[3:, 3:] = identified[:3, :3], right_jacobian_inverse(new[3:])
    spread = np.sqrt(np.clip(np.diagonal(moves @ covariance @ moves.T), 0, None))
    # held numbers stay exactly the same, so that rounding of a rotation makes none look free
    return old, new, np.where(spread > 1e-12 * np.sqrt(covariance.max(initial=0.0)), spread, 0.0)


def _row(name: str, is_length: bool, old: float, new: float, sd: float) -> DhRow:
    """One row in the unit that people read."""
    unit, scale = shown_in(name, is_length)
    return DhRow(
        name, unit, float(old * scale), float(new * scale),
        float((new - old) * scale), float(COVERAGE * sd * scale) if sd > 0 else None,
    )  # fmt: skip


def _near(step: Array, other: Array) -> Array:
    """The same frame with the rotation vector that lies nearest to another's: near a half turn."""
    turn = float(np.linalg.norm(step[3:]))
    if turn == 0.0:
        return step
    again = step[3:] * (1 - 2 * np.pi / turn)
    closer = np.linalg.norm(again - other[3:]) < np.linalg.norm(step[3:] - other[3:])
    return np.concatenate([step[:3], again]) if closer else step
