"""Arguments of the verbs that are given by name: a scene, a robot, a folder."""

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from testbed.scenario.scenario import Scenario


def scenario_of(scenario: "str | Path | Scenario") -> "Scenario":
    """The scenario itself, or the one read from a name or a file."""
    from testbed.scenario.scenario import Scenario
    from testbed.studies import load_scenario

    if isinstance(scenario, Scenario):
        return scenario
    return load_scenario(text_of("scenario", scenario))


def text_of(name: str, value: str | Path) -> str | Path:
    """A checked name or path; an `InputError` (A3) for anything else."""
    from calib.errors import refuse

    if not isinstance(value, str | PathLike):
        message = f"{name} is of the type {type(value).__name__}"
        raise refuse(name, value, "a name or a path", code="A3", message=message)
    return value
