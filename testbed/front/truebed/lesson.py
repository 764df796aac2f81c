"""What the lessons in `scenes/` share: a question first, virtual robots, and their true errors."""

import sys
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

import calib
from calib.arrays import Array

if TYPE_CHECKING:
    from calib.identification.result import Identification
    from testbed.laboratory.truth.laboratory import Laboratory


def guess(question: str) -> None:
    """Put a question; where somebody sits at the terminal, wait for the guess."""
    sys.stdout.write(f"{question}\n")
    sys.stdout.flush()
    if sys.stdin is not None and sys.stdin.isatty():
        input("Guess before you look, then press Enter: ")


def laboratories(seeds: Iterable[int], preset: str, **changes: Any) -> "Iterator[Laboratory]":
    """The scene `quick` with a robot of a preset, once for each seed.

    Parameters
    ----------
    seeds : iterable of int
        Each is another robot, another pool and other noise.
    preset : str
        Of the truth: ``rigid``, ``soft`` ...
    **changes : Any
        Keys of the scenario with ``__`` for a dot.
    """
    from testbed.laboratory.truth.laboratory import open_laboratory
    from testbed.laboratory.truth.setting import make_setting
    from testbed.scenario.read import changed
    from testbed.studies import load_scenario

    keys = {name.replace("__", "."): value for name, value in changes.items()}
    for seed in seeds:
        scenario = changed(load_scenario("quick"), {"seed": seed, "truth.preset": preset} | keys)
        yield open_laboratory(scenario, make_setting(scenario))


def calibrated(bench: "Laboratory", places: ArrayLike, name: str) -> "Identification":
    """Measure poses of the pool and identify what they can tell; `name` draws the noise."""
    seen = bench.measure_pool(np.asarray(places), name)
    return calib.identify(bench.setting.nominal, seen, bench.free("whitened"))


def true_error(bench: "Laboratory", result: "Identification") -> Array:
    """What the identified robot is off at the held-out poses (t, 3), against the truth [m]."""
    q = bench.setting.test_q
    return bench.held_out(q)[:, :3, 3] - result.model.poses(q)[:, :3, 3]


def mean_error(bench: "Laboratory", result: "Identification") -> float:
    """The mean distance of it [um]."""
    return float(1e6 * np.linalg.norm(true_error(bench, result), axis=1).mean())


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
