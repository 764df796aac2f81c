"""The product's front: robots, campaigns, plans and calibrations in one call each.

Everything here hands on to `testbed` and is imported at first use. Lengths in metres, angles in
radians; what is written to disk is what the command of the same name writes.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from testbed.files.session import Session
    from testbed.identify.calibration import Calibration
    from testbed.iso9283.records import CycleResult
    from testbed.plan.records import Plan
    from testbed.robots.robot import Robot
    from testbed.scenario.scenario import Scenario
    from testbed.store.written import WrittenFolder
    from testbed.studies.trial.records import Campaign

__all__ = ("identify", "iso9283", "load", "plan", "robot", "run")


def __getattr__(name: str) -> ModuleType:
    """The module ``plots``, which loads matplotlib where it is asked for."""
    if name != "plots":
        raise AttributeError(f"module 'truebed' has no attribute {name!r}")
    return import_module("truebed.plots")


def __dir__() -> list[str]:
    return sorted([*__all__, "plots"])


def robot(name_or_path: str | Path) -> "Robot":
    """A robot: one that ships (``staubli_tx60``), or a robot.toml, URDF or MJCF file."""
    from testbed.robots.catalog import load_robot

    return load_robot(name_or_path)


def run(scenario: "str | Path | Scenario", out: str | Path | None = None) -> "Campaign":
    """Play a whole virtual campaign, as ``truebed run`` does.

    Equal bytes on every machine are promised for the command only: it sets the thread variables
    (``OPENBLAS_NUM_THREADS=1`` and its like) before numpy is loaded, which a script that has
    imported numpy cannot do any more. Set them in the environment to get the same.

    Parameters
    ----------
    scenario : str, Path or Scenario
        A scene that ships (``quick``), a scenario file, or a scenario.
    out : path, optional
        Run folder to write; without it nothing is written.
    """
    from testbed.run.play import play_run

    return play_run(_scenario(scenario), out).campaign


def plan(scenario: "str | Path | Scenario", out: str | Path | None = None) -> "Plan":
    """Plan the measurement of a real robot, as ``truebed plan`` does.

    Parameters
    ----------
    scenario : str, Path or Scenario
        A scene that ships (``plan_tx60``), a scenario file, or a scenario.
    out : path, optional
        Folder to write; without it nothing is written.
    """
    from testbed.plan.folder import play_plan
    from testbed.plan.plan import plan

    scene = _scenario(scenario)
    return plan(scene) if out is None else play_plan(scene, Path(out))


def identify(
    robot: "str | Path | Robot", session: "str | Path | Session", out: str | Path | None = None
) -> "Calibration":
    """Calibrate a real robot from measurement files, as ``truebed identify`` does.

    Parameters
    ----------
    robot : str, Path or Robot
        The robot as its maker describes it.
    session : str, Path or Session
        A session.toml, a CSV of measurements, or what `testbed.files.read.read_session` gave.
    out : path, optional
        Folder to write; without it nothing is written.
    """
    from testbed.files.read import read_session
    from testbed.files.session import Session
    from testbed.identify.calibrate import calibrate
    from testbed.identify.folder import play_calibration
    from testbed.identify.given import require_order
    from testbed.robots.catalog import load_robot
    from testbed.robots.robot import Robot

    if not isinstance(robot, Robot) and not isinstance(session, Session):
        require_order(str(robot), Path(session))
    arm = robot if isinstance(robot, Robot) else load_robot(robot)
    seen = session if isinstance(session, Session) else read_session(session, arm)
    return calibrate(arm, seen) if out is None else play_calibration(arm, seen, Path(out))[0]


def iso9283(data: str | Path, out: str | Path | None = None) -> "CycleResult":
    """Test a real robot after ISO 9283, as ``truebed iso9283`` does.

    Parameters
    ----------
    data : str or Path
        A table of measured cycles, or a session.toml with [cycles] or [paths].
    out : path, optional
        Folder to write; without it nothing is written.
    """
    from testbed.iso9283.folder import play_iso9283
    from testbed.iso9283.play import play_test
    from testbed.iso9283.read import read_test

    test = read_test(data)
    return play_test(test) if out is None else play_iso9283(test, Path(out))


def load(folder: str | Path) -> "Campaign | Calibration | Session | Robot | WrittenFolder":
    """What any folder that this program wrote holds; what it is stands first when it is printed.

    A campaign or a calibration comes back as `run` or `identify` gave it; of a plan or a test after
    ISO 9283 the numbers and tables of its files; of exported measurements the session; of the
    folder of a robot the robot. Nothing is computed.

    Parameters
    ----------
    folder : path
        The folder, as given by ``--out``.
    """
    from calib.errors import refuse
    from testbed.files.read import read_session
    from testbed.files.session_toml import SESSION_FILE
    from testbed.gates.paths import is_there, near
    from testbed.gates.toml import read_toml_bytes, toml_document
    from testbed.identify.folder import load_calibration
    from testbed.robots.catalog import ROBOT_FILE, load_robot
    from testbed.run.play import load_run
    from testbed.store.manifest import CALIBRATION, kind_of, read_manifest
    from testbed.store.written import written_folder

    path = Path(folder)
    if not is_there(path, Path.is_dir):
        message = "is a file" if is_there(path) else "does not exist"
        fix = "give a folder that truebed wrote"
        fix = fix if is_there(path) else near(path, fix)
        raise refuse("", code="D42", message=message, fix=fix, where=str(path))
    if (written := written_folder(path)) is not None:
        return written
    if (path / ROBOT_FILE).is_file():
        return load_robot(path)
    if (file := path / SESSION_FILE).is_file():
        document = toml_document(read_toml_bytes(file, str(file)), str(file))
        return read_session(file, load_robot(str(document.get("robot", ""))))
    if kind_of(read_manifest(path)) == CALIBRATION:
        return load_calibration(path)[0]
    return load_run(path)


def _scenario(scenario: "str | Path | Scenario") -> "Scenario":
    """The scenario, read where a name or a file is given."""
    from testbed.scenario.scenario import Scenario
    from testbed.studies import load_scenario

    return scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
