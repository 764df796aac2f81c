"""Why 61 poses? What more poses gain on a rigid robot, and on one that sags.

Run it: python scenes/lesson_poses.py [--seed 1] [--picture poses.png]
"""

import numpy as np

import calib
from truebed import plots_lessons as plots
from truebed.lesson import asked, error_um, guess, laboratories, spread, tell

COUNTS, WANTED = (10, 15, 29, 61, 120), 61
KINDS = {"rigid": "rigid robot", "soft": "one that sags"}


def errors(seeds: range) -> dict[str, np.ndarray]:
    """Mean true error (seeds, counts) [um] at 50 held-out poses, per kind of robot."""
    found: dict[str, list[list[float]]] = {kind: [] for kind in KINDS}
    for kind, rows in found.items():
        for lab in laboratories(seeds, kind):
            order = lab.rng("lesson").permutation(len(lab.poses))
            rows.append([error_um(lab, order[:m], f"first {m}") for m in COUNTS])
    return {kind: np.array(rows) for kind, rows in found.items()}


def settled(seeds: range, sets: int = 50) -> list[float]:
    """Number of poses from which O1 hardly rises any more, by the rule of Wen et al. 2022."""
    found = []
    for lab in laboratories(seeds, "rigid"):
        problem = calib.design.Problem.of_blocks(lab.blocks("paper"), 80, "O1")
        rng = np.random.default_rng(lab.scenario.seed)
        count = calib.design.pose_count(problem, rng, sets=sets)[0].chosen
        found.append(float("nan") if count is None else float(count))
    return found


def gain(um: np.ndarray, fewer: int, more: int) -> np.ndarray:
    """Share (seeds,) of the error that more poses remove."""
    before, after = (um[:, COUNTS.index(count)] for count in (fewer, more))
    return 1 - after / before


def answer(found: dict[str, np.ndarray]) -> str:
    """The answer, from these numbers."""
    rigid, soft = (100 * gain(um, 29, WANTED) for um in found.values())
    noise = 100 * (1 - (29 / WANTED) ** 0.5)
    verdict = "less than" if soft.mean() < rigid.mean() else "no less than"
    return (
        f"From 29 to {WANTED} poses a rigid robot loses {spread(rigid)} % of its error (noise "
        f"alone: {noise:.0f} %), one that sags {spread(soft)} %, {verdict} the rigid one: more "
        "poses average the noise, and leave what the model lacks."
    )


if __name__ == "__main__":
    given = asked(6)
    guess("A paper uses 61 poses. By how many percent is the error smaller than after 29?")
    um = errors(given.seeds)
    print("mean true error [um], six robots: mean (smallest to largest)")
    print(f"{'poses':>6}" + "".join(f"{KINDS[kind]:>20}" for kind in um))
    for i, count in enumerate(COUNTS):
        print(f"{count:6}" + "".join(f"{spread(rows[:, i]):>20}" for rows in um.values()))
    print(f"O1 settles at {spread(settled(given.seeds))} poses: that is where 61 comes from.")
    tell(answer(um))
    given.draw(lambda axes: plots.error_by_poses(axes, COUNTS, um, KINDS))
