"""The same work done by other tools of the field, beside truebed: `python -m tests.bench.peers`.

Each peer that is installed must give the same poses or columns first; its time then stands in one
table, and in brackets as a multiple of truebed's: one thread, smallest of several rounds. What is
timed of a peer is the call that it offers for the work, looped over poses where it takes one at a
time. ``pip install -e '.[peers]'`` installs pinocchio and FIGAROH; pybotics 3.1 asks for numpy
before 2 but runs with the present one: ``pip install --no-deps pybotics``.
"""

import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement.tables import points
from calib.single_poses import SinglePoses
from testbed.robots.catalog import load_robot
from tests.reference import pool_r

PEERS = {"mujoco": "mujoco", "pinocchio": "pinocchio", "figaroh": "FIGAROH", "pybotics": "pybotics"}
"""Module and name of each peer."""
ROBOT = load_robot("staubli_tx60")
Q = np.ascontiguousarray(pool_r(1000))
FITTED, SD = 29, 1e-5
ONE, MANY, COLUMNS, FIT = (
    "pose of one posture",
    "poses of 1000 postures",
    "identification columns of 1000 postures",
    "fit of 29 reflector positions",
)
WORKS = (ONE, MANY, COLUMNS, FIT)


class Way(NamedTuple):
    """One tool's way to do one work."""

    tool: str
    work: str
    run: Callable[[], object]
    check: Callable[[object], float]
    """Largest difference from truebed, in metres or relative."""


def missing() -> list[str]:
    """Peers that are not installed."""
    return [name for module, name in PEERS.items() if find_spec(module) is None]


def ways() -> Iterator[Way]:
    """Every tool at hand and what it can do."""
    yield from ours()
    for module, make in (
        ("mujoco", of_mujoco), ("pinocchio", of_pinocchio), ("figaroh", of_figaroh),
        ("pybotics", of_pybotics),
    ):  # fmt: skip
        if find_spec(module) is not None:
            yield from make()


def far(found: object, expected: np.ndarray) -> float:
    """Largest difference between two arrays."""
    return float(np.abs(np.asarray(found) - expected).max())


def ours() -> Iterator[Way]:
    """truebed."""
    model, q = ROBOT.model, Q[0].copy()
    fast = SinglePoses.of(model)
    yield Way("truebed", ONE, lambda: fast.pose(q), lambda T: far(T, model.poses(q[None])[0]))
    yield Way("truebed", MANY, lambda: model.poses(Q), lambda T: far(T[0], fast.pose(q)))
    yield Way("truebed", COLUMNS, lambda: model.poses_and_jacobian(Q), lambda _: 0.0)
    table, free, _ = fit_task()
    true = table.position
    yield Way(
        "truebed", FIT, lambda: identify(model, table, free).model,
        lambda found: far(found.poses(Q[:FITTED])[:, :3, 3], true),
    )  # fmt: skip


def fit_task():
    """Reflector positions of a robot whose a, d and theta are a little off, and what is free."""
    model = ROBOT.model
    names = [n for n in model.names if (n[0] in "da" and n[1:].isdigit()) or n[:5] == "theta"]
    blind = {"d1", "theta1", "d2", "d3", "theta6", "d6", "a6"}  # what base and tool do as well
    wanted = [name for name in names if name not in blind]
    free, step = parameters_of(model, wanted), np.zeros(model.n_numbers)
    places = [model.names.index(name) for name in wanted]
    step[places] = 2e-4 * np.random.default_rng(0).standard_normal(len(places))
    q = Q[:FITTED]
    return points(q, model.moved(step).poses(q)[:, :3, 3], sd=SD), free, wanted


def of_mujoco() -> Iterator[Way]:
    """MuJoCo, on the MJCF that ships."""
    import mujoco

    spec = mujoco.MjModel.from_xml_path(str(ROBOT.folder / "staubli_tx60.xml"))
    data, site = mujoco.MjData(spec), spec.nsite - 1

    def pose(q):
        data.qpos[:] = q
        mujoco.mj_kinematics(spec, data)
        return data.site_xpos[site].copy()

    expected = ROBOT.model.poses(Q)[:, :3, 3]
    yield Way("MuJoCo", ONE, lambda: pose(Q[0]), lambda p: far(p, expected[0]))
    yield Way("MuJoCo", MANY, lambda: [pose(q) for q in Q], lambda p: far(p, expected))


def pinocchio_model():
    """The URDF that ships, in pinocchio, and the tool's frame."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(ROBOT.folder / "staubli_tx60.urdf"))
    return model, model.createData(), model.nframes - 1


def of_pinocchio() -> Iterator[Way]:
    """Pinocchio: poses, and its regressor of joint placements, six columns a joint."""
    import pinocchio

    model, data, tool = pinocchio_model()

    def pose(q):
        pinocchio.forwardKinematics(model, data, q)
        return pinocchio.updateFramePlacement(model, data, tool).translation.copy()

    def columns(q):
        pinocchio.forwardKinematics(model, data, q)
        return pinocchio.computeFrameKinematicRegressor(
            model, data, tool, pinocchio.LOCAL_WORLD_ALIGNED
        )

    expected = ROBOT.model.poses(Q)[:, :3, 3]
    yield Way("pinocchio", ONE, lambda: pose(Q[0]), lambda p: far(p, expected[0]))
    yield Way("pinocchio", MANY, lambda: [pose(q) for q in Q], lambda p: far(p, expected))
    yield Way("pinocchio", COLUMNS, lambda: [columns(q) for q in Q], span_of_columns)


def span_of_columns(found: object) -> float:
    """Part of our columns that those of joint placements (m, 6, k) do not reach.

    They are one per link but for the last, whose numbers lie behind the last joint.
    """
    _, J = ROBOT.model.poses_and_jacobian(Q[:50])
    ours, theirs = J[:, :3, :31].reshape(150, -1), np.stack(found)[:50, :3].reshape(150, -1)
    left = ours - theirs @ np.linalg.lstsq(theirs, ours, rcond=None)[0]
    return float(np.linalg.norm(left) / np.linalg.norm(ours))


def of_figaroh() -> Iterator[Way]:
    """FIGAROH: the aggregated regressor of its calibration."""
    from figaroh.calibration.calibration_tools import calculate_identifiable_kinematics_model

    model, data, tool = pinocchio_model()
    settings = {
        "NbSample": len(Q), "start_frame": "universe", "IDX_TOOL": tool,
        "measurability": [True] * 6, "calib_model": "full_params",
    }  # fmt: skip

    def columns():
        return calculate_identifiable_kinematics_model(Q, model, data, settings)

    yield Way("FIGAROH", COLUMNS, columns, lambda R: float(np.shape(R) != (6 * len(Q), 36)))


def of_pybotics() -> Iterator[Way]:
    """Pybotics: modified Denavit-Hartenberg; scipy fits the distances that it returns."""
    from pybotics.kinematic_chain import MDHKinematicChain
    from pybotics.optimization import OptimizationHandler, optimize_accuracy
    from pybotics.robot import Robot
    from scipy.optimize import least_squares

    chain = ROBOT.model.chain
    theta, d, a, alpha, _ = chain.links.T
    rows = np.column_stack([np.r_[0.0, alpha[:-1]], np.r_[0.0, a[:-1]], theta, d])
    robot = Robot(MDHKinematicChain.from_parameters(rows))
    robot.world_frame = chain.T_world_base
    turn = np.eye(4)
    turn[0, 3], turn[1:3, 1:3] = (
        a[-1],
        [[np.cos(alpha[-1]), -np.sin(alpha[-1])], [np.sin(alpha[-1]), np.cos(alpha[-1])]],
    )
    robot.tool.matrix = turn @ chain.T_flange_tool
    expected = ROBOT.model.poses(Q)[:, :3, 3]
    yield Way("pybotics", ONE, lambda: robot.fk(Q[0]), lambda T: far(T[:3, 3], expected[0]))
    yield Way(
        "pybotics", MANY, lambda: [robot.fk(q) for q in Q],
        lambda T: far(np.stack(T)[:, :3, 3], expected),
    )  # fmt: skip
    table, _, wanted = fit_task()
    mask = np.zeros(24, dtype=bool)
    for name in wanted:
        joint = int(name[-1]) - 1
        mask[4 * joint + 2 if name.startswith("theta") else 4 * joint + 3] |= name[0] in "td"
        if name[0] == "a" and joint < 5:
            mask[4 * (joint + 1) + 1] = True
    handler = OptimizationHandler(robot, kinematic_chain_mask=list(mask))
    start = handler.generate_optimization_vector()

    def fit():
        found = least_squares(
            optimize_accuracy, start, args=(handler, Q[:FITTED], table.position), x_scale="jac"
        )
        return float(np.abs(found.fun).max())

    yield Way("pybotics", FIT, fit, float)


def timed(run: Callable[[], object], rounds: int = 5) -> float:
    """Smallest time of the processor for one call [s]: others may be at work beside it."""
    run()
    best = np.inf
    for _ in range(rounds):
        begun, count = time.process_time(), 0
        while time.process_time() - begun < 0.05 or not count:
            run()
            count += 1
        best = min(best, (time.process_time() - begun) / count)
    return best


def main() -> None:
    """Print times and ratios of all that is installed."""
    for name in missing():
        print(f"not installed, left out: {name} (see the head of this file)")
    found: dict[tuple[str, str], float] = {}
    for way in ways():
        wrong = way.check(way.run())
        print(f"{way.tool}, {way.work}: differs by {wrong:.1e}")
        found[way.tool, way.work] = timed(way.run)
    tools = list(dict.fromkeys(tool for tool, _ in found))
    print("\n" + "work".ljust(42) + "".join(tool.rjust(20) for tool in tools))
    for work in WORKS:
        here = found["truebed", work]
        cells = [
            f"{1e6 * found[tool, work]:.3g} us ({found[tool, work] / here:.3g})"
            if (tool, work) in found else "-"
            for tool in tools
        ]  # fmt: skip
        print(work.ljust(42) + "".join(cell.rjust(20) for cell in cells))


if __name__ == "__main__":
    main()
