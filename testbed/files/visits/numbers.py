"""Stations, tools and reflectors of several visits, numbered through."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Index
from calib.measurement.observations import GIVEN, Measurements
from testbed.files.session import Session
from testbed.files.visits.tables import VisitTable


@dataclass(frozen=True, slots=True, eq=False)
class Numbered:
    """Where the stations, the tool and the reflectors of one visit stand among all."""

    station: Index
    """Number of each of its stations."""
    mounted: int
    reflector: Index
    """Number of each of its reflectors."""


def numbers(
    visits: Sequence[VisitTable], alone: Sequence[Session], owner: dict[str, list[int]]
) -> tuple[list[Numbered], tuple[str, ...], int, tuple[str, ...]]:
    """Numbers of every visit's stations, tool and reflectors; their names, and how many tools."""
    stations: list[str] = []
    at: dict[tuple[int, str], int] = {}
    tools: dict[int, int] = {}
    reflectors: dict[tuple[int, str], int] = {}
    found = []
    for k, (visit, one) in enumerate(zip(visits, alone, strict=True)):
        base, tool = owner["base"][k], owner["tool"][k]
        own = []
        for j, name in enumerate(one.station_names):
            # the first station of a session is where its base says
            key = (base, "" if j == 0 else name)
            if key not in at:
                at[key] = len(stations)
                stations.append(visit.name if j == 0 else f"{visit.name}/{name}")
            own.append(at[key])
        named = []
        for name in one.reflector_names:
            if (tool, name) not in reflectors:
                reflectors[tool, name] = len(reflectors)
            named.append(reflectors[tool, name])
        mounted = 0
        # a tool of which only reflectors of unknown place were seen is where they place it
        if not k or (one.measurements.reflector == GIVEN).any():
            mounted = tools.setdefault(tool, len(tools))
        found.append(Numbered(np.array(own), mounted, np.array(named, dtype=np.int64)))
    names = tuple(f"{visits[tool].name}/{name}" for tool, name in reflectors)
    return found, tuple(stations), len(tools), names


def renumbered(table: Measurements, number: Numbered, first: int) -> Measurements:
    """The rows of one visit among those of all."""
    reflector = table.reflector
    if len(number.reflector):
        reflector = np.where(reflector == GIVEN, GIVEN, number.reflector[reflector])
    return replace(
        table,
        pose_id=table.pose_id + first,
        station=number.station[table.station],
        reflector=reflector,
        tool=np.full(len(table), number.mounted),
    )
