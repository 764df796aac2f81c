"""A calibration's report: all its sections, with what went in and what can be told apart."""

from collections.abc import Iterator, Mapping

from testbed.identify.applies.region import reach_section
from testbed.identify.calibration import Calibration
from testbed.identify.conditions import conditions_words
from testbed.identify.decisions import decided_at, decision_section, decision_words
from testbed.identify.handback.delivered import Delivered
from testbed.identify.handback.report import hand_back_section
from testbed.identify.headline import condition, headline_cells
from testbed.identify.moved import moved_words
from testbed.identify.records import FittedModel
from testbed.identify.report.belief import belief_section
from testbed.identify.report.errors import (
    accuracy_section,
    joint_section,
    outlier_section,
    residual_section,
)
from testbed.identify.report.parameters import parameter_section
from testbed.identify.shared import shared_section, states_instrument
from testbed.identify.to_do.next_step import next_step
from testbed.identify.to_do.program import program_step
from testbed.identify.visits.report import visit_section
from testbed.identify.words import mark, notice, reasons, verdict
from testbed.jobsheet.report import Row, job_rows, job_section
from testbed.lengths import as_stated
from testbed.report.apart import left_nominal
from testbed.report.glossary import glossary_section
from testbed.report.page import Block, Page, Points, Section, Table, Text, record_section
from testbed.store.layout import RECORDING
from testbed.units import counted, listed, sentence, sentences, typeset

KINDS = {"pose": "position and orientation", "point": "position", "distance": "a distance"}
"""What a reading of each kind measures."""


def page_of(calibration: Calibration, delivered: Delivered, versions: Mapping[str, str]) -> Page:
    """The report of a calibration; sections without data are left out.

    Parameters
    ----------
    calibration : Calibration
        As `testbed.identify.calibrate.calibrate` gives it.
    delivered : Delivered
        What was written beside it.
    versions : mapping of str to str
        Program and packages.
    """
    source = calibration.source
    decided, moved = decision_words(calibration, delivered), sentences(moved_words(calibration))
    why = [text for text in reasons(calibration) if text not in moved]
    sections = (
        accuracy_section(calibration),
        visit_section(calibration),
        belief_section(calibration),
        reach_section(calibration, delivered),
        decision_section(decided_at(calibration, delivered)),
        shared_section(calibration),
        joint_section(calibration),
        residual_section(calibration),
        outlier_section(calibration),
        parameter_section(calibration),
        hand_back_section(calibration, delivered_blocks(delivered)),
        identifiable_section(calibration),
        data_section(calibration),
        job_section(sheet_rows(calibration, delivered)),
        glossary_section(),
        record_section(
            f"Seed {calibration.split.seed}. The same files, robot and options with the same "
            "versions give the same numbers.",
            versions,
        ),
    )
    return Page(
        banner=notice(calibration),
        title=f"Calibration of {source.robot}: {source.name}",
        subtitle=sentence(calibration.split.sentence),
        believable=calibration.settled,
        mark=mark(calibration),
        verdict=typeset(" ".join((verdict(calibration), *moved, *decided[:1]))),
        reasons=tuple(map(typeset, (*decided[1:], *why))),
        headline=headline(calibration),
        next_step=typeset(" ".join(filter(None, _to_do(calibration, delivered)))),
        recording=RECORDING,
        sections=tuple(section for section in sections if section is not None),
    )


def _to_do(calibration: Calibration, delivered: Delivered) -> Iterator[str]:
    """What to do, under which conditions it holds, and what R95 leaves out."""
    yield next_step(calibration)
    yield program_step(calibration, delivered)
    yield conditions_words(calibration)
    if not states_instrument(calibration.shared):
        yield "Systematic errors of the instrument are in no figure: the session states none."


def headline(calibration: Calibration) -> Table:
    """Before and after, every model."""
    chosen = 1 + [fit.model for fit in calibration.fits].index(calibration.choice.chosen)
    held = calibration.split.is_test.any()
    where = "held-out rows, never used for identification" if held else "the training rows"
    head, rows = headline_cells(calibration)
    return Table(
        caption=f"Errors at {where}: measured minus predicted",
        head=head,
        rows=rows,
        strong=(chosen,),
        size="small",
        note="The errors include measuring noise. A pose with several rows counts once, by their "
        "root mean square, so the mean over the rows of split.csv may differ. First row: the "
        "links as described, with base, tool and fixtures fitted to the training poses. training: "
        "mean at the training rows. χ²/dof: residuals against the stated noise.",
    )


def delivered_blocks(delivered: Delivered) -> tuple[Block, ...]:
    """The files to use, each with its proof."""
    kind, own = delivered.own_file
    blocks: list[Block] = [
        Text(
            "robot/: the identified robot, as robot.toml with all terms, as URDF and MJCF with the "
            "geometric part, and joint_origins.yaml for ROS. dh_table.csv: old and new value of "
            "every number. joint_map.csv, if there is one: how far each joint turns beyond its "
            "command. split.csv: every row with its errors, and whether it lies inside what was "
            "proven."
            + f" {own}: your own {kind} with corrected {'places' if kind == 'MJCF' else 'origins'}."
            * bool(own)
        ),
        Points(sentences(delivered.robot)),
    ]
    if delivered.program:
        blocks += [Text("Corrected program:"), Points(sentences(delivered.program))]
    return tuple(blocks)


def data_section(calibration: Calibration) -> Section:
    """What was read, how, and what was left out."""
    source, table = calibration.source, calibration.measurements
    kinds = listed(
        [
            f"{int((table.kind == kind).sum())} of {KINDS[kind]}"
            for kind in sorted(set(table.kind.tolist()))
        ]
    )
    again = " (some were measured several times)" if table.n_poses < len(table) else ""
    rows = (
        ("readings", kinds),
        ("different poses", f"{table.n_poses}{again}"),
        ("joints", source.joints),
        ("split", calibration.split.sentence),
        ("uncertainty", source.uncertainty),
        ("robot", f"{source.robot_title}, sha256 {source.robot_sha256[:16]}"),
        *(("file", f"{name}, sha256 {digest[:16]}") for name, digest in source.files),
    )
    blocks: list[Block] = [
        Table(caption="What was read", head=("what", "value"), rows=rows, align="ll")
    ]
    for title, texts in (
        ("How they were read:", source.probe),
        ("Assumed of the robot:", source.robot_notes),
        (f"Masked, {counted(len(source.masked), 'note')}:", source.masked),
        ("Drift:", source.drift or ("no drift nest was measured, so only the errors over time can "
                                    "show whether something moved",)),
    ):  # fmt: skip
        if texts:
            blocks += [Text(title), Points(sentences(texts))]
    return Section("data", "The data", tuple(blocks))


def identifiable_section(calibration: Calibration) -> Section:
    """What the measurements can tell apart, in words."""
    fit = calibration.fit
    result = fit.identification
    texts = (
        *sentences(calibration.frames),
        rank_words(fit),
        *left_nominal(result.reduction),
        *sentences(result.notes_of_fit),
    )
    return Section("identifiable", "What can be identified", (Points(texts),))


def rank_words(fit: FittedModel) -> str:
    """How many numbers the data tell apart, and how that was counted."""
    result = fit.identification
    reduction = result.reduction
    free = len(reduction.kept) + len(reduction.dropped)
    text = (
        f"{fit.model.capitalize()}: {counted(free, 'number')} free, "
        f"{len(result.parameters.names) - free} held; rank {reduction.rank} (singular values above "
        f"{reduction.tolerance:.0e} of the largest count)"
    )
    alike = condition(reduction)
    text += f", condition {alike} of the kept columns. " if alike else ". "
    if result.prior is not None:
        text += (
            f"{counted(len(result.prior.names), 'number')} of links and joints have a weak prior "
            "and are estimated even if the data cannot tell them apart. "
        )
    if not reduction.dropped:
        return text + "All free numbers can be told apart."
    return text + (
        f"{counted(len(reduction.dropped), 'number')} cannot be told from others and "
        f"{'is' if len(reduction.dropped) == 1 else 'are'} not fitted"
        + (
            " (handed back, a change may be shared among such numbers):"
            if result.prior is None
            else " unless the prior holds them."
        )
    )


def sheet_rows(calibration: Calibration, delivered: Delivered) -> tuple[Row, ...]:
    """The job sheet with the robot before it, and the day, the tolerance and the decision after."""
    asked, day = calibration.decision, calibration.set_up.date
    limit = "" if asked is None else f"{as_stated(asked.tolerance)}, {asked.rule}"
    stated = job_rows(calibration.set_up.job, (("measured on", day), ("tolerance", limit)))
    decided = "; ".join(text.rstrip(".") for text in decision_words(calibration, delivered))
    return (*stated, ("decision", decided)) if decided else stated
