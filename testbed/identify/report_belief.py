"""A calibration report's sections on what to believe of the tool point, and where it applies."""

from calib.arrays import Array
from testbed.identify.records import Calibration
from testbed.identify.statements import stated_joints, statements_of
from testbed.report.page import Block, Points, Section, Table, Text
from testbed.units import (
    DEG,
    MM,
    UM,
    fixed,
    probability,
    sentences,
    significant,
)

GLOSSARY = (
    "R95: radius of the ball about the predicted tool point that holds the true one with 95 % "
    "probability; of a distance in space, in three dimensions.",
    "u, U: standard uncertainty; U = 2 u of one number holds it with 95.4 %. In three dimensions "
    "the ellipsoid of k = 2 would hold 73.9 %, so that no U of a point is stated by k alone.",
    "k: factor of the region, 2.80 for 95 % in three dimensions, more where the guard asks for it.",
    "misfit: what the true robot does and the model cannot; in um per axis, one standard "
    "deviation. What could hide behind the noise is in the region.",
    "guard: held-out poses whose errors may raise k, so that the region would have held 95 % of "
    "them; it needs 19.",
    "transfer g: how much of what the model leaves out reaches a target, as against the held-out "
    "poses; leverage h: the same of the noise. The region grows with g; above 9 there is none.",
)


def belief_section(calibration: Calibration) -> Section:
    """Every statement on a new pose, what it promises, and whether it is believed."""
    proof = calibration.proof
    blocks: list[Block] = []
    if found := statements_of(calibration):
        blocks.append(
            Table(
                caption="What may be said of the tool point at a new pose like the "
                f"{len(stated_joints(calibration))} "
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
    asked = calibration.proof.questions
    when = "their times" if calibration.time is not None else "the files, which give no time"
    rows = [
        (name, probability(p), probability(adjusted), "said" if name in asked.said else "–")
        for name, p, adjusted in zip(asked.names, asked.p_values, asked.adjusted, strict=True)
    ]
    rows.append(("residuals and held-out errors together", probability(asked.combined), "–", "–"))
    return Table(
        caption="What the readings were asked, together",
        head=("question", "p", "p for all (Holm)", "answer"),
        rows=tuple(rows),
        align="lrrl",
        note="p: chance of readings that say so if it is not so. said: below 0.01 for all "
        "questions together. No test sees a misfit below the noise: no answer is no proof. drift: "
        f"asked of the rows in the order of {when}; on a tour of neighbors, misfit passes for "
        "drift. Last row: chi-square against the stated noise alone, combined after Fisher.",
    )


def reach_section(calibration: Calibration) -> Section | None:
    """Where the statement applies: the held-out poses, and how far joints may leave them."""
    belief = calibration.proof.belief
    if belief is None:
        return None
    proven, q = belief.proven, stated_joints(calibration)
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
    return Section("reach", "Where it applies", tuple(blocks))


def _ends(values: Array) -> str:
    """Least and largest."""
    return " and ".join(significant(float(end), 2) for end in (values.min(), values.max()))
