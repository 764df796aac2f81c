"""What the lessons in `scenes/` share: a question first, virtual robots, and their true errors."""

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

import calib

if TYPE_CHECKING:
    from calib.identification.result import Identification
    from truebed.virtual import VirtualLaboratory


WIDTH = 92
"""Characters per line that a class can read from a projector."""


@dataclass(frozen=True, slots=True)
class Asked:
    """Arguments of the script of a lesson."""

    seeds: range
    """Seeds of its robots."""
    picture: Path | None
    """File to draw the answer into."""

    def draw(self, painted: Callable[[Any], object]) -> None:
        """Write the picture, if one was asked for; `painted` draws on the axes it is given."""
        if self.picture is not None:
            from truebed.plots import slide

            slide(self.picture, painted)
            sys.stdout.write(f"Picture: {self.picture}\n")


def asked(robots: int, words: list[str] | None = None) -> Asked:
    """Read the arguments: ``--seed 7`` plays other robots, ``--picture FILE`` draws the answer.

    Parameters
    ----------
    robots : int
        Number of consecutive seeds that the lesson plays.
    words : list of str, optional
        The arguments; by default those of the script.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=1, help="of the first robot (1)")
    parser.add_argument("--picture", type=Path, help="draw the answer: FILE.png, .svg or .pdf")
    found = parser.parse_args(words)
    if found.seed < 0:
        parser.error("--seed is 0 or more")
    if found.picture and found.picture.suffix not in (".png", ".svg", ".pdf"):
        parser.error("--picture ends in .png, .svg or .pdf")
    return Asked(range(found.seed, found.seed + robots), found.picture)


def tell(answer: str) -> None:
    """Print an answer, folded into lines."""
    sys.stdout.write(f"\n{fill(answer, WIDTH)}\n")


def guess(question: str) -> None:
    """Print a question; in an interactive terminal, wait for Enter."""
    sys.stdout.write(f"{fill(question, WIDTH)}\n")
    sys.stdout.flush()
    if sys.stdin is not None and sys.stdin.isatty():
        input("Guess before you look, then press Enter: ")


def laboratories(
    seeds: Iterable[int], preset: str, **changes: Any
) -> "Iterator[VirtualLaboratory]":
    """The laboratory of the scene `quick` with a robot of a preset, once for each seed.

    Parameters
    ----------
    seeds : iterable of int
        Each seed draws another robot, another pool and other noise.
    preset : str
        Preset of the truth: ``rigid``, ``soft`` ...
    **changes : Any
        Keys of the scenario, with ``__`` in place of a dot.
    """
    from truebed import laboratory

    keys = {name.replace("__", "."): value for name, value in changes.items()}
    for seed in seeds:
        yield laboratory("quick", {"seed": seed, "truth.preset": preset} | keys)


def calibrated(lab: "VirtualLaboratory", places: ArrayLike, name: str) -> "Identification":
    """Measure candidates by their indices and identify the robot; `name` seeds the noise."""
    return calib.identify(lab.nominal, lab.measure(places, name), lab.free)


def error_um(lab: "VirtualLaboratory", places: ArrayLike, name: str) -> float:
    """Mean true error of the `calibrated` robot at the held-out poses [um]."""
    return 1e6 * lab.mean_error(calibrated(lab, places, name))


def spread(values: ArrayLike, digits: int = 0) -> str:
    """The mean with the smallest and the largest: ``23 (19 to 28)``.

    Examples
    --------
    >>> spread([19, 28, 22])
    '23 (19 to 28)'
    """
    some = np.asarray(values, dtype=np.float64)
    mean, low, high = (f"{value:.{digits}f}" for value in (some.mean(), some.min(), some.max()))
    return f"{mean} ({low} to {high})"
