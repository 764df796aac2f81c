"""The user's own URDF with corrected origins: for programs that have loaded it so far."""

from pathlib import Path

from calib.errors import one_line
from testbed.gates.paths import short_stem
from testbed.identify.calibration import Calibration
from testbed.identify.handback.delivered import GEOMETRIC, ROBOT
from testbed.identify.handback.states import in_own_frames
from testbed.robots.placements import LIMIT, agreement
from testbed.robots.robot import Robot
from testbed.robots.source import UrdfText
from testbed.robots.write.own_urdf import CorrectedUrdf, corrected_urdf
from testbed.units import DEG, MM, counted, significant


def own_urdf_name(path: Path) -> str:
    """Name of the corrected URDF: ``NAME_corrected.urdf``."""
    return f"{short_stem(path)}_corrected.urdf"


def deliver_own_urdf(
    calibration: Calibration, robot: Robot, folder: Path
) -> tuple[str, tuple[str, ...]]:
    """Write the URDF that the robot was read from with corrected origins, beside the others.

    It holds geometry alone, so that it is that of the geometric fit, in the frames that programs
    know (`in_own_frames`).

    Parameters
    ----------
    calibration, robot : Calibration, Robot
        What was found, of the robot as it was read.
    folder : Path
        That of the calibration, which has those of the identified robot.

    Returns
    -------
    tuple of str and tuple of str
        Its path from the folder, empty if none was written, and sentences about it.
    """
    source = robot.urdf
    if source is None:
        return "", ()
    file = one_line(source.path.name)
    model = in_own_frames(calibration, calibration.fits[0])
    found = corrected_urdf(source, robot.model.chain, model.chain, robot.limits)
    if found is None:
        return "", (
            f"{file} is not handed back with corrected origins, because its text is in an "
            "encoding that is not understood here: save it as UTF-8",
        )
    if not found.changed:
        return "", (f"{file} stays as it is: no number that it has was identified anew",)
    extended = calibration.choice.chosen == "extended"
    name = f"{GEOMETRIC if extended else ROBOT}/{own_urdf_name(source.path)}"
    (folder / name).write_bytes(found.data)
    told = _what_changed(found, file, one_line(name))
    told += "; no URDF has joint terms, so that it is the geometric fit" * extended
    return name, (told, _frames(calibration, source, found))


def _what_changed(found: CorrectedUrdf, file: str, name: str) -> str:
    """What was done to the file, and how it is used."""
    proof = agreement(f"{name} (yourdfpy)", *found.agreement)
    shift, turn = found.moved
    return (
        f"{name} is {file} with the origins of {counted(len(found.changed), 'joint')} corrected "
        f"(by up to {significant(shift * MM, 2)} mm and {significant(turn * DEG, 2)} deg) and "
        "nothing else changed: put it in the place of that file, from where its meshes are found; "
        f"{proof}"
    )


def _frames(calibration: Calibration, source: UrdfText, found: CorrectedUrdf) -> str:
    """Where its base and its tool are, and what of the tool no origin can take."""
    root, tip, (shift, turn) = one_line(found.root), one_line(source.tip), found.left
    if calibration.own_frames:
        words = f"in it {root} is the frame of the measurements, and {tip} the identified tool"
    else:
        words = (
            f"in it the base is {root} and the tool is {tip} as your programs know them: it has "
            "the identified links, not the places of instrument and target"
        )
    if max(shift, turn) > LIMIT:
        words += (
            f"; but {tip} moves with joint {one_line(found.last)}, whose axis has to run through "
            f"its origin, and so lies {significant(shift * MM, 2)} mm and "
            f"{significant(turn * DEG, 2)} deg from where it was identified: a link that is fixed "
            "to it, stated as --tip, can lie there"
        )
    return words
