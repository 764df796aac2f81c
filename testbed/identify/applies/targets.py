"""What is stated at the targets of a program: how near, how far from the proof, whether so."""

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.geometry.frames import inverse
from calib.measurement.tool_target import places_are_found
from calib.shown import length_unit
from calib.uncertainty.statement.applicability import Applicability
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.conformity import Conformity, conformity
from calib.uncertainty.statement.departure import named as named_targets
from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.places import GROWN, MEASURE, place_words, reasons
from calib.uncertainty.statement.stated_point import widened
from testbed.files.programs.correct import ProgramResult
from testbed.files.rows.targets import called
from testbed.identify.applies.unsaid import seen_by, unsaid_spread, widened_by
from testbed.identify.calibration import Calibration
from testbed.identify.decisions import UNDECIDED, outcomes
from testbed.identify.handback.delivered import NOT_CORRECTED, TargetStatement
from testbed.identify.handback.in_use import carried
from testbed.report.text import csv_text
from testbed.scenario.tool_in_use import ToolInUse
from testbed.units import UM, counted, millimetres, significant

FILE_TOOL = "tool of the robot's file"
CALLED = ("target", "name", "where")
HEAD = (*CALLED, "R95_mean_um", "R95_move_um", "R95_relative", "transfer", "leverage", "place",
        "why")  # fmt: skip
DECIDED = ("deviation_before_um", "decision_before", "deviation_um", "decision", "risk")


def statement_at(calibration: Calibration, program: ProgramResult) -> TargetStatement | None:
    """What is believed at a program's targets; None where nothing is believed at all.

    Parameters
    ----------
    calibration : Calibration
        With what is believed, and a tolerance if one was stated.
    program : ProgramResult
        The corrected program.
    """
    belief = calibration.proof.belief
    if belief is None or calibration.elsewhere:
        return None
    reach, points = belief.proven.applies(program.q, program.at), points_of(calibration, program)
    departed = np.zeros(len(program.q), np.bool_) if program.departed is None else program.departed
    decidable = (reach.place != "outside") & ~departed
    stated = decidable & program.corrected
    place = np.where(program.corrected, np.where(departed, "outside", reach.place), NOT_CORRECTED)
    mean = _covariance(calibration, points, program, program.q)
    before = _covariance(calibration, points, program, program.q_before)
    radius_move = frozen(())
    if calibration.repeatability.any():
        move = _covariance(calibration, points, program, program.q, calibration.repeatability)
        radius_move = _radii(move, stated)
    return TargetStatement(
        radius_mean=_radii(mean, stated),
        radius_move=radius_move,
        transfer=reach.transfer,
        leverage=reach.leverage,
        place=frozen(place, np.str_),
        stated=frozen(stated, np.bool_),
        decidable=frozen(decidable, np.bool_),
        reaches=reach.reaches,
        why=_why(calibration, reach, program),
        before=_decided(calibration, program.deviation_before, before, decidable),
        after=_decided(calibration, program.deviation, mean, decidable),
        names=program.names,
        places=program.places,
        departed=frozen(departed, np.bool_),
        relative=calibration.relative,
    )


def tool_point(calibration: Calibration) -> Array:
    """The point that programs move, in the identified tool frame [m]; zero if it was measured."""
    found = calibration.fit.identification
    if calibration.own_frames or not any(name.startswith("tool.") for name in found.names):
        return np.zeros(3)
    own = inverse(found.model.chain.T_flange_tool) @ calibration.nominal.chain.T_flange_tool
    return np.asarray(own[:3, 3])


def of_file_tool(belief: Belief, calibration: Calibration) -> Belief:
    """What is believed of the tool of the robot's file, where another target was measured.

    Of links that a fit leaves at nominal, the last one's numbers were taken up by the place of the
    target; those of others by base and links, which stay.
    """
    point = calibration.nominal.chain.T_flange_tool[:3, 3]
    links = np.zeros_like(calibration.handback.tolerance)
    links[-1] = calibration.handback.tolerance[-1]
    x, y, z = point.tolist()
    return carried(belief, ToolInUse(FILE_TOOL, (x, y, z), (0.0, 0.0, 0.0), 0.0), point, links)


def tool_words(calibration: Calibration, program: ProgramResult | None = None) -> tuple[str, ...]:
    """Of which point R95 at targets is, where no reading is of it."""
    point, in_use = tool_point(calibration), calibration.handback.in_use
    if in_use is not None:
        return () if program is None else _tip_words(in_use.tool.name, program)
    if places_are_found(calibration.measurements):
        return (
            f"R95 at targets is for the {FILE_TOOL}: no reading shows how the flange stands to the "
            "measured targets, which is known only within the tolerances of the last link; for "
            "another tool, state [tool_in_use]",
        )
    if not point.any():
        return ()
    away = millimetres(float(np.linalg.norm(point)), 2)
    return (
        f"R95 at targets is for the {FILE_TOOL}, {away} mm from the measured target: no reading "
        "shows how the flange stands to that target, which is known only within the tolerances of "
        "the links; for another tool, state [tool_in_use]; if the tool of the file was measured, "
        'write tool = "fixed" under [identification]',
    )


def datum_words(calibration: Calibration) -> tuple[str, ...]:
    """That R95 at targets is relative, where no reading shows the base."""
    if not calibration.relative:
        return ()
    return (
        "R95 at targets is that of tool points to each other: the readings do not show where "
        "the robot stands, and what they leave open of that is in no radius",
    )


def _tip_words(name: str, program: ProgramResult) -> tuple[str, ...]:
    """At which targets R95 is that of the tip of the tool in use."""
    told = f"R95 at targets is for the tip of {name}, as [tool_in_use] states it"
    if program.has_tip is not None and not program.has_tip.all():
        rows = np.flatnonzero(~program.has_tip)
        where = named_targets("target", rows)
        told += f"; at {where}, where the tool measured is named, for the {FILE_TOOL}"
    return (told,)


def points_of(
    calibration: Calibration, program: ProgramResult
) -> tuple[tuple[Bool, Belief, Array], ...]:
    """What is believed of which point (3,) in the tool frame [m], at which targets (m,)."""
    belief, point, m = calibration.proof.belief, tool_point(calibration), len(program.q)
    assert belief is not None  # else nothing is stated
    in_use, has_tip = calibration.handback.in_use, program.has_tip
    has_tip = np.full(m, in_use is not None) if has_tip is None else has_tip
    found = []
    if in_use is not None and has_tip.any():
        links = calibration.handback.tolerance
        tip = carried(belief, in_use.tool, np.array(in_use.worst), links)
        found.append((has_tip, tip, np.zeros(3)))
    if not has_tip.all():
        if point.any() or places_are_found(calibration.measurements):
            belief, point = of_file_tool(belief, calibration), np.zeros(3)
        found.append((~has_tip, belief, point))
    return tuple(found)


def _covariance(
    calibration: Calibration,
    points: tuple[tuple[Bool, Belief, Array], ...],
    program: ProgramResult,
    q: Array,
    repeatability: Array | None = None,
) -> Array:
    """Covariances (m, 3, 3) whose chi-square regions are those of the targets [m^2]."""
    out, seen = np.zeros((len(q), 3, 3)), seen_by(calibration)
    for which, belief, point in points:
        at = program.at.rows(which)
        # what is unsaid of a pose is that of the pose as corrected
        unsaid = unsaid_spread(belief.model, program.q[which], at, seen, point)
        region = belief.regions(q[which], target=point, repeatability=repeatability, at=at)
        out[which] = widened(widened_by(region, unsaid))
    return out


def _radii(covariance: Array, stated: Bool) -> Array:
    """R95 (m,) of each region; zero where none is stated [m]."""
    return frozen(np.where(stated, distance_radius(covariance), 0.0))


def _why(calibration: Calibration, reach: Applicability, program: ProgramResult) -> tuple[str, ...]:
    """(m,) what grows or refuses each region; empty where nothing does."""
    assert calibration.proof.belief is not None  # else nothing reaches anything
    out = []
    for k, text in enumerate(reasons(calibration.proof.belief.proven, reach, program.q)):
        told = []
        if not program.corrected[k]:
            left = millimetres(float(program.left[k]), 2)
            told.append(f"{NOT_CORRECTED}: {left} mm is left")
        if program.departed is not None and program.departed[k]:
            told.append(program.conditions[k])
        # no region is stated there, which could be grown
        told += [one for one in text.split("; ") if one and (one != GROWN or not told)]
        out.append("; ".join(told))
    return tuple(out)


def _decided(
    calibration: Calibration, deviation: Array, covariance: Array, decidable: Bool
) -> Conformity | None:
    """Decisions on the targets with a region, if a tolerance was stated."""
    asked = calibration.decision
    if asked is None or not calibration.decidable or not decidable.any():
        return None
    found = calibration.fit.identification.model.chain.T_world_base
    own = found if calibration.own_frames else calibration.nominal.chain.T_world_base
    R = own[:3, :3] @ found[:3, :3].T  # deviations are in the axes of the robot's file
    S = R @ covariance @ R.T
    return conformity(deviation[decidable], S[decidable], asked.tolerance, rule=asked.rule)


def named(found: TargetStatement) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Name and place of each target (m,); empty in records that hold none."""
    none = ("",) * len(found.why)
    return found.names or none, found.places or none


def target_words(found: TargetStatement) -> tuple[str, ...]:
    """What is stated at the targets, in sentences."""
    m, n = len(found.place), int(found.stated.sum())
    departed = np.zeros(m, np.bool_) if found.departed is None else found.departed
    outside = int(((found.place == "outside") & ~departed).sum())
    refused = int((departed & (found.place != NOT_CORRECTED)).sum())
    left = found.place == NOT_CORRECTED
    which, kind = np.flatnonzero(~left), "corrected " * bool(left.any())
    said = []
    if len(which):
        names = called(named(found)[0])
        one, many = (f"{kind}{noun} of the program" for noun in ("target", "targets"))
        said.append(place_words(found.place[which], one, many, [names[k] for k in which]))
    if left.any():
        said.append(f"no radius is stated at {counted(int(left.sum()), 'target')} left as written")
    if refused:
        said.append(
            f"no region is stated at {counted(refused, 'target')} under conditions that the "
            "measurements did not have, or do not state"
        )
    if outside:
        most = f", where {outside} of {m} targets lie: {MEASURE}"
        said.append("no region is stated outside" + ("" if found.reaches else most))
    if n:
        mean, move = (
            x[found.stated] if len(x) else x for x in (found.radius_mean, found.radius_move)
        )
        unit = length_unit([*mean, *move])
        text = f"R95 (3-D radius, 95 %) of the mean is {_span(mean, *unit)}"
        if len(move):
            text += f", for a single move {_span(move, *unit)},"
        grown = ""
        if (found.transfer[found.stated] > 1).any():
            grown = "; it grows where transfer is above 1"
        said.append(f"{text} at {n} of {counted(m, 'target')}{grown}")
    return tuple(said)


def quoted_words(found: TargetStatement) -> str:
    """The radius to quote at the targets, which may be of another point than that measured."""
    if not found.stated.any():
        return ""
    mean = found.radius_mean[found.stated]
    return f"At the targets of the program quote R95 = {_span(mean, *length_unit(mean))}."


def _span(radius: Array, scale: float, unit: str) -> str:
    """Least to largest in a unit, of which `scale` make a meter."""
    ends = (significant(float(end) * scale) for end in (radius.min(), radius.max()))
    return f"{' to '.join(dict.fromkeys(ends))} {unit}"


def statement_csv(found: TargetStatement) -> str:
    """One row for each target, numbered from 1."""
    decided = found.before is not None and found.after is not None
    names, places = named(found)
    rows = []
    for k, why in enumerate(found.why):
        radii = [found.radius_mean[k], *found.radius_move[k : k + 1]] if found.stated[k] else []
        cells = [f"{radius * UM:.4g}" for radius in radii]
        told = ("yes" if found.relative else "no") if radii else ""
        cells = [str(k + 1), names[k], places[k], *cells, *[""] * (2 - len(cells)), told]
        cells += [f"{found.transfer[k]:.3g}", f"{found.leverage[k]:.3g}", str(found.place[k])]
        cells.append(why if found.decidable[k] else f"no region: {why}")
        rows.append([*cells, *(_decision_cells(found, k) if decided else ())])
    return csv_text(HEAD + DECIDED * decided, rows)


def _decision_cells(found: TargetStatement, k: int) -> list[str]:
    """Cells of `DECIDED` for one target."""
    if found.before is None or found.after is None or not found.decidable[k]:
        return ["", UNDECIDED, "", UNDECIDED, ""]
    at = int(found.decidable[:k].sum())
    cells = []
    for one in (found.before, found.after):
        cells += [f"{one.distance[at] * UM:.3f}", outcomes(one)[at]]
    return [*cells, f"{found.after.risk[at]:.3g}"]
