"""What does one more held-out pose buy? A 95 % radius taken from errors alone, without a model.

Run it: python scenes/lesson_held_out.py [--seed 1] [--picture held_out.png]
"""

import numpy as np

import calib
from calib.errors import InputError
from truebed import plots_lessons as plots
from truebed.lesson import asked, calibrated, guess, laboratories, spread, tell

COUNTS, POSES, USED = (10, 18, 19, 20, 39, 59), 29, 1000


def radii(seeds: range, draws: int = 200) -> dict[int, np.ndarray | None]:
    """Per number of held-out poses (seeds, draws, 2): the radius [um], and the share inside it.

    The share is that of the true errors at the other poses of a thousand; None if no radius can be
    stated.
    """
    found: dict[int, list[np.ndarray] | None] = {count: [] for count in COUNTS}
    for lab in laboratories(seeds, "soft", test__poses=USED):
        rng = lab.rng("lesson")
        fit = calibrated(lab, rng.permutation(len(lab.poses))[:POSES], "29")
        um = 1e6 * np.linalg.norm(lab.errors(fit), axis=1)
        for count in COUNTS:
            rows = []
            for _ in range(draws):
                order = rng.permutation(USED)
                try:
                    radius = calib.uncertainty.conformal(um[order[:count]]).radius
                except InputError:
                    break
                rows.append((radius, (um[order[count:]] <= radius).mean()))
            if rows:
                found[count] = [*(found[count] or []), np.array(rows)]
    return {count: np.array(rows) if rows else None for count, rows in found.items()}


def answer(found: dict[int, np.ndarray | None]) -> str:
    """The answer, from these numbers."""
    stated = {count: rows for count, rows in found.items() if rows is not None}
    first, last = min(stated), max(stated)
    none = max((count for count in found if count < first), default=0)
    held = {count: 100 * rows[..., 1].mean() for count, rows in stated.items()}
    scatter = {count: rows[..., 0].std(axis=1).mean() for count, rows in stated.items()}
    return (
        f"With {none} held-out poses there is no radius at all; pose {first} buys one that holds "
        f"{held[first]:.1f} % on average, and {last} poses hold {held[last]:.1f} %: more poses do "
        f"not raise the promise, they make the radius sure (its scatter falls from "
        f"{scatter[first]:.0f} to {scatter[last]:.0f} um)."
    )


if __name__ == "__main__":
    given = asked(6)
    guess(
        "How many held-out poses allow a 95 % radius without a model, and what does one more buy?"
    )
    found = radii(given.seeds)
    print("200 draws on each of six robots: mean (smallest to largest robot)")
    print(f"{'poses':>6}{'radius [um]':>20}{'true points inside [%]':>26}")
    for count, rows in found.items():
        if rows is None:
            print(f"{count:6}{'none':>20}")
        else:
            radius, share = rows.mean(axis=1).T
            print(f"{count:6}{spread(radius):>20}{spread(100 * share, 1):>26}")
    tell(answer(found))
    given.draw(lambda axes: plots.share_by_held_out(axes, found))
