"""Sections of a test's report: poses, orientation, directions, distances, drift, paths."""

import numpy as np

from testbed.iso9283.figure_words import show, unit_of_all
from testbed.iso9283.plots import FEW, clusters, drawn, drift_picture, factor_of, path_picture
from testbed.iso9283.records import CycleResult, StatedFigure
from testbed.report.page import Figure as Drawing
from testbed.report.page import Section, Table
from testbed.report.svg import on_phone
from testbed.units import counted, p_equals, probability, significant

MOST_ROWS = 60
"""Rows of a table; all of them stand in iso9283.csv."""


def cells(figure: StatedFigure, named: str) -> tuple[str, ...]:
    """Value, limits and floor in a unit, and cycles."""
    floor = "–" if np.isnan(figure.floor) else show(figure.floor, figure, named)
    values = (show(x, figure, named) for x in (figure.value, figure.lower, figure.upper))
    return (*values, floor, str(figure.cycles))


def pose_section(result: CycleResult) -> Section | None:
    """AP and RP of every pose, and where the cycles fell."""
    visits = result.test.visits
    if visits is None:
        return None
    parts = {name: result.of(name) for name in ("AP", "AP_x", "AP_y", "AP_z", "RP")}
    rows, named = [], unit_of_all(result.of("AP", "RP"))
    for e, name in enumerate(visits.names[:MOST_ROWS]):
        own = {key: figures[e] for key, figures in parts.items()}
        along = (own[f"AP_{axis}"] for axis in "xyz")
        signed = (show(part.value, part, named) for part in along)
        AP, RP = own["AP"], own["RP"]
        rows.append(
            (
                name, show(AP.value, AP, named), _span(AP, named), *signed,
                show(RP.value, RP, named), _span(RP, named),
                "–" if np.isnan(RP.floor) else show(RP.floor, RP, named),
            )
        )  # fmt: skip
    table = Table(
        caption=f"Pose accuracy and repeatability, {_letter(named)}, {visits.cycles} cycles",
        head=("pose", "AP", "95 %", "AP x", "AP y", "AP z", "RP", "95 %", "floor of RP"),
        rows=tuple(rows),
        align="lrrrrrrrr",
        size="small",
        note="AP: from the commanded position to the barycenter of the attained ones; x, y, z in "
        "the frame of the commands. RP: mean distance to the barycenter plus three standard "
        f"deviations of it.{_more(len(visits.names))}",
    )
    count = len(drawn(result))
    which = "" if count == len(visits.names) else f" The {count} poses that scatter most."
    thinned = f" At most {2 * FEW} cycles, evenly spread, are drawn." * (visits.cycles > 2 * FEW)
    picture = Drawing(
        "Readings of each pose about their barycenter, seen from above (x, y) and from the side "
        f"(x, z).{which} An arrow that ends at the edge points to a command outside the picture."
        f"{thinned}",
        clusters(result),
        phone=on_phone(clusters, result),
    )
    return Section("poses", "Poses", (table, picture))


def _span(figure: StatedFigure, named: str) -> str:
    """Both limits in one cell."""
    return f"{show(figure.lower, figure, named)} to {show(figure.upper, figure, named)}"


def _letter(named: str) -> str:
    """A unit with micro as one letter."""
    return named.replace("u", "µ")


def _more(count: int) -> str:
    """What a note adds where rows are left out."""
    return f" {count - MOST_ROWS} more stand in iso9283.csv." if count > MOST_ROWS else ""


def angle_section(result: CycleResult) -> Section | None:
    """Orientation of every pose."""
    turns, about = result.of("AP_angle"), [result.of(f"RP_angle_{axis}") for axis in "xyz"]
    if not about[0]:
        return None
    named = unit_of_all([*turns, *(figure for own in about for figure in own)])
    rows = tuple(
        (
            one.where,
            *((show(turns[e].value, turns[e], named), _span(turns[e], named)) if turns else "––"),
            *(
                cell for own in about
                for cell in (show(own[e].value, own[e], named), _span(own[e], named))
            ),
        )
        for e, one in enumerate(about[0][:MOST_ROWS])
    )  # fmt: skip
    table = Table(
        f"Orientation, {named}",
        ("pose", "AP", "95 %", "RP x", "95 %", "RP y", "95 %", "RP z", "95 %"),
        rows,
        size="small",
        note="By rotation vectors about the mean attained rotation, in the axes of the commands, "
        "not by Euler angles: AP is the angle from the commanded to the mean rotation, RP three "
        f"standard deviations about each axis.{_more(len(about[0]))}",
    )
    return Section("angles", "Orientation", (table,))


def direction_section(result: CycleResult) -> Section | None:
    """VAP of every pose that was reached from several directions."""
    figures = result.of("vAP")
    if not figures:
        return None
    named = unit_of_all(figures)
    rows = tuple((figure.where, *cells(figure, named)) for figure in figures[:MOST_ROWS])
    head = ("where", f"vAP {_letter(named)}", "95 % from", "to", "floor", "cycles")
    note = "Largest distance between the barycenters of one pose reached from several directions."
    table = Table("vAP", head, rows, size="small", note=note + _more(len(figures)))
    return Section("directions", "Directions of approach", (table,))


def distance_section(result: CycleResult) -> Section | None:
    """AD and RD of pairs of poses."""
    AD, RD = result.of("AD"), result.of("RD")
    if not AD:
        return None
    named = unit_of_all([*AD, *RD])
    rows = tuple(
        (
            one.where, show(one.value, one, named), _span(one, named),
            show(two.value, two, named), _span(two, named),
        )
        for one, two in zip(AD[:MOST_ROWS], RD, strict=False)
    )  # fmt: skip
    table = Table(
        f"Distance accuracy and repeatability, {_letter(named)}",
        ("from, to", "AD", "95 %", "RD", "95 %"),
        rows,
        size="small",
        note="AD: mean attained distance minus the commanded one. RD: three standard deviations of "
        f"the attained distance over the cycles.{_more(len(AD))}",
    )
    return Section("distances", "Distances", (table,))


def drift_section(result: CycleResult) -> Section | None:
    """Drift over blocks of ten cycles."""
    if not result.drifts:
        return None
    dAP, dRP = result.of("dAP"), result.of("dRP")
    named = unit_of_all([*dAP, *dRP])
    rows = tuple(
        (
            one.where, str(len(one.AP)), significant(float(np.ptp(one.hours)), 2),
            show(a.value, a, named), _span(a, named), show(one.chance[0], a, named),
            probability(one.p_values[0]), show(r.value, r, named),
            show(one.chance[1], r, named), probability(one.p_values[1]),
        )
        for one, a, r in zip(result.drifts[:MOST_ROWS], dAP, dRP, strict=False)
    )  # fmt: skip
    table = Table(
        f"Drift of pose accuracy and repeatability, {_letter(named)}",
        ("pose", "blocks", "over h", "dAP", "95 %", "chance 95 %", "p", "dRP", "chance 95 %", "p"),
        rows,
        size="small",
        note="Blocks of ten cycles in order of time. dAP and dRP: largest change of AP and RP "
        "from the first block. chance 95 %: in 95 % of random orders of the same cycles the change "
        f"is smaller. p: share of orders with at least this change; all poses and figures: p "
        f"{p_equals(result.drift_p_value)}.{_more(len(result.drifts))}",
    )
    picture = Drawing(
        "AP and RP of each block of ten cycles. Dark: the pose whose change is least likely to be "
        "chance.",
        drift_picture(result.drifts),
        phone=on_phone(drift_picture, result.drifts),
    )
    return Section("drift", "Drift", (table, picture))


def path_sections(result: CycleResult) -> list[Section]:
    """AT and RT of every path, with its tube."""
    sections = []
    for k, shown in enumerate(result.paths):
        figures = [f for f in result.of("AT", "RT") if f.where == f"path {shown.name}"]
        named = unit_of_all(figures)
        rows = tuple((figure.name, *cells(figure, named)) for figure in figures)
        run = result.test.paths[k]
        how = (
            "" if run.matched else " The runs have no point numbers and were read in their order."
        )  # fmt: skip
        table = Table(
            f"Path {shown.name}: {counted(len(run.runs), 'run')}, {len(shown.command)} points",
            ("figure", _letter(named), "95 % from", "to", "floor", "runs"),
            rows,
            size="small",
            note="AT: largest distance of the mean path from a commanded point, in the plane "
            "across the path there. RT: largest mean distance to the mean path plus three standard "
            "deviations, in such a plane. Lead or lag along the path does not count. Both are the "
            "largest of many points, and so a little too high: the lower limits allow for that, "
            f"by using 1 - 0.025/{len(shown.command)} for each point.{how}",
        )
        picture = Drawing(
            f"Commanded path, mean path and the tube of RT, errors magnified {factor_of(shown)} "
            "times; and the distance of the mean path from the command, and RT, at each point.",
            path_picture(shown),
            phone=on_phone(path_picture, shown),
        )
        sections.append(Section(f"path-{k + 1}", f"Path {shown.name}", (table, picture)))
    return sections
