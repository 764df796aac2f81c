"""The parts of a calibration's record: origin, split, errors, models; nothing is computed."""

from dataclasses import dataclass
from typing import Annotated, Literal

from calib.arrays import LATER, Array, Bool, FloatOrNan
from calib.identification.climbing import ClimbStep, Offer
from calib.identification.identify import Identification
from calib.measurement.accuracy import Accuracy
from calib.shown import Shown

ModelName = Literal["geometric", "extended"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Origin(Shown):
    """Where the measurements come from, and what happened to them before any fit."""

    name: str
    """Of the session."""
    files: tuple[tuple[str, str], ...]
    """Name and sha256 of every file read."""
    robot: str
    robot_title: str
    robot_sha256: str
    robot_notes: tuple[str, ...]
    """What had to be assumed to read the robot."""
    simulated: bool
    """Whether a virtual tracker wrote the files."""
    joints: str
    """"commanded" or "read-back"."""
    uncertainty: str
    """Where the covariances come from."""
    masked: tuple[str, ...]
    """Rows left out while reading, and why."""
    drift: tuple[str, ...]
    """What the drift nests say."""
    probe: tuple[str, ...]
    """What the reading was tested against."""
    warnings: tuple[str, ...]
    exact: Annotated[bool, LATER] = False
    """Whether the nominal robot explains them as no robot that was measured."""
    noise_assumed: Annotated[bool, LATER] = False
    """Whether the covariances are guesses."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class HeldOutSplit(Shown):
    """Which rows are held out."""

    is_test: Annotated[Bool, "m"]
    """(m,) never used for identification."""
    is_train: Annotated[Bool, "m"]
    """(m,) to identify from; neither: later visits that are left to type A."""
    stated: bool
    """By the data themselves, else drawn here."""
    seed: int
    sentence: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RowErrors(Shown):
    """What one model misses in every row of the table."""

    vector: Annotated[Array, "m", 3]
    """(m, 3) seen minus predicted position, world axes; zero for distance rows [m]."""
    position: Annotated[Array, "m"]
    """(m,) length of it; of a distance row the size of what is missed [m]."""
    rotation: Annotated[Array, "m"]
    """(m,) angle; zero for other than pose rows [rad]."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Figures(Shown):
    """Statistics of one model's misses over one part of the table, each pose once."""

    position: Accuracy
    """[m]"""
    rotation: Accuracy | None
    """[rad]; None without pose rows."""
    median: float
    """Of the position misses: gross errors do not move it [m]."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FittedModel(Shown):
    """One identified model and how it does."""

    model: ModelName
    identification: Identification
    scatter: Annotated[Array, "f", "f"]
    """(f, f) covariance of the estimate from the scatter of the residuals from pose to pose,
    whatever noise was stated [m^2, m rad, rad^2]."""
    noise_factor: float
    """Typical residual at the rows identified from, in units of the stated noise."""
    misses: RowErrors
    train: Figures
    """At the rows identified from."""
    test: Figures | None
    """At the held-out rows; None if there are none."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Choice(Shown):
    """Which model is handed out, and why."""

    chosen: ModelName
    asked: str
    """What was asked for: geometric, extended or choose."""
    log_evidence: FloatOrNan
    """Of the levels chosen against geometry alone, or of the best with which a climb can begin; nan
    if only one model was looked at."""
    confirmation: Array
    """(2,) mean miss of geometry alone and of the levels chosen, at training poses left out in turn
    [m]; empty where nothing was chosen, or poses were too few."""
    sentence: str
    steps: tuple[ClimbStep, ...]
    """How the choice went, level by level."""
    offered: tuple[Offer, ...]
    """Each level of joint errors, what speaks for it and what became of it."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class OutlierRows(Shown):
    """Rows that do not fit the others."""

    noise_factor: float
    """Typical residual of the geometric model in units of the stated noise: what rows are judged
    against."""
    left_out: Annotated[Bool, "m"]
    """(m,) training rows that the fits do not use."""
    sentences: tuple[str, ...]
    """Training rows that do not fit, worst first."""
    held_out_sentences: tuple[str, ...]
    """Held-out rows far off; they stay in every figure."""
    radius_without: float | None
    """R95 of the mean tool point if these had not been there [m]; None where there are none, or
    nothing would be believed."""
    held_out_names: Annotated[tuple[str, ...], LATER] = ()
    """What these rows are called, worst first."""
