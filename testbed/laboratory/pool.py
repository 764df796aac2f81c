"""Candidate poses: drawn in the joint limits, kept if in the box, hitting nothing and seen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index, frozen
from calib.errors import refuse
from calib.geometry.frames import inverse, target_points
from calib.shown import Shown
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import Robot
from testbed.scenario.tables import PoolSettings

SAME = 1e-7
"""Joint vectors nearer than this in every joint are one pose: a table keeps it [rad, m]."""
BOX, LIMITS, CONE, ITSELF, FLOOR, OBSTACLE, SIGHT = range(7)
REASONS = (
    "outside the box",
    "joint limits",
    "acceptance cone",
    "self-collision",
    "floor",
    "obstacle",
    "line of sight",
)
"""Why a candidate is rejected, in the order of the tests; the first that applies counts."""
REMEDIES = (
    "move box_center_mm into the robot's reach or enlarge box_size_mm",
    "lower joint_margin_deg",
    "move [tracker] station_mm in front of the probe, or raise acceptance_deg",
    "move the box away from the robot's own body, or write self_collision = false",
    "raise the box above the floor",
    "move the box away from the [[cell.obstacle]] tables, or them away from the robot",
    "move [tracker] station_mm, or write line_of_sight = false",
)
SAMPLE = 100
"""Rejected candidates kept for each reason, so that rare reasons can be looked at too."""
PARTS = 10
"""In which a block of candidates is simulated."""
AT_ONCE = 4000
"""Candidates whose poses are held at once."""
PATIENCE = ((200_000, 1e-4), (4_000, 1e-2))
"""After so many candidates (drawn; in the box), give up below this feasible share."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PosePool(Shown):
    """Feasible joint vectors, and what was thrown away on the way to them."""

    q: Array
    """(N, n) feasible joints, in the order they were drawn [rad, m]."""
    T: Array
    """(N, 4, 4) their nominal tool poses in the world [m]."""
    rejected_q: Array
    """(R, n) the first rejected candidates of each reason, at most 100 each [rad, m]."""
    rejected_reason: tuple[str, ...]
    """(R,) why, from `rejection_names`."""
    rejection_names: tuple[str, ...]
    """(k,) reasons, in the order of the tests: all but those of things the scene has not."""
    rejection_counts: Index
    """(k,) candidates rejected for each reason, the first that applied."""
    n_drawn: int
    """Candidates up to the last one kept: N plus all rejections."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Where poses are drawn from, and the tests each must pass.

    A candidate is uniform in the joint ranges. It is kept if its nominal tool lies in the box, its
    joints keep their margin, the target faces the tracker, the robot hits neither itself nor the
    floor (both under `self_collision`) nor an obstacle of the simulator, and the tracker sees the
    target.
    """

    robot: Robot
    """Nominal robot and its limits."""
    simulator: Simulator
    """Of the robot's nominal chain, with its parts."""
    settings: PoolSettings
    """Box, margin and tests."""
    station: ArrayLike
    """(3,) where the beam starts, in the world [m]."""
    aim: ArrayLike = (0.0, 0.0, 0.0)
    """(3,) target in the tool frame [m]."""
    acceptance: float = np.pi
    """Half angle of the cone about the tool's z axis in which the tracker must stand, seen from the
    target [rad]; pi: anywhere."""
    others: tuple[tuple[Array, Array], ...] = ()
    """Further places (3,) with their targets (3,): what one of all faces and sees can be measured
    [m]."""

    def draw(
        self, rng: np.random.Generator, *, size: int | None = None, exclude: Array | None = None
    ) -> PosePool:
        """Draw feasible poses; the held-out ones come from here too, with their own `rng`.

        Candidates come in blocks of four per pose wanted.

        Parameters
        ----------
        rng : Generator
            Candidates.
        size : int, optional
            Poses wanted; the size in the settings by default.
        exclude : (k, n) array, optional
            Joint vectors that must not come again, to within 1e-7 rad or m: the pool, when held-out
            poses are drawn.

        Raises
        ------
        InputError
            If feasible poses are so rare that something is set wrong; names the test that lets
            least pass.

        References
        ----------
        The box is that of Wen et al. 2022, 900 x 1200 x 800 mm; with all tests off the draw is
        plain rejection sampling in joint space.
        """
        robot, wanted = self.robot, self.settings.size if size is None else size
        taken = np.zeros((0, len(robot.limits))) if exclude is None else np.asarray(exclude)
        lower, upper = joint_ranges(robot, self.settings).T
        blocks: list[Array] = []
        faults: list[Index] = []
        rejected, drawn = np.zeros(len(REASONS), dtype=np.int64), 0
        while drawn - rejected.sum() < wanted:
            block = rng.uniform(lower, upper, (4 * wanted, len(lower)))
            block = robot.controller.holding(block)
            block = block[is_new(block, taken)]
            some = np.array_split(block, 1 + len(block) // AT_ONCE)
            near = np.concatenate([self._cheap_fault(each) for each in some])
            # in order: nothing is simulated behind the last one wanted but the rest of its part
            parts = (np.array_split(each, PARTS) for each in (block, near))
            for part, reason in zip(*parts, strict=True):
                blocks.append(part)
                faults.append(self._simulated_fault(part, reason))
                rejected, drawn = rejected + counts(faults[-1]), drawn + len(part)
                if drawn - rejected.sum() >= wanted:
                    break
            _check_patience(rejected, drawn, wanted)
        q, reason = np.concatenate(blocks), np.concatenate(faults)
        end = np.flatnonzero(reason < 0)[wanted - 1] + 1
        q, reason = q[:end], reason[:end]
        apply = self._applying()
        sample = np.concatenate([np.flatnonzero(reason == k)[:SAMPLE] for k in range(len(REASONS))])
        kept = frozen(q[reason < 0])
        return PosePool(
            q=kept,
            T=frozen(robot.model.poses(kept)),
            rejected_q=frozen(q[sample]),
            rejected_reason=tuple(REASONS[k] for k in reason[sample]),
            rejection_names=tuple(REASONS[k] for k in apply),
            rejection_counts=frozen(counts(reason)[apply], np.int64),
            n_drawn=int(end),
        )

    def first_fault(self, q: Array, *, box: bool = True) -> Index:
        """Index (m,) into `REASONS` of the first test each pose q (m, n) fails, -1 if none.

        Cheap tests first; a later test looks only at what the earlier ones left. Without `box` the
        tool may be anywhere.
        """
        return self._simulated_fault(q, self._cheap_fault(q, box=box))

    def _cheap_fault(self, q: Array, *, box: bool = True) -> Index:
        """The same (m,) of the tests that arrays make."""
        reason = np.full(len(q), -1, dtype=np.int64)
        if box:
            reason[~self._in_box(q)] = BOX
        reason[(reason < 0) & ~self._keeps_margin(q)] = LIMITS
        left = np.flatnonzero(reason < 0)
        reason[left[~self.faces(q[left])]] = CONE
        return reason

    def _simulated_fault(self, q: Array, reason: Index) -> Index:
        """The same after all tests, from what cheap ones say: a robot stands at what is left."""
        settings = self.settings
        if settings.self_collision or self.simulator.obstacles:
            left = np.flatnonzero(reason < 0)
            itself, floor, obstacle = self.simulator.contacts(q[left])
            reason[left[obstacle]] = OBSTACLE
            if settings.self_collision:
                reason[left[floor]] = FLOOR
                reason[left[itself]] = ITSELF
        if settings.line_of_sight:
            left = np.flatnonzero(reason < 0)
            reason[left[~self.sees(q[left])]] = SIGHT
        return reason

    def faces(self, q: Array) -> Bool:
        """Whether (m,) a tracker stands in the cone about the tool's z axis."""
        if self.acceptance >= np.pi:
            return np.ones(len(q), dtype=bool)
        T = self.robot.model.poses(q)
        return np.asarray(np.any([self._in_cone(T, *view) for view in self._views], axis=0))

    def sees(self, q: Array) -> Bool:
        """Whether (m,) nothing stands between a tracker and the target that faces it."""
        if not self.others:
            return self.simulator.sees(q, self.station, self.aim)
        out, T = np.zeros(len(q), dtype=bool), self.robot.model.poses(q)
        for view in self._views:
            left = np.flatnonzero(~out & self._in_cone(T, *view))
            out[left] = self.simulator.sees(q[left], *view)
        return out

    def measurable(self, q: Array) -> Bool:
        """Whether (m,) a tracker faces its target, and sees it where sight is tested."""
        out = self.faces(q)
        if self.settings.line_of_sight:
            left = np.flatnonzero(out)
            out[left] = self.sees(q[left])
        return out

    @property
    def _views(self) -> tuple[tuple[ArrayLike, ArrayLike], ...]:
        """Every place with its target."""
        return ((self.station, self.aim), *self.others)

    def _in_cone(self, T: Array, station: ArrayLike, aim: ArrayLike) -> Bool:
        """Whether (m,) a place is in the cone of its target on tools T (m, 4, 4)."""
        if self.acceptance >= np.pi:
            return np.ones(len(T), dtype=bool)
        beam = np.asarray(station) - target_points(T, np.asarray(aim))
        along = np.einsum("mi,mi->m", T[:, :3, 2], beam)
        return np.asarray(along >= np.cos(self.acceptance) * np.linalg.norm(beam, axis=1))

    def _in_box(self, q: Array) -> Bool:
        """Whether (m,) the nominal tool lies in the box, which is fixed to the base frame."""
        model = self.robot.model
        T = inverse(model.chain.T_world_base) @ model.poses(q)
        center = np.array(self.settings.box_center_mm) / 1e3
        half = np.array(self.settings.box_size_mm) / 2e3
        return np.asarray((np.abs(T[:, :3, 3] - center) < half).all(axis=1))

    def _keeps_margin(self, q: Array) -> Bool:
        """Whether (m,) every revolute joint keeps the margin from its limits, arm's and J's."""
        turns = 1 - self.robot.model.chain.prismatic
        margin = np.radians(self.settings.joint_margin_deg) * turns
        lower, upper = self.robot.limits.T
        inside = ((q >= lower + margin) & (q <= upper - margin)).all(axis=1)
        return np.asarray(inside & ~self.robot.controller.beyond(q, margin).any(axis=1))

    def _applying(self) -> list[int]:
        """Tests that can reject: that of the cone and that of obstacles only if there are any."""
        off = {CONE} if self.acceptance >= np.pi else set()
        off |= set() if self.simulator.obstacles else {OBSTACLE}
        return [k for k in range(len(REASONS)) if k not in off]


def joint_ranges(robot: Robot, settings: PoolSettings) -> Array:
    """Lower and upper joint values (n, 2) between which postures are drawn [rad, m]."""
    if not settings.joint_ranges_deg:
        return robot.limits
    scale = np.where(robot.model.chain.prismatic, 1e-3, np.pi / 180)
    return np.asarray(settings.joint_ranges_deg) * scale[:, None]


def is_new(q: Array, taken: Array) -> Bool:
    """Whether (m,) joint vectors q (m, n) differ from all of `taken` (k, n) in some joint."""
    if not len(taken):
        return np.ones(len(q), dtype=bool)
    from scipy.spatial import KDTree  # loads much, and only drawing asks for it

    distance, _ = KDTree(taken).query(q, p=np.inf, distance_upper_bound=SAME)
    return np.asarray(np.isinf(distance))


def counts(reason: Index) -> Index:
    """Candidates (7,) rejected for each reason."""
    return np.bincount(reason[reason >= 0], minlength=len(REASONS)).astype(np.int64)


def _check_patience(rejected: Index, drawn: int, wanted: int) -> None:
    """Raise if feasible candidates are too rare to go on."""
    feasible = drawn - int(rejected.sum())
    entered = drawn - np.concatenate([[0], np.cumsum(rejected)[:-1]])  # each of the tests
    hopeless = any(
        n >= patience and feasible < share * n
        for n, (patience, share) in zip((drawn, int(entered[LIMITS])), PATIENCE, strict=True)
    )
    if feasible >= wanted or not hopeless:
        return
    # the test that lets the smallest share pass, not the first one, which sees them all
    worst = int(np.argmax(rejected / np.maximum(entered, 1)))
    allowed = f'the test "{REASONS[worst]}" rejects {rejected[worst]} of {entered[worst]}'
    message = f"[pool] only {feasible} of {wanted} poses are feasible after {drawn} draws"
    raise refuse("pool", feasible, allowed, code="S37", message=message, fix=REMEDIES[worst])
