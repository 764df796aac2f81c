"""What measurement files become: one frozen `Session` in SI units."""

from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.fixtures import Fixtures
from calib.measurement.corrections import Corrections
from calib.measurement.observations import Measurements
from calib.shown import Shown, in_a_line, length_words
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.conditions import SetUp
from testbed.files.rows.say import NOTHING_SAID, RowsSay
from testbed.files.session_toml import IdentificationTable
from testbed.files.table import Unread
from testbed.files.visits.visit import RobotVisit
from testbed.gates.text import SourceFile
from testbed.robots.robot import Reflector
from testbed.scenario.systematic import SystematicTable
from testbed.scenario.tolerance import Decision
from testbed.scenario.tool_in_use import ToolInUse

Record = TypeVar("Record", bound=Any)


def rows_of(record: Record, index: Index, columns: tuple[str, ...]) -> Record:
    """A frozen record with some rows (indices) of the fields that are arrays, tuples or None."""

    def chosen(values: Any) -> Any:
        if values is None:
            return None
        return tuple(values[k] for k in index) if isinstance(values, tuple) else values[index]

    return replace(record, **{name: chosen(getattr(record, name)) for name in columns})


DRIFTED = 2.0
"""A drift counts if its largest shift is above so many times its standard uncertainty."""


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """How far the station moved, by the nests that stay on the floor."""

    nests: tuple[str, ...]
    steps: Array
    """(r, 6) best fit of each round to the first: [translation (m); rotation (rad)]."""
    shift: Array
    """(r,) how far that moves the middle of the measured points [m]."""
    uncertainty: float
    """Standard uncertainty of one such shift [m]."""
    corrected: bool
    """Whether it was taken off: the largest shift is above `DRIFTED` times its uncertainty, and the
    file says between which poses the nests were shot."""
    covariance: Array
    """(r, 6, 6) of the place of each round, shift of the middle and rotation [m, rad]."""
    wrong: tuple[str, ...]
    """Shots at nests that lie too far from their median, in words; they do not count."""

    @property
    def sentence(self) -> str:
        """The drift in words, for the report."""
        done = "taken off" if self.corrected else "not taken off"
        size, u = float(self.shift.max(initial=0.0)), self.uncertainty
        largest, uncertain = length_words(size, u, um=".1f"), length_words(u, size, um=".1f")
        if size <= DRIFTED * u:
            done += ", being below twice that"
        lost = f"; {len(self.wrong)} wrong shots left out" if self.wrong else ""
        return (
            f"the station drifted up to {largest} over "
            f"{len(self.shift)} rounds of {len(self.nests)} nests "
            f"(standard uncertainty {uncertain}): {done}{lost}"
        )


@dataclass(frozen=True, slots=True, eq=False)
class Stated:
    """How rotations stand in the file, kept so that other readings of it can be tried."""

    form: str = "none"
    """none, matrix, quaternion, rotation_vector, axis_angle, or an Euler sequence: capitals turn
    about axes that turn along, small letters about fixed ones."""
    numbers: Array | None = None
    """(m, 3 | 4 | 9) as in the file: Euler angles in the order of the letters [rad], quaternions
    with w first, rotation vectors [rad], an axis and the angle about it [rad], matrices by rows."""
    inverted: bool = False
    """Whether the file gives T_tool_tracker."""

    def __repr__(self) -> str:
        return in_a_line(self)

    def rows(self, index: Index) -> "Stated":
        """The same for some rows (indices)."""
        return rows_of(self, index, ("numbers",))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class Session(Shown):
    """Everything a calibration needs of a measuring session; the world is the first station."""

    name: str
    files: tuple[SourceFile, ...] = ()
    """What was read, with sha256."""
    measurements: Measurements
    """All valid rows, identify and test."""
    pose_names: tuple[str, ...]
    """Name of each pose, by `measurements.pose_id`; empty for numbers no row has."""
    is_test: Bool
    """(m,) rows that judge and are never used for identification."""
    split_stated: bool
    """Whether the file says which rows those are."""
    read_back: Array | None
    """(m, n) joints as the controller read them back [rad, m]."""
    time: Array | None
    """(m,) since the first row [s]."""
    conditions: Conditions
    """Payload, tool and temperature of each row, as far as they are stated."""
    set_up: SetUp
    approach: tuple[str, ...] | None
    """(m,) how each pose was approached, as the file calls it."""
    joint_source: Literal["commanded", "read-back"]
    """Which joints `measurements.q` are."""
    uncertainty: str
    """Where the covariances come from, in a sentence."""
    noise_assumed: bool = False
    """Whether the file says that they are guesses."""
    systematic: SystematicTable | None = None
    """What the instrument gets wrong in all readings alike, where it is stated."""
    joint_scatter: Array
    """(n,) repeatability of the joints that the covariances do *not* hold yet [rad or m]; add it
    once base and tool are known."""
    fixtures: Fixtures
    """Reflectors, anchors and stations the rows refer to; zero where nothing is known yet."""
    placed: bool = False
    """Whether the file says about where all that is free among them is."""
    fixed: tuple[str, ...]
    """Names of the numbers of `fixtures` that the file gives; they are not identified."""
    reflector_names: tuple[str, ...]
    anchor_names: tuple[str, ...]
    station_names: tuple[str, ...]
    """The first one is the world."""
    stated_reflectors: tuple[Reflector, ...] = ()
    """Those whose place in the tool frame the file gives."""
    masked: tuple[str, ...] = ()
    """Rows left out, and why."""
    drift: Drift | None = None
    corrections: Corrections | None = None
    """Those by nests of each row (m,), where a drift was taken off."""
    warnings: tuple[str, ...]
    """What looks odd but did not stop the reading."""
    notes: tuple[str, ...]
    """How the files were read: dialect, units, conventions."""
    unread: tuple[Unread, ...] = ()
    """What the notes say of columns."""
    stated: Stated
    simulated: bool
    """Whether the file says that it comes from a virtual laboratory."""
    wanted: IdentificationTable
    """What is to be identified, as [identification] of session.toml states it."""
    rows_say: RowsSay = NOTHING_SAID
    """What the rows say for terms of a model that follow them, and why not."""
    gear: tuple[tuple[float, ...], ...] = ()
    """(n,) waves a turn that the drive of each joint may leave, as [gear] states them."""
    decision: Decision | None = None
    """How far the tool may miss and how that is decided, as [tolerance] states it."""
    link_sd: Array | None = None
    """(n, 5) of the prior on the links that the session states [rad, m, m, rad, rad]; None: it
    states none."""
    in_use: ToolInUse | None = None
    """The tool that will be used, where it is not the one that was measured."""
    order: Index | None = None
    """(m,) place of each row in time, where a column states it, or rows of several files have their
    own times."""
    numbered: bool = False
    """Whether it is what a column states."""
    place: tuple[str, ...]
    """(m,) file and line of each row, for messages."""
    visits: tuple[RobotVisit, ...] = ()
    """Those that were joined; none where the session is one of its own."""
    visit: Index | None = None
    """(m,) which of them each row is of."""
    alone: tuple["Session", ...] = ()
    """Each of them as it was read."""

    @property
    def where(self) -> str:
        """File of the first row, for messages."""
        return self.place[0].rpartition(":")[0]

    @property
    def stated_in(self) -> str:
        """The session.toml that says what is wanted, for messages; its name where there is none."""
        tomls = (file.path for file in self.files[:1] if file.path.suffix.lower() == ".toml")
        return next(map(str, tomls), self.name)

    @property
    def in_time(self) -> Index:
        """Place (m,) of each row in time: as stated, as the clock says, else as the rows stand."""
        if self.order is not None:
            return self.order
        m = len(self.measurements)
        order = np.arange(m)
        if self.time is not None:
            order[np.argsort(self.time, kind="stable")] = np.arange(m)
        return order

    def rows(self, which: Bool) -> "Session":
        """The session restricted to some rows (m,); what was left out stays named."""
        index = np.flatnonzero(which)
        columns = ("is_test", "read_back", "time", "order", "approach", "place", "visit")
        return replace(
            rows_of(self, index, columns),
            measurements=self.measurements.rows(index),
            stated=self.stated.rows(index),
            conditions=self.conditions.rows(index),
            corrections=self.corrections and self.corrections.rows(index),
        )

    def pose_name(self, row: int) -> str:
        """Name of the pose of a row."""
        return self.pose_names[int(self.measurements.pose_id[row])]

    @property
    def free_anchors(self) -> tuple[int, ...]:
        """Anchors of the fixtures, from 0, whose place in the world is to be found."""
        count = len(self.anchor_names)
        return tuple(k for k in range(count) if f"anchor{k + 1}.x" not in self.fixed)
