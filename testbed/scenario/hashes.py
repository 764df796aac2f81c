"""Hashes of what decides the numbers of a campaign, and of each of its records."""

from collections.abc import Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.errors import refuse
from testbed.disk import read_bounded
from testbed.scenario.laboratory import TruthSettings
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import BudgetSettings, TrialSettings
from testbed.store.npz import canonical

if TYPE_CHECKING:
    from testbed.robots.robot import Robot


MOST_BYTES = 20_000_000
"""Of a file that a scenario names: the largest mesh that is read, and more than any table."""
LATER_TRUTH = {
    "transmission_mdeg": ("transmission_waves",),
    "gear_mdeg": ("gear_ratio",),
    "payloads_kg": (),
    "motion": (
        *("speed_deg_s", "speed_mm_s", "approach_deg", "dwell_s", "friction_nm", "damping"),
    ),
}
"""Switches of [truth] that earlier versions had not, and the keys that only count beside them."""
SETTING_TABLES = ("format", "seed", "truth", "tracker", "pool", "cell", "test")


def scenario_hash(scenario: Scenario, robot: "Robot") -> str:
    """Hex sha256 of all that decides a campaign or plan: resolved scenario, robot, mesh files."""
    document = hashed_document(scenario) | {"robot": robot_hash(robot)}
    return sha256(canonical(document)).hexdigest()


def growing_hash(scenario: Scenario, robot: "Robot") -> str:
    """The same without numbers of robots: what was played of some is kept when there are more."""
    document = hashed_document(scenario) | {"robot": robot_hash(robot)}
    for name, table in scenario.tables.items():
        for key in table.totals:
            del document[name][key]
    del document["studies"]["population"]
    return sha256(canonical(document)).hexdigest()


def record_hash(reads: Mapping[str, Any], robot: "Robot", key: str) -> str:
    """Hex sha256 of what one record depends on: what it reads of the scenario, robot and key."""
    return sha256(canonical({**reads, "robot": robot_hash(robot), "key": key})).hexdigest()


def shared_part(scenario: Scenario) -> dict[str, Any]:
    """What every record reads: all that decides the robot, the laboratory and its poses.

    It depends on no trial and no study, so that adding one leaves every other file byte-identical.
    """
    kept = part(scenario, *SETTING_TABLES)
    if scenario.fixtures is not None:
        kept |= part(scenario, "fixtures")
        # which comes first counts, and hashed tables have no order
        kept["targets"] = [*scenario.fixtures.reflectors_mm, *scenario.fixtures.anchors_mm]
    if kept["truth"]["thermal_k"]:
        # what the robot grows into until the held-out poses depends on the largest trial
        kept["poses_before"] = max(trial.poses for trial in scenario.trial)
    return kept


def part(scenario: Scenario, *names: str) -> dict[str, Any]:
    """Some tables of the scenario, as they are hashed."""
    document = hashed_document(scenario)
    return {name: document[name] for name in names if name in document}


def goal_part(scenario: Scenario) -> dict[str, Any]:
    """What decides where the tool point counts."""
    plan = part(scenario, "plan")["plan"]
    return {"plan": {name: plan[name] for name in ("goal", "point_mm")}}


def hashed_document(scenario: Scenario) -> dict[str, Any]:
    """The scenario for hashing: files by what is in them, with no path of this machine in it."""
    document = scenario.document() | {"truth": truth_part(scenario.truth)}
    _leave_out_later_keys(document)
    for table, key in (
        *((entry, "file") for entry in document["cell"]["obstacle"]),
        (document["plan"], "measured"),
    ):
        if table.get(key):
            try:
                content = read_bounded(Path(table[key]), MOST_BYTES)
                table[key] = sha256(content).hexdigest()
            except (OSError, ValueError) as error:  # ValueError: a NUL in the name
                reason = getattr(error, "strerror", None) or "its name is not a path"
                message = f'{key} "{table[key]}" cannot be read: {reason}'
                fix, at = "check the name; it starts from the scenario file", scenario.name
                raise refuse(
                    key, table[key], code="R7", message=message, fix=fix, where=at
                ) from error
    return document


def _leave_out_later_keys(document: dict[str, Any]) -> None:
    """Take away, in place, what earlier versions had no key for and did just so.

    A run folder of theirs stays that of the same scenario.
    """
    if document["budget"] == BudgetSettings().model_dump(mode="json"):
        del document["budget"]
    if document["plan"]["use"] is None:
        del document["plan"]["use"]
    usual = list(TrialSettings.model_fields["detmax"].default)
    for trial in document["trial"]:
        if trial["detmax"] == usual:
            del trial["detmax"]


def truth_part(truth: TruthSettings) -> dict[str, Any]:
    """A truth as it is hashed: without later keys where the term they belong to is off."""
    document = truth.model_dump(mode="json")
    for switch, keys in LATER_TRUTH.items():
        usual = TruthSettings.model_fields[switch].default
        if document[switch] == (list(usual) if isinstance(usual, tuple) else usual):
            for key in (switch, *keys):
                del document[key]
    return document


@lru_cache(maxsize=4)
def robot_hash(robot: "Robot") -> str:
    """Hex sha256 of a robot's numbers and meshes, with no path of this machine in it."""
    from testbed.robots.parts import IN_PLACE
    from testbed.robots.springs import springs_table

    chain, errors = robot.model.chain, robot.model.joint_errors
    numbers = (
        chain.links,
        chain.T_world_base,
        chain.T_flange_tool,
        robot.limits,
        robot.speeds,
        robot.masses,
        robot.centers,
        robot.inertias,
        robot.repeatability,
    )
    document = {
        "name": robot.name,
        "kinds": chain.kinds,
        "numbers": [array.tolist() for array in numbers],
        "floor": robot.base_offset,
        "exclusions": robot.exclusions,
        "free_sets": dict(robot.free_sets),
        "parts": [
            [v.name, v.link, v.collides, sha256(v.file.read_bytes()).hexdigest()]
            for v in robot.visuals
        ],
    }
    moved = [v.affine for v in robot.visuals if v.affine != IN_PLACE]
    if moved:
        document["moved"] = moved
    if hidden := [v.name for v in robot.visuals if not v.drawn]:
        document["hidden"] = hidden
    if robot.mounting_height is not None:
        document["mounting_height"] = robot.mounting_height
    if robot.primitives:
        document["primitives"] = [
            [p.name, p.link, p.collides, p.drawn, p.form, p.affine] for p in robot.primitives
        ]
    if robot.tolerances is not None:
        document["tolerances"] = robot.tolerances.tolist()
    if not robot.controller.plain:
        counted = robot.controller.matrix, robot.controller.limits
        document["controller"] = [repr(array.tolist()) for array in counted]
    if errors.terms:
        terms = [
            (
                t.name,
                t.joint,
                t.wave,
                t.weights,
                *([t.reference] if t.reference else []),
                *([f"share {t.share!r}"] if t.share != 1.0 else []),
            )
            for t in errors.terms
        ]
        document["joint_terms"] = [terms, errors.coefficients.tolist()]
    if errors.springs is not None:
        document["springs"] = springs_table(errors)
    return sha256(canonical(document)).hexdigest()
