"""Which keys of a scenario somebody gave, and whether what was filled in still follows from them.

A written scenario has every number in it. Its table [origin] tells the given keys from those that
presets, robot and defaults filled in, and names these; so an edited preset beside the numbers of
another one is seen, and reading gives back the scenario that was written.
"""

import json
from collections.abc import Collection, Mapping
from typing import Any

from testbed.scenario.presets import written
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import Settings, Text
from testbed.strict import KeyPath, Values, flat, nodes, toml_key, toml_value

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
    truth: Text = ""
    """Preset, if one was given."""
    tracker: Text = ""
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
