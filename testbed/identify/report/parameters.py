"""A calibration report's section on numbers: old and new with their U, and fixtures."""

from collections.abc import Iterable, Sequence

import numpy as np

from calib.geometry.fixtures import POINT_AXES
from calib.geometry.frames import log_so3
from calib.geometry.joint_errors import JointTerm
from testbed.identify.calibration import Calibration
from testbed.identify.handback.states import HandedNumber, handed_numbers
from testbed.report.page import Block, Section, Table, Text
from testbed.units import DEG, MM, counted, decimals, fixed, with_uncertainty

HIGHEST_LISTED = 4
"""Waves a turn up to which the numbers of a joint are listed, where none has more."""
NO_DELTA = 1e-9
"""A change that is rounding [mm, deg]."""
UNSEEN = 5e-5
"""A change that four decimals do not show [mm, deg]."""
ONE_NUMBER = "U = 2 u (95.4 %)"
"""Heads the U of single numbers: k = 2 in one dimension."""


def parameter_section(calibration: Calibration) -> Section:
    """Every number of the robot old, new and changed, with its U; fixtures as found."""
    result = calibration.fit.identification
    how = "from the stated noise, if the model is right"
    if calibration.not_linear:
        played = calibration.proof.bootstrap
        unsettled = played is None or not played.settled
        how = "where linear propagation does not hold: " + (
            "only a rough size, because virtual calibrations did not converge"
            if unsettled
            else "from the spread of virtual calibrations"
        )
    elif calibration.refuted:
        how = (
            "from the scatter of the residuals between poses, because a test refutes the stated "
            "noise: U shows how well poses like these determine the numbers of this model, not "
            "that the model is right"
        )
    drawn = drawn_waves(result.model.joint_errors.terms)
    shown = [
        one for one in handed_numbers(calibration) if one.row.name not in drawn and not still(one)
    ]
    waves = sum(one.row.name.startswith("harmonic") for one in shown)
    blocks: list[Block] = [
        Text(
            f"U = 2 u contains one number with 95.4 % probability, {how}. U does not include "
            "misfit hidden by the noise; the region of the tool point does. The numbers are "
            "correlated: use them as one set. A number that others can replace stays near its old "
            "value."
        ),
        Table(
            caption=f"Base, links, tool: {counted(result.parameters.n_free, 'number')} estimated, "
            f"{len(shown)} changed"
            + (", joint terms included" if calibration.choice.chosen == "extended" else ""),
            head=("number", "unit", "old", "new", "delta", ONE_NUMBER, "held by"),
            rows=tuple(map(_cells, shown)),
            align="llrrrrl",
            size="small",
            on_paper=len(shown) - waves if are_last(shown, waves) else None,
            note="dh_table.csv also has the numbers that did not change. old: the nominal links, "
            "and base and tool as fitted to them. base, tool: position and rotation vector, in the "
            "measuring frame and in the flange frame. held by: see What is handed back."
            + (
                f" {counted(len(drawn), 'number')} of joint maps are drawn under Joint errors "
                "instead, and listed in dh_table.csv."
                if drawn
                else ""
            )
            + " Waves of joints, drawn under Joint errors, are not printed." * bool(waves),
        ),
    ]
    if result.model.fixtures.n_numbers:
        blocks.append(fixture_table(calibration))
    return Section("parameters", "Parameters", tuple(blocks))


def are_last(shown: Sequence[HandedNumber], waves: int) -> bool:
    """Whether the last numbers of a list, and no others, are so many waves of joints."""
    last = shown[len(shown) - waves :]
    return waves > 0 and all(one.row.name.startswith("harmonic") for one in last)


def drawn_waves(terms: Iterable[JointTerm]) -> set[str]:
    """Names of the waves of joints that have a map: it is drawn, and nobody reads its numbers."""
    waves = [one for one in terms if one.name.startswith("harmonic")]
    mapped = {one.joint for one in waves if one.order > HIGHEST_LISTED}
    return {one.name for one in waves if one.joint in mapped}


def fixture_table(calibration: Calibration) -> Table:
    """Reflectors, anchors, further stations and tools as found."""
    result = calibration.fit.identification
    u = np.zeros(len(result.parameters.names))
    u[result.parameters.free_index] = np.sqrt(np.diag(calibration.covariance))
    fixtures = result.model.fixtures
    frames = [
        np.concatenate([T[:3, 3], log_so3(T[None, :3, :3])[0]])
        for T in (*fixtures.stations, *fixtures.tools)
    ]
    values = np.concatenate([fixtures.reflectors.ravel(), fixtures.anchors.ravel(), *frames])
    first = result.model.first_fixture
    called = {
        f"reflector{k + 1}.{axis}": f"reflector{k + 1}.{axis} ({name})"
        for k, name in enumerate(calibration.reflector_names)
        for axis in POINT_AXES
    }
    return Table(
        caption="Reflectors, anchors, stations and tools as found",
        head=("number", "unit", "value", ONE_NUMBER),
        rows=tuple(
            _row(called.get(name, name), float(value), float(u[first + k]), length)
            for k, (name, value, length) in enumerate(
                zip(fixtures.names, values, fixtures.is_length, strict=True)
            )
        ),
        align="llrr",
        size="small",
        note="Reflectors are given in the tool frame, anchors and stations in the frame of the "
        "first station, tools in the flange frame; U along and about the axes of each frame.",
    )


def still(number: HandedNumber) -> bool:
    """Whether a number without a U stays where it was, but for rounding."""
    return number.row.expanded is None and abs(number.row.delta) <= UNSEEN


def _cells(number: HandedNumber) -> tuple[str, ...]:
    """One row, rounded by its uncertainty; a number without one as it stands."""
    row = number.row
    if row.expanded is None:
        if abs(row.delta) <= NO_DELTA:
            old = f"{row.old:.6g}".replace("-", "−")
            return (row.name, row.unit, old, old, "0", "–", number.held_by)
        places = max(4, decimals(row.delta, 2))
        new, delta = fixed(row.new, places), fixed(row.delta, places)
        return (row.name, row.unit, _short(row.old, places), new, delta, "–", number.held_by)
    new, half, delta = with_uncertainty(row.new, row.expanded / 2, row.delta)
    places = len(half.partition(".")[2])
    old = _short(row.old, places)
    return (row.name, row.unit, old, new, delta, fixed(row.expanded, places), number.held_by)


def _short(value: float, places: int) -> str:
    """A number stated with fewer decimals as it was stated; a fitted one with all of them."""
    text = fixed(value, places)
    stated = abs(value - round(value, places)) <= NO_DELTA
    return text.rstrip("0").rstrip(".") if stated and "." in text else text


def _row(name: str, value: float, u: float, length: bool) -> tuple[str, ...]:
    """A value with its U, or held."""
    scale, unit = (MM, "mm") if length else (DEG, "deg")
    if u <= 0:
        return (name, unit, f"{value * scale:.6g}".replace("-", "−"), "held")
    written, _, expanded = with_uncertainty(value * scale, u * scale, 2 * u * scale)
    return (name, unit, written, expanded)
