"""Implementation of some verbs of the front, with their imports, loaded at the first call."""

from pathlib import Path

from calib.calibration import CalibratedRobot
from calib.geometry.model import RobotModel
from testbed.files.read import read_session
from testbed.files.session import Session
from testbed.identify.calibrate import calibrate
from testbed.identify.calibration import Calibration
from testbed.identify.folder import play_calibration
from testbed.identify.given import require_order
from testbed.identify.handback.deliver import identified_name
from testbed.iso9283.folder import play_iso9283
from testbed.iso9283.play import play_test
from testbed.iso9283.read import read_test
from testbed.iso9283.records import CycleResult
from testbed.robots.catalog import load_robot
from testbed.robots.robot import Robot
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.identified import identified_robot


def identified(
    robot: str | Path | Robot, session: str | Path | Session, out: Path | None
) -> Calibration:
    """Implementation of `truebed.identify`."""
    if not isinstance(robot, Robot) and not isinstance(session, Session):
        require_order(str(robot), Path(session))
    arm = robot if isinstance(robot, Robot) else load_robot(robot)
    seen = session if isinstance(session, Session) else read_session(session, arm)
    return calibrate(arm, seen) if out is None else play_calibration(arm, seen, out)[0]


def cycled(data: str | Path, out: Path | None) -> CycleResult:
    """Implementation of `truebed.iso9283`."""
    test = read_test(data)
    return play_test(test) if out is None else play_iso9283(test, out)


def written(
    robot: str | Path | Robot, found: RobotModel | CalibratedRobot, folder: Path, *, overwrite: bool
) -> tuple[str, ...]:
    """Implementation of `truebed.write_robot`."""
    arm = robot if isinstance(robot, Robot) else load_robot(robot)
    model = found.model if isinstance(found, CalibratedRobot) else found
    own = RobotModel(model.chain, model.joint_errors)  # what the laboratory placed stays there
    if model is arm.model:  # nothing was identified: another file of the same robot
        return write_robot_folder(arm, folder, overwrite=overwrite)
    named = identified_robot(arm, own, name=identified_name(arm.name))
    return write_robot_folder(named, folder, overwrite=overwrite)
