"""A measuring session from its files: read, cleaned, matched, with every assumption stated."""

from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.errors import InputError, refuse
from testbed.files.assembly import assemble
from testbed.files.cleaned import readings_of
from testbed.files.reflectors.own_files import require_as_stated
from testbed.files.refusal import refusal
from testbed.files.rows.strays import mismatched_rows
from testbed.files.rows.with_joints import with_joints
from testbed.files.session import Session
from testbed.files.session_toml import FREE, SessionFile
from testbed.files.slips import raise_if_slipped
from testbed.files.sources import Sources, given, session_file
from testbed.files.tried.beyond_limits import explained
from testbed.files.uncertainty import require_shown
from testbed.files.visits.read import read_visits
from testbed.files.visits.tables import CampaignFile
from testbed.gates.paths import is_there
from testbed.gates.text import MAX_MB
from testbed.robots.file_frames import flange_of_points
from testbed.robots.robot import Robot
from testbed.robots.tolerances import tolerances_of, usual_tolerances
from testbed.scenario.tool_in_use import ToolInUse

MOST_STRAYS = 0.5
"""Share of held-out rows, or of the others, above which they stray because of their frame."""
LARGEST_MB = 100_000.0
"""What a user may allow."""
MISMATCHED = ": left out: "
"""Between the place of a row that does not belong to its joints and the reason."""


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the user may allow."""

    drop_invalid: bool = False
    """Leave out rows that are no numbers and joints without readings, instead of refusing."""
    max_mb: float = MAX_MB
    """Largest file that is read [MB]."""

    def __post_init__(self) -> None:
        """Refuse a size that no file has, nan among them."""
        if not 0.0 < self.max_mb <= LARGEST_MB:
            allowed = f"it must be above 0 and at most {LARGEST_MB:g} MB"
            fix = "give the size of the file in MB"
            raise refuse("--max-mb", self.max_mb, allowed, code="C41", fix=fix)


def read_session(
    data: str | Path,
    robot: Robot,
    *,
    config: str | Path | None = None,
    options: ReadOptions | None = None,
    alone: bool = False,
) -> Session:
    """Read a measuring session.

    Parameters
    ----------
    data : path
        A CSV, or a session.toml (or its folder) that names the files.
    robot : Robot
        Whose joints these are; its limits distinguish degrees from radians.
    config : path, optional
        A session.toml on how to read a CSV: column names, units, conventions.
    options : ReadOptions, optional
        What is allowed.
    alone : bool
        Whether `data` holds joints and readings, whatever files `config` names.

    Raises
    ------
    InputError
        Names the file, the line, the thing, what was allowed and the likely fix.
    """
    options = ReadOptions() if options is None else options
    source = given(data, config, options.max_mb, field="measurements")
    settings = source.settings.of_one_table if alone else source.settings
    where, drop = str(source.toml), options.drop_invalid
    session = whole_session(settings, source.sources, robot, drop=drop, where=where)
    source.sources.require_data_read(where)
    files = (*source.read, *session.files)
    return replace(session, name=session.name or source.file.stem, files=files)


def whole_session(
    settings: SessionFile, sources: Sources, robot: Robot, *, drop: bool, where: str
) -> Session:
    """The session that a session.toml describes, or all of its sessions as one.

    Rows that belong to no joints are left out, and named.

    Raises
    ------
    InputError
        As `read_session`.
    """

    def one(own: SessionFile, here: Sources) -> Session:
        """A session by itself."""

        def read(arm: Robot) -> Session:
            return session_of(own, here, arm, drop=drop, where=where)

        try:
            session = read(robot)
        except InputError as error:
            raise explained(error, robot, read) from error
        return without_strays(robot, session)

    if isinstance(settings, CampaignFile) and settings.session:
        return read_visits(settings, sources, one, where=where)
    return one(settings, sources)


def session_of(
    settings: SessionFile, sources: Sources, robot: Robot, *, drop: bool, where: str
) -> Session:
    """The session that a session.toml describes, `where` in messages, with all its rows.

    Raises
    ------
    InputError
        As `read_session`, but for rows that belong to other joints.
    """
    require_free_set(settings.identification.free, robot, where)
    cleaned = list(readings_of(sources, settings, drop=drop))
    joined = []
    for one in cleaned:
        others = [other for other in cleaned if other is not one]
        joined.append(with_joints(one, sources, settings, robot, others, drop=drop))
    parts = [part for part, _ in joined]
    session = assemble(parts, robot, settings, where=where)
    if settings.points is not None:
        require_as_stated(session, parts, settings.points, robot.model)
    require_shown(settings.uncertainty, session.measurements, where)
    warnings = [f"{where}: {text}" for text in settings.odd]
    sheet = settings.job.sheet
    warnings += [f"{where}: {text}" for text in sheet.instrument.warnings(session.set_up.date)]
    warnings += [text for one in cleaned for text in one.warnings]
    warnings += [text for _, match in joined for text in match.warnings]
    masked = [*(one.masked for one in cleaned), *(match.masked for _, match in joined)]
    if settings.robot and not _names(settings.robot, robot):
        warnings.append(f'the session names the robot "{settings.robot}", not {robot.name}')
    drifts = [one.drift for one in cleaned if one.drift is not None]
    return replace(
        session,
        files=sources.files,
        stated_reflectors=settings.stated_reflectors,
        masked=tuple(text for said in masked for text in said),
        warnings=tuple(dict.fromkeys([*warnings, *session.warnings])),
        notes=tuple(dict.fromkeys([*session.notes, *(drift.sentence for drift in drifts)])),
        link_sd=_prior(settings, robot, where),
        in_use=_in_use(settings, robot),
        drift=max(drifts, key=lambda drift: float(drift.shift.max()), default=None),
    )


def require_free_set(free: str | tuple[str, ...], robot: Robot, where: str) -> None:
    """Refuse a word for what is free that is no free set of the robot.

    Raises
    ------
    InputError
        S37: it is none; a list of names of numbers is not looked at.
    """
    known = [*FREE, *robot.free_sets]
    if isinstance(free, str) and free not in known:
        close = get_close_matches(free, known, 1)
        raise refusal(
            where, "identification.free", f'[identification] free is "{free}"', code="S37",
            value=free, allowed=f"it must be {', '.join(known)}, or a list of names of numbers",
            fix=f'did you mean "{close[0]}"?' if close else "choose one of these",
        )  # fmt: skip


def _in_use(settings: SessionFile, robot: Robot) -> ToolInUse | None:
    """The tool that will be used, with the frame that its point is stated in."""
    if settings.tool_in_use is None:
        return None
    tool = settings.tool_in_use.tool
    if robot.own_text is None:
        return tool
    return replace(tool, frame=tuple(flange_of_points(robot)[:3].ravel().tolist()))


def _prior(settings: SessionFile, robot: Robot, where: str) -> Array | None:
    """Widths (n, 5) of the prior on the links, if the session states one."""
    n, stated = robot.model.chain.n_joints, settings.prior
    if stated is None:
        return None
    if strange := stated.strange(n):
        message, allowed = f"[prior] has joint {strange}", f"joints of {robot.name} are 1 to {n}"
        raise refusal(where, "prior.joints", message, code="S37", value=strange, allowed=allowed)
    own = robot.tolerances
    return frozen(tolerances_of(stated, usual_tolerances(n) if own is None else own))


def without_strays(robot: Robot, session: Session) -> Session:
    """The session without rows that no base and tool bring near their joints, which are named.

    Where these are most of the held-out rows, or of the others, the file holds rows of two frames:
    each part is then asked by itself.
    """
    both = session.split_stated and 0 < session.is_test.sum() < len(session.is_test)
    parts = [session.is_test, ~session.is_test]
    try:
        mismatched, why = _strays(robot, session)
    except InputError:
        if not both:
            raise
        mismatched, why = np.ones(len(session.is_test), dtype=np.bool_), {}
    if both and any(mismatched[rows].mean() > MOST_STRAYS for rows in parts):
        mismatched, why = np.zeros(len(mismatched), dtype=np.bool_), {}
        for rows in parts:
            places = np.flatnonzero(rows)
            mismatched[places], said = _strays(robot, session.rows(rows))
            why |= {int(places[row]): text for row, text in said.items()}
    if not why:
        return session
    masked = tuple(f"{session.place[row]}{MISMATCHED}{why[row]}" for row in sorted(why))
    return replace(session.rows(~mismatched), masked=(*session.masked, *masked))


def _strays(robot: Robot, session: Session) -> tuple[Bool, dict[int, str]]:
    """Rows (m,) that no frames bring near their joints, and why; refuses shots that slipped."""
    mismatched, why, doubtful = mismatched_rows(robot.model, session.measurements, session.place)
    raise_if_slipped(robot.model, session.measurements, doubtful, session.place)
    return mismatched, why


def read_held_out(
    test: Path,
    robot: Robot,
    data: Path,
    *,
    config: Path | None = None,
    options: ReadOptions | None = None,
) -> Session:
    """Read held-out poses from a file of their own.

    A CSV says nothing of its own about units, conventions and uncertainties: what the session.toml
    of `data` says holds for it, too, but for the files that are named there.
    """
    file, main = session_file(test), session_file(data)
    own = config is not None or file.suffix.lower() == ".toml" or main.suffix.lower() != ".toml"
    if own:
        how = None if file.suffix.lower() == ".toml" else config
        return read_session(test, robot, config=how, options=options)
    try:
        return read_session(file, robot, config=main, options=options, alone=True)
    except InputError as error:
        raise error.located(str(file)) from error


def _names(stated: str, robot: Robot) -> bool:
    """Whether a session names this robot: by its name, or by a path of its file or folder."""
    last = Path(stated).name
    return robot.name == stated or robot.folder.name == last or is_there(robot.folder / last)
