"""What each of several visits shows: its part, its frames, its errors; and whose frames leave."""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Bool
from calib.identification.outliers.unchanged import zeros_within
from calib.uncertainty.statement.stated_point import common_radius
from testbed.files.visits.visit import OWN, RobotVisit
from testbed.identify.calibration import Calibration
from testbed.identify.errors import figures_of
from testbed.identify.records import Figures
from testbed.lengths import column_unit, with_unit
from testbed.report.page import Section, Table, Text
from testbed.store.quantities import METRE, RADIAN, Quantity, below
from testbed.units import DEG, MM, UM, counted, fixed, listed, significant

TOLD, TOLD_SLIDE = np.radians(1.0), 5e-3
"""Changes of a zero that readings must rule out to say so [rad, m]: else base or tool, which each
session has of its own, could stand for it."""
MOST_ROWS = 5000
"""Rows above which nothing is said of them."""
IDENTIFIES, FITS, JUDGES = "identify", "fit its frames", "judge"
"""What rows of a visit do."""


def handed_out(calibration: Calibration) -> tuple[str, ...]:
    """Whose base and tool the robot that is handed out has; nothing where there is one visit."""
    if not calibration.visits:
        return ()
    lead = calibration.visits[0].name
    return (
        "base and tool of the robot that is handed back, and the stated radius, are those of "
        f'session "{lead}"',
    )


def judges_called(calibration: Calibration) -> str:
    """The held-out rows that were asked whether they stand in another frame."""
    frame, called = calibration.proof.frame, "the held-out rows"
    judges = calibration.split.is_test
    for k, visit in enumerate(calibration.visits):
        there = frame is not None and visit.station == frame.station
        if there and (of(calibration, k) & judges).any():
            return f"{called} of session {visit.name}"
    return called


def visit_section(calibration: Calibration) -> Section | None:
    """The sessions of the robot side by side, and the errors of each."""
    if not calibration.visits:
        return None
    used = Table(
        caption="Sessions of this robot; all of them share one set of link numbers",
        head=("session", "rows", "poses", "base", "tool", "uncertainty", "conditions", "date"),
        rows=tuple(
            (
                visit.name,
                str(int(of(calibration, k).sum())),
                _part_words(calibration, k),
                _frame(visit.base, f"station{visit.station + 1}", "base"),
                _frame(visit.tool, f"tool{visit.mounted + 1}", "tool"),
                visit.uncertainty,
                visit.conditions or "not stated",
                visit.date or "–",
            )
            for k, visit in enumerate(calibration.visits)
        ),
        align="lrllllll",
        size="small",
        note="station2, tool2 ...: see Parameters for their numbers. The frames of a held-out "
        "session are fitted to some of its poses while the robot is held; its other poses judge.",
    )
    parts = [*_parts(calibration)]
    radii = [radius_there(calibration, rows) for *_, rows in parts]
    scale, unit = column_unit([radius or 0.0 for radius in radii])
    errors = Table(
        caption="Errors of each session: measured minus predicted",
        head=("session", "rows that", "rows", "before mean mm", "mean mm", "p95 mm", "max mm",
              "mean deg", f"R95 there {unit}"),
        rows=tuple(
            (*_error_cells(calibration, *each), significant(radius * scale) if radius else "–")
            for each, radius in zip(parts, radii, strict=True)
        ),
        align="llrrrrrrr",
        size="small",
        note="A pose with several rows counts once. before: nominal links, with all free frames "
        "fitted. R95 there: radius that contains the true point of the target with 95 % "
        "probability (3-D) in the frames of this session, at these poses; it includes the "
        "uncertainty of these frames.",
    )  # fmt: skip
    (said,) = handed_out(calibration)
    text = Text(f"{said[0].upper()}{said[1:]}.")
    return Section("visits", "Sessions", (text, used, errors))


def visit_numbers(calibration: Calibration) -> Iterator[Quantity]:
    """The same for result.json, by the names of the sessions."""
    for k, visit in enumerate(calibration.visits):
        found = [
            Quantity("held_out", visit.held_out),
            Quantity("base", visit.base),
            Quantity("tool", visit.tool),
            Quantity("numbers", visit.numbers),
            Quantity("date", visit.date or None),
            Quantity("conditions", visit.conditions),
            Quantity("rows", int(of(calibration, k).sum())),
        ]
        for number, part, rows in _parts(calibration):
            if number != k:
                continue
            before, after = _before_after(calibration, rows)
            own = [
                Quantity("rows", int(rows.sum())),
                Quantity("before_mean_mm", before.position.mean, METRE),
                Quantity("mean_mm", after.position.mean, METRE),
                Quantity("max_mm", after.position.maximum, METRE),
            ]
            if (radius := radius_there(calibration, rows)) is not None:
                own.append(Quantity("radius_mean_mm", radius, METRE))
            if after.rotation is not None:
                own.append(Quantity("mean_deg", after.rotation.mean, RADIAN))
            found += below(part.replace(" ", "_"), own)
        yield from below(visit.name.replace("/", "_"), found)


def visit_words(calibration: Calibration) -> tuple[str, ...]:
    """Sentences on the sessions for the terminal and the first screen."""
    said = []
    for k, part, rows in _parts(calibration):
        if part != JUDGES:
            continue
        visit = calibration.visits[k]
        before, mean = (each.position.mean for each in _before_after(calibration, rows))
        poses = counted(calibration.measurements.rows(rows).n_poses, "held-out pose")
        frames = ", in frames of its own" if visit.frame_poses else ""
        said.append(
            f"session {visit.name}: {poses}{frames}: mean error {fixed(before * MM, 4)} mm before, "
            f"{fixed(mean * MM, 4)} mm after"
        )
        if (radius := radius_there(calibration, rows)) is not None and not calibration.elsewhere:
            said[-1] += f"; R95 there is {with_unit(radius)}, its frames included"
    return (*said, *unchanged_words(calibration), *handed_out(calibration))


def unchanged_words(calibration: Calibration) -> tuple[str, ...]:
    """Within what each later session that identifies has the joint zeros of those before it."""
    visit, used = calibration.visit, np.flatnonzero(calibration.is_used)
    if visit is None or calibration.moved is not None or len(used) > MOST_ROWS:
        return ()
    table, chain = calibration.measurements.rows(used), calibration.nominal.chain
    if table.is_distance.any():
        return ()
    said = []
    for k in np.unique(visit[used])[1:]:
        within = zeros_within(calibration.fit.identification, table, visit[used] >= k)
        told = [
            f"joint {i + 1} by "
            + (
                f"{significant(one * UM, 2)} um"
                if chain.kinds[i] == "prismatic"
                else f"{significant(one * DEG, 2)} deg"
            )
            for i, one in enumerate(within)
            if one < (TOLD_SLIDE if chain.kinds[i] == "prismatic" else TOLD)
        ]
        if told:
            said.append(
                f'no joint is shown to have changed from session "{calibration.visits[k].name}" '
                f"on; the readings rule out (95 %) that a zero changed by more than: "
                f"{listed(told)}"
            )
    return tuple(said)


def of(calibration: Calibration, k: int) -> Bool:
    """Rows (m,) of a visit."""
    return np.asarray(calibration.visit == k)


def part_of(calibration: Calibration, row: int) -> str:
    """What split.csv calls a row that fits the frames of a held-out visit; else nothing."""
    if calibration.visit is None or calibration.split.is_test[row]:
        return ""
    visit = calibration.visits[int(calibration.visit[row])]
    if not visit.held_out:
        return ""
    return "frames" if visit.frame_poses else "known joints"


def _parts(calibration: Calibration) -> Iterator[tuple[int, str, Bool]]:
    """Visits by number, with what some of their rows (m,) do."""
    judges = calibration.split.is_test
    for k, visit in enumerate(calibration.visits):
        own = of(calibration, k)
        mine = (
            ((FITS, own & ~judges),)
            if visit.held_out
            else ((IDENTIFIES, own & calibration.is_used),)
        )
        for part, rows in (*mine, (JUDGES, own & judges)):
            if rows.any():
                yield k, part, rows


def _part_words(calibration: Calibration, k: int) -> str:
    """How many poses of a visit do what."""
    return ", ".join(
        f"{calibration.measurements.rows(rows).n_poses} {part}"
        for number, part, rows in _parts(calibration)
        if number == k
    )


def _frame(whose: str, name: str, first: str) -> str:
    """Whose frame it is, and what its numbers are called."""
    if whose != OWN:
        return f"same as {whose}"
    return f"own ({first if name[-1] == '1' and not name[-2].isdigit() else name})"


def _before_after(calibration: Calibration, rows: Bool) -> tuple[Figures, Figures]:
    """Errors at some rows (m,) before and after, each pose counted once."""
    both = (calibration.before_misses, calibration.fit.misses)
    before, after = (figures_of(each, calibration.measurements, rows) for each in both)
    return before, after


def _error_cells(calibration: Calibration, k: int, part: str, rows: Bool) -> tuple[str, ...]:
    """Cells of one part of a visit, all but R95."""
    before, after = _before_after(calibration, rows)
    p = after.position
    lengths = (before.position.mean, p.mean, p.p95, p.maximum)
    turn = "–" if after.rotation is None else fixed(after.rotation.mean * DEG, 4)
    numbers = (fixed(value * MM, 4) for value in lengths)
    return (calibration.visits[k].name, part, str(int(rows.sum())), *numbers, turn)


def radius_there(calibration: Calibration, rows: Bool) -> float | None:
    """R95 at some rows (m,) in the frames of their session [m]; None where nothing is believed.

    The radius that is stated grows where held-out errors ask for it; so does this one.
    """
    belief, point = calibration.proof.belief, calibration.proof.point
    if belief is None or point is None:
        return None
    plain = common_radius(belief.regions(calibration.stated_q, target=calibration.target))
    there = belief.seen_regions(calibration.measurements.rows(rows))
    return common_radius(there) * point.radius_mean / plain


def own_reflectors(
    visits: tuple[RobotVisit, ...], names: tuple[str, ...]
) -> tuple[str | None, ...]:
    """Names of the reflectors on the tool that is handed out; None for those of other tools."""
    if not visits:
        return names
    lead = f"{visits[0].name}/"
    return tuple(name.removeprefix(lead) if name.startswith(lead) else None for name in names)
