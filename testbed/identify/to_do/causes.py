"""What has to be settled before anything else, strongest first."""

from calib.uncertainty.drift.drifting import AGAIN
from calib.uncertainty.frames.other_frame import UNTIL
from testbed.identify.applies.beyond import beyond_words, far_words
from testbed.identify.calibration import DRIVES, FRAMES, IN_TURN, MOUNTING, Calibration
from testbed.identify.conditions import held_out_departs
from testbed.identify.moved import happened
from testbed.identify.to_do.change import rises
from testbed.identify.to_do.unconfirmed import unconfirmed

CHECK = "Check the robot's description, the units, and which reading belongs to which joints."


def first_of_all(calibration: Calibration) -> str:
    """What leaves no number of this calibration to be used as it is; else empty."""
    if calibration.source.exact:
        return (
            "First find out whether these are measurements: poses that a controller computed "
            "itself calibrate nothing. Measure them with an instrument."
        )
    if calibration.unshown:
        return (
            f"First let {UNTIL} (in the column split): where nothing shows in which frame they "
            "stand, held-out positions test nothing."
        )
    if calibration.elsewhere:
        used, judges = calibration.is_used, calibration.split.is_test
        differ = held_out_departs(calibration.conditions, calibration.set_up, used, judges)
        conditions = ", or what their conditions do" if differ else ""
        return (
            "First find out why the held-out poses are off as a whole: a base or a station that "
            f"moved, another target, another tool{conditions}. Then measure them again, or let "
            f"some of them show where they stand: {_own_session(calibration)}"
        )
    if calibration.moved is not None:
        first = f"First find out what {happened(calibration.moved)}, and "
        if calibration.moved.back is not None:
            return (
                f"{first}leave the rows out in which it was not as before, or describe them as a "
                "[[session]] of their own: the radius now covers both."
            )
        return (
            f"{first}separate the rows before it from those after it: the radius now covers both."
        )
    return ""


def _own_session(calibration: Calibration) -> str:
    """How a session has held-out poses that stand elsewhere, as it is written."""
    frame = calibration.proof.frame
    at_tool, both = (frame.at_tool, frame.both) if frame is not None else (False, False)
    parts = ["base"] * (both or not at_tool) + ["tool"] * (both or at_tool)
    free = ", ".join(f'{part} = "free"' for part in parts)
    if calibration.visits:
        return f"{free} and frame_poses = 10 in their [[session]]."
    return f"a [[session]] of their own with held_out = true, {free} and frame_poses = 10."


def description_step(calibration: Calibration) -> str:
    """What the readings contradict in the description, before its robot is used; else empty."""
    if IN_TURN in calibration.doubted:
        return "First find out what took turns in this table, pose by pose, and separate its rows."
    if FRAMES in calibration.doubted:
        return (
            "First settle where base and tool are, which the readings have elsewhere than the "
            "robot's file: correct it, or free them under [identification]."
        )
    if MOUNTING in calibration.doubted:
        then = "and"
        if hidden_drift_step(calibration):  # which is said at the end
            then = "or a steady drift looks like it; if it does hang there,"
        return (
            f"First find out whether the arm hangs on a wall or ceiling, {then} state it in "
            "robot.toml ([base] rotation_vector_deg)."
        )
    if DRIVES in calibration.doubted:
        return (
            "First state by which ratios the drives of the wrist turn each other (below), and "
            "identify again."
        )
    return ""


def drift_step(calibration: Calibration) -> str:
    """What to do about a drift that the readings show; else empty."""
    slow, order = calibration.repeats_drift, calibration.proof.drifting
    if slow is not None and slow.joints:
        return (
            "Visits differ from round to round: measure with the arm as warm as it will be used, "
            "and from the side from which it will come."
        )
    if slow is not None and slow.of_tool and not slow.or_else:
        return "The tool drifts on the flange: fasten it, and measure again."
    if slow is not None or (order is not None and order.seen):
        if calibration.source.drift:
            return (
                "The readings drift beside what the nests show: let the instrument and the arm "
                "settle, and measure the nests more often."
            )
        return (
            "The readings drift: let the instrument and the arm settle, and measure nests on the "
            "floor with them ([drift])."
        )
    return ""


def hidden_drift_step(calibration: Calibration) -> str:
    """What to do about a steady drift that the order of the poses hides in part; else empty."""
    order = calibration.proof.drifting
    if order is None or not order.hides_one:
        return ""
    nests = ", and nests on the floor ([drift]), which take off what the station does"
    return (
        f"What is left may be a steady drift: measure the first {AGAIN} poses once more at the end "
        f"to see whether it is{nests * (not calibration.source.drift)}."
    )


def do_not_use(calibration: Calibration) -> str:
    """What to do about a model that is no better than the nominal one."""
    worse = "worse" if rises(calibration) else "no better"
    why = description_step(calibration) or unconfirmed(calibration)
    if not why and not calibration.converged:
        why = (
            "The fit did not converge: measure poses that tell its numbers apart, or free fewer "
            "([identification] free)."
        )
    if not why and len(beyond_words(calibration)) > len(far_words(calibration)):
        why = (
            "Add training poses where the held-out ones lie, or find out whether the robot had "
            "changed by then."
        )
    why = why or drift_step(calibration) or CHECK
    return f"Do not use this model: on held-out poses it is {worse} than the nominal one. {why}"
