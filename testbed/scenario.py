"""The scenario file: read strictly, written with every default, and hashed."""

import json
import tomllib
from collections.abc import Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from calib.errors import InputError
from testbed.assets import scene_names, scenes
from testbed.mistakes import Fault, did_you_mean, foreign_values, one_error
from testbed.settings import FORMAT as FORMAT
from testbed.settings import RESERVED as RESERVED
from testbed.settings import STUDY_KEYS as STUDY_KEYS
from testbed.settings import At960Tracker as At960Tracker
from testbed.settings import PaperTracker as PaperTracker
from testbed.settings import PoolSettings as PoolSettings
from testbed.settings import Scenario as Scenario
from testbed.settings import TrialSettings as TrialSettings
from testbed.settings import TruthSettings as TruthSettings
from testbed.settings import resolved
from testbed.wording import TABLES, sentences

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

MAX_BYTES = 1_000_000
PAPER_SET = "wen2022"
"""Free set that the "paper" estimator identifies."""
SETTING_TABLES = ("format", "seed", "truth", "tracker", "pool", "test")


def scenario_path(name_or_path: str | Path) -> tuple[Path, str]:
    """File of a shipped scene or of a path, and how messages call it."""
    text = str(name_or_path)
    if text in scene_names():
        return scenes() / f"{text}.toml", f"scenes/{text}.toml"
    path = Path(text)
    try:
        is_file, is_folder = path.is_file(), path.is_dir()
    except (OSError, ValueError):
        is_file = is_folder = False
    if is_folder and (path / "scenario.toml").is_file():
        return path / "scenario.toml", str(path / "scenario.toml")
    if not is_file:
        names = ", ".join(scene_names())
        raise InputError(
            f'there is no scene or file "{text}"',
            code="S37",
            field="SCENE",
            value=text,
            allowed=f"scenes that ship: {names}" if names else "no scenes ship with this copy",
            fix=did_you_mean(text, scene_names()) or "give a scene name or the path of a .toml",
        )
    return path, text


def load_scenario(name_or_path: str | Path) -> Scenario:
    """A scenario from a shipped scene's name, a file, or a run folder.

    Raises
    ------
    InputError
        All faults of the file at once (up to 20), each with table, key, value and likely fix.
    """
    path, where = scenario_path(name_or_path)
    try:
        size = path.stat().st_size
        data = path.read_bytes() if size <= MAX_BYTES else b""
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", code="S38", where=where) from error
    if size > MAX_BYTES:
        raise InputError(
            f"is {size / 1e6:.1f} MB",
            code="S38",
            where=where,
            value=size,
            allowed="a scenario has at most 1 MB",
            fix="give a scenario file",
        )
    return parse_scenario(data, where=where, folder=path.parent)


def parse_scenario(data: bytes | str, *, where: str, folder: Path | None = None) -> Scenario:
    """A scenario from the content of a file; `folder` is what a relative robot path starts from."""
    try:
        text = data if isinstance(data, str) else data.decode("utf-8-sig")
        document = tomllib.loads(text.removeprefix("\ufeff"))
    except UnicodeDecodeError as error:
        raise InputError(
            f"byte {error.start} is not UTF-8",
            code="S38",
            where=where,
            allowed="a scenario is UTF-8 text",
            fix="save the file as UTF-8",
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"is not TOML: {error}",
            code="S38",
            where=where,
            fix="mend that line; strings need quotes, numbers and true/false do not",
        ) from error
    except (RecursionError, ValueError) as error:
        # tomllib recurses once per bracket; int() refuses numbers of thousands of digits
        raise InputError(
            "is nested too deeply or holds an endless number",
            code="S38",
            where=where,
            fix="a scenario has tables one level deep and ordinary numbers",
        ) from error
    robot = document.get("robot")
    if folder is not None and isinstance(robot, str) and _is_path(robot):
        document["robot"] = str((folder / robot).resolve())
    return scenario_of(document, where=where)


def _is_path(robot: str) -> bool:
    """Whether a robot is named by a path: it has a separator or ends in .toml."""
    return "/" in robot or "\\" in robot or robot.endswith(".toml")


def scenario_of(document: Mapping[str, Any], *, where: str = "scenario") -> Scenario:
    """A scenario from nested mappings, as a TOML reader gives them; presets are applied.

    Examples
    --------
    >>> scenario = scenario_of(
    ...     {
    ...         "format": 1,
    ...         "name": "small",
    ...         "robot": "staubli_tx60",
    ...         "trial": [{"name": "random-20", "poses": 20, "method": "random"}],
    ...     }
    ... )
    >>> scenario.truth.gravity_mdeg
    (10.0, 6.0, 8.0)
    """
    version = document.get("format")
    if isinstance(version, int) and not isinstance(version, bool) and version > FORMAT:
        raise InputError(
            f"has format {version}",
            code="D42",
            where=where,
            field="format",
            value=version,
            allowed=f"this version reads format {FORMAT}",
            fix="install a newer truebed",
        )
    faults, clean = foreign_values(document, TABLES)
    try:
        scenario = Scenario.model_validate_json(json.dumps(resolved(clean)))
    except ValidationError as error:
        faults += sentences(error, document, skip={fault.path for fault in faults})
        raise one_error(faults, where) from None
    if faults:
        raise one_error(faults, where)
    return scenario


def changed(scenario: Scenario, changes: Mapping[str, Any], *, where: str = "") -> Scenario:
    """The scenario with some keys changed, checked again: ``{"tracker.position_um": 5.0}``."""
    document = scenario.model_dump(mode="json")
    for dotted, value in changes.items():
        *tables, key = dotted.split(".")
        table = document
        for name in tables:
            table = table.setdefault(name, {})
        table[key] = value
    return scenario_of(document, where=where or scenario.name)


def dump_scenario(scenario: Scenario) -> str:
    """The scenario as TOML text, every default written out; reading it back gives an equal one."""
    document = scenario.model_dump(mode="json")
    trials = document.pop("trial")
    if document["truth"]["joint_repeatability_mdeg"] is None:
        document["truth"]["joint_repeatability_mdeg"] = "robot"
    lines = [f"{k} = {_toml(v)}" for k, v in document.items() if not isinstance(v, dict)]
    for name, table in document.items():
        if isinstance(table, dict):
            lines += ["", f"[{name}]", *(f"{k} = {_toml(v)}" for k, v in table.items())]
    for trial in trials:
        lines += ["", "[[trial]]", *(f"{k} = {_toml(v)}" for k, v in trial.items())]
    return "\n".join(lines) + "\n"


def _toml(value: object) -> str:
    """One value as TOML; the strings and numbers of JSON are also TOML's."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def canonical(value: object) -> bytes:
    """Canonical JSON bytes: sorted keys, shortest round-trip floats, no nan."""
    text = json.dumps(
        value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    )
    return text.encode()


def scenario_hash(scenario: Scenario, robot: "Robot") -> str:
    """Hex sha256 of everything that decides a campaign: resolved scenario and robot files."""
    document = scenario.model_dump(mode="json") | {"robot": robot_hash(robot)}
    return sha256(canonical(document)).hexdigest()


def record_hash(scenario: Scenario, robot: "Robot", key: str) -> str:
    """Hex sha256 of what one record depends on.

    The setting does not depend on trials; a trial depends on no other trial and on no study, so
    adding one leaves its file byte-identical; a study depends on everything but names and titles.
    """
    document = scenario.model_dump(mode="json")
    kept: dict[str, Any] = {name: document[name] for name in SETTING_TABLES}
    if key in STUDY_KEYS:
        kept |= {
            name: document[name] for name in ("identification", "uncertainty", "studies", "trial")
        }
    elif key != "setting":
        kept |= {name: document[name] for name in ("identification", "uncertainty")}
        kept["trial"] = next(trial for trial in document["trial"] if trial["name"] == key)
    kept |= {"robot": robot_hash(robot), "key": key}
    return sha256(canonical(kept)).hexdigest()


@lru_cache(maxsize=4)
def robot_hash(robot: "Robot") -> str:
    """Hex sha256 of a robot's numbers and meshes, with no path of this machine in it."""
    chain = robot.model.chain
    numbers = (
        chain.links,
        chain.T_world_base,
        chain.T_flange_tool,
        robot.limits,
        robot.speeds,
        robot.masses,
        robot.centers,
        robot.inertias,
        robot.repeatability,
    )
    document = {
        "name": robot.name,
        "kinds": chain.kinds,
        "numbers": [array.tolist() for array in numbers],
        "floor": robot.base_offset,
        "exclusions": robot.exclusions,
        "free_sets": dict(robot.free_sets),
        "parts": [
            [v.name, v.link, v.collides, sha256(v.file.read_bytes()).hexdigest()]
            for v in robot.visuals
        ],
    }
    return sha256(canonical(document)).hexdigest()


def check_robot(scenario: Scenario, robot: "Robot", *, where: str) -> None:
    """Raise one InputError if the scenario names parameters or sets the robot does not have."""
    names = robot.model.names
    faults = []
    for table, key, value, word in (
        ("truth", "perturb", scenario.truth.perturb, "links"),
        ("identification", "free", scenario.identification.free, "identifiable"),
    ):
        known = (word, *robot.free_sets) if isinstance(value, str) else names
        for name in [value] if isinstance(value, str) else value:
            if name not in known:
                fault = Fault(
                    (table, key),
                    f'[{table}] {key} has "{name}", which {robot.name} does not know',
                    allowed=f"known are {', '.join(known)}" if isinstance(value, str) else "",
                    fix=did_you_mean(name, known) or f"see `truebed robots {robot.name}`",
                    value=name,
                )
                faults.append(fault)
    if "paper" in scenario.identification.estimators and PAPER_SET not in robot.free_sets:
        fault = Fault(
            ("identification", "estimators"),
            f'[identification] estimators has "paper", but {robot.name} has no free set '
            f'"{PAPER_SET}"',
            fix='write estimators = ["whitened"]',
            value="paper",
        )
        faults.append(fault)
    if faults:
        raise one_error(faults, where)
