"""Which keys of a scenario somebody gave, and whether what was filled in still follows from them.

A written scenario has every number in it. Its table [origin] tells the given keys from those that
presets, robot and defaults filled in, and names these; so an edited preset beside the numbers of
another one is seen, and reading gives back the scenario that was written.
"""

import json
from collections.abc import Collection, Iterator, Mapping
from typing import Any, Literal

from testbed.faults import Fault, KeyPath, Values, flat, nodes
from testbed.gates.kinds import DESCRIPTIONS
from testbed.names import choice_of, did_you_mean
from testbed.scenario.laboratory import TruthPreset
from testbed.scenario.presets import written
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import Settings, Text
from testbed.toml_text import toml_key, toml_value

ORIGIN = "origin"
ROBOT: KeyPath = ("robot",)
TRUTH: KeyPath = ("truth", "preset")
TRACKER: KeyPath = ("tracker", "preset")
DECIDERS = {"robot": ROBOT, "truth": TRUTH, "tracker": TRACKER}
"""Keys that decide others, by their names in [origin]."""
COMMENT = (
    "# Somebody wrote the keys in `given`; defaults and what is named here filled in the others."
)


class OriginTable(Settings):
    """[origin]: keys that were given, and what filled in the others when the file was written."""

    robot: Text = ""
    """Robot that filled in what the file left open."""
    truth: TruthPreset | None = None
    """Preset, if one was given."""
    tracker: Literal["paper", "at960"] | None = None
    """Preset, if one was given."""
    given: tuple[Text, ...] = ()
    """Keys with their tables: "truth.preset"."""

    def given_in(self, document: Mapping[str, Any]) -> Values:
        """What was given of a document, as far as it is still there."""
        there = {dotted(path): (path, value) for path, value in nodes(document)}
        found = dict(there[name] for name in self.given if name in there)
        return {path: {} if isinstance(v, Mapping) else v for path, v in found.items()}

    def deciders(self, given: Values) -> Values:
        """What decided the other keys when the file was written; what it does not say, as now."""
        then = {path: getattr(self, name) for name, path in DECIDERS.items()}
        return {path: then[path] or given[path] for path in then if then[path] or path in given}


def unknown(origin: OriginTable, keys: Mapping[str, Collection[str]]) -> Iterator[Fault]:
    """Faults of names in [origin] that nothing has; `keys` are those of each table.

    A key may be gone from the file since it was written, but it must belong somewhere.
    """
    from testbed.robots.catalog import robot_names

    name = origin.robot
    if name and not is_path(name) and name not in robot_names():
        message = f'[{ORIGIN}] robot is "{name}", which is not a robot'
        yield Fault((ORIGIN, "robot"), message, fix=choice_of(name, robot_names()), value=name)
    for k, given in enumerate(origin.given):
        table, _, rest = given.partition(".")
        key, known = rest.partition(".")[0], keys.get(table, ())
        if table not in keys[""] or (key and key not in known):
            every = (*keys[""], *(f"{table}.{one}" for one in known))
            fix = did_you_mean(given, every) or "remove it"
            message = f'[{ORIGIN}] given has "{given}", which is not a key of a scenario'
            yield Fault((ORIGIN, "given", k), message, fix=fix, value=given)


def is_path(robot: str) -> bool:
    """Whether a robot is named by a path: it has a separator, or ends as a file of a robot does."""
    return "/" in robot or "\\" in robot or robot.lower().endswith((".toml", *DESCRIPTIONS))


def dotted(path: KeyPath) -> str:
    """A key with its tables, as TOML has it: ``truth.preset``."""
    return ".".join(toml_key(str(part)) for part in path)


def origin_lines(scenario: Scenario) -> list[str]:
    """[origin] of a scenario, as lines of its file."""
    values = flat(written(scenario.given))
    by = {name: values[path] for name, path in DECIDERS.items() if path in values}
    tables: dict[str, list[str]] = {}
    for path, _ in nodes(written(scenario.document())):
        if path in values:
            tables.setdefault(str(path[0]) if path[1:] else "", []).append(dotted(path))
    return [
        "",
        COMMENT,
        f"[{ORIGIN}]",
        *(f"{name} = {toml_value(value)}" for name, value in by.items()),
        "given = [",
        *(f"  {', '.join(map(toml_value, names))}," for names in tables.values()),
        "]",
    ]


def filled_in(values: Values, then: Scenario) -> list[KeyPath]:
    """Keys that are as they were filled in when the file was written."""
    before = flat(written(then.document()))
    return [path for path in values if path in before and same(values[path], before[path])]


def differing(values: Values, paths: Collection[KeyPath], scenario: Scenario) -> list[KeyPath]:
    """Those of some keys that a scenario has not, or with other values."""
    now = flat(written(scenario.document()))
    return [path for path in paths if path not in now or not same(values[path], now[path])]


def same(one: object, other: object) -> bool:
    """Whether two values are written alike: 1 is neither true nor 1.0."""
    return json.dumps(one) == json.dumps(other)
