"""How long steps took: the last time on this machine, and where the program was made.

What was measured here lies in the user's cache folder. It decides nothing but what is said of the
time left: where it cannot be read or written, nobody is told.
"""

import json
import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from math import nan
from pathlib import Path
from statistics import median

from calib.errors import MachineError
from testbed.cli.course import Took

SHIPPED = Path(__file__).with_name("timings.json")
"""Made by ``python -m tests.timings``: seconds of the processor and pieces, by work and step."""
FILE = "timings.json"
FOLDER = "TRUEBED_CACHE"
"""Variable of the environment: another folder for the user's file; empty: nothing is kept."""
MOST_BYTES, MOST_WORKS = 1_000_000, 100
"""Of the user's file; what is older than these works is forgotten."""
Works = dict[str, dict[str, Took]]
"""Steps by work: ``run wen2022``."""


def expected(work: str, planned: Mapping[str, int] | None = None) -> dict[str, Took]:
    """What each step of a work may take here.

    Parameters
    ----------
    work : str
        The verb and what it is played on: ``run wen2022``.
    planned : mapping, optional
        Pieces of the steps that there will be, by name. Of a work that was never played, those with
        names that others have take what they take there; what is left takes the mean of the rest,
        and what is played in pieces is not known.

    Returns
    -------
    dict
        Empty where nothing is known.
    """
    there = {**own(), **{name: one for name, one in _here().items() if name not in own()}}
    steps, guessed = there.get(work), False
    if steps is None:
        guessed = True
        verb = work.partition(" ")[0]
        alike = [one for name, one in there.items() if name.partition(" ")[0] == verb]
        if not alike:
            return {}
        names = set(planned or ())
        steps = max(alike, key=lambda one: (len(names & set(one)), -len(set(one) - names)))
    if not planned:
        return dict(steps)
    others = [took for name, took in steps.items() if name not in planned]
    usual = Took(sum(one.seconds for one in others) / len(others) if others else 0.0)
    return {
        name: Took(nan, count) if guessed and count > 1 else steps.get(name, usual).scaled(count)
        for name, count in planned.items()
    }


def total(work: str) -> float | None:
    """Seconds that a work takes one process here; None where it was never played."""
    mine = own().get(work) if _as_shipped(work) else None
    steps = mine or _here().get(work)
    return None if steps is None else sum(took.seconds for took in steps.values())


def _as_shipped(work: str) -> bool:
    """Whether what was played here is no smaller or larger work of the same name."""
    mine, theirs = own().get(work, {}), shipped().get(work, {})
    return all(took.pieces == theirs.get(name, took).pieces for name, took in mine.items())


def lasts(work: str) -> str:
    """How long a work takes one process here, in words; a dash where nobody knows."""
    seconds = total(work)
    return "-" if seconds is None else in_words(seconds)


def in_words(seconds: float) -> str:
    """A duration for people, to about a twentieth.

    Examples
    --------
    >>> in_words(1.74), in_words(95.2), in_words(170), in_words(1234), in_words(9000)
    ('1.7 s', '95 s', '2.8 min', '21 min', '2.5 h')
    """
    if seconds < 99.5:
        return f"{max(seconds, 0.1):.{int(seconds < 9.95)}f} s"
    if seconds < 99.5 * 60:
        return f"{seconds / 60:.{int(seconds < 570)}f} min"
    return f"{seconds / 3600:.{int(seconds < 34200)}f} h"


def remember(work: str, took: Mapping[str, Took]) -> None:
    """Keep how long the steps of a work took, for the next time."""
    place = _place()
    if place is None or not took:
        return
    others = [(name, steps) for name, steps in own().items() if name != work]
    works = dict([(work, dict(took)), *others][:MOST_WORKS])  # the last one first
    document = {
        name: {step: [round(one.seconds, 3), one.pieces] for step, one in steps.items()}
        for name, steps in works.items()
    }
    with suppress(OSError, MachineError):
        from testbed.disk import atomic_write

        place.parent.mkdir(parents=True, exist_ok=True)
        atomic_write(place, json.dumps(document, indent=1).encode())
        own.cache_clear()


@cache
def own() -> Works:
    """What works took here."""
    place = _place()
    return {} if place is None else _read(place)


@cache
def shipped() -> Works:
    """What works took where the program was made."""
    return _read(SHIPPED)


def _here() -> Works:
    """The shipped works as long as they take here, by those that were played at both places."""
    mine, theirs = own(), shipped()
    ratios = [
        sum(took.seconds for took in mine[work].values())
        / max(sum(took.seconds for took in theirs[work].values()), 1e-3)
        for work in mine
        if work in theirs and set(mine[work]) == set(theirs[work]) and _as_shipped(work)
    ]
    scale = median(ratios) if ratios else 1.0
    return {
        work: {name: Took(took.seconds * scale, took.pieces) for name, took in steps.items()}
        for work, steps in theirs.items()
    }


def _read(place: Path) -> Works:
    """The works of a file; none where it is not there, or damaged."""
    try:
        if place.stat().st_size > MOST_BYTES:
            return {}
        document = json.loads(place.read_bytes())
        return {
            str(work): {
                str(step): Took(min(max(float(seconds), 0.0), 1e9), max(int(pieces), 1))
                for step, (seconds, pieces) in steps.items()
            }
            for work, steps in document.items()
        }
    except (OSError, ValueError, TypeError, AttributeError, RecursionError, OverflowError):
        return {}


def _place() -> Path | None:
    """The user's file of timings; None where the user has no folder, or wants none kept."""
    wanted = os.environ.get(FOLDER)
    if wanted is not None:
        return Path(wanted) / FILE if wanted else None
    try:
        if sys.platform == "win32":
            base = Path(os.environ["LOCALAPPDATA"])
        elif sys.platform == "darwin":
            base = Path.home() / "Library" / "Caches"
        else:
            base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except (KeyError, RuntimeError):
        return None
    return base / "truebed" / FILE if base.is_absolute() else None
