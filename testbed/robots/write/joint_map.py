"""The joint map: the error of each joint over one turn, with its uncertainty.

It is for controllers that take tables, and to look at. It does not include sag that depends on
several joints, nor terms of operating conditions: direction of approach, torque, temperature.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from testbed.robots.write.dh_table import COVERAGE
from testbed.units import MDEG

FINEST = 90
"""Waves a turn of which a table with one line a degree shows the shape: gears leave more."""


@dataclass(frozen=True, slots=True, eq=False)
class JointMap:
    """Turns of k joints that have waves of their own, at a angles."""

    joints: Index
    """(k,) 0-based."""
    angle: Array
    """(a,) commanded [rad]."""
    turn: Array
    """(a, k) joint angle minus command [rad]."""
    u: Array
    """(a, k) standard uncertainty [rad]."""


def joint_map(model: RobotModel, parameters: Parameters, covariance: Array) -> JointMap:
    """The map of an identified robot, every degree of a turn.

    Parameters
    ----------
    model : RobotModel
        Identified.
    parameters : Parameters
        Which of its numbers were free.
    covariance : (f, f) array
        Of these [rad^2].
    """
    errors, n = model.joint_errors, model.chain.n_joints
    angle = np.radians(np.arange(-180.0, 181.0))
    places = {name: k for k, name in enumerate(parameters.free_names)}
    own = [
        (term, value)
        for term, value in zip(errors.terms, errors.coefficients, strict=False)
        if term.is_wave
        and max(map(abs, term.weights)) <= FINEST
        and not any(weight for i, weight in enumerate(term.weights) if i != term.joint)
        and model.chain.kinds[term.joint] == "revolute"
    ]
    joints = sorted({term.joint for term, _ in own})
    turn, u = np.zeros((len(angle), len(joints))), np.zeros((len(angle), len(joints)))
    for k, joint in enumerate(joints):
        terms, values = zip(*(each for each in own if each[0].joint == joint), strict=True)
        basis = JointErrors(terms).basis(np.repeat(angle[:, None], n, axis=1))
        turn[:, k] = basis @ np.array(values)
        free = [i for i, term in enumerate(terms) if term.name in places]
        at = [places[terms[i].name] for i in free]
        seen = basis[:, free]
        u[:, k] = np.sqrt(np.maximum((seen @ covariance[np.ix_(at, at)] * seen).sum(axis=1), 0.0))
    return JointMap(frozen(joints, np.int64), frozen(angle), frozen(turn), frozen(u))


def joint_map_rows(found: JointMap) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows of the table: angle [deg], then turn and U = 2 u of each joint [mdeg]."""
    head = ["angle_deg"]
    for joint in found.joints:
        head += [f"joint{joint + 1}_mdeg", f"joint{joint + 1}_U_k2_mdeg"]
    rows = []
    for angle, turns, spread in zip(found.angle, found.turn, found.u, strict=True):
        row = [f"{np.degrees(angle):.0f}"]
        for turn, u in zip(turns, spread, strict=True):
            row += [f"{MDEG * turn:.4f}", f"{COVERAGE * MDEG * u:.2g}"]
        rows.append(tuple(row))
    return tuple(head), rows
