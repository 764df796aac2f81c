"""A calibration report's sections on errors: before and after, of joints, where, outliers."""

import numpy as np

from calib.identification.larger_noise import HONEST
from testbed.identify.calibration import Calibration
from testbed.identify.headline import mm
from testbed.identify.report import plots
from testbed.identify.results import map_of
from testbed.report.choice import choice_tables
from testbed.report.page import Block, Figure, Points, Section, Text
from testbed.report.plots_joints import joint_maps
from testbed.report.svg import HALF_WIDTH, WIDTH, on_phone
from testbed.units import sentences, significant


def accuracy_section(calibration: Calibration) -> Section:
    """The whole distribution before and after."""
    poses = "Held-out poses" if calibration.split.is_test.any() else "Training poses"
    again = calibration.measurements.rows(calibration.is_judged)
    several = " (root mean square if a pose has several rows)" * (len(again) > again.n_poses)
    caption = (
        f"{poses} by the size of their error{several}, with the noise of the reading. Dashed: "
        "means. R95: the believed radius, of the mean tool point without that noise. Outer bars "
        "count what lies beyond the axis."
    )
    drawn = plots.histogram(calibration)
    figure = Figure(caption, drawn, phone=on_phone(plots.histogram, calibration))
    return Section("accuracy", "Before and after", (figure,))


def joint_section(calibration: Calibration) -> Section | None:
    """Which joint errors the model has, which were offered, and how each joint turns."""
    choice, found = calibration.choice, map_of(calibration)
    if not choice.offered and (found is None or choice.chosen != "extended"):
        return None
    blocks: list[Block] = [
        Text(
            "Joint errors are errors that no length or angle of the links can describe: sag, and "
            "waves of gears and encoders. A joint map contains all waves up to 32 per turn."
        )
    ]
    blocks += choice_tables(choice.offered, choice.steps)
    if found is not None and choice.chosen == "extended":
        blocks.append(
            Figure(
                "How far each joint turns beyond its command; the band is 2 u. Where a joint was "
                "not moved, only the prior determines the curve. The numbers are in joint_map.csv.",
                joint_maps(found.joints, found.angle, found.turn, found.u),
                "half",
            )
        )
    return Section("joints", "Joint errors", tuple(blocks))


def residual_section(calibration: Calibration) -> Section:
    """Where the errors are: by joint, in time, over the workspace."""
    low, high = plots.shade_steps(calibration)
    shown = "held-out rows" if calibration.split.is_test.any() else "training rows"
    medians = plots.has_medians(calibration)
    temperature = calibration.conditions.temperature
    warmed = temperature is not None and bool(np.ptp(temperature) > 0)
    by_order = Figure(
        "Error after calibration in the order of measuring"
        f"{f'; line: running median of the {shown}' * medians}. A trend or a step suggests "
        "that something moved, or that neighboring poses were measured one after another.",
        plots.by_order(calibration, HALF_WIDTH if warmed else WIDTH),
        "half" if warmed else "full",
    )
    blocks: list[Block] = [
        Figure(
            f"Errors of the {shown} against each joint, before and after"
            f"{'; lines: running medians' * medians}. A wave that remains in one joint suggests "
            f"that this joint does not turn as modeled.{plots.thinned(calibration)}",
            plots.by_joint(calibration),
        ),
        by_order,
        Figure(
            f"Errors after calibration over the workspace, from pale (below {mm(low)} mm) to dark "
            f"(above {mm(high)} mm), with equally many rows in each shade. Square: the base.",
            plots.over_workspace(calibration),
        ),
    ]
    if warmed:  # beside the order, with which it often goes
        caption = f"Errors of the {shown} against the temperature."
        blocks.insert(2, Figure(caption, plots.by_temperature(calibration), "half"))
    return Section("errors", "Where the errors are", tuple(blocks))


def outlier_section(calibration: Calibration) -> Section:
    """Rows that do not fit, by name."""
    outliers = calibration.gross
    blocks: list[Block] = [Text("No training row is an outlier.")]
    if outliers.sentences:
        kept = "they were used, weighted by the chosen loss"
        part = "--loss squared uses them" if outliers.left_out.any() else kept
        blocks = [
            Text(f"Training rows that do not fit the others, worst first ({part}):"),
            Points(sentences(outliers.sentences)),
        ]
    if outliers.held_out_sentences:
        blocks += [
            Text("Held-out rows with large errors. All of them count in every figure:"),
            Points(sentences(outliers.held_out_sentences)),
        ]
    against = (
        "against the stated noise (chance of any false alarm 1 %)."
        if outliers.noise_factor <= HONEST
        else f"against the scatter of the residuals, which is "
        f"{significant(outliers.noise_factor, 2)} times the stated noise, so only gross errors are "
        "named."
    )
    judged = (
        f"Outliers are found by a robust fit and judged {against} A row is no outlier if the "
        "richest model offered, fitted without it, predicts it: then the chosen model fails "
        "there, and a warning says so."
    )
    return Section("outliers", "Outliers", (*blocks, Text(judged)))
