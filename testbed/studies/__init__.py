"""The register of studies: names only; a study is imported when it is used.

Studies of other distributions join through the entry-point group `truebed.studies`; the name of the
entry is the name of its table, and it is loaded only if a scenario has such a table.
"""

from collections.abc import Collection, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.errors import refuse

if TYPE_CHECKING:
    from testbed.scenario.scenario import Scenario, StudyTable
    from testbed.studies.protocol import Study

SHIPPED = ("trial", "pose_sets", "coverage", "wen2022", "compensation")
"""In the order of their records; the last one with an answer provides the first screen."""
GROUP = "truebed.studies"


@cache
def study_named(name: str) -> "Study":
    """The study `name`: a shipped one, or one of another distribution.

    Raises
    ------
    InputError
        No distribution provides it, several do, or what they provide is not a study.
    """
    from testbed.studies.protocol import Study

    if name in SHIPPED:
        study: Study = import_module(f"testbed.studies.{name}.study").STUDY
        return study
    found = [entry for entry in _entries() if entry.name == name]
    if len(found) != 1:
        brought = ", ".join(_distribution(entry) for entry in found) or "none"
        raise refuse(
            "study", name, "exactly one distribution brings a study", code="C41",
            message=f'the study "{name}" is brought by {brought}', fix="uninstall all but one",
        )  # fmt: skip
    study = found[0].load()
    if not isinstance(study, Study):
        raise refuse(
            "study", name, "an object with the members of testbed.studies.protocol.Study",
            code="C41", message=f'what {_distribution(found[0])} brings as "{name}" is no study',
        )  # fmt: skip
    return study


def all_studies(scenario: "Scenario") -> tuple["Study", ...]:
    """The shipped studies, and those of other distributions whose tables the scenario has."""
    others = tuple(name for name in scenario.tables if name not in _shipped_tables())
    return tuple(study_named(name) for name in (*SHIPPED, *others))


def declared_tables(keys: Collection[str]) -> dict[str, "type[StudyTable]"]:
    """The tables of shipped studies, and those among `keys` from other distributions."""
    from testbed.scenario.scenario import Scenario

    tables = dict(_shipped_tables())
    others = [key for key in keys if key not in tables and key not in Scenario.model_fields]
    brought = {entry.name for entry in _entries()} if others else ()
    for key in others:
        if key in brought:
            settings = study_named(key).settings
            if settings is not None:
                tables[key] = settings
    return tables


def load_scenario(name_or_path: str | Path, *, finished: bool = False) -> "Scenario":
    """A scenario from a shipped scene's name, a file, or a run folder.

    With `finished` it is that of a finished run, guarded by its hash: its numbers are used
    unchanged, whatever preset is named beside them.

    Raises
    ------
    InputError
        All faults of the file at once (up to 20), each with table, key, value and likely fix.
    """
    from testbed.scenario import read

    return read.load_scenario(name_or_path, declared_tables, finished=finished)


def parse_scenario(data: bytes | str, *, where: str, folder: Path | None = None) -> "Scenario":
    """A scenario from the content of a file; relative robot paths start from `folder`."""
    from testbed.scenario import read

    return read.parse_scenario(data, declared_tables, where=where, folder=folder)


def scenario_of(document: Mapping[str, Any], *, where: str = "scenario") -> "Scenario":
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
    from testbed.scenario import read

    return read.scenario_of(document, declared_tables, where=where)


@cache
def _shipped_tables() -> dict[str, "type[StudyTable]"]:
    """The tables of the shipped studies, from their settings alone."""
    kinds = (import_module(f"testbed.studies.{name}.settings").TABLE for name in WITH_TABLE)
    return {kind.table: kind for kind in kinds}


WITH_TABLE = ("coverage", "wen2022", "compensation")
"""Shipped studies with a table of their own, in the order of a written scenario."""


def _entries() -> list[EntryPoint]:
    """Entry points of installed distributions."""
    return list(entry_points(group=GROUP))


def _distribution(entry: EntryPoint) -> str:
    """Distribution of an entry."""
    return entry.dist.name if entry.dist else entry.value
