"""Whether sessions that identify share the base and the tool that they are said to share."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from operator import itemgetter

import numpy as np

from calib.arrays import Bool, Index
from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import inverse, log_so3
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Identification, identify
from calib.identification.start.start import start_frames
from calib.measurement.observations import GIVEN, Measurements
from testbed.files.refusal import refusal
from testbed.files.session import Session
from testbed.files.visits.visit import OWN
from testbed.identify.frames import is_frame
from testbed.units import DEG, millimetres, significant

TIMES = 5.0
"""Frames are not shared if residuals are so many times smaller with frames of their own."""
BASE, TOOL = "base", "tool"


def require_shared(
    session: Session, nominal: RobotModel, train: Measurements, visit: Index, plain: Identification
) -> None:
    """Refuse sessions that do not have the base or tool of another, though the file says so.

    Asked only where all sessions together leave more than `TIMES` the noise. Then each session is
    fitted together with the one whose frames it has, once as stated and once with frames of its
    own, the links free in both.

    Parameters
    ----------
    session : Session
        Of one visit or of several.
    nominal : RobotModel
        Nominal links.
    train : Measurements
        Rows (m,) to identify from.
    visit : (m,) array
        Which visit each is of.
    plain : Identification
        Of all of them, as the file states the frames.

    Raises
    ------
    InputError
        M35: names the session, the part and how far it is off.
    """
    if len(np.unique(visit)) < 2 or plain.dof <= 0 or _size(plain) <= TIMES:
        return
    links = {name for name in plain.names if not is_frame(name)}
    for first, k, parts in _pairs(session, np.unique(visit)):
        some = np.isin(visit, (first, k))
        rows, its = train.rows(some), visit[some] == k
        stated = _fitted(nominal, rows, links)
        if stated is None or _size(stated) <= TIMES:
            continue
        several = dict.fromkeys([*((part,) for part in parts), parts])
        freed = [(tried, _fitted(nominal, _parted(rows, its, tried), links)) for tried in several]
        fits = [(len(tried), _size(fit), tried, fit) for tried, fit in freed if fit is not None]
        least = max(1.0, min((size for _, size, *_ in fits), default=np.inf))
        if _size(stated) <= TIMES * least:
            continue
        # one part, if it alone explains about as much as both
        _, _, off, found = min(
            (fit for fit in fits if fit[1] <= TIMES * least), key=itemgetter(0, 1)
        )
        far = " and ".join(filter(None, (_far(found.model, rows, its, part) for part in off)))
        one, other = session.visits[k].name, session.visits[first].name
        said = f'session "{one}" does not share the {" and the ".join(off)} of "{other}"'
        raise refusal(
            session.stated_in, f"session.{off[0]}", f"{said} ({far})" if far else said, code="M35",
            fix="write " + " and ".join(f'{part} = "free"' for part in off) + f' in "{one}"',
        )  # fmt: skip


def _pairs(session: Session, there: Index) -> Iterator[tuple[int, int, tuple[str, ...]]]:
    """Each visit after the first one with a base or tool that it shares, and what both share."""

    def whose(k: int, part: str) -> str:
        stated: str = getattr(session.visits[k], part)
        return session.visits[k].name if stated == OWN else stated

    known: dict[tuple[str, str], int] = {}
    for k in map(int, there):
        own = {part: (part, whose(k, part)) for part in (BASE, TOOL)}
        for first in sorted({known[key] for key in own.values() if key in known}):
            yield first, k, tuple(p for p in own if whose(first, p) == whose(k, p))
        for key in own.values():
            known.setdefault(key, k)


def _fitted(nominal: RobotModel, rows: Measurements, links: set[str]) -> Identification | None:
    """Links and all frames of some rows; None where they are too few."""
    table = replace(
        rows,
        station=_numbered(rows.station),
        tool=_numbered(rows.tool),
        reflector=_numbered(rows.reflector),
    )
    further = [int(column.max()) for column in (table.station, table.tool)]
    fixtures = Fixtures(
        np.zeros((int(table.reflector.max()) + 1, 3)),
        stations=np.tile(np.eye(4), (further[0], 1, 1)),
        tools=np.tile(np.eye(4), (further[1], 1, 1)),
    )
    try:
        start = start_frames(replace(nominal, fixtures=fixtures), table).model
        numbers = parameters_of(start)
        free = [name for name in numbers.names if is_frame(name) or name in links]
        found = identify(start, table, numbers.freeing(free))
    except InputError:
        return None
    return found if found.dof > 0 else None


def _numbered(column: Index) -> Index:
    """The same numbers without gaps, from 0; what is `GIVEN` stays so."""
    there = np.unique(column[column != GIVEN])
    return np.where(column == GIVEN, GIVEN, np.searchsorted(there, column))


def _parted(rows: Measurements, its: Bool, parts: Iterable[str]) -> Measurements:
    """The table whose rows of one visit are seen from stations, or by tools, of their own."""
    for part in parts:
        columns = ("station",) if part == BASE else ("tool", "reflector")
        for name in columns:
            column = getattr(rows, name)
            further = column + column.max() + 1
            moved = np.where(its & (column != GIVEN), further, column)
            rows = replace(rows, **{name: moved})
    return rows


def _size(found: Identification) -> float:
    """Residuals over noise."""
    return float(np.sqrt(found.chi_square / found.dof))


def _far(model: RobotModel, rows: Measurements, its: Bool, part: str) -> str:
    """How far base or tool of one visit stands from that of the other, in words."""
    if part == TOOL and not all((rows.reflector[some] == GIVEN).any() for some in (its, ~its)):
        return ""  # reflectors of unknown place stand for a tool that nothing shows
    name = "station" if part == BASE else "tool"
    column = getattr(rows, name)
    stated = _numbered(column)
    parted = _numbered(getattr(_parted(rows, its, (part,)), name))
    both = np.flatnonzero(its)[0]
    there = parted[np.flatnonzero(~its & (stated == stated[both]))[0]]
    chain, fixtures = model.chain, model.fixtures
    if part == BASE:
        world = np.concatenate([np.eye(4)[None], fixtures.stations])
        frames = inverse(world) @ chain.T_world_base
    else:
        frames = np.concatenate([chain.T_flange_tool[None], fixtures.tools])
    apart = inverse(frames[there]) @ frames[parted[both]]
    length = f"{millimetres(float(np.linalg.norm(apart[:3, 3])))} mm"
    if part == TOOL and not rows.is_pose.any():
        return length
    angle = float(np.linalg.norm(log_so3(apart[:3, :3])))
    return f"{length}, {significant(angle * DEG)} deg"
