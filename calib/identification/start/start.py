"""Initial values of a calibration: base, tool and fixtures of a nominal robot, without a guess.

The closed forms are in `closed_forms`: robot-world/hand-eye for full poses (Kronecker product and
singular values; Li, Wang, Wu 2010, Shah 2013), a linear lift and Procrustes for points (Umeyama
1991), multilateration and a linear lift for distances. Their results are refined by least squares
over frames and fixtures alone, with the links fixed.

`identify` searches near the model it is given. If the frames of that model may be meters away, use
`start_frames` first.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, FloatOrNan, Index
from calib.errors import refuse
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.identification.start.mirrored import on_their_sides
from calib.identification.start.one_tool import FoundFrames, frames_of_one_tool, refined_frames
from calib.kinds import checked_kinds
from calib.measurement.observations import GIVEN, POINT, Measurements
from calib.measurement.prediction import require_fixtures, targets
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class Start(Shown):
    """A nominal robot with frames and fixtures from measurements."""

    model: RobotModel
    """Nominal links, with base, tool and fixtures fitted to the measurements."""
    position_rms: float
    """Root mean square residual of positions and distances [m]."""
    rotation_rms: FloatOrNan
    """Root mean square rotation angle of the residuals of pose rows [rad]; nan without any."""
    notes: tuple[str, ...]
    """From which rows the frames come, and what stayed nominal because nothing determines it."""

    def __repr__(self) -> str:
        return f"Start(misses by {1e3 * self.position_rms:.3g} mm rms: {self.notes[0]})"


@checked_kinds
def start_frames(
    model: RobotModel,
    measurements: Measurements,
    *,
    free_tool: bool = True,
    free_anchors: Collection[int] = (),
) -> Start:
    """Fit base, tool and fixtures of a nominal robot, of which only the links need be right.

    All reflectors, further stations and further tools of the fixtures are fitted as well: each
    further tool from its own rows, with what earlier rows have determined held fixed, and in the
    end all of them together. Anchors are known places unless `free_anchors` lists them. What the
    table does not determine keeps its value in `model`, and `notes` list it: for example the tool
    if only reflectors of the fixtures were measured, or the base if only distances to unknown
    anchors were.

    Parameters
    ----------
    model : RobotModel
        Nominal links and joint errors. Its base, tool, reflectors and stations are used only where
        the table does not determine them, and to place guesses of reflectors about.
    measurements : Measurements
        Covariances are not used, because errors of the nominal links dominate.
    free_tool : bool
        Whether the tool of the chain is fitted; False keeps that of `model`. Further tools are
        fitted in any case.
    free_anchors : collection of int
        Anchors of the fixtures, counted from 0, whose places in the world are unknown.

    Raises
    ------
    InputError
        A3: no row was measured with the tool of the chain, or `free_anchors` lists an anchor that
        does not exist. Also with too few measurements; the message states how many are needed.
    """
    require_fixtures(model.fixtures, measurements)
    # flange poses by the nominal links alone
    links = Chain(model.chain.links, model.chain.kinds)
    F = RobotModel(links, model.joint_errors).poses(measurements.q, measurements.conditions)
    first = measurements.tool == 0
    if len(measurements) and not first.any():
        raise refuse(
            "tool", code="A3", message="no row was measured with the tool of the chain",
            fix="number the tools from 0, which is that of the chain",
        )  # fmt: skip
    rows = measurements.rows(first)
    one = found = frames_of_one_tool(model, F[first], rows, free_tool, free_anchors)
    further: tuple[str, ...] = ()
    if not first.all():
        found, further = _with_further_tools(one, F, measurements, free_anchors)
    if len(free_anchors):
        sided = on_their_sides(found.model, measurements, found.names)
        if sided is not found.model:
            found = refined_frames(sided, F, measurements, found.names)
    placed = {0} if "base.x" in found.names else set()
    notes = (*_origins(rows, one.names, free_tool, placed), *further)
    prediction, pose = found.prediction, measurements.is_pose
    turns = np.sqrt(np.square(prediction.turns[pose]).mean()) if pose.any() else np.nan
    return Start(
        model=found.model,
        position_rms=float(np.sqrt(np.square(prediction.misses).mean())),
        rotation_rms=float(turns),
        notes=(*notes, *found.reduction.sentences),
    )


def _with_further_tools(
    first: FoundFrames, F: Array, measurements: Measurements, free_anchors: Collection[int]
) -> tuple[FoundFrames, tuple[str, ...]]:
    """Fit each further tool with frames of earlier rows held; then refine all frames together."""
    found, numbers = first.model, {*first.names}
    notes: list[str] = []
    rows = measurements.rows(measurements.tool == 0)
    placed, reflectors, anchors = ({*column.tolist()} for column in _seen(rows))
    # without rows in the world frame, the base keeps its place
    if "base.x" in numbers or 0 not in _seen(measurements)[0]:
        placed.add(0)
    for k in np.unique(measurements.tool[measurements.tool > 0]).tolist():
        its = measurements.tool == k
        rows = measurements.rows(its)
        # reflectors already placed count as given; this tool takes the place of the chain's
        given = np.isin(rows.reflector, list(reflectors))
        alone = replace(
            rows,
            tool=np.zeros(len(rows), dtype=np.int64),
            offset=np.where(given[:, None], targets(found.fixtures, rows), rows.offset),
            reflector=np.where(given, GIVEN, rows.reflector),
        )
        tool = found.fixtures.tools[k - 1]
        own = replace(found, chain=replace(found.chain, T_flange_tool=tool))
        unknown = {*free_anchors} - anchors
        one = frames_of_one_tool(own, F[its], alone, True, unknown, placed)
        notes += [f"with tool {k + 1}: {note}" for note in _origins(alone, one.names, True, placed)]
        numbers |= {re.sub(r"^tool\.", f"tool{k + 1}.", name) for name in one.names}
        tools = found.fixtures.tools.copy()
        tools[k - 1] = one.model.chain.T_flange_tool
        found = replace(
            found,
            chain=replace(found.chain, T_world_base=one.model.chain.T_world_base),
            fixtures=replace(one.model.fixtures, tools=tools),
        )
        for known, column in zip((placed, reflectors, anchors), _seen(rows), strict=True):
            known.update(column.tolist())
        placed |= {0} if "base.x" in one.names else set()
    names = tuple(name for name in found.names if name in numbers)
    return refined_frames(found, F, measurements, names), tuple(notes)


def _seen(rows: Measurements) -> tuple[Index, Index, Index]:
    """Stations that measured poses or points, and the reflectors and anchors that rows refer to."""
    stations = rows.station[~rows.is_distance]
    named = (rows.reflector[rows.reflector != GIVEN], rows.anchor[rows.is_distance])
    return stations, *named


def _origins(
    measurements: Measurements,
    names: tuple[str, ...],
    free_tool: bool,
    placed: Collection[int] = (),
) -> tuple[str, ...]:
    """Notes on the rows that the frames were fitted to, and on frames that stay nominal."""
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
    if "base" in held and 0 not in placed:
        notes.append(
            "the base stays where the model has it: no known place was measured, so the base is "
            "the world"
        )
    if "tool" in held:
        why = "no row depends on its frame" if free_tool else "it was not to be looked for"
        notes.append(f"the tool stays where the model has it: {why}")
    return tuple(notes)


def _listed(words: list[str]) -> str:
    """Words with commas and a last "and"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
