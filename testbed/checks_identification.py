"""What [identification] asks of its robot beyond names: a prior about numbers that are free."""

from typing import TYPE_CHECKING

from testbed.mistakes import Fault, did_you_mean
from testbed.settings import Scenario
from testbed.settings_identification import SINGLE

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot


def prior_faults(scenario: Scenario, robot: "Robot") -> list[Fault]:
    """Faults of single numbers of the prior: unknown, of the other unit, or not free."""
    from testbed.estimator import default_parameters

    prior = scenario.identification.prior
    if prior is None:
        return []
    table = default_parameters(scenario, robot)
    free, faults = set(table.free_names), []
    for key, wanted in SINGLE.items():
        for name in getattr(prior, key):
            path = ("identification", "prior", key, name)
            at = f'[identification.prior.{key}] has "{name}"'
            if name not in table.names:
                fix = did_you_mean(name, table.names) or f"see `truebed robots {robot.name}`"
                message = f"{at}, which the model of {robot.name} does not know"
                faults.append(Fault(path, message, fix=fix, value=name))
            elif name not in free:
                fix = "remove it, or free that number"
                faults.append(Fault(path, f"{at}, which is not free", fix=fix, value=name))
            elif bool(table.is_length[table.names.index(name)]) is not wanted:
                kind, other = ("an angle", "sd_deg") if wanted else ("a length", "sd_mm")
                fix = f"move it to [identification.prior.{other}]"
                faults.append(Fault(path, f"{at}, which is {kind}", fix=fix, value=name))
    return faults


def default_contradictions(scenario: Scenario) -> list[str]:
    """Sentences, one per key for the default estimator where it is not played."""
    settings = scenario.identification
    if "whitened" in settings.estimators:
        return []
    keys = {
        "model": settings.model != "geometric",
        "loss": settings.loss != "squared",
        "prior": settings.prior is not None,
    }
    return [
        f'[identification] {key} belongs to the default estimator, and estimators has "paper" '
        f'only; add "whitened" or remove {key}'
        for key, given in keys.items()
        if given
    ]
