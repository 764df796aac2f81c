"""What does a wrong model do to an interval? Shares of true points inside "95 %" regions.

Run it: python scenes/lesson_model.py
"""

import numpy as np

import calib
from calib.information.propagation import tool_covariance
from calib.uncertainty.regions import inside
from testbed.streams import stream
from truebed.lesson import calibrated, guess, laboratories, spread, true_error

COUNTS, HELD_OUT = (29, 61, 120), 20
KINDS = {"rigid": "the model is right", "soft": "the arm sags"}


def shares(seeds: range) -> dict[str, np.ndarray]:
    """Percentage (seeds, counts + 1) of 50 true points inside what is stated, per kind of robot.

    By the parameters alone for each number of poses; last, inside the region that is believed
    after the first number of poses and 20 held-out ones.
    """
    found: dict[str, list[list[float]]] = {kind: [] for kind in KINDS}
    for kind, rows in found.items():
        for bench in laboratories(seeds, kind):
            order = stream(bench.scenario.seed, "lesson").permutation(len(bench.pool_q))
            q, held, row = bench.setting.test_q, bench.measure_pool(order[-HELD_OUT:], "test"), []
            for m in COUNTS:
                fit = calibrated(bench, order[:m], f"{m}")
                S = tool_covariance(fit.model, q, fit.full_covariance)[:, :3, :3]
                row.append(inside(true_error(bench, fit), S).mean())
            train = bench.measure_pool(order[: COUNTS[0]], f"{COUNTS[0]}")
            fit = calibrated(bench, order[: COUNTS[0]], f"{COUNTS[0]}")
            belief = calib.judge(fit, held, train=train).belief
            there = None if belief is None else belief.regions(q)
            row.append(0.0 if there is None else there.covers(true_error(bench, fit)).mean())
            rows.append(row)
    return {kind: 100 * np.array(rows) for kind, rows in found.items()}


def answer(found: dict[str, np.ndarray]) -> str:
    """The answer, from what was found."""
    right, wrong = (rows.mean(axis=0) for rows in found.values())
    grows = "fewer" if wrong[len(COUNTS) - 1] < wrong[0] else "no fewer"
    return (
        f'Where the model is right "95 %" holds {right[0]:.0f} %; where it is not, '
        f"{wrong[0]:.0f} %, and {grows} after four times as many poses "
        f"({wrong[len(COUNTS) - 1]:.0f} %): the interval knows the noise only. The region that "
        f"counts what held-out poses show holds {wrong[-1]:.0f} %."
    )


if __name__ == "__main__":
    guess('The tracker is the same. Of 50 true points, how many lie inside "95 %" if the arm sags?')
    percent = shares(range(1, 7))
    heads = [*(f"{m} poses" for m in COUNTS), "believed"]
    print("true points inside [%], six robots: mean (smallest to largest)")
    print(f"{'':20}" + "".join(f"{head:>18}" for head in heads))
    for kind, rows in percent.items():
        print(f"{KINDS[kind]:20}" + "".join(f"{spread(column):>18}" for column in rows.T))
    print(answer(percent))
