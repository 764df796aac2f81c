"""[[session]] of session.toml: one visit of a robot that was measured several times."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field

from calib.errors import refuse
from testbed.files.conditions import ConditionsTable
from testbed.files.dialects.tables import DialectTable, FramesTable, JointsTable, Name, PointsTable
from testbed.files.session_toml import DriftTable, SessionFile, UncertaintyTable
from testbed.strict import Strict

MOST = 100
"""Sessions of one file."""
FREE, SAME = "free", "same as "
FEWEST = 6
"""Poses that frames of a held-out session are fitted to, at least: five determine base and tool."""
WHOLE = ("match", "split", "dialect", "drift", "uncertainty")
"""What a session may have in place of what stands above all sessions."""
KEY_BY_KEY = ("joints", "frames", "points", "conditions")
"""Tables of which it may state some keys anew."""


class VisitTable(Strict):
    """[[session]]: files of its own, frames of its own or those of another session."""

    name: Name
    """What the visit is called, also in the tables of other visits."""
    file: Name | None = None
    """A CSV with joints and readings; else its own tables name the files."""
    base: Name = FREE
    """Where the station stands: "free", or "same as NAME" where it did not move."""
    tool: Name = FREE
    """What was mounted: "free", or "same as NAME" where it stayed on the flange."""
    payload: Name | None = None
    """"same as NAME"; else [session.conditions] states it."""
    held_out: bool = False
    """Whether it judges the calibration, instead of taking part in it."""
    frame_poses: Annotated[int, Field(ge=FEWEST)] | None = None
    """Of a held-out session: to how many poses, drawn at random, its own frames are fitted; the
    others judge."""
    match: Literal["pose_id", "order", "time"] | None = None
    """As above all sessions."""
    split: Literal["column", "ignore"] | None = None
    """As above all sessions."""
    dialect: DialectTable | None = None
    joints: JointsTable | None = None
    frames: FramesTable | None = None
    points: PointsTable | None = None
    drift: DriftTable | None = None
    uncertainty: UncertaintyTable | None = None
    conditions: ConditionsTable | None = None

    @property
    def names_a_file(self) -> bool:
        """Whether it says where its readings are."""
        tables = (self.frames, self.points)
        return self.file is not None or any(
            t is not None and t.sources != ((None, ""),) for t in tables
        )


class CampaignFile(SessionFile):
    """A session.toml, of one session or of several."""

    session: Annotated[tuple[VisitTable, ...], Field(max_length=MOST)] = ()
    """What stands above them holds for each of them that does not say otherwise."""

    @property
    def of_one_table(self) -> Self:
        """As for one session; several do not say how to read one CSV."""
        if self.session:
            raise refuse(
                "--test", code="M35", message="--test is given beside a file of several sessions",
                fix="state it as a [[session]] of that file with held_out = true",
            )  # fmt: skip
        return super().of_one_table

    def of(self, visit: VisitTable) -> SessionFile:
        """The session.toml of one visit alone."""
        own: dict[str, Any] = {"name": visit.name}
        for key in (*WHOLE, *KEY_BY_KEY):
            here, above = getattr(visit, key), getattr(self, key)
            if here is None:
                continue
            if key in KEY_BY_KEY and above is not None:
                here = above.model_copy(update={k: getattr(here, k) for k in here.model_fields_set})
            own[key] = here
        whole = {name: getattr(self, name) for name in SessionFile.model_fields}
        return SessionFile.model_construct(**{**whole, **own})
