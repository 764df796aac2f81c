"""A design problem, checked: the pool, how many poses, for what, and what is known before."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index, check, frozen
from calib.design.blocks import directions_seen, information, most_of_one, sees_all, unseen_in_words
from calib.errors import InputError
from calib.information.criteria.base import Criterion, Pool
from calib.information.criteria.named import criterion_named

NO_POSES = frozen(np.zeros(0), np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Choose m poses of a pool, beside those already measured, so that a criterion is best."""

    pool: Pool
    m: int
    criterion: Criterion
    before: Array
    """(b, p) rows worth the prior precision and the poses already measured."""
    base: Array
    """(p, p) their information."""
    open: Bool
    """(N,) poses that may be chosen."""
    repeats: bool
    """Whether a pose may be chosen more than once."""
    given: Index
    """Poses of the pool already measured; not counted in m."""
    prior: bool
    """Whether there is a prior precision."""

    @property
    def blocks(self) -> Array:
        """(N, r, p) blocks of the pool."""
        return self.pool.blocks

    @property
    def p(self) -> int:
        """Numbers to tell apart."""
        return int(self.blocks.shape[2])

    @property
    def n_poses(self) -> int:
        """Poses measured in the end."""
        return self.m + len(self.given)

    def information(self, chosen: ArrayLike) -> Array:
        """M (p, p) of a set, summed afresh, with all that is known before."""
        return self.base + information(self.blocks[np.asarray(chosen, dtype=np.int64)])

    def rows(self, chosen: ArrayLike) -> Array:
        """Rows behind that M: no update, no squaring."""
        A = self.blocks[np.asarray(chosen, dtype=np.int64)].reshape(-1, self.p)
        return np.concatenate([self.before, A])

    def is_singular(self, chosen: ArrayLike) -> bool:
        """Whether a set, with all that is known before, leaves a direction unseen."""
        return not sees_all(self.rows(chosen))

    def addable(self, chosen: ArrayLike) -> Bool:
        """Poses (N,) that may join a set."""
        free = self.open.copy()
        if not self.repeats:
            free[np.asarray(chosen, dtype=np.int64)] = False
        return free

    def checked_set(self, chosen: ArrayLike, field: str) -> Index:
        """Places (m,) of a set that the caller names, after refusing what is none."""
        places = np.asarray(chosen)
        sound = places.shape == (self.m,) and np.issubdtype(places.dtype, np.integer)
        if sound:
            sound = bool(((places >= 0) & (places < len(self.pool))).all())
        if sound:
            twice = not self.repeats and len(np.unique(places)) < len(places)
            sound = not twice and bool(self.open[places].all())
        if not sound:
            kind = "numbers" if self.repeats else "different numbers"
            raise InputError(
                f"{field} is not a set of places in the pool",
                code="A3",
                field=field,
                allowed=f"{self.m} {kind} from 0 to {len(self.pool) - 1}, of poses that may be "
                "chosen",
            )
        return np.asarray(places, dtype=np.int64)

    def sized(self, m: int) -> "Problem":
        """The same problem for another number of poses."""
        return replace(self, m=m)


def problem_of(
    blocks: ArrayLike,
    m: int,
    criterion: str | Criterion,
    *,
    prior: ArrayLike | None = None,
    given: ArrayLike = (),
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Problem:
    """Check a design problem before anything is computed.

    Parameters
    ----------
    blocks : (N, r, p) array_like
        Whitened, scaled rows of each candidate pose.
    m : int
        Poses to choose.
    criterion : str or Criterion
        Name, or a criterion made once (V and G need their goals).
    prior : (p, p) array_like, optional
        Precision of the scaled numbers before any measurement.
    given : (k,) array_like of int
        Poses of the pool already measured: counted in M, not in m, not chosen again unless
        `repeats`.
    allowed : (N,) array_like of bool, optional
        Poses that may be chosen.
    repeats : bool
        Whether a pose may be chosen more than once.
    names : sequence of p str
        Names of the numbers, for the messages.
    """
    criterion = criterion_named(criterion)
    (blocks,) = check("N r p", blocks=blocks)
    n, _, p = blocks.shape
    if not blocks.size:
        raise InputError(
            f"blocks has shape {blocks.shape}", code="A1", field="blocks", allowed="none may be 0"
        )
    if criterion.n_numbers not in (None, p):
        raise InputError(
            f"the goal is made for {criterion.n_numbers} numbers",
            code="A1",
            field="criterion",
            value=criterion.n_numbers,
            allowed=f"the blocks have {p}",
            fix="make goal and blocks from the same free numbers",
        )
    if len(names) not in (0, p):
        raise InputError(
            f"{len(names)} names",
            code="A1",
            field="names",
            value=len(names),
            allowed=f"one for each of {p} numbers, or none",
        )
    known = _places(given, n)
    free = _mask(allowed, n)
    if not repeats:
        free[known] = False
    prior_rows = _prior_rows(prior, p)
    before = np.concatenate([prior_rows, blocks[known].reshape(-1, p)])
    _check_size(m, int(free.sum()), n, repeats)
    _check_rank(blocks, m, before, free, names)
    return Problem(
        pool=Pool(blocks),
        m=int(m),
        criterion=criterion,
        before=before,
        base=np.asarray(before.T @ before),
        open=free,
        repeats=repeats,
        given=known,
        prior=prior is not None,
    )


def _places(given: ArrayLike, n: int) -> Index:
    """Places (k,) in a pool of n, after refusing what is none or comes twice."""
    places = np.asarray(given) if np.size(given) else NO_POSES
    whole = places.ndim == 1 and np.issubdtype(places.dtype, np.integer)
    if not whole or (places < 0).any() or (places >= n).any():
        raise InputError(
            "given is not a list of places in the pool",
            code="A3",
            field="given",
            allowed=f"numbers from 0 to {n - 1}",
        )
    unique, counts = np.unique(places, return_counts=True)
    if (counts > 1).any():
        twice = int(unique[np.argmax(counts > 1)])
        raise InputError(
            f"pose {twice} is given {counts.max()} times",
            code="M31",
            field="given",
            value=twice,
            allowed="each pose once",
            fix="remove the repetition, or put what it told into the prior",
        )
    return frozen(places, np.int64)


def _mask(allowed: ArrayLike | None, n: int) -> Bool:
    """Mask (n,) of poses that may be chosen."""
    free = np.ones(n, dtype=bool) if allowed is None else np.array(allowed)
    if free.shape != (n,) or free.dtype != np.bool_:
        raise InputError(
            f"allowed has shape {free.shape} of {free.dtype}",
            code="A1",
            field="allowed",
            allowed=f"true or false for each of {n} poses",
        )
    return free


def _prior_rows(prior: ArrayLike | None, p: int) -> Array:
    """Rows (k, p) whose information is the prior precision."""
    if prior is None:
        return np.zeros((0, p))
    (precision,) = check(f"{p} {p}", prior=prior)
    w, U = np.linalg.eigh((precision + precision.T) / 2)
    slack = p * np.finfo(np.float64).eps * max(np.abs(w).max(), np.finfo(np.float64).tiny)
    if np.abs(precision - precision.T).max() > 1e-9 * np.abs(precision).max() or w[0] < -slack:
        raise InputError(
            "prior is not a precision matrix",
            code="M34",
            field="prior",
            value=float(w[0]),
            allowed="symmetric, no negative eigenvalue",
        )
    kept = w > slack
    return np.asarray((U[:, kept] * np.sqrt(w[kept])).T)


def _check_size(m: int, free: int, n: int, repeats: bool) -> None:
    """Refuse a number of poses that the pool cannot give."""
    if m != int(m) or m < 1:
        raise InputError(
            f"{m} poses wanted",
            code="M27",
            field="m",
            value=m,
            allowed="a whole number, at least 1",
            fix="enlarge the pool or choose fewer poses" if not free else "",
        )
    if m > (free if not repeats else np.inf) or not free:
        pool = f"the pool has {n}" + ("" if free == n else f", of which {free} may be chosen")
        raise InputError(
            f"{m} poses wanted",
            code="M27",
            field="m",
            value=m,
            allowed=pool,
            fix="enlarge the pool or choose fewer poses",
        )


def _check_rank(blocks: Array, m: int, before: Array, free: Bool, names: Sequence[str]) -> None:
    """Refuse what leaves a direction unseen whatever is chosen."""
    _, r, p = blocks.shape
    candidates = blocks[free]
    each, missing = most_of_one(candidates), p - directions_seen(before)
    fewest = -(-missing // each)
    if m < fewest:
        seen = unseen_in_words(np.concatenate([before, *candidates[:m]]), names)
        raise InputError(
            f"{m} poses wanted",
            code="M27",
            field="m",
            value=m,
            allowed=f"{p} numbers need at least {fewest} poses of {r} rows"
            + (
                f"; {m} leave at least {missing - m * each} directions unseen, such as: {seen}"
                if names
                else ""
            ),
            fix="choose more poses or free fewer numbers",
        )
    rows = np.concatenate([before, candidates.reshape(-1, p)])
    if not sees_all(rows):
        raise InputError(
            f"even all {len(candidates)} poses cannot tell the {p} numbers apart",
            code="M28",
            field="blocks",
            allowed=unseen_in_words(rows, names),
            fix="reduce the free numbers first (calib.information.reduction)",
        )
