"""Where the poses on either side of a step lie: whether a misfit that follows them may look alike.

A side is a boolean array over rows in order of time: those that a step displaces, and the others.
"""

import numpy as np

from calib.arrays import Array, Bool
from calib.identification.start.on_a_line import extents_told
from calib.measurement.observations import POINT, Measurements

JUMP = 0.25
"""Part of all that a joint moves which no pose may leave out at such a step: misfit follows the
poses, and jumps with them. The widest gap of sixteen at random in order is 0.22 in the mean ((1 +
1/2 + ... + 1/15) / 15)."""
APART = 4.0
"""Standard errors between the means of a joint before and after the step, from which the poses lie
elsewhere: there, model misfit looks like a step. For a load and another robot, which follow the
poses, between the mean squares, too."""
ALIKE = 0.05
"""Part of a displacement by which it may differ between readings of one place and still move it as
a whole: an arm that misses the place by a centimeter turns by 2 % of half a meter more or less."""


def come_again(rows: Measurements, side: Bool) -> int:
    """Number of poses that were measured on either side."""
    return len(np.intersect1d(rows.pose_id[side], rows.pose_id[~side]))


def seen_once(rows: Measurements, side: Bool) -> float:
    """Part of the rows that one shot of each target is, at each pose on either side."""
    seen = np.column_stack([rows.pose_id, rows.target_key, side])
    return len(np.unique(seen, axis=0)) / len(rows)


def at_one_place(rows: Measurements, side: Bool) -> bool:
    """Whether all that was seen on one side is one place within its noise.

    A step of the station, another load, or another arm, would be free to put it anywhere: what
    lengths the readings tell is lost, and a place whose coordinates are wrong looks alike.
    """
    return any(_one_place(rows, part) for part in (side, ~side))


def moves_one_place(rows: Measurements, side: Bool, plain: Array) -> bool:
    """Whether a change moves all that was seen on one side alike, and that is one place.

    As the first joint does, which turns the arm about its base: a step of it is one of the base.
    Further joints displace a place the more, the further from their axes it was reached.

    Parameters
    ----------
    rows : Measurements
        (m,) rows in order of time.
    side : (m,) array of bool
        Those that a step displaces.
    plain : (m, 6, k) array
        Derivative of the rows by the change.
    """

    def is_alike(part: Bool) -> bool:
        seen = plain[part, :3].reshape(int(part.sum()), -1)
        off = np.linalg.norm(seen - np.median(seen, axis=0), axis=1)
        # a touch beside its place, or its joints misread, is moved differently
        return bool(np.median(off) <= ALIKE * np.median(np.linalg.norm(seen, axis=1)))

    return any(is_alike(part) and _one_place(rows, part) for part in (side, ~side))


def _one_place(rows: Measurements, part: Bool) -> bool:
    """Whether all points of a part of the rows lie at one place within their noise."""
    there = rows.rows(np.flatnonzero(part))
    return bool((there.kind == POINT).all()) and extents_told(there) == 0


def jumps(rows: Measurements, side: Bool) -> bool:
    """Whether some joint goes across a wide gap, for good, where one side ends."""
    inside, others = rows.q[side], rows.q[~side]
    gap = np.maximum(
        inside.min(axis=0) - others.max(axis=0), others.min(axis=0) - inside.max(axis=0)
    )
    return bool((gap > JUMP * np.ptp(rows.q, axis=0)).any())


def elsewhere(rows: Measurements, side: Bool, *, spread: bool = False) -> bool:
    """Whether the mean of some joint differs between the poses of one side and those of the other.

    With `spread` also how far it goes from its mean: what follows the poses, as misfit does, would
    look like that.
    """
    q = rows.q
    if spread:
        q = np.hstack([q, (q - np.unique(q, axis=0).mean(axis=0)) ** 2])
    # poses that come again after the step stand on both sides of it
    one, other = np.unique(q[~side], axis=0), np.unique(q[side], axis=0)
    if min(len(one), len(other)) < 2:
        return True
    noise = one.var(axis=0, ddof=1) / len(one) + other.var(axis=0, ddof=1) / len(other)
    gap = np.abs(one.mean(axis=0) - other.mean(axis=0))
    return bool((gap > APART * np.sqrt(noise)).any())
