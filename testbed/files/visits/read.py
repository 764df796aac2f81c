"""Several visits of one robot read and joined: stations and tools numbered through."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Index
from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.measurement.corrections import Corrections
from calib.measurement.observations import joined
from testbed.files.conditions import SetUp
from testbed.files.conditions import joined as joined_conditions
from testbed.files.readings import are_touched
from testbed.files.refusal import refusal
from testbed.files.rows.say import RowsSay
from testbed.files.session import Session, Stated
from testbed.files.session_toml import SessionFile
from testbed.files.sources import Sources
from testbed.files.visits.numbers import Numbered, numbers, renumbered
from testbed.files.visits.shared import Sharing, sharing_of
from testbed.files.visits.tables import CampaignFile, VisitTable
from testbed.files.visits.visit import OWN, RobotVisit
from testbed.units import counted

Reader = Callable[[SessionFile, Sources], Session]


def read_visits(settings: CampaignFile, sources: Sources, read: Reader, *, where: str) -> Session:
    """One session of all visits, the link numbers shared.

    Parameters
    ----------
    settings : CampaignFile
        With one [[session]] or more.
    sources : Sources
        The folder.
    read : callable
        Reads one visit as if it were alone.
    where : str
        The file, for messages.

    Raises
    ------
    InputError
        As `sharing_of` and as `read`; S37, M35: something that only one session can have.
    """
    shared = sharing_of(settings, where)
    _require_free(settings, sources, where)
    visits = [settings.session[k] for k in shared.order]
    alone = []
    for k, visit in zip(shared.order, visits, strict=True):
        own = _with_payload(settings, shared, k, where)
        alone.append(_one(own, visit, sources, read, where))
    owner = {part: [shared.order.index(shared.owner[part][k]) for k in shared.order]
             for part in ("base", "tool")}  # fmt: skip
    return _joined(settings, visits, alone, owner, where)


def _require_free(settings: CampaignFile, sources: Sources, where: str) -> None:
    """Refuse tables above the sessions that only one session can have."""
    for key, given, why in (
        ("start", settings.start is not None, "each session finds its frames from nothing"),
        ("ranges", settings.ranges is not None, "distances belong to a session alone"),
        ("file", sources.data is not None, "each [[session]] names its own file"),
    ):
        if given:
            what = f"[{key}]" if key != "file" else "a CSV is given"
            raise refusal(
                where, key, f"{what} beside [[session]]: {why}", code="S37", fix="take it out"
            )


def _with_payload(settings: CampaignFile, shared: Sharing, k: int, where: str) -> SessionFile:
    """The settings of session k, with the payload of the one whose it has."""
    own = settings.of(settings.session[k])
    owner = shared.owner["payload"][k]
    if owner == k:
        return own
    theirs = settings.of(settings.session[owner]).conditions
    name = settings.session[owner].name
    if theirs.payload_kg is None:
        raise refusal(
            where, "session.payload",
            f'session "{own.name}" has the payload of "{name}", which states none', code="S37",
            fix=f'write payload_kg under [session.conditions] of "{name}"',
        )  # fmt: skip
    same = {key: getattr(theirs, key) for key in ("payload_kg", "payload_center_mm")}
    return own.model_copy(update={"conditions": own.conditions.model_copy(update=same)})


def _one(
    own: SessionFile, visit: VisitTable, sources: Sources, read: Reader, where: str
) -> Session:
    """One visit read as if it were alone; its errors name it where they name only session.toml."""
    here = sources
    if visit.file is not None:
        sources.text(visit.file, "session")  # a file of the folder
        here = replace(sources, data=sources.root / visit.file)
    try:
        found = read(own, here)
    except InputError as error:
        raise error.located(f'{where}: session "{visit.name}"', instead=where) from error
    return found


def _joined(
    settings: CampaignFile,
    visits: Sequence[VisitTable],
    alone: Sequence[Session],
    owner: dict[str, list[int]],
    where: str,
) -> Session:
    """All rows as one session."""
    numbered, station_names, n_tools, reflector_names = numbers(visits, alone, owner)
    _require_one(visits, alone, where)
    first = np.cumsum([0, *(len(one.pose_names) for one in alone)])
    tables = [
        renumbered(one.measurements, number, int(start))
        for one, number, start in zip(alone, numbered, first[:-1], strict=True)
    ]
    counts = [len(table) for table in tables]
    fixtures = Fixtures(
        np.zeros((len(reflector_names), 3)),
        stations=np.tile(np.eye(4), (len(station_names) - 1, 1, 1)),
        tools=np.tile(np.eye(4), (n_tools - 1, 1, 1)),
    )
    held = np.repeat([visit.held_out for visit in visits], counts)
    test = np.concatenate([one.is_test for one in alone]) | held
    dates = tuple(one.set_up.date for one in alone)
    lead = alone[0]
    return replace(
        lead,
        name=settings.name,
        files=tuple(dict.fromkeys(file for one in alone for file in one.files)),
        measurements=joined(tables),
        pose_names=tuple(
            f"{one.name}/{name}" if name else "" for one in alone for name in one.pose_names
        ),
        is_test=test,
        split_stated=bool(held.any()) or any(one.split_stated for one in alone),
        read_back=_stacked([one.read_back for one in alone]),
        time=None,  # each visit begins its clock anew
        order=_order(alone),
        numbered=False,
        conditions=joined_conditions([(one.where, one.conditions) for one in alone]),
        set_up=SetUp(
            use=lead.set_up.use,
            tolerance=lead.set_up.tolerance,
            date=" and ".join(dict.fromkeys(filter(None, dates))),
            stations=tuple(dict.fromkeys(name for one in alone for name in one.set_up.stations)),
            job=lead.set_up.job,
        ),
        approach=None,
        uncertainty="; ".join(dict.fromkeys(one.uncertainty for one in alone)),
        fixtures=fixtures,
        placed=False,
        fixed=(),
        reflector_names=reflector_names,
        station_names=station_names,
        masked=tuple(text for one in alone for text in one.masked),
        drift=max(
            (one.drift for one in alone if one.drift is not None),
            key=lambda drift: float(drift.shift.max()), default=None,
        ),
        corrections=Corrections.stacked([(len(one.place), one.corrections) for one in alone]),
        warnings=tuple(dict.fromkeys(text for one in alone for text in one.warnings)),
        notes=tuple(dict.fromkeys(text for one in alone for text in one.notes)),
        unread=tuple(dict.fromkeys(columns for one in alone for columns in one.unread)),
        stated=Stated(inverted=any(one.stated.inverted for one in alone)),
        rows_say=_rows_say(alone),
        simulated=any(one.simulated for one in alone),
        noise_assumed=any(one.noise_assumed for one in alone),
        place=tuple(place for one in alone for place in one.place),
        visits=_visits(visits, alone, owner, numbered, fixtures),
        visit=np.repeat(np.arange(len(visits)), counts),
        alone=tuple(alone),
    )  # fmt: skip


def _visits(
    visits: Sequence[VisitTable], alone: Sequence[Session], owner: dict[str, list[int]],
    numbered: Sequence[Numbered], fixtures: Fixtures,
) -> tuple[RobotVisit, ...]:  # fmt: skip
    """What is kept of each; the numbers of a frame are of the first session that has it."""
    taken, found = {"station1", "tool1"}, []
    for k, (visit, one, number) in enumerate(zip(visits, alone, numbered, strict=True)):
        frames = {f"station{s + 1}" for s in number.station} | {f"tool{number.mounted + 1}"}
        frames |= {f"reflector{r + 1}" for r in number.reflector}
        own = {name.split(".")[0] for name in fixtures.names} & (frames - taken)
        taken |= own
        whose = {part: owner[part][k] for part in ("base", "tool")}
        found.append(
            RobotVisit(
                name=visit.name,
                base=OWN if whose["base"] == k else visits[whose["base"]].name,
                tool=OWN if whose["tool"] == k else visits[whose["tool"]].name,
                held_out=visit.held_out,
                station=int(number.station[0]),
                mounted=number.mounted,
                numbers=tuple(name for name in fixtures.names if name.split(".")[0] in own),
                frame_poses=visit.frame_poses or 0,
                uncertainty=one.uncertainty,
                conditions=one.conditions.phrase,
                date=one.set_up.date,
            )
        )
    return tuple(found)


def _require_one(visits: Sequence[VisitTable], alone: Sequence[Session], where: str) -> None:
    """Refuse what sessions of one calibration cannot differ in."""
    lead, known = alone[0], dict[bytes, str]()
    # what another station saw of another tool is never the same to the last bit; places that a tip
    # touches are, and not the joints that lead there
    touched = any(are_touched(one.measurements.position) for one in alone)
    for visit, one in zip(visits, alone, strict=True):
        table = one.measurements
        rows = np.hstack([table.position, table.q]) if touched else table.position
        seen = {row.tobytes() for row in rows}
        again = [row for row in seen if row in known]
        if again:
            raise refusal(
                where, "session.file",
                f'session "{visit.name}" has {counted(len(again), "reading")} of session '
                f'"{known[again[0]]}" again', code="M26", fix="name each file once",
            )  # fmt: skip
        known |= dict.fromkeys(seen, visit.name)
        what = ""
        if one.joint_source != lead.joint_source:
            what = f"{one.joint_source} joints, and {visits[0].name} has {lead.joint_source} ones"
        elif one.systematic != lead.systematic:
            what = f"other systematic parts of the instrument than {visits[0].name}"
        elif one.joint_scatter.any() != lead.joint_scatter.any():
            what = f"another joint_repeatability than {visits[0].name}"
        if what:
            raise refusal(
                where, "session", f'session "{visit.name}" has {what}',
                allowed="the same in all sessions of one calibration",
                fix="state it once, above all sessions",
            )  # fmt: skip


def _stacked(columns: Sequence[Array | None]) -> Array | None:
    """A column that all visits have, or None."""
    there = [column for column in columns if column is not None]
    return np.concatenate(there) if len(there) == len(columns) else None


def _rows_say(alone: Sequence[Session]) -> RowsSay:
    """What the rows of all visits say: what one of them leaves unsaid, nothing can follow."""
    said = [one.rows_say for one in alone]
    drives = {one.drive for one in said}
    unsaid = dict(pair for one in said for pair in one.unsaid)
    if len(drives) > 1:
        unsaid["torque"] = "not every session has the same columns of the drives"
    return RowsSay(drives.pop() if len(drives) == 1 else "", tuple(unsaid.items()))


def _order(alone: Sequence[Session]) -> Index:
    """Place of each row in time: visit after visit, each as it says itself."""
    first = np.cumsum([0, *(len(one.measurements) for one in alone)])
    return np.concatenate([k + one.in_time for k, one in zip(first, alone, strict=False)])
