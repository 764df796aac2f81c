"""Joints that turn with others, as drives that pass through each other make them."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import fdtrc

from calib.identification.fit_statistics import RED
from calib.identification.outliers.whitened import WhitenedRows
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict

EXPLAINED = 0.8
"""Fraction of the chi-square beyond noise that couplings must explain."""
ALIKE = 0.01
"""So much less of it may fewer couplings explain than more: the rest follow other misfit."""
WAVES = (1, 2)
"""Waves in a turn of the first joint by which the second may err instead, as by an eccentric."""
ODDS = 20.0
"""Odds from which that is ruled out."""


@dataclass(frozen=True, slots=True)
class Coupled:
    """Joints that turn by a part of another as well."""

    ratios: tuple[tuple[int, int, float], ...]
    """A joint, another that turns by a part of it, both from 0, and that part."""
    explained: float
    """Fraction of the chi-square beyond noise that this explains."""
    left: float
    """Chi-square that it leaves."""
    p_value: float
    """Probability of as large a drop by chance, for noise of any scale."""


def coupled(
    identification: Identification, table: Measurements, pairs: Iterable[tuple[int, int]]
) -> Coupled | None:
    """The couplings that explain what a fit misses; None if they explain too little of it.

    Parameters
    ----------
    identification : Identification
        Fit of all rows of `table`.
    table : Measurements
        Poses and points.
    pairs : iterable of tuple
        Joints that may be coupled, from 0: the second turns with the first.

    References
    ----------
    Fall of chi-square by columns q_a dT/dq_b beside the free numbers; F test with Bonferroni's
    factor for all sets of pairs. None, too, where BIC does not rule out waves cos(k q_a),
    sin(k q_a) of the same joints.
    """
    if table.is_distance.any():
        return None
    fit, names = WhitenedRows.of(identification, table), identification.parameters.names
    rows, pairs = predict(identification.model, table).rows, tuple(pairs)
    turned = {b: rows[:, :, names.index(f"theta{b + 1}")] for _, b in pairs}
    columns = {(a, b): turned[b] * table.q[:, a, None] for a, b in pairs}
    sets = [some for n in range(1, len(pairs) + 1) for some in combinations(pairs, n)]
    excess, found = fit.square - fit.freedom, list[Coupled]()
    for some in sets if excess > 0 else ():
        gain, told, change = fit.drop(np.stack([columns[pair] for pair in some], axis=2))
        freedom = fit.freedom - told
        if told < len(some) or freedom < 1 or gain < EXPLAINED * excess:
            continue
        rest = max(fit.square - gain, np.finfo(float).tiny)
        chance = float(fdtrc(told, freedom, gain / told / (rest / freedom))) * len(sets)
        if chance < RED:
            ratios = tuple((a, b, float(x)) for (a, b), x in zip(some, change, strict=True))
            found.append(Coupled(ratios, min(gain / excess, 1.0), rest, chance))
    most = max((one.explained for one in found), default=0.0)
    near = [one for one in found if one.explained > most - ALIKE]
    best = min(near, key=lambda one: (len(one.ratios), -one.explained), default=None)
    if best is None:
        return None
    for k in WAVES:
        waves = [
            turned[b] * wave(k * table.q[:, a, None])
            for a, b, _ in best.ratios
            for wave in (np.cos, np.sin)
        ]
        gain, told, _ = fit.drop(np.stack(waves, axis=2))
        rest = max(fit.square - gain, np.finfo(float).tiny)
        more = (told - len(best.ratios)) * np.log(fit.freedom)
        if fit.freedom * np.log(best.left / rest) > more - 2 * np.log(ODDS):
            return None
    return best
