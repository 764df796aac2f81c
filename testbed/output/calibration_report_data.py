"""A calibration report's sections on what went in and what came out: data, files, versions."""

from collections.abc import Mapping

from testbed.output.calibration_words import closed
from testbed.output.quantities import counted
from testbed.output.report_parts import Block, Points, Section, Table, Text, versions_table
from testbed.records_calibration import Calibration, Delivered


def delivered_section(delivered: Delivered) -> Section:
    """The files to use, each with its proof."""
    blocks: list[Block] = [
        Text(
            "robot/ holds the identified robot: robot.toml with every term, URDF and MJCF with "
            "the geometric part. dh_table.csv: the table above. split.csv: every row with its "
            "errors."
        ),
        Points(tuple(closed(text) for text in delivered.robot)),
    ]
    if delivered.program:
        blocks += [Text("Corrected program:"), Points(tuple(map(closed, delivered.program)))]
    return Section("files", "What comes with this report", tuple(blocks))


def data_section(calibration: Calibration) -> Section:
    """What was read, how, and what was left out."""
    source, table = calibration.source, calibration.measurements
    kinds = ", ".join(
        f"{int((table.kind == kind).sum())} {kind}{'s' if kind[-1] != 's' else ''}"
        for kind in sorted(set(table.kind.tolist()))
    )
    rows = (
        ("rows", f"{len(table)} ({kinds})"),
        ("poses", str(table.n_poses)),
        ("joints", source.joints),
        ("split", calibration.split.sentence),
        ("uncertainty", source.uncertainty),
        ("robot", f"{source.robot_title}, sha256 {source.robot_sha256[:16]}"),
        *(("file", f"{name}, sha256 {digest[:16]}") for name, digest in source.files),
    )
    blocks: list[Block] = [
        Table(caption="The data", head=("what", "value"), rows=rows, align="ll"),
    ]
    for title, sentences in (
        ("How they were read:", source.probe),
        ("Assumed of the robot:", source.robot_notes),
        (f"Masked, {counted(len(source.masked), 'note')}:", source.masked),
        ("Drift:", source.drift or ("no drift nest was measured: nothing tells whether anything "
                                    "moved but the errors in time",)),
        ("Warnings:", (*source.warnings, *calibration.warnings)),
    ):  # fmt: skip
        if sentences:
            blocks += [Text(title), Points(tuple(closed(text) for text in sentences))]
    return Section("data", "The data", tuple(blocks))


def record_section(calibration: Calibration, versions: Mapping[str, str]) -> Section:
    """What is needed to make this again."""
    table = versions_table(versions)
    text = (
        f"Seed {calibration.split.seed}. The same files, robot and options with the same versions "
        "give the same numbers."
    )
    return Section("record", "Versions", (Text(text), table))
