"""What the study of pose sets leaves behind; nothing is computed."""

from dataclasses import dataclass

from calib.arrays import Array
from testbed.studies.trial.records import Campaign

POPULATION = "population"


@dataclass(frozen=True, slots=True, eq=False)
class PopulationStudy:
    """Every trial's pose set on many virtual robots, each measured once: the robot is the unit."""

    trials: tuple[str, ...]
    """(s,) names."""
    mean_error: Array
    """(s, e, R) mean held-out position error against the truth, per trial, estimator, robot [m]."""
    rms_error: Array
    """(s, e, R) root mean square of the same [m]."""
    stated_u: Array
    """(s, e, R) root mean square over held-out poses of the stated 3-D u [m]."""
    inside: Array
    """(s, e, R) share of held-out points inside their stated 95 % region."""
    before: Array
    """(R,) mean held-out error of the nominal model [m]."""
    goal_u: Array
    """(s, R) RMS tool-point u over the goal that the set promised, from the nominal model [m]."""


def population_of(campaign: Campaign) -> PopulationStudy | None:
    """Every trial's set on many robots; None if nobody asked."""
    return campaign.records.find(POPULATION, PopulationStudy)
