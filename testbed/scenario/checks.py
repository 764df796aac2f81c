"""What a scenario asks of its robot: names, joint ranges, priors about numbers that are free."""

from typing import TYPE_CHECKING

from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import PAPER_SET as PAPER_SET
from testbed.scenario.tables import SINGLE
from testbed.scenario.truth import truth_faults
from testbed.strict import Fault, did_you_mean, one_error
from testbed.units import DEG, MM, unit_of

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot
    from testbed.scenario.scenario import PoolSettings


def check_robot(scenario: Scenario, robot: "Robot", *, where: str) -> None:
    """Raise one InputError if the scenario names parameters or sets the robot does not have."""
    names = robot.model.names
    faults = []
    for table, key, value, word in (
        ("truth", "perturb", scenario.truth.perturb, "links"),
        ("identification", "free", scenario.identification.free, "identifiable"),
    ):
        known = tuple(dict.fromkeys((word, *robot.free_sets))) if isinstance(value, str) else names
        for name in [value] if isinstance(value, str) else value:
            if name not in known:
                fault = Fault(
                    (table, key),
                    f'[{table}] {key} has "{name}", which {robot.name} does not know',
                    allowed=f"known are {', '.join(known)}" if isinstance(value, str) else "",
                    fix=did_you_mean(name, known) or f"see `truebed robots {robot.name}`",
                    value=name,
                )
                faults.append(fault)
    if "paper" in scenario.identification.estimators and PAPER_SET not in robot.free_sets:
        fault = Fault(
            ("identification", "estimators"),
            f'[identification] estimators has "paper", but {robot.name} has no free set '
            f'"{PAPER_SET}"',
            fix='write estimators = ["whitened"]',
            value="paper",
        )
        faults.append(fault)
    faults += pool_faults(scenario.pool, robot)
    faults += truth_faults(scenario.truth, robot)
    for own in scenario.tables.values():
        faults += own.faults(scenario, robot)
    faults = faults or free_faults(scenario, robot) or prior_faults(scenario, robot)
    if faults:
        raise one_error(faults, where)


def free_faults(scenario: Scenario, robot: "Robot") -> list[Fault]:
    """Faults of what [identification] frees: a frame both free and fixed, or nothing at all."""
    settings = scenario.identification
    wanted = settings.free
    listed = wanted if isinstance(wanted, tuple) else robot.free_sets.get(wanted, robot.model.names)
    states = {"base": settings.base, "tool": settings.tool}
    held = [name for name in listed if states.get(name.split(".")[0]) == "fixed"]
    if held and isinstance(wanted, tuple):
        frame = held[0].split(".")[0]
        return [
            Fault(
                ("identification", "free"),
                f'[identification] free has "{held[0]}", and {frame} is "fixed"',
                fix=f'remove it, or write {frame} = "free"',
                value=held[0],
            )
        ]
    if len(held) == len(listed):
        return [
            Fault(
                ("identification", "free"),
                "[identification] frees nothing",
                fix='name at least one parameter, or write free = "identifiable"',
                value=wanted,
            )
        ]
    return []


def pool_faults(pool: "PoolSettings", robot: "Robot") -> list[Fault]:
    """Faults of joint ranges that this robot cannot have."""
    ranges, place = pool.joint_ranges_deg, ("pool", "joint_ranges_deg")
    n = robot.model.chain.n_joints
    if not ranges:
        return []
    if len(ranges) != n:
        entries = "entry" if len(ranges) == 1 else "entries"
        has = f"{len(ranges)} {entries}; {robot.name} has {n} joints"
        message = f"[pool] joint_ranges_deg has {has}"
        return [Fault(place, message, fix="give one pair per joint", value=ranges)]
    faults = []
    for i, (low, high) in enumerate(ranges):
        slides = bool(robot.model.chain.prismatic[i])
        unit, scale = unit_of(slides), MM if slides else DEG
        lower, upper = robot.limits[i] * scale
        if low >= high or low < lower - 1e-6 or high > upper + 1e-6:
            faults.append(
                Fault(
                    place,
                    f"[pool] joint_ranges_deg lets joint {i + 1} go from {low:g} to {high:g} "
                    f"{unit}",
                    allowed=f"from a lower to a higher value inside {lower:g} to {upper:g} {unit}",
                    value=(low, high),
                )
            )
    return faults


def prior_faults(scenario: Scenario, robot: "Robot") -> list[Fault]:
    """Faults of single numbers of the prior: unknown, of the other unit, or not free."""
    from testbed.scenario.free_numbers import default_parameters

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
