"""What `identify` will report on a proposed session, which is read and probed in the same way."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.start.start import start_frames
from calib.identification.sufficiency import independent_equations, require_equations
from testbed.files.cleaned import readings_of, sheet_of, table_in
from testbed.files.columns import is_known
from testbed.files.read import MISMATCHED, whole_session
from testbed.files.session import Session
from testbed.files.session_toml import SESSION_FILE, SessionFile
from testbed.files.sources import Sources
from testbed.files.table import Columns
from testbed.files.valid import valid_rows
from testbed.files.visits.probing import probed
from testbed.files.visits.tables import CampaignFile
from testbed.gates.mistakes import validated
from testbed.gates.text import MAX_MB
from testbed.proposal.data import Document, Found
from testbed.robots.robot import Robot

DROP = "--drop-invalid"
"""Option of `identify` with which it leaves out rows that it would refuse."""
CELLS = ("M25", "V9")
"""Error codes of rows that can be left out to find further errors."""
OTHERWISE = "M20"
"""Error code of joints that mean something else in all rows: single rows are not to blame."""
SHOWN = 6
"""Largest number of sentences on rows that are left out, or odd."""


@dataclass(frozen=True, slots=True)
class Foretold:
    """Errors and warnings of a session, in the words of `identify`."""

    refused: tuple[str, ...] = ()
    odd: tuple[str, ...] = ()
    """What `identify` will leave out or warn of."""
    unread: tuple[str, ...] = ()
    """Unused columns, by file."""
    drops: bool = False
    """Whether it takes the rows that are left only with `DROP`."""


def verdict_on(
    document: Document, looks: Sequence[Found], robot: Robot | None, root: Path, *, fits: bool
) -> Foretold:
    """What `identify` will refuse, what it will leave out or warn of, and what it does not read.

    Parameters
    ----------
    document : dict
        A session.toml.
    looks : sequence of Found
        Its files.
    robot : Robot or None
        Robot of the measurements; without it only the cells are checked.
    root : Path
        Folder of the session.
    fits : bool
        Whether the robot fits at all; if not, that has been reported already.
    """
    settings = validated(document, CampaignFile, SESSION_FILE)
    if "joints.csv" in (table := document.get("joints", {})).get("file", "") and not any(
        look.name == table["file"] for look in looks
    ):
        return Foretold()  # a name to fill in

    def sources() -> Sources:
        texts = {(root / one.name, one.sheet): one.text for one in looks}
        return Sources(root, None, MAX_MB, texts)

    if robot is None:
        told = _cells(settings, sources())
        return Foretold(told, drops=any(DROP in text for text in told))
    refused: list[str] = []
    session: Session | None = None
    for drop in (False, True):
        try:
            session = whole_session(settings, sources(), robot, drop=drop, where=SESSION_FILE)
            break
        except InputError as error:
            if str(error) not in refused:
                refused.append(str(error))
            if error.code not in CELLS and DROP not in str(error):
                break
    if session is None:
        return Foretold(tuple(refused))
    odd, drops = list(session.masked), any(DROP in text for text in refused)
    if not refused:  # else they only repeat what was left out
        odd += session.warnings
    try:
        # where nothing fits, it has been reported that links explain no reading either
        odd += [text for one in probed(robot, session, links=fits) for text in one.warnings]
    except InputError as error:
        if fits or error.field != "ROBOT":
            refused.append(str(error))
        if error.field == "ROBOT" or error.code == OTHERWISE:
            odd = [text for text in odd if MISMATCHED not in text]
    try:
        _require_enough(robot, session)
    except InputError as error:
        refused.append(str(error.located(session.where)))
        drops = False  # what is left would be refused again
    if len(odd) > SHOWN:
        odd = [*odd[:SHOWN], f"and {len(odd) - SHOWN} more"]
    # each file by its own name, since the session states the folder
    left = [f"{Path(one.where).name}: columns {', '.join(one.columns)}" for one in session.unread]
    return Foretold(tuple(refused), tuple(odd), tuple(left), drops)


def _require_enough(robot: Robot, session: Session) -> None:
    """Refuse one visit whose rows are too few for links, base, tool and fixtures.

    Raises
    ------
    InputError
        M27: there are fewer equations than numbers, or no more than these.
    """
    if session.visits:
        return  # they share links: identify counts them together
    model = RobotModel(robot.model.chain, robot.model.joint_errors, session.fixtures)
    numbers = parameters_of(model)
    free = numbers.freeing(set(numbers.names) - set(session.fixed))
    table = session.measurements
    if independent_equations(table, free)[1] > free.n_free:
        return
    # in the fitted frames, since an anchor at the center of the base determines less than elsewhere
    model = start_frames(model, table, free_anchors=session.free_anchors).model
    require_equations(model, table, free)


def _cells(settings: SessionFile, sources: Sources) -> tuple[str, ...]:
    """Cells of one session that are not numbers, as far as this is known without a robot."""
    if isinstance(settings, CampaignFile) and settings.session:
        return ()
    refused = []
    try:
        for cleaned in readings_of(sources, settings, drop=False):
            own = settings.joints
            file = own.file if own is not None else None
            text = cleaned.text if file is None else sources.text(
                file, "joints", sheet_of(own, cleaned.section, file)
            )  # fmt: skip
            table = table_in(text, settings, own, cleaned.section)
            joints = [name for name in table.names if name[0] == "q" and name[1:2].isdigit()
                      and is_known(name)]  # fmt: skip
            valid_rows(table, Columns(tuple(joints)), drop=False)
    except InputError as error:
        refused.append(str(error))
    return tuple(refused)
