"""Wen et al. 2022 worked out again from the files of a run folder; numpy, nothing of the project.

What the paper makes of repeats, of random sets and of their number and place is computed here from
the raw arrays of the run, or from its seed by visits measured and calibrated anew.

The ratio of the protocol is the mean over the 24 numbers of u_best / u_random: u_best the scatter
of the ten repeats on one designed set by the paper's estimator, u_random the root sum of squares of
u_r, u_p and u_w. Repeats against repeats is the mean of u_best / u_r. Neither is a ratio of means,
which would mix m and rad.

    python -m tests.truth.wen2022_script RUN_FOLDER
"""

import json
import sys
import tomllib
import zipfile
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from tests.truth.wen2022_arm import calibrate, forward, rotation_of

POSE_NUMBERS = range(30, 151, 20)
"""Sizes of the random sets behind u_p."""
CONTRIBUTORS = "repeatability", "pose_number", "location"
"""u_r, u_p and u_w, as a run's record of the budget names them."""


def read_record(file):
    """Arrays and plain values of one file of trials/, by dotted name."""
    with zipfile.ZipFile(file) as archive:
        arrays = {}
        for entry in archive.namelist():
            with archive.open(entry) as stream:
                arrays[entry.removesuffix(".npy")] = np.lib.format.read_array(stream)
    return {**json.loads(arrays.pop("meta").tobytes())["values"], **arrays}


@dataclass(frozen=True, eq=False)
class Run:
    """What a run folder holds: the scenario, the records by key, result.json and arrays.npz."""

    scenario: dict
    records: dict
    result: dict
    arrays: dict

    @property
    def setting(self):
        return self.records["setting"]

    def repeated(self, trial, mode="paper"):
        """(v, 24) steps of one trial's repeated calibrations by one estimator."""
        return self.records[trial][f"estimates.{self.place(trial, mode)}.repeated"]

    def place(self, trial, mode):
        """Place of an estimator among those of a trial."""
        count = self.records[trial]["estimates.#"]
        modes = [self.records[trial][f"estimates.{k}.mode"] for k in range(count)]
        return modes.index(mode)


def read_run(folder):
    """A run folder, read by the standard library and numpy."""
    folder = Path(folder)
    with np.load(folder / "arrays.npz") as archive:
        arrays = {name: archive[name] for name in archive.files}
    return Run(
        tomllib.loads((folder / "scenario.toml").read_text(encoding="utf-8")),
        {file.stem: read_record(file) for file in (folder / "trials").glob("*.npz")},
        json.loads((folder / "result.json").read_text(encoding="utf-8")),
        arrays,
    )


def type_a(estimates):
    """Standard deviation (24,) of one of v calibrations (v, 24), divisor v - 1 (eq. 7)."""
    off = estimates - estimates.sum(axis=0) / len(estimates)
    return np.sqrt((off**2).sum(axis=0) / (len(estimates) - 1))


def root_sum_square(*parts):
    """Combined u (24,) of contributors that know nothing of each other (eqs. 8 and 9)."""
    return np.sqrt(sum(np.square(part) for part in parts))


def mean_ratio(best, random):
    """Last column of Table 3 over all numbers: the mean of the ratios, not the ratio of means."""
    return float((best / random).mean())


def stream(seed, *names):
    """The random numbers that a run keeps for one purpose: 128 bits of sha256 a name."""
    digests = (sha256(f"{type(name).__name__}:{name}".encode()).digest()[:16] for name in names)
    key = [int(word) for digest in digests for word in np.frombuffer(digest, "<u4")]
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(key)))


def true_poses(run, q):
    """Poses of the true robot: its own links, and joints that sag and wobble."""
    known, reached = run.setting, q.copy()
    for k, amplitude in enumerate(known["true.joint_errors.coefficients"]):
        term = f"true.joint_errors.terms.{k}"
        phase = sum(known[f"{term}.weights.{i}"] * q[..., i] for i in range(6))
        wave = {"sin": np.sin, "cos": np.cos}[known[f"{term}.wave"]]
        reached[..., known[f"{term}.joint"]] += amplitude * wave(phase)
    chain = (known[f"true.chain.{name}"] for name in ("T_world_base", "T_flange_tool"))
    return forward(known["true.chain.links"], reached, *chain)


def visit(run, places, *names, repeat=0):
    """Joints, positions and rotations that one visit of pool poses measured."""
    q = run.setting["pool_q"][places]
    p, R = true_poses(run, q)
    tracker = run.scenario["tracker"]
    noise = stream(run.scenario["seed"], "tracker", *names, repeat).standard_normal((len(q), 3, 3))
    turn = np.deg2rad(tracker["rotation_mdeg"] * 1e-3) * noise[:, 2]
    return q, p + tracker["position_um"] * 1e-6 * noise[:, 0], R @ rotation_of(turn)


def nominal(run):
    """Links, base and tool of the nominal robot."""
    return (run.setting[f"nominal.chain.{n}"] for n in ("links", "T_world_base", "T_flange_tool"))


def steps_of(run, visits):
    """Steps (k, 24) of the paper's estimator from k visits, which may differ in size."""
    links, base, tool = nominal(run)
    return np.array(
        [calibrate(links, *(x[None] for x in v), "paper", base=base, tool=tool)[0] for v in visits]
    )


def random_budget(run):
    """u_r, u_p and u_w (24,) of random sets, every visit measured and calibrated here again."""
    setting, v = run.setting, run.scenario["uncertainty"]["repeats"]
    n, rng = len(setting["pool_q"]), stream(run.scenario["seed"], "paper_budget", "sets")
    one = rng.choice(n, min(50, n), replace=False)
    x, y, _ = setting["pool_nominal"][:, :3, 3].T
    quarters = [((x > 0.25) == far) & ((y > 0) == left) for far in (0, 1) for left in (0, 1)]
    members = [np.flatnonzero(quarter) for quarter in quarters]
    local = [rng.choice(m, min(50, len(m)), replace=False) for m in members]
    sized = [rng.choice(n, min(size, n), replace=False) for size in POSE_NUMBERS]
    parts = []
    for name, sets in (("repeats", [one] * v), ("pose_number", sized), ("location", local)):
        visits = [visit(run, s, "paper_budget", name, repeat=k) for k, s in enumerate(sets)]
        parts.append(type_a(steps_of(run, visits)))
    return parts


def main(folder):
    """Ratios of Table 3 for every designed trial of a run."""
    run = read_run(folder)
    budget = run.records["paper_budget"]
    u_random = root_sum_square(*(budget[part] for part in CONTRIBUTORS))
    for trial in run.scenario["trial"]:
        if trial["method"] != "random":
            u_best = type_a(run.repeated(trial["name"]))
            protocol = mean_ratio(u_best, u_random)
            repeats = mean_ratio(u_best, budget[CONTRIBUTORS[0]])
            sys.stdout.write(f"{trial['name']}: {protocol:.4f}, repeats {repeats:.4f}\n")


if __name__ == "__main__":
    main(sys.argv[1])
