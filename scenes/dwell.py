"""How long must one wait? Arms that move to a pose, stop, vibrate, and are measured too soon.

Run it: python scenes/dwell.py. It prints a table and draws dwell.svg.
"""

from pathlib import Path

import numpy as np

from testbed.laboratory.truth.robot import draw_truth
from testbed.robots.catalog import load_robot
from testbed.scenario.laboratory import TruthSettings
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.trial.bending.plots import dying_away

DWELLS_S, AT_REST_S = (0.0, 0.1, 0.3, 0.5, 1.0), 8.0
ARMS = {  # the usual speed of an arm, and the slow one of Wen et al. 2022
    "fast": {"speed_deg_s": 120.0, "approach_deg": 20.0},
    "at 62.5 mm/s": {"speed_mm_s": 62.5, "approach_deg": 5.0},
}
# damping as a share of the critical one, friction in multiples of 1 % of the rated torque
KINDS = ((0.05, 1.0), (0.02, 0.3), (0.02, 0.0))


def of_kind(truth: TruthSettings, share: float, rng: np.random.Generator) -> TruthSettings:
    """One arm of a kind: stiffness and friction of every joint vary by up to 30 %."""
    keys = {"drive_nm_per_mrad": 1.0, "bearing_nm_per_mrad": 1.0, "friction_nm": share}
    size = {key: factor * rng.uniform(0.7, 1.3, 6) for key, factor in keys.items()}
    update = {key: tuple(each * getattr(truth, key)) for key, each in size.items()}
    return truth.model_copy(update=update)


def waited(how: str, damping: float, friction: float, *, robots: int, poses: int) -> np.ndarray:
    """Distance (robots, dwells + 1, poses) [um] of the tool from where it will come to rest.

    The last entry is the distance from where it rests if it comes from the other side, which no
    wait removes.
    """
    robot = load_robot("staubli_tx60")
    changes = {"truth": {"preset": "moving", "damping": damping, **ARMS[how]}}
    truth = changed(load_scenario("quick"), changes).truth
    found = []
    for seed in range(robots):
        rng = np.random.default_rng(seed)
        arm = draw_truth(robot, of_kind(truth, friction, rng), seed).simulator
        q = rng.uniform(*(0.7 * robot.limits.T), (poses, 6))
        way = np.radians(30) * rng.choice([-1.0, 1.0], q.shape)
        looks, back = (
            1e6 * arm.looks(q, side * way, (*DWELLS_S, AT_REST_S))[..., :3, 3] for side in (1, -1)
        )
        looks[-1], rest = back[-1], looks[-1].copy()
        found.append(np.linalg.norm(looks - rest, axis=-1))
    return np.array(found)


def table(*, robots: int = 5, poses: int = 12) -> list[tuple[str, float, float, np.ndarray]]:
    """Per kind of arm: how it arrives, damping, friction, and the distances of `waited`."""
    kinds = [(how, *kind) for how in ARMS for kind in KINDS]
    return [(*kind, waited(*kind, robots=robots, poses=poses)) for kind in kinds]


if __name__ == "__main__":
    print("um from where the tool comes to rest: mean over poses and robots (the worst pose)")
    times, drawn = "".join(f"{f'{dwell:g} s':>13}" for dwell in DWELLS_S), {}
    print(f"{'':14}damping friction{times}{'other side':>13}")
    for how, damping, friction, um in table():
        mean, most = um.mean(axis=(0, 2)), um.max(axis=(0, 2))
        worst = [f"{b:4.0f}" if b >= 0.5 else " <.5" for b in most]
        row = (f"{a:7.1f} ({b})" for a, b in zip(mean, worst, strict=True))
        print(f"{how:14}{damping:7g}{friction:9g}", *row, sep="")
        if how == "fast":
            kind = f"damping {damping:g}, friction {friction:g}: "
            drawn[kind] = mean[:-1] / 1e6, most[:-1] / 1e6
    Path("dwell.svg").write_text(dying_away(np.array(DWELLS_S), drawn), encoding="utf-8")
