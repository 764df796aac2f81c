"""Write the golden headline numbers: python -m tests.golden.write [SCENE...]; commit says why."""

import json
import os
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
SCENES = (
    "quick",
    "iiwa",
    "wen2022",
    "wen2022_moving",
    "position_only",
    "stations",
    "pose_sets",
    "pose_sets_rigid",
    "coverage",
    "compensate",
    "wen2022_reexamined",
)
SMALLER = {"studies.population": 8, "uncertainty.replications": 4}
"""What is played less often where the whole scene takes too long to play in a test."""
LONG = ("pose_sets", "pose_sets_rigid")
BY_HAND = (*LONG, "wen2022_moving")
"""What takes so long that only a study plays it again."""
FEWER: dict[str, dict[str, Any]] = {
    "wen2022": {"uncertainty.replications": 8},
    "stations": {"uncertainty.replications": 8},
    "coverage": {"coverage.robots": 4, "uncertainty.replications": 4},
    "compensate": {"compensation.robots": 3, "uncertainty.replications": 4},
    "wen2022_reexamined": {
        "reexamined.robots": 2,
        "reexamined.pools": 1,
        "uncertainty.repeats": 3,
        "uncertainty.replications": 0,
    },
}
"""The same for single scenes."""


def golden_file(scene: str) -> Path:
    """Where a scene's headline numbers lie."""
    return HERE / f"{scene}.json"


def headline_of(scene: str, poses: int | None = None) -> dict[str, Any]:
    """Headline of a shipped scene played in memory, a long one smaller; see `played`."""
    return headline(played(scene, poses))


def headline(campaign: Any) -> dict[str, Any]:
    """Headline of a campaign as its file would give it back."""
    from testbed.run import derive

    return json.loads(json.dumps(derive.headline(campaign), allow_nan=False))


def played(scene: str, poses: int | None = None) -> Any:
    """A shipped scene played in memory, a long one smaller.

    With `poses`, only its trials with that number of poses are played.
    """
    from testbed.run.play import play_run
    from testbed.scenario.read import changed
    from testbed.studies import load_scenario

    scenario = load_scenario(scene)
    if scene in LONG:
        scenario = changed(scenario, SMALLER)
    if poses is not None:
        trials = [trial for trial in scenario.document()["trial"] if trial["poses"] == poses]
        scenario = changed(scenario, {"trial": trials})
    scenario = changed(scenario, FEWER.get(scene, {}))
    return play_run(scenario).campaign


if __name__ == "__main__":
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    os.environ.setdefault("MUJOCO_GL", "disable")
    for scene in sys.argv[1:] or SCENES:
        text = json.dumps(headline_of(scene), indent=1, sort_keys=True, allow_nan=False)
        golden_file(scene).write_text(text + "\n", encoding="utf-8")
