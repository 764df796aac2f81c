"""What a scenario asks of its robot: names, joints, and which numbers the estimators may move."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from testbed.bounds import TRACKER_SD, shown
from testbed.faults import Fault, one_error
from testbed.names import did_you_mean
from testbed.scenario.idle import idle_settings
from testbed.scenario.laboratory import PaperTracker
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import PAPER_SET, SINGLE, PoolSettings
from testbed.scenario.truth import truth_faults
from testbed.units import DEG, MM, counted, unit_of

if TYPE_CHECKING:
    from calib.geometry.parameters import Parameters
    from calib.identification.identify import Mode
    from testbed.robots.catalog import Robot


def odd_settings(scenario: Scenario) -> tuple[str, ...]:
    """Sentences on what is hardly meant, though it can be played: a noise below any instrument's.

    Of a tracker with several sources the largest one counts, at one meter. The same of a tolerance
    that no such instrument could show, and of keys that change nothing.
    """
    said = (*(scenario.tolerance.odd if scenario.tolerance else ()), *idle_settings(scenario))
    tracker = scenario.tracker
    if isinstance(tracker, PaperTracker):
        key, noise = "position_um is", tracker.position_um
    else:
        key = "at one meter the largest of range_um, transverse_um and centering_um is"
        noise = max(sum(tracker.range_um), sum(tracker.transverse_um), tracker.centering_um)
    least = shown(TRACKER_SD, "um")
    if noise >= least:
        return said
    return (
        f"[tracker] {key} {noise:g}: no laser tracker measures better than {least:g} um; check the "
        "unit",
        *said,
    )


def check_robot(scenario: Scenario, robot: "Robot", *, where: str) -> None:
    """Raise one InputError if the scenario asks for what the robot does not have."""
    faults = [
        *_name_faults(scenario, robot),
        *_pool_faults(scenario.pool, robot),
        *truth_faults(scenario.truth, robot),
    ]
    for table in scenario.tables.values():
        faults += table.faults(scenario, robot)
    faults = faults or [*_free_faults(scenario, robot)] or [*_prior_faults(scenario, robot)]
    if faults:
        raise one_error(faults, where)


def _name_faults(scenario: Scenario, robot: "Robot") -> Iterator[Fault]:
    """Faults of parameters and sets that the robot does not have."""
    settings, every = scenario.identification, robot.model.names
    # joint errors that the robot has already are known: only its links are drawn anew
    links = every[: robot.model.chain.n_numbers]
    for table, key, value, word, names in (
        ("truth", "perturb", scenario.truth.perturb, "links", links),
        ("identification", "free", settings.free, "identifiable", every),
    ):
        known = tuple(dict.fromkeys((word, *robot.free_sets))) if isinstance(value, str) else names
        for name in [value] if isinstance(value, str) else value:
            if name not in known:
                yield Fault(
                    (table, key),
                    f'[{table}] {key} has "{name}", which {robot.name} does not know',
                    allowed=f"known are {', '.join(known)}" if isinstance(value, str) else "",
                    fix=did_you_mean(name, known) or f"see `truebed robots {robot.name}`",
                    value=name,
                )
    if "paper" in settings.estimators and PAPER_SET not in robot.free_sets:
        yield Fault(
            ("identification", "estimators"),
            f'[identification] estimators has "paper", but {robot.name} has no free set '
            f'"{PAPER_SET}"',
            fix='write estimators = ["whitened"]',
            value="paper",
        )


def _free_faults(scenario: Scenario, robot: "Robot") -> Iterator[Fault]:
    """Faults of what [identification] frees: a frame both free and fixed, or nothing at all."""
    settings, path = scenario.identification, ("identification", "free")
    wanted = settings.free
    listed = wanted if isinstance(wanted, tuple) else robot.free_sets.get(wanted, robot.model.names)
    states = {"base": settings.base, "tool": settings.tool}
    held = [name for name in listed if states.get(name.split(".")[0]) == "fixed"]
    if held and isinstance(wanted, tuple):
        frame = held[0].split(".")[0]
        message = f'[identification] free has "{held[0]}", and {frame} is "fixed"'
        yield Fault(path, message, fix=f'remove it, or write {frame} = "free"', value=held[0])
    elif len(held) == len(listed):
        fix = 'name at least one parameter, or write free = "identifiable"'
        yield Fault(path, "[identification] frees nothing", fix=fix, value=wanted)


def _pool_faults(pool: PoolSettings, robot: "Robot") -> Iterator[Fault]:
    """Faults of joint ranges that this robot cannot have."""
    ranges, path = pool.joint_ranges_deg, ("pool", "joint_ranges_deg")
    at, n = "[pool] joint_ranges_deg", robot.model.chain.n_joints
    if ranges and len(ranges) != n:
        message = f"{at} has {counted(len(ranges), 'entry')}; {robot.name} has {n} joints"
        yield Fault(path, message, fix="give one pair per joint", value=ranges)
        return
    for i, (low, high) in enumerate(ranges):
        slides = bool(robot.model.chain.prismatic[i])
        unit, scale = unit_of(slides), MM if slides else DEG
        lower, upper = robot.limits[i] * scale
        if low >= high or low < lower - 1e-6 or high > upper + 1e-6:
            message = f"{at} lets joint {i + 1} go from {low:g} to {high:g} {unit}"
            allowed = f"from a lower to a higher value inside {lower:g} to {upper:g} {unit}"
            yield Fault(path, message, allowed=allowed, value=(low, high))


def _prior_faults(scenario: Scenario, robot: "Robot") -> Iterator[Fault]:
    """Faults of single numbers of the prior: unknown, of the other unit, or not free."""
    prior = scenario.identification.prior
    if prior is None:
        return
    table = default_parameters(scenario, robot)
    free = set(table.free_names)
    for key, wanted in SINGLE.items():
        for name in getattr(prior, key):
            path = ("identification", "prior", key, name)
            at = f'[identification.prior.{key}] has "{name}"'
            if name not in table.names:
                fix = did_you_mean(name, table.names) or f"see `truebed robots {robot.name}`"
                message = f"{at}, which the model of {robot.name} does not know"
                yield Fault(path, message, fix=fix, value=name)
            elif name not in free:
                fix = "remove it, or free that number"
                yield Fault(path, f"{at}, which is not free", fix=fix, value=name)
            elif bool(table.is_length[table.names.index(name)]) is not wanted:
                kind, other = ("an angle", "sd_deg") if wanted else ("a length", "sd_mm")
                fix = f"move it to [identification.prior.{other}]"
                yield Fault(path, f"{at}, which is {kind}", fix=fix, value=name)


def free_parameters(scenario: Scenario, robot: "Robot", mode: "Mode") -> "Parameters":
    """Parameters that the estimator `mode` may move, before reduction.

    The paper's estimator always identifies the robot's set ``wen2022`` with base and tool fixed.
    """
    from calib.geometry.parameters import parameters_of

    table, settings = parameters_of(robot.model), scenario.identification
    if mode == "paper":
        return table.freeing(robot.free_sets[PAPER_SET])
    wanted = settings.free
    if isinstance(wanted, str):
        wanted = table.names if wanted == "identifiable" else robot.free_sets[wanted]
    states = {"base.": settings.base, "tool.": settings.tool}
    fixed = tuple(frame for frame, state in states.items() if state == "fixed")
    return table.freeing(name for name in wanted if not name.startswith(fixed))


def default_parameters(scenario: Scenario, robot: "Robot") -> "Parameters":
    """Every number that the default estimator may move, joint terms included where it may climb."""
    from calib.identification.joint_models import with_joint_terms

    free = free_parameters(scenario, robot, "whitened")
    if scenario.identification.model == "geometric":
        return free
    return with_joint_terms(robot.model, free)[1]
