"""What a corrected program needs: where its targets hold, and the tool that it moves."""

from testbed.identify.applies.targets import quoted_words, tool_words
from testbed.identify.calibration import Calibration
from testbed.identify.decisions import decided_at
from testbed.identify.handback.delivered import ROBOT, Delivered
from testbed.identify.handback.root import root_words
from testbed.units import sentence


def program_step(calibration: Calibration, delivered: Delivered) -> str:
    """What to do with the corrected program, beside the next step; empty without one."""
    if not delivered.program or not calibration.settled:
        return ""
    said = [quoted_words(delivered.targets)] if delivered.targets is not None else []
    if not calibration.own_frames:
        root = delivered.root
        base = root or f"the base of {ROBOT}/robot.toml, as it was found"
        where = sentence(f"{root_words(calibration, root)}.") if root else ""
        said.append(
            f"Corrected targets hold in {base}: measure work frames in it, or teach them again. "
            f"{where}".rstrip()
        )
    if _other_tool(calibration, delivered):
        said.append(
            "The corrected program is undecided because it moves another tool than the measured "
            "target: measure that tool, or three reflectors on it, or put the measured place into "
            'the [tool] of robot.toml and write tool = "fixed" under [identification].'
        )
    return " ".join(filter(None, said))


def _other_tool(calibration: Calibration, delivered: Delivered) -> bool:
    """Whether the program is undecided where poses of the measured target pass."""
    words = {one.key: one.word for one in decided_at(calibration, delivered)}
    undecided = words.get("program_after") == "UNDECIDED" and words.get("held_out_after") == "PASS"
    another = calibration.handback.in_use is not None or bool(tool_words(calibration))
    return undecided and another
