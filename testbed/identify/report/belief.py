"""A calibration report's section on what to believe of the tool point."""

from testbed.identify.calibration import Calibration
from testbed.identify.statements import statements_of
from testbed.lengths import column_unit
from testbed.report.page import Block, Section, Table
from testbed.units import probability, significant

FIXED = "\u00a0"
"""A space at which no line ends: the sentences between short cells have the room."""


def belief_section(calibration: Calibration) -> Section | None:
    """Every statement on a new pose, what it promises, and whether it is believed."""
    proof = calibration.proof
    blocks: list[Block] = []
    if found := statements_of(calibration):
        scale, unit = column_unit([one.radius for one in found])
        blocks.append(
            Table(
                caption="What can be stated about the tool point at a new pose, like the "
                f"{len(calibration.stated_q)} "
                f"{'identified from' if calibration.elsewhere else 'judged here'}",
                head=("statement", f"R95{FIXED}{unit}", "what it contains", "status"),
                rows=tuple(
                    (
                        one.name,
                        significant(one.radius * scale),
                        one.promise,
                        one.use.replace(" ", FIXED),
                    )
                    for one in found
                ),
                align="lrll",
                strong=tuple(k for k, one in enumerate(found) if one.key.startswith("region")),
                note="R95: 3-D radius about the predicted point, 95 %. Noise: that of the "
                "measurements, as stated.",
            )
        )
    if proof.questions.names:
        blocks.append(questions_table(calibration))
    return Section("belief", "Uncertainty of the tool point", tuple(blocks)) if blocks else None


def questions_table(calibration: Calibration) -> Table:
    """Tests, together: one small p among several is no surprise."""
    asked, drifting = calibration.proof.questions, calibration.proof.drifting
    when = f"tested on the rows in the order of {calibration.order_told_by}"
    if drifting is not None and drifting.void:
        when = "not tested, because neighboring poses were measured one after another"
    elif drifting is not None and drifting.of_visits:
        when = f"tested on visits of the same poses, in the order of {calibration.order_told_by}"
    elif not calibration.order_told_by:
        when = "not tested, because the order of the rows is not known"
    answers = dict.fromkeys(asked.said, "shown")
    if calibration.moved is not None and "drift" in answers:
        answers["drift"] = "as what moved"
    rows = [
        (name, probability(p), probability(adjusted), answers.get(name, "not shown"))
        for name, p, adjusted in zip(asked.names, asked.p_values, asked.adjusted, strict=True)
    ]
    rows.append(("residuals and held-out errors together", probability(asked.combined), "–", "–"))
    return Table(
        caption="Tests of the readings, taken together",
        head=("question", "p", "p for all (Holm)", "answer"),
        rows=tuple(rows),
        align="lrrl",
        note="p: probability of such readings if there is nothing to find. shown: below 0.01 for "
        "all questions together. not shown is no proof, as no test detects a misfit below the "
        f"noise. drift: {when}. Last row: chi-square against the stated noise alone (Fisher).",
    )
