"""What the comparison of pose sets publishes in result.json."""

from collections.abc import Iterator

import numpy as np

from testbed.store.quantities import METRE, Quantity, below
from testbed.studies.pose_sets.compare import contest_of, rms
from testbed.studies.pose_sets.records import PopulationStudy, population_of
from testbed.studies.trial.records import Campaign


def published(campaign: Campaign) -> list[Quantity]:
    """Errors over many robots; nothing where the study is off."""
    study = population_of(campaign)
    return [] if study is None else below("population", _population(study, campaign))


def _population(study: PopulationStudy, campaign: Campaign) -> Iterator[Quantity]:
    """Errors of each set by estimator, and their ratio to those of the random set of its size."""
    yield Quantity("robots", study.before.size)
    yield Quantity("before_mean_mm", study.before.mean(), METRE)
    entries = contest_of(campaign).entries if study.before.size > 1 else ()
    for i, name in enumerate(study.trials):
        for j, mode in enumerate(campaign.scenario.identification.estimators):
            key = f"trials/{name}/{mode}"
            yield Quantity(f"{key}/mean_mm", study.mean_error[i, j].mean(), METRE)
            yield Quantity(f"{key}/rms_mm", rms(study.rms_error[i, j]), METRE)
            yield Quantity(f"{key}/stated_u_3d_rms_mm", rms(study.stated_u[i, j]), METRE)
            yield Quantity(f"{key}/inside_95", study.inside[i, j].mean())
        yield Quantity(f"trials/{name}/promised_u_3d_rms_mm", rms(study.goal_u[i]), METRE)
        for entry in entries:
            if entry.trial.name == name and entry.ratio is not None and entry.joint is not None:
                key = f"trials/{name}/against_random"
                yield Quantity(f"{key}/error_ratio", np.exp(entry.ratio.value))
                for word, mean in (("ci_95", entry.ratio), ("joint_ci_95", entry.joint)):
                    yield Quantity(f"{key}/{word}", [np.exp(end) for end in (mean.low, mean.high)])
                yield Quantity(f"{key}/outcome", entry.outcome)
                yield Quantity(f"{key}/smaller_error_share", entry.wins)
