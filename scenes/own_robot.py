"""A robot of your own: three revolute joints and a prismatic one, described and calibrated.

Run it: python scenes/own_robot.py
"""

import tempfile
from pathlib import Path

import truebed
from testbed.studies import scenario_of
from testbed.studies.trial.records import Campaign

JOINT = """
[[joints]]
kind = "{kind}"
theta_deg = {theta}
d_mm = {d}
a_mm = {a}
alpha_deg = {alpha}
{limits}
mass_kg = 5.0
center_mm = [0.0, 0.0, 0.0]
inertia_kg_m2 = [0.1, 0.1, 0.1]
"""
TURN = "lower_deg = -150.0\nupper_deg = 150.0\nmax_speed_deg_s = 200.0\nrepeatability_urad = 10.0"
SLIDE = "lower_mm = 0.0\nupper_mm = 400.0\nmax_speed_mm_s = 500.0\nrepeatability_um = 5.0"
ROBOT = 'format = 1\nname = "stacker"\ntitle = "Turn, slide, turn, turn"\n' + "".join(
    JOINT.format(kind=kind, theta=theta, d=d, a=a, alpha=alpha, limits=limits)
    for kind, theta, d, a, alpha, limits in (
        ("revolute", 0.0, 400.0, 0.0, -90.0, TURN),
        ("prismatic", 0.0, 300.0, 0.0, 90.0, SLIDE),
        ("revolute", 0.0, 0.0, 250.0, -90.0, TURN),
        ("revolute", 0.0, 100.0, 50.0, 0.0, TURN),
    )
)
SOURCES = '\n[sources]\ngeometry = "made up for this script"\n'


def calibrate(folder: Path) -> Campaign:
    """Write the robot, perturb it in secret, measure 20 designed poses, identify."""
    file = folder / "robot.toml"
    file.write_text(ROBOT + SOURCES, encoding="utf-8")
    scenario = scenario_of(
        {
            "format": 1,
            "name": "own-robot",
            "seed": 4,
            "robot": str(file),
            "truth": {"preset": "rigid", "perturb": "links"},
            "pool": {"size": 300, "box_size_mm": [3000.0, 3000.0, 3000.0]},
            "identification": {"estimators": ["whitened"]},
            "uncertainty": {"replications": 40},
            "trial": [{"name": "designed", "poses": 20, "method": "detmax"}],
        }
    )
    return truebed.run(scenario)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        estimate = calibrate(Path(temporary)).trials[0].estimates[0]
    print(estimate.identification.summary())
    print(f"{estimate.identification.rank} of {28 + 4} numbers can be told apart")
    before, after = estimate.comparison.accuracy_before, estimate.comparison.accuracy_after
    print(f"held-out error {before.mean * 1e3:.3f} -> {after.mean * 1e3:.4f} mm")
