"""Whether a station, the base, a target, the tool or a joint moved once, in words."""

from dataclasses import replace

import numpy as np

from calib.arrays import Bool
from calib.identification.outliers.moved import Moved, moved_once, targets_of
from calib.identification.result import Identification
from calib.measurement.observations import GIVEN, Measurements
from testbed.files.session import Session
from testbed.identify.calibration import Calibration
from testbed.units import DEG, MM, UM, fixed, significant


def moved_in(
    session: Session, result: Identification, measurements: Measurements, used: Bool
) -> Moved | None:
    """What moved between two rows that identify, where something tells their order.

    Parameters
    ----------
    session : Session
        Whose rows; those of several visits have frames of their own.
    result : Identification
        Of the chosen model.
    measurements : Measurements
        All rows (m).
    used : (m,) array of bool
        Rows identified from.
    """
    if session.visits or session.wanted.order == "unknown":
        return None
    rows = np.flatnonzero(used)
    found = moved_once(result, measurements.rows(rows), session.in_time[rows])
    if found is None:
        return None
    return replace(found, last=int(rows[found.last]), row=int(rows[found.row]))


def moved_words(calibration: Calibration) -> tuple[str, ...]:
    """What moved, between which poses, how far, and what is to be done."""
    found = calibration.moved
    if found is None:
        return ()
    poses = calibration.measurements.pose_id
    last, first = (calibration.pose_names[poses[row]] for row in (found.last, found.row))
    what, mend = _said(calibration, found)
    return (
        f"Between pose {last} and pose {first} something moved: from there on {what}. That "
        f"explains {100 * found.explained:.0f} % of what noise does not (p < 0.001); {mend}",
    )


def _said(calibration: Calibration, found: Moved) -> tuple[str, str]:
    """What stands off, and what mends it."""
    size = _length(found.size)
    if found.what == "joint":
        slides = calibration.nominal.chain.kinds[found.number] == "prismatic"
        off = float(found.change[0])
        text = f"{off * UM:+.3g} um" if slides else f"{off * DEG:+.3g} deg"
        what = f"joint {found.number + 1} stands {text} off (its zero slipped or was set anew)"
        return what, "mend that joint in the rows of one side, or identify from one side alone"
    if found.what == "target":
        whole = calibration.measurements.rows(calibration.is_used)
        name = _target(calibration, whole, found.number)
        what = f"{name} stands {size} off on the tool (it came loose, or was mounted anew)"
        if len(targets_of(whole)[0]) > 1:
            return what, "leave its rows of one side out"
        return what, "state the rows from there on as a [[session]] of their own"
    turned = f"turned by {fixed(float(np.linalg.norm(found.change[3:])) * DEG, 4)} deg"
    apart = "state the rows from there on as a [[session]] of their own"
    if found.what == "tool":
        what = f"all targets stand {size} off on the tool as one piece, {turned} (it slipped, or "
        return f"{what}was mounted anew)", f'{apart}, base = "same as" the first'
    what = f"the readings stand {size} off as one piece, {turned} "
    if found.what == "base":
        what = f"the readings of all stations stand {size} off as one piece, {turned} (the base of "
        return f"{what}the robot was moved)", f'{apart}, tool = "same as" the first'
    what += "(the instrument or the base of the robot was moved)"
    if len(calibration.set_up.stations) > 1:
        what = f"the readings of station {calibration.set_up.stations[found.number]} stand {size} "
        what += f"off as one piece, {turned} (it was moved)"
    return what, f'{apart}, tool = "same as" the first'


def _target(calibration: Calibration, table: Measurements, number: int) -> str:
    """What a target is called."""
    targets, which = targets_of(table)
    row = int(np.argmax(which == number))
    reflector = int(table.reflector[row])
    if len(targets) == 1:
        return "the target"
    if reflector != GIVEN and reflector < len(calibration.reflector_names):
        return f"target {calibration.reflector_names[reflector]}"
    place = " ".join(f"{MM * x:g}" for x in table.offset[row])
    return f"the target at {place} mm"


def _length(metres: float) -> str:
    """In um below a millimetre, else in mm."""
    if metres < 1e-3:
        return f"{significant(metres * UM, 2)} um"
    return f"{significant(metres * MM)} mm"
