"""What a calibration from measurements leaves behind: one frozen record, made of `records`."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from calib.arrays import LATER, Array, Bool, Index, wrong_shape
from calib.geometry.model import RobotModel
from calib.identification.fit_statistics import RED
from calib.identification.identify import Status
from calib.identification.outliers.moved import Moved
from calib.measurement.observations import Measurements
from calib.measurement.tool_target import ToolTarget
from calib.shown import ResultTable, Shown
from calib.uncertainty.drift.between_repeats import RepeatDrift
from calib.uncertainty.judgement import Judgement
from calib.uncertainty.statement.conditions import Conditions
from calib.uncertainty.statement.shared import SharedErrors
from testbed.files.conditions import SetUp
from testbed.files.visits.visit import RobotVisit
from testbed.identify.handback.handed import HandBack
from testbed.identify.records import (
    Choice,
    Figures,
    FittedModel,
    HeldOutSplit,
    Origin,
    OutlierRows,
    RowErrors,
)
from testbed.robots.robot import Reflector
from testbed.scenario.tolerance import Decision

FRAMES, MOUNTING, DRIVES, IN_TURN = "frames", "mounting", "drives", "in turn"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Calibration(Shown):
    """A robot calibrated from measurements."""

    source: Origin
    nominal: RobotModel
    """As the robot's maker describes it."""
    before: RobotModel
    """The nominal links with base, tool and fixtures fitted to the training rows."""
    limits: Annotated[Array, "n", 2]
    """(n, 2) least and largest joint values, as the maker gives them [rad, m]."""
    own_frames: bool
    """Whether the measuring frame is the world of the robot's file."""
    frames: tuple[str, ...]
    """How base, tool and fixtures were found, in words."""
    measurements: Measurements
    """Every valid row."""
    pose_names: tuple[str, ...]
    """By `pose_id`."""
    time: Annotated[Array, "m"] | None
    """(m,) [s]"""
    conditions: Conditions
    """Payload, tool and temperature of each row."""
    set_up: SetUp
    order_told_by: str
    """What tells the order of the rows in time; empty if nothing does."""
    repeatability: Annotated[Array, "n"]
    """(n,) standard deviation with which each joint comes back; zero where nothing tells it [rad,
    m]."""
    target: ToolTarget
    """The point of the tool that is stated."""
    decision: Decision | None
    """A tolerance and its rule, if one was stated."""
    reflector_names: tuple[str, ...]
    """Of the reflectors whose place was identified, as the session calls them."""
    stated_reflectors: tuple[Reflector, ...]
    """Those whose place in the tool frame the session states."""
    split: HeldOutSplit
    gross: OutlierRows
    before_misses: RowErrors
    before_train: Figures
    before_test: Figures | None
    fits: tuple[FittedModel, ...]
    """Geometric first."""
    choice: Choice
    proof: Judgement
    shared: SharedErrors | None
    """What all readings of the instrument share; None where the session states nothing of it."""
    handback: HandBack
    """Tolerances of the links, what held them, and the tool in use."""
    warnings: tuple[str, ...]
    """What was found on the way, beside what the source says."""
    visits: tuple[RobotVisit, ...] = ()
    """The sessions of the robot, those that identify first; none where there is one only."""
    visit: Annotated[Index, "m"] | None = None
    """(m,) which of them each row is of."""
    moved: Moved | None = None
    """What moved once between two rows that identify, if that explains their residuals."""
    repeats_drift: Annotated[RepeatDrift | None, LATER] = None
    """A drift that visits of the same poses show."""
    doubted: Annotated[tuple[str, ...], LATER] = ()
    """What readings contradict of the description, `FRAMES`, `MOUNTING`, `DRIVES`; or `IN_TURN`."""

    def __post_init__(self) -> None:
        rows = len(self.measurements)
        misses = {f"fits[{k}].misses": fit.misses for k, fit in enumerate(self.fits)}
        columns = {
            "time": self.time,
            "visit": self.visit,
            "payload": self.conditions.payload,
            "tool": self.conditions.tool,
            "temperature": self.conditions.temperature,
            "split.is_test": self.split.is_test,
            "gross.left_out": self.gross.left_out,
            **{
                f"{name}.position": one.position
                for name, one in {"before_misses": self.before_misses, **misses}.items()
            },
        }
        for name, values in columns.items():
            if values is not None and len(values) != rows:
                raise wrong_shape(name, np.shape(values), f"one for each of {rows} rows")
        joints, q = self.nominal.chain.n_joints, self.measurements.q
        if q.shape[1] != joints:
            raise wrong_shape("measurements.q", q.shape, f"one for each of {joints} joints")

    def __repr__(self) -> str:
        before = 1e3 * self.before_misses.position[self.is_judged].mean()
        after = 1e3 * self.fit.misses.position[self.is_judged].mean()
        where = "held-out" if self.split.is_test.any() else "training"
        return (
            f"Calibration({self.source.name!r} of {self.source.robot}: {before:.3g} -> {after:.3g} "
            f"mm at {where} rows, {self.choice.chosen} model; {self.proof!r})"
        )

    def tables(self) -> dict[str, ResultTable]:
        """``numbers`` as estimated, with the U that is stated; ``errors``, row by row."""
        fit = replace(self.fit.identification, covariance=self.covariance)
        role = np.select([self.split.is_test, self.is_used], ["test", "identify"], "left out")
        errors = {
            "pose": [self.pose_names[k] for k in self.measurements.pose_id],
            "role": role,
            "before_mm": 1e3 * self.before_misses.position,
            "after_mm": 1e3 * self.fit.misses.position,
        }
        return {"numbers": fit.tables()["numbers"], "errors": ResultTable(errors)}

    @property
    def fit(self) -> FittedModel:
        """The one chosen."""
        return next(fit for fit in self.fits if fit.model == self.choice.chosen)

    @property
    def is_used(self) -> Bool:
        """(m,) rows identified from."""
        return np.asarray(self.split.is_train & ~self.gross.left_out)

    @property
    def is_judged(self) -> Bool:
        """(m,) rows whose misses are shown: held-out ones, else those identified from."""
        return self.split.is_test if self.split.is_test.any() else self.is_used

    @property
    def converged(self) -> bool:
        """Whether every fit ended in a certified minimum."""
        return all(fit.identification.status is Status.CONVERGED for fit in self.fits)

    @property
    def elsewhere(self) -> bool:
        """Whether the held-out poses stand in another frame, and prove nothing."""
        frame = self.proof.frame
        return frame is not None and frame.found

    @property
    def unshown(self) -> bool:
        """Whether they do because no reading identified from shows a frame."""
        frame = self.proof.frame
        return frame is not None and frame.unshown

    @property
    def decidable(self) -> bool:
        """Whether a tolerance in the base can be decided on at all: readings show where it is."""
        return self.proof.belief is not None and not self.elsewhere and not self.relative

    @property
    def relative(self) -> bool:
        """Whether tool points are stated to each other: no reading shows where the robot is."""
        belief = self.proof.belief
        return belief is not None and belief.datum is not None

    @property
    def believable(self) -> bool:
        """Whether the stated region is believed, and held-out poses say something of it."""
        says = not (self.elsewhere or self.source.exact)
        return self.proof.trust.believe == "region" and says

    @property
    def settled(self) -> bool:
        """Whether the region is, and nothing that was found has to be settled before it is used."""
        return self.believable and self.moved is None and not self.doubted

    @property
    def is_stated(self) -> Bool:
        """(m,) rows whose poses the believed radius is of: held out, else identified from."""
        return self.is_used if self.elsewhere else self.is_judged

    @property
    def stated_q(self) -> Array:
        """(n, j) joints of these poses [rad, m]."""
        table = self.measurements.rows(self.is_stated)
        return np.asarray(table.q[np.unique(table.pose_id, return_index=True)[1]])

    @property
    def stated_poses(self) -> Index:
        """(n,) their numbers."""
        return np.unique(self.measurements.pose_id[self.is_stated])

    @property
    def refuted(self) -> bool:
        """Whether a test contradicts the interval from the parameters alone."""
        return self.proof.trust.refuted

    @property
    def not_linear(self) -> bool:
        """Whether nothing but virtual calibrations speaks against that interval."""
        lack, repeated = self.fit.identification.lack_of_fit, self.proof.bootstrap
        plain = lack is None or lack.p_value >= RED
        return self.refuted and plain and repeated is not None and not repeated.agrees

    @property
    def covariance(self) -> Array:
        """(f, f) of the numbers of the chosen fit: stated, unless one of the next two holds.

        Of virtual calibrations where these say that linear propagation does not hold, if they all
        settled; from the scatter of the residuals where the stated noise is refuted.
        """
        repeated = self.proof.bootstrap
        if repeated is not None and self.not_linear:
            settled = repeated.settled
            return repeated.empirical if settled else self.fit.identification.covariance
        return self.fit.scatter if self.refuted else self.fit.identification.covariance
