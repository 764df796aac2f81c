"""Whether two arms, tools, stations or loads took turns in one table, pose by pose."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.gravity import DOWN
from calib.identification.identify import Identification
from calib.identification.outliers.moved import Moved, moved_once
from calib.measurement.observations import Measurements
from testbed.files.session import Session
from testbed.identify.calibration import Calibration
from testbed.identify.moved import or_else, said_of


def in_turn_words(calibration: Calibration, session: Session) -> tuple[str, ...]:
    """That every second pose differs from the others as if something else was measured there.

    Asked only where a test refutes the numbers, nothing moved between two rows, and something tells
    the order of the rows: then the poses at even places are put behind those at odd ones, and a
    step between the two is looked for as one in time is.

    Parameters
    ----------
    calibration : Calibration
        Without these words.
    session : Session
        Whose rows.
    """
    untold = session.wanted.order == "unknown" or bool(session.visits)
    if not calibration.refuted or calibration.moved is not None or untold:
        return ()
    rows = np.flatnonzero(calibration.is_used)
    turn = _turns(session)[rows]
    fits = dict.fromkeys(fit.identification for fit in (calibration.fit, calibration.fits[0]))
    found = _taken(
        [*fits], calibration.measurements.rows(rows), turn, session.in_time[rows],
        calibration.nominal.chain.T_world_base[:3, :3].T @ DOWN,
    )  # fmt: skip
    if found is None:
        return ()
    what = said_of(calibration, found)[0] + or_else(calibration, found)
    return (
        f"Every second pose differs from those between: there {what}. "
        f"That explains {100 * found.explained:.0f} % of the errors beyond noise (p < 0.001): if "
        "two arms, tools, stations or sides of approach took turns in this table, give each one of "
        "its own",
    )


def _turns(session: Session) -> Index:
    """Whether each row (m,) is of a pose at an odd place in time (0) or at an even one (1)."""
    order = np.argsort(session.in_time, kind="stable")
    pose = session.measurements.pose_id[order]
    turn = np.empty(len(order), dtype=np.int64)
    turn[order] = np.cumsum(np.concatenate([[False], pose[1:] != pose[:-1]])) % 2
    return turn


def _taken(
    fits: Sequence[Identification], table: Measurements, turn: Index, time: Index, gravity: Array
) -> Moved | None:
    """What differs between the turns (m,) of a table, by the first fit that shows it."""
    order = np.empty(len(table), dtype=np.int64)
    order[np.lexsort((time, turn))] = np.arange(len(table))
    for fit in fits:
        found = moved_once(fit, table, order, gravity=gravity)
        if found is not None and turn[found.last] < turn[found.row]:
            return found
    return None
