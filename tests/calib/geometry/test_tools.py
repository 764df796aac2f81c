"""Further tools: numbers of the model, and rows that were measured with one of them."""

from dataclasses import replace

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import exp_so3, inverse
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.evidence.normal_equations import normal_equations
from calib.identification.identify import identify
from calib.identification.prior import step_derivative, weak_prior
from calib.identification.start.start import start_frames
from calib.measurement import tables
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import perfect, predict, predicted_positions
from calib.measurement.residual import linearize, paper_stack
from calib.uncertainty.refit import unknown_to_loops
from tests.calib.kinds import (
    ARMS,
    NOISE,
    TURN_NOISE,
    anywhere,
    joints,
    require_derivatives,
    true_robot,
)
from tests.reference import pool_r


def robot_with_tools(seed: int = 0) -> RobotModel:
    """Two further tools, two further stations, terms between the chain and them."""
    rng = np.random.default_rng(seed)
    true = true_robot("tx60", rng)
    return replace(
        true,
        joint_errors=JointErrors(gravity_terms(6), rng.normal(size=3) * 1e-3),
        fixtures=replace(
            true.fixtures,
            stations=np.array([anywhere(rng, 3.0), anywhere(rng, 3.0)]),
            tools=np.array([anywhere(rng, 0.2), anywhere(rng, 0.2)]),
        ),
    )


def with_tool(model: RobotModel, k: int) -> RobotModel:
    """The same robot with tool k in place of its own: the second way to every number here."""
    tool = model.chain.T_flange_tool if k == 0 else model.fixtures.tools[k - 1]
    return replace(model, chain=replace(model.chain, T_flange_tool=tool))


def seen_poses(
    true: RobotModel, q: Array, rng: np.random.Generator, *, station: int, tool: int
) -> Measurements:
    """Full poses of a tool, from a station, by the chain alone."""
    T = inverse(true.fixtures.station_frames[station]) @ with_tool(true, tool).poses(q)
    T[:, :3, 3] += rng.normal(size=(len(q), 3)) * NOISE
    T[:, :3, :3] = exp_so3(rng.normal(size=(len(q), 3)) * TURN_NOISE) @ T[:, :3, :3]
    return tables.poses(q, T, sd=(NOISE, TURN_NOISE), station=station, tool=tool)


def every_tool(true: RobotModel, q: Array, rng: np.random.Generator) -> Measurements:
    """Poses, points and distances with every tool; readings are only roughly those."""
    rows = []
    for k in range(3):
        rows.append(seen_poses(true, q, rng, station=k, tool=k))
        near = with_tool(true, k).poses(q)[:, :3, 3]
        rows.append(tables.points(q, near, sd=1e-4, offset=(0.1, 0, 0.2), tool=k))
        rows.append(tables.points(q, near, sd=1e-4, reflector=1, station=2, tool=k))
        far = replace(tables.distances(q, np.ones(len(q)), sd=1e-4, anchor=k), tool=[k] * len(q))
        rows.append(far)
    return joined(rows)


def test_tools_come_last_are_named_and_move_in_their_own_axes():
    model = robot_with_tools()
    assert model.names[-12:-6] == tuple(f"tool2.{a}" for a in ("x", "y", "z", "rx", "ry", "rz"))
    assert model.is_length[-6:] == (True,) * 3 + (False,) * 3
    assert model.n_numbers == len(model.names) == 45 + 9 + 12 + 12 + 12
    step = np.random.default_rng(1).normal(size=model.n_numbers) * 0.1
    # rounding of rotations up to pi away, a few parts in 1e16 of meters
    np.testing.assert_allclose(model.step_to(model.moved(step)), step, atol=1e-12)
    alone = np.zeros(model.n_numbers)
    alone[-6] = 0.1
    moved = inverse(model.fixtures.tools[1]) @ model.moved(alone).fixtures.tools[1]
    np.testing.assert_allclose(moved[:3, 3], [0.1, 0, 0], atol=1e-14)


def test_a_step_of_a_step_follows_the_chain_rule_for_tools_too():
    rng, model = np.random.default_rng(6), robot_with_tools()
    step, small = rng.normal(size=model.n_numbers) * 0.3, rng.normal(size=model.n_numbers) * 1e-6
    there = model.moved(step)
    change = model.step_to(there.moved(small)) - model.step_to(there)
    # second order, 1e-12, and rounding of the logarithm
    np.testing.assert_allclose(change, step_derivative(step, there) @ small, atol=2e-11)


def test_rows_of_a_tool_are_those_of_a_robot_that_carries_it():
    """Residuals are those of the chain with the tool in place of its own, and so are all columns
    but those of the tool, which have moved to its own numbers."""
    rng, model = np.random.default_rng(2), robot_with_tools()
    table = every_tool(model, pool_r(3), rng)
    seen, own = predict(model, table), model.n_numbers - 12
    chain_tool = slice(36, 42)
    for k in range(3):
        rows = table.tool == k
        plain = replace(table.rows(rows), tool=np.zeros(rows.sum(), dtype=int))
        alone = predict(with_tool(model, k), plain)
        # the same products in another order
        np.testing.assert_allclose(seen.residual[rows], alone.residual, atol=1e-13)
        expected = alone.rows.copy()
        if k:
            here = own + 6 * (k - 1)
            expected[:, :, here : here + 6] = alone.rows[:, :, chain_tool]
            expected[:, :, chain_tool] = 0.0
        np.testing.assert_allclose(seen.rows[rows], expected, atol=1e-12)
        np.testing.assert_allclose(
            predicted_positions(model, table.rows(rows)),
            predicted_positions(with_tool(model, k), plain), atol=1e-13,
        )  # fmt: skip


def test_every_row_has_the_derivative_of_its_residual_in_every_number_of_the_tools():
    rng, true = np.random.default_rng(3), robot_with_tools()
    table = every_tool(true, pool_r(2), rng)
    model = true.moved(rng.normal(size=true.n_numbers) * 0.1)
    require_derivatives(
        model, table, (*range(36, 42), *range(model.n_numbers - 12, model.n_numbers), 0, 4, 12, 43)
    )


def test_a_climb_sees_the_rows_of_every_tool():
    """Terms that compete move whatever tool is mounted: the rows of a model that has them."""
    rng, model = np.random.default_rng(6), robot_with_tools()
    q = joints("tx60", rng, 40)
    table = joined([seen_poses(model, q, rng, station=k, tool=k) for k in range(3)])
    free = [n for n in model.names if not n.startswith(("reflector", "anchor", "gravity"))]
    parameters = parameters_of(model, free)
    wide = JointErrors(harmonic_terms(6)[:4])
    found = normal_equations(model, model, table, parameters, [wide], weak_prior(parameters, model))
    both = model.joint_errors.joined(wide)
    seen = linearize(replace(model, joint_errors=both), table)
    names = list(replace(model, joint_errors=both).names)
    own = [names.index(name) for name in (*free, *wide.names)]
    # as triangles: the same rows in another order of sums
    np.testing.assert_allclose(
        found.A.reshape(-1, len(own)), seen.A[:, own], rtol=1e-9, atol=1e-6 * np.abs(seen.A).max()
    )


def test_a_perfect_table_of_any_tool_leaves_no_residual():
    model = robot_with_tools()
    table = perfect(model, every_tool(model, pool_r(4), np.random.default_rng(4)))
    assert np.abs(predict(model, table).residual).max() < 1e-13


@pytest.mark.parametrize("stations", [(0, 1, 2), (0, 0, 2), (0, 1, 1)], ids=str)
def test_frames_of_all_visits_are_found_from_nothing(stations: tuple[int, int, int]):
    """A tool remounted, a tracker moved, both or one of them: the truth is meters away."""
    rng, true = np.random.default_rng(5), robot_with_tools()
    true = replace(true, joint_errors=JointErrors())
    q = joints("tx60", rng, 90)
    table = joined(
        [
            seen_poses(true, q[30 * k : 30 * k + 30], rng, station=s, tool=k)
            for k, s in enumerate(stations)
        ]
    )
    nowhere = replace(
        true.fixtures, stations=np.tile(np.eye(4), (2, 1, 1)), tools=np.tile(np.eye(4), (2, 1, 1))
    )
    start = start_frames(RobotModel(ARMS["tx60"], fixtures=nowhere), table)
    # links wrong by 0.3 mm and 0.1 deg leave millimeters at an arm's length
    assert start.position_rms < 5e-3
    free = [name for name in true.names if not name.startswith(("reflector", "anchor"))]
    seen = {f"station{s + 1}" for s in stations}
    free = [n for n in free if not n.startswith("station") or n.split(".")[0] in seen]
    found = identify(start.model, table, parameters_of(start.model, free))
    # 540 equations, chi-square within five standard deviations
    assert abs(found.chi_square - found.dof) < 5 * np.sqrt(2 * found.dof)
    # 30 numbers of one visit, and twelve or six for every frame that differs
    assert found.rank == 30 + 12 + 6 * len(set(stations) - {0})


def test_rows_of_a_tool_that_is_not_there_or_below_zero_are_refused():
    model = robot_with_tools()
    table = every_tool(model, pool_r(2), np.random.default_rng(7))
    with pytest.raises(
        InputError, match=r"tool\[\d+\] is 2, and the model has 2 tools; expected 0 to 1"
    ):
        predict(replace(model, fixtures=replace(model.fixtures, tools=model.fixtures.tools[:1])),
                table)  # fmt: skip
    with pytest.raises(InputError, match=r"tool\[0\] of a pose row is -1"):
        replace(table, tool=np.full(len(table), -1))
    with pytest.raises(InputError, match="no row was measured with the tool of the chain"):
        start_frames(model, table.rows(table.tool > 0))
    with pytest.raises(InputError, match="further tool"):
        paper_stack(
            model, seen_poses(model, pool_r(2), np.random.default_rng(8), station=0, tool=1)
        )


def test_compiled_loops_know_no_further_tools():
    model = robot_with_tools()
    rows = seen_poses(model, pool_r(9), np.random.default_rng(9), station=0, tool=1)
    found = unknown_to_loops(model, rows, parameters_of(model, ("theta2",)))
    assert found == ("tool", "rows of further tools")


def plate_rows(q: Array, tools: int = 2) -> Measurements:
    """Points of three reflectors in turn, at each of the tools in turn."""
    k = np.arange(len(q))
    tool = (k // 3) % tools
    return tables.points(q, np.zeros((len(q), 3)), sd=2e-5, reflector=k % 3, tool=tool)


def pose_rows(q: Array, stations: int = 1) -> Measurements:
    """Poses of both tools in turn."""
    k = np.arange(len(q))
    nowhere = np.tile(np.eye(4), (len(q), 1, 1))
    return tables.poses(
        q, nowhere, sd=(2e-5, 1e-4), tool=k % 2, station=np.where(k % 4 == 3, stations - 1, 0)
    )


def range_rows(q: Array) -> Measurements:
    """Distances of the first reflector from six known anchors, at both tools in turn."""
    k = np.arange(len(q))
    table = tables.distances(q, np.ones(len(q)), sd=2e-5, anchor=k % 6, reflector=0)
    return replace(table, tool=(k // 6) % 2)


SLIDES = Chain(
    [[0, 0, 0, np.pi / 2, 0], [np.pi / 2, 0, 0, np.pi / 2, 0], [0, 0.2, 0.3, 0, 0]],
    ("prismatic",) * 3,
)
TABLE = Chain([[0, 0.1, 0.3, 0, 0]])
SCARA = ARMS["scara"]
SHARED = {
    "gantry, poses": (SLIDES, pose_rows),
    "gantry, plate": (SLIDES, plate_rows),
    "gantry, two stations": (SLIDES, lambda q: pose_rows(q, 2)),
    "rotary table, poses": (TABLE, pose_rows),
    "rotary table, plate": (TABLE, plate_rows),
    "arm, poses": (ARMS["tx60"], pose_rows),
    "arm, plate": (ARMS["tx60"], plate_rows),
    "arm, two stations": (ARMS["tx60"], lambda q: pose_rows(q, 2)),
    "arm, distances": (ARMS["tx60"], range_rows),
    "arm, plate and poses": (
        ARMS["tx60"],
        lambda q: joined([pose_rows(q[:60]), plate_rows(q[60:])]),
    ),
}


@pytest.mark.parametrize("case", SHARED)
@pytest.mark.parametrize("seed", [0, 1])
def test_tools_share_the_base_stations_and_reflectors_of_perfect_readings(case: str, seed: int):
    """One robot made every row, so one base and one plate explain them: whatever the rows do not
    tell apart, nothing is left over."""
    rng, (chain, rows) = np.random.default_rng(seed), SHARED[case]
    fixtures = Fixtures(
        rng.normal(size=(3, 3)) * 0.1,
        rng.normal(size=(6, 3)) * 2,
        anywhere(rng, 2.0)[None],
        anywhere(rng, 0.2)[None],
    )
    framed = replace(chain, T_world_base=anywhere(rng, 2.0), T_flange_tool=anywhere(rng, 0.2))
    true = RobotModel(framed, fixtures=fixtures)
    nowhere = replace(
        fixtures, reflectors=np.zeros((3, 3)), stations=np.eye(4)[None], tools=np.eye(4)[None]
    )
    table = perfect(true, rows(rng.uniform(-1, 1, (120, chain.n_joints))))
    start = start_frames(RobotModel(chain, fixtures=nowhere), table)
    # meters in double precision, over the condition of a few distances
    assert start.position_rms < 1e-9
    assert np.isnan(start.rotation_rms) or start.rotation_rms < 1e-9
    # a second way: the whole model predicts what was read
    assert predict(start.model, table).misses.max() < 1e-8


def test_a_base_that_only_a_further_tool_shows_moves_what_was_placed_before():
    """The first tool is seen from the second station, whose place nothing tells until then."""
    rng = np.random.default_rng(12)
    chain = replace(ARMS["tx60"], T_world_base=anywhere(rng, 2.0), T_flange_tool=anywhere(rng, 0.2))
    fixtures = Fixtures(stations=anywhere(rng, 2.0)[None], tools=anywhere(rng, 0.2)[None])
    true, q = RobotModel(chain, fixtures=fixtures), joints("tx60", rng, 60)
    table = joined(
        [
            seen_poses(true, q[:30], rng, station=1, tool=0),
            seen_poses(true, q[30:], rng, station=0, tool=1),
        ]
    )
    nowhere = Fixtures(stations=np.eye(4)[None], tools=np.eye(4)[None])
    start = start_frames(RobotModel(ARMS["tx60"], fixtures=nowhere), perfect(true, table))
    # meters in double precision
    assert start.position_rms < 1e-12
    np.testing.assert_allclose(start.model.chain.T_world_base, chain.T_world_base, atol=1e-10)
    assert not any("base stays" in note for note in start.notes)


def test_rows_of_all_tools_find_the_base_that_one_tool_leaves_open():
    """The first tool keeps its orientation, so base and tool shift alike; the second one turns."""
    rng = np.random.default_rng(11)
    true = RobotModel(
        replace(SCARA, T_world_base=anywhere(rng, 2.0), T_flange_tool=anywhere(rng, 0.2)),
        fixtures=Fixtures(tools=anywhere(rng, 0.2)[None]),
    )
    q = rng.uniform(-1, 1, (80, 4)) * [1, 1, 0.1, 1]
    tool = np.arange(80) % 2
    q[tool == 0, 3] = q[tool == 0, 0] + q[tool == 0, 1]  # the last axis points down
    nowhere = np.tile(np.eye(4), (80, 1, 1))
    table = perfect(true, tables.poses(q, nowhere, sd=(2e-5, 1e-4), tool=tool))
    start = start_frames(RobotModel(SCARA, fixtures=Fixtures(tools=np.eye(4)[None])), table)
    # by Gauss-Newton from centimeters away, in double precision
    assert start.position_rms < 1e-9
