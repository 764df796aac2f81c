"""The user's own URDF or MJCF with corrected frames: for programs that have loaded it so far."""

from pathlib import Path

from calib.errors import one_line
from testbed.gates.paths import short_stem
from testbed.identify.calibration import Calibration
from testbed.identify.handback.delivered import GEOMETRIC, ROBOT
from testbed.identify.handback.states import in_own_frames
from testbed.robots.placements import LIMIT, agreement
from testbed.robots.robot import Robot
from testbed.robots.source import OwnText, UrdfText
from testbed.robots.write.own.mjcf import corrected_mjcf
from testbed.robots.write.own.places import CorrectedFile, NotCorrectableError
from testbed.robots.write.own.urdf import corrected_urdf
from testbed.units import DEG, MM, significant


def own_file_name(path: Path) -> str:
    """Name of the corrected file: ``NAME_corrected.urdf`` or ``NAME_corrected.xml``."""
    return f"{short_stem(path)}_corrected{path.suffix.lower()}"


def deliver_own_file(
    calibration: Calibration, robot: Robot, folder: Path
) -> tuple[str, tuple[str, ...]]:
    """Write the file that the robot was read from with corrected frames, beside the others.

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
    source = robot.own_text
    if source is None:
        return "", ()
    file = one_line(source.path.name)
    chain = in_own_frames(calibration, calibration.fits[0]).chain
    try:
        if isinstance(source, UrdfText):
            found = corrected_urdf(source, robot.model.chain, chain, robot.limits)
        else:
            found = corrected_mjcf(source, robot.model.chain, chain, robot.limits)
    except NotCorrectableError as error:
        return "", (f"{file} is not handed back corrected, because {one_line(str(error))}",)
    if not found.changed:
        return "", (f"{file} stays as it is: no number that it has was identified anew",)
    extended = calibration.choice.chosen == "extended"
    name = f"{GEOMETRIC if extended else ROBOT}/{own_file_name(source.path)}"
    (folder / name).write_bytes(found.data)
    told = _what_changed(found, source, one_line(name))
    kind = "URDF" if isinstance(source, UrdfText) else "MJCF"
    told += f"; no {kind} has joint terms, so that it is the geometric fit" * extended
    return name, (told, _frames(calibration, source, found))


def _what_changed(found: CorrectedFile, source: OwnText, name: str) -> str:
    """What was done to the file, and how it is used."""
    reader = "yourdfpy" if isinstance(source, UrdfText) else "MuJoCo"
    proof = agreement(f"{name} ({reader})", *found.agreement)
    shift, turn = found.moved
    return (
        f"{name} is {one_line(source.path.name)} with {found.what} corrected (by up to "
        f"{significant(shift * MM, 2)} mm and {significant(turn * DEG, 2)} deg) and nothing else "
        f"changed: put it in the place of that file, from where its meshes are found; {proof}"
    )


def _frames(calibration: Calibration, source: OwnText, found: CorrectedFile) -> str:
    """Where its base and its tool are, and what of the tool no frame can take."""
    root, tip, (shift, turn) = one_line(found.root), one_line(source.tip), found.left
    if calibration.own_frames:
        words = f"in it {root} is the frame of the measurements, and {tip} the identified tool"
    else:
        words = (
            f"in it the base is {root} and the tool is {tip} as your programs know them: it has "
            "the identified links, not the places of instrument and target"
        )
    if max(shift, turn) > LIMIT:
        fixed = "link that is fixed to" if isinstance(source, UrdfText) else "site or body fixed to"
        words += (
            f"; but {tip} moves with joint {one_line(found.last)}, whose axis stands in it, and so "
            f"lies {significant(shift * MM, 2)} mm and {significant(turn * DEG, 2)} deg from where "
            f"it was identified: a {fixed} it, stated as --tip, can lie there"
        )
    return words
