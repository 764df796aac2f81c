"""A calibration report's sections on what to believe of the tool point, and where it applies."""

from calib.arrays import Array
from testbed.identify.handback.delivered import Delivered, TargetStatement
from testbed.identify.records import Calibration
from testbed.identify.statements import statements_of
from testbed.identify.targets import target_words
from testbed.report.glossary import GLOSSARY
from testbed.report.page import Block, Points, Section, Table, Text, heads
from testbed.units import (
    DEG,
    MM,
    UM,
    fixed,
    probability,
    sentences,
    significant,
)

MOST_TARGETS = 30
"""Targets of a program in the report; all are in a file beside it."""


def belief_section(calibration: Calibration) -> Section:
    """Every statement on a new pose, what it promises, and whether it is believed."""
    proof = calibration.proof
    blocks: list[Block] = []
    if found := statements_of(calibration):
        blocks.append(
            Table(
                caption="What may be said of the tool point at a new pose like the "
                f"{len(calibration.stated_q)} "
                f"{'identified from' if calibration.elsewhere else 'judged here'}",
                head=("statement", "R95 um", "what it holds", "believe"),
                rows=tuple(
                    (one.name, significant(one.radius * UM), one.promise, one.use) for one in found
                ),
                align="lrll",
                strong=tuple(k for k, one in enumerate(found) if one.key.startswith("region")),
                note="R95: 3-D radius about the predicted point, 95 %. Noise: of the measurements, "
                "as stated.",
            )
        )
    blocks.append(Points(sentences(proof.trust.sentences)))
    if proof.questions.names:
        blocks.append(questions_table(calibration))
    blocks += [Text("Words used:"), Points(GLOSSARY)]
    return Section("belief", "What to believe, and why", tuple(blocks))


def questions_table(calibration: Calibration) -> Table:
    """Tests, together: one small p among several is no surprise."""
    asked, drifting = calibration.proof.questions, calibration.proof.drifting
    when = f"asked of the rows in the order of {calibration.order_told_by}"
    if drifting is not None and drifting.void:
        when = "not asked, because poses near each other were measured after each other"
    elif not calibration.order_told_by:
        when = "cannot be told from noise, because the order of the rows is not known"
    answers = ("not shown", "shown")
    rows = [
        (name, probability(p), probability(adjusted), answers[name in asked.said])
        for name, p, adjusted in zip(asked.names, asked.p_values, asked.adjusted, strict=True)
    ]
    rows.append(("residuals and held-out errors together", probability(asked.combined), "–", "–"))
    return Table(
        caption="What the readings were asked, together",
        head=("question", "p", "p for all (Holm)", "answer"),
        rows=tuple(rows),
        align="lrrl",
        note="p: chance of readings that say so if it is not so. shown: below 0.01 for all "
        "questions together; not shown is no proof, because no test sees a misfit below the noise. "
        f"drift: {when}. Last row: chi-square against the stated noise alone, after Fisher.",
    )


def reach_section(calibration: Calibration, delivered: Delivered) -> Section | None:
    """Where the statement applies: the held-out poses, and the targets of a program."""
    belief = calibration.proof.belief
    if belief is None:
        return None
    proven, q = belief.proven, calibration.stated_q
    here = proven.applies(q)
    room = proven.room
    rows = []
    for k, kind in enumerate(calibration.nominal.chain.kinds):
        scale, unit = (DEG, "deg") if kind == "revolute" else (MM, "mm")
        ends = (proven.low[k], proven.high[k], proven.low[k] - room[k], proven.high[k] + room[k])
        rows.append((str(k + 1), unit, *(fixed(float(end * scale), 0) for end in ends)))
    blocks: list[Block] = [
        Table(
            caption="Where the statement was proven",
            head=("joint", "unit", "proven from", "to", "warned below", "above"),
            rows=tuple(rows),
            align="llrrrr",
            note="Ranges over the "
            f"{len(q)} poses that the radius is of. Beyond the last two columns a target is warned "
            "of: nothing there tested what the model leaves out.",
        ),
        Text(
            f"Over these poses transfer g lies between {_ends(here.transfer)}, leverage h between "
            f"{_ends(here.leverage)}, each with mean one. Elsewhere the region grows with g, is "
            "warned of above 4, and refused above 9. Neither sees a payload, another tool or "
            "another temperature."
        ),
    ]
    if delivered.targets is not None:
        told = sentences(target_words(delivered.targets))
        blocks += [target_table(delivered.targets), Points(told)]
    return Section("reach", "Where it applies", tuple(blocks))


def target_table(found: TargetStatement) -> Table:
    """What is stated at the first targets of a program."""
    rows = []
    for k in range(min(len(found.why), MOST_TARGETS)):
        moves = found.radius_move[k : k + 1]
        radii = [significant(float(x) * UM) for x in (found.radius_mean[k], *moves)]
        cells = [*radii, "–"][:2] if found.stated[k] else ["–", "–"]
        reach = (significant(float(x[k]), 2) for x in (found.transfer, found.leverage))
        rows.append((str(k + 1), *cells, *reach, str(found.place[k]), found.why[k]))
    more = len(found.why) - len(rows)
    return Table(
        caption="What is stated at the targets of the corrected program",
        head=heads("target, R95 mean um, R95 one move um, transfer g, leverage h, place, why"),
        rows=tuple(rows),
        align="rrrrrll",
        size="small",
        note="R95: 3-D radius, 95 %; a dash: no region is stated there."
        + (f" {more} more targets are in the table beside the program." if more > 0 else ""),
    )


def _ends(values: Array) -> str:
    """Least and largest."""
    return " and ".join(significant(float(end), 2) for end in (values.min(), values.max()))
