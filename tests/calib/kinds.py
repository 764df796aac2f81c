"""What the tests of kinds of measurement share: four arms, true robots anywhere, tables of them."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import exp_so3, inverse, transform
from calib.geometry.model import RobotModel
from calib.measurement import tables
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict, targets
from tests.calib.slopes import slopes
from tests.reference import DEG, TX60_LINKS

# Universal Robots UR10 as measured by Landgraf et al. 2021: theta rad, d m, a m, alpha rad, beta
UR10 = np.array(
    [
        [0, 0.1273, 0, 90 * DEG, 0],
        [0, 0, -0.612, 0, 0],
        [0, 0, -0.5723, 0, 0],
        [0, 0.163941, 0, 90 * DEG, 0],
        [0, 0.1157, 0, -90 * DEG, 0],
        [0, 0.0922, 0, 0, 0],
    ]
)
# KUKA iiwa 7: d = 340, 400, 400, 126 mm, axes at right angles
IIWA = np.array(
    [
        [0, 0.34, 0, -90 * DEG, 0],
        [0, 0, 0, 90 * DEG, 0],
        [0, 0.4, 0, 90 * DEG, 0],
        [0, 0, 0, -90 * DEG, 0],
        [0, 0.4, 0, -90 * DEG, 0],
        [0, 0, 0, 90 * DEG, 0],
        [0, 0.126, 0, 0, 0],
    ]
)
SCARA = np.array(
    [[0, 0.3, 0.35, 0, 0], [0, 0, 0.3, 180 * DEG, 0], [0, 0.1, 0, 0, 0], [0, 0.05, 0, 0, 0]]
)
ARMS = {
    "tx60": Chain(TX60_LINKS),
    "ur10": Chain(UR10),
    "iiwa": Chain(IIWA),
    "scara": Chain(SCARA, ("revolute", "revolute", "prismatic", "revolute")),
}
NOISE = 20e-6
"""Of positions and distances [m]."""
TURN_NOISE = 0.01 * DEG
OFFSET = (0.05, 0.03, 0.08)


def anywhere(rng: np.random.Generator, far: float) -> Array:
    """A frame (4, 4) some `far` meters away, turned at random."""
    return transform(exp_so3(rng.normal(size=3) * 3), rng.normal(size=3) * far)


def true_robot(arm: str, rng: np.random.Generator) -> RobotModel:
    """Every link number wrong by 0.3 mm and 0.1 deg, base meters and tool decimeters away."""
    chain = ARMS[arm]
    wrong = rng.normal(size=chain.links.shape) * [0.1 * DEG, 0.3e-3, 0.3e-3, 0.1 * DEG, 0.1 * DEG]
    return RobotModel(
        Chain(chain.links + wrong, chain.kinds, anywhere(rng, 3.0), anywhere(rng, 0.1)),
        fixtures=Fixtures(
            rng.normal(size=(3, 3)) * 0.1, rng.normal(size=(4, 3)) * 2, anywhere(rng, 3.0)[None]
        ),
    )


def joints(arm: str, rng: np.random.Generator, m: int) -> Array:
    """Joint vectors (m, n) over 230 degrees and 0.4 m."""
    chain = ARMS[arm]
    return rng.uniform(-2, 2, (m, chain.n_joints)) * np.where(chain.prismatic > 0, 0.1, 1.0)


def poses(
    true: RobotModel, q: Array, rng: np.random.Generator, *, station: int = 0
) -> Measurements:
    """Full poses seen by a station."""
    T = inverse(true.fixtures.station_frames[station]) @ true.poses(q)
    T[:, :3, 3] += rng.normal(size=(len(q), 3)) * NOISE
    T[:, :3, :3] = exp_so3(rng.normal(size=(len(q), 3)) * TURN_NOISE) @ T[:, :3, :3]
    return tables.poses(q, T, sd=(NOISE, TURN_NOISE), station=station)


def points(
    true: RobotModel, q: Array, rng: np.random.Generator, *, reflector: int = -1, station: int = 0
) -> Measurements:
    """A reflector of the fixtures, or the one at `OFFSET`, seen by a station."""
    offset = OFFSET if reflector < 0 else (0.0, 0.0, 0.0)
    table = tables.points(
        q,
        np.zeros((len(q), 3)),
        sd=np.eye(3) * NOISE**2,
        offset=offset,
        reflector=reflector,
        station=station,
    )
    S = inverse(true.fixtures.station_frames[station])
    p = places(true, table) @ S[:3, :3].T + S[:3, 3]
    return replace(table, position=p + rng.normal(size=p.shape) * NOISE)


def distances(
    true: RobotModel, q: Array, rng: np.random.Generator, *, anchor: int = 0, reflector: int = -1
) -> Measurements:
    """Distances from an anchor to a reflector of the fixtures, or to the one at `OFFSET`."""
    offset = OFFSET if reflector < 0 else (0.0, 0.0, 0.0)
    table = tables.distances(
        q, np.ones(len(q)), sd=NOISE, anchor=anchor, offset=offset, reflector=reflector
    )
    d = np.linalg.norm(places(true, table) - true.fixtures.anchors[anchor], axis=1)
    return replace(table, distance=d + rng.normal(size=len(q)) * NOISE)


def places(true: RobotModel, table: Measurements) -> Array:
    """Where the reflectors of a table are in the world (m, 3) [m]."""
    T = true.poses(table.q)
    c = targets(true.fixtures, table)
    return T[:, :3, 3] + np.einsum("mij,mj->mi", T[:, :3, :3], c)


def everything(true: RobotModel, q: Array, rng: np.random.Generator) -> Measurements:
    """A few rows of each kind, in turn."""
    table = joined(
        [
            poses(true, q, rng),
            poses(true, q, rng, station=1),
            points(true, q, rng),
            points(true, q, rng, reflector=1, station=1),
            points(true, q, rng, reflector=2),
            distances(true, q, rng, anchor=3),
            distances(true, q, rng, anchor=1, reflector=0),
        ]
    )
    return table.rows(rng.permutation(len(table)))


KINDS = (
    "poses",
    "one point",
    "three reflectors",
    "known anchor",
    "unknown anchor",
    "four anchors",
    "two stations",
)


def measured(
    kind: str, arm: str, q: Array, rng: np.random.Generator
) -> tuple[RobotModel, RobotModel, Measurements, tuple[int, ...]]:
    """True robot, nominal robot with frames and fixtures of nowhere, a table, unknown anchors."""
    true, half = true_robot(arm, rng), len(q) // 2
    anchors = true.fixtures.anchors
    if kind == "poses":
        true, table = replace(true, fixtures=Fixtures()), poses(true, q, rng)
    elif kind == "one point":
        true, table = replace(true, fixtures=Fixtures()), points(true, q, rng)
    elif kind == "three reflectors":
        true = replace(true, fixtures=Fixtures(true.fixtures.reflectors))
        table = joined([points(true, q, rng, reflector=k) for k in range(3)])
    elif kind == "known anchor":
        true = replace(true, fixtures=Fixtures(anchors=anchors[:1]))
        table = distances(true, q, rng)
    elif kind == "unknown anchor":
        true = replace(true, fixtures=Fixtures(true.fixtures.reflectors[:1], anchors[:1]))
        table = distances(true, q, rng, reflector=0)
    elif kind == "four anchors":
        true = replace(true, fixtures=Fixtures(true.fixtures.reflectors[:1], anchors))
        table = joined([distances(true, q, rng, reflector=0, anchor=k) for k in range(4)])
    else:
        true = replace(true, fixtures=Fixtures(stations=true.fixtures.stations))
        table = joined([poses(true, q[:half], rng), poses(true, q[half:], rng, station=1)])
    unknown = (0,) if kind == "unknown anchor" else ()
    known = true.fixtures.anchors if not unknown else np.zeros((1, 3))
    k, _, t, _ = true.fixtures.counts
    nowhere = Fixtures(np.zeros((k, 3)), known, np.tile(np.eye(4), (t, 1, 1)))
    return true, RobotModel(ARMS[arm], fixtures=nowhere), table, unknown


def require_derivatives(
    model: RobotModel, table: Measurements, by: Iterable[int] | None = None
) -> None:
    """Rows are the change of the residuals with the numbers of the model, or those at `by`."""
    by = range(model.n_numbers) if by is None else list(by)
    rows = predict(model, table).rows
    change = slopes(
        lambda step: predict(model.moved(step), table).residual,
        np.zeros(model.n_numbers), 1e-5, by=by,
    )  # fmt: skip
    # h^2 / 6 of the third derivative and rounding 1e-15 / h are below 1e-9
    assert np.abs(change + rows[:, :, by]).max() < 2e-9 * max(1.0, np.abs(rows).max())
