"""The report of a test after ISO 9283: the largest figures first, then each with its limits."""

from collections.abc import Mapping

from testbed.iso9283.decided import decisions, overall
from testbed.iso9283.figure_words import show_limit, unit
from testbed.iso9283.records import STANDARD, CycleResult
from testbed.iso9283.report_figures import (
    angle_section,
    cells,
    direction_section,
    distance_section,
    drift_section,
    path_sections,
    pose_section,
)
from testbed.iso9283.words import EDITION, enough, mark, next_step, notice, reasons, verdict
from testbed.jobsheet.report import Row, job_rows, job_section
from testbed.lengths import as_stated
from testbed.report.page import Block, Page, Points, Section, Table, Text, record_section
from testbed.store.layout import PLAYED_TEST
from testbed.units import sentences

WORST = ("AP", "RP", "AP_angle", "RP_angle_x", "RP_angle_y", "RP_angle_z", "vAP", "AD", "RD",
         "dAP", "dRP", "AT", "RT")  # fmt: skip
"""Figures of the headline, in its order."""
LIMITS = (
    "95 %: confidence limits of the figure that infinitely many cycles would give. Those of AP, "
    "AD, vAP, AT and drift use Student's t and include stated systematic errors; those of RP, RD "
    "and RT use chi-square, with degrees of freedom from the shape of the scatter. Lower limits "
    "allow for what scatter adds to a length, and for the choice of the largest gap, block or "
    "point. floor: what the figure would be on average if its true value were zero. PASS: every "
    "upper limit is within the limit, at a risk of 2.5 %. FAIL: a lower limit is beyond it, at a "
    "risk of 2.5 % for each figure; for RP, RD and RT, even after subtracting what the stated "
    "noise of the instrument adds. All limits assume normal scatter: if single cycles stray, they "
    "are too narrow, and the first section names one. At poses, correlated cycles count as fewer."
)


def page_of(result: CycleResult, versions: Mapping[str, str]) -> Page:
    """The report; sections without data are left out."""
    test = result.test
    sections = (
        pose_section(result),
        angle_section(result),
        direction_section(result),
        distance_section(result),
        drift_section(result),
        *path_sections(result),
        _data(result),
        job_section(sheet_rows(result)),
        record_section("The same files with the same versions give the same numbers.", versions),
    )  # fmt: skip
    return Page(
        banner=notice(result),
        title=f"{STANDARD}: {test.name}" if test.name else STANDARD,
        subtitle=EDITION,
        believable=enough(result) and overall(result) in ("", "PASS"),
        mark=mark(result),
        verdict=verdict(result),
        reasons=reasons(result),
        headline=headline(result),
        next_step=next_step(result),
        sections=tuple(section for section in sections if section is not None),
        recording=PLAYED_TEST,
    )


def headline(result: CycleResult) -> Table:
    """The largest figure of each kind."""
    asked = {one.name: one for one in decisions(result)}
    rows = []
    for name in WORST:
        figure = result.worst(name)
        if figure is not None:
            limit = asked.get(name)
            named = unit(figure) if limit is None else unit(figure, limit.limit)
            rows.append(
                (
                    called(name),
                    figure.where,
                    *cells(figure, named),
                    named.replace("u", "µ"),
                    "–" if limit is None else show_limit(limit.limit, named),
                    "–" if limit is None else limit.word,
                )
            )
    head = ("figure", "where", "value", "95 % from", "to", "floor", "cycles", "unit", "limit",
            "decision")  # fmt: skip
    shown = len(head) if asked else head.index("limit")
    return Table(
        caption="The largest figure of each kind",
        head=head[:shown],
        rows=tuple(row[:shown] for row in rows),
        align="llrrrrrlrl"[:shown],
        size="small",
        note=LIMITS,
    )  # fmt: skip


def called(name: str) -> str:
    """A figure's name for people."""
    return name.replace("_angle_", " about ").replace("_angle", " of orientation")


def sheet_rows(result: CycleResult) -> tuple[Row, ...]:
    """The job sheet with how the test was done, and what was decided."""
    test = result.test
    limits = ", ".join(f"{name} {as_stated(x)}" for name, x in test.limits.items())
    decided = "; ".join(one.sentence for one in decisions(result))
    stated = job_rows(
        test.job,
        (
            ("measured on", test.date),
            ("conditions", test.conditions),
            ("speed", f"{test.speed_percent:g} %" if test.speed_percent else ""),
            ("limits", limits),
            ("decision", decided),
        ),
    )
    return (*stated, ("standard", STANDARD)) if stated else ()


def _data(result: CycleResult) -> Section:
    """What was read, how, and in which frame."""
    test = result.test
    rows = [
        ("uncertainty of a reading", test.uncertainty or "not stated"),
        ("systematic errors", "as stated" if test.systematic else "not stated"),
        ("conditions", test.conditions or "not stated"),
        ("speed", f"{test.speed_percent:g} %" if test.speed_percent else "not stated"),
        *(("file", f"{one.path.name}, sha256 {one.sha256[:16]}") for one in test.files),
    ]
    blocks: list[Block] = [Table("What was read", ("what", "value"), tuple(rows), "ll")]
    for title, texts in (("How they were read:", test.notes), ("Warnings:", test.warnings)):
        if texts:
            blocks += [Text(title), Points(sentences(texts))]
    return Section("data", "The data", tuple(blocks))
