"""A robot that is not quite nominal, measured from nowhere in particular, and its files."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from calib.geometry.frames import inverse, step_transform, transform
from calib.geometry.model import RobotModel
from testbed.robots.catalog import load_robot

ROBOT = load_robot("staubli_tx60")
N = ROBOT.model.chain.n_joints


@dataclass(frozen=True)
class Made:
    """Poses of a true robot as a tracker sees them."""

    q: np.ndarray
    T: np.ndarray
    truth: RobotModel


@cache
def made(seed=0, m=29, noise=17.5e-6, turn=2e-4, robot=ROBOT, off=1.0):
    """True geometry 0.04 deg / 0.15 mm off, times `off`, base anywhere, tool to 0.15 m per axis."""
    rng = np.random.default_rng(seed)
    model = robot.model
    sd = np.where(model.is_length, 0.15e-3, np.radians(0.04))
    moved = np.isin(model.names, robot.free_sets.get("wen2022", model.names))
    step = moved * off * sd * rng.standard_normal(model.n_numbers)
    base = np.concatenate([rng.uniform(-3, 3, 3), rng.uniform(-2, 2, 3)])
    tool = np.concatenate([rng.uniform(-0.15, 0.15, 3), rng.uniform(-2, 2, 3)])
    chain = model.moved(step).chain
    truth = RobotModel(
        replace(chain, T_world_base=step_transform(base), T_flange_tool=step_transform(tool))
    )
    lower, upper = robot.limits.T
    q = rng.uniform(0.8 * lower, 0.8 * upper, (m, len(lower)))
    T = truth.poses(q)
    R = Rotation.from_rotvec(turn * rng.standard_normal((m, 3))).as_matrix() @ T[:, :3, :3]
    T = transform(R, T[:, :3, 3] + noise * rng.standard_normal((m, 3)))
    q.flags.writeable = T.flags.writeable = False  # many tests share them
    return Made(q, T, truth)


def columns(data, *, euler="XYZ", form="euler", ids=True, gives="T_tracker_tool"):
    """Columns of a CSV in the project's own layout, as numbers."""
    T = inverse(data.T) if gives == "T_tool_tracker" else data.T
    out = {"pose_id": np.arange(1, len(data.q) + 1)} if ids else {}
    out |= {f"q{j + 1}_deg": np.degrees(data.q[:, j]) for j in range(data.q.shape[1])}
    out |= {f"{a}_mm": T[:, k, 3] * 1e3 for k, a in enumerate("xyz")}
    R = Rotation.from_matrix(T[:, :3, :3])
    if form == "euler":
        angles = R.as_euler(euler, degrees=True)
        out |= {f"r{letter.lower()}_deg": angles[:, k] for k, letter in enumerate(euler)}
    elif form == "quaternion":
        out |= {f"q{a}": R.as_quat()[:, k] for k, a in enumerate("xyzw")}
    elif form == "matrix":
        out |= {f"r{i + 1}{j + 1}": T[:, i, j] for i in range(3) for j in range(3)}
    return out


SPREAD = {"ux_mm": 0.0175, "uy_mm": 0.0175, "uz_mm": 0.0175}
TURN = {"urx_deg": 0.011, "ury_deg": 0.011, "urz_deg": 0.011}


def with_spread(table, *, turn=True):
    """The same with columns of standard uncertainties."""
    m = len(next(iter(table.values())))
    return table | {k: np.full(m, v) for k, v in (SPREAD | (TURN if turn else {})).items()}


def csv(table, *, separator=",", decimal=".", eol="\n", form="{:.15g}"):
    """Text of a table."""

    def cell(value):
        text = value if isinstance(value, str) else form.format(value)
        return text.replace(".", decimal) if not isinstance(value, str) else text

    rows = zip(*table.values(), strict=True)
    return eol.join(
        [separator.join(table), *(separator.join(cell(v) for v in row) for row in rows), ""]
    )


def poses_csv(data=None, **how):
    """Full poses with uncertainties, XYZ, as text."""
    data = made() if data is None else data
    table = with_spread(columns(data))
    return csv(table | {"euler": ["XYZ"] * len(data.q)}, **how)
