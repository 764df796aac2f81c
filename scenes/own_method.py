"""A selection method of your own, compared with the shipped ones on equal terms.

The idea that is tried: poses as far from each other in joint space as possible. Robots, level of
noise and estimator are the same for all methods; only the poses differ.

Run it: python scenes/own_method.py
"""

import numpy as np

import calib
import truebed
from calib.arrays import Array, Index

POSES = 29


def farthest(q: Array, m: int, rng: np.random.Generator) -> Index:
    """Places (m,) of joint vectors, each the farthest from those taken before."""
    chosen = [int(rng.integers(len(q)))]
    distance = np.linalg.norm(q - q[chosen[0]], axis=1)
    while len(chosen) < m:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(q - q[chosen[-1]], axis=1))
    return np.array(chosen)


def contest(robots: int = 8) -> dict[str, Array]:
    """Mean held-out error [mm] of each robot, per method."""
    errors: dict[str, list[float]] = {"DETMAX": [], "random": [], "farthest": []}
    for seed in range(robots):
        lab = truebed.laboratory("quick", {"seed": seed})
        problem = calib.design.Problem.of_blocks(lab.blocks(), POSES, "O1")
        sets = {
            "DETMAX": calib.design.detmax(problem, lab.rng("DETMAX")).indices,
            "random": calib.design.random_selection(len(lab.poses), POSES, lab.rng("random")),
            "farthest": farthest(lab.poses, POSES, lab.rng("farthest")),
        }
        for name, chosen in sets.items():
            result = calib.identify(lab.nominal, lab.measure(chosen, name), lab.free)
            errors[name].append(lab.mean_error(result) * 1e3)
    return {name: np.array(values) for name, values in errors.items()}


if __name__ == "__main__":
    for method, error in contest().items():
        spread = error.std(ddof=1) / len(error) ** 0.5
        print(f"{method:9s} {error.mean():.4f} +- {spread:.4f} mm over {len(error)} robots")
