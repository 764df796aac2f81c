"""result.json and arrays.npz of a campaign, from what its studies publish."""

from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import numpy as np

from testbed.report.page import SIMULATED
from testbed.run.report import headline_answer
from testbed.store.layout import FORMAT
from testbed.store.quantities import as_arrays, as_json
from testbed.studies import all_studies
from testbed.studies.protocol import Study
from testbed.studies.trial.records import Campaign


def headline(campaign: Campaign, studies: Sequence[Study] | None = None) -> dict[str, Any]:
    """Every headline number of a campaign as plain JSON values."""
    scenario, records = campaign.scenario, campaign.records
    studies = all_studies(scenario) if studies is None else studies
    _, answer = headline_answer(campaign, studies)
    verdict = answer.verdict
    published = [one for study in studies for one in study.results(scenario, records)]
    return {
        "format": FORMAT,
        "notice": SIMULATED,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "robot": _robot_name(scenario.robot),
        "verdict": {
            "believable": verdict.believable,
            "contradicted": verdict.contradicted,
            "sentence": verdict.sentence,
            "reasons": list(verdict.reasons),
        },
        **as_json(published),
    }


def arrays(
    campaign: Campaign, studies: Sequence[Study] | None = None
) -> dict[str, np.ndarray[Any, Any]]:
    """The main arrays of a campaign, names with units."""
    scenario, records = campaign.scenario, campaign.records
    studies = all_studies(scenario) if studies is None else studies
    return as_arrays(one for study in studies for one in study.arrays(scenario, records))


def _robot_name(robot: str) -> str:
    """Name of a shipped robot, or of one's own without the path of this machine."""
    path = PurePath(robot)
    return path.parent.name if path.suffix == ".toml" else path.name
