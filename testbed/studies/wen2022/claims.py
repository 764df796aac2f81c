"""The paper claim by claim: what it prints, what this campaign gives, one sentence of verdict.

One campaign has one true robot. It can contradict a general statement and repeat arithmetic; it
cannot prove an average over robots. Sentences that rest on this one robot begin "This campaign:".
Where the protocol was played on many robots, they speak instead, with intervals.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calib.geometry.model import RobotModel
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022 import claims_many_robots as claims_robots
from testbed.studies.wen2022 import claims_model, paper
from testbed.studies.wen2022 import claims_one_robot as claims_accuracy
from testbed.studies.wen2022.finding import Finding, Verdict
from testbed.studies.wen2022.paper import CLAIMS
from testbed.studies.wen2022.records import reexamined_of


@dataclass(frozen=True, slots=True)
class Examined:
    """The findings of a campaign, and the claims it cannot speak to."""

    findings: tuple[Finding, ...]
    """In the order of the paper's claims."""
    silent: tuple[int, ...]
    """Numbers of the claims that need a study this campaign did not play."""
    robots: int = 0
    """Robots of each kind behind the claims about errors and uncertainties; 0: the one played."""

    def count(self, verdict: Verdict) -> int:
        """How many findings have one verdict."""
        return sum(found.verdict == verdict for found in self.findings)


EXAMINERS: dict[int, Callable[[Campaign], Finding | None]] = {
    1: claims_model.zero_pose,
    2: claims_model.zero_pose_uncertainty,
    3: claims_model.zero_pose_range,
    4: claims_model.mean_uncertainty,
    5: claims_model.tool_ratio,
    6: claims_model.root_sums,
    7: claims_model.misprinted_distance,
    8: claims_model.identifiable,
    9: claims_model.number_of_poses,
    10: claims_model.settling,
    11: claims_model.sum_of_reciprocals,
    12: claims_accuracy.calibration_errors,
    13: claims_accuracy.held_out_errors,
    14: claims_accuracy.parameter_ratio,
    15: claims_accuracy.like_for_like,
    16: claims_accuracy.coverage,
    17: claims_accuracy.nonlinear,
}
"""One function per claim; None where the campaign has nothing to say."""


def is_paper_robot(model: RobotModel) -> bool:
    """Whether the nominal robot is the one of the paper: all printed nominal values agree."""
    if not set(paper.PARAMETERS) <= set(model.names):
        return False
    full = np.concatenate([np.zeros(6), model.chain.links.ravel(), np.zeros(6)])
    for row in paper.TABLE3:
        scale = 1e-3 if row.is_length else np.pi / 180
        if abs(full[model.names.index(row.name)] - row.nominal * scale) > 1e-9:
            return False
    return True


def examine(campaign: Campaign) -> Examined | None:
    """What a campaign says about each claim; None if its robot is not the paper's.

    References
    ----------
    Wen et al. 2022; the claims are listed in `testbed.studies.wen2022.paper.CLAIMS`.
    """
    if not is_paper_robot(campaign.setting.nominal):
        return None
    findings, silent = [], []
    again = reexamined_of(campaign)
    over = claims_robots.EXAMINERS if again else {}
    for claim in CLAIMS:
        examiner = over.get(claim.number, EXAMINERS[claim.number])
        found = examiner(campaign) or EXAMINERS[claim.number](campaign)
        if found is None:
            silent.append(claim.number)
        else:
            findings.append(found)
    return Examined(tuple(findings), tuple(silent), again[0].before.size if again else 0)
