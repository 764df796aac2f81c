"""The product's front: robots, campaigns, plans and calibrations in one call each.

Every function calls `testbed`, which is imported at first use. Lengths are in meters and angles in
radians; files written to disk are those of the command of the same name.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truebed.given import scenario_of, text_of

if TYPE_CHECKING:
    from calib.calibration import CalibratedRobot
    from calib.geometry.model import RobotModel
    from testbed.files.session import Session as Session
    from testbed.identify.calibration import Calibration as Calibration
    from testbed.iso9283.records import CycleResult as CycleResult
    from testbed.plan.records import Plan as Plan
    from testbed.robots.robot import Robot as Robot
    from testbed.scenario.scenario import Scenario as Scenario
    from testbed.studies.trial.records import Campaign as Campaign
    from truebed import lesson as lesson
    from truebed import plots as plots
    from truebed.virtual import VirtualLaboratory as VirtualLaboratory
else:
    import sys
    from importlib import import_module

    def __getattr__(name):
        """Modules and kinds of results, when asked for; ``plots`` loads matplotlib."""
        if name in MODULES:
            return import_module(f"truebed.{name}")
        if name in KINDS:
            return getattr(import_module(KINDS[name]), name)
        message = f"module 'truebed' has no attribute {name!r}"
        raise AttributeError(message, name=name, obj=sys.modules[__name__])

    def __dir__():
        return sorted([*__all__, *MODULES, *KINDS])


KINDS = {
    "Calibration": "testbed.identify.calibration",
    "Campaign": "testbed.studies.trial.records",
    "CycleResult": "testbed.iso9283.records",
    "Plan": "testbed.plan.records",
    "Robot": "testbed.robots.robot",
    "Scenario": "testbed.scenario.scenario",
    "Session": "testbed.files.session",
    "VirtualLaboratory": "truebed.virtual",
}
"""Classes of arguments and results, for annotations, and the module of each."""
MODULES = ("lesson", "plots")
"""Modules that are loaded when they are asked for."""
__all__ = (
    "export",
    "identify",
    "iso9283",
    "laboratory",
    "load",
    "plan",
    "robot",
    "run",
    "save",
    "scene",
    "write_robot",
)


def robot(name_or_path: str | Path, *, tip: str | None = None) -> "Robot":
    """Load a robot that ships (``staubli_tx60``), a robot.toml, or a URDF or MJCF up to `tip`."""
    from testbed.robots.catalog import load_robot

    return load_robot(text_of("name_or_path", name_or_path), tip=tip)


def scene(
    name_or_path: "str | Path | Scenario", changes: Mapping[str, Any] | None = None
) -> "Scenario":
    """Load a scenario to run or to plan: a scene that ships, or a file, with some keys changed.

    Parameters
    ----------
    name_or_path : str, Path or Scenario
        A scene that ships (``quick``), a scenario file, or a scenario.
    changes : mapping, optional
        Keys of the file, with their table before a dot: ``{"seed": 2, "truth.preset": "soft"}``.
        Keys that a preset fills in follow the changed preset, unless the file gives them.

    Examples
    --------
    >>> scene("quick", {"seed": 2})
    Scenario('quick', seed 2, staubli_tx60, 2 trials)
    """
    from calib.errors import refuse
    from testbed.scenario.read import changed

    if not isinstance(changes, Mapping | None):
        allowed, message = "keys and values", f"changes is of the type {type(changes).__name__}"
        fix = 'give a dictionary: {"seed": 2}'
        raise refuse("changes", changes, allowed, code="A3", message=message, fix=fix)
    return changed(scenario_of(name_or_path), changes) if changes else scenario_of(name_or_path)


def run(scenario: "str | Path | Scenario", out: str | Path | None = None) -> "Campaign":
    """Play a whole virtual campaign, as ``truebed run`` does.

    Equal bytes on every machine are promised for the command only: it sets the thread variables
    (``OPENBLAS_NUM_THREADS=1`` and its like) before numpy is loaded. A script that has imported
    numpy cannot do so any more; set them in the environment instead.

    Parameters
    ----------
    scenario : str, Path or Scenario
        A scene that ships (``quick``), a scenario file, or a scenario.
    out : path, optional
        Run folder to write; without it nothing is written.

    Returns
    -------
    Campaign
        ``trials``, each with its ``measurements`` and ``estimates``; ``tables()`` has errors and
        numbers.
    """
    from testbed.run.play import play_run

    return play_run(scenario_of(scenario), out).campaign


def laboratory(
    scenario: "str | Path | Scenario", changes: Mapping[str, Any] | None = None
) -> "VirtualLaboratory":
    """Open the virtual laboratory of a scenario, for a method of your own; arguments as in `scene`.

    It has a robot whose true geometry is hidden, candidate poses, and a tracker: choose poses,
    ``measure`` them, identify the robot, and ask for the true ``errors`` of the result.

    Examples
    --------
    >>> import calib
    >>> lab = laboratory("quick", {"pool.size": 60, "test.poses": 20})
    >>> seen = lab.measure(range(29), "first 29")
    >>> found = calib.identify(lab.nominal, seen, lab.free)
    >>> lab.mean_error(lab.nominal) > 5 * lab.mean_error(found)
    True
    """
    from truebed.virtual import opened

    return opened(scene(scenario, changes))


def plan(scenario: "str | Path | Scenario", out: str | Path | None = None) -> "Plan":
    """Plan the measurement of a real robot, as ``truebed plan`` does.

    Parameters
    ----------
    scenario : str, Path or Scenario
        A scene that ships (``plan_tx60``), a scenario file, or a scenario.
    out : path, optional
        Folder to write; without it nothing is written.

    Returns
    -------
    Plan
        The chosen poses and the accuracy predicted; ``tables()`` has the stops and the goal.
    """
    from testbed.plan.folder import play_plan
    from testbed.plan.plan import plan

    scene = scenario_of(scenario)
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
        A session.toml, a CSV of measurements, or exported measurements as `load` returns them.
    out : path, optional
        Folder to write; without it nothing is written.

    Returns
    -------
    Calibration
        The fitted models, the one chosen, and the statement of its uncertainty; ``tables()`` has
        errors and numbers.
    """
    from truebed.verbs import identified

    return identified(robot, session, None if out is None else Path(out))


def iso9283(data: str | Path, out: str | Path | None = None) -> "CycleResult":
    """Work out the figures of ISO 9283 of a real robot, as ``truebed iso9283`` does.

    Parameters
    ----------
    data : str or Path
        A table of measured cycles, or a session.toml with [cycles] or [paths].
    out : path, optional
        Folder to write; without it nothing is written.

    Returns
    -------
    CycleResult
        The figures with their limits; ``tables()`` has them.
    """
    from truebed.verbs import cycled

    return cycled(data, None if out is None else Path(out))


def export(campaign: "Campaign", folder: str | Path, *, overwrite: bool = False) -> None:
    """Write the virtual tracker's readings as measurement files, as ``truebed run --export`` does.

    `folder` is new, or one of an earlier export; with `overwrite` anything there is renamed.
    """
    from testbed.run.export import export_campaign

    export_campaign(campaign, robot(campaign.scenario.robot), folder, overwrite=overwrite)


def save(result: object, path: str | Path) -> None:
    """Write one result of `calib` to an .npz file; `load` reads it back, bit for bit.

    The file holds arrays and numbers with a checksum, and nothing pickled.

    Parameters
    ----------
    result : Measurements, RobotModel, CalibratedRobot, Judgement ...
        Result of `calib.points`, `calib.poses`, `calib.calibrate`, `calib.judge`,
        `calib.compensate`, `calib.design`, `bootstrap` or `tool_statement`. Campaigns and
        calibrations are written to folders by the argument ``out`` instead.
    path : path
        File to write, ending in ``.npz``; an existing one is replaced.
    """
    from truebed.saved import keep

    keep(result, Path(text_of("path", path)))


def write_robot(
    robot: "str | Path | Robot",
    found: "RobotModel | CalibratedRobot",
    folder: str | Path,
    *,
    overwrite: bool = False,
) -> tuple[str, ...]:
    """Write a robot with identified numbers as robot.toml, URDF and MJCF, each read back to check.

    Parameters
    ----------
    robot : str, Path or Robot
        The robot as its maker describes it: limits, masses, meshes.
    found : RobotModel or CalibratedRobot
        Its identified model, as `calib.calibrate` returns it. With ``robot.model`` itself the robot
        is written unchanged, under its own name: this turns a URDF into a robot.toml.
    folder : path
        Folder to write into; created if missing.
    overwrite : bool
        Whether files of these names may be replaced.

    Returns
    -------
    tuple of str
        Sentences on how well each file agrees with the model, and on what it cannot hold.
    """
    from truebed.verbs import written

    return written(robot, found, Path(folder), overwrite=overwrite)


def load(folder: str | Path) -> Any:
    """Read back any folder or file that this program wrote; nothing is computed again.

    A campaign or a calibration is returned as `run` or `identify` did; a plan or a test after
    ISO 9283 as the numbers and tables of its files; exported measurements as a session; the folder
    of a robot as a robot; a file of `save` as the result. The kind depends on the folder, so
    annotate it: ``campaign: truebed.Campaign = truebed.load(...)``.

    Parameters
    ----------
    folder : path
        The folder that was given to ``--out``, or the file that was given to `save`.

    Raises
    ------
    InputError
        D42: the path holds nothing that this program wrote.
    """
    from truebed.opened import opened

    return opened(Path(text_of("folder", folder)))
