"""The paper claim by claim: what it prints, what this campaign gives, one sentence of verdict.

One campaign has one true robot. It can contradict a general statement and repeat arithmetic; it
cannot prove an average over robots. Sentences that rest on this one robot begin "This campaign:".
If the protocol was played on many robots, their results are used instead, with intervals.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from calib.geometry.model import RobotModel
from testbed.scenario.scenario import Scenario
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022 import claims_many_robots as many_robots
from testbed.studies.wen2022 import claims_model as model
from testbed.studies.wen2022 import claims_one_robot as one_robot
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.finding import Finding, NotPlayedError
from testbed.studies.wen2022.summary import Reexamination, reexamination_of


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the paper, and the functions that examine it."""

    statement: str
    """The claim in one sentence."""
    printed: str
    """What the paper prints."""
    here: Callable[[Campaign], Finding]
    """Judges it by the one robot of a campaign; raises NotPlayedError if this cannot decide it."""
    over: Callable[[Reexamination], Finding] | None = None
    """Judges it by many robots; None if it is about arithmetic, the nominal robot or its pools."""


CLAIMS = {
    1: Claim(
        "With all joints at zero the nominal tool point is known exactly.",
        "(0, 20, 670) mm",
        model.zero_pose,
    ),
    2: Claim(
        "At the zero pose the tool uncertainty of the optimal set is a tenth of the random one.",
        "u 0.0034 mm best, 0.031 mm random",
        model.zero_pose_uncertainty,
    ),
    3: Claim(
        "The drawn tool positions at the zero pose stay within these ranges.",
        "x -0.0508 to 0.0437 mm best; y, z and random are not in our sources",
        model.zero_pose_range,
    ),
    4: Claim(
        "Over 50 points the mean tool uncertainty separates the optimal from the random set.",
        "u 0.0069 mm best, 0.0649 mm random",
        model.mean_uncertainty,
    ),
    5: Claim("Optimal poses cut the tool uncertainty to a tenth.", "ratio 0.106", model.tool_ratio),
    6: Claim(
        "The combined parameter uncertainties of Table 3 are root sums of squares.",
        "24 rows, seven columns",
        model.root_sums,
    ),
    7: Claim(
        "The tool uncertainty is that of g = sqrt(Px + Py + Pz).",
        "g = sqrt(Px + Py + Pz)",
        model.misprinted_distance,
    ),
    8: Claim(
        "Singular values of the identification Jacobian leave 24 identifiable parameters.",
        "24 parameters",
        model.identifiable,
    ),
    9: Claim(
        "Two poses suffice in principle; the index settles at 61 (O1) and 29 (O2) poses.",
        "mu >= 2; m = 61 and 29",
        model.number_of_poses,
    ),
    10: Claim(
        "The indices O3, O4 and O5 do not settle with the number of poses.",
        "figure of O1 to O5 against the number of poses",
        model.settling,
    ),
    11: Claim(
        "O5, the sum of reciprocal singular values, is to be maximized.",
        "O5 = sum of 1 / sigma",
        model.sum_of_reciprocals,
    ),
    12: Claim(
        "Calibration reduces the mean error on the calibration poses.",
        "Table 1: 0.545 to 0.086, 0.593 to 0.069, 0.377 to 0.057, 0.587 to 0.064 mm",
        one_robot.calibration_errors,
        many_robots.own_errors,
    ),
    13: Claim(
        "On the test poses optimal sets are a quarter more accurate than random ones.",
        "Table 2: 0.459 mm before; 0.097, 0.127, 0.098, 0.132 mm after",
        one_robot.held_out_errors,
        many_robots.held_out_errors,
    ),
    14: Claim(
        "Optimal poses cut the parameter uncertainties to a ninth.",
        "mean ratio 0.11",
        one_robot.parameter_ratio,
        many_robots.parameter_ratio,
    ),
    15: Claim(
        "Optimal poses reduce the uncertainty of the calibrated robot.",
        "ratio 0.11",
        one_robot.like_for_like,
        many_robots.like_for_like,
    ),
    16: Claim(
        "The stated tool uncertainty of the optimal set is the uncertainty of the robot.",
        "u 0.0069 mm",
        one_robot.coverage,
        many_robots.stated,
    ),
    17: Claim(
        "The model is too nonlinear for linear propagation, so Monte Carlo is needed.",
        "Monte Carlo with M = 10 000",
        one_robot.nonlinear,
    ),
}
"""The claims by their numbers in the report."""


@dataclass(frozen=True, slots=True)
class Examined:
    """The findings of a campaign, and the claims that it cannot decide."""

    findings: Mapping[int, Finding]
    """Findings by the numbers of their claims, in order."""
    robots: int = 0
    """Robots of each kind for the claims about errors and uncertainties; 0 for the one played."""

    @property
    def silent(self) -> tuple[int, ...]:
        """Numbers of the claims that need a study this campaign did not play."""
        return tuple(number for number in CLAIMS if number not in self.findings)

    def count(self, verdict: str) -> int:
        """Number of findings with this verdict."""
        return sum(found.verdict == verdict for found in self.findings.values())


def is_paper_robot(model: RobotModel) -> bool:
    """Whether the nominal robot is that of the paper, by all printed nominal values."""
    if not set(paper.PARAMETERS) <= set(model.names):
        return False
    full = np.concatenate([np.zeros(6), model.chain.links.ravel(), np.zeros(6)])
    own = full[[model.names.index(name) for name in paper.PARAMETERS]]
    return bool((np.abs(own - paper.table3("nominal")) <= 1e-9).all())


def plays_paper(scenario: Scenario) -> bool:
    """Whether a scenario plays a study of the paper, so that the claims are examined."""
    asked = scenario.studies
    return asked.pose_count or asked.paper_budget or asked.tool_point


def examine(campaign: Campaign) -> Examined | None:
    """Findings of a campaign on each claim; None if its robot is not the paper's.

    References
    ----------
    Wen et al. 2022.
    """
    if not is_paper_robot(campaign.setting.nominal):
        return None
    findings, again = {}, reexamination_of(campaign)
    for number, claim in CLAIMS.items():
        with suppress(NotPlayedError):
            findings[number] = claim.here(campaign)
        if again is not None and claim.over is not None:
            with suppress(NotPlayedError):  # the finding on the one robot remains
                findings[number] = claim.over(again)
    return Examined(findings, 0 if again is None else again.robots)
