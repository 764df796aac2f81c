"""Numbers that stand beside another preset or robot than the one they were filled in by."""

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from pydantic import ValidationError

from testbed.faults import Fault, KeyPath, flat, nested, place
from testbed.scenario.laboratory import At960Tracker, PaperTracker
from testbed.scenario.origin import DECIDERS, ROBOT, TRACKER, TRUTH, same
from testbed.scenario.presets import TRUTH_PRESETS, resolved, written
from testbed.scenario.scenario import Scenario, StudyTable
from testbed.scenario.tables import Settings
from testbed.toml_text import toml_value
from testbed.units import listed

MOST_NAMED = 7
"""Keys that one sentence names; once these are gone it names the others."""


WRITTEN = (
    "delete {them}, so that the new name fills {them} in; or write {theirs} again; or add "
    "TABLE.KEY of what shall stay to given, at the end. `truebed new scene` writes a short file"
)
"""Ways out for a file that was written in full, with [origin] at its end."""
OLD = (
    "delete {them}, so that the new name fills {them} in; or write {theirs} again; or write "
    '[origin] at the end, and below it given = ["TABLE.KEY"] with what shall stay'
)
"""Ways out for a file that has no [origin]."""
CALLED = "change {them} too, or leave {theirs}"
"""Ways out where no file is edited."""


def filled_scenario(document: Mapping[str, Any], kinds: Mapping[str, type[Settings]]) -> Scenario:
    """The scenario of a document, presets applied, with no check between its tables."""
    clean = dict(document)
    own = {name: clean.pop(name, {}) for name in kinds}
    core = Scenario.model_validate_json(json.dumps(resolved(clean)))
    tables = {name: kind.model_validate_json(json.dumps(own[name])) for name, kind in kinds.items()}
    return core.with_tables({k: v for k, v in tables.items() if isinstance(v, StudyTable)})


def stale(
    paths: Collection[KeyPath], now: Scenario, then: Scenario, fix: str = WRITTEN
) -> Fault | None:
    """The fault of keys that were filled in by another preset or robot; None if both are one."""
    here, before = flat(now.document()), flat(then.document())
    others = [path for path in DECIDERS.values() if here[path] != before[path]]
    beside = [path for path in paths if path not in others]
    if not others or not beside:
        return None
    said = " and ".join(f"{_place([path])} is {toml_value(here[path])}" for path in others)
    theirs = " and ".join(toml_value(before[path]) for path in others)
    it = "it" if len(others) == 1 else "them"
    are, them = ("are those", "them") if beside[1:] else ("is that", "it")
    return Fault(
        others[0],
        f"{said}, but {_place(beside, after=others[-1])} beside {it} {are} of {theirs}",
        fix=fix.format(them=them, theirs=theirs),
        value=here[others[0]],
    )


def _place(paths: Sequence[KeyPath], *, after: KeyPath = ()) -> str:
    """Keys in the words of the file, a table only where another was named before."""
    words = []
    for last, path in pairwise([after, *paths]):
        table = str(path[0])
        key = place(path, {}, (table,) if path[1:] else ())
        words.append(key.removeprefix(f"[{table}] ") if last[1:] and last[0] == table else key)
    return listed(words, MOST_NAMED)


def copies(scenario: Scenario) -> Iterator[tuple[KeyPath, str]]:
    """Other presets and robots whose numbers a file without [origin] may have been written with."""
    from testbed.robots.catalog import robot_names

    yield from ((TRUTH, name) for name in TRUTH_PRESETS if name != scenario.truth.preset)
    if set(scenario.given.get("tracker", ())) != set(type(scenario.tracker).model_fields):
        # its keys were mended by hand: a written one has all that belong to its preset
        presets = [kind.model_fields["preset"].default for kind in (PaperTracker, At960Tracker)]
        yield from ((TRACKER, name) for name in presets if name != scenario.tracker.preset)
    yield from ((ROBOT, name) for name in robot_names() if name != scenario.robot)


def copied(scenario: Scenario, now: Scenario, then: Scenario, of: KeyPath) -> list[KeyPath]:
    """Keys that have the numbers of another preset or robot, if the scenario is mostly its copy.

    `now` and `then` are filled in by what the scenario names and by the other one. Where they
    differ, the scenario has none of the numbers it should have, and most of the other ones.
    """
    own, here, before = (flat(written(s.document())) for s in (scenario, now, then))
    asked = [
        path for path in own
        if path not in DECIDERS.values() and path in here and path in before
        and (of != TRACKER or path[0] != "tracker")
        and not same(here[path], before[path])
    ]  # fmt: skip
    theirs = [path for path in asked if same(own[path], before[path])]
    kept = any(same(own[path], here[path]) for path in asked)
    return [] if kept or 2 * len(theirs) <= len(asked) else theirs


def copied_fault(scenario: Scenario, fix: str) -> Fault | None:
    """The fault of numbers that another preset or robot filled in, without a word of it."""
    given, found = scenario.given, None
    plain = {key: given[key] for key in ("format", "name", "robot", "trial") if key in given}
    named = {"truth": scenario.truth.preset, "tracker": scenario.tracker.preset}
    for path, other in copies(scenario):
        presets = {name: {"preset": preset} for name, preset in named.items()}
        try:
            now = filled_scenario(plain | presets, {})
            then = filled_scenario(nested(flat(plain | presets) | {path: other}), {})
        except ValidationError:
            continue  # a preset that this robot cannot have
        theirs = copied(scenario, now, then, path)
        if theirs and (found is None or len(theirs) > len(found[0])):
            found = theirs, now, then
    return stale(*found, fix) if found else None
