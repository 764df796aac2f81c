"""Core tables of a scenario: which poses, what is identified, and how often."""

from typing import Annotated, Literal

from pydantic import Field

from testbed.bounds import CELL, LENGTH_SD, shown
from testbed.strict import PlainText, Strict

Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_.-]{0,63}$")]
Text = Annotated[PlainText, Field(max_length=4096)]
Length = Annotated[float, CELL.signed("mm")]
Point = tuple[Length, Length, Length]
JointRange = tuple[Length, Length]
"""Lower and upper value of a joint: deg, or mm where it slides."""
Side = Annotated[float, CELL.size("mm")]
Turn = Annotated[float, Field(ge=-720.0, le=720.0)]
RotationVector = tuple[Turn, Turn, Turn]
PlanCriterion = Literal["D", "A", "V", "G", "E", "O1", "O2", "O3", "O4", "O5"]
PlanMethod = Literal["random", "best_of_random", "greedy", "detmax", "fedorov", "exchange"]
MAX_JOINTS = 32


class Settings(Strict):
    """One table of a scenario."""


class PoolSettings(Settings):
    """[pool]: the candidate poses."""

    size: Annotated[int, Field(ge=10, le=20_000)] = 1000
    """Candidate poses that are drawn."""
    box_center_mm: Point = (250.0, 0.0, 200.0)
    """Of the nominal tool position, base frame."""
    box_size_mm: tuple[Side, Side, Side] = (900.0, 1200.0, 800.0)
    """Edges of the box that the tool position is drawn from."""
    self_collision: bool = True
    """Leave out postures in which the robot touches itself, the floor or an obstacle."""
    line_of_sight: bool = True
    """Leave out postures in which the tracker cannot see the target."""
    joint_margin_deg: Annotated[float, Field(ge=0.0, le=90.0)] = 0.0
    """Kept from every joint limit; prismatic joints ignore it."""
    joint_ranges_deg: Annotated[tuple[JointRange, ...], Field(max_length=MAX_JOINTS)] = ()
    """Lowest and highest value of each joint of the arm; deg, mm where a joint slides; empty: the
    joint limits. For arms whose joints turn more than once: half a turn to either side is enough,
    and the moves between the poses stay short."""


class HeldOutSettings(Settings):
    """[test]: poses that judge and are never used for identification."""

    poses: Annotated[int, Field(ge=1, le=5000)] = 50
    """How many."""


class UncertaintySettings(Settings):
    """[uncertainty]: how often things are repeated and drawn."""

    repeats: Annotated[int, Field(ge=2, le=1000)] = 10
    """Visits of each pose, type A."""
    replications: Annotated[int, Field(ge=0, le=100_000)] = 200
    """Calibrations repeated to check the stated intervals; 0 skips the check."""
    draws: Annotated[int, Field(ge=2_000, le=10_000_000)] = 10_000
    """Monte Carlo draws of the tool point; fewer than 100 / (1 - p) say nothing of a 95 % interval
    (JCGM 101:2008, 7.9.4 b)."""


class StudySettings(Settings):
    """[studies]: which extra studies are played."""

    pose_count: bool = False
    """Play the paper's rule for the number of poses: indices of random sets of growing size."""
    pose_count_max: Annotated[int, Field(ge=30, le=1000)] = 150
    """Largest of these sets."""
    random_sets: Annotated[int, Field(ge=0, le=10_000)] = 100
    """Random sets each designed set is compared with; 0 skips the study. With paper_budget they are
    calibrated too, and at most 1000."""
    paper_budget: bool = False
    """Work out the uncertainty budget of Wen et al. 2022."""
    tool_point: bool = False
    """Draw the paper's Monte Carlo cloud of the tool point."""
    population: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Further virtual robots on which every trial's set is played; 0 skips the study."""


Poses = Annotated[int, Field(ge=6, le=5000)]
"""Poses of a set that the paper's estimator identifies 24 numbers from: four hold them, two are
spare."""
MOST_SETS = 100


class BudgetSettings(Settings):
    """[budget]: constants of the paper's uncertainty budget; the defaults are the paper's.

    Who asks for it are [studies] paper_budget and [reexamined]; [uncertainty] repeats says how
    often a set is repeated.
    """

    poses: Poses = 50
    """Of the random set whose repeats give u_r."""
    pose_numbers: Annotated[tuple[Poses, ...], Field(min_length=2, max_length=MOST_SETS)] = (
        *(30, 50, 70, 90, 110, 130, 150),
    )
    """Sizes of the random sets whose estimates scatter by u_p."""
    location_poses: Poses = 50
    """Poses in each of four regions, whose estimates scatter by u_w; of the paper's 50, in a region
    of fewer, all."""
    location_border_mm: tuple[Length, Length] = (250.0, 0.0)
    """x and y of the nominal tool position, base frame, where the four regions meet. The paper does
    not say where its regions lie."""
    environment_mm: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.0
    """u_c, the environment's part, of each number that is a length; the paper takes it as zero."""
    environment_deg: Annotated[float, Field(ge=0.0, le=90.0)] = 0.0
    """The same of each angle."""


Swaps = Annotated[int, Field(ge=1, le=5000)]
Searches = Annotated[int, Field(ge=1, le=100_000)]


class TrialSettings(Settings):
    """[[trial]]: one pose set."""

    name: Name
    """What the trial is called in report, results and files."""
    poses: Annotated[int, Field(ge=1, le=5000)]
    """Poses of the set."""
    method: PlanMethod
    """How the set is chosen from the pool."""
    criterion: PlanCriterion = "O1"
    """What the method makes best; random is only judged by it. V and G take their poses from
    [plan.goal], as `truebed plan` does."""
    rows: Literal["whitened", "paper"] = "whitened"
    """Rows and units the index is computed in; "paper": 12 unweighted rows, mm and rad."""
    sets: Annotated[int, Field(ge=1, le=10_000)] = 100
    """Random sets of which best_of_random keeps the best; the other methods ignore it."""
    detmax: tuple[Annotated[int, Field(ge=0, le=100_000)], Swaps, Swaps, Searches] = (40, 2, 1, 80)
    """The paper's a, b, c, d of DETMAX: each search after the first starts with b poses swapped for
    random ones, c poses once a searches in a row brought nothing; d such searches end it. The other
    methods ignore it."""


Spread = Annotated[float, Field(ge=shown(LENGTH_SD.least, "mm"), le=1e4)]
"""Standard deviation of a prior [deg or mm]."""
Named = dict[str, Spread]
PRIOR = ("identification", "prior")
"""Where the prior stands in the file."""
SINGLE = {"sd_deg": False, "sd_mm": True}
"""Keys of the prior that name numbers, and whether these are lengths."""


class PriorSettings(Settings):
    """[identification.prior]: how far from nominal the numbers may be, before any measurement.

    Standard deviations; a table with no key in it is the weak prior.
    """

    angles_deg: Spread = 0.1
    """Angles of the links."""
    lengths_mm: Spread = 0.6
    """Lengths of the links."""
    frame_angles_deg: Spread = 0.1
    """Rotation of base and tool, per axis."""
    frame_lengths_mm: Spread = 1.0
    """Position of base and tool, per axis."""
    gravity_mdeg: Spread = 50.0
    """Coefficients of sag; only a model with joint errors has them."""
    harmonics_mdeg: tuple[Spread, Spread] = (20.0, 12.0)
    """Coefficients of once and twice a turn, likewise; a quarter of it at the level of small waves.
    From three waves a turn on a chosen model believes in 6 mdeg, in a joint map in 3."""
    sd_deg: Named = Field(default_factory=dict)
    """Single numbers by name, angles: `alpha2 = 0.01`."""
    sd_mm: Named = Field(default_factory=dict)
    """Single numbers by name, lengths: `"base.x" = 5.0`."""


class IdentificationSettings(Settings):
    """[identification]: what the estimators may move, and how the default one works."""

    free: str | tuple[str, ...] = "identifiable"
    """"identifiable", a free set of the robot, or parameter names."""
    base: Literal["free", "fixed"] = "free"
    """Whether the base frame is identified or held at its nominal place."""
    tool: Literal["free", "fixed"] = "free"
    """The same of the tool frame."""
    estimators: Annotated[tuple[Literal["whitened", "paper"], ...], Field(min_length=1)] = (
        "whitened",
        "paper",
    )
    """The weighted fit of all identifiable numbers, and the paper's unweighted one."""
    model: Literal["geometric", "extended", "choose"] = "geometric"
    """Of the default estimator: geometry alone, with sag and two waves a turn, or what the readings
    choose, up to a map of every joint, its play, and the gears that the scene states."""
    loss: Literal["squared", "huber", "cauchy"] = "squared"
    """Of the default estimator: how much a shot counts that lies far off."""
    prior: PriorSettings | None = None
    """Of the default estimator. Without this table the geometric model has no prior, and one with
    joint errors the weak one."""


PAPER_SET = "wen2022"
"""Name of the free set that the paper's estimator identifies."""
