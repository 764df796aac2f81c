"""What does a wrong model do to an interval? Of 50 true points, those in 95 % regions.

Run it: python scenes/lesson_model.py [--seed 1] [--picture model.png]
"""

import numpy as np

import calib
from calib.information.propagation import tool_covariance
from calib.uncertainty.regions import inside
from truebed import plots_lessons as plots
from truebed.lesson import asked, calibrated, guess, laboratories, spread, tell

COUNTS, HELD_OUT = (29, 61, 120), 20
SAG_MDEG, UM_PER_MDEG = (0, 1, 2, 5), 11
"""How far joint 2 sags under the upper arm, and how far the tool moves on average per mdeg of it,
with the other sag in joints 2 and 3 that comes with it."""


def held(seeds: range) -> dict[int, np.ndarray]:
    """How many (seeds, counts + 1) of 50 true points lie inside the stated region, per sag.

    Regions of the parameters alone, for each number of poses; in the last column the believed
    region after the first number of poses and 20 held-out ones.
    """
    found: dict[int, list[list[float]]] = {sag: [] for sag in SAG_MDEG}
    for sag, rows in found.items():
        gravity = [sag, 0.6 * sag, 1.2 * sag]  # in the proportions of the preset soft
        for lab in laboratories(seeds, "rigid", truth__gravity_mdeg=gravity):
            order, q = lab.rng("lesson").permutation(len(lab.poses)), lab.held_out
            judges, row = lab.measure(order[-HELD_OUT:], "test"), []
            fits = [calibrated(lab, order[:m], f"{m}") for m in COUNTS]
            for fit in fits:
                S = tool_covariance(fit.model, q, fit.full_covariance)[:, :3, :3]
                row.append(inside(lab.errors(fit), S).sum())
            train = lab.measure(order[: COUNTS[0]], f"{COUNTS[0]}")
            belief = calib.judge(fits[0], judges, train=train).belief
            there = None if belief is None else belief.regions(q)
            row.append(0 if there is None else there.covers(lab.errors(fits[0])).sum())
            rows.append(row)
    return {sag: np.array(rows) for sag, rows in found.items()}


def answer(found: dict[int, np.ndarray]) -> str:
    """The answer, from these numbers."""
    mean = {sag: rows.mean(axis=0) for sag, rows in found.items()}
    right, wrong, last = mean[SAG_MDEG[0]], mean[SAG_MDEG[2]], len(COUNTS) - 1
    grows = "fewer" if wrong[last] < wrong[0] else "no fewer"
    return (
        f'Where the model is right, "95 %" holds {right[0]:.0f} of 50. Where {SAG_MDEG[2]} mdeg of '
        f"sag are missing from it, {wrong[0]:.0f}, and {grows} ({wrong[last]:.0f}) after four "
        "times as many poses: more poses make the region smaller, and leave the sag as it is. The "
        f"region that counts what held-out poses show holds {wrong[-1]:.0f}."
    )


if __name__ == "__main__":
    given = asked(6)
    guess(
        "An arm sags by thousandths of a degree (mdeg), and the model knows nothing of it. Of 50 "
        'true points, how many lie inside "95 %" after 29 poses, and how many after 120?'
    )
    numbers = held(given.seeds)
    heads = [*(f"{m} poses" for m in COUNTS), "believed"]
    print("true points inside, of 50; six robots: mean (smallest to largest)")
    print(f"{'sag, and at the tool':22}" + "".join(f"{head:>15}" for head in heads))
    for sag, rows in numbers.items():
        words = f"{sag} mdeg, {sag * UM_PER_MDEG} um" if sag else "none"
        print(f"{words:22}" + "".join(f"{spread(column):>15}" for column in rows.T))
    tell(answer(numbers))
    given.draw(lambda axes: plots.inside_by_poses(axes, COUNTS, numbers))
