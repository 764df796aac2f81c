"""The report's section on compensation: how much the calibration improves a program."""

from testbed.report.page import Block, Figure, Points, Section, Table, Text, Verdict
from testbed.report.svg import on_phone
from testbed.studies.compensation.plots import accuracy_by_pose, readings_of_one
from testbed.studies.compensation.study import STUDY, CompensationStudy
from testbed.studies.compensation.summary import Outcome, Typical, compared, outcomes
from testbed.studies.protocol import Answer
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.verdict import trial_verdict
from testbed.units import (
    MDEG,
    NARROW,
    UM,
    counted,
    fixed,
    micrometres,
    millimetres,
    percent,
    plain,
    significant,
    with_uncertainty,
)

WORDS = {"before": "as it was", "geometric": "geometric model", "chosen": "chosen model"}


def section(campaign: Campaign) -> Section:
    """Results of the corrected program in words, table and figures, and the procedure."""
    studies = STUDY.of(campaign)
    found = [outcomes(study) for study in studies]
    robots = counted(len(studies[0].extended), "robot")
    blocks: list[Block] = [
        Points(tuple(sentence for rows in found for sentence in sentences(rows))),
        outcome_table(found, robots),
        Figure(
            f"AP at each of the five poses: median over {robots} of each kind, 5 to 95 % of them. "
            "A figure near the noise floor shows only that the true value is smaller.",
            accuracy_by_pose(studies),
            phone=on_phone(accuracy_by_pose, studies),
        ),
        Figure(
            f"The {counted(studies[-1].cycles, 'cycle')} of the first {studies[-1].truth} robot at "
            "one pose, read minus commanded. The distance of their mean from the center is AP; "
            "their spread gives RP.",
            readings_of_one(studies[-1]),
        ),
        Text(procedure(studies[0])),
    ]
    return Section(
        "compensation", "What is the calibration worth to a program?", tuple(blocks), part="answer"
    )


def summary_table(studies: tuple[CompensationStudy, ...]) -> Table:
    """The table of the first screen: AP before and after on each kind of robot."""
    return Table(
        caption="AP after ISO 9283, µm: mean of five poses, median over "
        f"{counted(len(studies[0].extended), 'robot')} of each kind",
        head=("truth", *(WORDS[found.variant] for found in outcomes(studies[0])), "noise floor"),
        rows=tuple(
            (
                study.truth,
                *(with_u(found.ap) for found in outcomes(study)),
                micrometres(outcomes(study)[-1].ap.floor, 2),
            )
            for study in studies
        ),
        note="±: standard uncertainty of the mean of five poses of one robot.",
    )


def sentences(rows: tuple[Outcome, ...]) -> tuple[str, ...]:
    """The effect of the correction on one kind of robots, in words."""
    before, plain, chosen = rows
    said = [
        f"On {before.truth} robots the corrected program brings AP from {um(before.ap.value)} to "
        f"{um(chosen.ap.value)}. AP is the mean of five poses and the median of "
        f"{counted(before.robots, 'robot')}; its noise floor is {um(chosen.ap.floor)}, and without "
        f"noise it would be {um(chosen.true)}. {level(chosen)}"
    ]
    if chosen.extended and chosen.ap.value < plain.ap.value:
        said.append(
            f"The evidence supports the extended model on {percent(chosen.extended)} of the "
            f"{before.truth} robots; the geometric model alone would leave {um(plain.ap.value)}."
        )
    for found in (plain, chosen):
        worse = found.robots - found.better
        if worse:
            said.append(
                f"Correction by the {WORDS[found.variant]} made AP larger on "
                f"{counted(worse, f'{found.truth} robot')}."
            )
    if chosen.uncorrected:
        said.append(
            f"{counted(chosen.uncorrected, 'target')} of {before.truth} robots could not be "
            "corrected without reservation; they were executed unchanged."
        )
    return (*said, reached(chosen))


def reached(chosen: Outcome) -> str:
    """Whether a statement of the calibration applies at the corrected targets."""
    sizes = (
        f"transfer at most {significant(chosen.transfer, 2)}, leverage at most "
        f"{significant(chosen.leverage, 2)}"
    )
    if not chosen.edge + chosen.outside:
        return (
            f"All corrected targets of {chosen.truth} robots lie where held-out poses prove the "
            f"model ({sizes})."
        )
    said = []
    if chosen.edge:
        said.append(
            f"{counted(chosen.edge, 'target')} of {chosen.truth} robots lie at the edge of where "
            "held-out poses prove the model, and regions stated there are enlarged"
        )
    if chosen.outside:
        said.append(
            f"{counted(chosen.outside, 'target')} of {chosen.truth} robots lie outside, where no "
            "statement of the calibration applies"
        )
    return f"{'; '.join(said)} ({sizes})."


def level(chosen: Outcome) -> str:
    """Comparison of the remaining error with the errors of the model at held-out poses."""
    left, mean, p95 = chosen.true, chosen.held_out, chosen.held_out_p95
    inside = "within" if left <= p95 else "BEYOND"
    return (
        f"That is {inside} the errors of the model at held-out poses all over the box: "
        f"{um(mean)} on average, less than {um(p95)} at 95{NARROW}% of them."
    )


def outcome_table(found: list[tuple[Outcome, ...]], robots: str) -> Table:
    """Every figure with uncertainty and floor, by kind of robot and version of the program."""
    rows = []
    for three in found:
        for k, row in enumerate(three):
            rows.append(
                (
                    row.truth if k == 0 else "",
                    WORDS[row.variant],
                    with_u(row.ap),
                    micrometres(row.ap.floor, 2),
                    micrometres(row.true, 3),
                    with_u(row.rp),
                    micrometres(row.rp.floor, 2),
                    with_u(row.ad),
                    micrometres(row.ad.floor, 2),
                    with_u(row.angle, MDEG),
                    micrometres(row.held_out, 3),
                    f"{row.better} of {row.robots}" if k else "–",
                )
            )
    return Table(
        caption=f"ISO 9283 before and after, µm: mean of five poses, median over {robots}",
        head=(
            "truth", "program", "AP ± u", "floor", "true AP", "RP ± u", "floor", "AD ± u", "floor",
            "AP angle, mdeg", "held-out", "better",
        ),
        rows=tuple(rows),
        align="ll" + "r" * 10,
        size="small",
        strong=tuple(range(2, len(rows), 3)),  # the chosen model
        note="u: standard uncertainty of one robot's figure, from the scatter of the cycles and "
        "the errors that all readings share. floor: the figure of a perfect robot: AP and AD of "
        "one whose mean is right, RP of one that repeats perfectly. true AP: without noise, known "
        "in simulation only. AD: distance from pose 2 to pose 4. held-out: mean error of the "
        "model at held-out poses. better: robots with a smaller AP than before.",
    )  # fmt: skip


def procedure(study: CompensationStudy) -> str:
    """How the study was made."""
    side = fixed(float(abs(study.T[1, 1, 3] - study.T[2, 1, 3])) * 1e3, 0)
    return (
        f"Each robot was calibrated with the {counted(study.poses, 'pose')} of {study.trial}, one "
        "visit each. Then it ran a program of five joint targets, the center of a cube and four "
        f"points on the diagonals of its inclined plane ({side}{NARROW}mm apart in y), "
        f"{counted(study.cycles, 'cycle')} long, and every stop was read. The targets were "
        "replaced by those at which the identified robot has the commanded poses (numerical "
        "inverse kinematics inside the joint limits), and the program ran again. Correction and "
        "figures use only what the tracker measured. A target for a controller has no direction of "
        "approach, so the model that corrects it is offered no terms that depend on the last move "
        "of a joint. AP is the distance from the "
        "command to the mean of the readings, RP their mean distance from it plus three standard "
        "deviations, AD the error of the mean distance between two poses."
    )


def with_u(found: Typical, factor: float = UM) -> str:
    """A figure and its standard uncertainty in another unit; a length in um."""
    return " ± ".join(with_uncertainty(found.value * factor, found.uncertainty * factor))


def um(length: float) -> str:
    """A length in um or, from 100 um on, in mm."""
    if length < 1e-4:
        return f"{micrometres(length, 2)}{NARROW}µm"
    return f"{millimetres(length, 2)}{NARROW}mm"


def answer(campaign: Campaign) -> Answer:
    """The first screen: on which kinds of robots the corrected program is better, by how much."""
    studies = STUDY.of(campaign)
    found = [outcomes(study) for study in studies]
    said = compared(studies)
    better, open_ = said.count("better"), said.count("undecided")
    sign = "✓" if better == len(said) else "✗" if "worse" in said else "?"
    mark = f"{sign} The corrected program is better on {better} of "
    mark += f"{counted(len(said), 'kind')} of robots" + f", undecided on {open_}" * bool(open_)
    first, *rest = [text for rows in found for text in sentences(rows)]
    own = trial_verdict(campaign)
    reasons = tuple(plain(text) for text in (*rest, own.sentence))
    return Answer(
        Verdict(own.believable, own.contradicted, plain(first), reasons, mark),
        summary_table(studies),
        "Correct a program of your own with what measurements identify: truebed identify ROBOT "
        "DATA --program CSV. Where a figure is near its noise floor, only more cycles or a "
        "better tracker can show it smaller.",
    )
