"""A selection method of one's own against the shipped ones, on equal terms.

The idea tried here: poses as far from each other in joint space as possible. Same robots, same
noise, same estimator; only the poses differ.

Run it: python scenes/own_method.py
"""

import numpy as np

import calib
import truebed
from calib.arrays import Array, Index
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.streams import stream
from testbed.studies.trial.compare import compare, true_step

POSES = 29


def farthest(q: Array, m: int, rng: np.random.Generator) -> Index:
    """Places (m,) of joint vectors, each the farthest from those already taken."""
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
        scenario = truebed.scene("quick", {"seed": seed})
        bench = open_laboratory(scenario, make_setting(scenario))
        blocks, q = bench.design_blocks("whitened"), bench.setting.pool_q
        problem = calib.design.Problem.of_blocks(blocks, POSES, "O1")
        sets = {
            "DETMAX": calib.design.detmax(problem, stream(seed, "DETMAX")).indices,
            "random": calib.design.random_selection(len(q), POSES, stream(seed, "random")),
            "farthest": farthest(q, POSES, stream(seed, "farthest")),
        }
        for name, chosen in sets.items():
            seen = bench.measure_pool(chosen, name)
            result = calib.identify(bench.setting.nominal, seen, bench.free("whitened"))
            truth = true_step(bench.setting, result, seen)
            judged = compare(bench.setting, result, seen, truth)
            errors[name].append(judged.accuracy_after.mean * 1e3)
    return {name: np.array(values) for name, values in errors.items()}


if __name__ == "__main__":
    for method, error in contest().items():
        spread = error.std(ddof=1) / len(error) ** 0.5
        print(f"{method:9s} {error.mean():.4f} +- {spread:.4f} mm over {len(error)} robots")
