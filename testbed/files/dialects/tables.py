"""Tables of a session.toml that name a file, and how it is written."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from testbed.bounds import COORDINATE
from testbed.strict import Strict

Name = Annotated[str, Field(min_length=1, max_length=200)]
Coordinate = Annotated[float, COORDINATE.signed("mm")]
Point = tuple[Coordinate, Coordinate, Coordinate]
Euler = Annotated[str, Field(min_length=1, max_length=20)]
Place = Point | Literal["free"]


class DialectTable(Strict):
    """[dialect]: how cells are written, where the file leaves a doubt."""

    header: bool | None = None
    """Whether the first line names the columns; false: they are called "1", "2" ... and named by
    the tables `columns`. Left out: it does, and is refused where it holds numbers."""
    separator: Literal["comma", "semicolon", "tab", "bar", "space"] | None = None
    """What stands between cells; found from the file if left out."""
    decimal: Literal[".", ","] | None = None
    """What numbers have before their decimals; found from the file if left out."""


class FileTable(Strict):
    """What all tables of files share."""

    file: Name | None = None
    """Beside session.toml or below; the DATA of the command if left out."""
    sheet: Name | None = None
    """Of a workbook that has several."""
    columns: dict[Name, Name] = Field(default_factory=dict)
    """Own column name, unit included, to the name in the file: ``x_mm = "measurement_x"``."""
    header: bool | None = None
    """As under [dialect], for this file alone, where the first line of one names its columns and
    that of another does not."""

    @model_validator(mode="after")
    def _of_a_table(self) -> "FileTable":
        """Exports and programs have no line that names columns."""
        form = getattr(self, "format", "csv")
        if self.header is not None and form != "csv":
            raise ValueError(f'header is of tables, not of format = "{form}"')
        return self


class ObservedTable(FileTable):
    """What the files of a measuring device share."""

    name: ClassVar[str] = ""
    """What the table is called."""
    kind: ClassVar[str] = ""
    """Kind of its readings: pose, point or distance."""
    files: tuple[Name, ...] = ()
    """One file per station, the first one's frame is the world."""

    @model_validator(mode="after")
    def _one_way(self) -> "ObservedTable":
        """Either one file or several."""
        if self.file is not None and self.files:
            raise ValueError("write either file or files")
        return self

    @property
    def sources(self) -> tuple[tuple[str | None, str], ...]:
        """Its files, each with the reflector that it is of; "" where it says so itself."""
        return tuple((file, "") for file in (self.files or (self.file,)))


class JointsTable(FileTable):
    """[joints]: where the robot was commanded to be, or read back that it was."""

    format: Literal[
        "csv", "rapid", "krl", "fanuc", "urscript", "doosan", "kawasaki", "inform", "val3", "rokae"
    ] = "csv"
    """A table of joint values, or a program with joint targets: RAPID (ABB), KRL (KUKA), TP as
    ASCII and position registers (FANUC, `.ls` and `posreg.va`), URScript, DRL (Doosan), AS
    (Kawasaki), INFORM (Yaskawa, where positions are angles), VAL3 (Stäubli; also its Data,
    `.dtx`), RL (ROKAE). Its moves are the rows, else what it declares."""
    source: Literal["commanded", "read-back"] | None = None
    """Which joints the columns hold, where their names do not tell."""
    clock_offset_s: Annotated[float, Field(ge=-1e9, le=1e9)] = 0.0
    """For match = "time": how far the clock of the joints is ahead of that of the readings."""


class OpticalTable(ObservedTable):
    """What [frames] and [points] share."""

    format: Literal["csv", "sa"] = "csv"
    """A table with named columns, or an export of Spatial Analyzer."""
    length: Literal["mm", "m", "in", "um", "cm", "ft"] | None = None
    """For format = "sa", where the file does not state it; for targets, mm unless stated."""
    angle: Literal["deg", "rad"] | None = None
    """For format = "sa": of Euler angles, or of polar readings."""


class FramesTable(OpticalTable):
    """[frames]: full poses."""

    name = "frames"
    kind = "pose"
    euler: Euler | None = None
    """Three axes in the order of the turns, capitals about axes that turn with the tool, small
    letters about fixed ones; or what a controller means: kuka, staubli, fanuc, ur, kawasaki."""
    gives: Literal["T_tracker_tool", "T_tool_tracker"] = "T_tracker_tool"
    """Whether a row is the tool in the tracker's frame, or the inverse, as of a board that a camera
    on the flange sees; uncertainties are those of the row as it stands."""
    rotation: (
        Literal["euler", "matrix", "quaternion_scalar_first", "quaternion_scalar_last"] | None
    ) = None
    """For format = "sa"."""


class PointsTable(OpticalTable):
    """[points]: positions of reflectors."""

    name = "points"
    kind = "point"
    names: Annotated[int, Field(ge=0, le=3)] | None = None
    """For format = "sa": fields of each line before the coordinates."""
    azimuth: Literal["counterclockwise", "clockwise"] = "counterclockwise"
    """Of polar readings: which way azimuth_deg ... grows, seen from above; surveyors count
    clockwise."""
    differences: Literal["measured - target", "target - measured"] = "measured - target"
    """What columns difference_x_mm ... are, where a table has command_x_mm ... in place of x_mm."""
    after: tuple[Name, ...] = ()
    """For format = "sa": own names of the fields after the coordinates, "" for those unused."""
    pose: Literal["target", "group", "occurrence"] | None = None
    """For format = "sa": what numbers the poses."""
    targets: dict[Name, tuple[Name, Name, Name]] = Field(default_factory=dict)
    """Where a row holds several targets: the file's columns of x, y and z of each, in `length`."""
    reflectors_mm: dict[Name, Place] = Field(default_factory=dict)
    """Place of each target in the tool frame, or "free" where it is to be identified."""
    reflector_files: dict[Name, Name] = Field(default_factory=dict)
    """Where each reflector has a file of its own, in place of ``file``: its name to that file; all
    of them at the same poses, and in one frame."""

    @model_validator(mode="after")
    def _of_one_reflector(self) -> "PointsTable":
        """A file is that of one reflector, or of one station, or of several targets in a row."""
        names = list(self.reflector_files.values())
        if names and (self.file or self.files or self.targets):
            raise ValueError("write either reflector_files or file, files and targets")
        if again := {name for name in names if names.count(name) > 1}:
            raise ValueError(f'reflector_files has "{min(again)}" for two reflectors')
        return self

    @property
    def sources(self) -> tuple[tuple[str | None, str], ...]:
        """Its files, each with the reflector that it is of."""
        if not self.reflector_files:
            return super().sources
        return tuple((file, name) for name, file in self.reflector_files.items())

    @model_validator(mode="after")
    def _own_direction(self) -> "PointsTable":
        """An export of Spatial Analyzer says itself what its angles are."""
        if self.format == "sa" and self.azimuth != "counterclockwise":
            raise ValueError('azimuth is of tables, not of format = "sa"')
        return self


class RangesTable(ObservedTable):
    """[ranges]: distances from fixed points."""

    name = "ranges"
    kind = "distance"
    anchors_mm: dict[Name, Place] = Field(default_factory=dict)
    """Place of each anchor in the world, or "free" where it is to be identified. All distances are
    from the only one where no column `anchor` names any."""
    reflectors_mm: dict[Name, Place] = Field(default_factory=dict)
    """Place of each target in the tool frame, or "free" where it is to be identified."""


class CyclesTable(FileTable):
    """[cycles] or [paths]: poses or paths that were run again and again, for ISO 9283."""

    commanded: Name | None = None
    """File of the commanded poses or path points, where the rows do not say them."""
    euler: Euler | None = None
    """As under [frames]."""
