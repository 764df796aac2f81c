"""The report on what is handed back: the rule, what holds the numbers, the tool in use."""

import numpy as np

from testbed.identify.calibration import Calibration
from testbed.identify.handback.states import hand_back_words
from testbed.lengths import column_unit
from testbed.report.page import Block, Points, Section, Table, Text
from testbed.units import significant

SPRUNG = (
    "A compliance, a moment or a tilt has no U of its own: measurements only show what all springs "
    "bend together, and a single one of these numbers also absorbs what the model lacks."
)


def hand_back_section(calibration: Calibration, files: tuple[Block, ...]) -> Section:
    """Files, which of all equivalent robots they hold, what holds its numbers, the tool in use."""
    blocks: list[Block] = [
        *files,
        Points(hand_back_words(calibration)),
        Text(
            "held by: measurements, if the readings determine the number to within U; prior, if "
            "its nominal value and its tolerance say more than the readings do; only together with "
            "others, if these could replace it and no prior holds them (it then has no U); "
            "nominal, if base or tool take its part and it keeps its value."
            + f" {SPRUNG}"
            * (calibration.fit.identification.model.joint_errors.springs is not None)
        ),
    ]
    found = calibration.handback.in_use
    if found is not None:
        scale, unit = column_unit([*found.measured_at_poses, *found.at_poses])
        ends = [
            (name, *(significant(float(size) * scale) for size in (np.median(at), at.max())))
            for name, at in (
                ("measured target", found.measured_at_poses),
                (found.tool.name, found.at_poses),
            )
        ]
        blocks += [
            Table(
                caption="The tool in use compared with the measured target",
                head=("point", f"R95 {unit}, median", f"R95 {unit}, largest"),
                rows=tuple(ends),
                align="lrr",
                strong=(1,),
                note=f"Over the {len(found.at_poses)} poses of the statement. R95: 3-D radius of "
                "the mean of many moves, 95 %. tool_in_use.csv has it for every pose.",
            )
        ]
    return Section("handback", "What is handed back", tuple(blocks))
