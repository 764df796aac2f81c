"""Where a calibration starts: base, tool and fixtures of a nominal robot, without any guess.

The closed forms are in `closed_forms`: robot-world/hand-eye for full poses (Kronecker product and
singular values; Li, Wang, Wu 2010, Shah 2013), a linear lift and Procrustes for points (Umeyama
1991), multilateration and a linear lift for distances. What they give is refined by least squares
over the frames and fixtures alone, the links held.

`identify` looks for the answer near the model it is given: a robot whose frames are meters away
goes through `start_frames` first.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, FloatOrNan, Index
from calib.errors import refuse
from calib.geometry.chain import Chain
from calib.geometry.frames import inverse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.start.alignment import (
    SCALE,
    Alignment,
    StartProblem,
    refine,
    start_problem,
)
from calib.identification.start.guesses import initial_guesses
from calib.identification.sufficiency import require_equations
from calib.information.reduction import Reduction, reduce
from calib.measurement.observations import GIVEN, POINT, Measurements
from calib.measurement.prediction import predict, require_fixtures
from calib.shown import Shown

SUBSET = 200
"""Rows on which initial guesses are compared."""
GOOD = 0.01
"""Misfit, as a part of how far the tool moves, below which no other guess is tried."""


@dataclass(frozen=True, slots=True, eq=False)
class Start(Shown):
    """A nominal robot put where it was measured."""

    model: RobotModel
    """Nominal links; base, tool and fixtures as the measurements have them."""
    position_rms: float
    """Root mean square of what is missed in position or distance [m]."""
    rotation_rms: FloatOrNan
    """Root mean square angle missed by the pose rows [rad]; nan without any."""
    notes: tuple[str, ...]
    """Where the frames come from, and what stayed nominal because nothing determines it."""

    def __repr__(self) -> str:
        return f"Start(misses by {1e3 * self.position_rms:.3g} mm rms: {self.notes[0]})"


def start_frames(
    model: RobotModel,
    measurements: Measurements,
    *,
    free_tool: bool = True,
    free_anchors: Collection[int] = (),
) -> Start:
    """Put a nominal robot where it was measured; nothing but its links need be right.

    Base and tool, all reflectors, further stations and tools of the fixtures are determined, those
    of a further tool from its own rows; anchors are
    known places unless `free_anchors` names them. What the table does not determine stays as
    `model` has it: the tool where only reflectors of the fixtures were measured, the base where no
    anchor is known and nothing else was measured, and so on; `notes` list it.

    Parameters
    ----------
    model : RobotModel
        Nominal links and joint errors. Its base, tool, reflectors and stations are not used, but
        for what stays.
    measurements : Measurements
        Covariances are not used, because the misfit is the nominal robot's.
    free_tool : bool
        Whether the tool is looked for; False holds it where the model has it. Further ones are.
    free_anchors : collection of int
        Anchors of the fixtures, from 0, whose place in the world is not known.

    Raises
    ------
    InputError
        Too few measurements; how many are needed is stated.
    """
    require_fixtures(model.fixtures, measurements)
    if measurements.tool.any():
        return _with_further_tools(model, measurements, free_tool, free_anchors)
    return _with_one_tool(model, measurements, free_tool, free_anchors)


def _with_further_tools(
    model: RobotModel, measurements: Measurements, free_tool: bool, free_anchors: Collection[int]
) -> Start:
    """Frames of the chain's tool first; then each further tool, and the stations only it shows."""
    first = measurements.rows(measurements.tool == 0)
    if not len(first):
        raise refuse(
            "tool", code="A3", message="no row was measured with the tool of the chain",
            fix="number the tools from 0, which is that of the chain",
        )  # fmt: skip
    start = _with_one_tool(model, first, free_tool, free_anchors)
    found, notes = start.model, list(start.notes)
    placed = {0, *first.station.tolist()}
    for k in np.unique(measurements.tool[measurements.tool > 0]).tolist():
        rows = measurements.rows(measurements.tool == k)
        seen = sorted(set(rows.station.tolist()), key=lambda s: (s not in placed, s))
        # its own frames, in that of the first station it was seen from
        own = replace(
            found,
            chain=replace(found.chain, T_flange_tool=found.fixtures.tools[k - 1]),
            fixtures=replace(found.fixtures, stations=np.tile(np.eye(4), (len(seen) - 1, 1, 1))),
        )
        number = np.array([seen.index(s) for s in rows.station])
        alone = replace(rows, station=number, tool=np.zeros(len(rows), dtype=np.int64))
        one = _with_one_tool(own, alone, True, free_anchors)
        notes += [f"with tool {k + 1}: {note}" for note in one.notes]
        found = _joined(found, one.model, k, seen, placed)
        placed |= set(seen)
    prediction, pose = predict(found, measurements), measurements.is_pose
    turns = np.sqrt(np.square(prediction.turns[pose]).mean()) if pose.any() else np.nan
    missed = float(np.sqrt(np.square(prediction.misses).mean()))
    return Start(found, missed, float(turns), tuple(notes))


def _joined(
    model: RobotModel, own: RobotModel, k: int, seen: list[int], placed: Collection[int]
) -> RobotModel:
    """The model with tool k, its reflectors, and the stations `seen` that nothing placed before."""
    stations, tools = model.fixtures.stations.copy(), model.fixtures.tools.copy()
    tools[k - 1] = own.chain.T_flange_tool
    # the base stands where it stood, so that the first station of these rows does, too
    at = model.chain.T_world_base @ inverse(own.chain.T_world_base)
    if seen[0] in placed:
        at = model.fixtures.station_frames[seen[0]]
    for s, T in zip(seen, own.fixtures.station_frames, strict=True):
        if s not in placed:
            stations[s - 1] = at @ T
    fixtures = replace(own.fixtures, stations=stations, tools=tools)
    return replace(model, fixtures=fixtures)


def _with_one_tool(
    model: RobotModel, measurements: Measurements, free_tool: bool, free_anchors: Collection[int]
) -> Start:
    """`start_frames` of rows that were all measured with the tool of the chain."""
    names = _unknowns(model, measurements, free_tool, free_anchors)
    parameters = parameters_of(model, names)
    require_equations(model, measurements, parameters)
    # flange poses by the nominal links alone
    links = Chain(model.chain.links, model.chain.kinds)
    F = RobotModel(links, model.joint_errors).poses(measurements.q, measurements.conditions)
    problem = start_problem(model, F, measurements, free_tool, free_anchors)
    # best guess on some rows, refined on all of them
    alignment = _best_guess(problem, parameters)
    free = _indices(model, _reduction(alignment, problem, parameters).kept)
    alignment = refine(alignment, measurements, free)
    reduction = _reduction(alignment, problem, parameters, q=measurements.q)
    prediction, pose = alignment.predict(measurements), measurements.is_pose
    turns = np.sqrt(np.square(prediction.turns[pose]).mean()) if pose.any() else np.nan
    return Start(
        model=_with_frames(alignment, problem, names),
        position_rms=float(np.sqrt(np.square(prediction.misses).mean())),
        rotation_rms=float(turns),
        notes=(*_origins(measurements, names, free_tool), *reduction.sentences),
    )


def _unknowns(
    model: RobotModel,
    measurements: Measurements,
    free_tool: bool,
    free_anchors: Collection[int],
) -> tuple[str, ...]:
    """Names of the unknown numbers: those that some row of the table may determine."""
    wrong = [k for k in free_anchors if not 0 <= k < len(model.fixtures.anchors)]
    if wrong:
        count = len(model.fixtures.anchors)
        message = f"free_anchors names anchor {wrong[0]}, the model has {count}"
        allowed = "anchors of the fixtures, from 0"
        raise refuse("free_anchors", wrong[0], allowed, code="A3", message=message)
    far = measurements.is_distance
    optical = set(np.unique(measurements.station[~far]).tolist())
    anchored = set(np.unique(measurements.anchor[far]).tolist())
    prefixes = []
    # without any known place the base itself is the world
    if 0 in optical or (not optical and anchored - set(free_anchors)):
        prefixes.append("base.")
    if free_tool and (measurements.reflector == GIVEN).any():
        prefixes.append("tool.")
    reflectors = set(np.unique(measurements.reflector).tolist()) - {GIVEN}
    prefixes += [f"reflector{k + 1}." for k in sorted(reflectors)]
    prefixes += [f"anchor{k + 1}." for k in sorted(anchored & set(free_anchors))]
    prefixes += [f"station{s + 1}." for s in sorted(optical - {0})]
    return tuple(name for name in model.names if name.startswith(tuple(prefixes)))


def _indices(model: RobotModel, names: tuple[str, ...]) -> Index:
    """Positions of numbers among those of an alignment: base, tool, fixtures."""
    n = model.chain.n_numbers
    names_here = (*model.names[:6], *model.names[n - 6 : n], *model.fixtures.names)
    return np.array([names_here.index(name) for name in names], dtype=np.int64)


def _with_frames(alignment: Alignment, problem: StartProblem, names: tuple[str, ...]) -> RobotModel:
    """The model with the frames of an alignment; what was not looked for stays to the last bit."""
    chain = problem.model.chain
    base = alignment.base if "base.x" in names else chain.T_world_base
    tool = alignment.tool if "tool.x" in names else chain.T_flange_tool
    return replace(
        problem.model,
        chain=replace(chain, T_world_base=base, T_flange_tool=tool),
        fixtures=alignment.fixtures,
    )


def _reduction(
    alignment: Alignment, problem: StartProblem, parameters: Parameters, q: Array | None = None
) -> Reduction:
    """Which of the unknown numbers the table determines, and the others in words."""
    names = parameters.free_names
    prediction = alignment.predict(problem.measurements)
    rows = (prediction.rows * SCALE[:, None])[prediction.filled]
    A = rows[:, _indices(problem.model, names)]
    model = _with_frames(alignment, problem, names)
    return reduce(A * parameters.free_scale, parameters, model=model, q=q)


def _best_guess(problem: StartProblem, parameters: Parameters) -> Alignment:
    """The initial guess that fits best once refined, judged on some rows of each kind."""
    rows = _sample(problem.measurements)
    few = replace(problem, F=problem.F[rows], measurements=problem.measurements.rows(rows))
    spread = float(np.linalg.norm(problem.F[:, :3, 3].std(axis=0))) or 1.0
    best, least = None, np.inf
    for guess in initial_guesses(problem):
        alignment = guess.rows(rows)
        free = _indices(problem.model, _reduction(alignment, few, parameters).kept)
        alignment = refine(alignment, few.measurements, free, most=15)
        residual = alignment.predict(few.measurements).residual * SCALE
        misfit = float(np.square(residual).sum() / len(rows))
        if best is None or misfit < least:
            best, least = alignment, misfit
        if least < (GOOD * spread) ** 2:
            break
    assert best is not None  # there is always a guess
    return replace(best, F=problem.F)


def _sample(table: Measurements) -> Index:
    """About `SUBSET` rows spread evenly over whatever was looked at."""
    _, group = np.unique(table.target_key, axis=0, return_inverse=True)
    group = group.ravel()
    each = -(-SUBSET // (int(group.max()) + 1))
    chosen = []
    for k in range(int(group.max()) + 1):
        rows = np.flatnonzero(group == k)
        chosen.append(rows[np.unique(np.linspace(0, len(rows) - 1, each).round().astype(int))])
    return np.sort(np.concatenate(chosen))


def _origins(
    measurements: Measurements, names: tuple[str, ...], free_tool: bool
) -> tuple[str, ...]:
    """Where the frames come from, and which of them nothing in the table speaks of."""
    counts = [
        f"{n} {word}{'s' if n != 1 else ''}"
        for n, word in (
            (int(measurements.is_pose.sum()), "pose"),
            (int((measurements.kind == POINT).sum()), "point"),
            (int(measurements.is_distance.sum()), "distance"),
        )
        if n
    ]
    frames = list(dict.fromkeys(name.split(".")[0] for name in names))
    notes = [f"{_listed(frames)} found from {_listed(counts)}, starting from nothing"]
    held = [frame for frame in ("base", "tool") if frame not in frames]
    if "base" in held:
        notes.append(
            "the base stays where the model has it: no known place was measured, so the base is "
            "the world"
        )
    if "tool" in held:
        why = "no row speaks of its frame" if free_tool else "it was not to be looked for"
        notes.append(f"the tool stays where the model has it: {why}")
    return tuple(notes)


def _listed(words: list[str]) -> str:
    """Words with commas and a last "and"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
