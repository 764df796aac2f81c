"""Joints whose zeros a table has in another posture than the robot's file: by quarter turns.

A base in the world takes up the zero of a first joint that turns, and a tool that of the last one:
those of the joints between are left, four each. For six joints that is 256 combinations, and all of
them are tried; of more joints, those that differ by two joints at a time from the best so far.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from calib.arrays import Array, evenly
from calib.geometry.model import RobotModel
from testbed.files.alternatives import Alternative, Interpretation
from testbed.files.frames_fit import FAR, TIMES, fit_frames, flange_poses
from testbed.files.rows.counts import HERE
from testbed.units import listed

FEWEST = 12
"""Poses below which nothing is tried: of fewer, one of hundreds of combinations fits by chance."""
ROWS = 20
"""Poses by which combinations are compared."""
MOST = 256
"""Combinations up to which all are tried."""
BEAM, ROUNDS = 3, 4
"""Of more: how many are gone on from, and how often."""
QUARTER = np.pi / 2
ZEROS = "zeros"
"""Name of the alternative."""
Turns = tuple[int, ...]


def quarter_turns(
    model: RobotModel, read: Interpretation
) -> tuple[Alternative, Interpretation] | None:
    """The quarter turns of joint zeros that bring readings near the robot; None if none do.

    None as well where another combination comes nearly as near: it would be a guess.

    Parameters
    ----------
    model : RobotModel
        Nominal.
    read : Interpretation
        As the file was read.
    """
    n = model.chain.n_joints
    turning = np.flatnonzero(model.chain.prismatic == 0)
    inner = [int(j) for j in turning if 0 < j < n - 1]
    if not inner or len(np.unique(read.q, axis=0)) < FEWEST:
        return None
    rows = _some(read)
    scores = dict(_scores(model, rows, inner))
    plain = (0,) * len(inner)
    (best, least), *others = sorted(scores.items(), key=lambda one: one[1])
    second = others[0][1] if others else np.inf
    if best == plain or least > FAR or second < TIMES * least:
        return None
    turns = {j: (k if k < 3 else -1) for j, k in zip(inner, best, strict=True) if k}
    return _proposed(turns), _turned(read, inner, best)


def _some(read: Interpretation) -> Interpretation:
    """A few of the rows."""
    some = evenly(np.arange(len(read.q)), ROWS)
    rotation = None if read.rotation is None else read.rotation[some]
    return Interpretation(read.q[some], read.position[some], rotation)


def _turned(read: Interpretation, inner: Sequence[int], turns: Turns) -> Interpretation:
    """The same rows with some joints further by quarter turns."""
    further = np.zeros(read.q.shape[1])
    further[list(inner)] = QUARTER * np.array(turns)
    return replace(read, q=read.q + further)


def _scores(
    model: RobotModel, rows: Interpretation, inner: Sequence[int]
) -> Iterator[tuple[Turns, float]]:
    """Combinations of quarter turns of the inner joints, and what base and tool leave [m]."""

    def score(turns: Turns) -> float:
        q: Array = _turned(rows, inner, turns).q
        F = flange_poses(model, q)
        frames = fit_frames(F, rows.position, rows.rotation, one_valley=True)
        return frames.misfit(F, rows.position, rows.rotation).score

    if 4 ** len(inner) <= MOST:
        for turns in product(range(4), repeat=len(inner)):
            yield turns, score(turns)
        return
    known = {(0,) * len(inner): score((0,) * len(inner))}
    for _ in range(ROUNDS):
        ahead = sorted(known, key=lambda turns: known[turns])[:BEAM]
        new = {other for turns in ahead for other in _beside(turns)} - known.keys()
        if not new:
            break
        known |= {turns: score(turns) for turns in sorted(new)}
        if min(known.values()) <= FAR:
            break
    yield from known.items()


def _beside(turns: Turns) -> Iterator[Turns]:
    """All combinations that differ by one joint or two."""
    for a, b in combinations(range(len(turns)), 2):
        for further in product(range(4), repeat=2):
            other = list(turns)
            other[a], other[b] = (turns[a] + further[0]) % 4, (turns[b] + further[1]) % 4
            yield tuple(other)


def _proposed(turns: dict[int, int]) -> Alternative:
    """What they mean and what to do, for joints (from 0) further by so many quarter turns."""
    said = [f"joint {j + 1} by {90 * k:+d} deg" for j, k in turns.items()]
    columns = listed([f"{90 * k:+d} deg to q{j + 1}" for j, k in turns.items()])
    one = len(turns) == 1
    return Alternative(
        ZEROS,
        f"if the zeros of its joints are turned: {listed(said)}",
        f"add {columns} in the table; or, for a robot that counts so, to theta_deg of "
        f"{'that joint' if one else 'those joints'} {HERE}, and take it off "
        f"{'its' if one else 'their'} lower_deg and upper_deg",
        "M20",
        f"q{next(iter(turns)) + 1}",
    )
