"""Where to put the tracker? The same robot and poses, measured from near, far and the side.

Run it: python scenes/lesson_tracker.py [--seed 1] [--picture tracker.png]
"""

import numpy as np

from truebed import plots_lessons as plots
from truebed.lesson import asked, error_um, guess, laboratories, spread, tell

POSES = 29
STATIONS = {
    "1.5 m in front": (1500.0, 0.0, 300.0),
    "3 m to the side": (0.0, -3000.0, 300.0),
    "3 m in front": (3000.0, 0.0, 300.0),
    "6 m in front": (6000.0, 0.0, 300.0),
    "12 m in front": (12000.0, 0.0, 300.0),
}


def errors(seeds: range) -> dict[str, np.ndarray]:
    """Per station (2, seeds) [um]: u of one reading, 3-D, and the true error after calibration."""
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in STATIONS}
    for name, station in STATIONS.items():
        tracker = {"preset": "at960", "station_mm": station}
        for lab in laboratories(seeds, "rigid", tracker=tracker):
            places = lab.rng("lesson").permutation(len(lab.poses))[:POSES]
            seen = lab.measure(places, "29").covariance[:, :3, :3]
            u = 1e6 * np.sqrt(np.trace(seen, axis1=1, axis2=2).mean())
            found[name].append((float(u), error_um(lab, places, "29")))
    return {name: np.array(um).T for name, um in found.items()}


def answer(found: dict[str, np.ndarray]) -> str:
    """The answer, from these numbers."""
    (first, near), *_, (last, far) = found.items()
    best = min(found, key=lambda name: found[name][1].mean())
    noise, error = far.mean(axis=1) / near.mean(axis=1)
    wins = int((near[1] < far[1]).sum())
    return (
        f"From {last} a reading is {noise:.1f} times as noisy as from {first}, and the calibration "
        f"{error:.1f} times as far off ({wins} of {len(near[1])} robots): angles err in proportion "
        f"to the distance. Best of these: {best}. Part of the noise is the robot's, and stays."
    )


if __name__ == "__main__":
    given = asked(6)
    guess(
        "A laser tracker measures a distance to 2 um. By what factor does the error of a "
        "calibration grow if it stands 12 m away instead of 1.5 m?"
    )
    um = errors(given.seeds)
    print("six rigid robots [um]: mean (smallest to largest)")
    print(f"{'':16}{'u of a reading':>22}{'mean true error':>22}")
    for name, values in um.items():
        print(f"{name:16}{spread(values[0], 1):>22}{spread(values[1], 1):>22}")
    tell(answer(um))
    given.draw(lambda axes: plots.noise_and_error(axes, um))
