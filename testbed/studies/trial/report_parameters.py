"""The report's sections on parameters: each beside the truth, and which can be told apart."""

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from testbed.report.page import Block, Points, Section, Table, Text, heads
from testbed.studies.trial import plots
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.units import counted, in_units, sentence, significant, unit_of, with_uncertainty


def parameter_section(campaign: Campaign) -> Section:
    """Every parameter: nominal, identified, true, error, uncertainty."""
    blocks: list[Block] = [
        Text(
            "Angles in deg, lengths in mm. Values are rounded to the second digit of their own "
            "standard uncertainty. error = true minus identified. U = 2 u (k = 2). inside: the "
            "true value lies in the stated 95 % interval. Base and tool rows are displacements "
            "from the nominal frame, along and about its own axes. The true column is the truth "
            "seen through the parameters that were estimated: what redundant parameters really "
            "did is carried by the ones that stand for them." + others(campaign)
        )
    ]
    blocks += [
        parameter_table(campaign.setting.nominal, trial, estimate)
        for trial in plots.shown(campaign)
        for estimate in trial.estimates
    ]
    return Section("parameters", "Parameters", tuple(blocks), part="detail")


def others(campaign: Campaign) -> str:
    """Where the numbers of trials are that have no table; empty if there are none."""
    left = len(campaign.trials) - len(plots.shown(campaign))
    if not left:
        return ""
    return (
        f" Shown are the first {plots.MOST_PANELS} trials; the numbers of the other {left} are in "
        "arrays.npz."
    )


def parameter_table(nominal: RobotModel, trial: Trial, estimate: Estimate) -> Table:
    """Nominal, identified, true, error, U and inside for every parameter of one estimate."""
    found, seen = estimate.identification, estimate.comparison
    is_length = found.parameters.is_length[found.parameters.free_index]
    known = dict(zip(nominal.names, nominal_values(nominal), strict=True))
    at = np.array([known.get(name, 0.0) for name in found.names])
    values = (at, found.step, seen.true_step, found.standard_uncertainty, estimate.type_a)
    start, step, true, u, type_a = (in_units(numbers, is_length) for numbers in values)
    rows = []
    for k, name in enumerate(found.names):
        cells = with_uncertainty(
            start[k] + step[k], u[k], start[k] + true[k], true[k] - step[k], 2 * u[k]
        )
        identified, _, truth, error, expanded = cells
        unit = unit_of(bool(is_length[k]))
        repeated = with_uncertainty(0.0, type_a[k])[1]
        inside = "yes" if seen.parameter_inside[k] else "NO"
        at_start = f"{start[k]:g}".replace("-", "−")
        rows.append((name, unit, at_start, identified, truth, error, expanded, repeated, inside))
    return Table(
        caption=f"{trial.name}, {plots.mode_name(estimate)}: "
        f"{int(seen.parameter_inside.sum())} of {len(rows)} inside",
        head=heads(
            "parameter, unit, nominal, identified, true, error, U (k = 2), "
            f"s of {counted(len(estimate.repeated), 'repeat')}, inside"
        ),
        rows=tuple(rows),
        align="llrrrrrrl",
        size="small",
    )


def nominal_values(model: RobotModel) -> Array:
    """Nominal value (P,) of every number [m, rad]; zero for base and tool displacements."""
    return np.concatenate(
        [np.zeros(6), model.chain.links.ravel(), np.zeros(6), model.joint_errors.coefficients]
    )


def identifiable_section(campaign: Campaign) -> Section:
    """What the measurements can tell apart, in words."""
    trial = campaign.trials[0]
    blocks: list[Block] = []
    for estimate in trial.estimates:
        found = estimate.identification.reduction
        free = len(found.kept) + len(found.dropped)
        fixed_count = len(estimate.identification.parameters.names) - free
        text = (
            f"{plots.mode_name(estimate).capitalize()}: {counted(free, 'number')} free, "
            f"{fixed_count} held at their nominal values; rank {found.rank} (singular values above "
            f"{found.tolerance:.0e} of the largest count), condition "
            f"{significant(found.condition, 3)} of the kept columns. "
        )
        text += (
            "All free numbers can be told apart."
            if not found.dropped
            else f"{counted(len(found.dropped), 'number')} cannot be told from others and "
            f"{'is' if len(found.dropped) == 1 else 'are'} left nominal:"
        )
        blocks.append(Text(text))
        if found.sentences:
            blocks.append(Points(found.sentences))
        extra = estimate.identification.notes[len(found.sentences) :]
        if extra:
            blocks.append(Points(tuple(map(sentence, extra))))
    return Section("identifiable", "What can be identified", tuple(blocks))
