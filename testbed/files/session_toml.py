"""session.toml: its tables."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from calib.errors import refuse
from testbed.bounds import ANGLE_SD, CELL, FACTORS, LENGTH_SD, RANGE_SCALE, TRACKER_SD, Bound, shown
from testbed.files.conditions import ConditionsTable, SessionUse
from testbed.files.dialects.tables import (
    CyclesTable,
    DialectTable,
    FramesTable,
    JointsTable,
    Name,
    ObservedTable,
    Point,
    PointsTable,
    RangesTable,
)
from testbed.files.rows.gear import GearTable
from testbed.jobsheet.settings import JobTable
from testbed.robots.robot import Reflector
from testbed.robots.tolerances import LinkTolerances
from testbed.scenario.systematic import SystematicTable
from testbed.scenario.tolerance import ToleranceTable
from testbed.scenario.tool_in_use import ToolInUseTable
from testbed.strict import Strict

SESSION_FILE = "session.toml"
FRAMES_ALONE = "frames"
"""What `free` says where a calibrated robot is only placed anew."""
FREE = ("identifiable", FRAMES_ALONE)
"""Words for what is free, beside the free sets of a robot."""
LengthSd = Annotated[float, LENGTH_SD.size("um")]
AngleSd = Annotated[float, ANGLE_SD.size("mdeg")]
Floor = Annotated[float, LENGTH_SD.or_zero("um")]
IsoFigureName = Literal["AP", "RP", "vAP", "AD", "RD", "dAP", "dRP", "AT", "RT"]


class IsoTable(Strict):
    """[iso9283]: what a test was, and the largest figures that are allowed."""

    frame: Literal["robot", "fitted"] | None = None
    """Whether readings are in the frame of the commands, or brought there by a best fit."""
    speed_percent: Annotated[float, Field(gt=0.0, le=100.0)] | None = None
    """Printed."""
    limits_um: dict[IsoFigureName, LengthSd] = Field(default_factory=dict)
    """Largest figures, as the maker or the customer states them."""


class StartTable(Strict):
    """[start]: about where free reflectors and anchors and further stations are, by name.

    Stations have axes about parallel to the world's. Where frames fitted from there are as good as
    those found from nothing, identification begins there.
    """

    reflectors_mm: dict[Name, Point] = Field(default_factory=dict)
    """In the tool frame."""
    anchors_mm: dict[Name, Point] = Field(default_factory=dict)
    """In the world."""
    stations_mm: dict[Name, Point] = Field(default_factory=dict)
    """Beam origins in the world, which is the first station's frame."""


class DriftTable(Strict):
    """[drift]: nests that stay on the floor."""

    nests: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of at least three targets that stay in nests on the floor."""
    limit_mm: Annotated[float, CELL.size("mm")] = 0.2
    """A nest that seems to move by more was shot wrongly."""
    file: Name | None = None
    """Their shots; the file of the points if left out."""


class UncertaintyTable(Strict):
    """[uncertainty]: standard uncertainties (k = 1) of one reading, per axis."""

    position_um: LengthSd | None = None
    """Of each coordinate of a position."""
    rotation_mdeg: AngleSd | None = None
    """Of a rotation, about each axis."""
    distance_um: LengthSd | None = None
    """Of a distance."""
    mpe_um: tuple[Floor, Floor] | None = None
    """Maximum permissible error across the beam: constant, and per meter of range."""
    mpe_rule: Literal["rectangular", "two_sigma", "typical"] = "typical"
    """How the maximum permissible error is read: divided by √3, by 2 or by 4."""
    at_least_position_um: Floor = 0.0
    """Stated uncertainties of positions that are smaller are raised to this."""
    at_least_rotation_mdeg: Annotated[float, ANGLE_SD.or_zero("mdeg")] = 0.0
    """The same of rotations."""
    at_least_distance_um: Floor = 0.0
    """The same of distances."""
    joint_repeatability: Literal["robot", "included"] = "robot"
    """Whether the scatter of the joints comes on top, or is in the stated numbers already."""
    assumed: bool = False
    """Whether these numbers are guesses, not the instrument's: what is stated then says so."""
    systematic: SystematicTable | None = None

    @model_validator(mode="after")
    def _one_source(self) -> "UncertaintyTable":
        """One source of the position."""
        if self.position_um is not None and self.mpe_um is not None:
            raise ValueError("write either position_um or mpe_um")
        least = shown(LENGTH_SD.least, "um")
        if self.mpe_um is not None and max(self.mpe_um) < least:
            raise ValueError(f"one number of mpe_um must be {least:g} um or more")
        return self

    @property
    def odd(self) -> tuple[str, ...]:
        """Sentences on numbers that are hardly meant."""
        stated = {"position_um": self.position_um, "distance_um": self.distance_um}
        constant, slope = self.mpe_um or (None, None)
        stated |= {"rotation_mdeg": self.rotation_mdeg, "mpe_um": max(constant or 0, slope or 0)}
        least = shown(TRACKER_SD, "um")
        # interferometers tell distances better
        positions = {key: stated[key] for key in ("position_um", "mpe_um")}
        below = {key: value for key, value in positions.items() if value and value < least}
        stated = {key: value for key, value in stated.items() if key not in below}
        shared = {} if self.systematic is None else self.systematic.sizes
        return *(
            f"[uncertainty] {key} is {value:g}: no laser tracker measures better than {least:g} "
            "um; check the unit"
            for key, value in below.items()
        ), *(
            f"[{table}] {key} is {value:g}; {bound.allowed(unit, usual=True)}"
            for table, sizes in (("uncertainty", stated), ("uncertainty.systematic", shared))
            for key, value in sizes.items()
            for unit, bound in [_kind_of(key)]
            if value and not bound.is_usual(value * FACTORS[unit])
        )


def _kind_of(key: str) -> tuple[str, Bound]:
    """Unit and bound of an uncertainty, from its key."""
    if key.endswith("_um_per_m"):
        return "um/m", RANGE_SCALE
    unit = key.rpartition("_")[2]
    return unit, ANGLE_SD if unit == "mdeg" else LENGTH_SD


class IdentificationTable(Strict):
    """[identification]: what is to be identified."""

    model: Literal["geometric", "extended", "choose"] = "choose"
    """Geometry alone, with sag and two waves a turn, or what the training rows choose, up to a map
    of every joint."""
    free: str | tuple[str, ...] = "identifiable"
    """"identifiable", "frames" (base, tool and fixtures alone: a calibrated robot is placed anew),
    a free set of the robot, or names of numbers."""
    base: Literal["free", "fixed"] = "free"
    """Whether the place of the robot before the tracker is identified or taken from the robot's
    file."""
    tool: Literal["free", "fixed"] = "free"
    """The same of the target on the flange."""
    visits: Literal["all", "first"] = "all"
    """Which visits of a pose are identified from: "first" leaves repeats to type A."""
    held_out: Literal["drawn", "designed"] = "drawn"
    """How the held-out poses were chosen: designed ones guard no statement."""
    order: Literal["rows", "as measured", "time", "unknown"] = "rows"
    """What tells which row came first, for the test of drift: a column order, else times, else the
    order of the rows; times, which must be there; nothing. Times, a column order and "as measured"
    state it, so that what depends on the side that a joint came from can be told as well."""
    material: Literal["steel", "aluminium"] = "steel"
    """Of the links, which says about how much they grow where temperatures are given."""


class SessionFile(Strict):
    """A session.toml."""

    format: Literal[1] = 1
    """Version of the file format."""
    name: Annotated[str, Field(max_length=200)] = ""
    """What the session is called in the report."""
    robot: str = ""
    """Robot that was measured; a warning if the command names another one."""
    simulated: bool = False
    """Whether a virtual tracker measured: the report then says so."""
    match: Literal["pose_id", "order", "time"] = "pose_id"
    """Joints and readings belong together by their pose_id, row by row, or by the times in both
    files, which are of one clock, or of two whose difference [joints] clock_offset_s states."""
    match_within_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """For match = "time": how far apart a reading and its joints may be; 0: their times are equal.
    All joints so near must be one pose."""
    split: Literal["column", "ignore"] = "column"
    """Whether a column `split` decides which rows are held out."""
    dialect: DialectTable = DialectTable()
    joints: JointsTable = JointsTable()
    frames: FramesTable | None = None
    points: PointsTable | None = None
    ranges: RangesTable | None = None
    cycles: CyclesTable | None = None
    paths: CyclesTable | None = None
    iso9283: IsoTable = IsoTable()
    start: StartTable | None = None
    drift: DriftTable | None = None
    uncertainty: UncertaintyTable = UncertaintyTable()
    conditions: ConditionsTable = ConditionsTable()
    use: SessionUse = SessionUse()
    """Of targets that do not say under which conditions the robot goes there."""
    gear: GearTable = GearTable()
    identification: IdentificationTable = IdentificationTable()
    tolerance: ToleranceTable | None = None
    job: JobTable = JobTable()
    prior: LinkTolerances | None = None
    """How far the links may lie from nominal; those of the robot where nothing is stated."""
    tool_in_use: ToolInUseTable | None = None

    @property
    def odd(self) -> tuple[str, ...]:
        """Sentences on numbers that are hardly meant."""
        odd = [*self.uncertainty.odd, *(self.tolerance.odd if self.tolerance else ())]
        if self.match_within_s and self.match != "time":
            odd.append(f'match_within_s changes nothing: match is "{self.match}", not "time"')
        if self.joints.clock_offset_s and self.match != "time":
            odd.append(f'clock_offset_s changes nothing: match is "{self.match}", not "time"')
        return tuple(odd)

    @property
    def observed(self) -> tuple[ObservedTable, ...]:
        """The tables of readings that are there."""
        return tuple(table for table in (self.frames, self.points, self.ranges) if table)

    @property
    def of_one_table(self) -> Self:
        """The same for one CSV of joints and readings, whatever files are named; M35 if it cannot.

        A session that reads several files, or of another format, does not say how to read one.
        """
        several = len(self.observed) > 1 or any(len(one.sources) > 1 for one in self.observed)
        if several or any(getattr(one, "format", "csv") != "csv" for one in self.observed):
            raise refuse(
                "--test", code="M35",
                message="the session reads several files or another format, which does not say how "
                "to read one CSV", fix="give --test a session.toml of its own",
            )  # fmt: skip
        own: dict[str, Any] = {
            one.name: one.model_copy(update={"file": None}) for one in self.observed
        }
        own["joints"] = self.joints.model_copy(update={"file": None})
        if self.drift is not None and self.drift.file is not None:
            own["drift"] = None  # its nests belong to the other rows
        return self.model_copy(update=own)

    @property
    def stated_reflectors(self) -> tuple[Reflector, ...]:
        """Reflectors whose place in the tool frame is given."""
        tables = (table for table in (self.points, self.ranges) if table)
        places = {name: place for table in tables for name, place in table.reflectors_mm.items()}
        return tuple(
            Reflector(name, (place[0] / 1e3, place[1] / 1e3, place[2] / 1e3))
            for name, place in places.items()
            if place != "free"
        )
