"""session.toml: its tables, and where the files it names lie."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from calib.errors import InputError
from testbed.files.text import SourceFile, Text, read_text
from testbed.strict import Strict

Name = Annotated[str, Field(min_length=1, max_length=200)]
Point = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0.0, le=1e9)]
Floor = Annotated[float, Field(ge=0.0, le=1e9)]
Euler = Annotated[str, Field(min_length=1, max_length=20)]
Place = Point | Literal["free"]


class DialectTable(Strict):
    """[dialect]: how cells are written, where the file leaves a doubt."""

    separator: Literal["comma", "semicolon", "tab", "space"] | None = None
    decimal: Literal[".", ","] | None = None


class FileTable(Strict):
    """What all tables of files share."""

    file: Name | None = None
    """Beside session.toml or below; the DATA of the command if left out."""
    columns: dict[Name, Name] = Field(default_factory=dict)
    """Own column name, unit included, to the name in the file: ``x_mm = "measurement_x"``."""


class ObservedTable(FileTable):
    """What the files of a measuring device share."""

    files: tuple[Name, ...] = ()
    """One file per station, the first one's frame is the world."""

    @model_validator(mode="after")
    def _one_way(self) -> "ObservedTable":
        """Either one file or several."""
        if self.file is not None and self.files:
            raise ValueError("write either file or files")
        return self


class JointsTable(FileTable):
    """[joints]: where the robot was told to be, or says it was."""

    source: Literal["commanded", "read-back"] | None = None


class FramesTable(ObservedTable):
    """[frames]: full poses."""

    format: Literal["csv", "sa"] = "csv"
    euler: Euler | None = None
    """Capitals: about axes that turn along; small letters: about fixed axes."""
    gives: Literal["T_tracker_tool", "T_tool_tracker"] = "T_tracker_tool"
    length: Literal["mm", "m", "in"] | None = None
    """For format = "sa"."""
    angle: Literal["deg", "rad"] | None = None
    """For format = "sa"."""
    rotation: (
        Literal["euler", "matrix", "quaternion_scalar_first", "quaternion_scalar_last"] | None
    ) = None
    """For format = "sa"."""


class PointsTable(ObservedTable):
    """[points]: positions of reflectors."""

    format: Literal["csv", "sa"] = "csv"
    length: Literal["mm", "m", "in"] | None = None
    """For format = "sa", where the file does not say it."""
    angle: Literal["deg", "rad"] | None = None
    """For format = "sa", polar readings."""
    names: Annotated[int, Field(ge=0, le=3)] | None = None
    """For format = "sa": fields of each line before the coordinates."""
    after: tuple[Name, ...] = ()
    """For format = "sa": own names of the fields after the coordinates, "" for those unused."""
    pose: Literal["target", "group", "occurrence"] | None = None
    """For format = "sa": what numbers the poses."""
    reflectors_mm: dict[Name, Place] = Field(default_factory=dict)
    """Place of each target in the tool frame, or "free" where it is to be found."""


class RangesTable(ObservedTable):
    """[ranges]: distances from fixed points."""

    anchors_mm: dict[Name, Place] = Field(default_factory=dict)
    """Place of each anchor in the world, or "free" where it is to be found."""
    reflectors_mm: dict[Name, Place] = Field(default_factory=dict)


class DriftTable(Strict):
    """[drift]: nests that stay on the floor."""

    nests: Annotated[tuple[Name, ...], Field(min_length=1)]
    limit_mm: Positive = 0.2
    file: Name | None = None
    """Their shots; the file of the points if left out."""


class UncertaintyTable(Strict):
    """[uncertainty]: standard uncertainties (k = 1) of one reading, per axis."""

    position_um: Positive | None = None
    rotation_mdeg: Positive | None = None
    distance_um: Positive | None = None
    mpe_um: tuple[Floor, Floor] | None = None
    """Maximum permissible error across the beam: constant, and per meter of range."""
    mpe_rule: Literal["rectangular", "two_sigma", "typical"] = "typical"
    at_least_position_um: Floor = 0.0
    at_least_rotation_mdeg: Floor = 0.0
    at_least_distance_um: Floor = 0.0
    joint_repeatability: Literal["robot", "included"] = "robot"
    """Whether the scatter of the joints comes on top, or is in the stated numbers already."""

    @model_validator(mode="after")
    def _one_source(self) -> "UncertaintyTable":
        """One source of the position."""
        if self.position_um is not None and self.mpe_um is not None:
            raise ValueError("write either position_um or mpe_um")
        return self


class IdentificationTable(Strict):
    """[identification]: what is to be found."""

    model: Literal["geometric", "extended", "choose"] = "choose"
    free: str | tuple[str, ...] = "identifiable"
    base: Literal["free", "fixed"] = "free"
    tool: Literal["free", "fixed"] = "free"
    visits: Literal["all", "first"] = "all"


class SessionFile(Strict):
    """A session.toml."""

    format: Literal[1] = 1
    name: Annotated[str, Field(max_length=200)] = ""
    robot: str = ""
    simulated: bool = False
    match: Literal["pose_id", "order"] = "pose_id"
    split: Literal["column", "ignore"] = "column"
    dialect: DialectTable = DialectTable()
    joints: JointsTable = JointsTable()
    frames: FramesTable | None = None
    points: PointsTable | None = None
    ranges: RangesTable | None = None
    drift: DriftTable | None = None
    uncertainty: UncertaintyTable = UncertaintyTable()
    identification: IdentificationTable = IdentificationTable()

    @property
    def observed(self) -> tuple[tuple[str, ObservedTable], ...]:
        """The tables of readings that are there, with their names."""
        tables = (("frames", self.frames), ("points", self.points), ("ranges", self.ranges))
        return tuple((name, table) for name, table in tables if table is not None)


SESSION_FILE = "session.toml"


@dataclass(frozen=True, slots=True, eq=False)
class Sources:
    """The folder of a session, and the files read so far."""

    root: Path
    data: Path | None
    max_mb: float
    texts: dict[Path, Text]

    def text(self, name: str | None, key: str) -> Text:
        """Content of a file named in session.toml, or of DATA; each file is read once."""
        if name is None and self.data is None:
            raise InputError(
                f"[{key}] names no file",
                code="S37",
                where=str(self.root / SESSION_FILE),
                field=f"{key}.file",
                fix=f'write file = "{key}.csv" under [{key}]',
            )
        path = self.data if name is None else self.root / name
        assert path is not None  # one of the two is there
        if name is not None and not path.resolve().is_relative_to(self.root.resolve()):
            raise InputError(
                f'[{key}] file = "{name[:80]}" leads out of the folder',
                code="R6",
                where=str(self.root / SESSION_FILE),
                field=f"{key}.file",
                value=name,
                allowed="a file beside session.toml or in a folder below it",
                fix="copy it there",
            )
        if path not in self.texts:
            where = str(path) if name is None else name
            self.texts[path] = read_text(path, where, max_mb=self.max_mb)
        return self.texts[path]

    @property
    def files(self) -> tuple[SourceFile, ...]:
        """What was read so far."""
        return tuple(text.source for text in self.texts.values())
