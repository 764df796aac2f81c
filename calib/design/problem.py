"""A checked design problem: pool, number of poses, criterion, and the information known before."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index, check, is_whole, require_kind
from calib.design.blocks import (
    HUGE,
    has_full_rank,
    identifiable_blocks,
    information,
    most_of_one,
    prior_rows,
    unitless_rank,
    unobservable_in_words,
)
from calib.design.places import LARGER_POOL, array_of, mask_of, places_of, poses_wanted
from calib.design.places import NO_POSES as NO_POSES
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from calib.information.criteria.base import Criterion, Pool
from calib.information.criteria.named import criterion_named
from calib.information.goals import goal_matrix
from calib.kinds import in_short
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class Problem(Shown):
    """Choose m poses of a pool, beside those already measured, that optimize a criterion.

    Made by `of_blocks` or `of_poses`, which check it; all methods of design trust it.
    """

    pool: Pool
    """Blocks of the candidate poses."""
    m: int
    """Number of poses to choose."""
    criterion: Criterion
    """What is optimized."""
    before: Array
    """(b, p) rows that carry the prior precision and the poses already measured."""
    base: Array
    """(p, p) information of these rows."""
    open: Bool
    """(N,) poses that may be chosen."""
    repeats: bool
    """Whether a pose may be chosen more than once."""
    given: Index
    """(k,) indices of poses already measured; not counted in m."""
    prior: bool
    """Whether there is a prior precision."""
    fewest: int
    """Fewest poses that can determine all numbers."""
    names: tuple[str, ...] = ()
    """(p,) names of the numbers, for messages; may be empty."""

    def __repr__(self) -> str:
        pool = f"{self.m} of {int(self.open.sum())} poses"
        return f"Problem({pool}, {self.p} numbers, by {self.criterion.name})"

    @classmethod
    @in_short
    def of_blocks(
        cls,
        blocks: ArrayLike,
        poses: int,
        criterion: str | Criterion,
        *,
        prior: ArrayLike | None = None,
        given: ArrayLike = (),
        allowed: ArrayLike | None = None,
        repeats: bool = False,
        names: Sequence[str] = (),
    ) -> "Problem":
        """A problem from whitened blocks, checked before anything is computed.

        Parameters
        ----------
        blocks : (N, r, p) array_like
            Whitened, scaled rows of each candidate pose.
        poses : int
            Number of poses to choose.
        criterion : str or Criterion
            Name, or a criterion; V and G, which need goals, as a criterion only.
        prior : (p, p) array_like, optional
            Precision of the scaled numbers before any measurement, plus B'B of poses outside the
            pool that are already measured.
        given : (k,) array_like of int
            Poses of the pool already measured: counted in M, not in `poses`, and not chosen again
            unless `repeats`.
        allowed : (N,) array_like of bool, optional
            Poses that may be chosen.
        repeats : bool
            Whether a pose may be chosen more than once.
        names : sequence of p str
            Names of the numbers, for the messages.

        Raises
        ------
        InputError
            A1, A3: a shape or value is wrong; M27: so many poses cannot be chosen, or cannot
            determine p numbers; M28: not even all poses determine them; M29: no goals.
        """
        criterion = criterion_named(criterion)
        require_kind("repeats", repeats, bool, "True or False")
        (blocks,) = check("N r p", blocks=blocks)
        n, _, p = blocks.shape
        if not blocks.size:
            shape = f"blocks has shape {blocks.shape}"
            raise refuse("blocks", allowed="none may be 0", code="A1", message=shape)
        size = np.abs(blocks).max(axis=(0, 1))
        if (size > HUGE).any() or ((size > 0) & (size < 1 / HUGE)).any():
            at = float(size[np.argmax(np.abs(np.log(np.where(size > 0, size, 1.0))))])
            raise refuse(
                "blocks",
                at,
                f"sizes from {1 / HUGE:g} to {HUGE:g}, or 0: squares of squares are computed",
                code="A3",
                message=f"blocks holds numbers of the size {at:g}",
                fix="choose other units of the numbers",
            )
        if criterion.n_numbers not in (None, p):
            raise refuse(
                "criterion",
                criterion.n_numbers,
                f"the blocks have {p}",
                code="A1",
                message=f"the goal is made for {criterion.n_numbers} numbers",
                fix="make goal and blocks from the same free numbers",
            )
        names = tuple(names) if isinstance(names, Iterable) else (names,)
        if len(names) not in (0, p) or not all(isinstance(name, str) for name in names):
            wanted = f"one for each of {p} numbers, or none"
            raise refuse("names", len(names), wanted, code="A1", message=f"{len(names)} names")
        measured, may = places_of(given, n), mask_of(allowed, n)
        if not repeats:
            may[measured] = False
        before = np.concatenate([prior_rows(prior, p), blocks[measured].reshape(-1, p)])
        problem = cls(
            pool=Pool(blocks),
            m=poses,
            criterion=criterion,
            before=before,
            base=np.asarray(before.T @ before),
            open=may,
            repeats=repeats,
            given=measured,
            prior=prior is not None,
            fewest=max(-(-(p - unitless_rank(before)) // most_of_one(blocks[may])), 1),
            names=names,
        ).resize(poses)
        rows = np.concatenate([before, blocks[may].reshape(-1, p)])
        if not has_full_rank(rows):
            raise refuse(
                "blocks",
                allowed=unobservable_in_words(rows, names),
                code="M28",
                message=f"even all {may.sum()} poses cannot tell the {p} numbers apart",
                fix="reduce the free numbers first (calib.information.reduction)",
            )
        return problem

    @classmethod
    @in_short
    def of_poses(
        cls,
        model: RobotModel,
        pool_q: ArrayLike,
        *,
        poses: int,
        criterion: str | Criterion = "D",
        goals: ArrayLike | None = None,
        noise: ArrayLike = (1e-5, 1e-5 / CHARACTERISTIC_LENGTH),
        target: ArrayLike = (0.0, 0.0, 0.0),
        free: Iterable[str] | None = None,
        given: ArrayLike = (),
        allowed: ArrayLike | None = None,
        repeats: bool = False,
    ) -> "Problem":
        """A problem from joint values; numbers that the pool cannot determine are held fixed.

        Parameters
        ----------
        model : RobotModel
            Nominal model.
        pool_q : (N, n) array_like
            Joint values of the candidate poses [rad, m].
        poses, given, allowed, repeats
            As in `of_blocks`.
        criterion : str or Criterion
            Name, or a criterion.
        goals : (g, n) array_like, optional
            Joint values at which the tool must be right, for V and G [rad, m]; the pool must
            determine all that moves the tool there.
        noise : array_like
            Of the instrument that will measure: standard deviations of position and rotation of
            full poses (2,) [m, rad]; of points one number, or a covariance (3, 3), as `sd` of
            `calib.points`; and all others of `calib.design.blocks.identifiable_blocks`.
        target : (3,) array_like
            Tool point in the tool frame [m]: where the tool must be right at the goals, and if
            only points are measured, where the reflector is.
        free : iterable of str, optional
            Names of the numbers to identify; by default all of the model.
        """
        blocks, parameters = identifiable_blocks(
            model, pool_q, noise, free, goals=goals, target=target
        )
        wanted = None
        if goals is not None:
            wanted = goal_matrix(model, goals, parameters, target=target)
        return cls.of_blocks(
            blocks,
            poses,
            criterion_named(criterion, goals=wanted),
            given=given,
            allowed=allowed,
            repeats=repeats,
            names=parameters.free_names,
        )

    @property
    def blocks(self) -> Array:
        """(N, r, p) blocks of the pool."""
        return self.pool.blocks

    @property
    def p(self) -> int:
        """Number p of parameters to determine."""
        return int(self.blocks.shape[2])

    @property
    def n_poses(self) -> int:
        """Total number of poses: chosen and given."""
        return self.m + len(self.given)

    @in_short
    def information(self, chosen: ArrayLike) -> Array:
        """Information M (p, p) of a set (m,), summed afresh, with that known before."""
        return self.base + information(self.blocks[np.asarray(chosen, dtype=np.int64)])

    @in_short
    def rows(self, chosen: ArrayLike) -> Array:
        """Rows (n, p) whose products are that M, for work that must not square them."""
        A = self.blocks[np.asarray(chosen, dtype=np.int64)].reshape(-1, self.p)
        return np.concatenate([self.before, A])

    @in_short
    def is_singular(self, chosen: ArrayLike) -> bool:
        """Whether a set, with the information known before, leaves a direction undetermined."""
        return not has_full_rank(self.rows(chosen))

    @in_short
    def addable(self, chosen: ArrayLike) -> Bool:
        """Mask (N,) of poses that may be added to a set."""
        free = self.open.copy()
        if not self.repeats:
            free[np.asarray(chosen, dtype=np.int64)] = False
        return free

    @in_short
    def require_set(self, chosen: ArrayLike, field: str) -> Index:
        """Checked indices (m,) of a set; an `InputError` (A3) unless it is one of this problem."""
        places = array_of(chosen)
        sound = places.shape == (self.m,) and np.issubdtype(places.dtype, np.integer)
        if sound:
            sound = bool(((places >= 0) & (places < len(self.pool))).all())
        if sound:
            twice = not self.repeats and len(np.unique(places)) < len(places)
            sound = not twice and bool(self.open[places].all())
        if not sound:
            kind = "numbers" if self.repeats else "different numbers"
            last = len(self.pool) - 1
            allowed = f"{self.m} {kind} from 0 to {last}, of poses that may be chosen"
            message = f"{field} is not a set of places in the pool"
            raise refuse(field, allowed=allowed, code="A3", message=message)
        return np.asarray(places, dtype=np.int64)

    def resize(self, poses: int) -> "Problem":
        """The same problem for another number of poses; an `InputError` (M27) if not possible."""
        free, n, p = int(self.open.sum()), len(self.pool), self.p
        if not is_whole(poses) or poses < 1:
            raise poses_wanted(poses, "a whole number, at least 1", "" if free else LARGER_POOL)
        if not free or (poses > free and not self.repeats):
            some = "" if free == n else f", of which {free} may be chosen"
            raise poses_wanted(poses, f"the pool has {n}{some}", LARGER_POOL)
        if poses < self.fewest:
            candidates = self.blocks[self.open]
            allowed = f"{p} numbers need at least {self.fewest} poses of {candidates.shape[1]} rows"
            if self.names:
                most = unitless_rank(self.before) + poses * most_of_one(candidates)
                rows = np.concatenate([self.before, *candidates[:poses]])
                allowed += f"; {poses} leave at least {p - most} directions unseen, such as: "
                allowed += unobservable_in_words(rows, self.names)
            raise poses_wanted(poses, allowed, "choose more poses or free fewer numbers")
        return replace(self, m=int(poses))
