"""Why not all O1? Sets of 29 poses chosen by O1, by the uncertainty of the tool (V), and at random.

Run it: python scenes/lesson_o1.py [--seed 1] [--picture o1.png]
"""

import numpy as np

import calib
from calib.arrays import Index
from truebed import VirtualLaboratory
from truebed import plots_lessons as plots
from truebed.lesson import asked, error_um, guess, laboratories, spread, tell

POSES, RANDOM = 29, 5
KINDS = {"rigid": "rigid", "soft": "sags"}


def chosen(lab: VirtualLaboratory) -> dict[str, Index]:
    """Places in the pool of the O1 set and of the V set."""
    noise = 17.5e-6, np.radians(0.011)  # of the tracker in this scene [m, rad]
    o1 = calib.design.Problem.of_blocks(lab.blocks(), POSES, "O1")
    v = calib.design.Problem.of_poses(
        lab.nominal, lab.poses, poses=POSES, criterion="V", goals=lab.poses[::10], noise=noise
    )
    return {
        "O1": calib.design.detmax(o1, lab.rng("O1")).indices,
        "V": calib.design.exchange(v, lab.rng("V"), restarts=1).indices,
    }


def log_error(arm: VirtualLaboratory, places: Index, name: str) -> float:
    """Logarithm of the mean true error after a calibration from these poses."""
    return float(np.log(error_um(arm, places, name)))


def against_random(seeds: range, robots: int = 4) -> dict[tuple[str, str], np.ndarray]:
    """Error of a set against random sets [%], per kind and set: a mean over robots per seed."""
    found: dict[tuple[str, str], list[float]] = {}
    for kind in KINDS:
        for lab in laboratories(seeds, kind):
            sets, count = chosen(lab), len(lab.poses)
            ratios: dict[str, list[float]] = {name: [] for name in sets}
            for k in range(robots):
                arm, rng = lab.another("lesson", k), lab.rng(k)
                random = [calib.design.random_selection(count, POSES, rng) for _ in range(RANDOM)]
                base = np.mean([log_error(arm, set_, f"{k} {i}") for i, set_ in enumerate(random)])
                for name, places in sets.items():
                    ratios[name].append(log_error(arm, places, f"{k} {name}") - base)
            for name, logs in ratios.items():
                found.setdefault((kind, name), []).append(100 * (np.exp(np.mean(logs)) - 1))
    return {key: np.array(values) for key, values in found.items()}


def answer(found: dict[tuple[str, str], np.ndarray]) -> str:
    """The answer, from these numbers."""
    mean = {key: values.mean() for key, values in found.items()}
    return (
        f"On rigid robots O1 changes the error by {mean['rigid', 'O1']:+.0f} % and V by "
        f"{mean['rigid', 'V']:+.0f} %, on robots that sag by {mean['soft', 'O1']:+.0f} % and "
        f"{mean['soft', 'V']:+.0f} %: an index knows the noise, not what the model lacks."
    )


if __name__ == "__main__":
    given = asked(10)
    guess("How much smaller [%] is the error after 29 poses chosen by O1 than after random ones?")
    percent = against_random(given.seeds)
    print("O1: by the information of all numbers. V: by the uncertainty of the tool point.")
    print("error against random sets [%], four robots at each of ten seeds: mean (range of seeds)")
    for (kind, name), values in percent.items():
        print(f"{KINDS[kind]:6} {name:3} {spread(values, 1):>24}")
    tell(answer(percent))
    given.draw(lambda axes: plots.against_random(axes, percent, KINDS))
