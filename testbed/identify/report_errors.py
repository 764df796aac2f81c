"""A calibration report's sections on its errors: before and after, belief, where, outliers."""

import numpy as np

from calib.identification.outlier_search import HONEST
from calib.uncertainty.conformal import fewest_poses
from testbed.identify import plots
from testbed.identify.records import Calibration
from testbed.identify.words import held_out_poses, mm
from testbed.report.page import Block, Figure, Points, Section, Table, Text
from testbed.units import MM, counted, percent, probability, sentence, sentences, significant


def accuracy_section(calibration: Calibration) -> Section:
    """The whole distribution before and after."""
    rows = "Held-out rows" if calibration.split.is_test.any() else "Rows identified from"
    caption = (
        f"{rows} by the size of their error; dashed: the means. What lies beyond the axis is "
        "counted in the last bar."
    )
    figure = Figure(caption, plots.histogram(calibration))
    return Section("accuracy", "Before and after", (figure,))


def belief_section(calibration: Calibration) -> Section:
    """Every statement on a new pose, and whether to believe it."""
    proof = calibration.proof
    rows = []
    if proof.held_out is not None:
        u = np.sqrt(np.trace(proof.held_out.predicted, axis1=1, axis2=2))
        p = probability(proof.held_out.p_value)
        contradicted = calibration.contradicted and not calibration.not_linear
        rows.append(
            (
                "model",
                "model, from the stated noise",
                f"u = {significant(float(np.sqrt(np.mean(u**2))) * MM, 2)}",
                "one sd, if the model is right",
                f"contradicted: held-out p {p}"
                if contradicted
                else f"held-out errors agree, p {p}",
            )
        )
    if proof.discrepancy is not None:
        u3 = float(np.sqrt(np.trace(proof.discrepancy.covariance))) * MM
        poses = counted(proof.discrepancy.n_poses, "pose")
        rows.append(
            (
                "discrepancy",
                "discrepancy beyond the model",
                f"u = {significant(u3, 2)}",
                "one sd, approximate",
                f"from {poses}",
            )
        )
    if proof.conformal is not None:
        low, high = map(percent, proof.conformal.content_range())
        rows.append(
            (
                "conformal",
                "held-out radius (split conformal)",
                f"radius {significant(proof.conformal.radius * MM)}",
                percent(proof.conformal.probability),
                f"needs no model; this set: {low} to {high}",
            )
        )
    blocks: list[Block] = []
    if rows:
        table = Table(
            caption="What may be said of the tool at a new pose like the held-out ones",
            head=("statement", "size mm", "content", "test", "believe"),
            rows=tuple(
                (*row, "yes" if name == proof.trust.believe else "NO") for name, *row in rows
            ),
            align="lllll",
            note="u: 3-D standard uncertainty, root of the sum over x, y, z.",
        )
        blocks.append(table)
    blocks.append(Points(sentences(proof.trust.sentences)))
    count, needed = held_out_poses(calibration), fewest_poses()
    if count < needed:
        few = f"{counted(count, 'held-out pose')}: a radius for 95 % needs at least {needed}."
        blocks.append(Text(few))
    if proof.bootstrap is not None:
        blocks.append(Text(sentence(proof.bootstrap.sentence, keep_name=True)))
    return Section("belief", "What to believe, and why", tuple(blocks))


def residual_section(calibration: Calibration) -> Section:
    """Where the errors are: by joint, in time, over the workspace."""
    low, high = plots.shade_steps(calibration)
    shown = "held-out rows" if calibration.split.is_test.any() else "rows identified from"
    blocks: list[Block] = [
        Figure(
            f"Errors of the {shown} against each joint, before and after; lines: running medians. "
            "A wave that is left in one joint says that this joint does not turn as modeled."
            f"{plots.thinned(calibration)}",
            plots.by_joint(calibration),
        ),
        Figure(
            "Error after calibration in the order of measuring; a trend or a step says that "
            "something moved.",
            plots.by_order(calibration),
        ),
        Figure(
            f"Errors of the {shown} against the place of the tool in the base frame.",
            plots.by_place(calibration),
        ),
        Figure(
            f"Where the errors after calibration are, from pale, below {mm(low)} mm, to dark, "
            f"above {mm(high)} mm, equally many rows in each shade; square: the base.",
            plots.over_workspace(calibration),
        ),
    ]
    temperature = calibration.conditions.temperature
    if temperature is not None and np.ptp(temperature) > 0:
        caption = f"Errors of the {shown} against the temperature."
        blocks.append(Figure(caption, plots.by_temperature(calibration)))
    return Section("errors", "Where the errors are", tuple(blocks))


def outlier_section(calibration: Calibration) -> Section:
    """Rows that do not fit, by name."""
    outliers = calibration.gross
    blocks: list[Block] = [Text("Every training row fits the others.")]
    if outliers.sentences:
        rows = counted(len(outliers.sentences), "training row")
        part = (
            "They took no part in the identification; --loss squared keeps them."
            if outliers.left_out.any()
            else "They took part as the chosen loss weighs them."
        )
        do = "does" if len(outliers.sentences) == 1 else "do"
        blocks = [
            Text(f"{rows} {do} not fit the others, worst first. {part}"),
            Points(sentences(outliers.sentences)),
        ]
    if outliers.held_out_sentences:
        blocks += [
            Text("Held-out rows far off; none that was read is left out of any figure:"),
            Points(sentences(outliers.held_out_sentences)),
        ]
    against = (
        "against the stated noise (chance of any false alarm 1 %)."
        if outliers.noise_factor <= HONEST
        else f"against the scatter of the residuals, which is "
        f"{significant(outliers.noise_factor, 2)} times the stated noise; only gross errors are "
        "named then."
    )
    judged = f"Rows are judged by a robust fit that they cannot pull, {against}"
    return Section("outliers", "Outliers", (*blocks, Text(judged)))
