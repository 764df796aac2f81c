"""A campaign of a few milliseconds, for tests of the runner, the run folder and the command."""

import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.errors import CalibError
from testbed.scenario.hashes import part, shared_part
from testbed.scenario.scenario import Scenario
from testbed.store import layout, npz
from testbed.streams import stream
from testbed.studies import scenario_of
from testbed.studies.protocol import Record
from testbed.studies.trial.records import campaign_of as real_campaign_of

SCENARIO = {
    "format": 1,
    "name": "tiny",
    "seed": 5,
    "robot": "staubli_tx60",
    "studies": {"random_sets": 10, "pose_count": True},
    "trial": [
        {"name": f"trial-{name}", "poses": 20, "method": "detmax", "criterion": "O1"}
        for name in "abc"
    ],
}


def scenario(**changes: object) -> Scenario:
    return scenario_of(SCENARIO | changes)


@dataclass(frozen=True, slots=True, eq=False)
class Inner:
    name: str
    matrix: Array
    maybe: float | None


@dataclass(frozen=True, slots=True, eq=False)
class FakeSetting:
    pool: Array
    parts: tuple[Inner, ...]


@dataclass(frozen=True, slots=True, eq=False)
class FakeTrial:
    name: str
    values: Array
    mean: float


@dataclass(frozen=True, slots=True, eq=False)
class FakeStudy:
    total: float


@dataclass(frozen=True, slots=True, eq=False)
class FakeCampaign:
    scenario: Scenario
    setting: FakeSetting
    trials: tuple[FakeTrial, ...]


class Fake:
    """A study whose records take `pause` seconds each; trials named in `failing` fail."""

    name, settings, keys = "fake", None, ("setting", "pose_count", "random_sets")

    def __init__(self, pause: float = 0.0, failing: tuple[str, ...] = (), size: int = 100) -> None:
        self.pause, self.failing, self.size = pause, failing, size
        self.computed: list[str] = []

    def record_keys(self, scenario):
        return tuple(record.key for record in self.records(scenario))

    def records(self, scenario):
        shared = shared_part(scenario)
        everything = shared | part(scenario, "studies", "trial")
        trials = tuple(trial.name for trial in scenario.trial)
        kept = [Record("setting", FakeSetting, shared, vital=True)]
        for trial in scenario.trial:
            reads = shared | {"trial": trial.model_dump(mode="json")}
            kept.append(Record(trial.name, FakeTrial, reads, needs=("setting",)))
        if scenario.studies.pose_count:
            kept.append(Record("pose_count", FakeStudy, everything, needs=("setting",)))
        if scenario.studies.random_sets:
            kept.append(Record("random_sets", FakeStudy, everything, needs=trials))
        return tuple(kept)

    def play(self, scenario, task, needed):
        return self.compute(scenario, task.key, needed)

    def compute(self, scenario, key, needed):
        time.sleep(self.pause)
        self.computed.append(key)
        rng = stream(scenario.seed, "fake", key)
        if key == "setting":
            inner = tuple(Inner(f"ö{i}", rng.normal(size=(2, i)), None) for i in range(3))
            return FakeSetting(rng.normal(size=(self.size, 3)), inner)
        if key in self.failing:
            raise CalibError(f"{key} did not work", code="T0")
        if key == "random_sets":
            return FakeStudy(sum(needed.get(t.name, FakeTrial).mean for t in scenario.trial))
        pool = needed.get("setting", FakeSetting).pool
        if key == "pose_count":
            return FakeStudy(float(pool.sum()))
        values = pool.T @ rng.normal(size=(self.size, 4))
        return FakeTrial(key, values, float(values.mean()))

    def gather(self, scenario, key, parts):
        return parts[0]

    def answer(self, scenario, records):
        return None

    def results(self, scenario, records):
        return ()

    def arrays(self, scenario, records):
        return ()

    def sections(self, scenario, records, *, first):
        return ()

    def recording(self, scenario, records):
        return ()

    def derive(self, name, played):
        """Derived files of a fake: small, and the recording takes its time."""
        time.sleep(self.pause)
        campaign = campaign_of(played.scenario, played.records)
        values = {trial.name: trial.values for trial in campaign.trials}
        if name == layout.RESULT:
            return npz.pretty_json(result(campaign))
        if name == layout.ARRAYS:
            return npz.to_bytes({"format": 1}, values)
        if name == layout.REPORT:
            return f"<html>{json.dumps(sorted(values))}</html>\n".encode()
        time.sleep(self.pause)
        return np.concatenate([*values.values()]).tobytes()


def campaign_of(scenario, records):
    """The fake campaign in finished records."""
    found = [records.find(trial.name, FakeTrial) for trial in scenario.trial]
    trials = tuple(trial for trial in found if trial is not None)
    if not trials:
        return real_campaign_of(scenario, records)  # says why
    return FakeCampaign(scenario, records.get("setting", FakeSetting), trials)


def result(campaign: FakeCampaign) -> dict[str, object]:
    """As much of a result.json as the headline table needs."""
    found = {
        "believable": True,
        "chi_square_per_dof": None,
        "held_out_before": {"mean_mm": 0.5},
        "stated_u_3d_rms_mm": 0.015,
        "held_out_inside_95": 0.95,
    }
    return {
        "format": 1,
        "notice": "SIMULATED - not a calibration certificate",
        "scenario": campaign.scenario.name,
        "seed": campaign.scenario.seed,
        "verdict": {"sentence": "it works", "believable": True, "reasons": []},
        "trials": {
            trial.name: {
                "poses": 20,
                "estimates": {
                    "whitened": {
                        **found,
                        "held_out_after": {
                            "mean_mm": abs(trial.mean),
                            "p95_mm": 0.02,
                            "max_mm": 0.03,
                        },
                    }
                },
            }
            for trial in campaign.trials
        },
    }


def content(folder: Path) -> dict[str, bytes]:
    """Bytes of every file that must not depend on when, in what order or how often."""
    names = [layout.SCENARIO, layout.MANIFEST, *layout.DERIVED]
    names += [f"trials/{path.name}" for path in sorted((folder / layout.TRIALS).iterdir())]
    return {name: (folder / name).read_bytes() for name in names}
