"""[fixtures]: what its targets and rounds are, and what it may not say beside other tables."""

import math
import re
from collections.abc import Iterator, Mapping
from itertools import combinations

from testbed.names import did_you_mean
from testbed.scenario.laboratory import At960Tracker, FixtureSettings
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import Point
from testbed.units import counted

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")
"""What reflectors and anchors may be called: their names stand in files."""
ALONE = {"pose": "tool", "point": "reflector"}
"""What the one target of [tracker] is called among several."""
APART_MM = 100.0
"""Stations stand at least so far apart: a tracker is wider, and directions hardly change."""
SAME_MM = 1.0
"""Reflectors and anchors nearer than this are at one place: none is as small."""
RANGES = "-ranges"
"""What the file of a trial's distances adds to its name in an export."""


def targets_mm(scenario: Scenario) -> dict[str, Point]:
    """Every target on the tool by name, in the tool frame; the first one is judged."""
    tracker, fixtures = scenario.tracker, scenario.fixtures
    if fixtures is None or not fixtures.reflectors_mm:
        return {ALONE[tracker.measures]: tracker.reflector_mm}
    return dict(fixtures.reflectors_mm)


def ranged_targets(scenario: Scenario) -> tuple[str, ...]:
    """Targets whose distance from every anchor is measured; none without anchors."""
    fixtures = scenario.fixtures
    if fixtures is None or not fixtures.anchors_mm:
        return ()
    return fixtures.ranged or tuple(targets_mm(scenario))[:1]


def rounds_per_visit(scenario: Scenario) -> int:
    """How often the program runs until every target was measured from every place."""
    fixtures = scenario.fixtures
    if fixtures is None:
        return 1
    optical = len(targets_mm(scenario)) if scenario.tracker.measures == "point" else 1
    ranged = len(ranged_targets(scenario)) * len(fixtures.anchors_mm)
    return optical * (1 + len(fixtures.stations_mm)) + ranged


def fixture_contradictions(scenario: Scenario, fixtures: FixtureSettings) -> Iterator[str]:
    """What [fixtures] may not say, alone or beside the other tables."""
    if not (fixtures.reflectors_mm or fixtures.stations_mm or fixtures.anchors_mm):
        yield (
            "[fixtures] has no reflectors_mm, stations_mm or anchors_mm; give one of them, or "
            "remove the table"
        )
        return
    yield from _of_names(
        fixtures, targets_mm(scenario), points=scenario.tracker.measures == "point"
    )
    yield from _of_places(fixtures, scenario.tracker.station_mm)
    yield from _of_the_tracker(scenario, fixtures)
    yield from _of_estimators_and_studies(scenario)
    trials = [trial.name for trial in scenario.trial]
    for name in trials if fixtures.anchors_mm else ():
        if f"{name}{RANGES}" in trials:
            yield (
                f'[[trial]] "{name}{RANGES}" is what the distances of "{name}" are called in an '
                "export; rename it"
            )


def _of_names(
    fixtures: FixtureSettings, targets: Mapping[str, Point], *, points: bool
) -> Iterator[str]:
    """Names that cannot stand in files, that are used twice, or that nothing has."""
    places = (("reflectors_mm", fixtures.reflectors_mm), ("anchors_mm", fixtures.anchors_mm))
    for key, own in places:
        for name in own:
            if not NAME.fullmatch(name):
                yield (
                    f'[fixtures] {key} has "{name}"; a name has up to 32 letters, digits, "_", '
                    '"." or "-", the first a letter or digit; rename it'
                )
    for name in fixtures.anchors_mm:
        if name in targets:
            yield f'[fixtures] "{name}" is a reflector and an anchor; rename one of them'
    first = next(iter(targets))
    known = tuple(dict.fromkeys((*targets, *fixtures.anchors_mm)))
    for name in fixtures.free:
        if name not in known:
            hint = did_you_mean(name, known) or f"known are {', '.join(known)}"
            yield f'[fixtures] free has "{name}", which is no reflector and no anchor; {hint}'
        elif name == first and points:
            yield (
                f'[fixtures] free has "{name}", the first reflector: it says where the tool is; '
                "remove it, or write another one first"
            )
    if fixtures.ranged and not fixtures.anchors_mm:
        yield "[fixtures] ranged is set, but there are no anchors_mm; give them or remove ranged"
    for name in fixtures.ranged:
        if name not in targets:
            hint = did_you_mean(name, tuple(targets)) or f"known are {', '.join(targets)}"
            yield f'[fixtures] ranged has "{name}", which is not a reflector; {hint}'
    for key, names in (("free", fixtures.free), ("ranged", fixtures.ranged)):
        if len(set(names)) < len(names):
            yield f"[fixtures] {key} contains a name twice; remove the copy"


def _of_places(fixtures: FixtureSettings, station: Point) -> Iterator[str]:
    """Two of a kind at one place, of which the second tells nothing new."""
    for kind, places in (("reflectors", fixtures.reflectors_mm), ("anchors", fixtures.anchors_mm)):
        for (one, at), (other, same) in combinations(places.items(), 2):
            if math.dist(at, same) < SAME_MM:
                yield (
                    f'[fixtures] the {kind} "{one}" and "{other}" are at one place; move or remove '
                    "one of them"
                )
    stations = enumerate((station, *fixtures.stations_mm), 1)
    for (k, at), (later, beside) in combinations(stations, 2):
        if math.dist(at, beside) < APART_MM:
            which = "that of [tracker]" if k == 1 else f"entry {k - 1}"
            yield (
                f"[fixtures] stations_mm entry {later - 1} is {math.dist(at, beside):.3g} mm from "
                f"{which}; a tracker sees nothing new from less than {APART_MM:g} mm beside; move "
                "or remove it"
            )


def _of_the_tracker(scenario: Scenario, fixtures: FixtureSettings) -> Iterator[str]:
    """Contradictions with what the tracker measures."""
    tracker = scenario.tracker
    if fixtures.reflectors_mm and any(tracker.reflector_mm):
        yield (
            "[tracker] reflector_mm and [fixtures] reflectors_mm both say where the reflector is; "
            "remove reflector_mm"
        )
    if fixtures.reflectors_mm and tracker.measures == "pose":
        used = (*ranged_targets(scenario),)
        for name in fixtures.reflectors_mm:
            if name not in used:
                yield (
                    f'[fixtures] nothing measures the reflector "{name}": [tracker] measures is '
                    '"pose", and no distance is ranged to it; remove it, or write measures = '
                    '"point"'
                )
    if isinstance(tracker, At960Tracker) and tracker.systematic:
        yield (
            "[tracker] systematic is true, which is about one station and one target; remove "
            "[fixtures], or write systematic = false"
        )


def _of_estimators_and_studies(scenario: Scenario) -> Iterator[str]:
    """Contradictions with estimators and studies that know one target from one station."""
    if scenario.tracker.measures == "pose":  # else it is told that they cannot have points
        yield from _of_full_poses(scenario)
    if population := scenario.studies.population:
        yield (
            f"[studies] population is {counted(population, 'robot')}, each seen from one "
            "station; remove [fixtures], or write population = 0"
        )


def _of_full_poses(scenario: Scenario) -> Iterator[str]:
    """Contradictions with what needs full poses from one station."""
    if "paper" in scenario.identification.estimators:
        yield (
            '[identification] estimators has "paper", which needs full poses from one station; '
            'remove [fixtures], or write estimators = ["whitened"]'
        )
    for trial in scenario.trial:
        if trial.rows == "paper":
            yield (
                f'[[trial]] "{trial.name}" rows is "paper", which needs full poses from one '
                'station; remove [fixtures], or write rows = "whitened"'
            )
    if scenario.studies.tool_point:
        yield (
            "[studies] tool_point needs full poses from one station; remove [fixtures], or write "
            "tool_point = false"
        )
