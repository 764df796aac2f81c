"""Hashes of what decides a number: scenarios, robots, meshes; by content, not by place."""

from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.errors import InputError
from calib.information.criteria.named import NEEDS_GOALS
from testbed.scenario.scenario import STUDY_KEYS, Scenario
from testbed.store.npz import canonical
from testbed.studies.compensation.settings import COMPENSATION_KEYS
from testbed.studies.coverage.settings import COVERAGE_KEYS
from testbed.studies.many_robots import truth_of_kind
from testbed.studies.wen2022.settings import REEXAMINED_KEYS, SETS_KEY

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

SETTING_TABLES = ("format", "seed", "truth", "tracker", "pool", "cell", "test")


def scenario_hash(scenario: Scenario, robot: "Robot") -> str:
    """Hex sha256 of all that decides a campaign or plan: resolved scenario, robot, mesh files."""
    document = hashed_document(scenario) | {"robot": robot_hash(robot)}
    return sha256(canonical(document)).hexdigest()


def record_hash(scenario: Scenario, robot: "Robot", key: str) -> str:
    """Hex sha256 of what one record depends on.

    The setting does not depend on trials; a trial depends on no other trial and on no study, so
    adding one leaves its file byte-identical; one for V or G depends on the goal; a study depends
    on everything but names and titles. Coverage of one kind of robot depends on the first trial and
    on that kind, not on the others; so does its compensation; so does
    the paper on robots of one kind, with all trials.
    """
    document = hashed_document(scenario)
    kept: dict[str, Any] = {name: document[name] for name in SETTING_TABLES}
    if key in STUDY_KEYS:
        kept |= {
            name: document[name] for name in ("identification", "uncertainty", "studies", "trial")
        }
        kept |= _goal(document)
    elif key in COVERAGE_KEYS:
        truth = truth_of_kind(scenario, COVERAGE_KEYS[key])
        kept |= {"identification": document["identification"], "trial": document["trial"][0]}
        kept |= {"coverage": document["coverage"] | {"truths": truth.model_dump(mode="json")}}
        # when validation poses are visited hangs on the largest trial
        kept |= {"poses": [trial["poses"] for trial in document["trial"]]} | _goal(document)
    elif key in COMPENSATION_KEYS:
        truth = truth_of_kind(scenario, COMPENSATION_KEYS[key])
        kept |= {"identification": document["identification"], "trial": document["trial"][0]}
        kept |= {"compensation": document["compensation"]}
        kept["compensation"] |= {"truths": truth.model_dump(mode="json")}
        # when the program runs hangs on the largest trial
        kept |= {"poses": [trial["poses"] for trial in document["trial"]]} | _goal(document)
    elif key == SETS_KEY or key in REEXAMINED_KEYS:
        kept |= {name: document[name] for name in ("studies", "trial", "uncertainty")}
        kept |= {"pools": document["reexamined"]["pools"]} | _goal(document)
        if key in REEXAMINED_KEYS:
            truth = truth_of_kind(scenario, REEXAMINED_KEYS[key])
            kept |= {"robots": document["reexamined"]["robots"]}
            kept |= {"kind": truth.model_dump(mode="json")}
    elif key not in ("setting", "validation"):
        kept |= {name: document[name] for name in ("identification", "uncertainty")}
        kept["trial"] = next(trial for trial in document["trial"] if trial["name"] == key)
        if kept["trial"]["criterion"] in NEEDS_GOALS:
            kept |= _goal(document)
    if document["truth"]["thermal_k"]:
        # what the robot grows into until the held-out poses hangs on the largest trial
        kept |= {"poses_before": max(trial["poses"] for trial in document["trial"])}
    kept |= {"robot": robot_hash(robot), "key": key}
    return sha256(canonical(kept)).hexdigest()


def _goal(document: dict[str, Any]) -> dict[str, Any]:
    """What decides where the tool point counts."""
    return {"plan": {name: document["plan"][name] for name in ("goal", "point_mm")}}


def hashed_document(scenario: Scenario) -> dict[str, Any]:
    """The scenario for hashing: files by what is in them, with no path of this machine in it."""
    document = scenario.model_dump(mode="json")
    for table, key in (
        *((entry, "file") for entry in document["cell"]["obstacle"]),
        (document["plan"], "measured"),
    ):
        if table.get(key):
            try:
                table[key] = sha256(Path(table[key]).read_bytes()).hexdigest()
            except (OSError, ValueError) as error:
                raise InputError(
                    f'{key} "{table[key]}" cannot be read',
                    code="R7",
                    where=scenario.name,
                    field=key,
                    value=table[key],
                    fix="check the name; it starts from the scenario file",
                ) from error
    return document


@lru_cache(maxsize=4)
def robot_hash(robot: "Robot") -> str:
    """Hex sha256 of a robot's numbers and meshes, with no path of this machine in it."""
    from testbed.robots.robot import IN_PLACE

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
    if errors.terms:
        terms = [(t.name, t.joint, t.wave, t.weights) for t in errors.terms]
        document["joint_terms"] = [terms, errors.coefficients.tolist()]
    return sha256(canonical(document)).hexdigest()
