"""Odd values for every argument of the public functions: read as they are meant, or a sentence."""

import warnings

import numpy as np
import pytest
from numpy.typing import ArrayLike

import calib
from calib import design, uncertainty
from calib.compensation import corrected_poses
from calib.errors import CalibError, InputError
from calib.geometry.fixtures import Fixtures
from calib.geometry.inverse import inverse_kinematics
from calib.geometry.joint_errors import JointErrors, JointTerm, harmonic_terms
from calib.geometry.operating import OperatingConditions
from calib.geometry.parameters import Parameters
from calib.identification.ladders import ladders_of
from calib.identification.levels import NOTHING, Ladder, Level
from calib.identification.model_choice import choose
from calib.identification.prior import Prior, weak_prior
from calib.identification.start.start import start_frames
from calib.information.goals import goal_matrix
from calib.information.observability import indices
from calib.kinds import checked_kinds, of_kind
from calib.measurement import (
    iso9283,
    iso_drift,
    iso_limits,
    iso_memory,
    iso_paths,
    iso_rotations,
    iso_straying,
)

LINKS = [[0, 0.4, 0.1, -1.57, 0], [0, 0, 0.5, 0, 0], [0, 0, 0.4, 0, 0]]
ARM = calib.RobotModel(calib.Chain(LINKS))
RNG = np.random.default_rng(0)
Q = RNG.uniform(-2, 2, (40, 3))
T = ARM.poses(Q)
SEEN = calib.points(Q, T[:, :3, 3] + RNG.normal(size=(40, 3)) * 2e-5, sd=2e-5)
TRAIN, TEST = SEEN.split(held_out=10)
ALL, SOME = calib.parameters_of(ARM), calib.parameters_of(ARM, ["d1", "a2", "theta3"])
FOUND = calib.calibrate(ARM, TRAIN)
FROZEN = uncertainty.freeze(ARM, TRAIN, SOME)
PROBLEM = design.Problem.of_poses(ARM, Q, poses=12, criterion="V", goals=Q[:5])
PLACES = np.arange(12)
LIMITS = np.tile([-3.0, 3.0], (3, 1))
WIDE = np.eye(27) * 1e-12
CYCLES = RNG.normal(size=(2, 10, 3))
DRAWN = uncertainty.adaptive(lambda n, rng: rng.normal(size=(n, 2)), RNG, digits=1)
CONDITIONS = {
    "payload": np.ones(2), "center": np.zeros((2, 3)), "approach": np.ones((2, 3)),
    "torque": np.ones((2, 3)), "temperature": np.ones(2),
}  # fmt: skip


def judged(**known):
    circumstances = calib.Circumstances(**known)
    return calib.judge(FOUND.identification, TEST, train=TRAIN, circumstances=circumstances)


def two_named_alike(wave, joint):
    """A ladder with a term of that name."""
    errors = JointErrors((JointTerm("wave", joint, wave, (1, 0, 0)),))
    return Ladder(wave, (NOTHING, Level(wave, errors, [1e-3])))


CASES = {
    "Chain": (calib.Chain, {"links": LINKS, "kinds": ("revolute",) * 3, "T_world_base": np.eye(4)}),
    "Fixtures": (Fixtures, {"reflectors": np.zeros((1, 3)), "stations": np.eye(4)[None]}),
    "OperatingConditions": (OperatingConditions, CONDITIONS),
    "JointTerm": (JointTerm, {"name": "a", "joint": 1, "wave": "sin", "weights": (0, 1, 0)}),
    "JointErrors": (JointErrors, {"terms": harmonic_terms(3), "coefficients": np.zeros(12)}),
    "RobotModel": (
        calib.RobotModel,
        {"chain": ARM.chain, "joint_errors": JointErrors(), "fixtures": Fixtures()},
    ),
    "RobotModel.poses": (ARM.poses, {"q": Q, "at": OperatingConditions()}),
    "RobotModel.poses_and_jacobian": (ARM.poses_and_jacobian, {"q": Q}),
    "step_to": (ARM.step_to, {"other": ARM}),
    "moved": (ARM.moved, {"step": np.zeros(27)}),
    "poses": (
        calib.poses,
        {"q": Q, "T": T, "sd": (1e-5, 1e-4), "station": 0, "tool": 0, "pose_id": np.arange(40)},
    ),
    "points": (
        calib.points,
        {"q": Q, "xyz": T[:, :3, 3], "sd": 1e-5, "offset": (0, 0, 0), "reflector": -1, "repeat": 0},
    ),
    "distances": (calib.distances, {"q": Q, "d": np.ones(40), "sd": 1e-5, "anchor": 0}),
    "joined": (calib.joined, {"tables": [SEEN, TEST]}),
    "split": (SEEN.split, {"held_out": 10, "seed": 0}),
    "rows": (SEEN.rows, {"which": [0, 1]}),
    "parameters_of": (calib.parameters_of, {"model": ARM, "free": ["d1"]}),
    "freeing": (ALL.freeing, {"names": ["d1"]}),
    "Parameters": (
        Parameters,
        {"names": ALL.names, "is_length": ALL.is_length, "free": ALL.free, "scale": ALL.scale},
    ),
    "Prior": (
        Prior,
        {"mean": np.zeros(2), "sd": np.ones(2), "names": ("d1", "a2"), "precision": np.eye(2)},
    ),
    "of_precision": (
        Prior.of_precision,
        {"mean": np.zeros(2), "precision": np.eye(2), "names": ("d1", "a2")},
    ),
    "weak_prior": (weak_prior, {"parameters": ALL, "model": ARM}),
    "identify": (
        calib.identify,
        {
            "nominal": ARM, "measurements": TRAIN, "parameters": SOME, "mode": "whitened",
            "prior": weak_prior(SOME), "loss": "squared", "start": ARM,
        },
    ),
    "calibrate": (
        calib.calibrate,
        {
            "model": ARM, "measured": TRAIN, "free": ["d1", "a2"], "free_tool": True,
            "free_anchors": (), "prior": None, "loss": "squared",
        },
    ),
    "start_frames": (
        start_frames,
        {"model": ARM, "measurements": TRAIN, "free_tool": True, "free_anchors": ()},
    ),
    "choose": (
        choose,
        {
            "nominal": ARM, "measurements": TRAIN, "parameters": SOME, "prior": weak_prior(SOME),
            "own_prior": None, "ladders": (), "loss": "squared", "mounted": None, "rng": None,
        },
    ),
    "ladders_of": (
        ladders_of,
        {
            "nominal": ARM, "mounted": ARM.chain, "moments": None, "limits": LIMITS,
            "payload": None, "waves": (0.1, 0.1), "sag": 0.1,
        },
    ),
    "Level": (Level, {"name": "a", "errors": JointErrors(), "sd": (), "mean": (), "after": ""}),
    "judge": (
        calib.judge,
        {
            "identification": FOUND.identification, "test": TEST, "train": TRAIN,
            "circumstances": None, "probability": 0.95, "rng": None, "replicates": 100,
            "rejected_too": False, "linear": None,
        },
    ),
    "CalibratedRobot.judge": (FOUND.judge, {"test": TEST, "circumstances": None, "rng": None}),
    "Circumstances": (
        judged,
        {
            "visits": SEEN, "order": (np.arange(30), np.arange(30, 40)), "shared": 0 * WIDE,
            "repeatability": np.zeros(3), "told_by": "x", "drawn": True, "target": (0, 0, 0),
            "doubted": None, "stations_are_visits": False, "unmodelled": (),
        },
    ),
    "compensate": (
        calib.compensate, {"nominal": ARM, "identified": ARM, "q": Q[:2], "limits": LIMITS},
    ),
    "corrected_poses": (
        corrected_poses,
        {"nominal": ARM, "identified": ARM, "T": T[:2], "seeds": Q[:2], "limits": LIMITS},
    ),
    "inverse_kinematics": (
        inverse_kinematics, {"model": ARM, "T": T[:2], "seeds": Q[:2], "limits": LIMITS},
    ),
    "SinglePoses.of": (calib.SinglePoses.of, {"model": ARM}),
    "SinglePoses.pose": (calib.SinglePoses.of(ARM).pose, {"q": Q[0]}),
    "goal_matrix": (
        goal_matrix,
        {"model": ARM, "q_goals": Q[:3], "parameters": SOME, "weights": np.ones(3)},
    ),
    "bootstrap": (
        uncertainty.bootstrap,
        {
            "model": ARM, "measurements": TRAIN, "parameters": SOME, "rng": RNG,
            "replicates": 100, "steps": 2, "prior_precision": None, "threads": 1,
        },
    ),
    "of_blocks": (
        design.Problem.of_blocks,
        {
            "blocks": PROBLEM.blocks, "poses": 12, "criterion": "D", "prior": None,
            "given": (1, 2), "allowed": None, "repeats": False, "names": PROBLEM.names,
        },
    ),
    "of_poses": (
        design.Problem.of_poses,
        {
            "model": ARM, "pool_q": Q, "poses": 12, "criterion": "V", "goals": Q[:3],
            "noise": (1e-5, 1e-4), "target": (0, 0, 0), "free": ["d1", "a2"], "given": (),
            "repeats": False,
        },
    ),
    "greedy": (design.greedy, {"problem": PROBLEM}),
    "certify": (
        design.certify,
        {"problem": PROBLEM, "indices": PLACES, "iterations": 10, "tolerance": 0.01},
    ),
    "detmax": (
        design.detmax,
        {"problem": PROBLEM, "rng": RNG, "a": 2, "b": 1, "c": 1, "d": 2, "start": PLACES},
    ),
    "exchange": (design.exchange, {"problem": PROBLEM, "rng": RNG, "restarts": 1}),
    "fedorov": (design.fedorov, {"problem": PROBLEM, "rng": RNG, "start": PLACES}),
    "random_sets": (design.random_sets, {"problem": PROBLEM, "rng": RNG, "sets": 2}),
    "relaxation": (
        design.relaxation, {"problem": PROBLEM, "iterations": 10, "tolerance": 0.01},
    ),
    "pose_count": (
        design.pose_count, {"problem": PROBLEM, "rng": RNG, "counts": [10, 12], "sets": 2},
    ),
    "freeze": (
        uncertainty.freeze,
        {"model": ARM, "measurements": TRAIN, "parameters": SOME, "prior_precision": np.eye(3)},
    ),
    "refit": (
        uncertainty.refit,
        {
            "start": FROZEN, "position": TRAIN.position[None], "rotation": TRAIN.rotation[None],
            "prior_mean": None, "steps": 2, "threads": 1,
        },
    ),
    "adaptive": (
        uncertainty.adaptive,
        {
            "sample": lambda n, rng: rng.normal(size=(n, 1)), "rng": RNG, "digits": 1,
            "probability": 0.95, "finer": 1.0, "batch": None, "most": 100_000,
        },
    ),
    "conformal": (uncertainty.conformal, {"distance": np.ones(20), "probability": 0.95}),
    "coverage_factor": (uncertainty.coverage_factor, {"dimension": 3, "probability": 0.95}),
    "expanded": (
        uncertainty.expanded, {"standard": np.ones(3), "dimension": 3, "probability": 0.95},
    ),
    "ellipsoid": (uncertainty.ellipsoid, {"covariance": np.eye(3), "probability": 0.95}),
    "inside": (
        uncertainty.inside, {"error": np.ones(3), "covariance": np.eye(3), "probability": 0.95},
    ),
    "held_out": (
        uncertainty.held_out,
        {"model": ARM, "covariance": WIDE, "validation": TEST, "used_q": TRAIN.q},
    ),
    "discrepancy": (
        uncertainty.discrepancy,
        {"validation": uncertainty.held_out(ARM, WIDE, TEST, TRAIN.q)},
    ),
    "distance_spread": (
        uncertainty.distance_spread,
        {
            "model": ARM, "q": Q[:2], "standard": np.full(27, 1e-6), "rng": RNG,
            "draws": 2000, "probability": 0.95,
        },
    ),
    "point_spread": (
        uncertainty.point_spread,
        {"model": ARM, "q": Q[:2], "covariance": WIDE, "rng": RNG, "draws": 2000},
    ),
    "tool_statement": (
        uncertainty.tool_statement,
        {"model": ARM, "q": Q[:2], "covariance": WIDE, "probability": 0.95, "target": None},
    ),
    "propagate": (uncertainty.propagate, {"model": ARM, "q": Q[:2], "steps": np.zeros((3, 27))}),
    "tool_map": (
        uncertainty.tool_map,
        {
            "regions": lambda q: uncertainty.tool_statement(ARM, q, WIDE),
            "q": Q[:5], "cell": 0.05,
        },
    ),
    "type_a": (uncertainty.type_a, {"estimates": np.ones((3, 2))}),
    "common_inputs": (
        uncertainty.common_inputs,
        {
            "names": ["a"], "sensitivity": np.ones((30, 6, 1)), "variance": [1.0],
            "degrees_of_freedom": 5,
        },
    ),
    "budget": (
        uncertainty.budget,
        {
            "start": FROZEN, "noise": [uncertainty.RowNoise("a", TRAIN.covariance, 5.0)],
            "common": (),
        },
    ),
    "first_order": (
        uncertainty.first_order,
        {"model": lambda x: 2 * x, "mean": np.ones(2), "covariance": np.eye(2)},
    ),
    "validate": (
        uncertainty.validate,
        {"value": np.zeros(2), "covariance": np.eye(2), "monte_carlo": DRAWN, "digits": 2},
    ),
    "content_range": (
        uncertainty.conformal(np.ones(20)).content_range, {"probability": 0.9},
    ),
    "at_tool": (
        uncertainty.budget(FROZEN, [uncertainty.RowNoise("a", TRAIN.covariance)]).at_tool,
        {"model": ARM, "q": Q[:2]},
    ),
    "indices": (indices, {"singular": [3.0, 2.0, 1.0], "n_poses": 4}),
    "accuracy": (
        iso9283.accuracy, {"position": CYCLES, "command": np.zeros((2, 3)), "common": np.eye(3)},
    ),
    "repeatability": (iso9283.repeatability, {"position": CYCLES, "noise": np.eye(3)}),
    "approaches": (iso9283.approaches, {"position": CYCLES}),
    "distance_accuracy": (
        iso9283.distance_accuracy,
        {"first": CYCLES[0], "second": CYCLES[1], "distance": 1.0, "common": 0.1},
    ),
    "distance_repeatability": (
        iso9283.distance_repeatability,
        {"first": CYCLES[0], "second": CYCLES[1], "noise": np.eye(3)},
    ),
    "rotation_accuracy": (
        iso_rotations.rotation_accuracy,
        {"R": np.tile(np.eye(3), (2, 4, 1, 1)), "command": np.eye(3), "common": np.eye(3)},
    ),
    "rotation_repeatability": (
        iso_rotations.rotation_repeatability,
        {"R": np.tile(np.eye(3), (2, 4, 1, 1)), "noise": np.eye(3)},
    ),
    "mean_limits": (
        iso_limits.mean_limits,
        {"figure": iso9283.accuracy(CYCLES, [0, 0, 0]), "dof": 9, "probability": 0.95},
    ),
    "largest_limits": (
        iso_limits.largest_limits,
        {"figure": iso9283.gaps(CYCLES), "dof": 18, "probability": 0.95},
    ),
    "spread_limits": (iso_limits.spread_limits, {"value": [1.0], "n": 10, "probability": 0.95}),
    "repeatability_limits": (
        iso_limits.repeatability_limits, {"position": CYCLES, "probability": 0.95},
    ),
    "path_figures": (
        iso_paths.path_figures,
        {
            "position": CYCLES, "command": [[0, 0, 0], [1, 0, 0]],
            "noise": np.tile(np.eye(3), (2, 1, 1)), "readings": 2,
        },
    ),
    "drift": (
        iso_drift.drift, {"position": CYCLES, "command": np.zeros((2, 3)), "block": 5},
    ),
    "straying_cycle": (iso_straying.straying_cycle, {"position": CYCLES}),
    "cycle_memory": (iso_memory.cycle_memory, {"position": CYCLES}),
}  # fmt: skip
"""Functions with arguments that they take."""
ODD = (
    None, "abc", "", [], {}, object(), -1, 0, 1.5, np.nan, np.inf, True, int, 1j, 10**400,
    np.zeros((2, 2)), np.zeros(0), np.array(["a"]), [[1, 2], [3]], [[[[1.0]]]], ["a", "b"],
    np.full(40, np.nan), [-1, -1], [10**6],
)  # fmt: skip
SEARCHES = ("certify", "detmax", "exchange", "random_sets", "relaxation", "pose_count")
"""Asked for very much, they do it."""
OWN = {("adaptive", "sample"), ("tool_map", "regions"), ("first_order", "model")}
"""Functions of the caller: what they raise is theirs."""


@pytest.mark.parametrize("name", CASES)
def test_what_a_public_function_is_fed_is_taken_or_refused_in_words(name):
    function, right = CASES[name]
    function(**right)
    raw = []
    for argument in right:
        for odd in ODD:
            endless = name in SEARCHES and isinstance(odd, int) and odd > 1
            if endless or ((name, argument) in OWN and callable(odd)):
                continue
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    function(**{**right, argument: odd})
            except CalibError as error:
                assert str(error).endswith("]")  # noqa: PT017  # both outcomes are right
            except Exception as error:  # this is what must not come out
                raw.append(f"{argument} = {odd!r}: {error!r}")
    assert not raw, "\n".join(raw)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda: calib.joined([]), "there are no tables to join; expected at least one"),
        (lambda: calib.joined(SEEN), "tables is of the type Measurements; several, each calib.Mea"),
        (lambda: calib.joined([SEEN, Q]), r"tables\[1\] is of the type ndarray"),
        (
            lambda: calib.joined([SEEN, calib.points(Q[:, :2], T[:, :3, 3], sd=1e-5)]),
            "tables have rows of 3 and 2 joints; rows of one robot",
        ),
        (
            lambda: calib.poses(Q, T, sd=[1e-5] * 3),
            r"sd has shape \(3,\); two numbers, 6, or covariances \(6, 6\)",
        ),
        (lambda: iso9283.distance_accuracy(*CYCLES, np.nan), "distance is nan"),
        (
            lambda: iso9283.accuracy(np.ma.masked_greater(CYCLES, 1.0), np.zeros(3)),
            "position has masked entries",
        ),
        (
            lambda: iso_rotations.rotation_accuracy(np.ones((4, 3, 3)), np.eye(3)),
            r"R\[0\] is not a rotation; an orthonormal right-handed matrix",
        ),
        (
            lambda: iso_limits.mean_limits(iso9283.accuracy(CYCLES, np.zeros(3)), 0),
            "dof is 0; expected above zero",
        ),
        (
            lambda: uncertainty.budget(
                FROZEN, [uncertainty.RowNoise("a", TRAIN.covariance)]
            ).at_tool(calib.RobotModel(calib.Chain(LINKS[:2])), Q[:, :2]),
            "the budget has 27 numbers, the model has 22; the model that the budget is of",
        ),
        (
            lambda: uncertainty.held_out(ARM, WIDE, TEST.rows([]), Q),
            "there are no validation poses; expected at least one",
        ),
        (
            lambda: calib.parameters_of(ARM, "d1"),
            r"free is of the type str.* give a list: \['d1'\]",
        ),
        (
            lambda: calib.identify(ARM, TRAIN, SOME, loss="hubr"),
            'loss is "hubr"; expected one of squared,',
        ),
        (lambda: calib.judge(FOUND.identification, TEST, train=TRAIN, rng=1), "rng is of the type"),
        (lambda: SEEN.rows([40]), "which names no such rows; a mask of 40 rows, or places from 0"),
        (lambda: SEEN.rows([0.5]), "which names no such rows"),
        (lambda: uncertainty.coverage_factor(2.5), "dimension is 2.5; expected a whole number"),
        (lambda: ladders_of(ARM, waves=(0.1,)), "waves has 1 entries; expected 2"),
        (
            lambda: choose(
                ARM, TRAIN, SOME, ladders=[two_named_alike("sin", 0), two_named_alike("cos", 1)]
            ),
            "two levels have different terms of the name wave; rename one of them",
        ),
        (lambda: calib.Circumstances(drawn="no"), "drawn is of the type str; True or False"),
    ],
)
def test_the_sentence_says_what_is_wanted(wrong, sentence):
    with pytest.raises(InputError, match=sentence):
        wrong()


def test_of_no_posture_there_is_a_line_too():
    """A script that warns of a mean of nothing would stop at the prompt."""
    budget = uncertainty.budget(FROZEN, [uncertainty.RowNoise("a", 0 * TRAIN.covariance)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lines = [
            repr(uncertainty.tool_statement(ARM, Q[:0], WIDE)),
            repr(uncertainty.point_spread(ARM, Q[:0], WIDE, RNG, draws=10)),
            repr(budget.at_tool(ARM, Q[:0])),
            repr(iso9283.accuracy(np.zeros((0, 5, 3)), np.zeros((0, 3)))),
        ]
        assert all("0 " in line for line in lines)
        assert not budget.at_tool(ARM, Q[:2]).share.any()
    with pytest.raises(InputError, match="q has no postures"):
        uncertainty.distance_spread(ARM, Q[:0], np.zeros(27), RNG)
    sets = design.random_sets(PROBLEM, RNG, sets=2)
    assert repr(sets).startswith(type(sets).__name__)


def test_what_is_meant_is_taken():
    assert calib.parameters_of(ARM, (name for name in ("d1", "a2"))).free_names == ("d1", "a2")
    assert calib.parameters_of(ARM, np.array(["d1"])).n_free == 1
    assert uncertainty.coverage_factor(np.int64(3)) == uncertainty.coverage_factor(3)
    assert len(SEEN.rows([-1])) == 1
    assert of_kind("x", None, int | None) is None


def test_a_union_with_a_name_is_what_it_stands_for():
    """numpy names its ArrayLike from 2.5 on, where Python lets it: such a name has no parts."""

    class Named:
        __value__ = ArrayLike

    for kind in (ArrayLike, ArrayLike | None, Named()):
        value = object()  # arrays are looked at elsewhere
        assert of_kind("x", value, kind) is value
    Named.__value__ = int | str
    with pytest.raises(InputError, match="x is of the type list"):
        of_kind("x", [1], Named())


def test_a_function_keeps_its_name_and_words():
    def double(count: int) -> int:
        """Twice as much."""
        return 2 * count

    checked = checked_kinds(double)
    assert (checked.__name__, checked.__doc__) == ("double", "Twice as much.")
    assert checked(count=np.int32(2)) == 4
