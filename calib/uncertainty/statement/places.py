"""Where targets lie against what was proven, in words: the same ones for every statement."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Bool, Labels
from calib.uncertainty.statement.applicability import (
    BEYOND,
    BEYOND_SLIDE,
    REFUSED,
    WARNED,
    Applicability,
    Proven,
)

PLACES = ("inside", "edge", "outside")
MEASURE = "measure 20 poses there, and hold them out"
"""What lets a statement reach where it does not."""
GROWN = "the region is grown"
"""Said of a target at the edge that what the model misses reaches more than others."""


def reasons(proven: Proven, reach: Applicability, q: Array) -> tuple[str, ...]:
    """What warns of each target, or refuses it; empty inside of what was proven.

    Parameters
    ----------
    proven : Proven
        Where the proof stands.
    reach : Applicability
        Of the targets, from `proven`.
    q : (N, n) array
        Their joints [rad, m].
    """
    slides = proven.wide.chain.prismatic > 0
    out = []
    for k, values in enumerate(q):
        told = []
        for name, value in (("transfer", reach.transfer[k]), ("leverage", reach.leverage[k])):
            if value > WARNED:
                limit = REFUSED if value > REFUSED else WARNED
                told.append(f"{name} {_short(float(value))} is above {limit:g}")
        if reach.growth[k] > WARNED and reach.place[k] == "edge":
            told.append(GROWN)
        told += [
            f"joint {j + 1} was never proven {_beyond(proven, int(j), values, slides)}"
            for j in np.flatnonzero(reach.beyond[k])
        ]
        out.append("; ".join(told))
    return tuple(out)


def place_words(place: Labels, noun: str, plural: str, names: Sequence[str] | None = None) -> str:
    """How many targets lie inside what was proven, at its edge, or outside, and which ones do.

    Parameters
    ----------
    place : (N,) array of str
        Inside, edge or outside.
    noun, plural : str
        What one and several are called.
    names : sequence of str, optional
        (N,) how each is called; numbers from 1 by default.

    Examples
    --------
    >>> place_words(np.array(["inside", "edge", "inside", "outside"]), "target", "targets")
    'of 4 targets, 2 lie inside what was proven, 1 at its edge (2), 1 outside (4)'
    """
    called = [str(k + 1) for k in range(len(place))] if names is None else list(names)
    parts = []
    for word, text in zip(
        PLACES, ("inside what was proven", "at its edge", "outside"), strict=True
    ):
        which = np.flatnonzero(place == word)
        if word == "inside" or len(which):
            some = "" if word == "inside" else f" ({_named([called[k] for k in which])})"
            lie = ("lies " if len(which) == 1 else "lie ") if word == "inside" else ""
            parts.append(f"{len(which)} {lie}{text}{some}")
    if len(place) == 1:
        where = dict(zip(PLACES, ("inside", "at the edge of", "outside"), strict=True))
        return f"the only {noun} lies {where[str(place[0])]} what was proven"
    return f"of {len(place)} {plural}, {', '.join(parts)}"


def room_words(kinds: Sequence[str]) -> str:
    """How far joints of these kinds may leave their ranges over the held-out poses.

    Examples
    --------
    >>> room_words(["revolute"] * 6), room_words(["prismatic"])
    ('10 deg', '50 mm')
    >>> room_words(["prismatic", "revolute"])
    '10 deg (turning) or 50 mm (sliding)'
    """
    slides = {kind == "prismatic" for kind in kinds}
    turn, way = f"{np.degrees(BEYOND):g} deg", f"{1e3 * BEYOND_SLIDE:g} mm"
    if len(slides) > 1:
        return f"{turn} (turning) or {way} (sliding)"
    return way if True in slides else turn


def steps_words(proven: Proven) -> str:
    """Which joints stood at steps only, and what no reading shows of them; empty where none did.

    Joints that kept the same step are named together.
    """
    slides, each = proven.wide.chain.prismatic > 0, dict[str, list[str]]()
    for j in np.flatnonzero(proven.step):
        text = step_words(float(proven.step[j]), bool(slides[j]))
        each.setdefault(text, []).append(str(j + 1))
    if not each:
        return ""
    stood = " and ".join(
        f"joint{'s' * (len(some) > 1)} {', '.join(some)} stood only at steps of {text}"
        for text, some in each.items()
    )
    return (
        f"{stood}: no reading shows an error that repeats with these steps, as that of a gear may, "
        "and the radius is for targets at these steps only; measure at values between them as well"
    )


def step_words(step: float, slide: bool) -> str:
    """A step of a joint, in its unit [rad, m].

    Examples
    --------
    >>> step_words(0.2617994, False), step_words(0.05, True)
    ('15 deg', '50 mm')
    """
    return f"{1e3 * step:.3g} mm" if slide else f"{np.degrees(step):.3g} deg"


def _named(names: Sequence[str]) -> str:
    """The first ten of some names, and how many more."""
    more = [f"{len(names) - 10} more"] if len(names) > 10 else []
    return ", ".join([*names[:10], *more])


def _beyond(proven: Proven, joint: int, q: Array, slides: Bool) -> str:
    """Beyond which end of its range over the held-out poses a joint goes."""
    low, high = proven.low[joint], proven.high[joint]
    if proven.between(q)[joint]:
        return f"between steps of {step_words(float(proven.step[joint]), bool(slides[joint]))}"
    side, end = ("below", low) if q[joint] < low else ("above", high)
    return f"{side} {1e3 * end:.0f} mm" if slides[joint] else f"{side} {np.degrees(end):.0f} deg"


def _short(value: float) -> str:
    """Two digits of a number above four."""
    return f"{value:.2g}" if value < 100 else f"{value:.0f}"
