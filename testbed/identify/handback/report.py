"""The report on what is handed back: the rule, what holds the numbers, the tool in use."""

import numpy as np

from testbed.identify.calibration import Calibration
from testbed.identify.handback.states import hand_back_words
from testbed.report.page import Block, Points, Section, Table, Text
from testbed.units import UM, significant

SPRUNG = (
    "A compliance, a moment or a tilt has no U of its own: measurements tell what springs bend "
    "together, and one number of them stands for what the model lacks as well."
)


def hand_back_section(calibration: Calibration) -> Section:
    """Which of all equivalent robots leaves, what holds its numbers, and the tool in use."""
    blocks: list[Block] = [
        Points(hand_back_words(calibration)),
        Text(
            "held by: measurements, where the readings tell it to within U; "
            "prior, where its nominal value and its tolerance say more than the readings do; only "
            "together with others, where these could stand for it and no prior holds them: it has "
            "no U; nominal, where base or tool take it up and it stays."
            + f" {SPRUNG}"
            * (calibration.fit.identification.model.joint_errors.springs is not None)
        ),
    ]
    found = calibration.handback.in_use
    if found is not None:
        ends = [
            (name, *(significant(float(size) * UM) for size in (np.median(at), at.max())))
            for name, at in (
                ("target that was measured", found.measured_at_poses),
                (found.tool.name, found.at_poses),
            )
        ]
        blocks += [
            Table(
                caption="The tool in use beside the target that was measured",
                head=("point", "R95 µm, median", "R95 µm, largest"),
                rows=tuple(ends),
                align="lrr",
                strong=(1,),
                note=f"Over the {len(found.at_poses)} poses that the statement is of; R95: 3-D "
                "radius of the mean of many moves, 95 %. Pose by pose in tool_in_use.csv.",
            ),
        ]
    return Section("handback", "What is handed back", tuple(blocks))
