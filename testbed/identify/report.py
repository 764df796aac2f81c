"""A calibration's report: what went in, old and new numbers with U, what can be told apart."""

from collections.abc import Mapping

import numpy as np

from calib.geometry.fixtures import POINT_AXES
from calib.geometry.frames import log_so3
from testbed.identify.applies.region import reach_section
from testbed.identify.conditions import conditions_words
from testbed.identify.decisions import decided_at, decision_section, decision_words
from testbed.identify.handback.delivered import Delivered
from testbed.identify.handback.report import hand_back_section
from testbed.identify.handback.states import HandedNumber, handed_numbers
from testbed.identify.headline import HEAD, headline_rows
from testbed.identify.records import Calibration
from testbed.identify.report_belief import belief_section
from testbed.identify.report_errors import (
    accuracy_section,
    joint_section,
    outlier_section,
    residual_section,
)
from testbed.identify.shared import shared_section
from testbed.identify.visits.report import visit_section
from testbed.identify.words import mark, next_step, notice, rank_words, reasons, sheet_rows, verdict
from testbed.jobsheet.report import job_section
from testbed.report.apart import left_nominal
from testbed.report.glossary import glossary_section
from testbed.report.page import Block, Page, Points, Section, Table, Text, record_section
from testbed.store.layout import RECORDING
from testbed.units import (
    DEG,
    MM,
    counted,
    decimals,
    fixed,
    listed,
    sentences,
    typeset,
    with_uncertainty,
)

HIGHEST_LISTED = 4
"""Waves a turn up to which the numbers of a joint are listed."""
NO_DELTA = 1e-9
"""A change that is rounding [mm, deg]."""
UNSEEN = 5e-5
"""A change that four decimals do not show [mm, deg]."""
KINDS = {"pose": "position and orientation", "point": "position", "distance": "a distance"}
"""What a reading of each kind measures."""
ONE_NUMBER = "U = 2 u (95.4 %)"
"""Heads the U of single numbers: k = 2 in one dimension."""


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
    said = (*decision_words(calibration, delivered), *reasons(calibration))
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
        hand_back_section(calibration),
        identifiable_section(calibration),
        delivered_section(delivered),
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
        title=f"{source.robot_title}: {source.name}",
        subtitle=f"Session {source.name}, robot {source.robot}, seed {calibration.split.seed}; "
        f"{calibration.split.sentence}.",
        believable=calibration.believable,
        mark=mark(calibration),
        verdict=typeset(verdict(calibration)),
        reasons=tuple(map(typeset, said)),
        headline=headline(calibration),
        next_step=typeset(f"{next_step(calibration)} {conditions_words(calibration)}"),
        recording=RECORDING,
        sections=tuple(section for section in sections if section is not None),
    )


def headline(calibration: Calibration) -> Table:
    """Before and after, every model."""
    chosen = 1 + [fit.model for fit in calibration.fits].index(calibration.choice.chosen)
    held = calibration.split.is_test.any()
    where = "held-out rows, never used for identification" if held else "the rows identified from"
    return Table(
        caption=f"Errors at {where}: seen minus predicted",
        head=HEAD,
        rows=headline_rows(calibration),
        strong=(chosen,),
        size="small",
        note="Measuring noise is in the errors; a pose of several rows counts once. First row: the "
        "links as described, with base, tool and fixtures fitted to the training poses. training "
        "mean: at the rows identified from. χ²/dof: residuals against the stated noise. cond.: of "
        "the scaled Jacobian of the kept numbers. rank: directions that the data tell apart.",
    )


def delivered_section(delivered: Delivered) -> Section:
    """The files to use, each with its proof."""
    blocks: list[Block] = [
        Text(
            "robot/: the identified robot, robot.toml with every term, URDF and MJCF with the "
            "geometric part, joint_origins.yaml for ROS. dh_table.csv: every number old and new. "
            "joint_map.csv, where there is one: what each joint turns beside its command. "
            "split.csv: every row with its errors and its place against what was proven."
        ),
        Points(sentences(delivered.robot)),
    ]
    if delivered.program:
        blocks += [Text("Corrected program:"), Points(sentences(delivered.program))]
    return Section("files", "What comes with this report", tuple(blocks))


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
        Table(caption="What was read", head=("what", "value"), rows=rows, align="ll"),
    ]
    for title, texts in (
        ("How they were read:", source.probe),
        ("Assumed of the robot:", source.robot_notes),
        (f"Masked, {counted(len(source.masked), 'note')}:", source.masked),
        ("Drift:", source.drift or ("no drift nest was measured: only the errors over time can "
                                    "show whether something moved",)),
    ):  # fmt: skip
        if texts:
            blocks += [Text(title), Points(sentences(texts))]
    return Section("data", "The data", tuple(blocks))


def parameter_section(calibration: Calibration) -> Section:
    """Every number of the robot old, new and changed, with its U; fixtures as found."""
    result = calibration.fit.identification
    how = "from the stated noise, if the model is right"
    if calibration.not_linear:
        played = calibration.proof.bootstrap
        unsettled = played is None or not played.settled
        how = "where linear propagation does not hold: " + (
            "a rough size only, because virtual calibrations did not settle"
            if unsettled
            else "from the spread of virtual calibrations"
        )
    elif calibration.refuted:
        how = (
            "from the scatter of the residuals between poses, because a test refutes the stated "
            "noise: it says how well the numbers of this model are known from poses like these, "
            "not that the model is right"
        )
    waves = {
        t.name
        for t in result.model.joint_errors.terms
        if t.name.startswith("harmonic") and t.order > HIGHEST_LISTED
    }
    blocks: list[Block] = [
        Text(
            f"U = 2 u covers one number with 95.4 %, {how}; misfit hidden by the noise is in the "
            "region of the tool point, not in U. The numbers are correlated: use them as one set. "
            "A number that others can replace stays near its old value."
        ),
        Table(
            caption=f"Base, links, tool: {result.parameters.n_free} numbers estimated in all"
            + (", joint terms included" if calibration.choice.chosen == "extended" else ""),
            head=("number", "unit", "old", "new", "delta", ONE_NUMBER, "held by"),
            rows=tuple(
                _cells(one)
                for one in handed_numbers(calibration)
                if one.row.name not in waves and not still(one)
            ),
            align="llrrrrl",
            size="small",
            note="Numbers that stay as they were are in dh_table.csv. old: the nominal links, and "
            "base and tool as fitted to them. base, tool: position and rotation vector in the "
            "measuring frame and in the flange. held by: see What is handed back."
            + (
                f" {counted(len(waves), 'wave')} of joint maps are drawn under Joint errors "
                "instead and stand in dh_table.csv."
                if waves
                else ""
            ),
        ),
    ]
    if result.model.fixtures.n_numbers:
        blocks.append(fixture_table(calibration))
    return Section("parameters", "Parameters", tuple(blocks))


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
        caption="What stood beside the robot",
        head=("number", "unit", "value", ONE_NUMBER),
        rows=tuple(
            _row(called.get(name, name), float(value), float(u[first + k]), length)
            for k, (name, value, length) in enumerate(
                zip(fixtures.names, values, fixtures.is_length, strict=True)
            )
        ),
        align="llrr",
        size="small",
        note="Reflectors in the tool frame, anchors and stations in that of the first station, "
        "tools in that of the flange; U along and about a frame's own axes.",
    )


def identifiable_section(calibration: Calibration) -> Section:
    """What the measurements can tell apart, in words."""
    blocks: list[Block] = [Points(sentences(calibration.frames))]
    for fit in calibration.fits:
        result = fit.identification
        dependent = result.reduction.sentences
        shown = left_nominal(dependent) if fit is calibration.fits[0] else ()
        texts = (*shown, *sentences(result.notes[len(dependent) :]))
        blocks.append(Text(rank_words(fit)))
        blocks += [Points(texts)] if texts else []
    return Section("identifiable", "What can be identified", tuple(blocks))


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
